"""The published examples certified: what is claimed, what was found."""

from __future__ import annotations

from fractions import Fraction
from textwrap import shorten
from typing import NamedTuple

from lmi.exact.decimal_rounding import counted, near
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.examples.published import Published
from ptcc_certify.model.asks import Asks

#: The head of the table that ``ptcc examples published`` prints; its rows are of :meth:`Found.lines`.
PUBLISHED_HEAD = (f"{'published':<26}{'claim':<29}found", f"{'':<4}paper")


class Found(NamedTuple):
    """A published example, certified."""

    entry: Published
    certificate: Certificate

    @property
    def misses(self) -> tuple[str, ...]:
        """Nodes whose final states are not as claimed."""
        return self.entry.misses(self._ends()) if self.entry.ends else ()

    @property
    def as_recorded(self) -> bool:
        """Whether the claim holds, or fails in the recorded way."""
        code = self.certificate.assessment.exit_code
        if self.entry.fails is None:
            return code == 0 and not self.misses
        return code != 0 and self.entry.fails in self.certificate.assessment.text

    @property
    def verdict(self) -> str:
        """The verdict in a few words.

        Examples
        --------
        >>> from ptcc_certify.examples.published import PUBLISHED
        >>> certify_published(PUBLISHED["french"]).verdict
        'certified, 3 final states as claimed'
        >>> certify_published(PUBLISHED["leader_other_matrix"]).verdict
        'not as claimed: interval bipartite consensus, from ~-7.76 to 12'
        """
        if self.certificate.assessment.exit_code:
            if not self.as_recorded:
                return self.certificate.assessment.text
            states = self._ends().values()
            return f"not as claimed: {self.entry.fails}, from {near(min(states), 3)} to {near(max(states), 3)}"
        if self.misses:
            return f"not as claimed: {', '.join(self.misses)} end elsewhere"
        return "certified" + (f", {counted(len(self.entry.ends), 'final state')} as claimed" if self.entry.ends else "")

    def _ends(self) -> dict[str, Fraction]:
        """Return the final state of every node; where the topology switches, of those with one for all signals.

        Examples
        --------
        >>> from ptcc_certify.examples.published import PUBLISHED
        >>> certify_published(PUBLISHED["noisy"])._ends()["1"]
        Fraction(4, 15)
        """
        if self.certificate.of_family:
            ends = self.certificate.family_proof.final_state
            pairs = () if ends is None else zip(ends.labels, ends, strict=True)
            return {label: pair[0] for label, pair in pairs if pair is not None and pair[0] == pair[1]}
        final = self.certificate.graph_proof.final_state
        assert final is not None
        return {str(node): Fraction(state) for node, state in zip(final.labels, final.states, strict=True)}

    def lines(self) -> tuple[str, str]:
        """Return the two lines of the example under :data:`PUBLISHED_HEAD`.

        Examples
        --------
        >>> from ptcc_certify.examples.published import PUBLISHED
        >>> print(*certify_published(PUBLISHED["managers"]).lines(), sep=chr(10))
        managers                  consensus                    certified
            D. Krackhardt: Cognitive social structures, doi:10.1016/0378-8733(87)90009-8
        """
        entry = self.entry
        paper = shorten(entry.paper, 76, placeholder=" ...") + (f", doi:{entry.doi}" if entry.doi else "")
        return f"{entry.name:<26}{entry.behaviour:<29}{self.verdict}", f"{'':<4}{paper}"


def certify_published(entry: Published) -> Found:
    """Certify a published example, and what is claimed of it.

    Examples
    --------
    >>> from ptcc_certify.examples.published import PUBLISHED
    >>> certify_published(PUBLISHED["french"]).certificate
    Certificate(met: consensus; certified; consensus, Theorem 1.1, rate 0.999999)
    """
    x0 = None if entry.x0 is None else dict(entry.x0)
    return Found(entry, certify(entry.graph(), entry.protocol(), x0, asks=Asks(expectations=entry.behaviour)))
