"""One quadratic form for each mode of a family, for signals that switch seldom or never: the search, and the proof.

In mode ``i`` the value ``xi' P_i xi`` decays at the rate ``r_i`` whatever the weights do in their intervals, and
``P_j <= ratio P_i`` bounds what a switch adds.

A form whose mean rate over shares of the clock is large: some modes may be outages, or drive agents apart in it.

References
----------
docs/theory/families.md, "Dwell times".
docs/theory/families.md, "Shares of the clock".
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lmi.common_lyapunov import CommonCertificate, best_multipliers, common_lyapunov, evaluate
from lmi.definiteness_proofs import prove_generalized_margin
from lmi.dyadic import round_to_bits
from lmi.exact.elementary_enclosures import rounded
from lmi.matrix_of_each_mode import SwitchedCertificate, switched_lyapunov
from lmi.search_time import checkpoint
from lmi.uncertain_matrix import UncertainMatrix
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY
from ptcc_certify.lyapunov.common_form_search import search_common_forms
from ptcc_certify.lyapunov.common_forms import CommonForm, Quotient, form_with_constants, prove_ends, prove_mode
from ptcc_certify.lyapunov.error_system import rounded_matrix
from ptcc_certify.lyapunov.search_failures import failures_told
from ptcc_certify.theorems.family_behaviour import FamilyComponent
from ptcc_certify.theorems.lemmas import Matrix

#: Rows up to which forms are searched, of one mode and of all together, and modes.
ROWS, ALL_ROWS, MODES = 24, 96, 12
_MATRIX_BITS, _MULTIPLIER_BITS, _RATIO_BITS = 60, 40, 53


@dataclass(frozen=True, eq=False)
class ModeForms:
    """Forms ``xi' P_i xi``, one of each mode, in the coordinates of the quotient; proved.

    Attributes
    ----------
    matrices : tuple of n rows of n Fraction
        ``P_i``, positive definite.
    rates : tuple of Fraction
        Of each mode with its own matrix, per unit of the stretched clock.
    multipliers : tuple of tuples of Fraction
        As those of :class:`~ptcc_certify.lyapunov.common_forms.CommonForm`.
    ratio : Fraction
        ``P_j <= ratio P_i`` for all modes; at least 1.
    """

    matrices: tuple[Matrix, ...]
    rates: tuple[Fraction, ...]
    multipliers: tuple[tuple[Fraction, ...], ...]
    ratio: Fraction = Fraction(1)

    @property
    def rate(self) -> Fraction:
        """The least of the rates."""
        return min(self.rates)


def within_reach(quotient: Quotient) -> bool:
    """Tell whether forms of each mode are searched in a family of this size."""
    rows, modes = len(quotient.nodes), len(quotient.modes)
    return 0 < rows <= ROWS and modes <= MODES and rows * modes <= ALL_ROWS


def mode_functions(quotient: Quotient, forms: ModeForms) -> list[CommonForm]:
    """Return the form of each mode as a function of this mode alone, with the constants of its inputs.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> day, night = SignedDigraph.from_edges([("a", "b", 3)]), SignedDigraph.from_edges([("a", "b", 1)])
    >>> quotient = Quotient(Family.switching([day, night]))
    >>> [round(float(V.rate), 3) for V in mode_functions(quotient, search_single_forms(quotient))]
    [6.0, 2.0]
    """
    result = []
    parts = zip(quotient.family.modes, forms.matrices, forms.rates, forms.multipliers, strict=True)
    for mode, matrix, rate, multipliers in parts:
        alone = Quotient(Family((mode,)), quotient.kernel)
        V = form_with_constants("full", alone, matrix, (rate,), (multipliers,))
        assert V is not None, "the forms are proved definite"
        result.append(V)
    return result


def search_mode_forms(quotient: Quotient, price: float, known: Sequence[CommonForm] = ()) -> ModeForms | None:
    """Search and prove forms with a large least rate minus ``price ln(ratio)``; None if nothing was proved.

    Parameters
    ----------
    quotient : Quotient
    price : float
        Switches per unit of the stretched clock.
    known : sequence of CommonForm
        What was proved for every signal: where the search begins.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> day = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -4)])
    >>> night = SignedDigraph.from_edges([("b", "a", 1), ("a", "c", -1)])
    >>> quotient = Quotient.of(decide(Family.switching([day, night]))[0])
    >>> seldom, often = (search_mode_forms(quotient, price) for price in (0.01, 100))
    >>> seldom.rate > often.rate, seldom.ratio > often.ratio
    (True, True)
    """
    modes = [mode.array for mode in quotient.modes]
    with np.errstate(all="ignore"), failures_told([], "full"):
        return prove_mode_forms(quotient, switched_lyapunov(modes, price, start=_start(modes, known)))
    return None


def search_single_forms(quotient: Quotient) -> ModeForms | None:
    """Search and prove the form of the largest rate of each mode by itself; the ratio is not proved, and 1.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> day, night = SignedDigraph.from_edges([("a", "b", 3)]), SignedDigraph.from_edges([("b", "a", 1)])
    >>> [round(float(r), 3) for r in search_single_forms(Quotient(Family.switching([day, night]))).rates]
    [6.0, 2.0]
    """
    found = []
    with np.errstate(all="ignore"), failures_told([], "full"):
        found = [best_multipliers(common_lyapunov([mode.array]), [mode.array]) for mode in quotient.modes]
    if not found:
        return None
    certificate = SwitchedCertificate(
        tuple(c.matrix for c in found), tuple(c.rate for c in found), tuple(c.multipliers[0] for c in found), 1.0
    )
    return prove_mode_forms(quotient, certificate, ratios=False)


def _start(modes: Sequence[UncertainMatrix], known: Sequence[CommonForm]) -> CommonCertificate | None:
    """Return the best of the functions that were proved, as the search takes it; None if none has all multipliers."""
    sizes = [mode.radii.size for mode in modes]
    full = [V for V in known if not any(sizes) or [len(tau) for tau in V.multipliers] == sizes]
    if not full:
        return None
    V = max(full, key=lambda V: V.rate)
    P = np.array([[float(x) for x in row] for row in V.matrix])
    top = float(np.linalg.eigvalsh(P)[-1])
    taus = [np.array([float(x) for x in tau]) / top for tau in V.multipliers or [()] * len(modes)]
    with contextlib.suppress(np.linalg.LinAlgError):
        return evaluate(P / top, modes, taus)
    return None


def prove_mode_forms(quotient: Quotient, found: SwitchedCertificate, ratios: bool = True) -> ModeForms | None:
    """Round matrices and multipliers, and prove rates and, unless ``ratios`` is False, the ratio; None if a step fails.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> quotient = Quotient(Family.from_intervals([("a", "b", 1, 1)]))
    >>> one = SwitchedCertificate((np.eye(1),), (2.0,), (np.zeros(0),), 1.0)
    >>> round(float(prove_mode_forms(quotient, one).rate), 6)
    2.0
    """
    exponents = [math.ceil(math.log2(float(np.abs(P).max()))) for P in found.matrices]
    matrices, rates, multipliers = [], [], []
    cases = zip(quotient.modes, found.matrices, found.multipliers, found.rates, exponents, strict=True)
    for mode, P, tau, guess, exponent in cases:
        checkpoint()
        factor = Fraction(2) ** (exponent - min(exponents))
        matrix = [[factor * x for x in row] for row in rounded_matrix(P, _MATRIX_BITS)]
        unit = Fraction(2) ** (_MATRIX_BITS - min(exponents))
        own = tuple(unit * round_to_bits(float(t), _MULTIPLIER_BITS) for t in tau)
        rate = prove_mode(mode, matrix, own, guess) if prove_ends(matrix) is not None else None
        if rate is None:
            return None
        matrices.append(matrix)
        rates.append(rate)
        multipliers.append(own)
    ratio = prove_ratio(matrices) if ratios else Fraction(1)
    return None if ratio is None else ModeForms(tuple(matrices), tuple(rates), tuple(multipliers), ratio)


def prove_ratio(matrices: Sequence[Matrix]) -> Fraction | None:
    """Prove ``P_j <= ratio P_i`` for all pairs of different matrices; None if it fails.

    Examples
    --------
    >>> one, other = [[Fraction(1)]], [[Fraction(3)]]
    >>> prove_ratio([one, one]), 3 <= prove_ratio([one, other, one]) < 3.001
    (Fraction(1, 1), True)
    """
    distinct: list[Matrix] = []
    for P in matrices:
        if P not in distinct:
            distinct.append(P)
    floats = [np.array([[float(x) for x in row] for row in P]) for P in distinct]
    inverses = [np.linalg.inv(np.linalg.cholesky(P)) for P in floats]
    largest = Fraction(1)
    for P, inverse in zip(distinct, inverses, strict=True):
        for Q, values in zip(distinct, floats, strict=True):
            if P is Q:
                continue
            guess = float(np.linalg.eigvalsh(inverse @ values @ inverse.T)[-1])
            checkpoint()
            minus = prove_generalized_margin([[-x for x in row] for row in Q], P, -guess)
            if minus is None:
                return None
            largest = max(largest, -minus)
    return rounded(largest, _RATIO_BITS, up=True)


@dataclass(frozen=True, eq=False)
class ShareForm:
    """A form with a rate for each mode, by which all agents come to 0, or to one value up to camps.

    Attributes
    ----------
    function : CommonForm
        ``V <= V(0) e^(-sum_i rates_i s_i)``, where mode ``i`` has acted for ``s_i``.
    behaviour : "stability" or "bipartite consensus"
        Where the mean of the rates is positive.
    at_rest : tuple of bool
        Of each mode, whether nothing moves in it.
    """

    function: CommonForm
    behaviour: str
    at_rest: tuple[bool, ...]

    def mean(self, shares: Sequence[Fraction]) -> Fraction:
        """Return the mean of the rates.

        Parameters
        ----------
        shares : sequence of Fraction
            One of each mode.
        """
        return sum((s * rate for s, rate in zip(shares, self.function.rates, strict=True)), Fraction(0))


def search_share_form(
    component: FamilyComponent, shares: Sequence[Fraction], known: Sequence[CommonForm] = ()
) -> ShareForm | None:
    """Search and prove a form with a large mean of its rates; None where nothing was found.

    The states at rest in it are those of the mode that has fewest: 0, or the camps that all edges of all modes keep.
    Functions that are known for every signal are candidates, too: their means are no less than their rates.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> pair, outage = SignedDigraph.from_edges([("a", "b", 1)]), SignedDigraph.from_edges([], nodes="ab")
    >>> form = search_share_form(decide(Family.switching([pair, outage]))[0], [Fraction(3, 4), Fraction(1, 4)])
    >>> form.behaviour, [round(float(r), 6) for r in form.function.rates]
    ('bipartite consensus', [2.0, 0.0])
    """
    if component.nodes.size > EXACT_NODES:
        return None
    try:
        quotient = Quotient(component.family, component.kernel)
    except HypothesisError:
        return None
    camps = len(quotient.pivots) == 1 and component.gauge is not None
    if not (camps or not quotient.pivots) or not within_reach(quotient):
        return None
    search = None
    with failures_told([], "full"):
        search = search_common_forms(quotient, ("diagonal", "full"), shares=[float(s) for s in shares])
    if search is None:
        return None
    at_rest = tuple(mode.at_rest for mode in quotient.modes)
    functions = (*search.functions, *known)
    forms = [ShareForm(V, BIPARTITE_CONSENSUS if camps else STABILITY, at_rest) for V in functions]
    return max(forms, key=lambda form: form.mean(shares), default=None)
