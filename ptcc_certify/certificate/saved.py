"""Certificates read back from their files: what was proved, as the objects it was proved with.

Nothing is taken from a file that the independent check does not accept, and nothing from its key ``unverified``. Bounds
are rebuilt from the exact numbers of the file and rounded to the safe side, as those of a fresh certificate are.
"""

from __future__ import annotations

import hashlib
import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lmi.exact.rounding import down
from ptcc_certify.bounds.deviation import DistanceBound
from ptcc_certify.bounds.envelope import Comparison, Envelope, Member, float_above, float_below
from ptcc_certify.bounds.input import (
    Disturbed,
    Effort,
    EnergyIntegral,
    Limited,
    Limits,
    Peak,
    SlidingPart,
    Starts,
    Witness,
    first_input,
)
from ptcc_certify.bounds.sliding_envelope import SlidingEnvelope
from ptcc_certify.certificate.verdict import Assessment, Expectations, assess
from ptcc_certify.checker import CheckReport, read_and_check
from ptcc_certify.checker.reading import RejectedError, exact, interval, triangle
from ptcc_certify.checker.vectors import Numbers, SideFiles, beside
from ptcc_certify.errors import FormatError, ParameterError, PTCCError
from ptcc_certify.graphs.digraph import SignedDigraph, Weights
from ptcc_certify.graphs.rationals import nearest_float, shorten
from ptcc_certify.graphs.structure import Claim, Structure, analyse, behaviour_name
from ptcc_certify.lyapunov.rate_bound import optimality_ratio
from ptcc_certify.lyapunov.search import METHODS
from ptcc_certify.protocols import Protocol
from ptcc_certify.protocols.reaching_time import ReachingTime
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.trajectory import Trajectory
from ptcc_certify.theorems import LyapunovBlock, LyapunovFunction, sliding_claim

Interval = tuple[Fraction, Fraction]
Document = Mapping[str, Any]

#: What a simulated run meets under the sliding-mode protocol unless the file states an expression.
ADVERSARY = "adversary"


class RejectedCertificate(PTCCError, ValueError):
    """The independent check does not accept a certificate: nothing in its file may be taken for proved.

    Attributes
    ----------
    path : Path
        Of the file.
    report : CheckReport
        What the check found: ``rejected`` names the part, ``reason`` tells why.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from ptcc_certify import NominalProtocol, certify
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "c.json")
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1)).save(path)
    ...     _ = path.write_text(path.read_text().replace('"rho2": "1"', '"rho2": "2"'))
    ...     try:
    ...         read_certificate(path)
    ...     except RejectedCertificate as error:
    ...         print(error.path.name, error.report.rejected)
    c.json effort
    """

    def __init__(self, path: Path, report: CheckReport):
        self.path = path
        self.report = report
        reason = f"the independent check rejects {report.rejected}: {report.reason}"
        super().__init__(f"{shorten(str(path), 200)}: {reason}; certify the graph again")


