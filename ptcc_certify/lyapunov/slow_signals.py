"""Upper bounds on the rate that a family has for every signal, whatever the certificate.

``V <= c e^(-b s) V(0)`` for every signal means, for ``A`` of the quotient,

- ``b <= 2 Re lambda`` for every eigenvalue of every member, and of every convex combination of members, which fast
  switching approximates; and so for their mean, the trace over n;
- ``b <= -2 ln rho(Phi) / h`` for every periodic word ``Phi = prod exp(-A_i h_i)``, ``h = sum h_i``, with ``rho`` the
  spectral radius.

They are found in floating point; an eigenvalue is proved by inertia (:mod:`ptcc_certify.lyapunov.rate_upper_bound`), a
word in ball arithmetic.

References
----------
docs/theory/families.md, "Refutations".
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise

import numpy as np

from lmi.dyadic import round_to_bits
from lmi.search_time import checkpoint
from lmi.uncertain_matrix import UncertainMatrix
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.lyapunov.common_forms import CommonForm, Quotient, rounded_up
from ptcc_certify.lyapunov.rate_upper_bound import prove_slow_eigenvalues
from ptcc_certify.theorems.lemmas import Matrix

Vector = tuple[Fraction, ...]
#: Relative amounts by which an eigenvalue is raised, one after the other, until the proof succeeds.
_GAPS = (1e-8, 1e-6, 1e-4, 1e-2)
#: Bits of shares and durations, and of the balls of a word.
_SHARE_BITS, _BALL_BITS = 20, (128, 512)
#: Members improved at random for each mode, members of a mode that are mixed, and candidates that are proved.
_RANDOM, _MIXED, _PROVED = 4, 3, 4
#: Functions that are played against, steps of a play and those that a word may have, letters of a word, step lengths
#: in units of the mean time of an agent.
_PLAYED, _STEPS, _WINDOW, _LETTERS, _STEP = 2, 400, 120, 12, (0.03, 0.2)
#: Durations of a word, in units of the mean time of an agent, and their range.
_DURATIONS, _RANGE = (0.1, 0.3, 1.0, 3.0), (1e-3, 10.0)
#: Condition of eigenvectors up to which they give the exponential of a matrix with ten digits.
_APART = 1e5
#: Gain of a word or mixture over what it is made of, relatively, that is worth naming it.
_WORTH = 1e-4


@dataclass(frozen=True)
class Member:
    """One member of the family.

    Attributes
    ----------
    mode : int
    levels : tuple of Fraction
        Of the uncertain parts of the quotient's mode: sizes are ``w- + level (w+ - w-)``. Of two optional edges of
        opposite signs on one pair of nodes one is on at most.
    """

    mode: int
    levels: Vector


@dataclass(frozen=True)
class SignalRateBound:
    """No rate for every signal exceeds ``value``.

    Attributes
    ----------
    value : Fraction
        Of squared functions.
    kind : {"member", "mixture", "word"}
    members : tuple of Member
    durations : tuple of Fraction
        Of a word, in its order in time; of a mixture the shares, of sum 1.
    form, vectors : rows of Fractions
        The witness of inertia; empty for a word, and where the mean eigenvalue is the bound.
    """

    value: Fraction
    kind: str
    members: tuple[Member, ...]
    durations: Vector
    form: Sequence[Sequence[Fraction]] = field(default=(), repr=False)
    vectors: tuple[Vector, ...] = field(default=(), repr=False)


@dataclass(frozen=True)
class Candidate:
    """A bound as floating point has it.

    Attributes
    ----------
    value : float
    kind : {"member", "mixture", "word"}
    members : tuple of Member
    durations : tuple of float
    """

    value: float
    kind: str
    members: tuple[Member, ...]
    durations: tuple[float, ...] = (1.0,)


def prove_signal_rate_bound(
    quotient: Quotient, functions: Sequence[CommonForm] = (), seed: int = 0
) -> SignalRateBound | None:
    """Find and prove an upper bound on the rate for every signal; None if none is proved, or above 120 rows.

    Parameters
    ----------
    quotient : Quotient
    functions : sequence of CommonForm
        Lyapunov functions, against which signals are played: at every instant the member by which one falls least.
    seed : int
        Of the members that are drawn at random.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> day = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    >>> night = SignedDigraph.from_edges([("c", "a", -2), ("a", "b", 1)])
    >>> bound = prove_signal_rate_bound(Quotient(Family.switching([day, night])))
    >>> bound.kind, round(float(bound.value), 2)
    ('word', 1.41)
    """
    if not 0 < len(quotient.nodes) <= EXACT_NODES:
        return None
    candidates = rate_bounds(quotient, functions, seed)
    proved: list[SignalRateBound] = []
    single = next(c for c in candidates if c.kind != "word")  # what floats say of words may be wrong, of others hardly
    for candidate in dict.fromkeys([*candidates[:_PROVED], single]):
        checkpoint()
        if proved and candidate.value >= min(proved, key=lambda b: b.value).value:
            continue
        if (bound := prove_candidate(quotient, candidate)) is not None:
            proved.append(bound)
    return min(proved, key=lambda bound: bound.value, default=None)


def rate_bounds(quotient: Quotient, functions: Sequence[CommonForm] = (), seed: int = 0) -> list[Candidate]:
    """Return upper bounds as floating point has them, the least first: of members, mixtures and words."""
    search = _BoundSearch(quotient, np.random.default_rng(seed))
    members = [m for number in range(len(quotient.modes)) for m in search.members(number)]
    bounds = list(map(search.of_one_sign, [*members, *search.mixtures(members)]))
    best = min(c.value for c in bounds)
    forms = [np.array([[float(x / V.highest) for x in row] for row in V.matrix]) for V in functions[:_PLAYED]]
    words = [*search.words(members), *(word for P in forms for word in search.played_words(P))]
    bounds += (word for word in words if word.value < best - _WORTH * abs(best))
    return sorted(bounds, key=lambda c: (c.value, len(c.members)))


def rival_parts(quotient: Quotient, number: int) -> list[tuple[int, int]]:
    """Return pairs of parts of a mode with opposite signs on one pair of nodes, of which members have one on."""
    mode = quotient.family.modes[number]
    first: dict[tuple[int, int], int] = {}
    pairs = []
    for place, part in enumerate(quotient.modes[number].parts):
        ends = (int(mode.source[part.edge]), int(mode.target[part.edge]))
        if ends in first:
            pairs.append((first[ends], place))
        first[ends] = place
    return pairs


@dataclass(eq=False)
class _BoundSearch:
    quotient: Quotient
    rng: np.random.Generator

    @cached_property
    def arrays(self) -> list[UncertainMatrix]:
        return [mode.array for mode in self.quotient.modes]

    @cached_property
    def rivals(self) -> list[list[tuple[int, int]]]:
        return [rival_parts(self.quotient, number) for number in range(len(self.quotient.modes))]

    def pieces(self, member: Member) -> Iterator[tuple[Member, Fraction]]:
        """Yield members of which levels are the mean, with their shares; each has one sign of a pair on at most.

        Levels of two rivals are the shares of the time in which each is on; their sum is 1 at most.
        """
        levels = member.levels
        pairs = [(one, other) for one, other in self.rivals[member.mode] if levels[one] and levels[other]]
        ends = (end for one, other in pairs for end in (levels[one], levels[one] + levels[other]))
        for begin, end in pairwise(sorted({Fraction(0), Fraction(1), *ends})):
            own = list(levels)
            for one, other in pairs:
                own[one] = Fraction(end <= levels[one])
                own[other] = Fraction(levels[one] <= begin and end <= levels[one] + levels[other])
            yield Member(member.mode, tuple(own)), end - begin

    def of_one_sign(self, candidate: Candidate) -> Candidate:
        """Return the same bound of members in which no pair has both signs on: a mixture, if there are several."""
        shares: dict[Member, float] = {}
        for member, share in zip(candidate.members, candidate.durations, strict=True):
            for piece, part in self.pieces(member):
                shares[piece] = shares.get(piece, 0.0) + share * float(part)
        if len(shares) == 1:
            return candidate
        return Candidate(candidate.value, "mixture", tuple(shares), tuple(shares.values()))

    def matrix(self, member: Member) -> np.ndarray:
        array = self.arrays[member.mode]
        delta = 2 * np.array([float(x) for x in member.levels]) - 1
        return array.A + (array.F * (array.radii * delta)) @ array.H.T

    def members(self, mode: int) -> list[Candidate]:
        """Return members of a mode with slow eigenvalues, the slowest first."""
        q = len(self.arrays[mode].radii)
        starts = [np.zeros(q), np.ones(q), np.full(q, 0.5), *self.rng.random((_RANDOM, q)).round()]
        found: dict[Member, float] = {}
        for levels in starts if q else starts[:1]:
            member, value = self._improved(mode, levels)
            found[member] = value
            checkpoint()
        pairs = sorted(found.items(), key=lambda pair: pair[1])[:_MIXED]
        return [Candidate(value, "member", (member,)) for member, value in pairs]

    def _member(self, mode: int, levels: np.ndarray) -> Member:
        levels = levels.copy()
        for one, other in self.rivals[mode]:
            if levels[one] + levels[other] > 1:
                levels[other] = 1 - levels[one]
        return Member(mode, tuple(Fraction(float(x)) for x in levels))

    def _improved(self, mode: int, levels: np.ndarray) -> tuple[Member, float]:
        """Set all levels by the sign of the derivative of the slowest eigenvalue; then one by one."""
        member = self._member(mode, levels)
        best, slope = self._slowest(member)
        for _ in range(8):
            other = self._member(mode, np.where(slope < 0, 1.0, np.where(slope > 0, 0.0, levels)))
            value, other_slope = self._slowest(other)
            if not value < best:
                break
            member, best, slope = other, value, other_slope
        for e in np.argsort(-np.abs(slope))[: 2 * _MIXED]:
            levels = np.array([float(x) for x in member.levels])
            for level in {0.0, 1.0} - {levels[e]}:
                levels[e] = level
                other = self._member(mode, levels)
                value, _ = self._slowest(other)
                if value < best:
                    member, best = other, value
        return member, best

    def _slowest(self, member: Member) -> tuple[float, np.ndarray]:
        """Return twice the least real part and its derivatives by the levels, up to a positive factor."""
        from scipy.linalg import eig

        array, A = self.arrays[member.mode], self.matrix(member)
        values, left, right = eig(A, left=True, right=True)
        k = int(np.argmin(values.real))
        y, x = left[:, k].conj(), right[:, k]
        product = y @ x
        size = abs(product)
        slope = (
            ((y @ array.F) * (x @ array.H) * product.conjugate()).real if size > 1e-12 else np.zeros(len(array.radii))
        )
        return 2 * float(values[k].real), slope

    def mixtures(self, members: Sequence[Candidate]) -> Iterator[Candidate]:
        """Yield convex combinations of members of several modes, each by line searches from one of them."""
        from scipy.optimize import minimize_scalar

        if len(self.arrays) < 2:
            return
        for start in members:
            shares = {start.members[0]: 1.0}
            A, best = self.matrix(start.members[0]), start.value
            for _ in range(2):
                for member in (c.members[0] for c in members):
                    checkpoint()
                    B = self.matrix(member)
                    grid = np.linspace(0.1, 0.9, 9)
                    values = [_slowest_rate((1 - s) * A + s * B) for s in grid]
                    near = float(grid[int(np.argmin(values))])
                    fine = minimize_scalar(
                        lambda s, A=A, B=B: _slowest_rate((1 - s) * A + s * B),
                        bounds=(near - 0.1, near + 0.1),
                        method="bounded",
                        options={"xatol": 1e-4},
                    )
                    if fine.fun < best - _WORTH * abs(best):
                        best, s = float(fine.fun), float(fine.x)
                        shares = {m: (1 - s) * x for m, x in shares.items()}
                        shares[member] = shares.get(member, 0.0) + s
                        A = (1 - s) * A + s * B
            if len(shares) > 1:
                yield Candidate(best, "mixture", tuple(shares), tuple(shares.values()))

    def words(self, members: Sequence[Candidate]) -> Iterator[Candidate]:
        """Yield words of two members, and the best of them with more."""
        from itertools import combinations

        from scipy.linalg import expm

        slowest = (c.members[0] for c in sorted(members, key=lambda c: c.value))
        own = list(dict.fromkeys(piece for member in slowest for piece, _ in self.pieces(member)))[: 2 * _MIXED]
        matrices = [self.matrix(m) for m in own]
        unit = len(matrices[0]) / max(float(np.mean([np.trace(A) for A in matrices])), 1e-300)
        steps = {(i, h): expm(-A * (h * unit)) for i, A in enumerate(matrices) for h in _DURATIONS}
        trials = []
        for i, j in combinations(range(len(own)), 2):
            checkpoint()
            for h in _DURATIONS:
                for g in _DURATIONS:
                    rate = _word_rate(steps[j, g] @ steps[i, h], (h + g) * unit)
                    trials.append((rate, (i, j), (h, g)))
        trials.sort()
        for rate, letters, durations in trials[:2]:
            checkpoint()
            times = tuple(h * unit for h in durations)
            pair = self._tuned(Candidate(rate, "word", tuple(own[i] for i in letters), times))
            yield pair
            for member in own if len(own) > 2 else ():
                checkpoint()
                longer = replace(pair, members=(*pair.members, member), durations=(*pair.durations, 0.3 * unit))
                yield self._tuned(longer)

    def played_words(self, P: np.ndarray) -> Iterator[Candidate]:
        """Yield the worst word at the end of a play against ``x' P x``, with steps of several lengths."""
        from scipy.linalg import expm

        n = len(P)
        unit = n / max(float(np.mean([np.trace(array.A) for array in self.arrays])), 1e-300)
        for step in _STEP:
            x = self.rng.standard_normal(n)
            letters, flows = [], {}
            for _ in range(_STEPS):
                checkpoint()
                member = self._worst(P, x)
                if member not in flows:
                    flows[member] = expm(-self.matrix(member) * (step * unit))
                x = flows[member] @ x
                x /= max(float(np.linalg.norm(x)), 1e-300)
                letters.append(member)
            Phi = np.eye(n)
            best, length = np.inf, 0
            for count, member in enumerate(letters[: -_WINDOW - 1 : -1], 1):
                Phi = Phi @ flows[member]
                if (rate := _word_rate(Phi, count * step * unit)) < best:
                    best, length = rate, count
            word: list[tuple[Member, float]] = []
            for member in letters[len(letters) - length :]:
                if word and word[-1][0] == member:
                    member, duration = word.pop()
                    word.append((member, duration + step * unit))
                else:
                    word.append((member, step * unit))
            if 1 < len(word) <= _LETTERS:
                yield self._tuned(Candidate(best, "word", *(tuple(column) for column in zip(*word, strict=True))))

    def _worst(self, P: np.ndarray, x: np.ndarray) -> Member:
        """Return the member by which ``x' P x`` falls least."""
        gradient = P @ x
        least, worst = np.inf, None
        for mode, array in enumerate(self.arrays):
            slopes = (gradient @ array.F) * (x @ array.H)
            member = self._member(mode, np.where(slopes < 0, 1.0, 0.0))
            if (fall := float(gradient @ self.matrix(member) @ x)) < least:
                least, worst = fall, member
        assert worst is not None
        return worst

    def _tuned(self, word: Candidate) -> Candidate:
        """Improve the durations of a word."""
        from scipy.optimize import minimize

        matrices = [self.matrix(member) for member in word.members]
        flows = [_flow(A) for A in matrices]
        ends = [np.log(factor / np.mean([np.trace(A) for A in matrices]) * len(matrices[0])) for factor in _RANGE]

        def rate_of(logs: np.ndarray) -> float:
            times, Phi = np.exp(np.clip(logs, *ends)), np.eye(len(matrices[0]))
            for flow, h in zip(flows, times, strict=True):
                Phi = flow(h) @ Phi
            return _word_rate(Phi, float(times.sum()))

        options = {"maxfev": 60 + 20 * len(matrices), "xatol": 1e-3}
        found = minimize(rate_of, np.log(word.durations), method="Nelder-Mead", options=options)
        return replace(word, value=float(found.fun), durations=tuple(np.exp(np.clip(found.x, *ends)).tolist()))


