"""Random signed digraphs that are what they are by construction; nothing is drawn and thrown away.

A graph is built from blocks: strongly connected blocks (ear decompositions) that listen to nobody outside are the
closed strong components (CSCs), the others are followers and listen to an earlier block. Balanced blocks get their
signs from a gauge; unbalanced ones get any signs and one cycle whose signs multiply to -1. Every :class:`Made` graph
tells what it is, so that tests compare with the construction.

    made = random_graph(np.random.default_rng(1), "quasi-strong", "balanced", n=8, followers="chain")
    for name, kwargs in all_classes(): random_graph(rng, **kwargs)
    @given(made_graphs()) / @given(made_graphs(only=("2.1",), max_nodes=6))
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.packed_weights import Weights

Rng = np.random.Generator
Pair = tuple[int, int]  # (source, target)

CONNECTIVITIES = ("strong", "quasi-strong", "weak", "disconnected")
BALANCES = ("balanced", "unbalanced", "mixed")  # of the CSCs
LEADERS = ("any", "one", "single", "no single", "several")
FOLLOWERS = ("any", "irreducible", "reducible", "chain")
SPECIALS = (None, "whole", "positive", "undirected", "nearly undirected", "sign-symmetric", "opposite mutual")


@dataclass(frozen=True)
class Part:
    """One weakly connected component, as constructed."""

    nodes: frozenset[int]
    connectivity: str
    closed: frozenset[tuple[frozenset[int], bool]]  # (nodes, balanced) of each CSC
    theorem: str


@dataclass(frozen=True)
class Made:
    """A graph and what it is by construction; ``None`` where the construction leaves it open."""

    graph: SignedDigraph
    connectivity: str
    parts: tuple[Part, ...]
    whole_balanced: bool | None
    all_positive: bool | None
    undirected: bool | None
    sign_symmetric: bool | None

    @property
    def closed(self) -> frozenset[tuple[frozenset[int], bool]]:
        return frozenset(pair for part in self.parts for pair in part.closed)

    @property
    def theorems(self) -> tuple[str, ...]:
        return tuple(sorted(part.theorem for part in self.parts))


# ---------------------------------------------------------------------- weights


def _unit(rng: Rng) -> Fraction:
    return Fraction(1)


def _small_int(rng: Rng) -> Fraction:
    return Fraction(int(rng.integers(1, 10)))


def _decimal(rng: Rng) -> Fraction:
    return Fraction(int(rng.integers(1, 100)), 10)


def _ratio(rng: Rng) -> Fraction:
    return Fraction(int(rng.integers(1, 13)), int(rng.integers(1, 13)))


def _log6(rng: Rng) -> Fraction:
    """Two digits, log-uniform over 10^-3 .. 10^3."""
    exponent = float(rng.uniform(-3, 3))
    power = int(np.floor(exponent)) - 1
    return Fraction(round(10 ** (exponent - power))) * Fraction(10) ** power


def _dyadic(rng: Rng) -> Fraction:
    """Floats whose common scale does not fit int64."""
    return Fraction(int(rng.integers(1, 2**20)), 2 ** int(rng.integers(0, 90)))


def _long(rng: Rng) -> Fraction:
    """Rationals that neither a scaled int64 nor a float64 holds."""
    return Fraction(int(rng.integers(1, 2**60)), int(rng.integers(1, 2**60)))


WEIGHTS: dict[str, Callable[[Rng], Fraction]] = {
    "units": _unit,
    "small ints": _small_int,
    "decimals": _decimal,
    "ratios": _ratio,
    "log6": _log6,
    "dyadic": _dyadic,
    "long": _long,
}


# ---------------------------------------------------------------------- one weakly connected graph


@dataclass
class _Block:
    """A strongly connected block: its nodes, its edges, and the cycle they grew from (the first of the edges)."""

    nodes: list[int]
    edges: list[Pair]
    cycle: list[Pair]
    leads: bool
    balanced: bool  # of no meaning for followers


def _any(rng: Rng, items: Sequence[Any]) -> Any:
    return items[int(rng.integers(len(items)))]


def _strong_edges(rng: Rng, nodes: list[int], undirected: bool, shortest_cycle: int) -> tuple[list[Pair], list[Pair]]:
    """Edges that connect ``nodes`` strongly, and the cycle they grew from."""
    size = len(nodes)
    if size == 1:
        return [], []
    order = [nodes[i] for i in rng.permutation(size)]
    if undirected:
        first = 1 if shortest_cycle < 3 else int(rng.integers(3, size + 1))
    else:
        first = int(rng.integers(shortest_cycle, size + 1))
    cycle = [(order[i], order[(i + 1) % first]) for i in range(first)] if first > 1 else []
    edges = dict.fromkeys(cycle)
    inside, rest = order[:first], order[first:]
    while rest:  # an ear: a path from a node inside through new nodes back to a node inside
        length = 1 if undirected else int(rng.integers(1, len(rest) + 1))
        path = [_any(rng, inside), *rest[:length], *([] if undirected else [_any(rng, inside)])]
        edges.update(dict.fromkeys(pairwise(path)))
        inside, rest = inside + rest[:length], rest[length:]
    for _ in range(int(rng.poisson(_any(rng, (0.0, 0.5, 2.0)) * size))):
        a, b = (int(x) for x in rng.choice(size, 2, replace=False))
        edges[nodes[a], nodes[b]] = None
    if undirected:
        edges.update(dict.fromkeys([(b, a) for a, b in edges]))
    return list(edges), cycle


def _shares(rng: Rng, extra: int, boxes: int) -> list[int]:
    """Share ``extra`` among ``boxes``, unevenly."""
    weights = rng.dirichlet(np.ones(boxes)) if boxes else np.zeros(0)
    return [int(x) for x in rng.multinomial(extra, weights)] if boxes else []


def _least_unbalanced(special: str | None) -> int:
    return 3 if special in ("undirected", "nearly undirected", "sign-symmetric") else 2


def _least_leaders(connectivity: str, balance: str, leaders: str, special: str | None) -> list[tuple[int, bool]]:
    """Least sizes and balance of the CSCs."""
    one = 2 if leaders == "no single" or (special == "nearly undirected" and connectivity == "strong") else 1
    good, bad = (one, True), (_least_unbalanced(special), False)
    if leaders == "several":
        return [good, good, bad, bad]
    if connectivity == "weak":
        return {"balanced": [good, good], "unbalanced": [bad, bad], "mixed": [good, bad]}[balance]
    return [good if balance == "balanced" else bad]


def _least_followers(connectivity: str, followers: str, special: str | None, balance: str) -> int:
    if connectivity == "strong":
        return 0
    if special == "opposite mutual" and balance == "balanced":  # two of them form a block
        return 3 if followers == "reducible" else 2
    return 1 if followers == "any" else 2


def smallest(
    connectivity: str,
    balance: str,
    *,
    leaders: str = "any",
    followers: str = "any",
    special: str | None = None,
    parts: Sequence[dict[str, Any]] = (),
    isolated: int = 0,
    **_: Any,
) -> int:
    """Return the least number of nodes of such a graph."""
    if connectivity == "disconnected":
        if parts or isolated:
            return isolated + sum(smallest(**part) for part in parts)
        return sum(smallest("strong", b, special=special) for b in _least_parts(balance))
    csc = sum(size for size, _ in _least_leaders(connectivity, balance, leaders, special))
    return csc + _least_followers(connectivity, followers, special, balance)


def _least_parts(balance: str) -> list[str]:
    return ["balanced", "unbalanced"] if balance == "mixed" else [balance] * 2


def _plan(
    rng: Rng, n: int, connectivity: str, balance: str, leaders: str, followers: str, special: str | None
) -> list[tuple[int, bool, bool]]:
    """Sizes of the blocks: ``(size, leads, balanced)``, leaders first, summing to ``n``."""
    csc = _least_leaders(connectivity, balance, leaders, special)
    kinds = sorted(set(csc))
    n_followers = _least_followers(connectivity, followers, special, balance)
    spare = n - sum(size for size, _ in csc) - n_followers
    if connectivity == "weak":
        while spare > 0 and rng.random() < 0.4:
            size, good = _any(rng, kinds)
            if size > spare:
                break
            csc.append((size, good))
            spare -= size
    fixed = {"one": True, "single": True}.get(leaders, False)  # balanced CSCs stay single
    growing = [i for i, (_, good) in enumerate(csc) if not (fixed and good)]
    if connectivity == "strong":
        boxes = [spare]
        to_followers = 0
    else:
        *boxes, to_followers = _shares(rng, spare, len(growing) + 1)
    sizes = [size for size, _ in csc]
    for i, more in zip(growing, boxes, strict=False):
        sizes[i] += more
    plan = [(size, True, good) for size, (_, good) in zip(sizes, csc, strict=True)]
    n_followers += to_followers
    if n_followers == 0:
        return plan
    if followers == "chain":
        blocks = [1] * n_followers
    elif followers == "irreducible" or (followers == "any" and rng.random() < 0.3):
        blocks = [n_followers]
    elif special == "opposite mutual" and balance == "balanced":
        blocks = [2, *_composition(rng, n_followers - 2, 1)]
    else:
        blocks = _composition(rng, n_followers, 2 if followers == "reducible" else 1)
    return plan + [(size, False, False) for size in blocks]


def _composition(rng: Rng, total: int, parts: int) -> list[int]:
    """Write ``total`` as an ordered sum of at least ``parts`` positive numbers."""
    if total == 0:
        return []
    k = int(rng.integers(parts, total + 1))
    cuts = sorted(int(x) + 1 for x in rng.choice(total - 1, k - 1, replace=False)) if k > 1 else []
    return [b - a for a, b in zip([0, *cuts], [*cuts, total], strict=True)]


def _links(rng: Rng, blocks: list[_Block], chain: bool) -> list[Pair]:
    """Edges from earlier blocks to follower blocks, such that every follower block has one and all hang together."""
    group = list(range(len(blocks)))  # which blocks hang together already

    def join(a: int, b: int) -> Pair:
        old, new = group[a], group[b]
        group[:] = [new if g == old else g for g in group]
        return _any(rng, blocks[a].nodes), _any(rng, blocks[b].nodes)

    first_follower = sum(block.leads for block in blocks)
    links = []
    for b in range(first_follower, len(blocks)):
        a = b - 1 if chain and b > first_follower else int(rng.integers(b))
        links.append(join(a, b))
    for a in range(first_follower):  # a CSC that hangs apart gets a listener elsewhere
        others = [b for b in range(first_follower, len(blocks)) if group[b] != group[a]]
        if others:
            links.append(join(a, _any(rng, others)))
    if not chain and first_follower < len(blocks):
        size = sum(len(block.nodes) for block in blocks)
        for _ in range(int(rng.poisson(_any(rng, (0.0, 0.3, 1.5)) * size))):
            b = int(rng.integers(first_follower, len(blocks)))
            links.append((_any(rng, blocks[int(rng.integers(b))].nodes), _any(rng, blocks[b].nodes)))
    return list(dict.fromkeys(links))


def _signs(
    rng: Rng, blocks: list[_Block], links: list[Pair], negative: float, special: str | None, camp: dict[int, int]
) -> dict[Pair, int]:
    """Sign of every edge; may add the reverse of an edge for ``opposite mutual``."""
    sign: dict[Pair, int] = {}
    whole = special in ("whole", "positive")

    def anything() -> int:
        return -1 if rng.random() < negative else 1

    for block in blocks:
        gauged = whole or (block.leads and block.balanced)
        for a, b in block.edges:
            sign[a, b] = camp[a] * camp[b] if gauged else anything()
        if gauged:
            continue
        if block.leads:  # one cycle with a negative product
            a, b = _any(rng, block.cycle)
            product = int(np.prod([sign[edge] for edge in block.cycle]))
            sign[a, b] *= -product
        if special in ("undirected", "nearly undirected", "sign-symmetric"):
            for a, b in block.edges:  # the cycle comes first and, with 3 nodes or more, keeps its signs
                if (b, a) in sign:
                    sign[b, a] = sign[a, b]
    for a, b in links:
        sign[a, b] = camp[a] * camp[b] if whole else anything()
    if special == "opposite mutual":
        hosts = [b for b in blocks if len(b.nodes) > 1 and b.leads and not b.balanced]
        hosts = hosts or [b for b in blocks if len(b.nodes) > 1 and not b.leads]
        block = _any(rng, hosts)
        a, b = _any(rng, block.edges)
        sign[b, a] = -sign[a, b]
    return sign


THEOREM = {
    ("strong", True): "1.1",
    ("strong", False): "1.2",
    ("quasi-strong", True): "2.1",
    ("quasi-strong", False): "2.2",
    ("weak", True): "3.1",
    ("weak", False): "3.2",
}  # by connectivity and whether some CSC is balanced


@dataclass
class _Component:
    part: Part
    weight: dict[Pair, Fraction]
    whole: bool | None
    undirected: bool | None
    symmetric: bool | None


def _component(
    rng: Rng,
    nodes: list[int],
    connectivity: str,
    balance: str,
    *,
    weights: str = "small ints",
    negative: float = 0.3,
    leaders: str = "any",
    followers: str = "any",
    special: str | None = None,
) -> _Component:
    undirected = special in ("undirected", "nearly undirected")
    if undirected and connectivity != "strong":
        raise ValueError("a connected undirected graph is strongly connected")
    if special in ("whole", "positive") and balance != "balanced":
        raise ValueError(f"{special}: every CSC is balanced")
    if special == "opposite mutual" and balance == "balanced" and (connectivity == "strong" or followers == "chain"):
        raise ValueError("no block can hold a mutual pair of opposite signs")
    if leaders in ("one", "single") and (connectivity == "strong" or balance == "unbalanced"):
        raise ValueError("single leaders are balanced CSCs with followers")
    if (leaders == "one" and connectivity != "quasi-strong") or (leaders == "several" and balance != "mixed"):
        raise ValueError(f'leaders "{leaders}" do not fit {connectivity}, {balance}')
    if balance == "mixed" and connectivity != "weak":
        raise ValueError(f"a {connectivity} graph has one CSC")
    blocks, taken = [], 0
    for size, leads, good in _plan(rng, len(nodes), connectivity, balance, leaders, followers, special):
        own = nodes[taken : taken + size]
        taken += size
        shortest = _least_unbalanced(special) if leads and not good else 2
        edges, cycle = _strong_edges(rng, own, undirected, shortest)
        blocks.append(_Block(own, edges, cycle, leads, good))
    links = _links(rng, blocks, followers == "chain")
    camp = {v: -1 if special != "positive" and rng.random() < negative else 1 for v in nodes}
    sign = _signs(rng, blocks, links, negative, special, camp)
    weight: dict[Pair, Fraction] = {}
    for (a, b), s in sign.items():
        weight[a, b] = abs(weight[b, a]) * s if undirected and (b, a) in weight else WEIGHTS[weights](rng) * s
    if special == "nearly undirected":
        edge = _any(rng, list(weight))
        weight[edge] *= 1 + Fraction(1, 10**25)
    closed = frozenset((frozenset(b.nodes), b.balanced) for b in blocks if b.leads)
    some_balanced = any(good for _, good in closed)
    all_balanced = all(good for _, good in closed)
    whole: bool | None = None
    if special in ("whole", "positive") or (connectivity == "strong" and all_balanced):
        whole = True
    elif not all_balanced or special == "opposite mutual":
        whole = False
    mutual: bool | None = None
    if whole or special in ("undirected", "nearly undirected", "sign-symmetric"):
        mutual = True
    elif special == "opposite mutual":
        mutual = False
    equal: bool | None = None
    if special == "undirected" or len(nodes) == 1:
        equal = True
    elif special == "nearly undirected" or connectivity != "strong" or mutual is False:
        equal = False
    part = Part(frozenset(nodes), connectivity, closed, THEOREM[connectivity, some_balanced])
    return _Component(part, weight, whole, equal, mutual)


# ---------------------------------------------------------------------- any graph


def random_graph(
    rng: Rng,
    connectivity: str,
    balance: str,
    *,
    n: int | None = None,
    weights: str = "small ints",
    negative: float = 0.3,
    leaders: str = "any",
    followers: str = "any",
    special: str | None = None,
    parts: Sequence[dict[str, Any]] = (),
    isolated: int = 0,
) -> Made:
    """Construct a random signed digraph with nodes ``0 .. n-1`` in no particular order.

    Parameters
    ----------
    connectivity : one of CONNECTIVITIES
    balance : {"balanced", "unbalanced", "mixed"}
        Of the CSCs: all, none, or some of each (weak and disconnected only).
    n : int, optional
        Number of nodes, at least ``smallest(...)``; up to 12, or the smallest number, by default.
    weights : one of WEIGHTS
        Law of the sizes; all are exact.
    negative : float
        Probability that a node is in the second camp, or that a free edge is negative.
    leaders : one of LEADERS
        ``one``: quasi-strong with K = 1; ``single``: balanced CSCs have one node; ``no single``: every CSC has two
        nodes or more; ``several``: at least two balanced and two unbalanced CSCs.
    followers : one of FOLLOWERS
        ``irreducible``: one strong block; ``reducible``: several; ``chain``: one node listens to the node before.
    special : one of SPECIALS
        ``whole``: the whole graph is balanced; ``positive``; ``undirected``; ``nearly undirected``: one weight
        differs by 1e-25 of itself; ``sign-symmetric``: mutual edges have equal signs; ``opposite mutual``: some pair
        of mutual edges has opposite signs.
    parts, isolated : sequence of keyword dicts, int
        The components of a disconnected graph, drawn if absent, and how many nodes are isolated besides.
    """
    general = {"weights": weights, "negative": negative}
    if connectivity == "disconnected":
        if parts or isolated:
            recipes = [dict(general, **part) for part in parts]
        else:
            recipes = _draw_parts(rng, n, balance, dict(general, special=special))
        recipes += [dict(general, connectivity="strong", balance="balanced")] * isolated
    else:
        recipes = [
            dict(
                general,
                connectivity=connectivity,
                balance=balance,
                leaders=leaders,
                followers=followers,
                special=special,
            )
        ]
    sizes = [smallest(**recipe) for recipe in recipes]
    if n is None:
        n = int(rng.integers(sum(sizes), max(sum(sizes), 12) + 1)) if len(sizes) > isolated else isolated
    if n < sum(sizes):
        raise ValueError(f"such a graph has {sum(sizes)} nodes or more, not {n}")
    growing = len(recipes) - isolated
    if growing:
        sizes = [a + b for a, b in zip(sizes, _shares(rng, n - sum(sizes), growing) + [0] * isolated, strict=True)]
    elif n > isolated:
        raise ValueError(f"{isolated} isolated nodes are not {n}")
    numbers, made = [int(x) for x in rng.permutation(n)], []
    for size, recipe in zip(sizes, recipes, strict=True):
        made.append(_component(rng, numbers[:size], **recipe))
        numbers = numbers[size:]
    edges = [(a, b, w) for component in made for (a, b), w in component.weight.items()]
    edges = [edges[i] for i in rng.permutation(len(edges))]
    return Made(
        graph=SignedDigraph.from_edges(edges, range(n)),
        connectivity="disconnected" if len(made) > 1 else made[0].part.connectivity,
        parts=tuple(component.part for component in made),
        whole_balanced=_all(component.whole for component in made),
        all_positive=True if special == "positive" or not edges else None,
        undirected=_all(component.undirected for component in made),
        sign_symmetric=_all(component.symmetric for component in made),
    )


def _all(values: Any) -> bool | None:
    """And of three-valued truths."""
    known = list(values)
    return False if False in known else None if None in known else True


def _draw_parts(rng: Rng, n: int | None, balance: str, general: dict[str, Any]) -> list[dict[str, Any]]:
    """Two to four components that fit into ``n`` nodes."""
    special = general["special"]
    kinds = ["strong"] if special in ("undirected", "nearly undirected") else ["strong", "quasi-strong", "weak"]
    balances = _least_parts(balance)
    budget = n if n is not None else 12
    spare = budget - sum(smallest("strong", b, special=special) for b in balances)
    for _ in range(2):
        extra = _any(rng, _least_parts(balance))
        cost = smallest("strong", extra, special=special)
        if rng.random() < 0.3 and cost <= spare:
            balances.append(extra)
            spare -= cost
    recipes = []
    for b in balances:
        cost = smallest("strong", b, special=special)
        fit = [c for c in kinds if smallest(c, b, special=special) - cost <= spare]
        kind = _any(rng, fit)
        spare -= smallest(kind, b, special=special) - cost
        recipes.append(dict(general, connectivity=kind, balance=b))
    return recipes


def all_classes() -> list[tuple[str, dict[str, Any]]]:
    """Name and keywords of :func:`random_graph` for every row and special case of the theory."""

    def strong(balance: str = "balanced", **more: Any) -> dict[str, Any]:
        return dict(connectivity="strong", balance=balance, **more)

    def quasi(balance: str = "balanced", **more: Any) -> dict[str, Any]:
        return dict(connectivity="quasi-strong", balance=balance, **more)

    def weak(balance: str = "balanced", **more: Any) -> dict[str, Any]:
        return dict(connectivity="weak", balance=balance, **more)

    def apart(balance: str = "mixed", *parts: dict[str, Any], **more: Any) -> dict[str, Any]:
        return dict(connectivity="disconnected", balance=balance, parts=parts, **more)

    bad = "unbalanced"
    return [
        ("1.1 one node", strong(n=1)),
        ("1.1", strong()),
        ("1.1 undirected", strong(special="undirected")),
        ("1.1 nearly undirected", strong(special="nearly undirected")),
        ("1.1 positive", strong(special="positive")),
        ("1.1 positive undirected", strong(special="undirected", negative=0.0)),
        ("1.2", strong(bad)),
        ("1.2 undirected", strong(bad, special="undirected")),
        ("1.2 nearly undirected", strong(bad, special="nearly undirected")),
        ("1.2 sign-symmetric", strong(bad, special="sign-symmetric")),
        ("1.2 opposite mutual", strong(bad, special="opposite mutual")),
        ("2.1", quasi()),
        ("2.1 K=1", quasi(leaders="one")),
        ("2.1 K=1 chain", quasi(leaders="one", followers="chain")),
        ("2.1 K=1 irreducible followers", quasi(leaders="one", followers="irreducible")),
        ("2.1 K=1 whole", quasi(leaders="one", special="whole")),
        ("2.1 K=1 positive", quasi(leaders="one", special="positive")),
        ("2.1 K>=2", quasi(leaders="no single")),
        ("2.1 K>=2 chain", quasi(leaders="no single", followers="chain")),
        ("2.1 K>=2 irreducible followers", quasi(leaders="no single", followers="irreducible")),
        ("2.1 K>=2 reducible followers", quasi(leaders="no single", followers="reducible")),
        ("2.1 K>=2 whole", quasi(leaders="no single", special="whole")),
        ("2.1 K>=2 positive", quasi(leaders="no single", special="positive")),
        ("2.1 sign-symmetric", quasi(special="sign-symmetric")),
        ("2.1 opposite mutual followers", quasi(special="opposite mutual")),
        ("2.2", quasi(bad)),
        ("2.2 chain", quasi(bad, followers="chain")),
        ("2.2 irreducible followers", quasi(bad, followers="irreducible")),
        ("2.2 reducible followers", quasi(bad, followers="reducible")),
        ("2.2 sign-symmetric", quasi(bad, special="sign-symmetric")),
        ("2.2 opposite mutual", quasi(bad, special="opposite mutual")),
        ("3.1", weak()),
        ("3.1 all single", weak(leaders="single")),
        ("3.1 all single chain", weak(leaders="single", followers="chain")),
        ("3.1 all single irreducible followers", weak(leaders="single", followers="irreducible")),
        ("3.1 all single positive", weak(leaders="single", special="positive")),
        ("3.1 no single", weak(leaders="no single")),
        ("3.1 no single reducible followers", weak(leaders="no single", followers="reducible")),
        ("3.1 whole", weak(special="whole")),
        ("3.1 positive", weak(special="positive")),
        ("3.1 no single positive", weak(leaders="no single", special="positive")),
        ("3.1 opposite mutual followers", weak(special="opposite mutual")),
        ("3.1 mixed", weak("mixed")),
        ("3.1 mixed balanced ones single", weak("mixed", leaders="single")),
        ("3.1 mixed no single", weak("mixed", leaders="no single")),
        ("3.1 mixed several", weak("mixed", leaders="several")),
        ("3.1 mixed chain", weak("mixed", followers="chain")),
        ("3.1 mixed sign-symmetric", weak("mixed", special="sign-symmetric")),
        ("3.1 mixed opposite mutual", weak("mixed", special="opposite mutual")),
        ("3.2", weak(bad)),
        ("3.2 chain", weak(bad, followers="chain")),
        ("3.2 irreducible followers", weak(bad, followers="irreducible")),
        ("3.2 reducible followers", weak(bad, followers="reducible")),
        ("3.2 sign-symmetric", weak(bad, special="sign-symmetric")),
        ("3.2 opposite mutual", weak(bad, special="opposite mutual")),
        ("disconnected balanced", apart("balanced")),
        ("disconnected unbalanced", apart(bad)),
        ("disconnected mixed", apart("mixed")),
        ("disconnected whole", apart("balanced", special="whole")),
        ("disconnected positive", apart("balanced", special="positive")),
        ("disconnected undirected balanced", apart("balanced", special="undirected")),
        ("disconnected undirected unbalanced", apart(bad, special="undirected")),
        ("disconnected undirected mixed", apart("mixed", special="undirected")),
        ("disconnected isolated only", apart("balanced", isolated=4)),
        ("disconnected two isolated", apart("balanced", isolated=2)),
        ("disconnected 1.1 and isolated", apart("balanced", strong(), isolated=1)),
        ("disconnected 1.1 1.2", apart("mixed", strong(), strong(bad))),
        ("disconnected 1.1 2.1", apart("balanced", strong(), quasi())),
        ("disconnected 1.2 2.2", apart(bad, strong(bad), quasi(bad))),
        ("disconnected 1.2 2.1 isolated", apart("mixed", strong(bad), quasi(), isolated=2)),
        ("disconnected 2.1 3.1", apart("balanced", quasi(), weak())),
        ("disconnected 2.2 3.1", apart("mixed", quasi(bad), weak())),
        ("disconnected 1.1 3.1 mixed", apart("mixed", strong(), weak("mixed"), isolated=1)),
        ("disconnected 1.1 3.2", apart("mixed", strong(), weak(bad))),
        ("disconnected 1.2 3.2", apart(bad, strong(bad), weak(bad))),
        ("disconnected 2.1 3.2 chains", apart("mixed", quasi(followers="chain"), weak(bad, followers="chain"))),
        ("disconnected opposite mutual", apart("mixed", strong(bad, special="opposite mutual"), quasi())),
        ("disconnected followers opposite", apart("balanced", quasi(special="opposite mutual"), strong())),
    ]


# ---------------------------------------------------------------------- large graphs, hypothesis


def sparse_digraph(
    rng: Rng, n: int, mean_in_degree: float, negative: float = 0.3, *, block: int | None = None
) -> SignedDigraph:
    """About ``n * mean_in_degree`` edges +-1 between random nodes, for large ``n``.

    With ``block``, sources are drawn from the same ``block`` nodes as the target, but for one edge in 20, which
    comes from any smaller node: many CSCs of several nodes.
    """
    m = round(n * mean_in_degree)
    source, target = rng.integers(n, size=m), rng.integers(n, size=m)
    if block is not None:
        near = np.minimum(target - target % block + source % block, n - 1)
        source = np.where(rng.random(m) < 0.05, np.minimum(source, target), near)
    key = np.unique((target * n + source)[source != target])
    code = (rng.random(key.size) < negative).astype(np.int64)
    return SignedDigraph(map(str, range(n)), key % n, key // n, Weights([Fraction(1), Fraction(-1)], code))


@st.composite
def made_graphs(
    draw: st.DrawFn,
    only: Sequence[str] | None = None,
    max_nodes: int = 12,
    weights: Sequence[str] = ("units", "small ints", "log6"),
) -> Made:
    """Strategy: a graph of :func:`all_classes` whose name begins with one of ``only``."""
    classes = [(name, kwargs) for name, kwargs in all_classes() if only is None or name.startswith(tuple(only))]
    _, kwargs = draw(st.sampled_from(classes))
    least = smallest(**kwargs)
    fixed = "n" in kwargs or (kwargs.get("isolated") and not kwargs["parts"])
    n = least if fixed else draw(st.integers(least, max(least, max_nodes)))
    law = draw(st.sampled_from(list(weights)))
    seed = draw(st.integers(0, 2**32 - 1))
    return random_graph(np.random.default_rng(seed), **dict(kwargs, n=n, weights=law))


#: One of each kind: every row of the theory, every form of leaders and followers, every special case.
KINDS = (
    "1.1 one node",
    "1.1",
    "1.1 undirected",
    "1.1 positive",
    "1.2",
    "1.2 nearly undirected",
    "1.2 opposite mutual",
    "2.1 K=1",
    "2.1 K=1 chain",
    "2.1 K>=2 irreducible followers",
    "2.1 K>=2 reducible followers",
    "2.1 K>=2 whole",
    "2.2",
    "2.2 reducible followers",
    "2.2 sign-symmetric",
    "3.1 all single",
    "3.1 no single reducible followers",
    "3.1 no single positive",
    "3.1 mixed chain",
    "3.1 mixed no single",
    "3.1 mixed several",
    "3.2",
    "3.2 irreducible followers",
    "3.2 opposite mutual",
    "disconnected mixed",
    "disconnected isolated only",
    "disconnected 1.1 and isolated",
    "disconnected 1.2 2.2",
    "disconnected 2.1 3.2 chains",
)


def class_cases(by_default: Sequence[str] = KINDS, names: Sequence[str] | None = None) -> list[Any]:
    """Cases ``(name, kwargs)`` of a test, of all classes or of ``names``; those not in the first, in campaigns only."""
    return [
        pytest.param(name, kwargs, id=name, marks=() if name in by_default else pytest.mark.campaign)
        for name, kwargs in all_classes()
        if names is None or name in names
    ]