@dataclass(frozen=True, eq=False, repr=False)
class SavedCertificate:
    """A certificate as its file states it, accepted by the independent check; made by :func:`read_certificate`.

    Attributes
    ----------
    path : Path
    sha256 : str
        Of the file.
    document : mapping
        The JSON of the file. What stands under ``unverified`` is the file's own word.
    report : CheckReport
        Of the independent check, accepted.
    structure : Structure
        Computed anew from the edges.
    protocol : NominalProtocol or SlidingModeProtocol
    start, sigma0 : tuple of N Fraction, or None
        ``X(0)``; ``sigma(0)`` of the sliding-mode protocol.
    final_state : tuple of N pairs of Fraction, or None
        Middle and radius of a proved interval for each agent's state at the deadline; radius 0 where it is exact.
    degenerate : tuple of int
        1-based numbers of the balanced closed components that meet at 0.
    reaching : tuple of N ReachingTime, or None
        Proved reaching times of the sliding-mode protocol.
    lyapunov : LyapunovFunction or None
        The paper's own, of a proved rate.
    envelope : Envelope or SlidingEnvelope
        The proved bounds over time.
    effort : Effort or None
        What is proved about the input. Bounds in ``peak.how`` include the sliding part.
    trajectory : Trajectory or None
        A run repeated by :meth:`with_simulation`; a file holds none.
    comparison : Comparison or None
        That run against the bounds.
    expectations : Expectations
        What was asked when it was made, as the file says; what became of it follows from what is proved.
    limits : tuple of Limits
        Likewise the limits of the gain under which the input was asked to be judged.
    delta, noise : Fraction or None
        Likewise the bounds of disturbances, in units of the input, and of noise, in units of the states.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from ptcc_certify import NominalProtocol, certify
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5]).save(f"{folder}/c.json")
    ...     saved = read_certificate(f"{folder}/c.json")
    >>> saved.verdict, saved.claim.theorem, saved.rate <= 4 <= saved.upper_bound
    ('certified', '1.1', True)
    >>> bool(saved.norm_bound([0.5])[0] < saved.norm_bound([1])[0])
    True
    >>> saved.with_simulation(samples=11).comparison.violated
    False
    """

    path: Path
    sha256: str
    document: Document
    report: CheckReport
    structure: Structure
    protocol: Protocol
    start: tuple[Fraction, ...] | None
    sigma0: tuple[Fraction, ...] | None
    final_state: tuple[Interval, ...] | None
    degenerate: tuple[int, ...]
    reaching: tuple[ReachingTime, ...] | None
    lyapunov: LyapunovFunction | None
    envelope: Envelope
    effort: Effort | None
    trajectory: Trajectory | None = None
    comparison: Comparison | None = None
    expectations: Expectations = field(default_factory=Expectations)
    limits: tuple[Limits, ...] = ()
    delta: Fraction | None = None
    noise: Fraction | None = None

    @property
    def graph(self) -> SignedDigraph:
        """The graph."""
        return self.structure.graph

    @property
    def verdict(self) -> str:
        """``certified`` or ``undecided``, as the independent check confirms."""
        return self.report.verdict

    @property
    def checked(self) -> CheckReport:
        """Of the independent check, accepted."""
        return self.report

    @cached_property
    def assessment(self) -> Assessment:
        """The graded verdict: whether the bound says something by the deadline, and what became of expectations."""
        return assess(self)

    @property
    def method(self) -> str:
        """Which Lyapunov functions were searched, as the file says."""
        said = self.document["unverified"].get("search")
        method = said.get("method") if isinstance(said, dict) else None
        return method if method in METHODS else "best"

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks of the file."""
        said = self.document["unverified"].get("notes")
        return tuple(note for note in said if isinstance(note, str)) if isinstance(said, list) else ()

    @property
    def cut_off(self) -> tuple[str, ...]:
        """What the time limit ended, as the file says."""
        said = self.document["unverified"].get("cut_off")
        return tuple(name for name in said if isinstance(name, str)) if isinstance(said, list) else ()

    @property
    def time_limit(self) -> float:
        """Seconds that the searches were given, as the file says; infinity if it does not."""
        said = self.document["unverified"].get("time_limit")
        return float(said) if type(said) in (int, float) else math.inf

    @property
    def longest_way(self) -> float | None:
        """The longest way of an agent from its initial to its final state (numerical); None if unknown."""
        if self.start is None or self.final_state is None:
            return None
        ways = (abs(x - middle) for x, (middle, _) in zip(self.start, self.final_state, strict=True))
        return nearest_float(max(ways))

    @cached_property
    def claims(self) -> tuple[Claim, ...]:
        """What the theorems say of each of ``structure.components``."""
        claims = tuple(component.claim for component in self.structure.components)
        return tuple(map(sliding_claim, claims)) if self.protocol.reaching else claims

    @property
    def claim(self) -> Claim | None:
        """What is claimed of a weakly connected graph; None if disconnected (see ``claims``)."""
        return self.claims[0] if len(self.claims) == 1 else None

    @property
    def constant(self) -> bool:
        """Whether every agent keeps its state, so that there is no decay to certify."""
        return self.graph.n_edges == 0

    @property
    def direct(self) -> bool:
        """Whether the decay begins at 0: nominal protocol, or ``sigma(0) = 0``."""
        return not any(self.sigma0 or ())

    @property
    def rate(self) -> Fraction | None:
        """The largest proved rate, per unit of the stretched clock."""
        return _maybe(self.document["rates"]["certified"])

    @property
    def paper_rate(self) -> Fraction | None:
        """The rate of the paper's own certificate."""
        return _maybe(self.document["rates"]["paper"])

    @property
    def upper_bound(self) -> Fraction | None:
        """The proved upper bound on the decay rate: no Lyapunov function exceeds it."""
        return _maybe(self.document["rates"]["limit"])

    @property
    def optimality_ratio(self) -> float | None:
        """Proved rate over its proved upper bound, rounded down; at most 1."""
        return optimality_ratio(self.rate, self.upper_bound)

    @property
    def prefactor(self) -> Fraction | None:
        """What multiplies the squared norm at the largest proved rate."""
        said = self.document["prefactor"]
        return None if said is None else exact(said["value"])

    def norm_bound(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound of ``||E(t)||`` (or ``||eps(t)||``, see ``envelope.coordinates``) from the start.

        Under the sliding-mode protocol it holds whatever the disturbance.

        Parameters
        ----------
        remaining : (M,) array_like
            ``1 - t/T`` at the instants, in [0, 1].

        Returns
        -------
        (M,) array
            Infinite where nothing was proved.

        Raises
        ------
        ParameterError
            The certificate has no start, or an instant is not from 0 to 1.
        """
        return self.envelope.norm_bound(remaining, self._known_start())

    def outcome_distance(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound of ``|x_k(t) - x_k(T)|`` from the start, for every agent.

        Parameters
        ----------
        remaining : (M,) array_like
            ``1 - t/T`` at the instants, in [0, 1].

        Returns
        -------
        (N, M) array
            Infinite where nothing was proved.

        Raises
        ------
        ParameterError
            The certificate has no start, or an instant is not from 0 to 1.
        """
        return self.envelope.outcome_distance(remaining, self._known_start())

    @property
    def disturbance(self) -> str | None:
        """The disturbance of a repeated run: the file's, if it is an expression, otherwise ``adversary``.

        None for the nominal protocol. No part of the claim, which holds for every disturbance within ``delta``.
        """
        if self.protocol.reaching is None:
            return None
        from ptcc_certify.protocols.disturbance import ExpressionDisturbance

        said = self.document["protocol"]["disturbance"]
        if said is None or said == "none":
            return said or ADVERSARY
        try:
            ExpressionDisturbance(said)
        except PTCCError:
            return ADVERSARY
        return said

    def simulate(self, **options: Any) -> Trajectory:
        """Run the protocol again from the start with CVODES, without whatever limits of the gain were judged.

        Under the sliding-mode protocol with :attr:`disturbance`; with the adversary where that exceeds ``delta``.

        Parameters
        ----------
        **options : Any
            ``samples`` and others of :func:`ptcc_certify.simulation.run.simulate`.

        Returns
        -------
        Trajectory
            The run, from 0 to the deadline.

        Raises
        ------
        ParameterError
            The certificate has no start.
        SimulationError
            The integrator failed.
        """
        start = [float(x) for x in self._known_start()]
        if self.sigma0 is None:
            return simulate(self.graph, self.protocol, start, **options)
        options["sigma0"] = [float(x) for x in self.sigma0]
        try:
            return simulate(self.graph, self.protocol, start, disturbance=self.disturbance, **options)
        except ParameterError:
            if self.disturbance == ADVERSARY:
                raise
            return simulate(self.graph, self.protocol, start, disturbance=ADVERSARY, **options)

    def with_simulation(self, **options: Any) -> SavedCertificate:
        """Return the same with ``trajectory`` and, if a bound was proved, ``comparison``.

        Parameters
        ----------
        **options : Any
            Those of :meth:`simulate`.

        Returns
        -------
        SavedCertificate

        Raises
        ------
        ParameterError
            The certificate has no start.
        SimulationError
            The integrator failed.
        """
        run = self.simulate(**options)
        bounded = bool(self.envelope.members) or isinstance(self.envelope, SlidingEnvelope)
        return replace(self, trajectory=run, comparison=self.envelope.compare(run) if bounded else None)

    def _known_start(self) -> tuple[Fraction, ...]:
        if self.start is None:
            raise ParameterError("the certificate has no start; certify the graph with x0")
        return self.start

    def _repr_html_(self) -> str:
        """Show in a notebook what the independent check verified."""
        return f"<pre>{html.escape(chr(10).join([repr(self), *self.report.lines()]))}</pre>"

    def __repr__(self) -> str:
        rate = "none" if self.rate is None else down(self.rate)
        said = self.claim.behaviour if self.claim else f"{len(self.claims)} components"
        return f"SavedCertificate({said}, rate {rate}, {self.verdict}, {self.graph.n_nodes} nodes)"


def read_certificate(path: str | Path, *, stdlib: bool = False, memory: float = 1) -> SavedCertificate:
    """Check a certificate's file with the independent check, and read it back.

    Parameters
    ----------
    path : str or Path
        A file of schema ``ptcc-certificate/1``; its side files are in the same folder.
    stdlib : bool
        Let the check use the standard library alone.
    memory : float
        GB that the check may take; see :func:`ptcc_certify.checker.check`.

    Returns
    -------
    SavedCertificate
        Its verdict is ``certified`` or ``undecided``.

    Raises
    ------
    FormatError
        The file cannot be read as a certificate.
    RejectedCertificate
        The check does not accept it; nothing in it may be taken for proved.
    PTCCError
        A weight or parameter is exact in the file, but beyond the range of float64.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from ptcc_certify import NominalProtocol, certify
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> with TemporaryDirectory() as folder:
    ...     certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5]).save(f"{folder}/c.json")
    ...     saved = read_certificate(f"{folder}/c.json")
    >>> saved, saved.report.accepted
    (SavedCertificate(bipartite consensus, rate 3.99999, certified, 2 nodes), True)
    >>> [str(x) for x, radius in saved.final_state]
    ['-1', '1']
    """
    path = Path(path)
    sha256 = _file_hash(path)
    document, report = read_and_check(path, stdlib=stdlib, memory=memory)
    if _file_hash(path) != sha256:
        raise FormatError(f"{shorten(str(path), 200)}: was changed while it was read; try again")
    if not report.accepted:
        raise RejectedCertificate(path, report)
    return _Reader(path, document).certificate(sha256, report)


def _file_hash(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise FormatError(f"{shorten(str(path), 200)}: not a readable certificate ({error.strerror})") from None


def certificate_graph(document: Document, folder: Path) -> SignedDigraph:
    """Return the graph of an accepted certificate.

    Parameters
    ----------
    document : dict
        The parsed JSON.
    folder : Path
        Of its side files.

    Returns
    -------
    SignedDigraph

    Examples
    --------
    >>> from ptcc_certify import NominalProtocol, certify
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> document = certify(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), simulation=False).to_dict()
    >>> certificate_graph(document, Path()) == foes
    True
    """
    said, files = document["graph"], SideFiles(folder, None)
    labels, edges = said["nodes"], said["edges"]
    if isinstance(edges, dict):
        source, target, weight = (
            np.array(files.column(edges[key], edges["count"])) for key in ("source", "target", "weight")
        )
        scale = exact(edges["scale"])
        values, codes = np.unique(weight, return_inverse=True)
        weights = Weights([Fraction(x) / scale for x in values.tolist()], codes)
    else:
        index = {label: i for i, label in enumerate(labels)}
        source = np.array([index[s] for s, _, _ in edges], dtype=np.int64)
        target = np.array([index[t] for _, t, _ in edges], dtype=np.int64)
        weights = Weights([exact(w) for _, _, w in edges])
    return SignedDigraph(labels, source, target, weights, said["read"])


def _maybe(text: str | None) -> Fraction | None:
    return None if text is None else exact(text)


class _Reader:
    """Turns the JSON of an accepted certificate into objects; the check has verified that every part is there."""

    def __init__(self, path: Path, document: Document):
        self.path, self.document = path, document
        self.files = SideFiles(path.parent, None)
        self.graph = certificate_graph(document, path.parent)
        self.structure = analyse(self.graph)
        self.steps = {(step["kind"], step["of"]): step for step in document["proof"]}

    def certificate(self, sha256: str, report: CheckReport) -> SavedCertificate:
        """Return the whole."""
        data, protocol = self.document, self._protocol()
        sigma0, lyapunov, reaching = self._state("sigma0"), self._paper(), None
        members = tuple(self._member(k, said, lyapunov) for k, said in enumerate(data["lyapunov"]["members"]))
        envelope = Envelope(self.structure, protocol.gain, members)
        if (sliding := protocol.reaching) is not None:
            reaching = tuple(ReachingTime(sliding.T_r, _maybe(z)) for z in data["reaching_time"]["z"].values())
            envelope = SlidingEnvelope(self.structure, protocol.gain, members, sliding, sigma0 or (), reaching)
        outcome = data["outcome"]
        return SavedCertificate(
            path=self.path,
            sha256=sha256,
            document=data,
            report=report,
            structure=self.structure,
            protocol=protocol,
            start=self._state("initial_state"),
            sigma0=sigma0,
            final_state=None if outcome is None else self._final_state(outcome["final_state"]),
            degenerate=() if outcome is None else tuple(outcome["degenerate"] or ()),
            reaching=reaching,
            lyapunov=lyapunov,
            envelope=envelope,
            effort=self._effort(protocol),
            **self._asked(),
        )

    def _asked(self) -> dict[str, Any]:
        """Read what was asked; nothing of it is claimed, so that what cannot be read is left out."""
        said = self.document["unverified"].get("asked")

        def number(section: Any, key: str) -> Fraction | None:
            try:
                value = None if section.get(key) is None else exact(section[key])
            except (AttributeError, RejectedError):
                return None
            return value if value is not None and value > 0 else None

        if not isinstance(said, dict):
            return {}
        behaviour, limits = said.get("behaviour"), said.get("limits")
        limits = limits[:100] if isinstance(limits, list) else []
        try:
            behaviour = behaviour_name(behaviour) if isinstance(behaviour, str) else None
        except ValueError:
            behaviour = None
        each = [[number(entry, key) for key in ("gain_cap", "stop_before", "sample_period")] for entry in limits]
        return {
            "expectations": Expectations(behaviour, number(said, "min_rate"), number(said, "max_input")),
            "limits": tuple(Limits(*entry) for entry in each if any(entry)),
            "delta": number(said, "delta"),
            "noise": number(said, "noise"),
        }

    # ------------------------------------------------------------------ graph, protocol, states

    def _protocol(self) -> Protocol:
        said = {key: value for key, value in self.document["protocol"].items() if key != "disturbance"}
        return Protocol.from_dict({key: value if key == "kind" else exact(value) for key, value in said.items()})

    def _by_agent(self, said: Any) -> tuple[Fraction, ...]:
        """Read numbers by agent: an object in the order of the nodes, or a side vector."""
        if beside(said):
            return tuple(self.files.numbers(said, "a vector", self.graph.n_nodes))
        return tuple(map(exact, said.values()))

    def _state(self, key: str) -> tuple[Fraction, ...] | None:
        said = self.document[key]
        return None if said is None else self._by_agent(said)

    def _final_state(self, said: Any) -> tuple[Interval, ...] | None:
        if said is None:
            return None
        if list(said) == ["mid", "radius"] and beside(said["mid"]):
            return tuple(zip(self._by_agent(said["mid"]), self._by_agent(said["radius"]), strict=True))
        return tuple(map(interval, said.values()))

    def _nodes(self, said: Any) -> tuple[int, ...]:
        if beside(said):
            return tuple(self.files.integers(said, "nodes", said["count"]))
        return tuple(self.graph.index[label] for label in said)

    # ------------------------------------------------------------------ Lyapunov functions

    def _paper(self) -> LyapunovFunction | None:
        """Return the Lyapunov function of the theorem's row, if a rate of it was proved."""
        said = self.document["paper"]
        if said is None or said["rate"] is None:
            return None
        blocks = tuple(
            LyapunovBlock(b["name"], self._nodes(b["nodes"]), tuple(map(exact, b["diagonal"])), b["times_rho"])
            for b in said["blocks"]
        )
        return LyapunovFunction(said["theorem"], said["objective"], said["coordinates"], blocks, _maybe(said["rho"]))

    def _member(self, k: int, said: Document, paper: LyapunovFunction | None) -> Member:
        """Return one bound, rounded to the safe side as :meth:`Member.of` and :meth:`Member.of_sharp` round it."""
        rate, given = exact(said["rate"]), said["distance"]
        distance = None if given is None else DistanceBound(self._by_agent(given["agents"]), exact(given["norm"]))
        if said["class"] == "paper":
            assert paper is not None
            return Member.of(self.structure, paper, rate, distance=distance)
        (block,) = said["blocks"]
        nodes = self._nodes(block["nodes"])
        if "diagonal" in block:
            numbers = self.files.numbers(block["diagonal"], "diagonal", len(nodes))
            weights = _floats(numbers)
            lowest = Fraction(min(numbers.values)) / (numbers.scale or 1)
        else:
            lower = triangle(block["lower_triangle"], len(nodes))
            weights = np.array([[float(x) for x in row] for row in lower])
            lowest = exact(self.steps["prefactor", f"lyapunov.members[{k}]"]["numbers"]["lowest"])
        return Member(
            said["class"],
            "E",
            np.array(nodes, dtype=np.int64),
            weights,
            None,
            float_below(rate),
            float_above(exact(said["prefactor"])),
            float_below(lowest),
            distance,
        )

    # ------------------------------------------------------------------ input

    def _effort(self, protocol: Protocol) -> Effort | None:
        said = self.document["effort"]
        if said is None:
            return None
        by_agent, start = self._maybe_by_agent, self._state("initial_state")
        region = self._starts(said["starts"]) or (None if start is None else Starts(start))
        sliding = said["sliding"]
        threshold = said["threshold"]
        return Effort(
            bounded=said["bounded"],
            by=None if said["bounded"] is None else self.steps["input-threshold", "effort"]["witness"],
            threshold=(_maybe(threshold["lower"]), _maybe(threshold["upper"])),
            starts=self._starts(said["starts"]),
            constants=tuple(map(by_agent, said["constants"])),
            peak=self._peak(said["peak"]),
            energy=self._energy(said["energy"]),
            path_length=self._witness(said["path_length"], "input-length"),
            sliding=None if sliding is None else SlidingPart(sliding["bounded"], by_agent(sliding["agents"])),
            residual=tuple(self._limited(k, entry) for k, entry in enumerate(said["residual"])),
            disturbed=self._disturbed(said["disturbed"]),
            first=None if region is None else first_input(self.structure, protocol, region),
        )

    def _maybe_by_agent(self, said: Any) -> tuple[Fraction, ...] | None:
        return None if said is None else self._by_agent(said)

    def _starts(self, said: Document | None) -> Starts | None:
        if said is None:
            return None
        axes = tuple(map(self._by_agent, said.get("axes", ())))
        return Starts(self._by_agent(said["center"]), () if axes else self._by_agent(said["radius"]), axes)

    def _witness(self, said: str | None, kind: str) -> Witness | None:
        if said is None:
            return None
        step = self.steps[kind, "effort"]
        return Witness(exact(said), step["witness"], exact(step["numbers"]["z"]))

    def _energy(self, said: str | None) -> Witness | EnergyIntegral | None:
        step = self.steps.get(("input-energy", "effort"))
        if said is None or step is None or not isinstance(step["witness"], dict):
            return self._witness(said, "input-energy")
        rows = [step["witness"][key] for key in ("W0", "W1")]
        first, second = (triangle(lower, len(lower)) for lower in rows)
        p, m0, m1 = (exact(step["numbers"][key]) for key in ("p", "m0", "m1"))
        return EnergyIntegral(exact(said), p, (first, second), (m0, m1))

    def _peak(self, said: Document | None) -> Peak | None:
        if said is None:
            return None
        step = self.steps["input-peak", "effort"]
        agents, norm = self._by_agent(said["agents"]), exact(said["norm"])
        how = step["witness"]["agents"].values()
        return Peak(
            agents,
            tuple(Witness(bound, k, exact(z)) for bound, (k, z) in zip(agents, how, strict=True)),
            norm,
            Witness(norm, step["witness"]["norm"], exact(step["numbers"]["z"])),
        )

    def _limited(self, k: int, said: Document) -> Limited:
        step, noise = self.steps["limited-gain", f"effort.residual[{k}]"], said["noise"] or {}
        first, second = (*step["witness"], None)[:2] if isinstance(step["witness"], list) else (step["witness"], None)
        return Limited(
            limits=Limits(*(_maybe(said[key]) for key in ("gain_cap", "stop_before", "sample_period"))),
            clock=exact(said["clock"]),
            member=first,
            growth=exact(step["numbers"]["growth"]),
            norm=exact(said["norm"]),
            agents=self._maybe_by_agent(said["agents"]),
            largest=_maybe(said["largest"]),
            noise=_maybe(noise.get("bound")),
            noise_member=second,
            noisy_norm=_maybe(noise.get("norm")),
            noisy_largest=_maybe(noise.get("largest")),
        )

    def _disturbed(self, said: Document | None) -> Disturbed | None:
        if said is None:
            return None
        member = self.steps["nominal-disturbed", "effort"]["witness"]
        return Disturbed(
            exact(said["delta"]), member, self._by_agent(said["inputs"]), self._maybe_by_agent(said["drift"])
        )


def _floats(numbers: Numbers) -> np.ndarray:
    """Return the floats nearest to exact numbers, each rounded once."""
    if numbers.scale is None:
        return np.array([float(x) for x in numbers.values])
    return np.array([x / numbers.scale for x in numbers.values])
