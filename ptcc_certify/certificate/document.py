"""The JSON of a certificate, schema ``ptcc-certificate/1``; ``FORMAT.md`` specifies it."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.bounds.enclosed_state import EnclosedOutcome
from ptcc_certify.bounds.envelope import FRACTIONS, LAST_INSTANTS
from ptcc_certify.bounds.final_state import Influence
from ptcc_certify.bounds.input import EnergyIntegral, Peak, effort_section, energy_witness, peak_witness
from ptcc_certify.checker import MANY_COMPONENTS, SCHEMA, SLIDING_BOUND, SLIDING_CLOCK, digest
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.rationals import MAX_EXPONENT, format_exact, writable
from ptcc_certify.graphs.structure import Claim, Structure
from ptcc_certify.lyapunov.dominance import DominantMember
from ptcc_certify.theorems import Obligation

if TYPE_CHECKING:
    from ptcc_certify.certificate.certificate import Certificate

#: Vectors above this length go to side files.
LONG = 50_000
#: Decimals of the middle of a ball, and its radius, where an exact number would be too long.
_DECIMALS, _RADIUS = 120, Fraction(1, 10**60)

Interval = tuple[Fraction, Fraction]


class Writer:
    """Writes the vectors of a document: in the JSON, or the long ones to side files.

    Parameters
    ----------
    labels : sequence of str
        Of the nodes.
    files : bool
        Whether vectors of more than ``LONG`` entries go to side files.

    Attributes
    ----------
    files : dict of str to bytes
        Names and contents of the side files, ``.npy`` vectors of 64-bit numbers.
    told : set of tuple
        The proofs of leader groups that are written already: first row, rate, weights.
    """

    def __init__(self, labels: Sequence[str], files: bool = False):
        self.labels, self._aside = labels, files
        self.files: dict[str, bytes] = {}
        self.told: set[tuple[int, Fraction, bytes]] = set()

    def aside(self, length: int) -> bool:
        """Tell whether a vector of this length goes to a side file."""
        return self._aside and length > LONG

    def file(self, name: str, values: np.ndarray) -> dict[str, Any]:
        """Put int64 or float64 numbers into a side file; return its name and hash."""
        kind = "<f8" if values.dtype.kind == "f" else "<i8"
        head = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': ({values.size},), }}".ljust(117) + "\n"
        content = b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head.encode() + values.astype(kind).tobytes()
        sha256 = hashlib.sha256(content).hexdigest()
        file = f"{sha256[:16]}-{name}.npy"
        self.files[file] = content
        return {"file": file, "sha256": sha256}

    def vector(self, name: str, values: np.ndarray) -> dict[str, Any]:
        """Put int64 or float64 numbers into a side file; return what stands for the vector."""
        return {**self.file(name, values), "count": values.size}

    def nodes(self, nodes: Sequence[int] | np.ndarray) -> Any:
        """Write node indices as labels, or as a side file of indices."""
        if self.aside(len(nodes)):
            return self.vector("nodes", np.asarray(nodes, dtype=np.int64))
        return [self.labels[v] for v in np.asarray(nodes, dtype=np.int64).tolist()]

    def floats(self, name: str, values: np.ndarray) -> Any:
        """Write floats as the dyadic numbers that they are."""
        if self.aside(values.size):
            return self.vector(name, values)
        return [x.hex() for x in values.tolist()]

    def integers(self, name: str, values: np.ndarray) -> Any:
        """Write int64 numbers."""
        return self.vector(name, values.astype(np.int64)) if self.aside(values.size) else values.tolist()

    def state(self, name: str, state: Sequence[Fraction] | None) -> Any:
        """Write one number of each agent: by label, or as a side file of integers over a common denominator."""
        if state is None:
            return None
        if self.aside(len(state)):
            scale = math.lcm(*{x.denominator for x in state})
            if scale.bit_length() < 63:
                whole = [x.numerator * (scale // x.denominator) for x in state]
                if max(map(abs, whole)) < 2**63:
                    return {**self.vector(name, np.array(whole, dtype=np.int64)), "scale": str(scale)}
        return dict(zip(self.labels, map(format_exact, state), strict=True))


def certificate_document(certificate: Certificate, verdict: str, files: bool = False) -> tuple[dict[str, Any], Writer]:
    """Return the certificate as JSON-ready data, and what holds its side files."""
    graph, structure = certificate.graph, certificate.structure
    out = Writer(graph.labels, files)
    claim, outcome = certificate.claim, outcome_section(certificate, out)
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "producer": producer(),
        "graph": graph_section(graph, out),
        "structure": structure_section(structure, out),
        "claim": None if claim is None else claim_section(claim),
    }
    if claim is None:
        final = outcome and outcome["final_state"]
        document["components"] = components_section(structure, certificate.claims, final, out)
    document |= {
        "protocol": _protocol_section(certificate),
        "paper": _paper_section(certificate),
        "lyapunov": {"members": _members_section(certificate, out)},
        "rates": {
            "paper": _text(certificate.proof.rate),
            "diagonal": _text(certificate.diagonal_rate),
            "certified": _text(certificate.rate),
            "limit": _text(certificate.upper_bound),
        },
        "prefactor": _prefactor_section(certificate),
        "initial_state": out.state("start", certificate.start),
        "sigma0": out.state("sigma", certificate.sigma0),
        "outcome": outcome,
        "reaching_time": _reaching_section(certificate),
        "effort": effort_section(certificate.effort, graph.labels, format_exact),
        "proof": [obligation_section(o, certificate, out) for o in certificate.obligations],
        "verdict": verdict,
    }
    return document | {"digest": digest(document), "unverified": _unverified_section(certificate)}, out


def structure_document(structure: Structure) -> dict[str, Any]:
    """Return graph, structure and claim as JSON-ready data, in the keys of a certificate."""
    out = Writer(structure.graph.labels)
    data = {"graph": graph_section(structure.graph, out), "structure": structure_section(structure, out)}
    if structure.claim is not None:
        return {**data, "claim": claim_section(structure.claim)}
    claims = [component.claim for component in structure.components]
    return {**data, "claim": None, "components": components_section(structure, claims, None, out)}


# ---------------------------------------------------------------------- numbers


def exact_or_ball(value: Fraction) -> str | dict[str, str]:
    """Write a rational exactly, or as a ball ``{mid, radius}`` that contains it where the text would be too long.

    Examples
    --------
    >>> exact_or_ball(Fraction(1, 3))
    '1/3'
    >>> sorted(exact_or_ball(Fraction(1, 3**9000)))
    ['mid', 'radius']
    """
    return format_exact(value) if writable(value) else _ball_text((value, _RADIUS))


def _interval_text(interval: Interval) -> str | dict[str, str]:
    return exact_or_ball(interval[0]) if interval[1] == 0 else _ball_text(interval)


def _ball_text(interval: Interval) -> dict[str, str]:
    """Write an interval as a ball that contains it, with short decimals."""
    middle, radius = interval
    unit = 10**_DECIMALS
    mid = round(middle * unit)
    wide = math.ceil((radius + abs(middle - Fraction(mid, unit))) * unit)
    return {"mid": f"{mid}e-{_DECIMALS}", "radius": f"{wide}e-{_DECIMALS}"}


def decimal_text(value: Fraction) -> str:
    """Write a rational whose denominator divides a power of ten as digits and an exponent.

    Examples
    --------
    >>> decimal_text(Fraction(-3, 80)), decimal_text(Fraction(12))
    ('-375e-4', '12')
    """
    places, left = 0, value.denominator
    while left > 1:
        left //= math.gcd(left, 10)
        places += 1
    if places > MAX_EXPONENT:
        return format_exact(value)
    digits = value.numerator * (10**places // value.denominator)
    return f"{digits}e-{places}" if places else str(digits)


def _text(value: Fraction | None) -> str | None:
    return None if value is None else format_exact(value)


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


# ---------------------------------------------------------------------- outcome


def influence_balls(matrix: Influence) -> tuple[list[list[Interval]], list[list[Interval]]]:
    """Return voices and pulls as intervals: of radius 0, but for those of a component that are too long to write."""
    voices = [_balls([Fraction(w) for w in voice]) for voice in matrix.voices]
    rows = matrix.pulls or ()
    columns = [_balls([Fraction(row[k]) for row in rows]) for k in range(len(matrix.voices))]
    pulls = [list(row) for row in zip(*columns, strict=True)] if columns else [[] for _ in rows]
    return voices, pulls


def _balls(values: Sequence[Fraction]) -> list[Interval]:
    if all(map(writable, values)):
        return [(x, Fraction(0)) for x in values]
    unit = 10**_DECIMALS
    return [(Fraction(round(x * unit), unit), _RADIUS) for x in values]


def outcome_witness(structure: Structure, matrix: Influence) -> dict[str, Any] | None:
    """Return ``u > 0`` with ``M u > 0`` on followers and on leader groups less one agent, if balls need it.

    ``M`` is the comparison matrix of ``L_F``, and that of ``L_k`` transposed. From it follows how far a ball's middle
    may be from the truth.
    """
    voices, pulls = influence_balls(matrix)
    if not any(r for row in (*voices, *pulls) for _, r in row):
        return None
    u = np.ones(structure.graph.n_nodes)
    L = structure.graph.laplacian().toarray()
    M = np.diag(np.diag(L)) * 2 - np.abs(L)
    groups = [(structure.followers.tolist(), M)]
    for component, voice in zip(matrix.balanced, voices, strict=True):
        top = max(range(len(voice)), key=lambda i: abs(voice[i][0]))
        groups.append(([v for i, v in enumerate(component.nodes) if i != top], M.T))
    for nodes, block in groups:
        if nodes:
            own = block[np.ix_(nodes, nodes)]
            u[nodes] = np.abs(np.linalg.solve(own / np.diag(own)[:, None], np.ones(len(nodes))))
    return {"u": {label: format_exact(Fraction(float(x))) for label, x in zip(structure.graph.labels, u, strict=True)}}


def outcome_section(certificate: Certificate, out: Writer) -> dict[str, Any] | None:
    """Return the outcome with the influence of every leader, exact or in balls; None if it is floating point."""
    matrix, structure = certificate.influence, certificate.structure
    if not matrix.exact:
        return None if certificate.enclosed is None else _enclosed_section(certificate, certificate.enclosed, out)
    labels = certificate.graph.labels
    voices, pulls = influence_balls(matrix)
    section: dict[str, Any] = {"final_state": None, "degenerate": None}
    if certificate.outcome is not None and certificate.start is not None:
        gone = certificate.sigma0 or [Fraction(0)] * len(labels)
        moved = [x - s for x, s in zip(certificate.start, gone, strict=True)]
        final: list[Interval] = [(Fraction(0), Fraction(0))] * len(labels)
        values = []
        for component, voice in zip(matrix.balanced, voices, strict=True):
            middle = sum((w * moved[v] for v, (w, _) in zip(component.nodes, voice, strict=True)), Fraction(0))
            radius = sum((r * abs(moved[v]) for v, (_, r) in zip(component.nodes, voice, strict=True)), Fraction(0))
            values.append((middle, radius))
            for v, sign in zip(component.nodes, component.gauge or (), strict=True):
                final[v] = (sign * middle, radius)
        for v, row in zip(structure.followers.tolist(), pulls, strict=True):
            pairs = list(zip(row, values, strict=True))
            middle = sum((w * x for (w, _), (x, _) in pairs), Fraction(0))
            final[v] = (middle, sum((abs(w) * s + r * abs(x) + r * s for (w, r), (x, s) in pairs), Fraction(0)))
        section["final_state"] = {label: _interval_text(x) for label, x in zip(labels, final, strict=True)}
        section["degenerate"] = list(certificate.outcome.degenerate)
    section["influence"] = {
        "components": [
            {"nodes": [labels[v] for v in c.nodes], "voices": [_interval_text(w) for w in voice]}
            for c, voice in zip(matrix.balanced, voices, strict=True)
        ],
        "followers": {
            labels[v]: [_interval_text(w) for w in row]
            for v, row in zip(structure.followers.tolist(), pulls, strict=True)
        },
    }
    return section


def _enclosed_section(certificate: Certificate, enclosed: EnclosedOutcome, out: Writer) -> dict[str, Any]:
    """Return the outcome of a large graph: voices of leader groups, and the final state in intervals."""
    labels = certificate.graph.labels
    final: dict[str, Any] | None = None
    if enclosed.middle is not None and enclosed.radius is not None:
        if out.aside(len(labels)) and enclosed.unit == 1:
            final = {"mid": out.vector("mid", enclosed.middle), "radius": out.vector("radius", enclosed.radius)}
        else:
            unit = enclosed.unit
            text = repr if unit == 1 else lambda x: format_exact(Fraction(x) * unit)
            pairs = zip(enclosed.middle.tolist(), enclosed.radius.tolist(), strict=True)
            final = {
                label: {"mid": text(x), "radius": text(r)} if r else format_exact(Fraction(x) * unit)
                for label, (x, r) in zip(labels, pairs, strict=True)
            }
            final.update((labels[v], exact_or_ball(x)) for v, x in enclosed.exact.items())
    groups = []
    for k, (component, voice) in enumerate(
        zip(certificate.influence.balanced, certificate.influence.voices, strict=True)
    ):
        if k in enclosed.voices:
            pairs = zip(*(x.tolist() for x in enclosed.voices[k]), strict=True)
            voices: list[Any] = [{"mid": repr(x), "radius": repr(r)} for x, r in pairs]
        else:
            voices = [exact_or_ball(Fraction(w)) for w in voice]
        if len(component.nodes) > 1:
            groups.append({"nodes": [labels[v] for v in component.nodes], "voices": voices})
    degenerate = None if enclosed.degenerate is None else list(enclosed.degenerate)
    return {"final_state": final, "degenerate": degenerate, "influence": {"components": groups, "followers": None}}


def _dominance_witness(member: DominantMember, out: Writer) -> dict[str, Any]:
    """Return the vector, and the proof of every leader group."""
    groups: list[Any] = []
    first = 0
    for proof in member.groups:
        rate = format_exact(proof.rate)
        unit = math.frexp(float(proof.weights[0]))[1]
        key = first, proof.rate, np.ldexp(proof.weights, -unit).tobytes()
        told = key in out.told
        out.told.add(key)
        if proof.factor is None or told:
            groups.append(rate)
        else:
            # The factor is that of the group's own weights, of which those of the member are a power of two.
            times = member.weights[first] / proof.weights[0]
            factor = {
                key: out.integers(key, getattr(proof.factor, key))
                for key in ("order", "indptr", "indices", "data", "exponents")
            }
            weights = proof.factor.weights
            factor |= {
                "bits": proof.factor.bits,
                "power": proof.power + 1 - math.frexp(times)[1],
                "weights": None if weights is None else out.integers("weights", weights),
                "parents": None if proof.parents is None else out.integers("parents", proof.parents),
            }
            groups.append({"rate": rate, "factor": factor})
        first += proof.weights.size
    return {"vector": out.floats("vector", member.vector), "groups": groups}


# ---------------------------------------------------------------------- sections


def _protocol_section(certificate: Certificate) -> dict[str, Any]:
    run = certificate.trajectory
    if certificate.protocol.reaching is None:
        return certificate.protocol.to_dict()
    met = None if run is None or run.sliding is None else run.sliding.source
    return {**certificate.protocol.to_dict(), "disturbance": met}


def _reaching_section(certificate: Certificate) -> dict[str, Any] | None:
    if certificate.reaching is None:
        return None
    return {
        "bound": SLIDING_BOUND,
        "clock": SLIDING_CLOCK,
        "z": {label: _text(r.z) for label, r in zip(certificate.graph.labels, certificate.reaching, strict=True)},
    }


def _paper_section(certificate: Certificate) -> dict[str, Any] | None:
    V = certificate.lyapunov
    if V is None:
        return None
    blocks = [
        {
            "name": block.name,
            "nodes": [certificate.graph.labels[v] for v in block.nodes],
            "diagonal": [format_exact(w) for w in block.diagonal],
            "times_rho": block.times_rho,
        }
        for block in V.blocks
    ]
    interval = certificate.proof.interval
    return {
        "theorem": V.theorem,
        "objective": V.objective,
        "coordinates": V.coordinates,
        "blocks": blocks,
        "rho": _text(V.rho),
        "rho_interval": interval and {"printed": _text(interval.printed), "exact": _text(interval.exact)},
        "rate": _text(certificate.proof.rate),
        "prefactor": format_exact(V.prefactor) if V.blocks else None,
    }


def _members_section(certificate: Certificate, out: Writer) -> list[dict[str, Any]]:
    labels, sections = certificate.graph.labels, []
    if certificate.lyapunov is not None and certificate.proof.rate is not None:
        paper = _paper_section(certificate) or {}
        keys = ("coordinates", "blocks", "rho", "rate", "prefactor")
        sections.append({"class": "paper", **{key: paper[key] for key in keys}})
    for member in certificate.sharpening.members:
        block: dict[str, Any] = {"name": "P", "nodes": out.nodes(member.nodes)}
        if member.dominance is not None:
            block["diagonal"] = out.floats("diagonal", member.dominance.weights)
        elif member.diagonal is not None:
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
    for section, bound in zip(sections, certificate.envelope.members, strict=True):
        section["distance"] = None
        if (distance := bound.distance) is not None:
            agents = dict(zip(labels, map(format_exact, distance.agents), strict=True))
            section["distance"] = {"agents": agents, "norm": format_exact(distance.norm)}
    return sections


def _prefactor_section(certificate: Certificate) -> dict[str, Any] | None:
    if certificate.prefactor is None:
        return None
    kind = certificate.fastest[2]
    coordinates = certificate.lyapunov.coordinates if kind == "paper" and certificate.lyapunov else "E"
    return {"value": format_exact(certificate.prefactor), "of": f"||{coordinates}||^2"}


def _unverified_section(certificate: Certificate) -> dict[str, Any]:
    comparison = certificate.comparison
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
        **_sliding_run_section(certificate),
    }
    floats = None
    if certificate.outcome is not None and not certificate.outcome.exact:
        values = map(_finite, certificate.outcome.values.tolist())
        floats = dict(zip(certificate.graph.labels, values, strict=True))
    return {
        "spectral": _finite(certificate.spectral_rate),
        "optimality_ratio": certificate.optimality_ratio,
        "paper_rate": _finite(certificate.numerical_rate),
        "rounding_loss": _finite(certificate.rounding_loss),
        "search": {
            "method": certificate.method,
            "at": None if certificate.at is None else float(certificate.at),
            "tried": {kind: _finite(rate) for kind, rate in certificate.sharpening.tried.items()},
            "diagonal_limit": _finite(certificate.sharpening.diagonal_limit),
        },
        "residual": {
            str(1 - q if q > 1e-3 else f"1-{q:g}"): _finite(certificate.envelope.residual(q))
            for q in (*(1 - f for f in FRACTIONS), *LAST_INSTANTS)
        }
        if certificate.direct
        else None,
        "final_state": floats,
        "asked": _asked_section(certificate),
        "simulation": simulation,
        "time_limit": _finite(certificate.time_limit),
        "cut_off": list(certificate.cut_off),
        "notes": list(certificate.notes),
    }


def _asked_section(certificate: Certificate) -> dict[str, Any]:
    """Return what was asked; what became of it is no part of the claim, and follows from what is."""
    asked = certificate.expectations
    return {
        "behaviour": asked.behaviour,
        "min_rate": _text(asked.min_rate),
        "max_input": _text(asked.max_input),
        "limits": [
            {name: _text(getattr(entry, name)) for name in ("gain_cap", "stop_before", "sample_period")}
            for entry in certificate.limits
        ],
        "delta": _text(certificate.delta),
        "noise": _text(certificate.noise),
    }


def _sliding_run_section(certificate: Certificate) -> dict[str, Any]:
    seen, run = certificate.comparison, None if certificate.trajectory is None else certificate.trajectory.sliding
    if run is None or seen is None:
        return {}
    z = run.reaching_z.tolist()
    return {
        "sliding_ratio": _finite(seen.sliding_ratio),
        "reaching_kept": seen.reaching_kept,
        "reached": {label: _finite(value) for label, value in zip(certificate.graph.labels, z, strict=True)},
        "disturbance_bounded_by": run.bounded_by,
    }


def producer() -> str:
    """Return the name and version of this program, as certificates tell who made them."""
    from importlib.metadata import version

    return f"ptcc-certify {version('ptcc-certify')}"


def graph_section(graph: SignedDigraph, out: Writer) -> dict[str, Any]:
    """Return nodes, edges and how they were read."""
    read, (table, scale) = graph.read, graph.weight_table()
    edges: Any
    if out.aside(graph.n_edges) and table is not None:
        edges = {
            "count": graph.n_edges,
            "scale": str(scale),
            "source": out.file("source", graph.source),
            "target": out.file("target", graph.target),
            "weight": out.file("weight", table),
        }
    else:
        edges = [
            [graph.labels[s], graph.labels[t], w]
            for s, t, w in zip(graph.source.tolist(), graph.target.tolist(), graph.weight_texts, strict=True)
        ]
    return {
        "nodes": list(graph.labels),
        "edges": edges,
        "read": {key: read[key] for key in ("orientation", "duplicates", "self_loops", "undirected")},
        "sha256": graph.sha256,
    }


def structure_section(structure: Structure, out: Writer) -> dict[str, Any]:
    """Return components with the witnesses of their balance."""
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
        "leaders": out.nodes(structure.leaders),
        "followers": out.nodes(structure.followers),
        "balanced": structure.balanced,
        "sign_symmetric": structure.sign_symmetric,
    }


def claim_section(claim: Claim) -> dict[str, Any]:
    """Return theorem, behaviour and corollaries."""
    return {"theorem": claim.theorem, "behaviour": claim.behaviour, "corollaries": list(claim.corollaries)}


def components_section(structure: Structure, claims: Sequence[Claim], final: dict[str, Any] | None, out: Writer) -> Any:
    """Return connectivity, claim and outcome of every weak component, in arrays if there are many."""
    components, labels = structure.components, structure.graph.labels
    by_label = final is not None and len(final) == len(labels)  # not in side files
    if len(components) > MANY_COMPONENTS:
        return {
            "nodes": out.vector("component", structure.weak_component)
            if out.aside(len(labels))
            else [[labels[v] for v in c.nodes] for c in components],
            "connectivity": [c.connectivity for c in components],
            "theorem": [claim.theorem for claim in claims],
            "behaviour": [claim.behaviour for claim in claims],
            "corollaries": [list(claim.corollaries) for claim in claims],
        }
    return [
        {
            "nodes": [labels[v] for v in c.nodes],
            "connectivity": c.connectivity,
            "claim": claim_section(claim),
            "outcome": final and {labels[v]: final[labels[v]] for v in c.nodes} if by_label else None,
        }
        for c, claim in zip(components, claims, strict=True)
    ]


def obligation_section(obligation: Obligation, certificate: Certificate, out: Writer) -> dict[str, Any]:
    """Return one step of the proof."""
    witness = obligation.witness
    if isinstance(witness, DominantMember):
        witness = _dominance_witness(witness, out)
    elif isinstance(witness, EnergyIntegral):
        witness = energy_witness(witness, format_exact)
    elif isinstance(witness, Peak):
        witness = peak_witness(witness, certificate.graph.labels, format_exact)
    elif isinstance(witness, EnclosedOutcome):
        u = witness.witness
        by_label = zip(certificate.graph.labels, map(repr, u.tolist()), strict=True)
        witness = {"u": out.vector("u", u) if out.aside(u.size) else dict(by_label)}
    return {
        "kind": obligation.kind,
        "of": obligation.of,
        "statement": obligation.statement,
        "lemma": obligation.lemma,
        "numbers": {name: format_exact(value) for name, value in obligation.numbers.items()},
        "witness": witness,
    }
