"""Certificates: what is claimed about a graph under a protocol, what was proved, what was only observed.

``certify`` is the main job: structure -> theorem -> Lyapunov function -> proved rate -> outcome -> comparison with
CVODES. Everything a certificate says outside ``unverified`` was established in exact arithmetic; a simulation
corroborates and never proves.
"""

from __future__ import annotations

import html
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lmi.errors import LMIError
from ptcc_certify.bounds import FRACTIONS, LAST_INSTANTS, Comparison, Envelope, Member
from ptcc_certify.distance import DistanceBound, OutcomeGeometry
from ptcc_certify.error_system import ErrorSystem
from ptcc_certify.errors import FormatError, HypothesisError, NumberError, ParameterError, SimulationError
from ptcc_certify.graph import SignedDigraph
from ptcc_certify.io import write_atomically
from ptcc_certify.lemmas import EXACT_NODES, laplacian_spectrum
from ptcc_certify.outcomes import Influence, Outcome, exact_start, influence, outcome
from ptcc_certify.protocols import Protocol, SlidingModeProtocol
from ptcc_certify.rationals import as_fraction, format_exact, shorten, writable
from ptcc_certify.reaching import ReachingTime, certified_reaching_times
from ptcc_certify.sharpen import DIAGONAL, METHODS, Sharpening, sharpen
from ptcc_certify.simulation import simulate
from ptcc_certify.sliding_bounds import SlidingEnvelope
from ptcc_certify.structure import Claim, Structure, analyse
from ptcc_certify.summary import certificate_lines
from ptcc_certify.theorems import LyapunovFunction, Obligation, RateProof, Theorem, sliding_claim, theorem_for
from ptcc_certify.trajectory import SlidingTrajectory, Trajectory

