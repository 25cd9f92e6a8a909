"""The place of the nonzero spectrum against a line, compared with numerical and with exact algebra."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from math import lcm

import flint
import networkx as nx
import numpy as np
import pytest

from lmi.exact import polynomials
from lmi.exact import spectrum_beyond_line as spectrum
from lmi.exact.polynomials import characteristic, rank
from lmi.exact.spectrum_beyond_line import nonzero_spectrum_beyond
from lmi.exact.work import WorkError, limited

#: Weights of the edges from j to i, by (j, i).
Edges = dict[tuple[int, int], Fraction]


def laplacian(
    size: int, edges: Mapping[tuple[int, int], Fraction | int], factor: int = 1
) -> tuple[list[dict[int, int]], int, int]:
    """Rows of the Laplacian, their unit, and how many strong components are closed and balanced."""
    unit = factor * lcm(*(Fraction(w).denominator for w in edges.values()))
    rows: list[dict[int, int]] = [{} for _ in range(size)]
    graph = nx.DiGraph()
    graph.add_nodes_from(range(size))
    for (j, i), w in edges.items():
        graph.add_edge(j, i)
        rows[i][j] = -int(w * unit)
        rows[i][i] = rows[i].get(i, 0) + abs(int(w * unit))
    still = 0
    for nodes in map(list, nx.strongly_connected_components(graph)):
        still += all(j in nodes for i in nodes for j in graph.predecessors(i)) and balanced(nodes, edges)
    return rows, unit, still


def balanced(nodes: list[int], edges: Mapping[tuple[int, int], Fraction | int]) -> bool:
    side, left = {nodes[0]: 1}, [nodes[0]]
    inner = [(j, i, 1 if w > 0 else -1) for (j, i), w in edges.items() if j in nodes and i in nodes]
    while left:
        node = left.pop()
        for j, i, sign in inner:
            if node in (i, j):
                other = j if node == i else i
                if other not in side:
                    side[other] = side[node] * sign
                    left.append(other)
    return all(side[i] == side[j] * sign for j, i, sign in inner)


def location(size: int, edges: Mapping[tuple[int, int], Fraction | int], line: Fraction | int, factor: int = 1) -> str:
    return nonzero_spectrum_beyond(*laplacian(size, edges, factor)[:2], Fraction(line))


def ring(nodes: list[int], weight: int = 1) -> dict[tuple[int, int], int]:
    return dict.fromkeys(zip(nodes, nodes[1:] + nodes[:1], strict=True), weight)


def complete(nodes: Iterable[int], weight: int = 1) -> dict[tuple[int, int], int]:
    nodes = list(nodes)
    return {(j, i): weight for i in nodes for j in nodes if i != j}


def numerical(rows: list[dict[int, int]], unit: int) -> np.ndarray:
    size = len(rows)
    return np.linalg.eigvals(np.array([[row.get(j, 0) / unit for j in range(size)] for row in rows]))


def exact(rows: list[dict[int, int]], unit: int, line: Fraction) -> str:
    """Place by enclosed roots of the minimal polynomial, whose multiplicities are sizes of Jordan blocks.

    A root nearer to the line than 1e-20 is taken to lie on it.
    """
    size = len(rows)
    minimal = flint.fmpz_mat(size, size, [row.get(j, 0) for row in rows for j in range(size)]).minpoly()
    worst = "beyond"
    for root, multiplicity in minimal.complex_roots():
        if root == 0:
            assert multiplicity == 1
            continue
        apart = root.real - flint.arb(flint.fmpq(line.numerator, line.denominator)) * unit
        if abs(apart) < 1e-20:
            worst = "defective" if multiplicity > 1 or worst == "defective" else "on"
        elif apart < 0:
            return "below"
    return worst


@pytest.fixture
def precision():
    before, flint.ctx.prec = flint.ctx.prec, 200
    yield
    flint.ctx.prec = before


# Classes of graphs: each makes a number of nodes and the edges.


def weight(r: random.Random, signed: bool = True) -> Fraction:
    return Fraction(r.randint(1, 30), r.randint(1, 12)) * (r.choice([1, -1]) if signed else 1)


def digraph(r: random.Random) -> tuple[int, Edges]:
    size = r.randint(2, 9)
    return size, {(j, i): weight(r) for i in range(size) for j in range(size) if i != j and r.random() < 0.3}


def undirected(r: random.Random) -> tuple[int, Edges]:
    size = r.randint(2, 8)
    edges = {}
    for i in range(size):
        for j in range(i):
            if r.random() < 0.5:
                edges[i, j] = edges[j, i] = weight(r)
    return size, edges


def two_sides(r: random.Random) -> tuple[int, Edges]:
    size = r.randint(3, 9)
    side = [r.choice([1, -1]) for _ in range(size)]
    edges = {(j, i): weight(r, False) for i in range(size) for j in range(size) if i != j and r.random() < 0.35}
    edges |= {((i - 1) % size, i): weight(r, False) for i in range(size)}
    return size, {(j, i): side[i] * side[j] * w for (j, i), w in edges.items()}


def unbalanced_ring(r: random.Random) -> tuple[int, Edges]:
    size = r.randint(3, 8)
    edges = {((i - 1) % size, i): weight(r, False) for i in range(size)}
    edges[size - 1, 0] *= -1
    return size, edges


def leaders(r: random.Random) -> tuple[int, Edges]:
    """Several closed components and followers after them."""
    size = r.randint(4, 10)
    return size, {(j, i): weight(r) for i in range(2, size) for j in range(i) if r.random() < 0.5}


def parts(size: int, edges: Edges) -> list[list[int]]:
    """Nodes of the strong components, by networkx."""
    graph = nx.DiGraph(list(edges))
    graph.add_nodes_from(range(size))
    return [sorted(nodes) for nodes in nx.strongly_connected_components(graph)]


CLASSES = [digraph, undirected, two_sides, unbalanced_ring, leaders]


@pytest.mark.parametrize("make", CLASSES)
def test_random_graphs_on_both_sides_of_the_slowest_mode(make: Callable[[random.Random], tuple[int, Edges]]):
    r = random.Random(make.__name__)
    compared = 0
    while compared < 80:
        size, edges = make(r)
        if not edges:
            continue
        rows, unit, still = laplacian(size, edges)
        roots = numerical(rows, unit)
        slowest = np.sort(roots.real)[still:]
        assert np.sum(abs(roots) < 1e-9) == still
        if not len(slowest):
            continue
        compared += 1
        for factor, expected in ((0.9, "beyond"), (1.1, "below")):
            line = Fraction(slowest[0] * factor).limit_denominator(r.choice([10**3, 10**6, 10**15]))
            assert nonzero_spectrum_beyond(rows, unit, line) == expected
            assert nonzero_spectrum_beyond(rows, unit, line, parts(size, edges)) == expected
            c = r.randint(2, 40)
            more = [{j: c * v for j, v in row.items()} for row in rows]
            assert nonzero_spectrum_beyond(more, c * unit, line) == expected


def unit_weights(r: random.Random) -> tuple[int, Edges]:
    """Small components with weights 1 and 2, so that eigenvalues repeat across them."""
    size, edges = 0, {}
    for _ in range(r.randint(1, 4)):
        kind = r.choice(["node", "node", "ring", "complete", "pair", "random"])
        inner = list(range(size, size + {"node": 1, "ring": 3, "complete": 3, "pair": 2, "random": 3}[kind]))
        if kind == "ring":
            made = ring(inner)
        elif kind == "random":
            made = {key: r.choice([1, 2, -1]) for key in complete(inner) if r.random() < 0.6}
        else:
            made = complete(inner, r.choice([1, -1]))
        edges |= {key: Fraction(w) for key, w in made.items()}
        if size and r.random() < 0.8:
            for _ in range(r.randint(1, 2)):
                edges[r.randrange(size), r.choice(inner)] = Fraction(r.choice([1, 1, -1]))
        size += len(inner)
    return size, edges


@pytest.mark.parametrize("bits", [spectrum.BITS, ()], ids=["rounded first", "exact only"])
def test_lines_through_eigenvalues(bits: tuple[int, ...], monkeypatch: pytest.MonkeyPatch, precision: None):
    monkeypatch.setattr(spectrum, "BITS", bits)
    r = random.Random(7)
    seen: dict[str, int] = {}
    for _ in range(400):
        size, edges = unit_weights(r)
        if not edges:
            continue
        rows, unit, still = laplacian(size, edges)
        real = np.sort(numerical(rows, unit).real)[still:]
        if not len(real):
            continue
        line = max(Fraction(round(2 * real[0]), 2), Fraction(1, 2))
        found = nonzero_spectrum_beyond(rows, unit, line)
        assert found == exact(rows, unit, line) == nonzero_spectrum_beyond(rows, unit, line, parts(size, edges))
        seen[found] = seen.get(found, 0) + 1
    assert min(seen[key] for key in ("beyond", "on", "defective", "below")) >= 10, seen


def test_a_directed_ring():
    edges = ring([0, 1, 2])
    assert location(3, edges, Fraction(3, 2)) == "on"
    assert location(3, edges, Fraction(3, 2) - Fraction(1, 10**30)) == "beyond"
    assert location(3, edges, Fraction(3, 2) + Fraction(1, 10**30)) == "below"


def test_a_chain_has_a_jordan_block():
    edges = {(0, 1): 1, (1, 2): 1}
    assert [location(3, edges, Fraction(n, 2)) for n in (1, 2, 4)] == ["beyond", "defective", "below"]


def test_a_star_has_none():
    assert location(3, {(0, 1): 1, (0, 2): -1}, 1) == "on"


@pytest.mark.parametrize("weight", [1, -1])
def test_complete_graphs(weight: int):
    edges = complete(range(4), weight)
    if weight > 0:  # 0 and 4 three times
        assert [location(4, edges, line) for line in (3, 4, 5)] == ["beyond", "on", "below"]
    else:  # 2 three times and 6
        assert [location(4, edges, line) for line in (1, 2, 3)] == ["beyond", "on", "below"]


def test_a_change_of_signs_by_sides_changes_nothing():
    side = [1, -1, -1, 1]
    edges = {(j, i): side[i] * side[j] for j, i in complete(range(4))}
    assert [location(4, edges, line) for line in (3, 4, 5)] == ["beyond", "on", "below"]


def rings(count: int, weight: int, heard: int, joined: str) -> tuple[int, Edges]:
    """Directed rings of 3, whose nodes also hear weights of sum ``heard``: of the leader 0, or of the ring before.

    Each ring is the block ``(heard + |weight|) I - weight P``, with ``P`` a cyclic permutation.
    """
    edges: Edges = {}
    for start in range(1, 3 * count, 3):
        edges |= {key: Fraction(weight) for key in ring([start, start + 1, start + 2])}
        for k in range(3):
            if start == 1 or joined == "apart":
                edges[0, start + k] = Fraction(heard)
            elif joined == "node to node":
                edges[start + k - 3, start + k] = Fraction(heard)
            elif joined == "one to all":
                edges[start - 1, start + k] = Fraction(heard)
            else:  # one node hears one node with a part of the weight
                edges[0, start + k] = Fraction(heard) * (1 if k else Fraction(3, 4))
        if start > 1 and joined == "one to one":
            edges[start - 1, start] = Fraction(heard, 4)
    return 3 * count + 1, edges


@pytest.mark.parametrize("count", [2, 3, 12])
@pytest.mark.parametrize(
    ("weight", "heard", "line", "joined", "expected"),
    [
        # 4 and 7 +- i sqrt(3): a real eigenvalue on the line.
        (2, 4, 4, "apart", "on"),
        (2, 4, 4, "node to node", "defective"),
        (2, 4, 4, "one to one", "defective"),
        (2, 4, 4, "one to all", "defective"),
        # 3 and 3/2 +- i sqrt(3)/2: a complex pair, which what is heard by all alike does not move.
        (-1, 1, Fraction(3, 2), "apart", "on"),
        (-1, 1, Fraction(3, 2), "node to node", "defective"),
        (-1, 1, Fraction(3, 2), "one to one", "defective"),
        (-1, 1, Fraction(3, 2), "one to all", "on"),
    ],
)
def test_eigenvalues_repeated_across_rings(
    count: int, weight: int, heard: int, line: Fraction | int, joined: str, expected: str, precision: None
):
    rows, unit, _ = laplacian(*rings(count, weight, heard, joined))
    line = Fraction(line)
    assert nonzero_spectrum_beyond(rows, unit, line) == expected
    if count < 4:
        assert exact(rows, unit, line) == expected
    assert nonzero_spectrum_beyond(rows, unit, line * Fraction(99, 100)) == "beyond"
    assert nonzero_spectrum_beyond(rows, unit, line * Fraction(101, 100)) == "below"


def test_two_closed_rings_and_a_chain_after_them():
    closed = ring([0, 1, 2]) | ring([3, 4, 5])
    assert location(6, closed, Fraction(3, 2)) == "on"
    # Followers at 2 do not come near; one at 3/2 lies on the line beside the pairs; one at 1 is below.
    for weights, expected in (
        ((1, 1), "on"),
        ((Fraction(3, 4), Fraction(3, 4)), "on"),
        ((1, Fraction(-1, 4)), "below"),
    ):
        assert location(7, closed | {(0, 6): weights[0], (3, 6): weights[1]}, Fraction(3, 2)) == expected
    chain = closed | {(0, 6): Fraction(3, 2), (6, 7): Fraction(3, 2)}
    assert location(8, chain, Fraction(3, 2)) == "defective"


@pytest.mark.parametrize("bits", [spectrum.BITS, ()], ids=["rounded first", "exact only"])
def test_roots_in_symmetry_to_the_line(bits: tuple[int, ...], monkeypatch: pytest.MonkeyPatch):
    """Their polynomial in y has even powers only, as that of roots on the line, but one of each pair is below."""
    monkeypatch.setattr(spectrum, "BITS", bits)
    # Followers at 1 and 3, each a block: none of them is on 2, and 1 is below.
    assert location(3, {(0, 1): 1, (0, 2): 3}, 2) == "below"
    # In one block: an undirected pair with 1 to a leader, 1 and 3.
    assert location(3, {(1, 2): 1, (2, 1): 1, (0, 1): 1, (0, 2): 1}, 2) == "below"
    on_axis = spectrum._roots_on_axis
    assert on_axis([1, 0, -1]) is None  # y^2 - 1
    assert on_axis([1, 0, 0, 0, 4]) is None  # y^4 + 4: +-1 +- i
    assert on_axis([1, -1, 0, 0, 4, -4]) is None  # (y^4 + 4)(y - 1)
    assert on_axis([1, 0, 1]) == (2, [1, 0, 1])  # y^2 + 1
    assert on_axis([1, 0, 2, 0, 1]) == (4, [1, 0, 1])  # (y^2 + 1)^2
    assert on_axis([1, -1, 2, -2, 0, 0]) == (4, [1, 0, 2, 0])  # y^2 (y^2 + 2)(y - 1)
    assert on_axis([1, 0, 0, -1]) is None  # y^3 - 1
    assert on_axis([1, -3, 3, -1]) == (0, [1])  # (y - 1)^3
    assert on_axis([1, 0, 1, 0, 1]) is None  # y^4 + y^2 + 1


@pytest.mark.parametrize("bits", [(8,), (64,), spectrum.BITS, ()])
def test_products_of_chosen_roots(bits: tuple[int, ...], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(spectrum, "BITS", bits)
    r = random.Random(3)
    for _ in range(150):
        p, zeros, below = [1], r.randint(0, 2), False
        squares = [r.randint(1, 5) for _ in range(r.randint(0, 3))]
        simple = [1, 0] if zeros else [1]
        for square in squares:
            p = polynomials.product(p, [1, 0, square])
        for square in set(squares):
            simple = polynomials.product(simple, [1, 0, square])
        for _ in range(r.randint(0, 4)):
            root, square = r.choice([-1, 1, 1, 2, 3, 50]), r.randint(0, 3)
            below |= root < 0
            p = polynomials.product(p, [1, -root] if not square else [1, -2 * root, root**2 + square])
        count = zeros + 2 * len(squares)
        assert spectrum._roots_on_axis(p + [0] * zeros) == (None if below else (count, simple))


def test_the_unit_and_the_line_scale_together():
    edges = {(0, 1): Fraction(1, 3), (1, 2): Fraction(1, 3), (2, 1): Fraction(-2, 7)}
    for factor in (1, 5, 10**20):
        for line, c in ((Fraction(1, 10), 1), (Fraction(1, 2), 1), (Fraction(2), 20)):
            more = {key: c * w for key, w in edges.items()}
            assert location(3, more, line, factor) == location(3, edges, line / c)
    chain = {(0, 1): Fraction(1, 3), (1, 2): Fraction(1, 3)}
    assert location(3, chain, Fraction(1, 3), 12) == "defective"


def test_without_edges_nothing_is_below():
    assert nonzero_spectrum_beyond([{}, {}], 1, Fraction(5)) == "beyond"


@pytest.mark.parametrize(("unit", "line"), [(0, 1), (1, 0), (-1, 1)])
def test_what_is_refused(unit: int, line: int):
    with pytest.raises(ValueError, match="positive"):
        nonzero_spectrum_beyond([{}, {0: -1, 1: 1}], unit, Fraction(line))


def test_characteristic_polynomials_and_ranks():
    r = random.Random(1)
    for _ in range(60):
        size = r.randint(1, 9)
        rows = [{j: r.randint(-9, 9) for j in range(size) if r.random() < 0.5} for _ in range(size)]
        if size > 1 and r.random() < 0.5:
            rows[-1] = {j: rows[0].get(j, 0) - 2 * rows[1].get(j, 0) for j in range(size)}
        rows = [{j: v for j, v in row.items() if v} for row in rows]
        matrix = flint.fmpz_mat(size, size, [row.get(j, 0) for row in rows for j in range(size)])
        assert characteristic(rows) == [int(c) for c in reversed(matrix.charpoly().coeffs())]
        assert rank(rows) == matrix.rank()


def test_a_large_graph():
    r = random.Random(60)
    size = 60
    edges = {((i - 1) % size, i): Fraction(r.randint(1, 99), 50) for i in range(size)}
    for i in range(size):
        for j in r.sample(range(size), 3):
            if j != i:
                edges[j, i] = Fraction(r.randint(1, 99), 50) * r.choice([1, -1])
    rows, unit, still = laplacian(size, edges)
    assert not still
    slowest = numerical(rows, unit).real.min()
    for factor, expected in ((0.999, "beyond"), (1.001, "below")):
        start = time.perf_counter()
        line = Fraction(slowest * factor).limit_denominator(10**9)
        assert nonzero_spectrum_beyond(rows, unit, line) == expected
        print(f"{size} nodes, {expected}: {time.perf_counter() - start:.2f} s")


@pytest.mark.few(0)
def test_a_line_beside_an_eigenvalue_costs_no_more_than_its_own_component():
    """The ring has 3 +- i sqrt(3), and the line is nearer than any enclosure tells; the followers are dense."""
    r = random.Random(1)
    edges = ring([0, 1, 2], 2) | {(0, i): 100 for i in range(3, 18)}
    edges |= {(j, i): r.choice([-1, 1]) * r.randrange(3, 9) for i in range(3, 18) for j in range(3, 18) if i != j}
    rows, unit, _ = laplacian(18, edges)
    line = 3 - Fraction(1, 2**8600)
    with limited(1):
        assert nonzero_spectrum_beyond(rows, unit, line, parts(18, edges)) == "beyond"
    with pytest.raises(WorkError, match="Routh"), limited(1):
        nonzero_spectrum_beyond(rows, unit, line)
