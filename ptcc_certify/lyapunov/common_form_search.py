"""The search for Lyapunov functions of families, and their proof.

A search proposes a matrix ``P`` and multipliers in floats; they are rounded to short dyadic numbers, and the rate of
each mode is lowered until the kernel accepts one definite integer matrix of size n + q for it. Nothing enumerates the
``2^q`` vertices of a box.

Families whose members share a positive left null vector: the distance to the states at rest, in closed form.

Let ``p > 0`` and ``p' M(L) = 0`` for every member, ``M(L)`` with ``-|w|`` off the diagonal: known weights that share
``p``, and uncertain undirected edges between nodes of equal ``p`` (``p = 1`` for undirected graphs). Then

    x'(diag(p) L + L' diag(p)) x = sum_kl p_k |w_kl| (x_k - sgn(w_kl) x_l)^2

grows with every weight: ``w-`` is the worst case, whatever the signal. The weighted distance to ``K`` decays at the
rate ``b`` if ``S - b P > 0`` over the nodes that are no pivots, ``S`` the matrix above at ``w-`` and
``P = diag(p) - diag(p) B (B' diag(p) B)^-1 B' diag(p)``: ``B' diag(p) X`` is constant. Where ``diag(p) L(w-)`` is
symmetric in the slowest mode, no rate of any kind is larger.

Forms for one initial state and a few instants: what is proved of deviations and inputs there is made small.

A form of rate ``r`` bounds ``|y'xi|`` at the clock ``s`` by ``|y|_* sqrt(V(0)) e^(-r s / 2)``, ``|y|_*^2 = y'P^-1 y``.
Among all forms of a rate that is a little below the largest, those of least ``V(0)`` are taken that have ``|y|_* <= 1``
for the coordinates, and for the rows of inputs.

References
----------
docs/theory/families.md, "Common quadratic functions", "Uncertain weights" and "Undirected graphs".
docs/theory/families.md, "Undirected graphs".
docs/theory/families.md, "Common quadratic functions".
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

import numpy as np

from lmi.common_closed_form import closed_form_lyapunov
from lmi.common_lyapunov import CommonCertificate, best_multipliers, common_lyapunov, least_condition, least_value
from lmi.dyadic import round_to_bits
from lmi.errors import NoCertificate
from lmi.search_time import checkpoint, part_of_time, share_of_time
from ptcc_certify.checker.matrix_products import LARGEST_ROWS, WITH_MULTIPLIERS
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.lyapunov.common_forms import CommonForm, Quotient, form_with_constants, prove_margin_about, prove_mode
from ptcc_certify.lyapunov.error_system import rounded_matrix
from ptcc_certify.lyapunov.search_failures import failures_told
from ptcc_certify.theorems.lemmas import Matrix, solve_exact

Vector = tuple[Fraction, ...]


def undirected_function(quotient: Quotient) -> CommonForm | None:
    """Return the function of the module, proved; None if no common left vector is found.

    Nor is one tried above 120 nodes, or where nothing moves.

    Examples
    --------
    >>> path = Family.from_intervals([("a", "b", 1, 10), ("b", "c", 1, 10)], undirected=True)
    >>> V = undirected_function(Quotient(path))
    >>> round(float(V.rate), 6), V.optimal
    (2.0, True)
    """
    family = quotient.family
    p = common_left_vector(family)
    if p is None:
        return None
    P = _distance(quotient, p)
    rates, symmetric = [], []
    for mode, own in zip(family.modes, quotient.modes, strict=True):
        checkpoint()
        L = mode.mandatory.exact_laplacian()
        S = [[p[i] * L[i][j] + p[j] * L[j][i] for j in quotient.nodes] for i in quotient.nodes]
        rate = Fraction(0) if own.at_rest else prove_margin_about(S, P, _least_eigenvalue(S, P), own.largest_entry)
        if rate is None:
            return None
        rates.append(rate)
        nodes = range(family.n_nodes)
        symmetric.append(all(p[i] * L[i][j] == p[j] * L[j][i] for i in nodes for j in nodes if i < j))
    moving = [i for i, own in enumerate(quotient.modes) if not own.at_rest]
    if not moving:
        return None
    optimal = symmetric[min(moving, key=lambda i: rates[i])]
    return form_with_constants("undirected", quotient, P, rates, ((),) * len(rates), optimal)


def common_left_vector(family: Family) -> Vector | None:
    """Return ``p > 0`` with ``p' M(L) = 0`` for every member, exact; None if none is found or nodes are too many.

    It is all ones, or the one left null vector of the sum of all mandatory graphs.

    Examples
    --------
    >>> common_left_vector(Family.from_graph(SignedDigraph.from_edges([(1, 2, -3), (2, 1, 1)])))
    (Fraction(3, 4), Fraction(1, 4))
    """
    n = family.n_nodes
    if any(mode.parameters.size and not mode.tied for mode in family.modes) or n > EXACT_NODES:
        return None
    comparisons, zero = [_comparison(mode) for mode in family.modes], Fraction(0)
    ones = (Fraction(1),) * n
    if _shared(family, comparisons, ones):
        return ones
    total = [[sum((M[i][j] for M in comparisons), zero) for j in range(n)] for i in range(n)]
    system = [[total[j][i] for j in range(n)] for i in range(n - 1)] + [list(ones)]
    solution = solve_exact(system, [[zero]] * (n - 1) + [[Fraction(1)]])
    if solution is None or any(row[0] <= 0 for row in solution):
        return None
    p = tuple(row[0] for row in solution)
    return p if _shared(family, comparisons, p) else None


def _comparison(mode: Mode) -> Matrix:
    L = mode.mandatory.exact_laplacian()
    return [[x if i == j else -abs(x) for j, x in enumerate(row)] for i, row in enumerate(L)]


def _shared(family: Family, comparisons: list[Matrix], p: Vector) -> bool:
    for mode, M in zip(family.modes, comparisons, strict=True):
        ends = ((int(mode.source[e]), int(mode.target[e])) for e in mode.parameters)
        if any(p[source] != p[target] for source, target in ends):
            return False
        if any(sum(map(Fraction.__mul__, p, column), Fraction(0)) for column in zip(*M, strict=True)):
            return False
    return True


def _distance(quotient: Quotient, p: Vector) -> Matrix:
    """Return ``P`` of the module over the nodes that are no pivots."""
    nodes, d = quotient.nodes, len(quotient.pivots)
    P = [[p[v] if v == u else Fraction(0) for u in nodes] for v in nodes]
    if not d:
        return P
    B, zero = quotient.basis, Fraction(0)
    gram = [[sum((w * b[i] * b[j] for w, b in zip(p, B, strict=True)), zero) for j in range(d)] for i in range(d)]
    part = solve_exact(gram, [[p[v] * B[v][j] for v in nodes] for j in range(d)])
    assert part is not None, "B has full rank"
    for row, v in zip(P, nodes, strict=True):
        for j in range(d):
            if scale := p[v] * B[v][j]:
                row[:] = [x - scale * y for x, y in zip(row, part[j], strict=True)]
    return P


def _least_eigenvalue(S: Matrix, P: Matrix) -> float:
    from scipy.linalg import eigh

    arrays = (np.array([[float(x) for x in row] for row in M]) for M in (S, P))
    return float(eigh(*arrays, eigvals_only=True, subset_by_index=[0, 0])[0])


#: Classes of functions.
KINDS = ("undirected", "diagonal", "full")
#: Rows up to which a full matrix, and a diagonal one, is searched, and a full one taken from Lyapunov equations.
FULL_ROWS, DIAGONAL_ROWS, CLOSED_ROWS = 24, EXACT_NODES, LARGEST_ROWS
#: What is told where the check would refuse a proof, between the rows that it takes and those that there may be.
TOO_MANY_ROWS = "agents and uncertain edges in one mode are above the rows of a proof"
#: Share of the time of the search for the diagonal matrix, which comes before the full one.
_DIAGONAL_SHARE = 0.3
#: Share of the time of a class for the climb to the largest rate.
_CLIMB_SHARE = 0.7
#: Losses of the rate for which a smaller overshoot constant is looked for, unless it is as good as this; and by what
#: factor it has to be smaller.
_LOSSES, _GOOD_CONDITION, _WORTH = (1e-3, 0.03, 0.2), 4.0, 0.7
_MATRIX_BITS, _MULTIPLIER_BITS = 60, 40


@dataclass(frozen=True)
class CommonFormSearch:
    """What the searches gave.

    Attributes
    ----------
    functions : tuple of CommonForm
        Proved; the largest rate first, that of the slowest mode in which something moves.
    notes : tuple of str
        What failed, and why.
    cut_off : tuple of str
        What the time limit cut short.
    """

    functions: tuple[CommonForm, ...] = ()
    notes: tuple[str, ...] = ()
    cut_off: tuple[str, ...] = ()


def search_common_forms(
    quotient: Quotient,
    kinds: Sequence[str] = KINDS,
    enough: Fraction | None = None,
    shares: Sequence[float] | None = None,
    slower: bool = True,
) -> CommonFormSearch:
    """Search and prove Lyapunov functions of a family for every signal.

    Parameters
    ----------
    quotient : Quotient
        :meth:`Quotient.of` a component whose behaviour is decided; or of a family some of whose modes have more states
        at rest, which then have rates of 0 or below.
    kinds : sequence of {"undirected", "diagonal", "full"}
        What to search. ``undirected`` costs one eigenvalue and where it is optimal ends the search.
    enough : Fraction, optional
        A rate that ends the search, such as 0.99 of a proved upper bound.
    shares : sequence of float, optional
        Of the clock that each mode is active: the mean of the rates is made large instead of the least one, for
        families with modes in which not everything decays.
    slower : bool
        Whether slower functions of much smaller overshoot constants are searched besides.

    Returns
    -------
    CommonFormSearch
        Without functions if everything is at rest in every member.

    References
    ----------
    docs/theory/families.md, "Common quadratic functions".

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> day = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    >>> night = SignedDigraph.from_edges([("c", "a", -2), ("a", "b", 1)])
    >>> best = search_common_forms(Quotient.of(decide(Family.switching([day, night]))[0])).functions[0]
    >>> round(float(best.rate), 2), len(best.rates), float(best.rates[1]) >= float(best.rate)
    (0.96, 2, True)
    """
    n = len(quotient.nodes)
    if n > CLOSED_ROWS:
        return CommonFormSearch(notes=(f"{n} agents are above the {CLOSED_ROWS} of the searches",))
    if not n or all(mode.at_rest for mode in quotient.modes):
        return CommonFormSearch()
    functions: list[CommonForm] = []
    notes: list[str] = []
    cut_off: list[str] = []
    if "undirected" in kinds:
        with share_of_time(1.0, "undirected", cut_off):
            functions += filter(None, [undirected_function(quotient)])
    if shares is None and any(V.optimal for V in functions):
        return CommonFormSearch(tuple(functions), tuple(notes), tuple(cut_off))
    most = max(mode.proof_rows for mode in quotient.modes)
    if most > WITH_MULTIPLIERS:
        return CommonFormSearch(
            tuple(functions), (f"{most:,} {TOO_MANY_ROWS}, {WITH_MULTIPLIERS} at most",), tuple(cut_off)
        )
    closed = _closed_function(quotient, cut_off) if "full" in kinds and shares is None else None
    share = _DIAGONAL_SHARE if "full" in kinds and n <= FULL_ROWS else 1.0  # else nothing comes after the diagonal one
    for kind, rows, own in (("diagonal", DIAGONAL_ROWS, share), ("full", FULL_ROWS, 1.0)):
        if n == 1 and kind == "full" and functions:
            continue  # the same
        if kind not in kinds or (enough is not None and any(_worth(quotient, V, shares) >= enough for V in functions)):
            continue
        if n > rows:
            if closed is None:
                notes.append(f"class {kind} is searched up to {rows} rows; these are {n}")
            continue
        with share_of_time(own, f"class {kind}", cut_off), failures_told(notes, kind):
            losses = _LOSSES if slower else ()
            for function in _common_functions(quotient, kind, notes, shares, losses):  # kept, whatever comes after
                functions.append(function)
    if closed is not None and not any(_worth(quotient, V, shares) >= closed.rate for V in functions):
        functions.append(closed)
    functions.sort(key=lambda V: (-_worth(quotient, V, shares), V.overshoot))
    return CommonFormSearch(tuple(functions), tuple(notes), tuple(cut_off))


def _closed_function(quotient: Quotient, cut_off: list[str]) -> CommonForm | None:
    """Return a full matrix that Lyapunov equations give; None if its rate is not positive.

    It takes little time, and so comes first: what is searched for longer may be cut off.
    """
    moving = [number for number, mode in enumerate(quotient.modes) if not mode.at_rest]
    with share_of_time(1.0, "Lyapunov equations", cut_off), contextlib.suppress(NoCertificate, np.linalg.LinAlgError):
        certificate = closed_form_lyapunov([quotient.modes[number].array for number in moving])
        if certificate.rate > 0:
            return prove_certificate(quotient, "full", certificate, moving)
    return None


def _worth(quotient: Quotient, V: CommonForm, shares: Sequence[float] | None) -> Fraction:
    """Return the mean of the rates over the shares, or the least rate of the modes in which something moves."""
    if shares is not None:
        return sum((Fraction(s) * rate for s, rate in zip(shares, V.rates, strict=True)), Fraction(0)) / Fraction(
            sum(shares)
        )
    return min(rate for rate, mode in zip(V.rates, quotient.modes, strict=True) if not mode.at_rest)


def _common_functions(
    quotient: Quotient, kind: str, notes: list[str], shares: Sequence[float] | None, losses: Sequence[float]
) -> Iterator[CommonForm]:
    """Yield the function of the largest rate, then slower ones whose overshoot constants are much smaller."""
    moving = [number for number, mode in enumerate(quotient.modes) if not mode.at_rest]
    arrays = [quotient.modes[number].array for number in moving]
    with np.errstate(all="ignore"):
        own = None if shares is None else [shares[number] for number in moving]
        with part_of_time(_CLIMB_SHARE):  # what it has by then is proved in the rest
            best = common_lyapunov(arrays, shape=kind, shares=own)
        goal = [best.rate] * len(arrays) if shares is None else best.rates
        condition, top = math.inf, max(goal)
        for loss in (0.0, *losses):
            if condition <= _GOOD_CONDITION or (loss and not top > 0):
                return
            certificate: CommonCertificate | None = None if loss else best
            if loss:
                wanted = [rate - loss * top for rate in goal]
                with failures_told(notes, kind):  # a smaller rate is easier
                    certificate = least_condition(arrays, wanted, shape=kind)
            if certificate is None or not certificate.condition < _WORTH * condition:
                continue
            certificate = best_multipliers(certificate, arrays)
            function = prove_certificate(quotient, kind, certificate, moving)
            if function is None:
                notes.append(f"class {kind}: the rate {certificate.rate:.6g} is not proved")
            else:
                condition = certificate.condition
                yield function


def prove_certificate(
    quotient: Quotient, kind: str, certificate: CommonCertificate, moving: Sequence[int]
) -> CommonForm | None:
    """Round a matrix and multipliers of the modes ``moving``, and prove their rates; None if a step fails."""
    P, top = certificate.matrix, float(np.abs(certificate.matrix).max())
    matrix = rounded_matrix(np.diag(np.diag(P)) if kind == "diagonal" else P, _MATRIX_BITS)
    unit = Fraction(2) ** (_MATRIX_BITS - math.ceil(math.log2(top)))
    rates: list[Fraction] = [Fraction(0)] * len(quotient.modes)
    multipliers: list[tuple[Fraction, ...]] = [()] * len(quotient.modes)
    for number, tau, guess in zip(moving, certificate.multipliers, certificate.rates, strict=True):
        checkpoint()
        multipliers[number] = tuple(unit * round_to_bits(float(t), _MULTIPLIER_BITS) for t in tau)
        rate = prove_mode(quotient.modes[number], matrix, multipliers[number], guess)
        if rate is None:
            return None
        rates[number] = rate
    return form_with_constants(kind, quotient, matrix, rates, multipliers)


#: By what factor a form must improve a bound at some instant.
_BETTER = 1.1
#: What of the identity is added to a sum of squares of rows, against its trace.
_REST = 1e-6


@dataclass(frozen=True, eq=False)
class Aim:
    """Where bounds should be small.

    Attributes
    ----------
    begin : (n,) array
        The initial state in quotient coordinates, up to a factor; not 0.
    clocks : (M,) array
        Instants of the stretched clock.
    """

    begin: np.ndarray
    clocks: np.ndarray


def aimed_functions(
    quotient: Quotient, aim: Aim, known: Sequence[CommonForm], notes: list[str]
) -> Iterator[CommonForm]:
    """Yield proved functions, each of which improves a bound of an aim over those before it.

    Parameters
    ----------
    quotient : Quotient
        Of 2 to 24 rows.
    aim : Aim
    known : sequence of CommonForm
        Functions at hand; nothing is yielded without one that decays.
    notes : list of str
        Is told what failed.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> from ptcc_certify.lyapunov.common_form_search import search_common_forms
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> chain = Family.from_intervals([("a", "b", 1, 2), ("b", "c", 1, 2)])
    >>> quotient = Quotient.of(decide(chain)[0])
    >>> known, aim = search_common_forms(quotient, slower=False).functions, Aim(np.array([1.0, 0.0]), np.array([2.0]))
    >>> [V.kind for V in aimed_functions(quotient, aim, known, [])]
    ['full', 'full']
    """
    top = max((float(V.rate) for V in known), default=0.0)
    if top <= 0:
        return
    numbers = [number for number, mode in enumerate(quotient.modes) if not mode.at_rest]
    modes = [quotient.modes[number] for number in numbers]
    rows = np.array([[float(x) for x in row] for mode in modes for row in mode.rows if any(row)])
    rows /= np.abs(rows).max()
    best = np.min([_log_bounds(np.array(V.matrix, dtype=float), float(V.rate), aim, rows) for V in known], axis=0)
    units = np.eye(len(aim.begin))
    squares = rows.T @ rows
    floors = (units, squares + _REST * np.trace(squares) * units)
    arrays = [mode.array for mode in modes]
    for rate, floor in product((top * (1 - loss) for loss in _LOSSES), floors):
        form = None
        with failures_told(notes, "full"):  # a smaller rate is easier
            form = least_value(arrays, [rate] * len(arrays), aim.begin, floor)
        if form is None:
            continue
        bounds = _log_bounds(form.matrix, form.rate, aim, rows)
        if (bounds < best - math.log(_BETTER)).any():
            function = prove_certificate(quotient, "full", form, numbers)
            if function is None:
                notes.append(f"class full: the rate {form.rate:.6g} is not proved")
            else:
                best = np.minimum(best, bounds)
                yield function


def _log_bounds(P: np.ndarray, rate: float, aim: Aim, rows: np.ndarray) -> np.ndarray:
    """Return logarithms of the bounds of the largest coordinate and row, up to a factor, at the instants, (2, M)."""
    inverse = np.linalg.inv(P)
    sizes = inverse.diagonal().max(), np.einsum("ki,ij,kj->k", rows, inverse, rows).max()
    value = float(aim.begin @ P @ aim.begin)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((np.log(np.array(sizes)[:, None] * value) - rate * aim.clocks) / 2)