def _flow(A: np.ndarray) -> Callable[[float], np.ndarray]:
    """Return ``exp(-A h)`` as a function of ``h``: by eigenvectors, many times as fast, where they are far apart."""
    from scipy.linalg import expm

    sizes, vectors = np.linalg.eig(A)
    if np.linalg.cond(vectors) > _APART:
        return lambda h: expm(-A * h)
    inverse = np.linalg.inv(vectors)
    return lambda h: ((vectors * np.exp(-sizes * h)) @ inverse).real


def _slowest_rate(A: np.ndarray) -> float:
    return 2 * float(np.linalg.eigvals(A).real.min())


def _word_rate(Phi: np.ndarray, duration: float) -> float:
    radius = float(np.abs(np.linalg.eigvals(Phi)).max())
    return -2 * float(np.log(radius)) / duration if radius > 1e-250 else np.inf


# ---------------------------------------------------------------------- proofs


def prove_candidate(quotient: Quotient, candidate: Candidate) -> SignalRateBound | None:
    """Round shares or durations, and prove the bound; None if it fails."""
    matrices = [quotient.modes[m.mode].member(m.levels) for m in candidate.members]
    durations = [round_to_bits(h, _SHARE_BITS) for h in candidate.durations]
    if candidate.kind == "word":
        value = prove_word(matrices, durations)
        return None if value is None else SignalRateBound(value, "word", candidate.members, tuple(durations))
    shares = [h / sum(durations) for h in durations]
    A, n = _mixture(matrices, shares), len(matrices[0])
    mean = SignalRateBound(
        2 * sum((A[i][i] for i in range(n)), Fraction(0)) / n, candidate.kind, candidate.members, tuple(shares)
    )
    c = candidate.value / 2
    if mean.value <= 2 * Fraction(c) + 2 * Fraction(abs(c)) * Fraction(_GAPS[0]):
        return mean
    unit = max(abs(c), 1e-9 * max(float(abs(x)) for row in A for x in row))
    with np.errstate(all="ignore"):
        for gap in _GAPS:
            bound = round_to_bits(c + gap * unit, 53)
            if 2 * bound < mean.value and (witness := prove_slow_eigenvalues(A, bound)) is not None:
                return SignalRateBound(2 * bound, candidate.kind, candidate.members, tuple(shares), *witness)
    return mean


