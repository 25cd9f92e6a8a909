"""What is told of an agent is asked for by its label, and who does not exist is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from asked import certify_words

import ptcc_certify as ptcc
from ptcc_certify.errors import UnknownAgentError

pytestmark = pytest.mark.usefixtures("quick_search")

GRAPH = ptcc.SignedDigraph.from_edges([("ann", "bob", -1), ("bob", "ann", -1), ("ann", "eve", 2)])
PROTOCOL, X0 = ptcc.NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), [3, 1, 2]
FAMILY = ptcc.as_family([("ann", "bob", -1, -1), ("bob", "ann", -1, -1), ("ann", "eve", 1, 2)])


def certify(**options: Any) -> Any:
    return certify_words(GRAPH, PROTOCOL, X0, method="paper", **options)


def values_of(run: Any) -> Callable[[Any], Any]:
    return lambda agent: run[agent].tolist()


BY_PLACE_TOO: dict[str, Callable[[], Callable[[Any], Any]]] = {
    "influence": lambda: ptcc.influence(GRAPH).row,
    "influence of a certificate": lambda: certify().influence.row,
    "final states of a family": lambda: ptcc.certify(FAMILY, PROTOCOL, X0).final_state.__getitem__,
    "kernel of a family": lambda: ptcc.decide(FAMILY)[0].kernel.row,
    "rows of the Laplacian": lambda: lambda agent: GRAPH.exact_rows([agent]),
}
BY_LABEL: dict[str, Callable[[], Callable[[Any], Any]]] = {
    "final state": lambda: certify().final_state.__getitem__,
    "run": lambda: values_of(certify().trajectory),
    "run of a family": lambda: values_of(ptcc.simulate(FAMILY, PROTOCOL, X0)),
    "run of agents of order n": lambda: values_of(certify(agents=ptcc.Agents(order=2)).agents.simulate(samples=5)),
    "run with late messages": lambda: values_of(
        ptcc.simulate_late(GRAPH, PROTOCOL, ptcc.LateMessages(delay="0.1"), X0)
    ),
}


@pytest.mark.few(1)
@pytest.mark.parametrize("accessor", [*BY_PLACE_TOO, *BY_LABEL])
def test_labels_count_and_unknown_agents_are_refused(accessor: str) -> None:
    get = (BY_PLACE_TOO | BY_LABEL)[accessor]()
    assert get("eve")
    for nobody in ("joe", 7, -7, None, 1.5):
        with pytest.raises(UnknownAgentError, match=r"no agent (is called|has place) .*ann, bob, eve"):
            get(nobody)


@pytest.mark.parametrize("accessor", BY_PLACE_TOO)
def test_a_place_tells_what_the_label_there_does(accessor: str) -> None:
    get = BY_PLACE_TOO[accessor]()
    assert [get(k) for k in range(3)] == [get(label) for label in GRAPH.labels]


def test_a_row_of_the_influence_holds_all_weights_of_its_table() -> None:
    who = ptcc.influence(GRAPH)
    table = who.to_pandas()
    for label in GRAPH.labels:
        row = {GRAPH.labels[k]: float(weight) for k, weight in who.row(label).items()}
        assert row == {leader: x for leader, x in table.loc[label].to_dict().items() if x}
