"""What is proved rests on what the file states, so that the check accepts it; where it does not, nothing is claimed."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked import certify_family, certify_words
from bad_inputs import ptcc
from late_certificates import led_graph
from selection import thinned

from ptcc_certify import (
    Expectations,
    Family,
    LateMessages,
    MovingLeaders,
    NominalProtocol,
    SignedDigraph,
    certify,
    read_graph,
)
from ptcc_certify.bounds.delay import certain_misses
from ptcc_certify.bounds.delay.certain_misses import Missed
from ptcc_certify.certificate import document
from ptcc_certify.certificate.assessment import Answer, standing
from ptcc_certify.certificate.certificate import RejectedCertificate
from ptcc_certify.checker import CheckReport
from ptcc_certify.checker.final_state import WIDEST
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.lyapunov import dominance
from ptcc_certify.lyapunov.rate_upper_bound import mean_bound
from ptcc_certify.model.asks import Asks

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
LATE = LateMessages(delay="0.01")
REJECTED = CheckReport(False, "", (), "rates", "because this test says so", "none", "")
LEFT = {"verdict": "undecided", "rejected": "rates", "reason": "because this test says so"}
CHAIN = "source,target,weight\na,b,1\nb,c,-1\n"


# ---------------------------------------------------------------------- what the file states


@pytest.mark.few(1)
@pytest.mark.parametrize("seed", thinned([0, 2, 3, 4, 5], 3))
def test_who_misses_the_deadline_is_proved_of_final_states_that_are_enclosed(seed: int):
    """Above 120 agents the file states decimals, which are not the floats that were computed."""
    rng = np.random.default_rng(seed)
    graph = led_graph(rng, 3, 120, acyclic=True, signs="gauge")
    x0 = [Fraction(int(x), 100) for x in rng.integers(-500, 500, graph.n_nodes)]
    made = certify(graph, PROTOCOL, x0, messages=LATE, asks=Asks(simulation=False, method="perron"))
    assert made.late is not None and made.late.missed is not None and made.influence.enclosure is not None
    assert made.checked.accepted, made.checked.reason


@pytest.mark.few(0)
@pytest.mark.parametrize("how", [{"messages": LATE}, {"leaders": MovingLeaders(speed="0.1")}], ids=["late", "leaders"])
def test_agents_that_begin_at_a_final_state_that_is_too_long_to_be_written(how: dict[str, Any]):
    """Its weights are exact, and the file states an interval: agents at its middle may be off it by the radius."""
    rng, n = np.random.default_rng(1), 100

    def weight() -> int:
        return int(rng.integers(2**61, 2**62)) * 2**40 + int(rng.integers(1, 2**40))

    names = [f"f{k}" for k in range(n)]
    pairs = list(zip(names, [*names[1:], names[0]], strict=True))
    edges = [("a", "f0", weight()), ("b", "f1", weight())]
    edges += [(s, t, weight()) for s, t in pairs] + [(t, s, weight()) for s, t in pairs]
    graph = SignedDigraph.from_edges(edges)
    made = certify_words(graph, PROTOCOL, [1] * graph.n_nodes, simulation=False, method="perron", **how)
    assert isinstance(made.to_dict()["final_state"]["f3"], dict)
    assert made.checked.accepted, made.checked.reason


@pytest.mark.few(1)
@pytest.mark.parametrize(("decades", "seed"), [(1, 0), (2, 4), (2, 8), (2.5, 3), (3, 6)])
def test_followers_of_ill_conditioned_equations_are_as_wide_as_is_proved(decades: float, seed: int):
    """A chain of 130 followers between two leaders; its weights are spread over twice so many decades."""
    rng, n = np.random.default_rng(seed), 130

    def weight() -> Fraction:
        return Fraction(f"{10 ** rng.uniform(-decades, decades):.3g}")

    edges = [("a", 0, weight()), ("b", n - 1, weight())]
    edges += [(k, k + 1, weight()) for k in range(n - 1)] + [(k + 1, k, weight()) for k in range(n - 1)]
    graph = SignedDigraph.from_edges(edges)
    x0 = [k % 4 - 1 for k in range(n + 2)]
    made = certify(graph, PROTOCOL, x0, asks=Asks(simulation=False, method="perron"))
    assert made.checked.accepted, made.checked.reason
    assert made.final_state is not None and made.final_state.radius is not None
    assert max(made.final_state.radius) > WIDEST * max(x0)  # the check lets no interval be much wider than is proved


@pytest.mark.few(0)
def test_an_upper_bound_that_is_too_long_to_be_written_is_left_out():
    """Twice the mean eigenvalue of 130 agents with weights of many digits takes more digits than a file may hold."""
    n, rng = 130, np.random.default_rng(0)
    weights = [Fraction(int(rng.integers(1, 2**60)), int(rng.integers(2**59, 2**60)) | 1) for _ in range(n)]
    graph = SignedDigraph.from_edges([(k, (k + 1) % n, w) for k, w in enumerate(weights)])
    assert mean_bound(analyse(graph)) is None
    made = certify(graph, PROTOCOL, asks=Asks(simulation=False, time_limit=5))
    assert made.checked.accepted and made.upper_bound is None


# ---------------------------------------------------------------------- where the check rejects


def reject(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the check that lays down proofs reject all certificates."""
    monkeypatch.setattr(document, "record", lambda sections, *rest: ({**sections, "digest": "0"}, REJECTED))