def prove_again(
    quotient: Quotient, kind: str, members: tuple[Member, ...], durations: Vector, value: Fraction
) -> SignalRateBound | None:
    """Prove the bound that given members make, with ``value`` as the aim; None if it fails.

    None also where one of them has both signs of a pair of nodes on: the family has no such member.

    Examples
    --------
    >>> quotient = Quotient(Family.from_intervals([("a", "b", 1, 2)]))
    >>> prove_again(quotient, "member", (Member(0, (Fraction(1),)),), (Fraction(1),), Fraction(4)).value
    Fraction(4, 1)
    """
    if not 0 < len(quotient.nodes) <= EXACT_NODES:
        return None
    if any(m.levels[one] and m.levels[other] for m in members for one, other in rival_parts(quotient, m.mode)):
        return None
    matrices = [quotient.modes[m.mode].member(m.levels) for m in members]
    if kind == "word":
        rate = prove_word(matrices, durations)
        return None if rate is None else SignalRateBound(rate, kind, members, durations)
    A = _mixture(matrices, durations)
    mean = 2 * sum((A[i][i] for i in range(len(A))), Fraction(0)) / len(A)
    if mean <= value:
        return SignalRateBound(mean, kind, members, durations)
    witness = prove_slow_eigenvalues(A, value / 2)
    return None if witness is None else SignalRateBound(value, kind, members, durations, *witness)


