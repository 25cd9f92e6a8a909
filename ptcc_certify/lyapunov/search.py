"""Lyapunov functions beyond the paper's: searched in several classes, chosen for the bound over time, proved.

All are quadratic in the error: ``V = E' P E`` with ``V <= e^(-b s) V(0)``, hence
``||E||^2 <= overshoot e^(-b s) ||E(0)||^2``. The classes:

* ``perron``: diagonal, from the Perron vectors of leaders and followers, in closed form;
* ``lmi``: the best diagonal matrix, searched by semidefinite programs;
* ``full``: not diagonal, from Lyapunov equations on invariant subspaces; its rates come as near as wanted to the
  spectral rate, which nothing exceeds.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial

import numpy as np

import lmi
import lmi.full
from lmi.child_process import apart
from lmi.matrix_classes import block_columns
from lmi.search_time import checkpoint, part_of_time, share_of_time
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.common_forms import prove_margins
from ptcc_certify.lyapunov.dominance import dominant_functions
from ptcc_certify.lyapunov.error_system import ErrorSystem, rounded_diagonal, rounded_matrix
from ptcc_certify.lyapunov.function import LyapunovBlock, LyapunovFunction
from ptcc_certify.lyapunov.search_failures import failures_told
from ptcc_certify.model.asks import METHODS
from ptcc_certify.theorems.lemmas import BITS, diagonal_matrix, laplacian_spectrum, left_vector

DIAGONAL = ("perron", "lmi")
#: Largest leader group of a large graph whose best diagonal matrix is searched, and where that is asked for.
SEARCHED_GROUP = (300, 2000)
#: The share of the time left that the searches may take together.
SEARCHING = 0.6
#: Above so many nodes a search runs in a process of its own, which a time limit ends whatever it is at.
APART_NODES = 40
#: The Lyapunov function with the largest rate is chosen among those with at most this overshoot constant.
LARGEST_OVERSHOOT = 1e6
#: Relative losses of rate at which blocks are coupled: a smaller loss costs a larger overshoot constant.
_COUPLING_LOSSES = (1e-5, 1e-3, 1e-2, 0.05, 0.15, 0.3, 0.5)
#: Wanted losses of full matrices where the bound is optimised at one instant.
_FINE_LOSSES = tuple(np.concatenate([np.geomspace(1e-5, 0.05, 20), np.linspace(0.07, 0.95, 20)]))
#: A bound is useful where it leaves this share of the error. One more candidate is used for that, if all others need
#: so many times more of the clock: it costs a proof, and tells which gains make a bound useful.
USEFUL, _LATE = 0.01, 1.5
#: Rates that differ by less, relatively, are the same.
_SAME_RATE = 1e-6
#: The largest entry of deviations at random, over their mean size: bounds above this say nothing.
LARGEST_ENTRY = 2.0
#: By what factor one more Lyapunov function must improve the bound of deviations at some instant.
WORTH_A_FUNCTION = 1.25
#: Beyond this overshoot constant a diagonal matrix is of no use to anybody.
_HOPELESS = 1e15
_MATRIX_BITS = 60


@dataclass(frozen=True, eq=False)
class Candidate:
    """A Lyapunov matrix in floats: ``log_weights`` (n,) of a diagonal one, or ``matrix`` (n, n).

    No diagonal matrix has a larger rate than ``upper``.
    """

    kind: str
    rate: float
    condition: float
    log_weights: np.ndarray | None = None
    matrix: np.ndarray | None = None
    upper: float = math.inf

    def log_bound(self, clock: float) -> float:
        """Return the logarithm of the bound of ``||E|| / ||E(0)||`` at a value of the clock."""
        return (math.log(self.condition) - self.rate * clock) / 2


@dataclass(frozen=True)
class Search:
    """What was searched, what is used, and how far the diagonal class reaches.

    Attributes
    ----------
    functions : tuple of LyapunovFunction
        Proved.
    searched : dict of str to float
        Largest rate found of each class at any overshoot constant, in floating point.
    diagonal_limit : float or None
        No diagonal matrix has a larger rate, by a dual solution in floating point; None if not computed.
    notes : tuple of str
        What failed.
    cut_off : tuple of str
        What the time limit ended.
    """

    functions: tuple[LyapunovFunction, ...] = ()
    searched: dict[str, float] = field(default_factory=dict, hash=False)
    diagonal_limit: float | None = None
    notes: tuple[str, ...] = ()
    cut_off: tuple[str, ...] = ()


def search_functions(system: ErrorSystem, method: str, clocks: Sequence[float], at: float | None = None) -> Search:
    """Search the classes of a method, choose the Lyapunov functions that bound best, and prove them.

    Parameters
    ----------
    system : ErrorSystem
    method : {"paper", "perron", "lmi", "full", "best"}
        ``paper`` searches nothing; ``best`` everything.
    clocks : sequence of float
        Values of the stretched clock at which the bound should be small; the largest useful rate is searched besides.
    at : float, optional
        One more such value, for which the classes are searched more finely.

    Returns
    -------
    Search
    """
    if method == "paper" or not system.nodes:
        return Search()
    results: dict[str, list[Candidate]] = {}
    notes: list[str] = []
    cut_off: list[str] = []
    clock_values = [*clocks] if at is None else [*clocks, at]
    losses = lmi.full.LOSSES if at is None else _FINE_LOSSES
    # The quickest search first; each takes a share of the time that is left, and leaves some for the proofs.
    searches = {
        "perron": (0.2, lambda: _perron_candidates(system)),
        "full": (0.4, lambda: _full_candidates(system, losses)),
        "lmi": (0.6, lambda: _lmi_candidates(system, method == "lmi" or at is not None)),
    }
    with np.errstate(all="ignore"), part_of_time(SEARCHING):  # the rest is for the proofs
        for kind, (share, search) in searches.items():
            if method not in (kind, "best"):
                continue
            frontier = results[kind] = []
            told = len(notes)
            with share_of_time(share, f"class {kind}", cut_off), failures_told(notes, kind):
                for candidate in apart(search) if len(system.nodes) > APART_NODES else search():
                    frontier.append(candidate)
            if not frontier and f"class {kind}" not in cut_off and len(notes) == told:
                notes.append(f"class {kind}: nothing was found in floating point")
    with np.errstate(all="ignore"):
        every = [c for kind in METHODS for c in results.get(kind, ())]
        largest_rates = {c.kind: max(other.rate for other in results[c.kind]) for c in every}
        candidates = [c for c in every if math.isfinite(c.rate) and c.condition <= _HOPELESS]
        for kind, rate in largest_rates.items():
            if not any(c.rate > 0 for c in candidates if c.kind == kind):
                notes.append(f"class {kind}: the rate {rate:.4g} needs an overshoot constant above {_HOPELESS:.0e}")
        proved: list[LyapunovFunction] = []
        extra: LyapunovFunction | None = None
        with share_of_time(1.0, "proofs of Lyapunov functions", cut_off):
            selection = choose(candidates, clock_values)
            for candidate in selection:
                checkpoint()
                function = prove_function(system, candidate)
                if function is None:
                    notes.append(f"class {candidate.kind}: the rate {candidate.rate:.6g} is not proved")
                else:
                    proved.append(function)
            checkpoint()
            decays = any(V.proved_rate > 0 for V in proved)
            near = _for_deviations(system, candidates, selection, clock_values) if decays else None
            extra = None if near is None else prove_function(system, near)
    limit = min((c.upper for c in every), default=math.inf)
    functions = _without_hair_splitting(sorted(proved, key=lambda m: m.numerical_rate or 0.0))
    if extra is not None:  # the largest rate, and its overshoot constant, stay those of a function that is small in E
        fastest = max(functions, key=lambda m: (m.proved_rate, -m.overshoot))
        if extra.proved_rate < fastest.proved_rate or extra.overshoot >= fastest.overshoot:
            functions.append(replace(extra, rate=min(extra.proved_rate, fastest.proved_rate)))
    least = limit if math.isfinite(limit) else None
    return Search(tuple(functions), largest_rates, least, tuple(notes), tuple(cut_off))


def search_large(structure: Structure, method: str, clocks: Sequence[float]) -> Search:
    """Return diagonal Lyapunov functions of a large graph, to be proved row by row by the check of the certificate.

    Leader groups take the Perron vector (class ``perron``), and those of some hundreds of nodes the best diagonal
    matrix besides (class ``lmi``; asked for by ``method``, those of some thousands).

    Parameters
    ----------
    structure : Structure
    method : {"perron", "lmi", "best"}
    clocks : sequence of float
        See :func:`search_functions`.
    """
    if method not in (*DIAGONAL, "best"):
        n = structure.graph.n_nodes
        note = f"above {EXACT_NODES} nodes only the classes perron and lmi are proved; the graph has {n}"
        return Search(notes=(note,))
    functions: dict[Candidate, LyapunovFunction] = {}
    notes: list[str] = []
    largest_rates: dict[str, float] = {}
    groups = [len(c.nodes) for c in structure.closed_components]
    largest = SEARCHED_GROUP[method == "lmi"]
    searches = {"perron": 0}
    if method != "perron" and any(EXACT_NODES < size <= largest for size in groups):
        searches = {"lmi": largest} if method == "lmi" else {**searches, "lmi": largest}
    elif method == "lmi":
        notes.append(f"class lmi is for leader groups of {EXACT_NODES + 1} to {largest} nodes; class perron instead")
    cut_off: list[str] = []
    for kind, search in searches.items():
        frontier: Sequence[LyapunovFunction] = ()
        with np.errstate(all="ignore"), share_of_time(1.0, f"class {kind}", cut_off), failures_told(notes, kind):
            frontier = list(apart(partial(dominant_functions, structure, search=search)))
        rates = [float(V.proved_rate) for V in frontier]
        functions.update((Candidate(kind, r, float(V.overshoot)), V) for r, V in zip(rates, frontier, strict=True))
        if frontier:
            largest_rates[kind] = max(rates)
    selection = sorted(choose(list(functions), clocks), key=lambda c: c.rate)
    return Search(tuple(functions[c] for c in selection), largest_rates, notes=tuple(notes), cut_off=tuple(cut_off))


def choose(candidates: Sequence[Candidate], clocks: Sequence[float]) -> list[Candidate]:
    """Return the fastest candidate that is useful, the best at each clock value, and the fastest diagonal ones.

    The diagonal ones are that of the largest rate at any overshoot constant, and the fastest useful one.

    Besides, unless one of these is nearly as early, the one that first leaves a hundredth of the error.

    Examples
    --------
    >>> slow, fast = Candidate("perron", 1.0, 1.0), Candidate("full", 2.0, 100.0)
    >>> [c.kind for c in choose([slow, fast], [1.0])]
    ['full', 'perron']
    """
    if not candidates:
        return []
    useful = [c for c in candidates if c.condition <= LARGEST_OVERSHOOT]
    selection = [_fastest(useful) if useful else min(candidates, key=lambda c: c.condition)]
    selection += [min(candidates, key=lambda c, s=s: c.log_bound(s)) for s in clocks]  # type: ignore[misc]
    diagonal = [c for c in candidates if c.kind in DIAGONAL]
    selection += [_fastest(some) for some in (diagonal, [c for c in diagonal if c in useful]) if some]
    if decaying := [c for c in candidates if c.rate > 0]:
        first = min(decaying, key=_useful_from)
        if all(c.rate <= 0 or _useful_from(c) > _LATE * _useful_from(first) for c in selection):
            selection.append(first)
    return list(dict.fromkeys(selection))


def _useful_from(candidate: Candidate) -> float:
    """Return the clock value from which on a decaying candidate leaves the useful share."""
    return (math.log(candidate.condition) - 2 * math.log(USEFUL)) / candidate.rate


def _fastest(candidates: Sequence[Candidate]) -> Candidate:
    """Return the candidate of the largest rate, and of equal ones but for rounding the least overshoot constant."""
    top = max(c.rate for c in candidates)
    return min((c for c in candidates if c.rate >= top - _SAME_RATE * abs(top)), key=lambda c: c.condition)


def _without_hair_splitting(functions: list[LyapunovFunction]) -> list[LyapunovFunction]:
    """Lower rates that are larger by rounding alone to that of the function with the smaller overshoot constant.

    A smaller rate is proved with the larger one. The largest rate then comes with an overshoot constant that is worth
    it.
    """
    result = []
    for function in functions:
        own, slower = function.proved_rate, (V.proved_rate for V in functions if V.overshoot < function.overshoot)
        close = [rate for rate in slower if 0 < rate < own <= rate + Fraction(_SAME_RATE) * rate]
        result.append(replace(function, rate=max(close)) if close else function)
    return result


def prove_function(system: ErrorSystem, candidate: Candidate) -> LyapunovFunction | None:
    """Round a candidate to rationals and prove its rate and overshoot constant exactly; None if a step fails."""
    ends: tuple[Fraction, Fraction] | None = None
    if candidate.log_weights is not None:
        weights = rounded_diagonal(candidate.log_weights, BITS)
        if min(weights) <= 0:
            return None
        P, block = diagonal_matrix(weights), LyapunovBlock("P", system.nodes, weights)
    else:
        assert candidate.matrix is not None
        P = rounded_matrix(candidate.matrix, _MATRIX_BITS)
        block = LyapunovBlock("P", system.nodes, matrix=P)
    rate = system.prove_rate(P, candidate.rate)
    if rate is None:
        return None
    if block.matrix is not None and (ends := prove_margins(P)) is None:
        return None
    return LyapunovFunction(candidate.kind, "E", (block,), rate=rate, ends=ends, numerical_rate=candidate.rate)


# ---------------------------------------------------------------------- deviations


def _for_deviations(
    system: ErrorSystem, candidates: Sequence[Candidate], selection: Sequence[Candidate], clocks: Sequence[float]
) -> Candidate | None:
    """Return, as a matrix in ``E``, what bounds ``d = x - Q x`` best; None if the chosen ones do nearly as well.

    ``d`` obeys the equation of ``E``, ``d' = -gain A d``, and ``E = -A d``: a good Lyapunov matrix ``P`` in ``E`` is
    one for ``d`` too, namely ``A^-T P A^-1`` in ``E``. Judged by the bound of the largest entry of ``d`` at the clock
    values, from entries at random.
    """
    if not any(c.kind == "full" for c in candidates):
        return None
    A, U = system.matrix, np.eye(len(system.nodes)) if system.basis is None else system.basis
    reduced = U.T @ A @ U
    reduced /= np.abs(reduced).max()  # the scale is immaterial
    try:
        inverse = np.linalg.inv(reduced)
    except np.linalg.LinAlgError:
        return None

    def log_bounds(form: np.ndarray, rate: float) -> np.ndarray:
        try:
            largest = np.einsum("ij,ji->i", U, np.linalg.solve(form, U.T)).max() * np.trace(form)
        except np.linalg.LinAlgError:
            return np.full(len(clocks), np.inf)
        return (math.log(largest) - rate * np.array(clocks)) / 2 if largest > 0 else np.full(len(clocks), np.inf)

    def reduce(c: Candidate) -> np.ndarray:
        return U.T @ (c.matrix @ U if c.matrix is not None else np.exp(c.log_weights)[:, None] * U)  # type: ignore[arg-type]

    bounds = [log_bounds(reduced.T @ reduce(c) @ reduced, c.rate) for c in selection]
    bounds.append(np.full(len(clocks), math.log(LARGEST_ENTRY)))
    best, candidate = np.min(bounds, axis=0), None
    least = math.log(WORTH_A_FUNCTION)
    for c in candidates:
        if c.kind == "full":
            gain = best - log_bounds(reduce(c), c.rate)
            if gain.max() > math.log(WORTH_A_FUNCTION) and np.maximum(gain, 0).sum() > least:
                least, candidate = np.maximum(gain, 0).sum(), c
    if candidate is None:
        return None
    P = inverse.T @ reduce(candidate) @ inverse
    sizes = np.linalg.eigvalsh(P)
    low, high = float(sizes[0]), float(sizes[-1])
    if not low > high / _HOPELESS:
        return None
    P = U @ P @ U.T + math.sqrt(low * high) * (np.eye(len(A)) - U @ U.T)
    return Candidate("full", candidate.rate, high / low, matrix=P)


# ---------------------------------------------------------------------- classes


def _perron_candidates(system: ErrorSystem) -> Iterator[Candidate]:
    """Yield Perron vectors of every leader group and of the followers, coupled at several losses."""
    A, basis = system.matrix, system.basis
    log_weights = np.zeros(len(A))
    for rows, component in zip(system.parts, system.leaders, strict=False):
        graph = system.structure.graph.subgraph(component.nodes)
        p = np.log(left_vector(graph))
        log_weights[rows] = p - p.max()
    if len(system.parts) == len(system.leaders):
        yield from _couple_blocks("perron", A, system.parts, log_weights, basis)
        return
    followers = system.parts[-1]
    with contextlib.suppress(lmi.NoCertificate):  # no rate at this condition, and so at none of the smaller ones
        for certificate in lmi.h_matrix_frontier(A[np.ix_(followers, followers)], (None, 1e6, 1e3, 30.0)):
            log_weights[followers] = certificate.log_omega
            yield from _couple_blocks("perron", A, system.parts, log_weights, basis)


def _lmi_candidates(system: ErrorSystem, thorough: bool) -> Iterator[Candidate]:
    """Yield the best diagonal matrix, useful ones, and if ``thorough`` the whole frontier."""
    A, basis = system.matrix, system.basis
    best = lmi.diagonal_lyapunov(A, objective="rate", basis=basis)
    yield replace(_diagonal("lmi", best), upper=best.upper)
    for largest in (LARGEST_OVERSHOOT, _HOPELESS / 1e3):
        if best.log_condition > math.log(largest):
            with contextlib.suppress(lmi.NoCertificate):
                near = lmi.diagonal_lyapunov(
                    A, objective="rate", max_condition=largest, basis=basis, start=best.log_omega
                )
                yield _diagonal("lmi", near)
    if thorough:
        yield from (_diagonal("lmi", function) for function in lmi.rate_frontier(A, basis=basis, best=best))


def _full_candidates(system: ErrorSystem, losses: Sequence[float]) -> Iterator[Candidate]:
    """Yield full matrices on the error's subspace, continued beyond it."""
    A, U = system.matrix, system.basis
    spectral = laplacian_spectrum(system.structure).spectral_rate
    block = A if U is None else U.T @ A @ U
    for function in lmi.full_frontier(block, decay=None if spectral is None else spectral / 2, losses=losses):
        P = function.matrix
        if U is not None:  # beyond the subspace anything between the extremes will do
            P = U @ P @ U.T + np.sqrt(function.condition) * (np.eye(len(A)) - U @ U.T)
        yield Candidate("full", function.rate, function.condition, matrix=P)