@pytest.fixture
def rejecting(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A folder with two graphs, and a check that rejects all certificates."""
    monkeypatch.chdir(tmp_path)
    reject(monkeypatch)
    Path("chain.csv").write_text(CHAIN)
    Path("other.csv").write_text("source,target,weight\na,b,2\na,c,1\n")
    return tmp_path


QUICK = ["chain.csv", "--method", "paper"]
COMMANDS = {
    "behaviour": [*QUICK, "--expect", "stability"],
    "rate": [*QUICK, "--min-rate", "1000"],
    "input": [*QUICK, "--max-input", "0.001"],
    "met": [*QUICK, "--expect", "bipartite-consensus", "--min-rate", "0.001"],
    "late": [*QUICK, "--delay", "0.01", "--max-residual", "1e-9"],
    "leaders": [*QUICK, "--leader-speed", "1", "--max-input", "1e-3"],
    "agents": [*QUICK, "--agents", "2", "--max-input", "1e-3", "--expect", "stability"],
    "family": ["chain.csv", "other.csv", "--switching", "--expect", "stability", "--min-rate", "1000"],
}


@pytest.mark.few(3)
@pytest.mark.parametrize("options", COMMANDS.values(), ids=COMMANDS)
@pytest.mark.parametrize("long", [False, True], ids=["short", "long"])
def test_where_the_check_rejects_nothing_is_claimed_refuted_or_written(options: list[str], long: bool, rejecting: Path):
    run = ptcc("certify", *options, "--no-simulation", "-o", "c.json", *(["-v"] if long else []))
    text = " ".join(run.out.split())
    assert run.code == 4 and not (rejecting / "c.json").exists()
    assert "undecided: the independent check rejects rates, a defect of this program: nothing is claimed" in text
    assert "nothing was written" in text
    assert not {"claim", "rate", "error", "input", "INPUT", "late", "x(T)"} & {
        line[:10].strip() for line in run.out.splitlines()
    }
    for word in ("refuted:", "met:", "at least", "proved"):
        assert word not in text


@pytest.mark.few(0)
@pytest.mark.parametrize("options", COMMANDS.values(), ids=COMMANDS)
def test_where_the_check_rejects_json_tells_that_alone(options: list[str], rejecting: Path):
    run = ptcc("certify", *options, "--no-simulation", "--json", "-o", "c.json")
    assert run.code == 4 and not (rejecting / "c.json").exists()
    assert json.loads(run.out) == LEFT


def test_where_the_check_rejects_nothing_is_saved(rejecting: Path):
    graph, other = (read_graph(name) for name in ("chain.csv", "other.csv"))
    made = certify(graph, PROTOCOL, asks=Asks(simulation=False))
    family = certify_family(Family.switching([graph, other]), PROTOCOL)
    for one in (made, family):
        with pytest.raises(RejectedCertificate, match=r"rejects .*: because this test says so; .* nothing was written"):
            one.save("c.json")
    assert not Path("c.json").exists()
    for one in (made, family):
        assert one.to_dict() == json.loads(one.to_json()) == LEFT


def test_a_refutation_rests_on_what_the_check_accepts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """An agent that is said to miss the deadline by more than is so: rejected, and no answer."""
    honest: Callable[..., Missed | None] = certain_misses.find_missed

    def more(*case: Any) -> Missed | None:
        found = honest(*case)
        return None if found is None else replace(found, bound=found.bound * 2)

    monkeypatch.setattr("ptcc_certify.bounds.delay.late_messages.find_missed", more)
    graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    made = certify(
        graph, PROTOCOL, [1, 3, 4], messages=LATE, asks=Asks(simulation=False, expectations="bipartite consensus")
    )
    assert made.checked.rejected == "late-missed of messages.missed"
    assert made.assessment.exit_code == 4 and made.assessment.asked == "left open"
    monkeypatch.undo()
    true = certify(
        graph, PROTOCOL, [1, 3, 4], messages=LATE, asks=Asks(simulation=False, expectations="bipartite consensus")
    )
    assert true.checked.accepted and true.assessment.asked == "refuted" and true.assessment.exit_code == 3


def test_a_certificate_without_a_rate_is_checked_and_its_answers_rest_on_that(monkeypatch: pytest.MonkeyPatch):
    """The upper bound is all that is proved of this ring, and refutes what is above it."""
    monkeypatch.setattr(dominance, "FILL_ROWS", -1)
    ring = SignedDigraph.from_edges([(k, (k + 1) % 121, 1) for k in range(121)])
    made = certify(ring, PROTOCOL, asks=Asks(simulation=False, expectations=Expectations(min_rate=1000)))
    assert made.rate is None and made.checked.accepted and made.verdict == "undecided"
    assert made.assessment.asked == "refuted" and made.assessment.exit_code == 3
    reject(monkeypatch)
    again = made.changed(notes=())
    assert again.assessment.asked == "left open" and again.assessment.exit_code == 4


def test_what_is_decided_of_a_family_and_not_certified_leaves_answers_open():
    """Whether rest states agree takes exact rows of more than 120 agents: no certificate, so nothing is refuted."""
    answers = standing([Answer("refuted", "consensus"), Answer("met", "rate >= 1")], None)
    assert {answer.status for answer in answers} == {"left open"}


@pytest.mark.few(0)
def test_a_left_null_vector_that_is_too_long_to_be_written_is_enclosed():
    """Of a leader group that is solved exactly in a graph that is not: what a file rounds needs a witness."""
    rng, n = np.random.default_rng(2), 100
    names = [f"a{k}" for k in range(n)]
    pairs = list(zip(names, [*names[1:], names[0]], strict=True))
    edges = [(s, t, int(rng.integers(2**61, 2**62)) * 2**40 + 1) for s, t in [*pairs, *((t, s) for s, t in pairs)]]
    followers = [("a0", "f0", 1), *((f"f{k}", f"f{k + 1}", 1) for k in range(40)), ("f40", "f20", -1)]
    made = certify(
        SignedDigraph.from_edges([*edges, *followers]), PROTOCOL, asks=Asks(simulation=False, method="perron")
    )
    assert made.graph.n_nodes > 120 and made.checked.accepted, made.checked.reason
