"""Who decides whom: shares, sums and the heat map agree with where agents end."""

from __future__ import annotations

import csv
import json
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from bad_inputs import ptcc as command
from generators import made_graphs
from hypothesis import given
from matplotlib.colors import to_rgb

import ptcc_certify as ptcc
from ptcc_certify.errors import ParameterError, unlabelled
from ptcc_certify.report.facts.influence import influence_facts
from ptcc_certify.report.plots.influence import plot_influence

TEAM = [("ann", "bob", 1), ("bob", "ann", 1), ("bob", "eve", -2), ("eve", "dan", 1), ("dan", "eve", 1)]


@pytest.mark.few(3)
@given(made_graphs(max_nodes=7))
def test_weights_times_initial_states_are_final_states(made):
    """Two routes to the same numbers: the weights, in the table as floats, and the final state of certificates."""
    who = ptcc.influence(made.graph)
    x0 = {label: Fraction(3 * k * k - 7, k + 2) for k, label in enumerate(made.graph.labels)}
    ends = dict.fromkeys(made.graph.labels, Fraction(0))
    rows = [(label, j, weight) for k, label in enumerate(x0) for j, weight in who.row(k).items()]
    for label, j, weight in rows:
        ends[label] += weight * x0[who.structure.graph.labels[j]]
    table = list(csv.DictReader(who.to_csv().splitlines()))
    assert [(row["node"], float(row["weight"])) for row in table] == [(label, float(x)) for label, _, x in rows]
    final = ptcc.final_state(made.graph, list(x0.values()))
    assert ends == dict(zip(final.labels, final.states, strict=True))
    table = np.zeros((len(x0), len(x0)))
    for k in range(len(x0)):
        for j, weight in who.row(k).items():
            table[k, j] = abs(float(weight))
    total = table.sum()
    assert np.allclose(who.shares, table.sum(axis=0) / (total or 1), rtol=1e-12, atol=0)


def test_shares_and_sums_are_told():
    decides, ends = influence_facts(ptcc.influence(TEAM))
    assert decides.text == "ann 50 %, bob 50 %"
    assert ends.text == "ann, bob end at 0.5 x_ann + 0.5 x_bob, eve, dan at -0.5 x_ann - 0.5 x_bob"
    decides, ends = influence_facts(ptcc.influence([("look at me", "a", 1), ("a", "b", -1)]))
    assert decides.text == "look at me 100 %"
    assert ends.text == "look at me, a end at x_look at me, b at -x_look at me"
    (nobody,) = influence_facts(ptcc.influence("fig1a"))
    assert nobody.text.startswith("nobody")


def test_the_heat_map_has_the_weights_of_all():
    ax = plot_influence("fig5a")
    rows, columns = ([tick.get_text() for tick in ticks] for ticks in (ax.get_yticklabels(), ax.get_xticklabels()))
    who = ptcc.influence("fig5a").to_pandas()
    places = [(text.get_position(), float(text.get_text())) for text in ax.texts]
    written = [weight for _, weight in places if weight]
    assert len(written) == int((who != 0).sum().sum()) > 30
    assert len(places) - len(written) == int((who == 0).all(axis=1).sum()) * len(columns) > 0  # who ends at 0
    for (x, y), weight in places:
        assert abs(who.loc[rows[round(y)], columns[round(x)]] - weight) <= 0.005, (x, y)
    with pytest.raises(ParameterError, match="all end at 0"):
        plot_influence("fig1a")


def test_weights_stand_out_from_their_cells_and_the_bar_says_what_it_is_of():
    ax = plot_influence("fig5a")
    (cells,) = ax.collections
    colours = cells.cmap(cells.norm(cells.get_array()))[..., :3]

    def luminance(colour):
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour]
        return float(np.dot([0.2126, 0.7152, 0.0722], linear)) + 0.05

    for text in ax.texts:
        column, row = text.get_position()
        pair = luminance(to_rgb(text.get_color())), luminance(colours[row, column])
        assert max(pair) / min(pair) >= 4.5
    assert ax.figure.axes[1].get_ylabel() == "weight in $x(T)$"


def test_rows_of_up_to_60_nodes_are_named():
    for n in (60, 61):
        ax = plot_influence([("a0", f"a{k}", 1) for k in range(1, n)])
        assert len(ax.get_yticklabels()) == (n if n == 60 else 0)


def test_the_command_prints_writes_and_draws(tmp_path: Path):
    run = command("influence", "fig3a", "-o", str(tmp_path / "q.csv"))
    assert run.code == 0 and "decides    2 37.5 %, 3 37.5 %, 1 25 %" in run.out
    assert (tmp_path / "q.csv").read_text(encoding="utf-8").startswith("node,leader,weight\n1,1,0.25\n")
    assert command("influence", "fig3a", "-o", str(tmp_path / "q.svg")).code == 0
    told = json.loads(command("influence", "fig3a", "--json").out)
    assert told["weights"]["6"] == {"1": "-1/8", "2": "-3/16", "3": "3/16"} and told["exact"]
    refused = command("influence", "fig3a", "-o", str(tmp_path / "q.txt"))
    assert refused.code == 2 and refused.err.count("\n") == 1 and not (tmp_path / "q.txt").exists()


def test_long_sums_and_long_names_keep_whole_terms_on_the_short_screen():
    names = [f"Bürgermeisterin Nummer {k} der Stadt" for k in range(6)]
    ring = [(names[k], names[(k + step) % 6], k + step) for k in range(6) for step in (1, 2)]
    _, ends = influence_facts(ptcc.influence([*ring, (names[0], "zoe", -1)]))
    (brief,) = (unlabelled(text) for text in ends.brief)
    group, _, rest = brief.partition(" end at ")
    first, _, more = rest.partition(" + ")
    assert group == "Bürgerm...er 0 der Stadt, ... (6 in all)" and first.split(" x_")[1].endswith("Stadt")
    assert "+ ... (6 terms)" in more and brief.endswith(", ... (2 in all)")
    assert len(brief) <= 140