def _diagonal(kind: str, certificate: lmi.DiagonalCertificate) -> Candidate:
    return Candidate(kind, certificate.rate, certificate.condition, log_weights=certificate.log_omega)


def _couple_blocks(
    kind: str, A: np.ndarray, parts: Sequence[np.ndarray], log_weights: np.ndarray, basis: np.ndarray | None
) -> Iterator[Candidate]:
    """Yield the blocks coupled at several rates below the slowest of them."""
    bases = [None if basis is None else block_columns(basis, part) for part in parts]
    pairs = zip(parts, bases, strict=True)
    slowest = min(lmi.diagonal_rate(A[np.ix_(part, part)], log_weights[part], own) for part, own in pairs)
    if not slowest > 0:
        raise lmi.NoCertificate(f"the slowest block decays at {slowest:.3g}, which is not positive")
    if len(parts) == 1:
        yield _diagonal(kind, lmi.DiagonalCertificate(log_weights - log_weights.max(), slowest))
        return
    for loss in _COUPLING_LOSSES:
        with contextlib.suppress(lmi.NoCertificate):
            log_omega = lmi.couple_blocks(A, parts, log_weights, slowest * (1 - loss), basis)
            if (rate := lmi.diagonal_rate(A, log_omega, basis)) > 0:
                yield _diagonal(kind, lmi.DiagonalCertificate(log_omega, rate))
