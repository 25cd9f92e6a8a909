"""Certificates: what is claimed about a graph under a protocol, what was proved, what was only observed.

``certify`` is the main job: structure -> theorem -> Lyapunov function -> proved rate -> outcome -> comparison with
CVODES. Every claim of a certificate outside ``unverified`` was established in exact or ball arithmetic, and verified
again by the independent check; a simulation corroborates and never proves.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from lmi import deadline
from lmi.apart import apart
from lmi.deadline import share_of_time
from lmi.diagonal import CLARABEL_MARGIN_ROWS, load_solver
from lmi.errors import LMIError, OutOfTime
from lmi.exact.enclosure import decay_integrals_below
from lmi.exact.rounding import down
from ptcc_certify.bounds.deviation import DistanceBound, OutcomeGeometry
from ptcc_certify.bounds.enclosed_state import EnclosedOutcome, NotEnclosedError, enclose
from ptcc_certify.bounds.envelope import FRACTIONS, Comparison, Envelope, Member, remaining_part
from ptcc_certify.bounds.final_state import Influence, Outcome, exact_start, influence, outcome
from ptcc_certify.bounds.input import (
    Effort,
    InputRequest,
    Limits,
    Starts,
    WorstStart,
    bound_effort,
    starts_within,
    worst_start,
)
from ptcc_certify.bounds.sliding_envelope import SlidingEnvelope
from ptcc_certify.certificate.document import Writer, certificate_document, outcome_witness
from ptcc_certify.certificate.verdict import MANY_DECADES, Assessment, Expectations, assess
from ptcc_certify.checker import REACHING_BITS, CheckReport, check
from ptcc_certify.checker.input_bounds import Form
from ptcc_certify.checker.reading import MAX_SCALE_BITS
from ptcc_certify.errors import HypothesisError, NumberError, ParameterError, SimulationError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import write_atomically
from ptcc_certify.graphs.rationals import as_fraction, shorten, writable
from ptcc_certify.graphs.structure import Claim, Structure, analyse
from ptcc_certify.lyapunov.error_system import ErrorSystem
from ptcc_certify.lyapunov.rate_bound import RateLimit, mean_limit, optimality_ratio, prove_rate_limit
from ptcc_certify.lyapunov.search import APART_NODES, DIAGONAL, METHODS, Sharpening, sharpen, sharpen_large
from ptcc_certify.protocols import Protocol
from ptcc_certify.protocols.disturbance import as_disturbance
from ptcc_certify.protocols.limits import GainLimits
from ptcc_certify.protocols.parameters import parameter
from ptcc_certify.protocols.reaching_time import ReachingTime, certified_reaching_times
from ptcc_certify.simulation.filippov import rounding_slack
from ptcc_certify.simulation.instants import PAST
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.trajectory import Trajectory
from ptcc_certify.theorems import LyapunovFunction, Obligation, RateProof, Theorem, sliding_claim, theorem_for
from ptcc_certify.theorems.lemmas import EXACT_NODES, FACTOR_NODES, laplacian_spectrum

CERTIFIED, UNDECIDED = "certified", "undecided"
#: What :func:`certify` does, in this order.
STEPS = (
    "simulation",
    "the paper's certificate",
    "sharper certificates",
    "limit of rates",
    "outcome",
    "independent check",
)
#: Below this time limit, in seconds, the solver is loaded before the time begins to run.
SHORT_LIMIT = 10
#: The share of a time limit after which the searches end, so that what they found is checked within it, and the shares
#: of the time then left that the first of the steps may take.
SEARCHING, SHARES = 0.4, (0.3, 0.3, 0.8, 1.0)
#: Largest graph for which the search of the paper's certificate (dense semidefinite cones) is started.
SEARCH_NODES = 150
#: Largest graph that is simulated unasked, and the instants of a larger one where it is asked for.
SIMULATED_NODES, FEW_SAMPLES = 10_000, 51
#: A simulated end state is settled when it is this near to the outcome, relative to the start.
SETTLED = 1e-6
#: Largest entry of a start, in size: outcomes and trajectories are also reported as floats.
LARGEST_STATE = Fraction(10**300)
#: Longest weights and initial states, over a common denominator: so many bits over ``N^(5/4)``, for seconds of work.
LONGEST_BITS = 470_000
#: GB that the check of a large graph may take while it is certified.
LARGE_MEMORY = 16


@dataclass(frozen=True, repr=False)
class Certificate:
    """A claim about a signed digraph under a protocol, with its proof; made by :func:`certify`.

    Attributes
    ----------
    structure : Structure
    protocol : NominalProtocol or SlidingModeProtocol
    theorem : Theorem
        Whose Lyapunov function is used.
    lyapunov : LyapunovFunction or None
        None when the search found none or was not started.
    proof : RateProof
        The proved rate (None if not proved) and the statements proved for it.
    numerical_rate : float or None
        The paper's rate in floating point, per unit of the clock; nothing is claimed about it.
    spectral_rate : float or None
        ``2 min Re lambda`` in floating point, per unit of the clock: no certificate can reach further.
    start : tuple of Fraction or None
    sigma0 : tuple of Fraction or None
        ``sigma(0)`` of the sliding-mode protocol; None for the nominal one.
    reaching : tuple of ReachingTime or None
        When each sliding variable is proved to be 0, whatever the disturbance.
    influence : Influence
        ``Q``, factored.
    outcome : Outcome or None
        ``Q X(0)``, for the sliding-mode protocol ``Q (X(0) - sigma(0))``; None without a start.
    enclosed : EnclosedOutcome or None
        The same in proved intervals, where the graph is too large for rationals.
    trajectory : Trajectory or None
    sharpening : Sharpening
        Sharper Lyapunov functions of the classes that ``method`` names, proved.
    limit : RateLimit or None
        The proved upper bound on the decay rate, and what proves it; None if no agent listens to another.
    method : str
    at : Fraction or None
        Instant for which the bound was optimised, in units of time.
    starts : Starts or None
        The set of starts for which the input is bounded; None: that of ``start`` alone.
    limits : tuple of Limits
        Limits of the gain that are judged besides.
    delta : Fraction or None
        Nominal protocol: bound of the disturbances that are judged besides, in units of the input.
    noise : Fraction or None
        Nominal protocol: bound of the measurement noise that is judged under each of the limits.
    time_limit : float
        Seconds that the searches were given, infinity for no limit.
    cut_off : tuple of str
        The searches that the time limit ended; what they had proved by then stands.
    notes : tuple of str
        What kept the verdict from ``certified``, and other remarks.
    expectations : Expectations
        What is asked besides; what became of it is part of ``assessment``.

    References
    ----------
    Theorems 1 to 6 and Corollaries 1 to 10 of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify import NominalProtocol, SignedDigraph, certify
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 1], simulation=False)
    >>> cert.verdict, cert.claim.behaviour, cert.claim.theorem
    ('certified', 'bipartite consensus', '1.1')
    >>> cert.outcome, bool(cert.rate <= cert.upper_bound), cert.checked.accepted
    (Outcome(1=1, 2=-1), True, True)
    """

    structure: Structure
    protocol: Protocol
    theorem: Theorem
    lyapunov: LyapunovFunction | None
    proof: RateProof
    numerical_rate: float | None
    spectral_rate: float | None
    start: tuple[Fraction, ...] | None
    sigma0: tuple[Fraction, ...] | None
    reaching: tuple[ReachingTime, ...] | None
    influence: Influence
    outcome: Outcome | None
    enclosed: EnclosedOutcome | None
    trajectory: Trajectory | None
    sharpening: Sharpening
    limit: RateLimit | None
    method: str
    at: Fraction | None
    starts: Starts | None
    limits: tuple[Limits, ...]
    delta: Fraction | None
    noise: Fraction | None
    time_limit: float
    cut_off: tuple[str, ...]
    notes: tuple[str, ...]
    expectations: Expectations = field(default_factory=Expectations)

    @property
    def graph(self) -> SignedDigraph:
        """The graph."""
        return self.structure.graph

    @property
    def claim(self) -> Claim | None:
        """What is claimed of a weakly connected graph; None if disconnected (see ``claims``)."""
        return self.claims[0] if len(self.claims) == 1 else None

    @cached_property
    def claims(self) -> tuple[Claim, ...]:
        """What is claimed of each of ``structure.components``."""
        claims = tuple(component.claim for component in self.structure.components)
        return tuple(map(sliding_claim, claims)) if self.protocol.reaching else claims

    @property
    def rate(self) -> Fraction | None:
        """The largest proved rate of all members; None if nothing decays or nothing was proved."""
        proved = [rate for rate, _, _ in self._rated if rate > 0]
        return max(proved) if proved else None

    @property
    def diagonal_rate(self) -> Fraction | None:
        """The largest proved rate of a diagonal Lyapunov matrix of the sharper classes; None if there is none."""
        proved = [m.rate for m in self.sharpening.members if m.kind in DIAGONAL and m.rate > 0]
        return max(proved) if proved else None

    @property
    def prefactor(self) -> Fraction | None:
        """What multiplies the squared norm at the largest proved rate."""
        return self.fastest[1] if self.rate is not None else None

    @property
    def fastest(self) -> tuple[Fraction, Fraction, str]:
        """The largest proved rate, and of those that share it the least prefactor."""
        return max(self._rated, key=lambda member: (member[0], -member[1]))

    @property
    def _rated(self) -> list[tuple[Fraction, Fraction, str]]:
        """Rate, prefactor and class of every proved member, the paper's first."""
        paper = []
        if self.lyapunov is not None and self.proof.rate is not None:
            paper = [(self.proof.rate, self.lyapunov.prefactor, "paper")]
        return paper + [(m.rate, m.prefactor, m.kind) for m in self.sharpening.members]

    @property
    def constant(self) -> bool:
        """Whether every agent keeps its state, so that there is no decay to certify."""
        return self.graph.n_edges == 0

    @cached_property
    def obligations(self) -> tuple[Obligation, ...]:
        """Everything that was proved, in the order of the JSON."""
        found = [Obligation("structure", "graph"), Obligation("claim", "graph")]
        if self.influence.exact:
            found.append(Obligation("outcome", "graph", witness=outcome_witness(self.structure, self.influence)))
        elif self.enclosed is not None:
            found.append(Obligation("outcome", "graph", witness=self.enclosed))
        found += self.proof.obligations if self.proof.rate is not None else ()
        sharp = iter(self.sharpening.members)
        for k, bound in enumerate(self.envelope.members):
            of = f"lyapunov.members[{k}]"
            if bound.kind != "paper":
                member = next(sharp)
                if member.dominance is not None:
                    found.append(Obligation("dominance", of, {"b": member.rate}, member.dominance))
                else:
                    found.append(Obligation("rate", of, {"b": member.rate}))
                if member.matrix is not None:
                    ends = {"lowest": member.lowest, "highest": member.highest}
                    found.append(Obligation("prefactor", of, ends))
            if bound.distance is not None:
                found.append(Obligation("distance", of))
        if self.limit is not None:
            witness = self.limit.witness(self.graph.labels)
            found.append(Obligation(self.limit.kind, "rates", {"limit": self.limit.value}, witness))
        if self.reaching is not None:
            found.append(Obligation("sliding-bound", "protocol"))
            if any(s and r.z is not None for s, r in zip(self.sigma0 or (), self.reaching, strict=True)):
                found.append(Obligation("reaching-time", "reaching_time"))
        if self.effort is not None:
            found += self.effort.obligations
        return tuple(found)

    @property
    def forms(self) -> list[Form | None]:
        """The Lyapunov functions of the envelope as bounds of the input take them; None for those of large graphs."""
        forms: list[Form | None] = []
        V = self.lyapunov
        if V is not None and V.blocks and self.proof.rate is not None:
            gauge = [] if self.structure.gauge is None else self.structure.gauge[list(V.nodes)].tolist()
            weights = V.weights
            forms.append(Form(self.proof.rate, V.coordinates, V.nodes, weights, None, min(weights), gauge))
        forms += [
            None
            if m.dominance is not None
            else Form(m.rate, "E", m.nodes, m.diagonal, m.matrix, m.lowest if m.matrix else min(m.diagonal or ()))
            for m in self.sharpening.members
        ]
        return forms

    @cached_property
    def comparison(self) -> Comparison | None:
        """The simulated run against the proved bounds; None without a run, or if nothing was proved."""
        if self.trajectory is None or not (self.envelope.members or isinstance(self.envelope, SlidingEnvelope)):
            return None
        return self.envelope.compare(self.trajectory)

    @cached_property
    def effort(self) -> Effort | None:
        """What is proved about the input; None if no decay was proved."""
        if self.rate is None and not self.constant:
            return None
        asked = InputRequest(
            self.structure,
            self.protocol,
            self.forms,
            rate=self.rate,
            limit=self.upper_bound,
            start=self.start,
            starts=self.starts,
            sigma0=self.sigma0,
            reaching=None if self.reaching is None else [r.z for r in self.reaching],
            influence=self.influence,
            distances=[None if m.distance is None else m.distance.agents for m in self.envelope.members],
            limits=self.limits,
            delta=self.delta,
            noise=self.noise,
        )
        return bound_effort(asked)

    @cached_property
    def worst_start(self) -> WorstStart | None:
        """The start of the set ``starts`` from which the input gets largest (numerical); None without a set."""
        if self.starts is None or self.graph.n_nodes > EXACT_NODES:
            return None
        return worst_start(self.structure, self.protocol, self.starts)

    @cached_property
    def checked(self) -> CheckReport | None:
        """What the independent check says of the certificate as it would be written; None if nothing was proved."""
        proved = self.constant or self.rate is not None
        ended = self.influence.exact or self.enclosed is not None
        if not (proved and ended):
            return None
        document, written = self._document(CERTIFIED)
        return check(document, files=written.files, memory=1 if self.graph.n_nodes <= EXACT_NODES else LARGE_MEMORY)

    def _document(self, verdict: str) -> tuple[dict[str, Any], Writer]:
        """Return the JSON of a verdict and its side files, made once."""
        kept = self.__dict__.setdefault("_documents", {})
        if verdict not in kept:
            kept[verdict] = certificate_document(self, verdict, files=True)
        return kept[verdict]

    @property
    def verdict(self) -> str:
        """``certified`` if rate and outcome were proved and the independent check accepts it, else ``undecided``."""
        return CERTIFIED if self.checked is not None and self.checked.accepted else UNDECIDED

    @cached_property
    def assessment(self) -> Assessment:
        """The graded verdict: whether the bound says something by the deadline, and what became of expectations."""
        return assess(self)

    @property
    def longest_way(self) -> float | None:
        """The longest way of an agent from its initial to its final state (numerical); None if unknown."""
        if self.start is None or self.outcome is None:
            return None
        return float(np.abs(np.array([float(x) for x in self.start]) - self.outcome.values).max())

    @property
    def upper_bound(self) -> Fraction | None:
        """The proved upper bound on the decay rate, per unit of the clock: no Lyapunov function exceeds it."""
        return None if self.limit is None else self.limit.value

    @property
    def optimality_ratio(self) -> float | None:
        """Proved rate over its proved upper bound, rounded down; at most 1."""
        return optimality_ratio(self.rate, self.upper_bound)

    @property
    def rounding_loss(self) -> float | None:
        """The largest relative loss of rate between what floating point found and what was proved; None without rates.

        Matrices are rounded to short rationals, and their rates lowered until they prove.
        """
        pairs = [(m.rate, m.numerical_rate) for m in self.sharpening.members]
        if self.proof.rate is not None and self.numerical_rate is not None:
            pairs.append((self.proof.rate, self.numerical_rate))
        losses = [float(1 - rate / Fraction(found)) * math.copysign(1, found) for rate, found in pairs if found]
        return max(losses, default=None)

    @property
    def direct(self) -> bool:
        """Whether the decay begins at 0: nominal protocol, or ``sigma(0) = 0``."""
        return not any(self.sigma0 or ())

    @cached_property
    def envelope(self) -> Envelope:
        """The proved bounds over time; without members if nothing was proved."""
        members: list[Member] = []
        V = self.lyapunov
        if V is not None and V.blocks and self.proof.rate is not None:
            distance = self._distance(V.coordinates, V.nodes, V.weights, None)
            members.append(Member.of(self.structure, V, self.proof.rate, distance=distance))
        for sharp in self.sharpening.members:
            distance = self._distance("E", sharp.nodes, sharp.diagonal, sharp.matrix)
            members.append(Member.of_sharp(sharp, distance=distance))
        if (sliding := self.protocol.reaching) is not None:
            sigma0, reaching = self.sigma0 or (), self.reaching or ()
            return SlidingEnvelope(self.structure, self.protocol.gain, tuple(members), sliding, sigma0, reaching)
        return Envelope(self.structure, self.protocol.gain, tuple(members))

    @cached_property
    def _geometry(self) -> OutcomeGeometry | None:
        if not self.influence.exact or outcome_witness(self.structure, self.influence) is not None:
            return None
        return OutcomeGeometry(self.structure, self.influence)

    def _distance(
        self,
        coordinates: str,
        nodes: Sequence[int],
        diagonal: Sequence[Fraction] | None,
        matrix: Sequence[Sequence[Fraction]] | None,
    ) -> DistanceBound | None:
        """Return the constants from ``V`` to the distances, or None without an exact outcome."""
        if self._geometry is None:
            return None
        return self._geometry.bound(coordinates, nodes, diagonal, matrix)

    def norm_bound(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound of ``||E(t)||`` (or ``||eps(t)||``, see ``envelope.coordinates``) from the start, (M,).

        At the instants where ``1 - t/T`` is ``remaining``; under the sliding-mode protocol whatever the disturbance.

        Raises
        ------
        ParameterError
            The certificate has no start, or an instant is not from 0 to 1.
        """
        return self.envelope.norm_bound(remaining, self._known_start())

    def outcome_distance(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound of ``|x_k(t) - x_k(T)|`` from the start, (N, M), at the instants where ``1 - t/T`` is ``remaining``.

        Under the sliding-mode protocol whatever the disturbance.

        Raises
        ------
        ParameterError
            The certificate has no start, or an instant is not from 0 to 1.
        """
        return self.envelope.outcome_distance(remaining, self._known_start())

    def _known_start(self) -> tuple[Fraction, ...]:
        if self.start is None:
            raise ParameterError("the certificate has no start; give x0")
        return self.start

    def best_possible_residual(self, remaining: float) -> float | None:
        """``e^(-spectral rate s / 2)`` where ``1 - t/T`` is ``remaining``: what the slowest mode leaves (numerical).

        Raises
        ------
        ParameterError
            ``remaining`` is not from 0 to 1.
        """
        if self.spectral_rate is None:
            return None
        return math.exp(-self.spectral_rate * self.protocol.gain.clock_at_remaining(remaining_part(remaining)) / 2)

    def to_dict(self) -> dict[str, Any]:
        """Return the certificate as JSON-ready data of schema ``ptcc-certificate/1``, without side files."""
        document, written = self._document(self.verdict)
        return dict(document if not written.files else certificate_document(self, self.verdict)[0])

    def to_json(self) -> str:
        """Return the certificate as one JSON object, without NaN or infinity."""
        return _json(self.to_dict())

    def save(self, path: str | Path) -> None:
        """Write the certificate to ``path``; the file appears whole or not at all.

        Vectors of more than 50,000 entries go to ``.npy`` files beside it, which are written first.

        Parameters
        ----------
        path : str or Path

        Raises
        ------
        FormatError
            The file cannot be written.
        """
        document, written = self._document(self.verdict)
        for name, content in written.files.items():
            write_atomically(Path(path).parent / name, content)
        # What UTF-8 cannot hold, a lone surrogate in a label, becomes its JSON escape.
        write_atomically(path, _json(document).encode("utf-8", "backslashreplace"))

    def _repr_html_(self) -> str:
        from ptcc_certify.report.notebook import certificate_html

        return certificate_html(self)

    def __repr__(self) -> str:
        rate = "none" if self.rate is None else down(self.rate)
        said = self.claim.behaviour if self.claim else f"{len(self.structure.components)} components"
        return f"Certificate({said}, Theorem {self.theorem.number}, rate {rate}, {self.verdict})"


def certify(
    graph: SignedDigraph,
    protocol: Protocol,
    x0: Sequence[Any] | Mapping[Any, Any] | None = None,
    *,
    sigma0: Sequence[Any] | Mapping[Any, Any] | None = None,
    disturbance: Any = None,
    simulation: bool | None = None,
    method: str = "best",
    at: Any = None,
    starts: Any = None,
    limits: Sequence[Limits] = (),
    delta: Any = None,
    noise: Any = None,
    time_limit: float | None = None,
    expectations: Expectations | None = None,
    progress: Callable[[str], None] = lambda step: None,
) -> Certificate:
    """Certify what a protocol does on a signed digraph.

    Parameters
    ----------
    graph : SignedDigraph
        Any signed digraph, disconnected ones included.
    protocol : NominalProtocol or SlidingModeProtocol
        With ``rho2 > 0``. Under the sliding-mode protocol everything is claimed for all disturbances within ``delta``.
    x0 : sequence of N numbers, mapping of label to number or pandas Series, optional
        The start, in node order, or by label where there are labels. Without it there is no final state and no
        simulation.
    sigma0 : sequence of N numbers, mapping of label to number or pandas Series, optional
        Sliding mode: ``sigma(0)``, like ``x0``; without it 0, which leaves no reaching phase and ``Q X(0)`` as the
        outcome.
    disturbance : Disturbance, str, number, callable or sequence, optional
        Sliding mode: what the simulated run meets; see :func:`ptcc_certify.simulation.run.simulate`.
    simulation : bool, optional
        Whether to compare the proved bound with a CVODES run; by default up to 10,000 agents.
    method : {"best", "paper", "perron", "lmi", "full"}
        Which Lyapunov functions are searched beside the paper's; see :mod:`ptcc_certify.lyapunov.search`.
    at : number, optional
        An instant before the deadline, in units of time, at which the bound should be smallest.
    starts : Starts or positive number, optional
        The set of starts for which the input is bounded, instead of ``x0`` alone; a number ``R`` stands for
        ``||X(0)||_inf <= R``.
    limits : sequence of Actuator
        Nominal protocol: caps, stops and sampling of the gain, under which what is left at the deadline is bounded.
        With sampling, which may drive agents apart, it is certified if ``||E||`` is no larger there than at first.
    delta : number, optional
        Nominal protocol: bound of the disturbances ``|d_k|`` whose effect is bounded, in units of the input.
    noise : number, optional
        Nominal protocol: bound of the measurement noise ``|n_k|``, ``u = -gain L (X + n)``, whose effect is bounded
        under each of ``limits`` but sampling. Noise times an infinite gain is bounded by nothing.
    time_limit : float, optional
        Seconds of wall time. Simulation and searches may take 40 % together, each its share of what is left; what is
        proved by then stands and is checked, and ``cut_off`` names what was ended. Without it they have 60 s, and 1 s
        more for every 1,000 nodes.
    expectations : Expectations, optional
        What is asked besides: a behaviour, a rate, a bound of the input. It decides nothing but the ``assessment``.
    progress : callable, optional
        Is told each of :data:`STEPS` as it begins.

    Returns
    -------
    Certificate

    Raises
    ------
    ParameterError
        ``rho2 = 0`` (no deadline), a time limit that is not positive, a start of the wrong length, with other labels
        than the nodes, beyond 1e300 or of thousands of digits, or a disturbance that exceeds ``delta``.

    References
    ----------
    Theorems 1 to 6, Corollaries 1 to 10 and Proposition 1 of Zhu et al., Robust prescribed-time coordination control of
    cooperative-antagonistic networks with disturbances.

    Examples
    --------
    >>> from ptcc_certify.protocols import NominalProtocol
    >>> g = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> cert = certify(g, NominalProtocol(T="0.6", rho1="0.1", rho2="0.3", kappa=1), [3, 5])
    >>> cert
    Certificate(bipartite consensus, Theorem 1.1, rate 3.99999, certified)
    >>> cert.outcome
    Outcome(1=-1, 2=1)
    >>> robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    >>> cert = certify(g, robust, [3, 5], sigma0=[1, 0], disturbance="sin(5*k*t)")
    >>> cert, cert.reaching
    (Certificate(bipartite consensus, Theorem 4.1, rate 3.99999, certified), (ReachingTime(0.43409, 0.565 before T_r), \
ReachingTime(0, 1 before T_r)))
    >>> cert.outcome
    Outcome(1=-1.5, 2=1.5)
    """
    if not protocol.prescribed:
        raise ParameterError("rho2 = 0 gives no deadline: nothing is prescribed to certify; give rho2 > 0")
    sliding = protocol.reaching
    for name, value in (("sigma0", sigma0), ("disturbance", disturbance)):
        if value is not None and not sliding:
            raise ParameterError(f"{name} belongs to the sliding-mode protocol; leave it out or change the protocol")
    if method not in METHODS:
        raise ParameterError(f'method "{method}" is unknown; one of {", ".join(METHODS)}')
    instant = None if at is None else _instant(at, protocol)
    _refuse_long(_distinct_weights(graph), graph.n_nodes, "the weights", lambda: f"edge {_longest_edge(graph)}")
    structure = analyse(graph)
    region = _starts(structure, starts)
    if sliding and (limits or delta is not None or noise is not None):
        raise ParameterError("limits, delta and noise are for the nominal protocol; the sliding mode has its own delta")
    blur = None if noise is None else parameter("noise", noise)
    spread = None if delta is None else parameter("delta", delta)
    judged = tuple(_limits(entry, protocol) for entry in limits)
    start = None if x0 is None else _start(structure, x0, "x0")
    manifold, reaching = _reaching(structure, protocol, sigma0)
    trajectory = None
    notes: list[str] = []
    cut_off: list[str] = []
    seconds = 60 + graph.n_nodes / 1000 if time_limit is None else time_limit
    if not seconds > 0:
        raise ParameterError(f"time_limit = {seconds} is outside its domain; it must be > 0, in seconds")
    if simulation is None and graph.n_nodes > SIMULATED_NODES:
        notes.append(f"above {SIMULATED_NODES} agents there is no CVODES run unless it is asked for")
        simulation = False
    begin = None if simulation is False else start
    if sliding and disturbance is not None and begin is None:
        horizon = float(protocol.T) * (1 + PAST)  # as far as a run would go
        source = as_disturbance(disturbance, graph.n_nodes, sliding.delta, horizon)
        source.check(sliding.delta, graph.labels, horizon, rounding_slack(sliding))
    theorem = theorem_for(structure, protocol.kind)
    V, proof, numerical, limit, sharpening = None, RateProof(None, ()), None, None, Sharpening()
    if seconds < SHORT_LIMIT and graph.n_nodes <= CLARABEL_MARGIN_ROWS:
        load_solver()
    with deadline.time_limit(SEARCHING * seconds):
        if begin is not None:
            progress(STEPS[0])
            more: dict[str, Any] = {"samples": FEW_SAMPLES} if graph.n_nodes > SIMULATED_NODES else {}
            if sliding:
                more |= {"sigma0": [float(x) for x in manifold or ()], "disturbance": disturbance}
            with share_of_time(SHARES[0], STEPS[0], cut_off):
                try:
                    trajectory = simulate(graph, protocol, [float(x) for x in begin], **more)
                except SimulationError as error:
                    notes.append(f"simulation: {error}")
        progress(STEPS[1])
        with share_of_time(SHARES[1], STEPS[1], cut_off):
            V, proof, numerical = _search_and_prove(structure, theorem, notes)
        progress(STEPS[2])
        with share_of_time(SHARES[2], STEPS[2], cut_off):
            sharpening = _sharpen(structure, protocol, method, instant, notes)
            cut_off += sharpening.cut_off
        if proof.rate is None and not any(m.rate > 0 for m in sharpening.members) and graph.n_edges:
            notes.insert(0, _precision_note(graph))
        progress(STEPS[3])
        limit = mean_limit(structure)  # which stands if time runs out
        with share_of_time(SHARES[3], STEPS[3], cut_off):
            limit = prove_rate_limit(structure)
    progress(STEPS[4])
    matrix = influence(structure)
    gone = manifold or [Fraction(0)] * graph.n_nodes
    moved = None if start is None else [x - s if s else x for x, s in zip(start, gone, strict=True)]
    result = None if moved is None else outcome(structure, moved, matrix=matrix)
    enclosed = None
    if not matrix.exact:
        try:
            enclosed = enclose(structure, matrix, moved)
        except NotEnclosedError as error:
            notes.append(f"the outcome is floating point only: {error}")
    if enclosed is not None and result is not None:
        result = enclosed.outcome(result)
    if trajectory is not None and result is not None:
        gap = float(np.abs(trajectory.final_state - result.values).max())
        if gap > SETTLED * max(float(max(map(abs, (*(start or ()), *gone)))), 1e-300):
            notes.append(f"the simulated run is still {gap:.1e} from the outcome: its slowest modes had not settled")
    certificate = Certificate(
        structure=structure,
        protocol=protocol,
        theorem=theorem,
        lyapunov=V,
        proof=proof,
        numerical_rate=numerical,
        spectral_rate=_spectral_rate(structure, [proof.rate, *(m.rate for m in sharpening.members)], notes),
        start=start,
        sigma0=manifold,
        reaching=reaching,
        influence=matrix,
        outcome=result,
        enclosed=enclosed,
        trajectory=trajectory,
        sharpening=sharpening,
        limit=limit,
        method=method,
        at=instant,
        starts=region,
        limits=judged,
        delta=spread,
        noise=blur,
        time_limit=seconds,
        cut_off=tuple(cut_off),
        notes=tuple(notes),
        expectations=expectations or Expectations(),
    )
    progress(STEPS[5])
    report = certificate.checked
    if report is not None and report.accepted and report.memory > 1:
        note = f"the check of this certificate needs more than 1 GB: ptcc check --memory {math.ceil(report.memory)}"
        certificate = replace(certificate, notes=(*certificate.notes, note))
    if report is not None and not report.accepted:
        note = f"the independent check does not accept {report.rejected}: {report.reason}"
        certificate = replace(certificate, notes=(note, *certificate.notes))
    return certificate


def _limits(entry: Limits, protocol: Protocol) -> GainLimits:
    """Return limits of the gain, or refuse them."""
    limits = GainLimits(entry.gain_cap, entry.stop_before, entry.sample_period)
    if limits.ideal:
        raise ParameterError("limits that limit nothing; give gain_cap, stop_before or sample_period")
    T = protocol.T
    if limits.stop_before is not None and limits.stop_before >= T:
        raise ParameterError(f"stop_before = {float(limits.stop_before):.6g} is not below the deadline {float(T):.6g}")
    if limits.sample_period is not None and limits.sample_period > T:
        raise ParameterError(f"sample_period = {float(limits.sample_period):.6g} is beyond the deadline {float(T):.6g}")
    return limits


def _starts(structure: Structure, starts: Any) -> Starts | None:
    """Return a set of starts, or refuse it."""
    if starts is None:
        return None
    if not isinstance(starts, Starts):
        return starts_within(structure, starts)
    n = structure.graph.n_nodes
    for name, vector in (("center", starts.center), ("radius", starts.radius or starts.center)):
        if len(vector) != n:
            raise ParameterError(f"{name} of the starts has {len(vector)} entries for {n} agents")
    if any(len(axis) != n for axis in starts.axes):
        raise ParameterError(f"an axis of the starts has another number of entries than {n} agents")
    if starts.radius and starts.axes:
        raise ParameterError("starts have a radius, for a box, or axes, for an ellipsoid; leave one out")
    if any(r < 0 for r in starts.radius):
        raise ParameterError("a radius of the starts is negative")
    numbers = [x for vector in (starts.center, starts.radius, *starts.axes) for x in vector]
    if any(abs(x) > LARGEST_STATE or not writable(Fraction(x)) for x in numbers):
        raise ParameterError("the starts are beyond 1e300, or have too many digits to keep")
    return starts


def _distinct_weights(graph: SignedDigraph) -> Iterable[Fraction]:
    """Return the weights that may be long, each once."""
    table, _ = graph.weight_table()
    if table is None:
        return (graph.exact_weight(i) for i in range(graph.n_edges))
    return map(Fraction, np.unique(table).tolist()) if table.dtype.kind == "f" else ()


def _bits(value: Fraction) -> int:
    return value.numerator.bit_length() + value.denominator.bit_length()


def _longest_edge(graph: SignedDigraph) -> str:
    edge = max(range(graph.n_edges), key=lambda i: _bits(graph.exact_weight(i)))
    ends = (graph.labels[int(part[edge])] for part in (graph.source, graph.target))
    return " -> ".join(map(shorten, ends))


def _refuse_long(values: Iterable[Fraction], n: int, what: str, where: Callable[[], str]) -> None:
    """Refuse numbers of ``n`` agents whose exact arithmetic would take long: judged over a common denominator.

    Large graphs are proved row by row, in short numbers: only what their check refuses is refused.
    """
    most = int(LONGEST_BITS / n**1.25) if n <= EXACT_NODES else MAX_SCALE_BITS
    common, longest = 1, 0
    for value in values:
        common = math.lcm(common, value.denominator)
        longest = max(longest, value.numerator.bit_length() - value.denominator.bit_length())
        if common.bit_length() + longest > most:
            raise ParameterError(
                f"{what} take more than {most:,} bits over a common denominator, too many for exact proofs of {n:,} "
                f"agents (the longest is that of {where()}); round them, to 17 digits say"
            )


def _start(structure: Structure, values: Sequence[Any] | Mapping[Any, Any], name: str) -> tuple[Fraction, ...]:
    start = tuple(exact_start(structure, values, name))
    for label, value in zip(structure.graph.labels, start, strict=True):
        if abs(value) > LARGEST_STATE:
            raise ParameterError(f"{name} of agent {shorten(label)} is beyond 1e300; choose another unit")
        if not writable(value):
            raise ParameterError(f"{name} of agent {shorten(label)} has too many digits to keep; round it")
    longest = max(zip(structure.graph.labels, start, strict=True), key=lambda entry: _bits(entry[1]))[0]
    _refuse_long(start, len(start), f"the numbers of {name}", lambda: f"agent {shorten(longest)}")
    return start


def _reaching(
    structure: Structure, protocol: Protocol, sigma0: Sequence[Any] | Mapping[Any, Any] | None
) -> tuple[tuple[Fraction, ...] | None, tuple[ReachingTime, ...] | None]:
    """Return ``sigma(0)`` and the proved reaching times; nothing for the nominal protocol."""
    sliding = protocol.reaching
    if sliding is None:
        return None, None
    start = (Fraction(0),) * len(structure.graph.labels) if sigma0 is None else _start(structure, sigma0, "sigma0")
    times = certified_reaching_times(sliding, start)
    # Whatever the check could not confirm is not claimed.
    asked = [r.z for r, s in zip(times, start, strict=True) if s and r.z is not None]
    pole = sliding.mu3 * sliding.kappa
    known = decay_integrals_below(sliding.T_r, sliding.mu2, pole, asked, REACHING_BITS)
    push = sliding.mu1 - sliding.delta
    return start, tuple(
        r if r.z is None or abs(s) <= push * known.get(r.z, Fraction(0)) else ReachingTime(r.deadline, None)
        for r, s in zip(times, start, strict=True)
    )


def _search_and_prove(
    structure: Structure, theorem: Theorem, notes: list[str]
) -> tuple[LyapunovFunction | None, RateProof, float | None]:
    n = structure.graph.n_nodes
    nothing = RateProof(None, ())
    if n > SEARCH_NODES:
        notes.append(f"the search of the paper's certificate stops at {SEARCH_NODES} nodes; the graph has {n}")
        return None, nothing, None
    try:
        with np.errstate(all="ignore"):
            search = partial(_searched, theorem, structure)
            (V,) = apart(search) if n > APART_NODES else search()
            numerical = theorem.rate(structure, V) if V.blocks else None
    except OutOfTime:
        raise
    except (LMIError, np.linalg.LinAlgError) as error:
        notes.append(f"no Lyapunov matrix was found: {error}")
        return None, nothing, None
    except (
        HypothesisError,
        ZeroDivisionError,
        OverflowError,
    ):  # the structure meets the hypotheses exactly, so it is the floats that do not
        notes.append("no Lyapunov matrix was found: the weights lie too far apart for floating point")
        return None, nothing, None
    if n > EXACT_NODES:
        notes.append(f"the paper's certificate is proved up to {EXACT_NODES} nodes; the graph has {n}")
        return V, nothing, numerical
    with np.errstate(all="ignore"):
        proof = theorem.prove(structure, V)
    if proof.failed:
        notes.append(proof.failed)
    return V, proof, numerical


def _searched(theorem: Theorem, structure: Structure) -> list[LyapunovFunction]:
    return [theorem.lyapunov(structure)]


def _instant(at: Any, protocol: Protocol) -> Fraction:
    """Read an instant before the deadline."""
    try:
        instant = as_fraction(at, "at")
    except NumberError as error:
        raise ParameterError(f"at: {error}") from None
    if not 0 <= instant < protocol.T:
        raise ParameterError(
            f"at = {float(instant):.12g} is not an instant before the deadline {float(protocol.T):.12g}"
        )
    return instant


def _sharpen(
    structure: Structure, protocol: Protocol, method: str, at: Fraction | None, notes: list[str]
) -> Sharpening:
    """Search sharper Lyapunov functions for the instants that the screen reports, and for ``at``."""
    n, gain = structure.graph.n_nodes, protocol.gain
    clocks = [float(gain.clock_at_remaining(1 - fraction)) for fraction in FRACTIONS]
    if n > EXACT_NODES:
        if method not in ("perron", "lmi", "best"):
            notes.append(f"above {EXACT_NODES} nodes only the classes perron and lmi are proved; the graph has {n}")
            return Sharpening()
        if at is not None:
            clocks.append(float(gain.clock_at_remaining(float(1 - at / protocol.T))))
        found = sharpen_large(structure, method, clocks)
        notes.extend(found.notes)
        return found
    own = None if at is None else float(gain.clock_at_remaining(float(1 - at / protocol.T)))
    found = sharpen(ErrorSystem(structure), method, clocks, own)
    notes.extend(found.notes)
    return found


def _precision_note(graph: SignedDigraph) -> str:
    """Tell how far apart the weights lie, where no rate was proved."""
    decades = graph.weight_decades
    if decades < MANY_DECADES:
        return "no rate was proved"
    return f"no rate was proved; the weights span {decades} decades, which may be too many for float64"


def _spectral_rate(structure: Structure, proved: Sequence[Fraction | None], notes: list[str]) -> float | None:
    if int(np.bincount(structure.strong_component).max()) > FACTOR_NODES:
        notes.append(f"the spectral rate is not computed for strong components above {FACTOR_NODES} nodes")
        return None
    try:
        rate = laplacian_spectrum(structure).spectral_rate
    except np.linalg.LinAlgError:
        rate = math.nan
    if rate is not None and not (rate > 0 and math.isfinite(rate) and max(x or 0 for x in proved) <= rate * (1 + 1e-6)):
        notes.append("the spectral rate was not found, or is lost in the rounding of float64")
        return None
    return rate


def _json(document: dict[str, Any]) -> str:
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
