"""Certificates of families: what every signal does, proved, written, and checked.

A family of one mode with known weights is a graph, and :func:`ptcc_certify.certify` certifies it as one.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lmi import search_time as deadline
from lmi.exact.decimal_rounding import down
from lmi.search_time import share_of_time
from ptcc_certify.certificate.certificate_data import Source
from ptcc_certify.certificate.checking import check
from ptcc_certify.certificate.family_verdict import assess_family
from ptcc_certify.certificate.format_family import family_document
from ptcc_certify.certificate.format_vectors import side_files
from ptcc_certify.certificate.request import (
    Expectations,
    listener,
    origins_of,
    read_expectations,
    read_initial_state,
    read_seconds,
)
from ptcc_certify.certificate.verdict import Assessment
from ptcc_certify.checker import CheckReport
from ptcc_certify.checker.family_bounds import deviations, final_interval, peaks
from ptcc_certify.checker.reading import Interval
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.display_hook import Shown, family_summary
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.io import write_atomically
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY, analyse
from ptcc_certify.lyapunov.family_function import FamilyFunction
from ptcc_certify.lyapunov.family_rate_upper_bound import FamilyRateBound, prove_family_rate_bound
from ptcc_certify.lyapunov.family_search import FamilySearch, search_family
from ptcc_certify.lyapunov.follower_function import FollowerFunction, follower_functions
from ptcc_certify.lyapunov.quotient import Quotient
from ptcc_certify.protocols import Protocol
from ptcc_certify.protocols.base import refuse_no_protocol
from ptcc_certify.theorems.family_behaviour import DEPENDS, FamilyComponent, decide
from ptcc_certify.theorems.family_groups import FamilyGroups

STEPS = ("the decision", "upper bound on the decay rate", "Lyapunov functions", "independent check")
#: GB that the check may take for families whose members have more nodes than are solved for exactly.
LARGE_MEMORY = 16
#: Share of the upper bound that ends the search, and share of the time that the bound may take at first.
_ENOUGH, _BOUND_SHARE = Fraction(99, 100), 0.3


@dataclass(frozen=True, eq=False)
class ComponentProof:
    """What is proved of one component beside its behaviour.

    Attributes
    ----------
    component : FamilyComponent
    functions : tuple of FamilyFunction
        Proved, the largest rate first; nodes are numbered within the component.
    upper_bound : FamilyRateBound or None
        No rate for every signal is larger.
    """

    component: FamilyComponent
    functions: tuple[FamilyFunction | FollowerFunction, ...] = ()
    upper_bound: FamilyRateBound | None = None

    @property
    def rate(self) -> Fraction | None:
        """The largest proved rate for every signal; None if there is none."""
        return max((V.rate for V in self.functions if V.rate > 0), default=None)


@dataclass(frozen=True)
class BoundFunction:
    """A function of a component as the formulas of the bounds take it: by nodes of the component."""

    quotient: Quotient
    function: FamilyFunction

    @property
    def rate(self) -> Fraction:
        """The rate for every signal."""
        return self.function.rate

    @property
    def inputs(self) -> Mapping[int, Fraction]:
        """``|(L X)_k|^2 <= inputs[k] V``."""
        return dict(enumerate(self.function.input_constants))

    @property
    def coordinates(self) -> Mapping[int, Fraction]:
        """``xi_k^2 <= coordinates[k] V``."""
        return dict(zip(self.function.nodes, self.function.coordinate_constants, strict=True))

    def value(self, x: Sequence[Fraction]) -> Fraction:
        """Return ``V`` of a state of the component."""
        return self.function.value(self.quotient.coordinates(x))


@dataclass(frozen=True, eq=False, repr=False)
class FamilyCertificate(Shown):
    """What a protocol does on a family of graphs, whatever the signal, with its proof.

    Attributes
    ----------
    family : Family
    protocol : NominalProtocol
    parts : tuple of ComponentProof
        One for each weakly connected component of all edges of all modes.
    initial_state : tuple of N Fraction, or None
    expectations : Expectations
    notes : tuple of str
    source : Source or None
        The file that it was read from.
    origins : mapping of str to str
        What ``"graph"`` is called, and where ``"x(0)"`` comes from.

    References
    ----------
    docs/theory/families.md.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> day = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    >>> night = SignedDigraph.from_edges([("c", "a", -2), ("a", "b", 1)])
    >>> protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
    >>> certify_family(Family.switching({"day": day, "night": night}), protocol, [1, 2, 3])
    FamilyCertificate(bipartite consensus for every signal, rate 0.955184, certified)
    """

    family: Family
    protocol: Protocol
    parts: tuple[ComponentProof, ...]
    initial_state: tuple[Fraction, ...] | None = None
    expectations: Expectations = field(default_factory=Expectations)
    notes: tuple[str, ...] = ()
    source: Source | None = None
    origins: Mapping[str, str] = field(default_factory=dict)

    @property
    def common(self) -> bool:
        """Whether every component keeps one kernel, so that every signal brings all agents to rest."""
        return all(part.component.behaviour not in (None, DEPENDS) for part in self.parts)

    @property
    def unbounded(self) -> bool:
        """Whether the input is proved to grow without limit for some signal and some initial state.

        Where rest states differ, or where the upper bound of the rate times ``rho2 kappa / 2`` is below 1.
        """
        pole, bounds = self.protocol.gain.pole, [part.upper_bound for part in self.parts]
        slow = any(bound is not None and bound.value * pole < 2 for bound in bounds)
        return slow or any(part.component.behaviour == DEPENDS for part in self.parts)

    @cached_property
    def assessment(self) -> Assessment:
        """The graded verdict: what became of what was asked, whether the bound is useful, and the exit code."""
        return assess_family(self)

    def summary(self) -> str:
        """Return what ``ptcc certify`` prints of it."""
        return family_summary(self)

    @property
    def behaviours(self) -> tuple[str, ...]:
        """What every component does for every signal."""
        return tuple(str(part.component.behaviour) for part in self.parts)

    @property
    def rate(self) -> Fraction | None:
        """The rate that every component has for every signal; None if some has none that is proved."""
        rates = [part.rate for part in self.parts if part.component.nodes.size > 1]
        return None if None in rates else min((r for r in rates if r is not None), default=None)

    @property
    def upper_bound(self) -> Fraction | None:
        """No rate for every signal is larger; None if none is proved."""
        return min((part.upper_bound.value for part in self.parts if part.upper_bound is not None), default=None)

    # ------------------------------------------------------------------ bounds

    def _bound_functions(self, part: ComponentProof) -> list[BoundFunction | FollowerFunction]:
        result: list[BoundFunction | FollowerFunction] = []
        for V in part.functions:
            result.append(BoundFunction(Quotient.of(part.component), V) if isinstance(V, FamilyFunction) else V)
        return result

    @cached_property
    def final_states(self) -> tuple[Interval | None, ...] | None:
        """Ends between which each agent is at the deadline, for every signal; None where no limit is claimed."""
        if self.initial_state is None:
            return None
        result: list[Interval | None] = [None] * self.family.n_nodes
        for part in self.parts:
            nodes = part.component.nodes.tolist()
            x = [self.initial_state[v] for v in nodes]
            for k, ends in self._final(part, x).items():
                result[nodes[k]] = ends
        return tuple(result)

    def _final(self, part: ComponentProof, x: list[Fraction]) -> Mapping[int, Interval | None]:
        component, n = part.component, len(x)
        if component.behaviour == STABILITY:
            return dict.fromkeys(range(n), (Fraction(0), Fraction(0)))
        if component.behaviour == DEPENDS:
            return dict.fromkeys(range(n))
        moves = deviations(self._bound_functions(part), False, x)
        if component.behaviour == BIPARTITE_CONSENSUS:
            assert component.gauge is not None
            camps = dict(enumerate(component.gauge.tolist()))
            return dict(final_interval(range(n), camps, FamilyGroups(component).sources.tolist(), moves, x))
        largest = max(map(abs, x))
        return {
            k: (max(-largest, x[k] - moves.get(k, 2 * largest)), min(largest, x[k] + moves.get(k, 2 * largest)))
            for k in range(n)
        }

    @property
    def bounded(self) -> bool | None:
        """Whether the input is proved bounded for every signal and initial state; None if it is not."""
        pole = self.protocol.gain.pole
        held = (
            part.component.nodes.size == 1 or any(V.rate * pole >= 2 for V in part.functions) for part in self.parts
        )
        return True if all(held) else None

    @cached_property
    def input_peaks(self) -> tuple[Fraction, ...] | None:
        """Bounds of ``|u_k|`` for every signal; None if none are proved."""
        if self.initial_state is None or not self.bounded:
            return None
        result = [Fraction(0)] * self.family.n_nodes
        gains = self.protocol.parameters
        for part in self.parts:
            nodes = part.component.nodes.tolist()
            x = [self.initial_state[v] for v in nodes]
            for k, bound in peaks(self._bound_functions(part), gains, x).items():
                result[nodes[k]] = bound
        return tuple(result)

    def deviation_bound(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound of ``|x_k(t) - x_k(T)|`` for every agent and every signal, from the initial state.

        Parameters
        ----------
        remaining : (M,) array_like
            ``1 - t/T`` at the instants, in [0, 1].

        Returns
        -------
        (N, M) array
            Infinite where nothing is proved.

        Raises
        ------
        ParameterError
            There is no initial state.
        """
        if self.initial_state is None:
            raise ParameterError("the certificate has no initial state; certify the family with x0")
        clock = np.asarray(self.protocol.gain.clock_at_remaining(remaining))
        bounds = np.full((self.family.n_nodes, clock.size), np.inf)
        for part in self.parts:
            nodes = part.component.nodes
            if nodes.size == 1:
                bounds[nodes] = 0
            x = [self.initial_state[v] for v in nodes.tolist()]
            for V in self._bound_functions(part):
                moves = deviations([V], part.component.behaviour == STABILITY, x)
                if moves:
                    size = np.array([float(moves[k]) for k in range(nodes.size)]) * (1 + 1e-12)
                    decay = np.exp(-float(V.rate) * (1 - 1e-12) / 2 * clock)
                    bounds[nodes] = np.minimum(bounds[nodes], np.multiply.outer(size, decay))
        return bounds

    # ------------------------------------------------------------------ the file

    @cached_property
    def _document(self) -> tuple[dict[str, Any], Mapping[str, bytes]]:
        """The JSON, and its side files by name."""
        if self.source is not None:
            return dict(self.source.document), side_files(self.source.document, self.source.path.parent)
        document, out = family_document(self, files=True)
        return document, out.files

    @cached_property
    def checked(self) -> CheckReport | None:
        """What the independent check says; None where a behaviour is not decided."""
        if self.source is not None:
            return self.source.report
        if any(part.component.behaviour is None for part in self.parts):
            return None
        document, files = self._document
        return check(document, files=files, memory=1 if self.family.n_nodes <= EXACT_NODES else LARGE_MEMORY)

    def for_check(self) -> tuple[Mapping[str, Any], Mapping[str, bytes]]:
        """Return the JSON and the contents of its side files, as the independent check takes them."""
        return self._document

    @property
    def verdict(self) -> str:
        """``certified`` if the independent check accepts it, else ``undecided``."""
        return "certified" if self.checked is not None and self.checked.accepted else "undecided"

    def to_dict(self) -> dict[str, Any]:
        """Return the certificate as JSON-ready data, without side files: a copy."""
        document, files = self._document
        return json.loads(json.dumps(family_document(self)[0] if files and self.source is None else document))

    def save(self, path: str | Path) -> None:
        """Write the certificate; the file appears whole or not at all.

        Vectors of more than 50,000 entries go to ``.npy`` files beside it, which are written first.

        Raises
        ------
        FormatError
            The file cannot be written.
        ParameterError
            The certificate is undecided: there is nothing to check.
        """
        if self.verdict != "certified":
            raise ParameterError("nothing is certified of this family, so that no certificate is written")
        document, files = self._document
        for name, content in files.items():
            write_atomically(Path(path).parent / name, content)
        text = json.dumps(document, indent=1, ensure_ascii=False) + "\n"
        write_atomically(Path(path), text.encode("utf-8", "backslashreplace"))

    def __repr__(self) -> str:
        behaviour = self.behaviours[0] if len(self.parts) == 1 else f"{len(self.parts)} components"
        behaviour += " for every signal" if behaviour != DEPENDS else ""
        rate = "none" if self.rate is None else down(self.rate)
        return f"FamilyCertificate({behaviour}, rate {rate}, {self.verdict})"