SCHEMA = "ptcc-certificate/1"
PROPOSITION_1 = "||sigma(t)|| <= phi(t,T_r)^(-mu3) e^(-mu2 t) ||sigma(0)||"
DISTANCE = Obligation(
    "distance", "|x_k - (Q x)_k|^2 <= c_k V, ||x - Q x||^2 <= c V", "L (x - Q x) = -E, ball arithmetic"
)
CERTIFIED, UNDECIDED = "certified", "undecided"
#: Largest graph for which the search of the paper's certificate (dense semidefinite cones) is started.
SEARCH_NODES = 150
#: A simulated end state is settled when it is this near to the outcome, relative to the start.
SETTLED = 1e-6
#: Largest strong component whose dense spectrum is computed.
SPECTRUM_NODES = 1500
#: Above this many components the list of components is grouped in arrays.
MANY_COMPONENTS = 100
#: Largest entry of a start, in size: outcomes and trajectories are also reported as floats.
LARGEST_STATE = Fraction(10**300)


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
        The paper's rate in floating point; nothing is claimed about it.
    spectral_rate : float or None
        ``2 min Re lambda`` in floating point: no certificate can reach further.
    start : tuple of Fraction or None
    sigma0 : tuple of Fraction or None
        ``sigma(0)`` of the sliding-mode protocol; None for the nominal one.
    reaching : tuple of ReachingTime or None
        When each sliding variable is proved to be 0, whatever the disturbance.
    influence : Influence
        ``Q``, factored.
    outcome : Outcome or None
        ``Q X(0)``, for the sliding-mode protocol ``Q (X(0) - sigma(0))``; None without a start.
    trajectory : Trajectory or None
    comparison : Comparison or None
    sharpening : Sharpening
        Sharper Lyapunov functions of the classes that ``method`` names, proved.
    method : str
    at : Fraction or None
        Instant for which the bound was optimised.
    notes : tuple of str
        What kept the verdict from ``certified``, and other remarks.
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
    outcome_proof: tuple[Obligation, ...]
    sliding_proof: tuple[Obligation, ...]
    trajectory: Trajectory | None
    comparison: Comparison | None
    sharpening: Sharpening
    method: str
    at: Fraction | None
    notes: tuple[str, ...]

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
        return tuple(map(sliding_claim, claims)) if isinstance(self.protocol, SlidingModeProtocol) else claims

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
        return self._fastest[1] if self.rate is not None else None

    @property
    def _fastest(self) -> tuple[Fraction, Fraction, str]:
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
        return self.lyapunov is not None and not self.lyapunov.blocks

    @property
    def obligations(self) -> tuple[Obligation, ...]:
        """Everything that was proved."""
        sharper = (o for member in self.sharpening.members for o in member.obligations)
        members = self.envelope.members
        distance = (DISTANCE,) if any(m.distance is not None for m in members) else ()
        return (*self.proof.obligations, *sharper, *distance, *self.sliding_proof, *self.outcome_proof)

    @property
    def verdict(self) -> str:
        """``certified`` if rate and outcome were proved in exact arithmetic, otherwise ``undecided``."""
        proved = self.constant or self.rate is not None
        return CERTIFIED if proved and self.influence.exact else UNDECIDED

    @property
    def tightness(self) -> float | None:
        """Proved rate over spectral rate, at most 1."""
        if self.rate is None or not self.spectral_rate:
            return None
        return float(self.rate) / self.spectral_rate

    @property
    def direct(self) -> bool:
        """Whether the decay begins at 0: nominal protocol, or ``sigma(0) = 0``."""
        return not any(self.sigma0 or ())

    @cached_property
    def rate_limit(self) -> Fraction | None:
        """An exact upper bound of every rate: ``2 trace(L) / r``, twice the mean of the ``r`` nonzero eigenvalues."""
        r = self.graph.n_nodes - len(self.influence.balanced)
        trace = sum((abs(self.graph.exact_weight(i)) for i in range(self.graph.n_edges)), Fraction(0))
        return 2 * trace / r if r else None

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
        if isinstance(self.protocol, SlidingModeProtocol):
            sigma0, reaching = self.sigma0 or (), self.reaching or ()
            return SlidingEnvelope(self.structure, self.protocol.gain, tuple(members), self.protocol, sigma0, reaching)
        return Envelope(self.structure, self.protocol.gain, tuple(members))

    @cached_property
    def _geometry(self) -> OutcomeGeometry | None:
        return OutcomeGeometry(self.structure, self.influence) if self.influence.exact else None

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
            The certificate has no start.
        """
        envelope, start = self.envelope, self._known_start()
        if isinstance(envelope, SlidingEnvelope) and not envelope.direct:
            return envelope.state_bound(np.asarray(remaining, dtype=float), start)
        return envelope.bound(self._clocks(remaining), start)

    def outcome_distance(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Bound of ``|x_k(t) - x_k(T)|`` from the start, (N, M), at the instants where ``1 - t/T`` is ``remaining``.

        Under the sliding-mode protocol whatever the disturbance.

        Raises
        ------
        ParameterError
            The certificate has no start.
        """
        envelope, start = self.envelope, self._known_start()
        if isinstance(envelope, SlidingEnvelope) and not envelope.direct:
            return envelope.outcome_distance(np.asarray(remaining, dtype=float), start)
        return envelope.distance(self._clocks(remaining), start)

    def _known_start(self) -> tuple[Fraction, ...]:
        if self.start is None:
            raise ParameterError("the certificate has no start; give x0")
        return self.start

    def _clocks(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        return np.array([float(self.protocol.gain.clock_at_remaining(q)) for q in remaining])

    def best_possible_residual(self, remaining: float) -> float | None:
        """``e^(-spectral rate s / 2)`` where ``1 - t/T`` is ``remaining``: what the slowest mode leaves (numerical)."""
        if self.spectral_rate is None:
            return None
        return math.exp(-self.spectral_rate * self.protocol.gain.clock_at_remaining(remaining) / 2)

    def to_dict(self) -> dict[str, Any]:
        """Return the certificate as JSON-ready data of schema ``ptcc-certificate/1``."""
        labels = self.graph.labels
        return {
            "schema": SCHEMA,
            "producer": _producer(),
            "graph": _graph_section(self.graph),
            "structure": _structure_section(self.structure),
            "claim": None if self.claim is None else _claim_section(self.claim),
            **({} if self.claim else {"components": _components_section(self.structure, self.claims, self.outcome)}),
            "protocol": self._protocol_section(),
            "paper": self._paper_section(),
            "lyapunov": {"members": self._members_section()},
            "rates": {
                "paper": _text(self.proof.rate),
                "diagonal": _text(self.diagonal_rate),
                "certified": _text(self.rate),
            },
            "prefactor": self._prefactor_section(),
            "initial_state": self.start and dict(zip(labels, map(format_exact, self.start), strict=True)),
            "sigma0": self.sigma0 and dict(zip(labels, map(format_exact, self.sigma0), strict=True)),
            "outcome": self._outcome_section(),
            "reaching_time": self._reaching_section(),
            "effort": None,
            "proof": [_obligation_section(o) for o in self.obligations],
            "verdict": self.verdict,
            "unverified": self._unverified_section(),
        }

    def to_json(self) -> str:
        """Return the certificate as one JSON object, without NaN or infinity."""
        return json.dumps(self.to_dict(), indent=1, ensure_ascii=False, allow_nan=False) + "\n"

    def save(self, path: str | Path) -> None:
        """Write the certificate to ``path``; the file appears whole or not at all."""
        # What UTF-8 cannot hold, a lone surrogate in a label, becomes its JSON escape.
        write_atomically(path, self.to_json().encode("utf-8", "backslashreplace"))

    def _protocol_section(self) -> dict[str, Any]:
        run = self.trajectory
        if not isinstance(self.protocol, SlidingModeProtocol):
            return self.protocol.to_dict()
        return {**self.protocol.to_dict(), "disturbance": run.source if isinstance(run, SlidingTrajectory) else None}

    def _reaching_section(self) -> dict[str, Any] | None:
        if self.reaching is None:
            return None
        return {
            "bound": PROPOSITION_1,
            "clock": "z = ln(T_r / (T_r - t)); null: certain at T_r only",
            "z": {label: _text(r.z) for label, r in zip(self.graph.labels, self.reaching, strict=True)},
        }

    def _paper_section(self) -> dict[str, Any] | None:
        V = self.lyapunov
        if V is None:
            return None
        blocks = [
            {
                "name": block.name,
                "nodes": [self.graph.labels[v] for v in block.nodes],
                "diagonal": [format_exact(w) for w in block.diagonal],
                "times_rho": block.times_rho,
            }
            for block in V.blocks
        ]
        interval = self.proof.interval
        return {
            "theorem": V.theorem,
            "objective": V.objective,
            "coordinates": V.coordinates,
            "blocks": blocks,
            "rho": _text(V.rho),
            "rho_interval": interval and {"printed": _text(interval.printed), "exact": _text(interval.exact)},
            "rate": _text(self.proof.rate),
            "prefactor": format_exact(V.prefactor) if V.blocks else None,
        }

    def _members_section(self) -> list[dict[str, Any]]:
        labels, sections = self.graph.labels, []
        if self.lyapunov is not None and self.proof.rate is not None:
            paper = self._paper_section() or {}
            keys = ("coordinates", "blocks", "rho", "rate", "prefactor")
            sections.append({"class": "paper", **{key: paper[key] for key in keys}})
        for member in self.sharpening.members:
            block: dict[str, Any] = {"name": "P", "nodes": [labels[v] for v in member.nodes]}
            if member.diagonal is not None:
                block["diagonal"] = [format_exact(w) for w in member.diagonal]
            else:
                rows = member.matrix or []
                block["lower_triangle"] = [[format_exact(x) for x in row[: i + 1]] for i, row in enumerate(rows)]
            sections.append(
                {
                    "class": member.kind,
                    "coordinates": "E",
                    "blocks": [{**block, "times_rho": False}],
                    "rho": None,
                    "rate": format_exact(member.rate),
                    "prefactor": format_exact(member.prefactor),
                }
            )
        for section, bound in zip(sections, self.envelope.members, strict=False):
            if (distance := bound.distance) is not None:
                agents = dict(zip(labels, map(format_exact, distance.agents), strict=True))
                section["distance"] = {"agents": agents, "norm": format_exact(distance.norm)}
        return sections

    def _prefactor_section(self) -> dict[str, Any] | None:
        if self.prefactor is None:
            return None
        kind = self._fastest[2]
        coordinates = self.lyapunov.coordinates if kind == "paper" and self.lyapunov else "E"
        return {"value": format_exact(self.prefactor), "of": f"||{coordinates}||^2"}

    def _outcome_section(self) -> dict[str, Any] | None:
        if not self.influence.exact:
            return None
        labels = self.graph.labels
        followers = self.structure.followers.tolist()
        section: dict[str, Any] = {"final_state": None, "degenerate": None}
        if self.outcome is not None:
            section["final_state"] = _labelled(labels, self.outcome.final_state)
            section["degenerate"] = list(self.outcome.degenerate)
        section["influence"] = {
            "components": [
                {"nodes": [labels[v] for v in c.nodes], "voices": [exact_or_ball(Fraction(w)) for w in voice]}
                for c, voice in zip(self.influence.balanced, self.influence.voices, strict=True)
            ],
            "followers": {
                labels[v]: [exact_or_ball(Fraction(w)) for w in pull]
                for v, pull in zip(followers, self.influence.pulls, strict=True)
            },
        }
        return section

    def _unverified_section(self) -> dict[str, Any]:
        comparison = self.comparison
        simulation = comparison and {
            "worst_ratio": _finite(comparison.worst_ratio),
            "floor": _finite(comparison.floor),
            "resolved_until": comparison.resolved_until,
            "judged": comparison.judged,
            "ratios": {str(k): _finite(v) for k, v in comparison.ratios.items()},
            "stop": comparison.stop,
            "tolerances": {"relative": comparison.tolerance},
            "distance_ratio": _finite(comparison.distance_ratio),
            "deadline_resolved": comparison.deadline_resolved,
            **self._sliding_run_section(),
        }
        floats = None
        if self.outcome is not None and not self.outcome.exact:
            floats = dict(zip(self.graph.labels, self.outcome.values.tolist(), strict=True))
        return {
            "spectral": _finite(self.spectral_rate),
            "tightness": _finite(self.tightness),
            "paper_rate": _finite(self.numerical_rate),
            "search": {
                "method": self.method,
                "at": None if self.at is None else float(self.at),
                "tried": {kind: _finite(rate) for kind, rate in self.sharpening.tried.items()},
                "diagonal_limit": _finite(self.sharpening.diagonal_limit),
            },
            "residual": {
                str(1 - q if q > 1e-3 else f"1-{q:g}"): _finite(self.envelope.residual(q))
                for q in (*(1 - f for f in FRACTIONS), *LAST_INSTANTS)
            }
            if self.direct
            else None,
            "final_state": floats,
            "simulation": simulation,
            "notes": list(self.notes),
        }

    def _sliding_run_section(self) -> dict[str, Any]:
        run, seen = self.trajectory, self.comparison
        if not isinstance(run, SlidingTrajectory) or seen is None:
            return {}
        z = run.reaching_z.tolist()
        return {
            "sliding_ratio": _finite(seen.sliding_ratio),
            "reaching_kept": seen.reaching_kept,
            "reached": {label: _finite(value) for label, value in zip(self.graph.labels, z, strict=True)},
            "disturbance_bounded_by": run.bounded_by,
        }

    def _repr_html_(self) -> str:
        """Show the screen of ``ptcc certify`` in a notebook."""
        return f"<pre>{html.escape(chr(10).join(certificate_lines(self, 'graph')))}</pre>"

    def __repr__(self) -> str:
        rate = "none" if self.rate is None else f"{float(self.rate):.6g}"
        said = self.claim.behaviour if self.claim else f"{len(self.structure.components)} components"
        return f"Certificate({said}, Theorem {self.theorem.number}, rate {rate}, {self.verdict})"


def certify(
    graph: SignedDigraph,
    protocol: Protocol,
    x0: Sequence[Any] | Mapping[Any, Any] | None = None,
    *,
    sigma0: Sequence[Any] | Mapping[Any, Any] | None = None,
    disturbance: Any = None,
    simulation: bool = True,
    method: str = "best",
    at: Any = None,
) -> Certificate:
    """Certify what a protocol does on a signed digraph.

    Parameters
    ----------
    graph : SignedDigraph
        Any signed digraph, disconnected ones included.
    protocol : NominalProtocol or SlidingModeProtocol
        With ``rho2 > 0``. Under the sliding-mode protocol everything is claimed for all disturbances within ``delta``.
    x0 : sequence of N numbers or mapping of label to number, optional
        The start, in node order or by label. Without it there is no final state and no simulation.
    sigma0 : sequence of N numbers or mapping of label to number, optional
        Sliding mode: ``sigma(0)``, by default 0, which leaves no reaching phase and ``Q X(0)`` as the outcome.
    disturbance : optional
        Sliding mode: what the simulated run meets; see :func:`ptcc_certify.simulation.simulate`.
    simulation : bool
        Whether to compare the proved bound with a CVODES run.
    method : {"best", "paper", "perron", "lmi", "full"}
        Which Lyapunov functions are searched beside the paper's; see :mod:`ptcc_certify.sharpen`.
    at : number, optional
        An instant before the deadline at which the bound should be smallest.

    Returns
    -------
    Certificate

    Raises
    ------
    ParameterError
        ``rho2 = 0`` (no deadline), a start of the wrong length, beyond 1e300 or of thousands of digits, or a
        disturbance that exceeds ``delta``.

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
    Certificate(bipartite consensus, Theorem 1.1, rate 4, certified)
    >>> cert.outcome
    Outcome(1=-1, 2=1)
    >>> robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    >>> cert = certify(g, robust, [3, 5], sigma0=[1, 0], disturbance="sin(5*k*t)")
    >>> cert, cert.reaching
    (Certificate(bipartite consensus, Theorem 4.1, rate 4, certified), (ReachingTime(0.43409, 0.566 before T_r), \
ReachingTime(0, 1 before T_r)))
    >>> cert.outcome
    Outcome(1=-1.5, 2=1.5)
    """
    if not protocol.prescribed:
        raise ParameterError("rho2 = 0 gives no deadline: nothing is prescribed to certify; give rho2 > 0")
    sliding = isinstance(protocol, SlidingModeProtocol)
    for name, value in (("sigma0", sigma0), ("disturbance", disturbance)):
        if value is not None and not sliding:
            raise ParameterError(f"{name} belongs to the sliding-mode protocol; leave it out or change the protocol")
    if method not in METHODS:
        raise ParameterError(f'method "{method}" is unknown; one of {", ".join(METHODS)}')
    instant = None if at is None else _instant(at, protocol)
    structure = analyse(graph)
    start = None if x0 is None else _start(structure, x0, "x0")
    manifold, reaching, sliding_proof = _reaching(structure, protocol, sigma0)
    trajectory = comparison = None
    notes: list[str] = []
    if simulation and start is not None:
        more = {"sigma0": [float(x) for x in manifold or ()], "disturbance": disturbance} if sliding else {}
        try:
            trajectory = simulate(graph, protocol, [float(x) for x in start], **more)
        except SimulationError as error:
            notes.append(f"simulation: {error}")
    theorem = theorem_for(structure, protocol.kind)
    V, proof, numerical = _search_and_prove(structure, theorem, notes)
    sharpening = _sharpen(structure, protocol, method, instant, notes)
    if proof.rate is None and not any(m.rate > 0 for m in sharpening.members) and (V is None or V.blocks):
        notes.insert(0, _precision_note(graph))
    matrix = influence(structure)
    gone = manifold or [Fraction(0)] * graph.n_nodes
    result = None if start is None else outcome(structure, [x - s for x, s in zip(start, gone, strict=True)])
    obligations: tuple[Obligation, ...] = ()
    if matrix.exact:
        obligations = _prove_outcome(structure, matrix, sliding)
    else:
        notes.append(f"the outcome of a graph of more than {EXACT_NODES} nodes is computed in floating point only")
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
        outcome_proof=obligations,
        sliding_proof=sliding_proof,
        trajectory=trajectory,
        comparison=comparison,
        sharpening=sharpening,
        method=method,
        at=instant,
        notes=tuple(notes),
    )
    if trajectory is None or not (certificate.envelope.members or sliding):
        return certificate
    return replace(certificate, comparison=certificate.envelope.compare(trajectory))


