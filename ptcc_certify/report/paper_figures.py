"""The figures of Section 4 of the paper, from certificates of its examples on the packaged graphs.

Figures 1, 3 and 5 are the graphs, 2, 4, 6, 8, 10 and 12 the states, 7, 9 and 11 the sliding variables; panel (a) and
(b) side by side. To these come the decay under its proved bound and the input under its certified peak.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from lmi.exact.rounding import float_down
from ptcc_certify.examples import Example
from ptcc_certify.report.plots import (
    DOUBLE_COLUMN,
    SINGLE_COLUMN,
    STYLE,
    new_axes,
    plot_decay,
    plot_graph,
    plot_input,
    plot_sliding,
    plot_trajectory,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ptcc_certify.certificate.certificate import Certificate


_COLUMNS = (
    *("example", "graph", "claim", "theorem", "certified_rate", "paper_rate", "optimality_ratio", "reached_by", "T_r"),
    *("final_state", "verdict", "simulated_worst_ratio", "simulated_reached"),
)


class Run(NamedTuple):
    """An example on one of its graphs, certified."""

    example: Example
    graph: str
    certificate: Certificate


def paper_figures(runs: Sequence[Run]) -> dict[str, Figure]:
    """Draw the figures of some examples, each with as many panels as there are graphs.

    Parameters
    ----------
    runs : sequence of Run
        Simulated, those of an example next to each other.

    Returns
    -------
    dict of str to Figure
        By name: ``figure_02_states`` for Figure 2 of the paper, ``example_1_decay`` for what it does not show.

    Examples
    --------
    >>> from ptcc_certify import certify
    >>> from ptcc_certify.examples import load_graph, select
    >>> example, name, _ = select("fig1b")[0]
    >>> cert = certify(load_graph(name), example.protocol(), example.x0.split(","))
    >>> list(paper_figures([Run(example, name, cert)]))
    ['figure_01_graphs', 'figure_02_states', 'example_1_decay', 'example_1_input']
    """
    figures: dict[str, Figure] = {}
    for number in dict.fromkeys(run.example.number for run in runs):
        own = [run for run in runs if run.example.number == number]
        for what, figure in own[0].example.figures.items():
            figures[f"figure_{figure:02d}_{what}"] = _panels(own, _DRAW[what])
        for what in ("decay", "input"):
            figures[f"example_{number}_{what}"] = _panels(own, _DRAW[what])
    return figures


def results_csv(runs: Sequence[Run]) -> str:
    """Return what came of the examples as CSV: claim, theorem, rates, reaching times, final state, verdict.

    Rates are per unit of the stretched clock, and the optimality ratio is the proved rate over its proved upper bound,
    all rounded down; ``reached_by`` is when each sliding variable is proved to be 0; the final state is written in
    full, exactly. What the simulated run showed is called so.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    for example, graph, certificate in runs:
        claim, paper, seen = certificate.claim, certificate.proof.rate, certificate.comparison
        ends, (last, proved, deadline) = certificate.outcome, reaching_times(certificate)
        writer.writerow(
            [
                example.number,
                graph,
                claim.behaviour if claim else "",
                claim.theorem if claim else "",
                "" if certificate.rate is None else float_down(certificate.rate),
                "" if paper is None else float_down(paper),
                certificate.optimality_ratio,
                proved,
                deadline,
                ""
                if ends is None
                else "; ".join(f"{k}={x}" for k, x in zip(ends.labels, ends.final_state, strict=True)),
                certificate.verdict,
                seen.worst_ratio if seen else "",
                last,
            ]
        )
    return text.getvalue()


def reaching_times(certificate: Certificate) -> tuple[float, float, float] | tuple[str, str, str]:
    """Return when the last sliding variable was 0 in the run, when each is proved to be, and ``T_r``; texts if none."""
    reaching, run = certificate.reaching, None if certificate.trajectory is None else certificate.trajectory.sliding
    if reaching is None or run is None:
        return "", "", ""
    return float(run.reaching_times.max()), max(r.time for r in reaching), float(run.protocol.T_r)


def _panels(runs: Sequence[Run], draw: Callable[[Certificate, Axes], object]) -> Figure:
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(STYLE):
        figure = Figure(SINGLE_COLUMN if len(runs) == 1 else DOUBLE_COLUMN, layout="constrained")
        panels = figure.subfigures(1, len(runs), squeeze=False)[0]
        for (example, graph, certificate), panel in zip(runs, panels, strict=True):
            draw(certificate, new_axes(panel))
            claim = certificate.claim
            letter = "ab"[example.graphs.index(graph)]
            panel.suptitle(f"({letter}) {graph}: {claim.behaviour if claim else ''}")
    return figure


def _states(certificate: Certificate, ax: Axes) -> Axes:
    assert certificate.trajectory is not None
    return plot_trajectory(certificate.trajectory, certificate.structure, ax)


def _sliding(certificate: Certificate, ax: Axes) -> Axes:
    assert certificate.trajectory is not None and certificate.trajectory.sliding is not None
    return plot_sliding(certificate.trajectory.sliding, certificate.reaching, ax)


def _input(certificate: Certificate, ax: Axes) -> Axes:
    assert certificate.trajectory is not None
    return plot_input(certificate.trajectory, certificate.structure, certificate, ax)


_DRAW: dict[str, Callable[[Certificate, Axes], object]] = {
    "graphs": lambda certificate, ax: plot_graph(certificate.structure, ax),
    "states": _states,
    "sliding_variables": _sliding,
    "decay": lambda certificate, ax: plot_decay(certificate, ax),
    "input": _input,
}
