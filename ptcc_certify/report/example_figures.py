"""The figures of Section 4 of the paper, from certificates of its examples on the packaged graphs.

Figures 1, 3 and 5 are the graphs, 2, 4, 6, 8, 10 and 12 the states, 7, 9 and 11 the sliding variables; panel (a) and
(b) side by side. To these come the decay under its proved bound and the input under its proved peak.
"""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib import style
from matplotlib.figure import Figure

from ptcc_certify.report.example_results import Run
from ptcc_certify.report.page_figures import PLOTS
from ptcc_certify.report.plots.sizes import DOUBLE_COLUMN, SINGLE_COLUMN
from ptcc_certify.report.plots.style import STYLE, new_axes, share_legend

#: The plots of those figures of the paper that have a name of their own.
_PLOTS = {"graphs": "graph", "sliding_variables": "sliding"}


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
            figures[f"figure_{figure:02d}_{what}"] = _panels(own, what)
        for what in ("decay", "input"):
            figures[f"example_{number}_{what}"] = _panels(own, what)
    return figures


def _panels(runs: Sequence[Run], what: str) -> Figure:
    width, height = SINGLE_COLUMN if len(runs) == 1 else DOUBLE_COLUMN
    with style.context(STYLE):
        figure = Figure((width, height), layout="constrained")
        for place, (example, graph, certificate) in enumerate(runs, start=1):
            ax = new_axes(figure, (1, len(runs), place))
            others = {"beside": [run.certificate for run in runs]} if what == "input" else {}
            PLOTS[_PLOTS.get(what, what)](certificate, ax=ax, **others)
            claim = certificate.graph_proof.claim
            ax.set_title(f"({'ab'[example.graphs.index(graph)]}) {graph}: {claim.behaviour if claim else ''}")
        return share_legend(figure, 2 * len(runs) + 1)
