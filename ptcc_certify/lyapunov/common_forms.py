"""Lyapunov functions of families: one matrix for every signal, its rates, and the constants of inputs, all proved.

The distance of a family of graphs to its common states at rest, as a linear system of its own.

``K`` is at rest in every member, ``B`` its basis (N, d), and ``p_1 .. p_d`` are *pivots*, nodes whose rows of ``B`` are
the unit vectors. Over the other nodes

    xi_k = x_k - sum_j B_kj x_(p_j),    xi = C X,    xi' = -gain A xi,    A = C L C^r

for every member ``L``, since ``L B = 0``; ``C^r`` puts ``xi`` on these nodes and 0 on the pivots. An uncertain weight
changes ``A`` by a matrix of rank one: ``A = A_0 + sum_e delta_e f_e h_e'``, ``|delta_e| <= r_e``.

References
----------
docs/theory/families.md, "Common quadratic functions" and "Uncertain weights".
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from lmi.definiteness_proofs import prove_generalized_margin
from lmi.exact import arithmetic
from lmi.exact.numbers import integers
from lmi.uncertain_matrix import UncertainMatrix
from ptcc_certify.checker.common_forms import Scaled, spread
from ptcc_certify.checker.common_kernel_ends import WeightedMean
from ptcc_certify.checker.input_formulas import root_above
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.theorems.family_behaviour import FamilyComponent, moving_rest_state
from ptcc_certify.theorems.kernel import Kernel, TooLarge
from ptcc_certify.theorems.lemmas import Matrix, integer_matrix, integer_rows

Vector = tuple[Fraction, ...]


@dataclass(frozen=True)
class UncertainPart:
    """What one uncertain parameter adds: ``delta f h'`` with ``|delta| <= radius``.

    Attributes
    ----------
    edge : int
        The number of the edge in its mode; of an undirected edge that of the direction from the smaller node.
    f, h : tuple of n Fraction
        In the coordinates ``xi``.
    effect : dict of node to int
        ``f`` in the coordinates ``X``: 1 at the listener; of an undirected edge its sign, reversed, at the other end.
    radius : Fraction
        Half the length of the interval of ``|w|``.
    """

    edge: int
    f: Vector
    h: Vector
    effect: dict[int, int]
    radius: Fraction


@dataclass(frozen=True, eq=False)
class QuotientMode:
    """One mode: ``A = center + sum_e delta_e f_e h_e'``.

    Attributes
    ----------
    center : n rows of n Fraction
        ``A_0``, with all weights at the midpoints of their intervals.
    parts : tuple of UncertainPart
    rows : N rows of n Fraction
        ``L_0 C^r``: the input of each node is minus the gain times its row of this times ``xi``.
    """

    center: Matrix
    parts: tuple[UncertainPart, ...]
    rows: Matrix

    @cached_property
    def array(self) -> UncertainMatrix:
        """The same in floats."""
        n, q = len(self.center), len(self.parts)
        F, H = np.zeros((n, q)), np.zeros((n, q))
        for e, part in enumerate(self.parts):
            F[:, e], H[:, e] = [float(x) for x in part.f], [float(x) for x in part.h]
        A = np.array([[float(x) for x in row] for row in self.center]).reshape(n, n)
        return UncertainMatrix(A, F, H, np.array([float(part.radius) for part in self.parts]))

    @property
    def proof_rows(self) -> int:
        """Rows of the matrix that proves a rate: one for each coordinate and each multiplier."""
        return len(self.center) + len(self.parts)

    @property
    def at_rest(self) -> bool:
        """Whether nothing moves in this mode: a mode without edges, an outage."""
        return not self.parts and not any(map(any, self.center))

    @property
    def largest_entry(self) -> float:
        """The size of the largest entry of ``A_0``."""
        return max((float(abs(x)) for row in self.center for x in row), default=0.0)

    def member(self, levels: Sequence[Fraction]) -> Matrix:
        """Return ``A`` with each uncertain size at ``w- + level (w+ - w-)``, levels in the order of ``parts``."""
        A = [list(row) for row in self.center]
        for part, level in zip(self.parts, levels, strict=True):
            delta = (2 * level - 1) * part.radius
            for row, f in zip(A, part.f, strict=True):
                if f and delta:
                    row[:] = [x + delta * f * h for x, h in zip(row, part.h, strict=True)]
        return A


class Quotient:
    """The coordinates ``xi`` of a family whose states at rest have a common subspace.

    Parameters
    ----------
    family : Family
        Connected.
    kernel : Kernel, optional
        ``K``; by default the kernel of the first mandatory graph whose dimension is least. Modes may have more states
        at rest than ``K``, as an outage has.

    Attributes
    ----------
    kernel : Kernel
    pivots : tuple of int
        The first node of each balanced closed component that ``K`` belongs to.
    nodes : tuple of int
        The others, ascending.

    Raises
    ------
    HypothesisError
        A state of ``K`` moves in some member, or ``B`` takes an exact solve of too many rows.

    Examples
    --------
    >>> day = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    >>> night = SignedDigraph.from_edges([("c", "a", -2), ("a", "b", 1)])
    >>> quotient = Quotient(Family.switching([day, night]))
    >>> quotient.pivots, quotient.nodes, quotient.modes[1].center
    ((0,), (1, 2), [[Fraction(1, 1), Fraction(-2, 1)], [Fraction(0, 1), Fraction(2, 1)]])
    """

    def __init__(self, family: Family, kernel: Kernel | None = None):
        self.family, self.kernel = family, kernel or _least_kernel(family)
        balanced = [c for c in self.kernel.structure.closed_components if c.balanced]
        self.pivots = tuple(c.nodes[0] for c in balanced)
        self.nodes = tuple(v for v in range(family.n_nodes) if v not in set(self.pivots))
        try:
            self._verify_rest()
            self.basis = [tuple(self.kernel.row(v)) for v in range(family.n_nodes)]
        except TooLarge:
            raise HypothesisError("the common states at rest take an exact solve of too many rows") from None

    @classmethod
    def of(cls, component: FamilyComponent) -> Quotient:
        """Return the quotient of a component whose behaviour is decided and does not depend on the signal.

        Raises
        ------
        HypothesisError
            It does, or is not decided.
        """
        if component.kernel is None:
            raise HypothesisError("the members have no common kernel, or it is not known")
        return cls(component.family, component.kernel)

    @cached_property
    def modes(self) -> tuple[QuotientMode, ...]:
        """What every mode is in these coordinates."""
        return tuple(self._mode(mode) for mode in self.family.modes)

    def coordinates(self, x: Sequence[Fraction]) -> list[Fraction]:
        """Return ``xi`` of a state."""
        return [x[v] - sum(b * x[p] for b, p in zip(self.basis[v], self.pivots, strict=True)) for v in self.nodes]

    def coordinate_sizes(self, sizes: Mapping[int, Fraction]) -> list[Fraction]:
        """Return bounds of ``|xi_k|`` of all states with ``|x_k| <= sizes_k``."""
        rows = ((v, zip(self.basis[v], self.pivots, strict=True)) for v in self.nodes)
        return [sizes[v] + sum((abs(b) * sizes[p] for b, p in row), Fraction(0)) for v, row in rows]

    def _verify_rest(self) -> None:
        if (moved := moving_rest_state(self.family, self.kernel)) is not None:
            name = self.family.modes[moved.other].name or moved.other + 1
            raise HypothesisError(f"a state at rest in one mode moves in mode {name}")

    def _mode(self, mode: Mode) -> QuotientMode:
        place = {v: i for i, v in enumerate(self.nodes)}
        rows = [[Fraction(0)] * len(self.nodes) for _ in range(self.family.n_nodes)]
        for edge in range(mode.n_edges):
            weight = (mode.lower.fraction(edge) + mode.upper.fraction(edge)) / 2
            source, target = int(mode.source[edge]), int(mode.target[edge])
            for v, entry in ((target, weight), (source, -int(mode.sign[edge]) * weight)):
                if v in place:
                    rows[target][place[v]] += entry
        parts = (self._part(mode, int(edge), place) for edge in mode.parameters)
        return QuotientMode(self._project(rows), tuple(p for p in parts if any(p.f) and any(p.h)), rows)

    def _project(self, rows: Matrix) -> Matrix:
        """Return ``C M``: the rows of the nodes, minus those of the pivots times ``B``."""
        result = []
        for v in self.nodes:
            row = list(rows[v])
            for b, pivot in zip(self.basis[v], self.pivots, strict=True):
                if b:
                    row = [x - b * y for x, y in zip(row, rows[pivot], strict=True)]
            result.append(row)
        return result

    def _part(self, mode: Mode, edge: int, place: dict[int, int]) -> UncertainPart:
        source, target, sign = int(mode.source[edge]), int(mode.target[edge]), int(mode.sign[edge])
        h = [Fraction(0)] * len(self.nodes)
        for v, entry in ((target, 1), (source, -sign)):
            if v in place:
                h[place[v]] = Fraction(entry)
        effect = {target: 1, source: -sign} if mode.tied else {target: 1}
        column = [[Fraction(effect.get(v, 0))] for v in range(self.family.n_nodes)]
        f = tuple(x for (x,) in self._project(column))
        radius = (mode.upper.fraction(edge) - mode.lower.fraction(edge)) / 2
        return UncertainPart(edge, f, tuple(h), effect, radius)


def _least_kernel(family: Family) -> Kernel:
    kernels = [Kernel(analyse(mode.mandatory)) for mode in family.modes]
    return min(kernels, key=lambda kernel: kernel.dimension)


#: Significant bits of constants, which are rounded up.
_CONSTANT_BITS = 53
#: Room for a check that forms the constants with other roundings.
MARGIN = 1 + Fraction(1, 2**40)
#: Against the entries of a mode: bounds of growth that are tried where a rate is about 0.
_NEARLY_ZERO = (1e-9, 1e-7, 1e-5)


@dataclass(frozen=True, eq=False)
class CommonForm:
    """``V = xi' P xi`` of a family in its quotient coordinates; for every signal ``V <= e^(-rate s) V(0)``.

    More closely ``V(s) <= V(0) e^(-sum_i rates_i s_i)``, where the signal spends the part ``s_i`` of the clock in mode
    ``i``: modes in which not everything decays have rates of 0 or below.

    Attributes
    ----------
    kind : {"full", "diagonal", "undirected"}
        ``undirected``: ``P`` is the square of the distance to the states at rest, weighted by a common left vector.
    quotient : Quotient
        Its coordinates.
    matrix : n rows of n Fraction
        ``P``, positive definite.
    rates : tuple of Fraction
        One of each mode.
    multipliers : tuple of tuples of Fraction
        Of each mode: ``tau_e > 0`` of the parts of :class:`~ptcc_certify.lyapunov.common_forms.QuotientMode`, in their
        order; empty for the kind ``undirected``, of which the least weights are the worst.
    lowest, highest : Fraction
        ``lowest I <= P <= highest I``.
    optimal : bool
        Whether no rate of any kind is larger: ``diag(p) L`` is symmetric in the slowest mode in which something moves.
    input_constants : tuple of N Fraction
        ``|(L X)_k|^2 <= input_constants[k] V`` for every member ``L``.
    coordinate_constants : tuple of n Fraction
        ``xi_k^2 <= coordinate_constants[k] V``.
    means : tuple of WeightedMean
        Of leading groups: ``|q' L X|^2 <= constant V`` for every member.
    """

    kind: str
    quotient: Quotient
    matrix: Matrix
    rates: tuple[Fraction, ...]
    multipliers: tuple[tuple[Fraction, ...], ...]
    lowest: Fraction
    highest: Fraction
    optimal: bool = False
    input_constants: tuple[Fraction, ...] = ()
    coordinate_constants: tuple[Fraction, ...] = ()
    means: tuple[WeightedMean, ...] = ()

    @property
    def nodes(self) -> tuple[int, ...]:
        """The nodes that have a coordinate."""
        return self.quotient.nodes

    @property
    def rate(self) -> Fraction:
        """The least of the rates: that of every signal."""
        return min(self.rates)

    @property
    def overshoot(self) -> Fraction:
        """``highest / lowest``, which multiplies the squared norm of ``xi``."""
        return self.highest / self.lowest

    @cached_property
    def speeds(self) -> list[Scaled]:
        """Bounds of ``|(L X)_k| / sqrt(V)`` for every member: integers by node, and what multiplies them."""
        return [_roots(range(len(self.input_constants)), self.input_constants)]

    @cached_property
    def sizes(self) -> list[Scaled]:
        """Bounds of ``|xi_k| / sqrt(V)``."""
        return [_roots(self.nodes, self.coordinate_constants)]

    def root(self, x: Sequence[Fraction]) -> Fraction:
        """Bound ``sqrt(V)`` of a state."""
        return root_above(self.value(self.quotient.coordinates(x)))

    def largest(self, sizes: Mapping[int, Fraction]) -> Fraction:
        """Bound ``V`` of all states with ``|x_k| <= sizes_k``, by entries."""
        own = self.quotient.coordinate_sizes(sizes)
        rows = (sum((abs(p) * b for p, b in zip(row, own, strict=True)), Fraction(0)) for row in self.matrix)
        return sum((b * total for b, total in zip(own, rows, strict=True)), Fraction(0))

    def spread(self, sizes: Mapping[int, Fraction]) -> Fraction | None:
        """Bound how much faster ``sqrt(V)`` grows than agents that move by themselves part."""
        whole, scale = integers(self.matrix)
        return spread(whole, scale, [self.quotient.basis[v] for v in self.nodes], [sizes[v] for v in self.nodes])

    def value(self, xi: Sequence[Fraction]) -> Fraction:
        """Return ``V`` of quotient coordinates."""
        products = (
            x * sum(map(Fraction.__mul__, row, xi), Fraction(0)) for x, row in zip(xi, self.matrix, strict=True)
        )
        return sum(products, Fraction(0))


def decay_matrices(mode: QuotientMode, P: Matrix, multipliers: Sequence[Fraction]) -> tuple[Matrix, Matrix]:
    """Return ``S``, ``Z`` for which ``S - b Z > 0`` proves the rate ``b`` of all members of a mode.

    ``S = [[P A_0 + A_0' P - H diag(tau) H', P F diag(r)], [diag(r) F' P, diag(tau)]]``, ``Z = diag(P, 0)``.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> pair = Quotient(Family.from_intervals([("a", "b", 1, 3)])).modes[0]
    >>> S, Z = decay_matrices(pair, [[Fraction(1)]], [Fraction(1)])
    >>> [[str(x) for x in row] for row in S]
    [['3', '1'], ['1', '1']]
    """
    n, q = len(P), len(mode.parts)
    zero = Fraction(0)
    (form, p), (A, a) = integer_matrix(P), integer_matrix(mode.center)
    product = integer_rows(form * A)
    S = [[Fraction(product[i][j] + product[j][i], p * a) for j in range(n)] + [zero] * q for i in range(n)]
    S += [[zero] * n + [tau if i == j else zero for j in range(q)] for i, tau in enumerate(multipliers)]
    for e, (part, tau) in enumerate(zip(mode.parts, multipliers, strict=True)):
        heard = [(i, x) for i, x in enumerate(part.h) if x]
        for i, x in heard:
            for j, y in heard:
                S[i][j] -= tau * x * y
        pushed = [(j, x * part.radius) for j, x in enumerate(part.f) if x]
        for i, row in enumerate(P):
            S[i][n + e] = S[n + e][i] = sum((row[j] * x for j, x in pushed), zero)
    Z = [[*row, *[zero] * q] for row in P] + [[zero] * (n + q) for _ in range(q)]
    return S, Z


def prove_mode(mode: QuotientMode, P: Matrix, multipliers: Sequence[Fraction], guess: float) -> Fraction | None:
    """Prove a rate of all members of a mode, as near to the guess as proves; None if none was.

    That ``P`` is positive definite is proved by the caller. A mode in which nothing moves has the rate 0.
    """
    if mode.at_rest:
        return Fraction(0)
    S, Z = decay_matrices(mode, P, multipliers)
    return prove_margin_about(S, Z, guess, mode.largest_entry)


def prove_margin_about(S: Matrix, Z: Matrix, guess: float, unit: float) -> Fraction | None:
    """Prove ``S > b Z`` for ``b`` near to the guess, or, of a guess that is small against ``unit``, a small ``b < 0``.

    Examples
    --------
    >>> one = [[Fraction(1)]]
    >>> -1e-6 < prove_margin_about([[Fraction(0)]], one, 0.0, 1.0) < 0 < prove_margin_about(one, one, 1.0, 1.0) < 1
    True
    """
    guesses = [guess, *(-size * unit for size in _NEARLY_ZERO if abs(guess) <= size * unit)]
    return next((b for one in guesses if (b := prove_generalized_margin(S, Z, one)) is not None), None)


def prove_ends(P: Matrix) -> tuple[Fraction, Fraction] | None:
    """Prove ``0 < lowest I < P < highest I``; None if it fails.

    Examples
    --------
    >>> prove_ends([[Fraction(2), Fraction(0)], [Fraction(0), Fraction(1)]])
    (Fraction(1, 1), Fraction(2, 1))
    """
    if not any(x for i, row in enumerate(P) for j, x in enumerate(row) if i != j):
        diagonal = [row[i] for i, row in enumerate(P)]
        return (min(diagonal), max(diagonal)) if min(diagonal) > 0 else None
    return prove_margins(P)


def prove_margins(P: Matrix) -> tuple[Fraction, Fraction] | None:
    """Prove ``0 < lowest I < P < highest I`` strictly, also of a diagonal matrix; None if it fails.

    Examples
    --------
    >>> low, high = prove_margins([[Fraction(2), Fraction(0)], [Fraction(0), Fraction(1)]])
    >>> 0.999 < low < 1, 2 < high < 2.001
    (True, True)
    """
    whole, scale = integer_matrix(P)
    rows, identity = integer_rows(whole), np.eye(len(P), dtype=int).tolist()
    size = np.linalg.eigvalsh(np.array(rows, dtype=float))
    lowest = prove_generalized_margin(rows, identity, float(size[0])) if size[0] > 0 else None
    minus_highest = prove_generalized_margin([[-x for x in row] for row in rows], identity, -float(size[-1]))
    if lowest is None or lowest <= 0 or minus_highest is None:
        return None
    return lowest / scale, -minus_highest / scale


# ---------------------------------------------------------------------- constants


def _roots(nodes: Iterable[int], constants: Sequence[Fraction]) -> Scaled:
    """Return square roots, rounded up: integers by node, and what multiplies them."""
    (values,), scale = integers([[root_above(c) for c in constants]])
    return dict(zip(nodes, values, strict=True)), Fraction(1, scale)


def form_with_constants(
    kind: str,
    quotient: Quotient,
    matrix: Matrix,
    rates: Sequence[Fraction],
    multipliers: Sequence[tuple[Fraction, ...]],
    optimal: bool = False,
) -> CommonForm | None:
    """Return a form of proved rates, with its ends, and the constants of inputs and coordinates; None if a proof fails.

    With ``y`` the row ``k`` of ``L_0 C^r`` and ``|z| = sqrt(z' P^-1 z)``, every member has
    ``|(L X)_k| <= (|y| + sum_e radius_e |effect_ek| |h_e|) sqrt(V)``.

    References
    ----------
    docs/theory/families.md, "Inputs".
    """
    n = len(matrix)
    if (ends := prove_ends(matrix)) is None:
        return None
    function = CommonForm(kind, quotient, matrix, tuple(rates), tuple(multipliers), *ends, optimal)
    vectors: dict[tuple[Fraction, ...], int] = {}
    for mode in quotient.modes:
        for row in (*mode.rows, *(part.h for part in mode.parts)):
            vectors.setdefault(tuple(row), len(vectors))
    units = [tuple(Fraction(int(i == j)) for j in range(n)) for i in range(n)]
    for unit in units:
        vectors.setdefault(unit, len(vectors))
    squares = inverse_forms(matrix, list(vectors))
    if squares is None:
        return function
    norms = [root_above(x) for x in squares]
    largest = [Fraction(0)] * len(quotient.basis)
    for mode in quotient.modes:
        sizes = [norms[vectors[tuple(row)]] for row in mode.rows]
        for part in mode.parts:
            for k, sign in part.effect.items():
                sizes[k] += part.radius * abs(sign) * norms[vectors[part.h]]
        largest = [max(pair) for pair in zip(largest, sizes, strict=True)]
    return replace(
        function,
        input_constants=tuple(rounded_up(x * x * MARGIN) for x in largest),
        coordinate_constants=tuple(rounded_up(squares[vectors[unit]] * MARGIN) for unit in units),
    )


def mean_constant(function: CommonForm, q: Mapping[int, Fraction]) -> Fraction | None:
    """Return a constant with ``|q' L X|^2 <= constant V`` for every member; None if ``P > 0`` is not proved.

    ``q`` is by nodes, 0 of others. With ``|z| = sqrt(z' P^-1 z)``,
    ``|q' L X| <= (|q' L_0 C^r| + sum_e radius_e |q' effect_e| |h_e|) sqrt(V)``.

    References
    ----------
    docs/theory/families.md, "Where it ends".

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> from ptcc_certify.lyapunov.common_form_search import undirected_function
    >>> pair = Quotient(Family.from_intervals([("a", "b", 1, 3)], undirected=True))
    >>> mean_constant(undirected_function(pair), {0: Fraction(1), 1: Fraction(1)})
    Fraction(0, 1)
    """
    zero = Fraction(0)
    terms = []
    for mode in function.quotient.modes:
        columns = zip(*mode.rows, strict=True)
        own = [(Fraction(1), [sum((w * c[k] for k, w in q.items() if c[k]), zero) for c in columns])]
        for part in mode.parts:
            if size := abs(sum((q.get(k, zero) * sign for k, sign in part.effect.items()), zero)):
                own.append((part.radius * size, list(part.h)))
        terms.append(own)
    squares = inverse_forms(function.matrix, [vector for own in terms for _, vector in own])
    if squares is None:
        return None
    norms = iter([root_above(y) for y in squares])
    return max(sum((factor * next(norms) for factor, _ in own), zero) for own in terms) ** 2


def weighted_mean(quotient: Quotient, q: Mapping[int, Fraction], constant: Fraction) -> WeightedMean:
    """Return a weighted mean of a leading group, by nodes, with its constant.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> pair = Quotient(Family.from_intervals([("a", "b", -1, -1), ("b", "a", -1, -1)]))
    >>> weighted_mean(pair, {0: Fraction(1, 2), 1: Fraction(-1, 2)}, Fraction(0)).size
    Fraction(1, 1)
    """
    codes = {v: int(quotient.kernel.codes[v]) for v in sorted(q)}
    size = sum((q[v] if code > 0 else -q[v] for v, code in codes.items()), Fraction(0))
    return WeightedMean(abs(codes[min(q)]) - 1, {v: q[v] for v in codes}, size, constant)


def inverse_forms(P: Matrix, vectors: Sequence[Sequence[Fraction]]) -> list[Fraction] | None:
    """Bound ``z' P^-1 z`` from above for every vector ``z``; None if ``P > 0`` is not proved.

    Examples
    --------
    >>> [float(x) for x in inverse_forms([[Fraction(4)]], [[Fraction(3)], [Fraction(0)]])]
    [2.25, 0.0]
    """
    (whole, scale), (rows, unit) = integer_matrix(P), integer_matrix(vectors)
    bounds = arithmetic().above(integer_rows(whole), integer_rows(rows))
    return None if bounds is None else [x * scale / unit**2 for x in bounds]


def rounded_up(x: Fraction) -> Fraction:
    """Return a number of 53 bits or so that is not below ``x``.

    Examples
    --------
    >>> third = Fraction(1, 3)
    >>> rounded_up(third) > third, rounded_up(-third) > -third, rounded_up(Fraction(3))
    (True, True, Fraction(3, 1))
    """
    if not x:
        return x
    unit = Fraction(2) ** (abs(x.numerator).bit_length() - x.denominator.bit_length() - _CONSTANT_BITS)
    return -(-x // unit) * unit
