"""The paper's examples and published ones certified, and what came of each: a row for the screen, a row of CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from fractions import Fraction
from textwrap import shorten
from typing import NamedTuple

from lmi.exact.decimal_rounding import counted, down, float_down, near, up
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.examples import Example, load_graph
from ptcc_certify.examples.published import Published
from ptcc_certify.model.asks import Asks, InitialState

#: The head of the table that ``ptcc examples`` prints; its rows are of :func:`result_lines`.
RESULTS_HEAD = (
    f"{'example':<9}{'theorem':<9}{'behaviour':<30}verdict",
    f"{'rate':>18}{'optimality':>12}{'worst':>8}{'reached':>10}{'proved by':>11}{'T_r':>5}  final state",
)


class Run(NamedTuple):
    """An example on one of its graphs, certified."""

    example: Example
    graph: str
    certificate: Certificate


def certify_example(entry: tuple[Example, str, str]) -> Run:
    """Certify an example on a graph, as :func:`ptcc_certify.examples.select` returns both, and what is expected."""
    example, graph, reported = entry
    certificate = certify(
        load_graph(graph),
        example.protocol(),
        InitialState(example.x0.split(","), sigma0=example.sigma0 and example.sigma0.split(",")),
        asks=Asks(disturbance=example.disturbance, expectations=reported),
    )
    return Run(example, graph, certificate)


def results_csv(runs: Sequence[Run]) -> str:
    """Return what came of the examples as CSV: claim, theorem, rates, reaching times, final state, verdict.

    Rates are per unit of the stretched clock, and the optimality ratio is the proved rate over its proved upper bound,
    all rounded down; ``reached_by`` is when each sliding variable is proved to be 0; the final state is written in
    full, exactly. What the simulated run showed is called so.
    """
    table = []
    for example, graph, certificate in runs:
        claim, paper, comparison = (
            certificate.graph_proof.claim,
            certificate.graph_proof.paper_rate,
            certificate.comparison,
        )
        ends, (last, proved, deadline) = certificate.graph_proof.final_state, _reaching_times(certificate)
        final = [] if ends is None else [f"{k}={x}" for k, x in zip(ends.labels, ends.states, strict=True)]
        row = {
            "example": example.number,
            "graph": graph,
            "claim": claim and claim.behaviour,
            "theorem": claim and claim.theorem,
            "certified_rate": None if certificate.proof.rate is None else float_down(certificate.proof.rate),
            "paper_rate": None if paper is None else float_down(paper),
            "optimality_ratio": certificate.graph_proof.optimality_ratio,
            "reached_by": proved,
            "T_r": deadline,
            "final_state": "; ".join(final),
            "verdict": certificate.verdict,
            "simulated_worst_ratio": comparison and comparison.worst_ratio,
            "simulated_reached": last,
        }
        table.append(row)
    text = io.StringIO()
    writer = csv.DictWriter(text, table[0] if table else (), lineterminator="\n")
    writer.writeheader()
    writer.writerows(table)  # None is an empty field
    return text.getvalue()


def result_lines(run: Run) -> tuple[str, str]:
    """Return the two lines of an example under :data:`RESULTS_HEAD`; what was proved is rounded to the safe side."""
    certificate = run.certificate
    claim, rate, comparison = certificate.graph_proof.claim, certificate.proof.rate, certificate.comparison
    assert claim is not None
    last, proved, deadline = _reaching_times(certificate)
    ratio = comparison.worst_ratio if comparison else 0
    times = f"{'-':>10}{'-':>11}{'-':>5}"
    if last is not None and proved is not None:
        times = f"{last:>10.5f}{up(proved, 5):>11}{deadline:>5.2g}"
    return (
        f"{run.example.number} {run.graph:<7}{claim.theorem:<9}{claim.behaviour:<30}{certificate.assessment.word}",
        f"{down(rate or Fraction(0)):>18}{down(certificate.graph_proof.optimality_ratio or 0.0, 4):>12}"
        f"{ratio:>8.3f}{times}  {_ends(certificate)}",
    )


def _reaching_times(certificate: Certificate) -> tuple[float | None, float | None, float | None]:
    """Return when the last sliding variable was 0 in the run, when each is proved to be, and ``T_r``; None if none."""
    reaching, run = (
        certificate.proof.reaching,
        None if certificate.trajectory is None else certificate.trajectory.sliding,
    )
    if reaching is None or run is None:
        return None, None, None
    return float(run.reaching_times.max()), max(r.time for r in reaching), float(run.protocol.T_r)


def _ends(certificate: Certificate) -> str:
    """Return the final state in a few letters: 0, a common size, or the largest, rounded up."""
    if (ends := certificate.graph_proof.final_state) is None:
        return "-"
    sizes = {abs(Fraction(x)) for x in ends.states}
    largest = max(sizes)
    common = near(largest, 5) if sizes == {0} else f"+-{near(largest, 5)}"
    return common if len(sizes) == 1 else f"|x| <= {up(largest, 5)}"


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
