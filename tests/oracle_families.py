"""What a family does, and whether a counterexample is one: judged by exact ranks of members, products and replay."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator
from fractions import Fraction
from math import prod

import flint
import networkx as nx
import numpy as np
from oracle import kernel
from scipy.linalg import expm

from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.theorems.family_behaviour import Counterexample, FamilyComponent

Row = list[Fraction]


# ---------------------------------------------------------------------- members, exactly


def signed_edges(mode: Mode, on: np.ndarray, largest: np.ndarray | None = None) -> list[tuple[int, int, Fraction]]:
    """Return the edges of a member: of those ``on``, at ``w-`` (at ``w+`` where that is 0, or ``largest``)."""
    edges = []
    for e in np.flatnonzero(on).tolist():
        low, high = mode.lower.fraction(e), mode.upper.fraction(e)
        top = low == 0 or (largest is not None and bool(largest[e]))
        edges.append((int(mode.source[e]), int(mode.target[e]), int(mode.sign[e]) * (high if top else low)))
    return edges


def laplacian(n: int, edges: list[tuple[int, int, Fraction]]) -> list[Row]:
    L = [[Fraction(0)] * n for _ in range(n)]
    for s, t, w in edges:
        L[t][t] += abs(w)
        L[t][s] -= w
    return L


def mandatory(mode: Mode) -> list[Row]:
    on = np.array([mode.lower.fraction(e) > 0 for e in range(mode.n_edges)], dtype=bool)
    return laplacian(len(mode.labels), signed_edges(mode, on))


def member_masks(mode: Mode, rng: random.Random, most: int = 64) -> Iterator[np.ndarray]:
    """Yield which edges are on in members of a mode, at most one sign of a pair: all, or ``most`` at random."""
    groups: dict[object, list[list[int]]] = {}
    for e in range(mode.n_edges):
        if mode.lower.fraction(e) == 0:
            s, t, sign = int(mode.source[e]), int(mode.target[e]), int(mode.sign[e])
            pair = frozenset((s, t)) if mode.tied else (s, t)
            options = groups.setdefault(pair, [[]])
            same = next((o for o in options if o and int(mode.sign[o[0]]) == sign), None)
            if same is None:
                options.append([e])
            else:
                same.append(e)
    always = np.array([mode.lower.fraction(e) > 0 for e in range(mode.n_edges)], dtype=bool)
    choices = list(groups.values())
    if prod(map(len, choices)) <= most:
        drawn: Iterator[tuple[list[int], ...]] = itertools.product(*choices)
    else:
        drawn = (tuple(rng.choice(c) for c in choices) for _ in range(most))
    for pick in itertools.chain(drawn, [tuple(c[-1] for c in choices)]):
        on = always.copy()
        on[[e for chosen in pick for e in chosen]] = True
        yield on


def member_laplacians(family: Family, rng: random.Random, most: int = 24) -> list[list[Row]]:
    """Return members of every mode: edges on and off, weights at one end or the other."""
    result = []
    for mode in family.modes:
        for on in member_masks(mode, rng, most):
            for largest in (
                np.zeros_like(on),
                np.ones_like(on),
                np.array([rng.random() < 0.5 for _ in on], dtype=bool),
            ):
                result.append(laplacian(family.n_nodes, signed_edges(mode, on, largest)))
    return result


def rank(rows: list[Row]) -> int:
    entries = [flint.fmpq(x.numerator, x.denominator) for row in rows for x in row]
    return flint.fmpq_mat(len(rows), len(rows[0]), entries).rank() if rows else 0


def has_common_kernel(members: list[list[Row]], n: int) -> tuple[bool, int]:
    """Tell whether all members have one kernel, and the dimension of the intersection."""
    together: list[Row] = []
    for L in members:
        if rank(together + L) > rank(together):
            together = together + L
    dimension = n - rank(together)
    return all(n - rank(L) == dimension for L in members), dimension


def rest_behaviour(family: Family, dimension: int) -> str:
    """Return what a common kernel of a dimension means, from one state in it and the graphs of mandatory edges."""
    if dimension == 0:
        return "stability"
    (first, *others) = kernel(mandatory(family.modes[0]))
    if not others and len({abs(x) for x in first}) == 1:
        return "bipartite consensus"
    single = all(len(_closed(mode, family.n_nodes)) == 1 for mode in family.modes)
    return "interval bipartite consensus" if single else "bipartite containment"


def _closed(mode: Mode, n: int) -> list[set[int]]:
    """Return the strong components that no mandatory edge enters."""
    graph = _digraph(mode, n).reverse()
    return [set(c) for c in nx.attracting_components(graph)]


# ---------------------------------------------------------------------- products


def slowest_product(members: list[list[Row]], steps: int, beam: int = 4, step: float = 1.0) -> float:
    """Return the largest distance from the kernel, times its norm, that a beam search over words of members leaves."""
    floats = [np.array(L, dtype=float) for L in members]
    _, sizes, V = np.linalg.svd(np.vstack(floats))
    full = int((sizes > 1e-9 * max(sizes.max(), 1)).sum())
    off = V[:full].T @ V[:full]  # the projection off the common kernel
    if not full:
        return 0.0
    n = len(floats[0])
    letters = np.array([expm(-L * step / 4) for L in floats])
    states = np.eye(n)[None]
    for _ in range(steps):
        states = (letters[:, None] @ states[None]).reshape(-1, n, n)
        left = np.abs(off @ states).sum(axis=2).max(axis=1)
        states = states[np.argsort(-left)[:beam]]
    return float(np.abs(off @ states).sum(axis=2).max())


# ---------------------------------------------------------------------- replay of counterexamples


def replay(component: FamilyComponent, witness: Counterexample) -> bool:
    """Tell whether a counterexample is one, from the family alone, in rationals."""
    kinds = {
        "balanced closed set": _closed_set,
        "two closed components": _two_components,
        "no camps": _no_camps,
        "different kernels": _different_kernels,
        "moving rest state": _moving,
        "stable member": _stable,
    }
    return kinds[witness.kind](component, witness)


def _mandatory_edges(mode: Mode) -> list[tuple[int, int, int]]:
    ends = zip(mode.source.tolist(), mode.target.tolist(), mode.sign.tolist(), strict=True)
    return [edge for e, edge in enumerate(ends) if mode.lower.fraction(e) > 0]


def _closed_set(component: FamilyComponent, witness: Counterexample) -> bool:
    camps = dict(zip(witness.nodes, witness.camps, strict=True))
    into = [edge for edge in _mandatory_edges(component.family.modes[witness.mode]) if edge[1] in camps]
    return bool(camps) and all(s in camps and sign == camps[s] * camps[t] for s, t, sign in into)


def _heard(mode: Mode, node: int) -> set[int]:
    graph = nx.DiGraph([(s, t) for s, t, _ in _mandatory_edges(mode)])
    graph.add_node(node)
    return nx.ancestors(graph, node) | {node}


def _two_components(component: FamilyComponent, witness: Counterexample) -> bool:
    mode = component.family.modes[witness.mode]
    one, other = (_heard(mode, node) for node in witness.nodes)
    closed = all(node in _heard(mode, v) for node in witness.nodes for v in _heard(mode, node))
    return closed and not one & other


def _no_camps(component: FamilyComponent, witness: Counterexample) -> bool:
    modes = component.family.modes
    if component.signal == "constant":
        modes = (modes[witness.mode],)
        if len(_closed(modes[0], component.family.n_nodes)) != 1:
            return False
    signs: dict[tuple[int, int], set[int]] = {}
    for mode in modes:
        for s, t, sign in zip(mode.source.tolist(), mode.target.tolist(), mode.sign.tolist(), strict=True):
            signs.setdefault((s, t), set()).add(sign)
    walk = list(witness.cycle)
    if not walk or not all(edge in signs for edge in walk):
        return False
    # An undirected walk that closes: some orientation of its edges chains them.
    ends = walk[0]
    closes = any(_chains(walk[1:], here, start) for start, here in (ends, ends[::-1]))
    return closes and any(prod(choice) == -1 for choice in itertools.product(*(signs[e] for e in walk)))


def _chains(walk: list[tuple[int, int]], here: int, start: int) -> bool:
    for s, t in walk:
        if here not in (s, t):
            return False
        here = t if here == s else s
    return here == start


def _digraph(mode: Mode, n: int) -> nx.DiGraph:
    graph = nx.DiGraph([(s, t) for s, t, _ in _mandatory_edges(mode)])
    graph.add_nodes_from(range(n))
    return graph


def _different_kernels(component: FamilyComponent, witness: Counterexample) -> bool:
    modes = component.family.modes
    return rank(mandatory(modes[witness.mode])) != rank(mandatory(modes[witness.other]))


def _product(L: list[Row], q: Row) -> Row:
    return [sum((a * x for a, x in zip(row, q, strict=True) if a), Fraction(0)) for row in L]


def _moving(component: FamilyComponent, witness: Counterexample) -> bool:
    modes, n = component.family.modes, component.family.n_nodes
    first, other = modes[witness.mode], modes[witness.other]
    if witness.state is None:
        return witness.enclosure is not None and _moves_enclosed(component, witness)
    q = list(witness.state)
    on = np.array([other.lower.fraction(e) > 0 for e in range(other.n_edges)], dtype=bool)
    largest = np.zeros_like(on)
    if witness.edge is not None:
        turned = [witness.edge]
        if other.tied:
            s, t, sign = (int(a[witness.edge]) for a in (other.source, other.target, other.sign))
            back = (other.source == t) & (other.target == s) & (other.sign == sign)
            turned += np.flatnonzero(back).tolist()
        on[turned] = largest[turned] = True
    L = laplacian(n, signed_edges(other, on, largest))
    return any(q) and not any(_product(mandatory(first), q)) and any(_product(L, q))


def _moves_enclosed(component: FamilyComponent, witness: Counterexample) -> bool:
    """Verify the enclosure row by row, and that its state moves, in integers."""
    modes, q = component.family.modes, witness.enclosure
    assert q is not None
    first, other = modes[witness.mode], modes[witness.other]
    leaders = set().union(*_closed(first, component.family.n_nodes))
    rows = [dict[int, Fraction]() for _ in q.middle]
    for s, t, w in signed_edges(first, ~first.optional):
        rows[t][s] = w
    for k, row in enumerate(rows):
        defect = abs(sum(abs(w) * q.middle[k] - w * q.middle[v] for v, w in row.items()))
        if k in leaders:  # at rest exactly
            if defect or q.radius[k]:
                return False
        elif sum(abs(w) * (q.radius[k] - q.radius[v]) for v, w in row.items()) < defect or q.radius[k] < 0:
            return False
    if witness.edge is not None:
        s, t, sign = (int(a[witness.edge]) for a in (other.source, other.target, other.sign))
        return abs(q.middle[t] - sign * q.middle[s]) > q.radius[t] + q.radius[s]
    moved = [dict[int, Fraction]() for _ in q.middle]
    for s, t, w in signed_edges(other, ~other.optional):
        moved[t][s] = w
    for k, row in enumerate(moved):
        speed = sum(abs(w) * q.middle[k] - w * q.middle[v] for v, w in row.items())
        if abs(speed) > sum(abs(w) * (q.radius[k] + q.radius[v]) for v, w in row.items()):
            return True
    return False


def _stable(component: FamilyComponent, witness: Counterexample) -> bool:
    mode, n = component.family.modes[witness.mode], component.family.n_nodes
    on = np.ones(mode.n_edges, dtype=bool)
    on[list(witness.off)] = False
    edges = signed_edges(mode, on)
    pairs = {(s, t): np.sign(w) for s, t, w in edges}
    single = len(pairs) == len(edges) and all(mode.optional[e] for e in witness.off)
    tied = not mode.tied or all(pairs.get((t, s)) == sign for (s, t), sign in pairs.items())
    return single and tied and rank(laplacian(n, edges)) == n
