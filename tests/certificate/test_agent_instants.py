"""Agents of order n where halves of the time are left: they are there, functions are no larger, bounds are near."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
from asked import certify_words
from mutations import resealed
from scipy.integrate import solve_ivp
from selection import every, thinned

from ptcc_certify.certificate.agents_part import AgentsPart
from ptcc_certify.certificate.cascade_part import CascadePart
from ptcc_certify.certificate.certificate import Certificate, read_certificate
from ptcc_certify.checker import check
from ptcc_certify.checker.agent_instants import halvings
from ptcc_certify.checker.agent_model import Agents as CheckedAgents
from ptcc_certify.checker.agent_model import Cascade
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.ensembles import Ensemble
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.agents import Agents

F = Fraction
PROTOCOL = NominalProtocol(T=2, rho1="1/2", rho2=1, kappa=2)
CAMPS = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -2), ("c", "a", "-1/2"), ("c", "f", -1), ("a", "f", 2)])
STABLE = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", -2), ("b", "c", 3), ("c", "d", "1/3")])
TWO_LEADERS = SignedDigraph.from_edges([("a", "f", 1), ("b", "f", -2), ("f", "g", 1), ("a", "g", 1), ("g", "f", 1)])
GRAPHS = {"camps": CAMPS, "stability": STABLE, "two leaders": TWO_LEADERS}
KINDS = {
    "plain": Agents(order=2),
    "at rest": Agents(order=2, rest=1),
    "drag": Agents(order=2, drag="1/2"),
    "drag, at rest": Agents(order=2, drag="1/2", rest="3/2"),
    "order 3": Agents(order=3, drag=1),
    "oscillators in a formation": Agents(plant=[4, 0], offsets=[1, 2, 3, 5]),
    "cascade": Agents(order=2, cascade=2),
    "cascade in a formation": Agents(order=2, cascade="1/2", offsets=[1, 2, 3, 5]),
}
CASES = [(graph, kind) for graph in GRAPHS for kind in KINDS]


@cache
def made(graph: str, kind: str) -> Certificate:
    agents = KINDS[kind]
    later = [[1, -2, 0, 3], [0, 1, 1, -1]][: agents.degree - 1]
    return certify_words(GRAPHS[graph], PROTOCOL, [5, 2, -4, 1], agents=agents, derivatives=later, simulation=False)


def part_of(certificate: Certificate) -> AgentsPart | CascadePart:
    assert isinstance(certificate.agents, AgentsPart | CascadePart)
    return certificate.agents


def deviations(part: AgentsPart | CascadePart) -> tuple[np.ndarray, np.ndarray]:
    """Instants ``1 - t/T`` of a run, and the deviations from the common motion there, (N, n, M)."""
    run = part.simulate(remaining=1e-3)
    known = run.remaining > 0
    q, scaled = run.remaining[known], np.sqrt((run.scaled[..., known] ** 2).sum(axis=1))
    eta = np.array([part.protocol.value(x) for x in q])
    return q, scaled * eta ** np.arange(part.order)[:, None] * np.exp(-run.rate * run.clock[known] / 2)


@pytest.mark.few(0)
@pytest.mark.parametrize(("graph", "kind"), thinned(CASES, 3))  # every kind once, by turns on every graph
def test_bounds_are_above_the_motion_and_at_99_percent_within_ten_times_of_it(graph: str, kind: str):
    part = part_of(made(graph, kind))
    q, true = deviations(part)
    bound = part.deviation_bound(q)
    assert (true <= bound * (1 + 1e-6) + 1e-8 * true.max(axis=0)).all()  # leaders alone stay in place, up to rounding
    at = [int(np.abs(np.log(q / x)).argmin()) for x in (0.1, 0.01)]
    ratio = np.linalg.norm(bound[:, :, at], axis=0) / np.linalg.norm(true[:, :, at], axis=0)
    assert (ratio[:2, 1] <= 10).all() and (ratio[0] <= 20).all(), ratio
    without = replace(part, instants=()).deviation_bound(q)
    assert (bound <= without).all() and np.linalg.norm(bound[:, 0, at]) < np.linalg.norm(without[:, 0, at])


@pytest.mark.few(0)
@pytest.mark.parametrize("kind", KINDS)
def test_agents_are_where_they_are_enclosed(kind: str):
    """The motion in original coordinates, by an explicit integrator of high order."""
    part = part_of(made("camps", kind))
    protocol, n = part.protocol, part.order
    chains: Any = (n, 1, protocol.plant, protocol.own, None, protocol.gain.exact)
    if isinstance(part, CascadePart):
        agents: Cascade | CheckedAgents = Cascade(*chains)
    else:
        matrix = part.matrix
        agents = CheckedAgents(*chains, protocol.gains, matrix.coupling, matrix.W, matrix.rate, matrix.points)
    L, h = CAMPS.laplacian().toarray(), np.array([float(row[0]) for row in protocol.offsets])
    K, f, a = (np.array(list(map(float, x))) for x in (protocol.gains, protocol.own, protocol.plant))

    def slope(t: float, x: np.ndarray) -> np.ndarray:
        X, eta, theta = x.reshape(n, 4), 1 / 2 + 2 / (2 - t), 2 / (3 - t / 2) ** 2
        powers, own = eta ** np.arange(n, 0, -1.0), K.copy()
        own[0] += theta * isinstance(part, CascadePart)
        return np.concatenate([X[1:].ravel(), -(powers * own) @ X @ L.T - (powers * f + a) @ X])

    start = np.array([[float(x) for x in agent[0]] for agent in part.initial_state or ()]).T
    start[0] -= h
    times = [2 - 2 * 2.0**-i for i in range(1, 6)]
    run = solve_ivp(slope, (0, times[-1]), start.ravel(), "DOP853", times, rtol=1e-11, atol=1e-11)

    def product(x: Sequence[int]) -> list[int]:
        return [sum(int(2 * a) * y for a, y in zip(row, x, strict=True)) for row in L]

    known = halvings(agents, product, 2, part.initial_state or (), protocol.offsets)
    for t, x, at in zip(times, run.y.T, known, strict=False):
        y = np.array([[float(x / at.scale) for x in row] for row in at.columns[0]])
        seen = x.reshape(n, 4) / (1 / 2 + 2 / (2 - t)) ** np.arange(n)[:, None]
        assert np.abs(y - seen).max() <= 1e-7 * np.abs(seen).max()
        assert at.off < 1e-30


def changed(change: Callable[[list[Any]], Any], kind: str = "at rest") -> Any:
    document = copy.deepcopy(made("camps", kind).to_dict())
    document["instants"] = change(document["instants"])
    return resealed(document)


def less(rows: list[Any], i: int) -> list[Any]:
    rows[i] = [value and str(F(value) * F(99999, 100000)) for value in rows[i]]
    return rows


@pytest.mark.parametrize("kind", ["at rest", "cascade"])
@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda rows: less(rows, 0), "a Lyapunov function is larger at an instant"),
        (lambda rows: less(rows, -1), "a Lyapunov function is larger at an instant"),
        (lambda rows: rows[1:], "a Lyapunov function is larger at an instant"),
        (lambda rows: [[None, *rows[0]]], ""),
        (lambda rows: [rows[0]] * 17, "more than 16"),
        (lambda rows: [], "no instants"),
        (lambda rows: None, "instants is null, and not left out"),
    ],
)
def test_forged_instants_are_rejected(change: Callable[[list[Any]], Any], reason: str, kind: str):
    report = check(changed(change, kind))
    assert not report.accepted and reason in (report.reason or "")


@pytest.mark.few(0)
@pytest.mark.parametrize("kind", ["at rest", "cascade"])
def test_instants_that_are_not_told_are_not_proved(kind: str):
    document = {key: part for key, part in made("camps", kind).to_dict().items() if key != "instants"}
    report = check(resealed(document))
    assert not report.accepted and report.rejected != "digest"


@pytest.mark.few(0)
@every(3)
@pytest.mark.parametrize("kind", ["at rest", "cascade"])
def test_no_root_of_an_instant_is_less_than_it_is(kind: str, every: int):
    """Every number by itself, a hundred thousandth smaller."""
    rows = made("camps", kind).to_dict()["instants"]
    for i, k in [(i, k) for i, row in enumerate(rows) for k, value in enumerate(row) if value is not None][::every]:

        def smaller(rows: list[Any], i: int = i, k: int = k) -> list[Any]:
            rows[i][k] = str(F(rows[i][k]) * F(99999, 100000))
            return rows

        assert check(changed(smaller, kind)).reason == "a Lyapunov function is larger at an instant"


@pytest.mark.few(0)
@pytest.mark.parametrize("kind", ["at rest", "cascade"])
def test_instants_are_accepted_and_read_back_whole_or_in_part(kind: str):
    certificate = made("camps", kind)
    assert check(certificate.to_dict()).accepted and len(part_of(certificate).instants) == 10
    back = read_certificate(certificate)
    assert back == certificate and part_of(back).instants == part_of(certificate).instants
    q = np.array([0.5, 0.3, 0.1, 0.01, 1e-6])
    assert (part_of(back).deviation_bound(q) == part_of(certificate).deviation_bound(q)).all()
    assert check(changed(lambda rows: [rows[0], [None] * len(rows[0])], kind)).accepted


def test_instants_stand_beside_agents_of_order_n_without_a_cap_alone():
    instants = made("camps", "plain").to_dict()["instants"]
    options: dict[str, Any] = {"simulation": False, "method": "paper"}
    plain = certify_words(CAMPS, PROTOCOL, [5, 2, -4, 1], **options)
    capped = certify_words(CAMPS, PROTOCOL, [5, 2, -4, 1], agents=Agents(order=3, gain_cap=50), **options)
    nowhere = certify_words(CAMPS, PROTOCOL, agents=Agents(order=2), **options)
    no_cascade = certify_words(CAMPS, PROTOCOL, agents=Agents(order=2, cascade=1), **options)
    for certificate in (plain, capped, nowhere, no_cascade):
        document = certificate.to_dict()
        assert "instants" not in document
        assert not check(resealed({**document, "instants": instants})).accepted


@pytest.mark.few(0)
def test_agents_in_agreement_have_none_and_large_teams_as_many_as_little_work_allows():
    together = certify_words(CAMPS, PROTOCOL, [1, 1, -1, 1], agents=Agents(order=2), simulation=False)
    assert together.verdict == "certified" and not part_of(together).instants
    graph = Ensemble(count=1, nodes=40).graph(0)
    large = certify_words(graph, PROTOCOL, list(range(40)), agents=Agents(order=8), simulation=False, method="paper")
    assert large.verdict == "certified" and len(part_of(large).instants) < 10


@pytest.mark.few(0)
def test_under_the_sliding_mode_protocol_and_in_the_plane():
    protocol = SlidingModeProtocol(T_r="1/2", T_s="3/2", rho1=1, rho2=1, kappa=2)
    places = [[1, 0], [2, 5], [-4, 1], [0, 3]]
    certificate = certify_words(CAMPS, protocol, places, agents=Agents(order=2, drag=1), simulation=False)
    part = part_of(certificate)
    assert check(certificate.to_dict()).accepted and part.instants
    q, true = deviations(part)
    assert (true <= part.deviation_bound(q) * (1 + 1e-6)).all()
