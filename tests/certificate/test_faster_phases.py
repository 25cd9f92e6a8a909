"""Faster decrease of agents of order n nearer to the deadline: it is proved, it is above the motion, it leaves less."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
from asked import certify_words
from mutations import resealed

from ptcc_certify.certificate.agents_part import AgentsPart
from ptcc_certify.certificate.certificate import Certificate, read_certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Asks, InitialState

F = Fraction
TEAM = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -2), ("c", "a", "-1/2"), ("c", "f", -1), ("a", "f", 2)])
PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=4)
KINDS = {
    "drag": Agents(order=3, drag="1/3"),
    "order 4": Agents(order=4, drag=2),
    "at rest": Agents(order=2, rest=1),
    "oscillators": Agents(plant=[4, 0]),
}


@cache
def made(name: str) -> Certificate:
    agents = KINDS[name]
    later = [[1, -2, 0, 3], [0, 1, 1, -1], [2, 0, 0, 1]][: agents.degree - 1]
    return certify(
        TEAM, PROTOCOL, InitialState([5, 2, -4, 1], derivatives=later), agents=agents, asks=Asks(simulation=False)
    )


def part_of(certificate: Certificate) -> AgentsPart:
    assert isinstance(certificate.agents, AgentsPart)
    return certificate.agents


@pytest.mark.few(0)
@pytest.mark.parametrize("name", KINDS)
def test_phases_are_accepted_read_back_and_leave_less(name: str):
    certificate = made(name)
    part, remaining = part_of(certificate), np.geomspace(1e-6, 1, 30)
    assert certificate.verdict == "certified" and part.phases
    kinds = [step["kind"] for step in certificate.to_dict()["proof"][-len(part.phases) - 1 :]]
    assert kinds == ["agent-phase"] * len(part.phases) + ["agent-instants"]
    alone = replace(part, instants=())
    ours, without = (one.deviation_bound(remaining) for one in (alone, replace(alone, phases=())))
    assert (ours <= without).all() and (ours[:, :, 0] < without[:, :, 0] / 2).all()
    again = read_certificate(certificate)
    assert again == certificate and np.array_equal(
        part_of(again).deviation_bound(remaining), part.deviation_bound(remaining)
    )


@pytest.mark.few(0)
@pytest.mark.parametrize("name", KINDS)
def test_deviations_stay_within_the_bounds_of_phases(name: str):
    part = part_of(made(name))
    run = part.simulate(remaining=1e-4)
    known = run.remaining > 0
    q, clock = run.remaining[known], run.clock[known]
    eta = np.array([part.protocol.value(x) for x in q])
    scaled = np.sqrt((run.scaled[..., known] ** 2).sum(axis=1))
    size = eta ** np.arange(part.order)[:, None] * np.exp(-run.rate * clock / 2)
    rounding = 1e-8 * scaled.max() * size
    assert (scaled * size <= part.deviation_bound(q) * (1 + 1e-7) + rounding).all()


def changed(path: tuple[Any, ...], change: Callable[[Any], Any]) -> Any:
    document = copy.deepcopy(made("order 4").to_dict())
    place: Any = document
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = change(place[path[-1]])
    if path[-1] == "rate":
        next(step for step in document["proof"] if step["of"] == f"phases[{path[1]}]")["numbers"]["rate"] = place[
            "rate"
        ]
    return resealed(document)


def times(factor: Any) -> Callable[[str], str]:
    return lambda text: str(F(text) * F(factor))


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("path", "change", "reason"),
    [
        (("phases", 0, "rate"), times("1.05"), "the decrease of a phase is not proved"),
        (("phases", -1, "rate"), times("1.2"), "the decrease of a phase is not proved"),
        (("phases", 0, "rate"), lambda _: "0", "not positive"),
        (("phases", 0, "coupling"), times("1.001"), "K is not c b'W^-1"),
        (("phases", 0, "lower_triangle", 0, 0), times("0.9"), "the matrix of a phase is below the former"),
        (("phases", 0, "function"), lambda _: 99, "a function that is not used"),
        (("phases", 0, "points", -1), times(20), "begins too early"),
        (("phases", 0, "points", 0), lambda _: "1/1000", "begins too early"),
        (("phases",), lambda entries: entries[::-1], ""),
        (("phases",), lambda entries: entries[:-1], "lists another obligation"),
        (("phases",), lambda entries: [*entries, entries[-1]], "lists another obligation"),
        (("phases",), lambda _: None, "phases is null, and not left out"),
    ],
)
def test_forged_phases_are_rejected(path: tuple[Any, ...], change: Callable[[Any], Any], reason: str):
    if path[1:2] == (-1,):
        path = ("phases", len(made("order 4").to_dict()["phases"]) - 1, *path[2:])
    report = check(changed(path, change))
    assert not report.accepted and reason in (report.reason or "")


@pytest.mark.few(0)
def test_phases_that_are_not_told_are_not_proved():
    document = {key: part for key, part in made("order 4").to_dict().items() if key != "phases"}
    report = check(resealed(document))
    assert not report.accepted and report.rejected != "digest"
    report = check(resealed({**document, "phases": []}))
    assert (report.rejected, report.reason) == ("phases", "no phase, or more than 100")


@pytest.mark.few(0)
def test_phases_stand_beside_agents_of_order_n_without_a_cap_alone():
    phases = made("order 4").to_dict()["phases"]
    options: dict[str, Any] = {"simulation": False, "method": "paper"}
    plain = certify_words(TEAM, PROTOCOL, [5, 2, -4, 1], **options)
    capped = certify_words(TEAM, PROTOCOL, [5, 2, -4, 1], agents=Agents(order=3, gain_cap=50), **options)
    cascade = certify_words(TEAM, PROTOCOL, [5, 2, -4, 1], agents=Agents(order=2, cascade=1), **options)
    for certificate, reason in (
        (plain, "not of order n"),
        (capped, "capped"),
        (cascade, "phases of the cascade"),
    ):
        document = certificate.to_dict()
        assert check(document).accepted and "phases" not in document
        report = check(resealed({**document, "phases": phases}))
        assert report.rejected == "phases" and reason in (report.reason or "")