def _mixture(matrices: Sequence[Matrix], shares: Sequence[Fraction]) -> Matrix:
    n = len(matrices[0])
    return [
        [sum((s * M[i][j] for s, M in zip(shares, matrices, strict=True)), Fraction(0)) for j in range(n)]
        for i in range(n)
    ]


def prove_word(matrices: Sequence[Matrix], durations: Sequence[Fraction]) -> Fraction | None:
    """Return ``-2 ln rho(Phi) / h``, rounded up, in ball arithmetic; None where balls grow too large.

    Parameters
    ----------
    matrices : sequence of (n, n) Matrix
        The first acts first.
    durations : sequence of Fraction
        Positive.

    Examples
    --------
    >>> A = [[Fraction(1)]]
    >>> 2 <= prove_word([A, A], [Fraction(1), Fraction(2)]) < 2 + 1e-9
    True
    """
    import flint

    bits = flint.ctx.prec
    try:
        for precision in _BALL_BITS:
            flint.ctx.prec = precision
            with contextlib.suppress(ValueError, ZeroDivisionError):
                Phi = None
                for A, h in zip(matrices, durations, strict=True):
                    entries = [flint.arb(flint.fmpq(-(x * h).numerator, (x * h).denominator)) for row in A for x in row]
                    step = flint.arb_mat(len(A), len(A), entries).exp()
                    Phi = step if Phi is None else step * Phi
                sizes = [value.abs_lower() for value in flint.acb_mat(Phi).eig(multiple=True)]
                radius = max(sizes, key=float)
                total = sum(durations, Fraction(0))
                rate = -2 * radius.log() / flint.arb(flint.fmpq(total.numerator, total.denominator))
                mantissa, exponent = rate.upper().man_exp()
                return rounded_up(Fraction(int(mantissa)) * Fraction(2) ** int(exponent))
    finally:
        flint.ctx.prec = bits
    return None