def _start(structure: Structure, values: Sequence[Any] | Mapping[Any, Any], name: str) -> tuple[Fraction, ...]:
    start = tuple(exact_start(structure, values, name))
    for label, value in zip(structure.graph.labels, start, strict=True):
        if abs(value) > LARGEST_STATE:
            raise ParameterError(f"{name} of agent {shorten(label)} is beyond 1e300; choose another unit")
        if not writable(value):
            raise ParameterError(f"{name} of agent {shorten(label)} has too many digits to keep; round it")
    return start


def _reaching(
    structure: Structure, protocol: Protocol, sigma0: Sequence[Any] | Mapping[Any, Any] | None
) -> tuple[tuple[Fraction, ...] | None, tuple[ReachingTime, ...] | None, tuple[Obligation, ...]]:
    """Return ``sigma(0)``, the proved reaching times and what was proved; nothing for the nominal protocol."""
    if not isinstance(protocol, SlidingModeProtocol):
        return None, None, ()
    labels = structure.graph.labels
    start = (Fraction(0),) * len(labels) if sigma0 is None else _start(structure, sigma0, "sigma0")
    times = certified_reaching_times(protocol, start)
    statement = f"mu1 > delta, mu2 > 0, mu3 > 0, so {PROPOSITION_1}, 0 from T_r on"
    numbers = {name: getattr(protocol, name) for name in ("mu1", "delta", "mu2", "mu3")}
    proved = [Obligation("sliding-bound", statement, "Proposition 1", numbers)]
    early = {label: r.z for label, r in zip(labels, times, strict=True) if r.z is not None}
    if any(start) and early:
        statement = (
            "|sigma_k(0)| <= (mu1 - delta) int_0^t dr/psi(r) at ln(T_r/(T_r - t)) = z_k, so sigma_k = 0 from t on"
        )
        proved.append(Obligation("reaching-time", statement, "comparison with the adversary", early))
    return start, times, tuple(proved)


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
            V = theorem.lyapunov(structure)
            numerical = theorem.rate(structure, V) if V.blocks else None
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
        notes.append(f"exact proofs stop at {EXACT_NODES} nodes; the graph has {n}")
        return V, nothing, numerical
    with np.errstate(all="ignore"):
        proof = theorem.prove(structure, V)
    if proof.failed:
        notes.append(proof.failed)
    return V, proof, numerical


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
    if n > EXACT_NODES:
        if method != "paper":
            notes.append(f"sharper Lyapunov functions are searched up to {EXACT_NODES} nodes; the graph has {n}")
        return Sharpening()
    clocks = [float(gain.clock_at_remaining(1 - fraction)) for fraction in FRACTIONS]
    own = None if at is None else float(gain.clock_at_remaining(float(1 - at / protocol.T)))
    found = sharpen(ErrorSystem(structure), method, clocks, own)
    notes.extend(found.notes)
    return found


