"""What no gains of the protocol can undercut, whatever the certificate: the product of peak and deadline."""

from __future__ import annotations

from fractions import Fraction

from lmi.exact.elementary_enclosures import rounded, sqrt
from ptcc_certify.bounds.input.initial_sets import ways
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.checker import INPUT_NODES
from ptcc_certify.checker.input_formulas import BITS, InitialSet, Linear
from ptcc_certify.gain_design.request import DesignRequest
from ptcc_certify.graphs.rationals import shorten

_PRODUCT_BITS = 40


def lower_product(base: Certificate, request: DesignRequest) -> tuple[Fraction | None, str]:
    """Return what ``U T`` is at least, whatever the gains, and why; None if nothing is known."""
    proof = base.graph_proof
    candidates = [(Fraction(0), "")]
    initial_set, graph = request.initial_set, proof.graph
    agents = [shorten(label) for label in graph.labels]
    if proof.influence.exact and graph.n_nodes <= INPUT_NODES:
        for agent, row in zip(agents, ways(proof.influence), strict=True):
            way = _largest_below(initial_set, row) - (request.residual or 0)
            candidates.append((way, f"the way of agent {agent} to its final state"))
    limit = proof.upper_bound
    if request.residual is None and limit and _has_inner_points(initial_set):
        for agent, weights in zip(agents, graph.exact_rows(range(graph.n_nodes)), strict=True):
            candidates.append(
                (2 / limit * _largest_below(initial_set, weights), f"the input of agent {agent} at t = 0")
            )
    best, why = max(candidates, key=lambda entry: entry[0])
    return (rounded(best, _PRODUCT_BITS) if best > 0 else None), why


def _largest_below(initial_set: InitialSet, row: Linear) -> Fraction:
    """Bound the largest size of a linear function over the set from below; exact but for an ellipsoid's root."""
    if not initial_set.axes:
        return initial_set.largest(row)
    size = abs(sum((x * initial_set.center[j] for j, x in row.items()), Fraction(0)))
    shares = [sum((x * axis[j] for j, x in row.items()), Fraction(0)) for axis in initial_set.axes]
    return size + sqrt(rounded(sum((x * x for x in shares), Fraction(0)), BITS), BITS)[0]


def _has_inner_points(initial_set: InitialSet) -> bool:
    """Tell whether the set spans all directions, so that an input bounded on it is bounded for every initial state."""
    if not initial_set.axes:
        return bool(initial_set.radius) and min(initial_set.radius) > 0
    import flint

    rows = [[flint.fmpq(x.numerator, x.denominator) for x in axis] for axis in initial_set.axes]
    return flint.fmpq_mat(rows).rank() == len(initial_set.center)