def certify_family(
    family: Family,
    protocol: Protocol,
    x0: Any = None,
    *,
    time_limit: float | None = None,
    expectations: Expectations | str | None = None,
    origins: Mapping[str, str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> FamilyCertificate:
    """Certify what the nominal protocol does on a family of graphs, whatever the signal.

    Parameters
    ----------
    family : Family
    protocol : NominalProtocol
        With ``rho2 > 0``.
    x0 : state-like, optional
        The initial state; without it no final states and no peaks.
    time_limit : float, optional
        Seconds of wall time for the searches; without it 60, and 1 more for every 1,000 nodes.
    expectations : Expectations or str, optional
    origins : mapping of str to str, optional
        See :func:`ptcc_certify.certify`.
    progress : callable
        Is told each step as it begins.

    Returns
    -------
    FamilyCertificate

    Raises
    ------
    ParameterError
        No protocol, another than the nominal one, or an initial state that does not fit.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> unsure = Family.from_intervals([("a", "b", "0.8", "1.2"), ("b", "a", "-1.2", "-0.8")])
    >>> cert = certify_family(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3))
    >>> cert.behaviours, cert.verdict, cert.bounded
    (('stability',), 'certified', True)
    """
    refuse_no_protocol(protocol)
    if protocol.reaching is not None:
        raise ParameterError("families are certified under the nominal protocol; give NominalProtocol(..)")
    if not protocol.prescribed:
        raise ParameterError("rho2 = 0 gives no deadline: nothing is prescribed to certify; give rho2 > 0")
    asked, seconds, progress = read_expectations(expectations), read_seconds(time_limit, family), listener(progress)
    initial_state = None if x0 is None else read_initial_state(analyse(family.modes[0].mandatory), x0, "x0")
    progress(STEPS[0])
    components = decide(family)
    parts, notes = [], list(family.notes)
    with deadline.time_limit(seconds):
        for component in components:
            parts.append(_prove(component, notes, progress))
    progress(STEPS[3])
    told = origins_of(None, x0, None) | dict(origins or {})
    return FamilyCertificate(
        family, protocol, tuple(parts), initial_state, asked, tuple(dict.fromkeys(notes)), origins=told
    )


def _prove(component: FamilyComponent, notes: list[str], progress: Callable[[str], None]) -> ComponentProof:
    if component.kernel is None or component.nodes.size == 1:
        return ComponentProof(component)
    if component.nodes.size > EXACT_NODES:
        progress(STEPS[2])
        with share_of_time(1.0, STEPS[2], notes):
            return ComponentProof(component, tuple(follower_functions(component, notes=notes)))
        return ComponentProof(component)
    quotient = Quotient.of(component)
    bound, search = None, FamilySearch()
    progress(STEPS[1])
    with share_of_time(_BOUND_SHARE, STEPS[1], notes):
        bound = prove_family_rate_bound(quotient)
    progress(STEPS[2])
    with share_of_time(1.0, STEPS[2], notes):
        search = search_family(quotient, enough=None if bound is None else _ENOUGH * bound.value)
    notes += [*search.notes, *(f"{name}: cut off by the time limit" for name in search.cut_off)]
    rate = max((V.rate for V in search.functions), default=Fraction(0))
    if bound is not None and search.functions and rate < _ENOUGH * bound.value:
        with share_of_time(1.0, STEPS[1], notes):  # signals played against what was found
            again = prove_family_rate_bound(quotient, search.functions)
            bound = bound if again is None else min(bound, again, key=lambda b: b.value)
    return ComponentProof(component, search.functions, bound)
