"""Ensembles of random signed digraphs that are what they are by construction: nothing is drawn and thrown away.

A graph is laid out in strongly connected blocks. Blocks that listen to nobody outside are the closed components; every
other block listens to an earlier one. Edges are added only where they change neither. A balanced closed component
takes its signs from two camps; in an unbalanced one the signs along one cycle are made to multiply to -1.

Graph ``i`` depends on the ensemble and on ``i`` alone, so that any machine can make it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ptcc_certify.errors import NumberError, ParameterError, gated
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io.files import parse_toml, read_bytes
from ptcc_certify.graphs.packed_weights import Weights
from ptcc_certify.graphs.rationals import as_fraction, format_exact, given, parse_exact, shorten, whole_number

CONNECTIVITIES = ("strong", "quasi-strong", "weak", "disconnected")
LARGEST_COUNT, LARGEST_SEED, LARGEST_ORDER = 10**6, 2**32 - 1, 10**6
LARGEST_DECADES = 30
#: Most closed components of a weakly connected part, and most parts of a disconnected graph.
MOST_GROUPS, MOST_PARTS = 5, 4


class _Block(NamedTuple):
    """A strongly connected block: the positions ``first .. last - 1``, which may listen to ``floor .. last - 1``."""

    first: int
    last: int
    floor: int
    leads: bool


@gated
@dataclass(frozen=True)
class Ensemble:
    """A family of random signed digraphs of stated classes, each a function of its number alone.

    The classes take turns: graph ``i`` has connectivity ``connectivity[i % c]`` and leaders that are balanced as
    ``balanced[(i // c) % b]`` says, where ``c`` and ``b`` are the numbers of entries. Everything else is drawn by a
    generator that is seeded with ``(seed, i)``.

    Parameters
    ----------
    count : int
        Number of graphs.
    nodes : int, sequence of int or range
        Number of nodes, or the numbers of nodes to choose from.
    seed : int
        0 to 2^32 - 1.
    connectivity : str or sequence of str
        Of ``strong``, ``quasi-strong``, ``weak``, ``disconnected``.
    balanced : bool or sequence of bool
        Whether every closed component is balanced (True) or none (False).
    mean_degree : number
        Edges per node, as near as the class and the number of nodes allow.
    negative : number
        Probability that a node of a balanced closed component is in the second camp, or that another edge is negative.
    weight_range : pair of numbers
        Sizes of weights are uniform in it, to three digits, or to a thousandth of its width where fewer than ten such
        numbers are in it.
    weight_decades : number, optional
        Instead: sizes are log-uniform over so many decades around 1, to three digits.
    undirected : bool
        Every edge goes both ways with one weight; connectivity is then ``strong`` or ``disconnected``.

    Raises
    ------
    ParameterError
        Names the parameter and its domain, or the class that no graph of so few nodes is of.

    Examples
    --------
    >>> ensemble = Ensemble(count=8, nodes=range(5, 9), seed=1)
    >>> ensemble.kind(2), analyse(ensemble.graph(2)).connectivity
    (('weak', True), 'weak')
    >>> ensemble.graph(2) == Ensemble(count=3, nodes=range(5, 9), seed=1).graph(2)
    True
    """

    count: int
    nodes: Sequence[int]
    seed: int = 0
    connectivity: Sequence[str] = CONNECTIVITIES
    balanced: Sequence[bool] = (True, False)
    mean_degree: float = 3.0
    negative: float = 0.3
    weight_range: tuple[Fraction, Fraction] = (Fraction(1, 2), Fraction(2))
    weight_decades: float | None = None
    undirected: bool = False

    def __post_init__(self) -> None:
        _require(isinstance(self.undirected, bool), "undirected", self.undirected, "true or false")
        ends, decades = self.weight_range, self.weight_decades
        _require(isinstance(ends, list | tuple) and len(ends) == 2, "weight_range", ends, "[least, largest]")
        low, high = (_exact(x, "weight_range") for x in ends)
        _require(0 < low <= high <= 10**300 and low >= Fraction(1, 10**300), "weight_range", ends, "0 < least, largest")
        vars(self).update(
            count=whole_number(self.count, "count", 1, LARGEST_COUNT),
            nodes=_orders(self.nodes),
            seed=whole_number(self.seed, "seed", 0, LARGEST_SEED),
            connectivity=_classes(self.connectivity, "connectivity", CONNECTIVITIES),
            balanced=_classes(self.balanced, "balanced", (True, False)),
            mean_degree=_real(self.mean_degree, "mean_degree", 1000),
            negative=_real(self.negative, "negative", 1),
            weight_range=(low, high),
            weight_decades=None if decades is None else _real(decades, "weight_decades", LARGEST_DECADES),
        )
        self._refuse_impossible()

    def _refuse_impossible(self) -> None:
        few = min(self.nodes)
        for connectivity in self.connectivity:
            if self.undirected and connectivity in ("quasi-strong", "weak"):
                raise ParameterError(
                    f'an undirected graph is not {connectivity}; leave "{connectivity}" out of connectivity'
                )
            for balanced in self.balanced:
                least = _least(connectivity, balanced, self.undirected)
                if few < least:
                    graph = "undirected graph" if self.undirected else "graph"
                    leaders = "balanced" if balanced else "unbalanced"
                    raise ParameterError(
                        f"nodes = {few} is too few: a {connectivity} {graph} with {leaders} leaders has {least} nodes "
                        "or more"
                    )

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Ensemble:
        r"""Read an ensemble from a TOML file whose keys are the parameters of the class.

        In the file at ``path``, ``nodes`` is a number, a list to choose from, or a range ``{ from = 5, to = 40 }``
        with both ends.

        Raises
        ------
        FormatError
            The file cannot be read, or is no TOML.
        ParameterError
            A key is unknown or missing, or a value is outside its domain; the message names the file.

        Examples
        --------
        >>> with TemporaryDirectory() as folder:
        ...     spec = Path(folder, "spec.toml")
        ...     _ = spec.write_text('count = 2\nnodes = { from = 5, to = 40 }\nconnectivity = "weak"')
        ...     ensemble = Ensemble.read(spec)
        >>> ensemble.nodes, ensemble.kind(1)
        (range(5, 41), ('weak', False))
        """
        name = shorten(os.fspath(path), 200)
        spec = parse_toml(read_bytes(Path(path), name), name, parse_exact)
        keys = [field.name for field in fields(cls)]
        for key in spec:
            if key not in keys:
                raise ParameterError(f'{name}: unknown key "{shorten(key)}"; the keys are {", ".join(keys)}')
        for key in ("count", "nodes"):
            if key not in spec:
                raise ParameterError(f'{name}: the key "{key}" is missing; add it')
        try:
            if isinstance(spec["nodes"], dict):
                spec["nodes"] = _range(spec["nodes"])
            return cls(**spec)
        except ParameterError as error:
            raise ParameterError(f"{name}: {error}") from None

    def to_dict(self) -> dict[str, Any]:
        """Return the parameters as JSON takes them; equal ensembles give equal ones."""
        nodes = self.nodes
        return {field.name: getattr(self, field.name) for field in fields(self)} | {
            "nodes": [nodes.start, nodes.stop, nodes.step, "range"] if isinstance(nodes, range) else list(nodes),
            "connectivity": list(self.connectivity),
            "balanced": list(self.balanced),
            "weight_range": [format_exact(x) for x in self.weight_range],
        }

    def __len__(self) -> int:
        return self.count

    def kind(self, i: int) -> tuple[str, bool]:
        """Return connectivity of graph ``i``, and whether its leaders are balanced.

        Raises
        ------
        ParameterError
            There is no such graph.
        """
        if not 0 <= i < self.count:
            raise ParameterError(f"there is no graph {i}; the ensemble has the numbers 0 to {self.count - 1}")
        c = len(self.connectivity)
        return self.connectivity[i % c], self.balanced[(i // c) % len(self.balanced)]

    def graph(self, i: int) -> SignedDigraph:
        """Make graph ``i``, with nodes ``1 .. n``.

        Parameters
        ----------
        i : int
            0 to ``count - 1``.

        Raises
        ------
        ParameterError
            There is no such graph.
        """
        return _Drawing(self, i).graph()


# ---------------------------------------------------------------------- parameters


def _require(holds: bool, name: str, value: Any, domain: str) -> None:
    if not holds:
        raise ParameterError(f"{name} = {given(value)} is outside its domain; it must be {domain}")


def _exact(value: Any, name: str) -> Fraction:
    try:
        if isinstance(value, bool):
            raise NumberError("a truth value is not a number")
        return as_fraction(value)
    except NumberError as error:
        raise ParameterError(f"{name}: {error}") from None


def _real(value: Any, name: str, most: int) -> float:
    number = _exact(value, name)
    _require(0 <= number <= most, name, value, f"from 0 to {most}")
    return float(number)


def _several(value: Any, name: str) -> Sequence[Any]:
    """Return one or several values as a tuple or a range."""
    if isinstance(value, range):
        chosen: Sequence[Any] = value
    else:
        chosen = tuple(value) if isinstance(value, list | tuple | np.ndarray) else (value,)
    if not chosen:
        raise ParameterError(f"{name} is empty; give at least one value")
    return chosen


def _orders(nodes: Any) -> Sequence[int]:
    """Return the numbers of nodes to choose from; a range stays one."""
    chosen = _several(nodes, "nodes")
    numbers = [whole_number(n, "nodes", 1, LARGEST_ORDER) for n in chosen]
    return chosen if isinstance(chosen, range) else tuple(numbers)


def _classes(value: Any, name: str, allowed: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the classes that take turns, each one of those that there are, and once."""
    chosen = tuple(_several(value, name))
    for one in chosen:
        if type(one) is not type(allowed[0]) or one not in allowed:
            raise ParameterError(f"{name} = {given(one)} is unknown; choose of {', '.join(map(given, allowed))}")
    if len(set(chosen)) < len(chosen):
        raise ParameterError(f"{name} names a class twice; name it once")
    return chosen


def _range(table: dict[str, Any]) -> range:
    if set(table) != {"from", "to"}:
        raise ParameterError("nodes: a range is written { from = 5, to = 40 }")
    least, most = (whole_number(table[key], f"nodes.{key}", 1, LARGEST_ORDER) for key in ("from", "to"))
    _require(least <= most, "nodes.to", most, f"{least} or more")
    return range(least, most + 1)


# ---------------------------------------------------------------------- drawing


def _least(connectivity: str, balanced: bool, undirected: bool) -> int:
    """Return the least number of nodes: a cycle with negative product takes two nodes, three where edges go both ways.

    Outside a strongly connected graph there is at least one follower.
    """
    group = 1 if balanced else 3 if undirected else 2
    return {"strong": group, "quasi-strong": group + 1, "weak": 2 * group + 1, "disconnected": 2 * group}[connectivity]


class _Drawing:
    """One graph of an ensemble as it is drawn, in positions ``0 .. n - 1``."""

    def __init__(self, ensemble: Ensemble, i: int):
        self.connectivity, self.balanced = ensemble.kind(i)
        self.ensemble, self.undirected = ensemble, ensemble.undirected
        self.rng = np.random.default_rng([ensemble.seed, i])
        self.n = n = ensemble.nodes[self.draw(0, len(ensemble.nodes))]
        self.group = _least("strong", self.balanced, self.undirected)  # nodes of a leading block, at least
        self.leading = np.full(n, -1)  # number of the leading block that a node is in
        self.cycles: list[range] = []  # for each leading block the numbers of the edges along one cycle

    def graph(self) -> SignedDigraph:
        source, target = self.edges()
        signs = self.signs(source, target).tolist()
        weights = [size * sign for size, sign in zip(self.sizes(source.size), signs, strict=True)]
        if self.undirected:
            source, target = np.append(source, target), np.append(target, source)
            weights = weights * 2
        number = self.rng.permutation(self.n)  # no number tells who leads
        return SignedDigraph(map(str, range(1, self.n + 1)), number[source], number[target], Weights(weights))

    def draw(self, least: int, end: int) -> int:
        """Draw one of ``least .. end - 1``."""
        return int(self.rng.integers(least, end))

    def shares(self, extra: int, boxes: int) -> list[int]:
        """Share ``extra`` among ``boxes``, unevenly."""
        return [int(x) for x in self.rng.multinomial(extra, self.rng.dirichlet(np.ones(boxes)))]

    def parts(self) -> Iterator[list[_Block]]:
        """Lay out the weakly connected parts in blocks that cover ``0 .. n - 1``."""
        if self.connectivity != "disconnected":
            yield self.part(0, self.n, self.connectivity)
            return
        count = self.draw(2, min(MOST_PARTS, self.n // self.group) + 1)
        first = 0
        for extra in self.shares(self.n - count * self.group, count):
            size = self.group + extra
            kinds = CONNECTIVITIES[:1] if self.undirected else CONNECTIVITIES[:3]
            fit = [kind for kind in kinds if _least(kind, self.balanced, self.undirected) <= size]
            yield self.part(first, size, fit[self.draw(0, len(fit))])
            first += size

    def part(self, first: int, n: int, connectivity: str) -> list[_Block]:
        if connectivity == "strong":
            return [_Block(first, first + n, first, True)]
        groups = 1 if connectivity == "quasi-strong" else self.draw(2, min(MOST_GROUPS, (n - 1) // self.group) + 1)
        *leading, following = self.shares(n - 1 - groups * self.group, groups + 1)
        blocks, at = [], first
        for extra in leading:
            blocks.append(_Block(at, at + self.group + extra, at, True))
            at = blocks[-1].last
        single = self.rng.random(following) < self.rng.random()  # from one block to a chain of single nodes
        cuts = [at, *(at + 1 + np.flatnonzero(single)).tolist(), first + n]
        return blocks + [_Block(a, b, first, False) for a, b in pairwise(cuts)]

    def edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Return sources and targets; of an undirected graph, one of the two directions."""
        n, degree = self.n, self.ensemble.mean_degree
        pairs: list[tuple[int, int]] = []
        low, high = np.zeros((2, n), dtype=np.int64)
        for blocks in list(self.parts()):
            for block in blocks:
                here = slice(block.first, block.last)
                nodes = (block.first + self.rng.permutation(block.last - block.first)).tolist()
                edges, length = self.tree(nodes) if self.undirected else self.ears(nodes)
                if block.leads:
                    self.leading[here] = len(self.cycles)
                    self.cycles.append(range(len(pairs), len(pairs) + length))
                pairs += edges
                low[here], high[here] = block.floor, block.last
            pairs += self.links(blocks)
        if self.undirected:  # every edge from the smaller position to the larger one
            pairs = [(min(pair), max(pair)) for pair in pairs]
            degree = degree / 2
            high = np.arange(n)
        skeleton = np.array([t * n + s for s, t in pairs], dtype=np.int64)
        keys = np.append(skeleton, self.further(low, high, skeleton, round(degree * n) - skeleton.size))
        return keys % n, keys // n

    def further(self, low: np.ndarray, high: np.ndarray, present: np.ndarray, count: int) -> np.ndarray:
        """Choose ``count`` more edges: node ``t`` may listen to ``low[t] .. high[t] - 1`` but itself."""
        n = self.n
        itself = (low <= np.arange(n)) & (np.arange(n) < high)
        ends = np.cumsum(high - low - itself)
        count = min(count, int(ends[-1]) - present.size)
        if count <= 0:
            return present[:0]
        # As many besides as are present: whatever is drawn twice, enough remain.
        picks = self.rng.choice(int(ends[-1]), count + present.size, replace=False)
        target = np.searchsorted(ends, picks, side="right")
        source = low[target] + picks - np.append(0, ends)[target]
        source += itself[target] & (source >= target)
        keys = target * n + source
        return keys[~np.isin(keys, present)][:count]

    def ears(self, nodes: list[int]) -> tuple[list[tuple[int, int]], int]:
        """Connect nodes strongly: first a cycle, whose length is returned too, and ears from it back to it."""
        if len(nodes) == 1:
            return [], 0
        size = length = self.draw(2, len(nodes) + 1)
        edges = _cycle(nodes[:length])
        while size < len(nodes):
            new = nodes[size : size + self.draw(1, len(nodes) - size + 1)]
            begin, end = (nodes[self.draw(0, size)] for _ in range(2))
            edges += pairwise([begin, *new, end])
            size += len(new)
        return edges, length

    def tree(self, nodes: list[int]) -> tuple[list[tuple[int, int]], int]:
        """Connect nodes by a tree, grown from a cycle of three nodes or more if it is not to be balanced."""
        length = 0 if self.balanced else self.draw(3, len(nodes) + 1)
        branches = [(nodes[self.draw(0, i)], nodes[i]) for i in range(max(length, 1), len(nodes))]
        return _cycle(nodes[:length]) + branches, length

    def links(self, blocks: list[_Block]) -> list[tuple[int, int]]:
        """Let the first block of followers listen to every leading block, and each later one to somebody before it."""
        leading = [(block.first, block.last) for block in blocks if block.leads]
        links = []
        for number, block in enumerate(blocks[len(leading) :]):
            spans = leading if number == 0 else [(block.floor, block.first)]
            links += [(self.draw(*span), self.draw(block.first, block.last)) for span in spans]
        return links

    def signs(self, source: np.ndarray, target: np.ndarray) -> np.ndarray:
        camp, sign = (np.where(self.rng.random(m) < self.ensemble.negative, -1, 1) for m in (self.n, source.size))
        if self.balanced:
            inside = (self.leading[source] >= 0) & (self.leading[source] == self.leading[target])
            return np.where(inside, camp[source] * camp[target], sign)
        for cycle in self.cycles:
            if np.prod(sign[cycle]) > 0:
                sign[cycle[self.draw(0, len(cycle))]] *= -1
        return sign

    def sizes(self, m: int) -> list[Fraction]:
        (low, high), decades = self.ensemble.weight_range, self.ensemble.weight_decades
        if decades is not None:
            samples = (10.0 ** self.rng.uniform(-decades / 2, decades / 2, m)).tolist()
            return [Fraction(f"{x:.2e}") for x in samples]
        if low == high:
            return [low] * m
        if high - low < 10 * Fraction(10) ** (int(f"{float(high):e}".partition("e")[2]) - 2):
            return [low + (high - low) * Fraction(round(1000 * x), 1000) for x in self.rng.uniform(size=m).tolist()]
        samples = self.rng.uniform(float(low), float(high), m).tolist()
        return [min(max(Fraction(f"{x:.2e}"), low), high) for x in samples]


def _cycle(nodes: list[int]) -> list[tuple[int, int]]:
    return list(zip(nodes, nodes[1:] + nodes[:1], strict=True))
