"""Lyapunov functions of agents of order n where halves of the time are left, as the check encloses them.

Of agents by one matrix they are of ``y``; of the cascade of positions and of ``r``, of which its bounds are made.

What a function is worth there, of the motion from one initial state, is far less than its decay says: most of it is of
motions that die sooner.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from fractions import Fraction
from itertools import islice

from lmi.exact.elementary_enclosures import rounded
from lmi.exact.work import WorkError, limited
from ptcc_certify.bounds.agents.cascade import checked_agents
from ptcc_certify.bounds.agents.each_agent import States, checked_function, checked_graph
from ptcc_certify.checker.agent_bounds import Begin
from ptcc_certify.checker.agent_cascade import halvings_of, roots_above
from ptcc_certify.checker.agent_instants import halvings, value_above
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.model.cascade import CascadeProtocol

Values = tuple[Fraction | None, ...]
#: Instants at most; GB whose share of work they may take, a small part of what a check may.
INSTANTS, WORK = 10, 0.1
#: Bits of values.
BITS = 64


def instant_values(begin: Begin, functions: Sequence[LyapunovFunction]) -> tuple[Values, ...]:
    """Return bounds of ``V`` at ``T (1 - 2^-i)``, ``i = 1, 2, ..``, of those functions that bound a deviation best.

    Empty where the gain is capped; as many as little work allows.
    """
    known = {k: V for k, V in enumerate(functions) if V.deviation is not None and V.form is not None}
    if begin.agents.cap is not None or not known:
        return ()
    graph, nodes, found = begin.graph, range(begin.graph.n), list[Values]()
    with suppress(WorkError), limited(WORK):
        read = {k: checked_function(V) for k, V in known.items()}
        deviations = {k: V.deviation.agents for k, V in known.items() if V.deviation is not None}
        instants = halvings(begin.agents, graph.laplacian_product, graph.unit, begin.states, begin.offsets)
        for at in islice(instants, INSTANTS):
            values = {k: rounded(value_above(begin, V, at), BITS, up=True) for k, V in read.items()}
            best = {min(known, key=lambda k: deviations[k][v] * values[k]) for v in nodes}
            found.append(tuple(values[k] if k in best else None for k in range(len(functions))))
    return tuple(found)


def instant_roots(
    structure: Structure, protocol: CascadeProtocol, functions: Sequence[LyapunovFunction], states: States
) -> tuple[Values, ...]:
    """Return bounds of ``sqrt(V)`` of positions and of ``r``, function after function, at ``T (1 - 2^-i)``.

    Of those functions alone that bound a position best; as many instants as little work allows.
    """
    known = {k: V for k, V in enumerate(functions) if V.deviation is not None and V.form is not None}
    if not known:
        return ()
    agents = checked_agents(protocol)
    nodes, found, remaining = range(structure.graph.n_nodes), list[Values](), Fraction(1)
    with suppress(WorkError), limited(WORK):
        graph, read = checked_graph(structure), {k: checked_function(V) for k, V in known.items()}
        deviations = {k: V.deviation.agents for k, V in known.items() if V.deviation is not None}
        for at in islice(halvings_of(graph, agents, states, protocol.offsets), INSTANTS):
            remaining /= 2
            roots = {k: roots_above(graph, agents, V, at, remaining) for k, V in read.items()}
            best = {min(known, key=lambda k: deviations[k][v] * roots[k][0] ** 2) for v in nodes}
            told = [roots[k] if k in best else (None, None) for k in range(len(functions))]
            found.append(tuple(None if x is None else rounded(x, BITS, up=True) for pair in told for x in pair))
    return tuple(found)
