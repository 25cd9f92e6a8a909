"""A form whose mean rate over shares of the clock is large: some modes may be outages, or drive agents apart in it.

References
----------
docs/theory/families.md, "Shares of the clock".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from lmi.errors import LMIError, OutOfTime
from ptcc_certify.errors import HypothesisError
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY
from ptcc_certify.lyapunov.common_form_search import search_common_forms
from ptcc_certify.lyapunov.common_forms import CommonForm
from ptcc_certify.lyapunov.mode_forms import within_reach
from ptcc_certify.lyapunov.quotient import Quotient
from ptcc_certify.theorems.family_behaviour import FamilyComponent


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
    try:
        search = search_common_forms(quotient, ("diagonal", "full"), shares=[float(s) for s in shares])
    except OutOfTime:
        raise
    except LMIError:
        return None
    at_rest = tuple(mode.at_rest for mode in quotient.modes)
    functions = (*search.functions, *known)
    forms = [ShareForm(V, BIPARTITE_CONSENSUS if camps else STABILITY, at_rest) for V in functions]
    return max(forms, key=lambda form: form.mean(shares), default=None)
