"""Certificates of families: what every signal does, proved, written, and checked.

A family of one mode with known weights is a graph, and :func:`ptcc_certify.certify` certifies it as one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi import search_time as deadline
from lmi.blas_threads import one_thread
from lmi.errors import NoCertificate
from lmi.exact.decimal_rounding import counted, down
from lmi.search_time import share_of_time
from ptcc_certify.bounds.attracting_box import AttractingBox, box_of_family
from ptcc_certify.bounds.envelope import FRACTIONS
from ptcc_certify.bounds.kept_means import with_means
from ptcc_certify.bounds.late_messages import bound_late
from ptcc_certify.bounds.tracking import bound_tracking
from ptcc_certify.certificate.agents_table import agents_table
from ptcc_certify.certificate.certificate_file import Recorded
from ptcc_certify.certificate.document import family_document
from ptcc_certify.certificate.family_content import ComponentProof, FamilyContent
from ptcc_certify.certificate.functions import ProvedFunction
from ptcc_certify.certificate.request import (
    listener,
    origins_of,
    read_initial_state,
    read_seconds,
    read_sliding_variable,
)
from ptcc_certify.certificate.restricted_claims import RateClaim
from ptcc_certify.certificate.restricted_search import STEP, claims_for, require_nominal
from ptcc_certify.checker import CheckReport
from ptcc_certify.checker.family import MANY_MODES
from ptcc_certify.checker.family_rows import MANY_FUNCTIONS
from ptcc_certify.checker.matrix_products import LARGEST_ROWS
from ptcc_certify.checker.reading import Interval
from ptcc_certify.checker.restricted_signals import reachable_bounds
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.graphs.size_limits import EXACT_NODES, ONE_THREAD_NODES
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY, analyse
from ptcc_certify.lyapunov.aimed_forms import Aim, aimed_functions
from ptcc_certify.lyapunov.family_function import FamilyFunction
from ptcc_certify.lyapunov.family_rate_upper_bound import prove_family_rate_bound
from ptcc_certify.lyapunov.family_search import CLOSED_ROWS, FULL_ROWS, FamilySearch, search_family
from ptcc_certify.lyapunov.follower_function import LOSSES, FollowerFunction, follower_functions
from ptcc_certify.lyapunov.quotient import Quotient
from ptcc_certify.lyapunov.squares_function import SquaresFunction, squares_function
from ptcc_certify.model import Protocol
from ptcc_certify.model.asks import Expectations, read_expectations
from ptcc_certify.model.base import refuse_no_protocol
from ptcc_certify.model.initial_state import InitialState
from ptcc_certify.model.late_messages import LateMessages
from ptcc_certify.model.moving_leaders import MovingLeaders
from ptcc_certify.model.restricted_signals import ClockShares, JointWindows, SignalClass, read_signal
from ptcc_certify.theorems.family_behaviour import DEPENDS, FamilyComponent, decide
from ptcc_certify.theorems.joint_windows import refuse_impossible_windows

if TYPE_CHECKING:
    import pandas as pd

STEPS = ("the decision", "upper bound on the decay rate", "Lyapunov functions", STEP, "independent check")
BOXES = "boxes of followers"
#: Share of the upper bound that ends the search, and share of the time that the bound may take at first.
_ENOUGH, _BOUND_SHARE = Fraction(99, 100), 0.3
#: Agents and edges of a component up to which ends are told between which each agent stays.
_MANY = 200_000


@dataclass(frozen=True, eq=False, repr=False)
class FamilyCertificate(FamilyContent, Recorded):
    """What a protocol does on a family of graphs, whatever the signal, with its proof.

    Attributes
    ----------
    family : Family
    protocol : NominalProtocol or SlidingModeProtocol
    parts : tuple of ComponentProof
        One for each weakly connected component of all edges of all modes.
    initial_state : tuple of N Fraction, or None
    sigma0 : tuple of N Fraction, or None
        ``sigma(0)``, under the sliding-mode protocol.
    reaching : tuple of N ReachingTime, or None
        Proved reaching times, which no graph enters.
    disturbance : str or None
        What a run met, as a file tells; no part of the claim.
    expectations : Expectations
    notes : tuple of str
    source : Source or None
        The file that it was read from.
    origins : mapping of str to str
        What ``"graph"`` is called, and where ``"x(0)"`` comes from.
    scenario : mapping or None
        The scenario file that asked for it, as JSON; it is kept, and nothing is read from it.
    signal : "any", "constant", DwellTime, JointWindows or ClockShares
        The signals that it was asked for.
    restricted : tuple of Claim
        What holds for these beside what holds for every signal.
    boxes : mapping of int to AttractingBox
        Where every signal brings the followers of components that depend on it, by the numbers of these.
    ranges : mapping of int to tuple of (Fraction, Fraction)
        Between which ends every signal keeps each agent of these components, at all times.

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

    @property
    def refused(self) -> bool:
        """Whether the check does not accept the functions that were found: nothing that follows from them is told."""
        return self.verdict != "certified" and any(part.functions for part in self.parts)

    def beside(self, messages: LateMessages | None, leaders: MovingLeaders | None) -> FamilyCertificate:
        """Return the certificate with what is proved for every signal where messages are late, or leaders move.

        Raises
        ------
        ParameterError
            Sliding variables move.
        HypothesisError
            Where followers are drawn to depends on the signal, or leaders hear somebody in some mode.
        """
        state, finals = self.initial_state, self.final_states
        if not self.direct:
            raise ParameterError("sigma0", "late messages ask for 0, so that no sliding variable moves; leave it out")
        known = [] if finals is None else [pair for pair in finals if pair is not None]
        middles = [((low + high) / 2, (high - low) / 2) for low, high in known]
        ends = middles if len(known) == self.family.n_nodes else None
        late, tracking = None, None
        if messages is not None:
            late = bound_late(self.family, self.protocol, messages, state, ends, leaders)
        elif leaders is not None:
            with suppress(NoCertificate):
                tracking = bound_tracking(self.family, self.protocol, leaders, state, ends)
        return replace(self, late=late, tracking=tracking, asked_leaders=leaders)

    @property
    def main_figure(self) -> str:
        """The figure that is drawn where none is named: the decay, or the states where nothing of one is proved.

        With late messages what is left, while leaders move how they are tracked.
        """
        if self.late is not None:
            return "late" if self.late.rows else "graph"
        if self.leaders_move:
            return "graph" if self.tracking is None else "tracking"
        nothing = self.initial_state is not None and not np.isfinite(self.deviation_bound([0.5])).any()
        return "states" if nothing else "decay"

    @property
    def checkable(self) -> bool:
        """Whether every behaviour is decided, and takes few enough rows to be written."""
        return all(part.certifiable for part in self.parts)

    def _record(self, files: bool) -> tuple[dict[str, Any], Mapping[str, bytes], CheckReport]:
        return family_document(self, files)

    def to_pandas(self) -> pd.DataFrame:
        """Return one row per agent, with ends that are rounded outwards to floats; NaN where nothing is proved.

        Ends are those with nothing late and leaders at rest, also where more was asked.

        - ``least``, ``largest``: of the state at the deadline, for every signal.
        - ``restricted_least``, ``restricted_largest``: the same for the signals that were asked for, if not all were;
          ``restricted_to`` names these, ``"constant"`` or ``"DwellTime(1/5, clock='t')"`` say, and is empty where there
          are no such ends. Where the last mode decides, an agent stays between them at all times, whether or not it
          comes to rest.
        - ``box_least``, ``box_largest``: the interval into which every signal draws a follower whose end depends on the
          signal. It may move there for ever: these are no ends at the deadline.
        - ``stays_least``, ``stays_largest``: the interval in which every signal keeps an agent at all times whose end
          depends on the signal.
        - ``keeps``: whether no edge of any mode leads to the agent and neither sliding variables nor leaders move, so
          that it stays at ``x(0)`` under every signal. Edges alone decide this, and it is no part of the claim that is
          checked.

        Without an initial state ``keeps`` alone is known, of an undecided certificate no restricted ends and no boxes.

        Raises
        ------
        ParameterError
            pandas is not installed.

        Examples
        --------
        >>> pair = Family.from_intervals([("a", "b", -2, -1)])
        >>> table = certify_family(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 2]).to_pandas()
        >>> table.loc["b", ["least", "largest"]].tolist(), table["keeps"].tolist()
        ([-1.0, -1.0], [True, False])
        """
        return agents_table(self, self.verdict == "certified")

    def __repr__(self) -> str:
        behaviour = self.parts[0].component.behaviour or "not decided"
        if len(self.parts) > 1:
            behaviour = f"{len(self.parts):,} components"
        elif behaviour in self.behaviours and behaviour != DEPENDS:
            behaviour += " for every signal"
        rate = "none" if self.rate is None else down(self.rate)
        return f"FamilyCertificate({behaviour}, rate {rate}, {self.verdict})"


