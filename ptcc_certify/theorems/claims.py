"""Which theorem applies, and what it says: the table from connectivity and balance to the behaviour of the agents."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ptcc_certify.checker.structure import reference
from ptcc_certify.graphs.structure import (
    BIPARTITE_CONSENSUS,
    BIPARTITE_CONTAINMENT,
    CONSENSUS,
    CONTAINMENT,
    INTERVAL_BIPARTITE_CONSENSUS,
    SIGNED_AVERAGE_CONSENSUS,
    STABILITY,
    WeakComponent,
    behaviour_name,
)

#: What each behaviour implies besides itself (Definitions 3 to 5: each contains the one before).
_IMPLIES: dict[str, tuple[str, ...]] = {
    CONSENSUS: (BIPARTITE_CONSENSUS, CONTAINMENT),
    SIGNED_AVERAGE_CONSENSUS: (BIPARTITE_CONSENSUS,),
    BIPARTITE_CONSENSUS: (INTERVAL_BIPARTITE_CONSENSUS,),
    INTERVAL_BIPARTITE_CONSENSUS: (BIPARTITE_CONTAINMENT,),
    CONTAINMENT: (BIPARTITE_CONTAINMENT,),
}
#: Theorem and behaviour by connectivity, and by whether some closed component is balanced.
_THEOREMS: dict[tuple[str, bool], tuple[str, str]] = {
    ("strong", True): ("1.1", BIPARTITE_CONSENSUS),
    ("strong", False): ("1.2", STABILITY),
    ("quasi-strong", True): ("2.1", INTERVAL_BIPARTITE_CONSENSUS),
    ("quasi-strong", False): ("2.2", STABILITY),
    ("weak", True): ("3.1", BIPARTITE_CONTAINMENT),
    ("weak", False): ("3.2", STABILITY),
}
#: The corollaries of each theorem: number, what the component has to be, and the special behaviour if there is one.
_COROLLARIES: dict[str, tuple[tuple[str, str, str | None], ...]] = {
    "1.1": (("1.1", "undirected", SIGNED_AVERAGE_CONSENSUS), ("2", "all_positive", CONSENSUS)),
    "1.2": (("1.2", "undirected", None),),
    "2.1": (("3", "balanced", BIPARTITE_CONSENSUS), ("4", "all_positive", CONSENSUS)),
    "3.1": (("5", "all_positive", CONTAINMENT),),
}
#: Under the sliding-mode protocol.
_SLIDING_COROLLARIES = {"1.1": "6.1", "1.2": "6.2", "2": "7", "3": "8", "4": "9", "5": "10"}


@dataclass(frozen=True)
class Claim:
    """What Theorems 1 to 3 say about one weakly connected graph.

    Attributes
    ----------
    theorem : str
        ``"1.1"`` .. ``"3.2"``.
    behaviour : str
        ``stability``, ``bipartite consensus``, ``interval bipartite consensus`` or ``bipartite containment``.
    corollaries : tuple of str
        Those whose hypotheses hold, e.g. ``("1.1", "2")``.
    special : tuple of str
        Special behaviours that the corollaries add, e.g. ``("consensus",)``.

    References
    ----------
    Theorems 1 to 6 and Corollaries 1 to 10 of [Zhu]_.

    Examples
    --------
    >>> claim = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 1, 1)])).claim
    >>> claim.theorem, claim.behaviour, claim.special
    ('1.1', 'bipartite consensus', ('signed-average consensus', 'consensus'))
    """

    theorem: str
    behaviour: str
    corollaries: tuple[str, ...]
    special: tuple[str, ...]

    @property
    def sharpest(self) -> str:
        """The sharpest behaviour: the last of the special ones, if there are any.

        Examples
        --------
        >>> Claim("2.1", "interval bipartite consensus", ("3",), ("bipartite consensus",)).sharpest
        'bipartite consensus'
        """
        return (self.behaviour, *self.special)[-1]

    @property
    def reference(self) -> str:
        """The theorem, and the corollary that makes the behaviour sharper.

        Examples
        --------
        >>> Claim("2.1", "interval bipartite consensus", ("3",), ("bipartite consensus",)).reference
        'Theorem 2.1, Corollary 3'
        """
        return reference(self.theorem, self.corollaries)

    def holds(self, behaviour: str) -> bool:
        """Tell whether ``behaviour`` (words joined by blanks or hyphens) follows from this claim.

        Parameters
        ----------
        behaviour : str
            ``stability``, ``bipartite-consensus``, ... or a special case such as ``consensus``.

        Returns
        -------
        bool

        Raises
        ------
        ValueError
            No behaviour is called so.

        Examples
        --------
        >>> Claim("2.1", "interval bipartite consensus", ("3",), ("bipartite consensus",)).holds("bipartite-consensus")
        True
        """
        expected = behaviour_name(behaviour)
        return any(expected in _implications(name) for name in (self.behaviour, *self.special))


def _implications(behaviour: str) -> set[str]:
    """Return a behaviour and all that it implies."""
    return {behaviour}.union(*map(_implications, _IMPLIES.get(behaviour, ())))


def claim_of(component: WeakComponent) -> Claim:
    """Apply Theorems 1 to 3 and Corollaries 1 to 5.

    Examples
    --------
    >>> claim_of(analyse(SignedDigraph.from_edges([(1, 2, 1)])).components[0]).corollaries
    ('3', '4')
    """
    theorem, behaviour = _THEOREMS[component.connectivity, component.leaders_balanced]
    corollaries = [(number, more) for number, fact, more in _COROLLARIES.get(theorem, ()) if getattr(component, fact)]
    special = tuple(more for _, more in corollaries if more is not None)
    return Claim(theorem, behaviour, tuple(number for number, _ in corollaries), special)


def sliding_number(number: str) -> str:
    """Return the number of a nominal theorem's counterpart.

    Examples
    --------
    >>> sliding_number("2.1")
    '5.1'
    """
    family, _, part = number.partition(".")
    return f"{int(family) + 3}.{part}"


def sliding_claim(claim: Claim) -> Claim:
    """Return what Theorems 4 to 6 and Corollaries 6 to 10 say where Theorems 1 to 3 say ``claim``.

    Examples
    --------
    >>> sliding_claim(Claim("1.1", "bipartite consensus", ("1.1", "2"), ("consensus",))).corollaries
    ('6.1', '7')
    """
    corollaries = tuple(_SLIDING_COROLLARIES[number] for number in claim.corollaries)
    return replace(claim, theorem=sliding_number(claim.theorem), corollaries=corollaries)