def _precision_note(graph: SignedDigraph) -> str:
    """Tell how far apart the weights lie, where no rate was proved."""
    sizes = [abs(graph.exact_weight(i)) for i in range(graph.n_edges)]
    ratio = max(sizes) / min(sizes)
    decades = len(str(ratio.numerator // ratio.denominator)) - 1
    return f"no rate was proved; the weights span {decades} decades, of which float64 resolves less than 16"


def _prove_outcome(structure: Structure, matrix: Influence, sliding: bool) -> tuple[Obligation, ...]:
    """Check in rationals that ``Q`` maps into the kernel of ``L`` and keeps what the motion keeps.

    ``L Q = 0`` column by column of the factored form, ``eta_k' M(L_Lk) = 0`` and ``eta_k' 1 = 1``; since the kernel
    of ``L`` has dimension ``m_b`` and ``d/dt eta_k' G_k X_Lk = 0``, these determine ``Q``.
    """
    graph = structure.graph
    L = graph.exact_laplacian()
    for column, (component, voice) in enumerate(zip(matrix.balanced, matrix.voices, strict=True)):
        state = [Fraction(0)] * graph.n_nodes
        for v, sign in zip(component.nodes, component.gauge or (), strict=True):
            state[v] = Fraction(sign)
        for v, pull in zip(structure.followers.tolist(), matrix.pulls, strict=True):
            state[v] = Fraction(pull[column])
        if any(sum((a * x for a, x in zip(row, state, strict=True) if a and x), Fraction(0)) for row in L):
            raise ArithmeticError("internal check failed: the outcome is not in the kernel of L")
        own = component.nodes
        eta = [sign * Fraction(w) for sign, w in zip(component.gauge or (), voice, strict=True)]
        M = [[abs(L[i][j]) if i == j else -abs(L[i][j]) for j in own] for i in own]
        kept = all(sum((e * row[j] for e, row in zip(eta, M, strict=True)), Fraction(0)) == 0 for j in range(len(own)))
        if not kept or sum(eta) != 1:
            raise ArithmeticError("internal check failed: the outcome does not keep eta' G X")
    statement = "L Q = 0 and eta_k' G_k X_Lk is kept by the motion, so X(T) = Q X(0)"
    if sliding:
        statement = "L Q = 0 and Q (X - sigma) is kept by the motion, so X(T_r + T_s) = Q (X(0) - sigma(0))"
    return (Obligation("outcome", statement, "Lemmas 2, 8 and 9"),)


def _spectral_rate(structure: Structure, proved: Sequence[Fraction | None], notes: list[str]) -> float | None:
    if int(np.bincount(structure.strong_component).max()) > SPECTRUM_NODES:
        notes.append(f"the spectral rate is not computed for strong components above {SPECTRUM_NODES} nodes")
        return None
    try:
        rate = laplacian_spectrum(structure).spectral_rate
    except np.linalg.LinAlgError:
        rate = math.nan
    if rate is not None and not (rate > 0 and math.isfinite(rate) and max(x or 0 for x in proved) <= rate * (1 + 1e-6)):
        notes.append("the spectral rate is lost in the rounding of float64")
        return None
    return rate


def exact_or_ball(value: Fraction) -> str | dict[str, str]:
    """Write a rational exactly, or as a ball ``{mid, radius}`` that contains it where the text would be too long.

    Examples
    --------
    >>> exact_or_ball(Fraction(1, 3))
    '1/3'
    >>> sorted(exact_or_ball(Fraction(1, 3**9000)))
    ['mid', 'radius']
    """
    if writable(value):
        return format_exact(value)
    scale = 10**60
    mid = round(value * scale)
    return {"mid": f"{mid}e-60", "radius": "1e-60"}


def structure_json(structure: Structure) -> dict[str, Any]:
    """Return graph, structure and claim as JSON-ready data, in the keys of a certificate."""
    data = {"graph": _graph_section(structure.graph), "structure": _structure_section(structure)}
    if structure.claim is not None:
        return {**data, "claim": _claim_section(structure.claim)}
    claims = [component.claim for component in structure.components]
    return {**data, "claim": None, "components": _components_section(structure, claims, None)}


def read_certificate(path: str | Path) -> dict[str, Any]:
    """Read the JSON of a certificate strictly: no duplicate keys, no NaN or infinity, the known schema.

    Raises
    ------
    FormatError
        Names the file and what is wrong.
    """

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        result = dict(pairs)
        if len(result) != len(pairs):
            raise ValueError("a key occurs twice")
        return result

    def finite(text: str) -> float:
        if not math.isfinite(number := float(text)):
            raise ValueError(f"{shorten(text)} is not a finite number")
        return number

    name = shorten(str(path), 200)
    try:
        text = Path(path).read_text(encoding="utf-8")
        data = json.loads(text, object_pairs_hook=unique, parse_constant=finite, parse_float=finite)
    except (OSError, ValueError, RecursionError) as error:
        raise FormatError(f"{name}: not a readable certificate ({shorten(str(error), 160)})") from None
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise FormatError(f'{name}: not a certificate of schema "{SCHEMA}"')
    return data


def _producer() -> str:
    from importlib.metadata import version

    return f"ptcc-certify {version('ptcc-certify')}"


def _graph_section(graph: SignedDigraph) -> dict[str, Any]:
    read = graph.read
    return {
        "nodes": list(graph.labels),
        "edges": [[s, t, format_exact(w)] for s, t, w in graph.edges],
        "read": {key: read[key] for key in ("orientation", "duplicates", "self_loops", "undirected")},
        "sha256": graph.sha256,
    }


def _structure_section(structure: Structure) -> dict[str, Any]:
    labels = structure.graph.labels
    closed = []
    for component in structure.closed_components:
        entry: dict[str, Any] = {"nodes": [labels[v] for v in component.nodes], "balanced": component.balanced}
        if component.gauge is not None:
            entry["gauge"] = list(component.gauge)
        if component.negative_cycle is not None:
            entry["negative_cycle"] = [[labels[s], labels[t]] for s, t in component.negative_cycle]
        closed.append(entry)
    return {
        "connectivity": structure.connectivity,
        "closed_components": closed,
        "leaders": [labels[v] for v in structure.leaders.tolist()],
        "followers": [labels[v] for v in structure.followers.tolist()],
        "balanced": structure.balanced,
        "sign_symmetric": structure.sign_symmetric,
    }


def _claim_section(claim: Claim) -> dict[str, Any]:
    return {"theorem": claim.theorem, "behaviour": claim.behaviour, "corollaries": list(claim.corollaries)}


def _components_section(structure: Structure, claims: Sequence[Claim], result: Outcome | None) -> Any:
    components, labels = structure.components, structure.graph.labels
    if len(components) > MANY_COMPONENTS:
        return {
            "nodes": [[labels[v] for v in c.nodes] for c in components],
            "connectivity": [c.connectivity for c in components],
            "theorem": [claim.theorem for claim in claims],
            "behaviour": [claim.behaviour for claim in claims],
            "corollaries": [list(claim.corollaries) for claim in claims],
        }
    state = result.final_state if result is not None and result.exact else None
    return [
        {
            "nodes": [labels[v] for v in c.nodes],
            "connectivity": c.connectivity,
            "claim": _claim_section(claim),
            "outcome": None if state is None else {labels[v]: exact_or_ball(Fraction(state[v])) for v in c.nodes},
        }
        for c, claim in zip(components, claims, strict=True)
    ]


def _obligation_section(obligation: Obligation) -> dict[str, Any]:
    numbers = {name: format_exact(value) for name, value in obligation.numbers.items()}
    return {"kind": obligation.kind, "statement": obligation.statement, "lemma": obligation.lemma, "numbers": numbers}


def _labelled(labels: Sequence[str], values: Sequence[Any]) -> dict[str, Any]:
    return {label: exact_or_ball(Fraction(value)) for label, value in zip(labels, values, strict=True)}


def _text(value: Fraction | None) -> str | None:
    return None if value is None else format_exact(value)


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