def certify_family(
    family: Family,
    protocol: Protocol,
    x0: Any = None,
    *,
    sigma0: Any = None,
    time_limit: float | None = None,
    signal: SignalClass = "any",
    expectations: Expectations | str | None = None,
    scenario: Mapping[str, Any] | None = None,
    origins: Mapping[str, str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> FamilyCertificate:
    """Certify what a protocol does on a family of graphs, whatever the signal, and whatever the disturbances.

    Parameters
    ----------
    family : Family
    protocol : NominalProtocol or SlidingModeProtocol
        With ``rho2 > 0``.
    x0 : state-like, optional
        The initial state; without it no final states and no peaks.
    sigma0 : state-like, optional
        Sliding mode: ``sigma(0)``, like ``x0``; without it 0, which leaves no reaching phase.
    time_limit : float, optional
        Seconds of wall time for the searches; without it the work of 60 s of one core, and of 1 s more for every 1,000
        nodes, so that what is found does not depend on how busy the machine is.
    signal : {"any", "constant"}, DwellTime, JointWindows or ClockShares
        Restricted signals of which more is claimed, beside what holds for every signal.
    expectations : Expectations or str, optional
    scenario, origins : mapping, optional
        See :func:`ptcc_certify.certify`.
    progress : callable
        Is told each step as it begins.

    Returns
    -------
    FamilyCertificate

    Raises
    ------
    ParameterError
        No protocol, a state that does not fit, restricted signals that are not constant under the sliding-mode
        protocol, or more than 1,000 modes.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> unsure = Family.from_intervals([("a", "b", "0.8", "1.2"), ("b", "a", "-1.2", "-0.8")])
    >>> cert = certify_family(unsure, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3))
    >>> cert.behaviours, cert.verdict, cert.bounded
    (('stability',), 'certified', True)
    """
    refuse_no_protocol(protocol)
    if sigma0 is not None and protocol.reaching is None:
        raise ParameterError("sigma0", "belongs to the sliding-mode protocol; leave it out or change the protocol")
    if not protocol.prescribed:
        raise ParameterError("rho2", "= 0 gives no deadline: nothing is prescribed to certify; give rho2 > 0")
    if len(family.modes) > MANY_MODES:
        mend = "put modes whose edges have the same signs into one, with intervals that hold them all; ptcc classify"
        raise ParameterError(
            f"{len(family.modes):,} modes, and a certificate holds {MANY_MODES:,} at most; {mend} and decide take any"
        )
    signal = read_signal(signal)
    require_nominal(signal, protocol)
    if isinstance(signal, JointWindows):
        refuse_impossible_windows(family, signal)
    if isinstance(signal, ClockShares) and len(signal.shares) != len(family.modes):
        shares = counted(len(signal.shares), "share")
        raise ParameterError(f"{shares} of the clock; give one for each of {len(family.modes)} modes")
    asked, seconds = read_expectations(expectations), read_seconds(time_limit, family)
    progress = listener(progress)
    structure = analyse(family.modes[0].mandatory)
    initial_state = None if x0 is None else read_initial_state(structure, x0, "x0")
    sigma, reaching = read_sliding_variable(structure, protocol, sigma0)
    progress(STEPS[0])
    components = decide(family)
    parts, notes = [], list(family.notes)
    still = sigma is None or not any(sigma)
    few = one_thread(family.n_nodes <= ONE_THREAD_NODES)
    with few, deadline.time_limit(seconds, work=time_limit is None):
        for component in components:
            part = _prove(component, notes, progress, protocol, initial_state if still else None)
            parts.append(_with_means(part) if initial_state is not None and still else part)
        if signal != "any":
            progress(STEP)
        begin = initial_state if still else None
        fields: dict[str, Any] = {
            "boxes": _boxes(parts, begin, notes),
            "ranges": _ranges(parts, begin),
            "signal": signal,
            "restricted": claims_for(signal, parts, protocol, begin, notes, asked.min_rate),
        }
    progress(STEPS[-1])
    notes = [f"{note}: cut off by the time limit" if note in (*STEPS, BOXES) else note for note in notes]
    fields |= {"expectations": asked, "notes": tuple(dict.fromkeys(notes)), "scenario": scenario}
    fields["origins"] = origins_of(None, InitialState(x0, sigma0)) | dict(origins or {})
    return _fewer_functions(FamilyCertificate(family, protocol, tuple(parts), initial_state, sigma, reaching, **fields))


def _fewer_functions(certificate: FamilyCertificate) -> FamilyCertificate:
    """Leave out functions, slower ones first, that the check refuses since they are many or their proofs large.

    Claims for restricted signals that rest on a function left out are left out with it.
    """
    functions = [(part, V) for part in certificate.parts for V in part.functions if isinstance(V, FamilyFunction)]
    work = sum((len(V.nodes) + len(tau)) ** 3 for _, V in functions for tau in V.multipliers)
    few = sum(len(part.functions) for part in certificate.parts) <= MANY_FUNCTIONS
    if (few and work <= LARGEST_ROWS**3) or not all(part.certifiable for part in certificate.parts):
        return certificate
    for most in (1, 0):
        report = certificate.checked
        if report is None or report.accepted:
            break
        parts = tuple(replace(part, functions=part.functions[:most]) for part in certificate.parts)
        note = f"the independent check does not take all functions that were found: {report.reason}"
        claims = (c for c in certificate.restricted if most or not (isinstance(c, RateClaim) and c.forms is None))
        notes = tuple(dict.fromkeys((*certificate.notes, note)))
        certificate = replace(certificate, parts=parts, restricted=tuple(claims), notes=notes)
    return certificate


def _boxes(
    parts: Sequence[ComponentProof], state: Sequence[Fraction] | None, notes: list[str]
) -> dict[int, AttractingBox]:
    """Return the boxes of components that depend on the signal and have followers."""
    boxes: dict[int, AttractingBox] = {}
    if state is None:
        return boxes
    for number, part in enumerate(parts):
        if part.component.behaviour == DEPENDS:
            with share_of_time(1.0, BOXES, notes):
                x = [state[v] for v in part.component.nodes.tolist()]
                if (box := box_of_family(part.component.family, x)) is not None:
                    boxes[number] = box
    return boxes


def _ranges(parts: Sequence[ComponentProof], state: Sequence[Fraction] | None) -> dict[int, tuple[Interval, ...]]:
    """Return of components that depend on the signal between which ends each agent stays at all times."""
    ranges: dict[int, tuple[Interval, ...]] = {}
    for number, part in enumerate(parts if state is not None else ()):
        component = part.component
        if component.behaviour == DEPENDS and component.family.n_nodes + component.family.union[0].size <= _MANY:
            edges = zip(*(end.tolist() for end in component.family.union), strict=True)
            x = [state[v] for v in component.nodes.tolist()]  # type: ignore[index]
            ranges[number] = tuple(reachable_bounds(range(len(x)), edges, x).values())
    return ranges


def _with_means(part: ComponentProof) -> ComponentProof:
    """Add weighted means to the functions, where groups of leaders keep none exactly."""
    if all(group.vector is not None for group in part.leading_groups):
        return part
    forms = {k: V for k, V in enumerate(part.functions) if isinstance(V, FamilyFunction)}
    quotient = Quotient.of(part.component) if forms else None
    functions = list(part.functions)
    for k, V in forms.items():
        assert quotient is not None
        functions[k] = with_means(V, quotient, part.leading_groups)
    return replace(part, functions=tuple(functions))


def _squares(component: FamilyComponent, notes: list[str] | None = None) -> list[SquaresFunction]:
    """Return the weighted sum of squares of a component whose agents end at 0, if one is proved."""
    if component.behaviour != STABILITY:
        return []
    found = squares_function(component.family, notes)
    return [] if found is None else [found]


def _dense(component: FamilyComponent, notes: list[str]) -> tuple[ProvedFunction, ...]:
    """Return a dense form of a component of some hundreds of agents, if one is proved."""
    if component.nodes.size > CLOSED_ROWS or component.behaviour not in (STABILITY, BIPARTITE_CONSENSUS):
        return ()
    search = search_family(Quotient.of(component), ["full"])
    notes += search.notes
    return search.functions


def _led(component: FamilyComponent) -> list[FollowerFunction]:
    """Return a function of rows if small parts lead in which something moves, for the rates of these parts."""
    found = follower_functions(component, LOSSES[:1], largest_part=component.nodes.size // 2)
    return [W for W in found if W.parts]


def _aim(quotient: Quotient, protocol: Protocol, x: Sequence[Fraction]) -> Aim | None:
    """Return where bounds should be small: at the instants that are reported; None where other functions serve."""
    begin = quotient.coordinates(x)
    if not (1 < len(begin) <= FULL_ROWS and any(begin)):
        return None
    top = max(map(abs, begin))
    clocks = protocol.gain.clock_at_remaining([1 - fraction for fraction in FRACTIONS])
    return Aim(np.array([nearest_float(xi / top) for xi in begin]), np.asarray(clocks))


def _prove(
    component: FamilyComponent,
    notes: list[str],
    progress: Callable[[str], None],
    protocol: Protocol,
    state: Sequence[Fraction] | None,
) -> ComponentProof:
    bare = ComponentProof(component)
    if component.kernel is None or component.nodes.size == 1 or not bare.certifiable:
        return bare
    if component.nodes.size > EXACT_NODES:
        progress(STEPS[2])
        functions: list[ProvedFunction] = []
        with share_of_time(1.0, STEPS[2], notes):
            functions += follower_functions(component, notes=notes)
            functions += _squares(component, notes) if not functions else []
            functions += _dense(component, notes) if not functions else []
        return ComponentProof(component, tuple(functions))
    quotient = Quotient.of(component)
    bound, search = None, FamilySearch()
    progress(STEPS[1])
    with share_of_time(_BOUND_SHARE, STEPS[1], notes):
        bound = prove_family_rate_bound(quotient)
    progress(STEPS[2])
    squares: list[SquaresFunction] = []
    aimed: list[ProvedFunction] = []
    aim = None if state is None else _aim(quotient, protocol, [state[v] for v in component.nodes.tolist()])
    with share_of_time(1.0, STEPS[2], notes):
        squares = _squares(component)  # which takes no time to speak of
        enough = None if bound is None else _ENOUGH * bound.value
        search = search_family(quotient, enough=enough, slower=aim is None)
        for V in () if aim is None else aimed_functions(quotient, aim, search.functions, notes):
            aimed.append(V)  # kept, whatever comes after
        aimed += [] if aim is None else _led(component)
    notes += [*search.notes, *(f"{name}: cut off by the time limit" for name in search.cut_off)]
    rate = max((V.rate for V in search.functions), default=Fraction(0))
    if bound is not None and search.functions and rate < _ENOUGH * bound.value:
        with share_of_time(1.0, STEPS[1], notes):  # signals played against what was found
            again = prove_family_rate_bound(quotient, search.functions)
            bound = bound if again is None else min(bound, again, key=lambda b: b.value)
    better = [V for V in squares if _ENOUGH * V.rate > rate]
    functions = sorted((*search.functions, *aimed), key=lambda V: -V.rate)
    return ComponentProof(component, (*better, *functions), bound)
