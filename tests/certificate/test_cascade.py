"""Double integrators that track the velocity of the paper's protocol: what is proved of them, and what is refused."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked import certify_words
from generators import all_classes, random_graph
from oracle_cascade import false_claims_of_cascade, moved
from scipy.integrate import solve_ivp

from ptcc_certify.bounds.agents.cascade import Roots, course
from ptcc_certify.bounds.agents.each_agent import checked_graph
from ptcc_certify.certificate.cascade_part import CascadePart
from ptcc_certify.certificate.certificate import Certificate, read_certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check
from ptcc_certify.checker.agent_cascade import halvings_of
from ptcc_certify.checker.agent_model import Cascade
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.agents_protocol import CascadeProtocol
from ptcc_certify.model.asks import Asks

F = Fraction
CLASSES = all_classes()
TEAM = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1), ("a", "c", -1), ("c", "d", 1), ("d", "c", 1)])
ENEMIES = SignedDigraph.from_edges([("a", "b", -1), ("b", "c", -2), ("c", "a", -1), ("b", "a", -1)])
PAIR = SignedDigraph.from_edges([("a", "b", 1)])  # a leads; the rate is 2
FAST = NominalProtocol(T=2, rho1=1, rho2=6, kappa=1)


def made(graph: Any, protocol: Any, x0: Any, agents: Agents, **options: Any) -> Certificate:
    return certify_words(graph, protocol, x0, agents=agents, **{"method": "paper", "simulation": False, **options})


def part_of(certificate: Certificate) -> CascadePart:
    assert isinstance(certificate.agents, CascadePart)
    return certificate.agents


def holds(certificate: Certificate) -> None:
    """Accepted, read back the same, true, and above what was simulated."""
    data = json.loads(certificate.to_json())
    report = check(data)
    assert report.accepted, (report.rejected, report.reason)
    assert false_claims_of_cascade(data) == []
    seen = certificate.agents_comparison
    assert seen is None or not seen.violated, seen


# ---------------------------------------------------------------------- random cases


@dataclass(frozen=True)
class Case:
    """A graph, gains, and where agents begin."""

    graph: SignedDigraph
    protocol: Any
    alpha: Fraction
    x0: list[list[Fraction]]
    v0: list[list[Fraction]]
    offsets: list[list[Fraction]] | None


def case_of(seed: int) -> Case:
    rng = np.random.default_rng([33, seed])
    _, keywords = CLASSES[seed % len(CLASSES)]
    graph = random_graph(rng, **{"weights": "decimals", **keywords}).graph
    N, d = graph.n_nodes, int(rng.integers(1, 3))
    rows = lambda: [[F(int(x), 100) for x in row] for row in rng.integers(-500, 501, (N, d))]  # noqa: E731
    T, k = F(int(rng.integers(5, 30)), 10), F(int(rng.integers(1, 60)), 10)
    rho1 = F(int(rng.integers(1, 20)), 10) if rng.random() < 0.6 else F(1, 10**12)
    protocol: Any = NominalProtocol(T=T, rho1=rho1, rho2=k, kappa=1)
    if rng.random() < 0.2:
        protocol = SlidingModeProtocol(T_r=T / 3, T_s=2 * T / 3, rho1=rho1, rho2=k, kappa=1)
    alpha = F(int(rng.integers(1, 40)), 10)
    return Case(graph, protocol, alpha, rows(), rows(), rows() if rng.random() < 0.4 else None)


def certified(case: Case, method: str, simulation: bool = True) -> Certificate:
    agents = Agents(order=2, cascade=case.alpha, offsets=case.offsets)
    return made(case.graph, case.protocol, case.x0, agents, v0=case.v0, method=method, simulation=simulation)


def worst_ratio(certificate: Certificate) -> float:
    """The largest deviation over its bound, of a motion formed in positions and velocities."""
    part, gain = part_of(certificate), certificate.protocol.gain
    states = np.array([[[float(x) for x in chain] for chain in agent] for agent in part.initial_state or ()])
    states[:, :, 0] -= np.array([[float(x) for x in row] for row in part.protocol.offsets])
    L = np.ascontiguousarray(certificate.graph.laplacian().toarray())
    numbers = (float(gain.T), float(gain.rho1), float(gain.pole), float(part.alpha))
    run = moved(L.tobytes(), states.tobytes(), states.shape, numbers)
    bounds = part.deviation_bound(np.exp(-run.z))  # agents, derivatives, instants
    sizes = np.moveaxis(np.linalg.norm(run.states, axis=2), 0, -1)
    known = np.isfinite(bounds)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratios = np.where(known & (sizes > 1e-13 * sizes.max(initial=1e-300)), sizes / bounds, 0)
    return float(ratios.max(initial=0))


@pytest.mark.few(0)
def test_deviations_stay_within_their_bounds_on_every_kind_of_graph():
    for seed in (5, 12):
        certificate = certified(case_of(seed), ("paper", "best")[seed % 2])
        assert certificate.verdict == "certified" and worst_ratio(certificate) <= 1 + 1e-7
        holds(certificate)


def enclosed_deviations(certificate: Certificate, remaining: np.ndarray) -> np.ndarray:
    """Deviations of positions and velocities where a half, a quarter, .. of the time is left, (N, 2, M), from below.

    In rationals, less what the enclosure of the check is off by: ``Q x`` has no larger entry than ``x``.
    """
    part, gain = part_of(certificate), certificate.protocol.gain
    states, offsets = part.initial_state or (), part.protocol.offsets
    agents = Cascade(2, len(states[0]), part.protocol.plant, part.protocol.own, None, gain.exact)
    sizes = np.zeros((len(states), 2, len(remaining)))
    for m, at in enumerate(islice(halvings_of(checked_graph(part.structure), agents, states, offsets), len(remaining))):
        for i, x in [(i, [F(y) / at.scale for y in row]) for rows in at.columns for i, row in enumerate(rows)]:
            ends, _ = certificate.influence.apply(x)
            sizes[:, i, m] += [float(one - end) ** 2 for one, end in zip(x, ends, strict=True)]
        sizes[:, :, m] = np.maximum(np.sqrt(sizes[:, :, m]) - 2 * float(at.off), 0)
    sizes[:, 1] *= gain.value_at_remaining(remaining)
    return sizes


#: ``1 - t/T`` down to a sixty thousandth; bounds start again at the first ten.
HALVINGS = 2.0 ** -np.arange(1, 17)


def ratios_where_enclosed(part: CascadePart, sizes: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(sizes > 0, sizes / part.deviation_bound(HALVINGS), 0)


@pytest.mark.few(0)
@pytest.mark.parametrize("seed", range(160))
def test_bounds_are_above_where_agents_are_enclosed_by_no_integrator(seed: int):
    """From the beginning, from the third instant and from every one; what is near to its bound shows that it is."""
    certificate = certified(case_of(seed), ("paper", "best")[seed % 2], simulation=False)
    part, sizes = part_of(certificate), enclosed_deviations(certificate, HALVINGS)
    for count in (0, 3, 10) if part.instants else (0,):
        ratios = ratios_where_enclosed(replace(part, instants=part.instants[:count]), sizes)
        assert ratios.max() <= 1, (count, ratios.max(axis=0))
    assert ratios.max() > 0.25 or not part.instants


def with_smaller_roots(part: CascadePart) -> CascadePart:
    """Roots at the instants a hundred thousandth less."""
    return replace(part, instants=tuple(tuple(x and x * F(99_999, 10**5) for x in row) for row in part.instants))


def with_faster_functions(part: CascadePart) -> CascadePart:
    faster = [replace(V, rate=V.proved_rate * F(1001, 1000)) for V in part.functions]
    return replace(part, functions=tuple(faster))


def with_larger_alpha(part: CascadePart) -> CascadePart:
    return replace(
        part, protocol=CascadeProtocol.of(part.protocol.base, part.alpha * F(1001, 1000), part.protocol.offsets)
    )


@pytest.mark.few(0)
@pytest.mark.parametrize("change", [with_smaller_roots, with_faster_functions, with_larger_alpha])
def test_false_bounds_are_below_where_agents_are_enclosed_and_below_a_run(change: Any):
    """Also below one that is judged above :data:`~ptcc_certify.bounds.agents.run_against_bounds.RESOLVED`."""
    for seed in (5, 12, 13, 15):
        certificate = certified(case_of(seed), ("paper", "best")[seed % 2], simulation=False)
        part = part_of(certificate)
        assert ratios_where_enclosed(change(part), enclosed_deviations(certificate, HALVINGS)).max() > 1
        true, false = (each.compare(part.simulate()) for each in (part, change(part)))
        assert true is not None and not true.violated and false is not None and false.violated


@pytest.mark.campaign
@pytest.mark.parametrize("first", range(0, 160, 20))
def test_bounds_final_states_and_inputs_of_many_graphs(first: int):
    """160 graphs of every class, ``rho1`` next to 0 and not, formations, sliding variables."""
    ratios = []
    for seed in range(first, first + 20):
        certificate = certified(case_of(seed), ("paper", "best")[seed % 2])
        assert certificate.verdict == "certified"
        holds(certificate)
        ratios.append(worst_ratio(certificate))
    assert max(ratios) <= 1 + 1e-7 and max(ratios) > 0.5
    print(f"\nlargest ratio {max(ratios):.6f}, median {np.median(ratios):.3f}")


@pytest.mark.campaign
@pytest.mark.parametrize("first", range(0, len(CLASSES), 13))
def test_inputs_of_every_class_stay_within_their_bounds(first: int):
    """Gains by which the input is bounded, from just so to by far; velocities at random, or none."""
    ratios = []
    for seed in range(first, min(first + 13, len(CLASSES))):
        case, rng = case_of(seed), np.random.default_rng([34, seed])
        free = Agents(order=2, cascade=1, offsets=case.offsets)
        best = part_of(made(case.graph, case.protocol, None, free, method="best")).best
        if not best:
            continue
        k = 4 / best * F(str(rng.choice([1.02, 1.5, 3, 8])))
        gain = case.protocol.gain
        protocol = NominalProtocol(T=gain.T, rho1=gain.rho1, rho2=k, kappa=1)
        agents = Agents(order=2, cascade=F(str(rng.choice([1.02, 2, 4, 10]))) / k, offsets=case.offsets)
        v0 = case.v0 if rng.random() < 0.7 else None
        certificate = made(case.graph, protocol, case.x0, agents, v0=v0, method="best", simulation=True)
        seen = certificate.agents_comparison
        assert part_of(certificate).input is not None and seen is not None and seen.input is not None
        holds(certificate)
        ratios.append(seen.input)
    assert 0 < max(ratios) <= 1 + 1e-7 and np.median(ratios) > 0.1
    text = ", ".join(f"{x:.3g}" for x in np.quantile(ratios, [0, 0.25, 0.5, 0.75, 1]))
    print(f"\n{len(ratios)} graphs: input over its bound, least to largest by quarters: {text}")


# ---------------------------------------------------------------------- where they end


def ends_of(certificate: Certificate) -> list[Sequence[Fraction]]:
    final = part_of(certificate).final_state
    assert final is not None
    return [[m for m, _ in chain] for (chain,) in final]


def motion_in_full(certificate: Certificate, until: float) -> np.ndarray:
    """Positions and velocities at ``z = until``, from the closed loop as CasADi has it."""
    import casadi as ca

    part = part_of(certificate)
    loop = part.protocol.closed_loop(certificate.graph)
    slope, T = ca.Function("slope", [loop["t"], loop["x"]], [loop["ode"]]), float(certificate.protocol.gain.T)
    begin = np.array([[float(x) for x in chain] for (chain,) in part.initial_state or ()]).T.ravel()
    field = lambda z, x: T * math.exp(-z) * np.array(slope(-T * math.expm1(-z), x)).ravel()  # noqa: E731
    run = solve_ivp(field, (0, until), begin, "LSODA", rtol=1e-11, atol=1e-12)
    assert run.success
    return np.array(run.y[:, -1].reshape(2, -1))


@pytest.mark.few(0)
@pytest.mark.parametrize("graph", [TEAM, pytest.param(ENEMIES, marks=pytest.mark.campaign)], ids=["team", "enemies"])
def test_agents_end_at_rest_where_the_final_state_says(graph: SignedDigraph):
    N = graph.n_nodes
    certificate = made(graph, FAST, [5, 2, 4, -1][:N], Agents(order=2, cascade="1.5"), v0=[1, 0, 3, -2][:N])
    x, v = motion_in_full(certificate, 6)
    ends = ends_of(certificate)
    assert np.allclose(x, [float(end[0]) for end in ends], atol=1e-5) and [end[1] for end in ends] == [0] * N
    assert np.abs(v).max() < 1e-2
    holds(certificate)


def test_positions_settle_where_velocities_do_not():
    """``k Re lambda < 1``: the velocity grows without limit, and nothing is claimed of it."""
    slow = NominalProtocol(T=2, rho1=1, rho2="1/2", kappa=1)
    certificate = made(PAIR, slow, [5, 2], Agents(order=2, cascade=3), v0=[1, 0])
    x, v = motion_in_full(certificate, 14)
    ends = ends_of(certificate)
    assert all(len(end) == 1 for end in ends) and np.abs(v).max() > 10
    assert np.allclose(x, [float(end[0]) for end in ends], atol=1e-2)
    run = part_of(certificate).simulate()
    assert np.isnan(run.velocities[..., -1]).all() and np.isfinite(run.positions).all()
    holds(certificate)


@pytest.mark.few(0)
def test_without_velocities_allies_end_where_single_integrators_do():
    """``q(0) = -eta(0) e(0)``, whose mean is 0: the same place, whatever alpha."""
    plain = certify(TEAM, FAST, [5, 2, 4, -1], asks=Asks(method="paper", simulation=False))
    assert isinstance(plain, Certificate) and plain.final_state is not None
    for alpha in (1, 7):
        certificate = made(TEAM, FAST, [5, 2, 4, -1], Agents(order=2, cascade=alpha))
        assert [end[0] for end in ends_of(certificate)] == list(plain.final_state.states)


@pytest.mark.few(0)
def test_agents_that_begin_with_the_commanded_velocity_move_as_single_integrators():
    x0 = [5, 2, 4, -1]
    v0 = (float(FAST.gain.first) * -(TEAM.laplacian() @ np.array(x0, dtype=float))).tolist()
    certificate = made(TEAM, FAST, x0, Agents(order=2, cascade="0.7"), v0=v0)
    part = part_of(certificate)
    assert all(root.drive == 0 for root in part.roots)
    plain = certify(TEAM, FAST, x0, asks=Asks(method="paper", simulation=False))
    late = np.array([0.01, 1e-6])
    from_start = replace(part, instants=()).deviation_bound(late)[:, 0]
    assert np.allclose(from_start, plain.deviation_bound(late), rtol=1e-7, atol=0)
    assert (part.deviation_bound(late)[:, 0] < from_start / 5).all()
    run, single = part.simulate(), certify(TEAM, FAST, x0, asks=Asks(method="paper")).simulate()
    same = np.interp(single.t[single.t < 1.9], run.t, run.positions[0, 0])
    assert np.allclose(same, single.states[0][single.t < 1.9], atol=2e-2)
    holds(certificate)


# ---------------------------------------------------------------------- boundary cases


#: The rate that is proved of the pair, a little below 2.
RATE = part_of(made(PAIR, FAST, None, Agents(order=2, cascade=1))).best


def pair(rho2: Any, alpha: Any) -> Certificate:
    protocol = NominalProtocol(T=2, rho1=1, rho2=rho2, kappa=1)
    return made(PAIR, protocol, [3, 1], Agents(order=2, cascade=alpha), v0=[1, 2])


@pytest.mark.few(0)
def test_an_input_at_both_limits_is_not_claimed_to_be_bounded():
    rho2 = 4 / RATE  # rate k = 4
    both = part_of(pair(rho2, 1 / rho2))
    assert both.best == RATE and both.input is None and "as is rate/4" in both.unbounded[0][0]
    for certificate in (pair(rho2, 1 / rho2 + F(1, 1000)), pair(rho2 + F(1, 1000), 1 / (rho2 + F(1, 1000)))):
        assert part_of(certificate).input is not None and part_of(certificate).unbounded == ()
        holds(certificate)


@pytest.mark.few(0)
@pytest.mark.parametrize(
    ("rho2", "alpha", "names"),
    [
        (1, 3, ["rho2"]),
        (3, "1/5", ["cascade"]),
        (1, "1/5", ["rho2", "cascade"]),
        (4 / RATE, RATE / 4, ["cascade"]),
    ],
)
def test_what_keeps_the_input_from_being_bounded_is_told_with_its_mend(rho2: Any, alpha: Any, names: list[str]):
    part = part_of(pair(rho2, alpha))
    mends = {mend.field: mend.number for _, mend in part.unbounded}
    assert list(mends) == names and part.input is None
    again = part_of(pair(mends.get("rho2", rho2), mends.get("cascade", alpha)))
    assert again.input is not None


@pytest.mark.few(0)
def test_alpha_that_is_half_the_rate_is_no_exception():
    certificate = pair(6, RATE / 2)
    assert part_of(certificate).best == RATE and worst_ratio(certificate) <= 1 + 1e-7
    holds(certificate)


def test_one_agent_comes_to_rest_by_itself():
    certificate = made(SignedDigraph.from_edges([], ["a"]), FAST, [3], Agents(order=2, cascade=2), v0=[-1])
    part = part_of(certificate)
    assert certificate.verdict == "certified" and part.functions == () and part.final_state is not None
    ((place, rest),) = part.final_state[0]
    m = part.motion[0][1]
    assert rest == (0, 0) and abs(place[0] - (3 - m[0])) <= place[1] + m[1] and 0 < m[0] < 2
    holds(certificate)


@pytest.mark.few(0)
def test_single_leaders_and_disconnected_and_unbalanced_graphs():
    led = made(SignedDigraph.from_edges([("a", "b", -2)]), FAST, [3, 5], Agents(order=2, cascade=2), v0=[-1, 4])
    (a, _), (b, _) = ends_of(led)
    assert a == -b and a != 3
    apart = SignedDigraph.from_edges([("a", "b", 1), ("c", "d", -1)])
    certificate = made(apart, FAST, [1, 2, 3, 4], Agents(order=2, cascade=2))
    assert [end[0] for end in ends_of(certificate)] == [1, 1, 3, -3]
    unbalanced = made(ENEMIES, FAST, [1, 2, 3], Agents(order=2, cascade=2, offsets=[7, 8, 9]), v0=[1, 1, 1])
    assert ends_of(unbalanced) == [[7, 0], [8, 0], [9, 0]]
    for one in (led, certificate, unbalanced):
        holds(one)


def test_without_initial_states_the_certificate_holds_for_all():
    certificate = made(TEAM, FAST, None, Agents(order=2, cascade=2))
    part = part_of(certificate)
    assert certificate.verdict == "certified" and part.roots == () and part.final_state is None
    assert np.isinf(part.deviation_bound(np.array([0.5]))).all() and 0 < part.fall(0.01) < part.fall(0.5)
    holds(certificate)


def test_the_share_of_the_first_deviations_is_one_where_no_agent_has_a_bound_of_its_own():
    followers, slow = 130, NominalProtocol(T=1, rho1=1, rho2="1/2", kappa=1)
    star = SignedDigraph.from_edges([("L", k, 50) for k in range(followers)])
    agents = Agents(order=2, cascade=1)
    part = part_of(made(star, slow, [0] + [1] * followers, agents, method="perron"))
    assert part.functions and not np.isfinite(part.deviation_bound(np.array([0.01]))).all()
    # Every follower moves as the only one of a pair: x' = v, v' = u.
    pair = SignedDigraph.from_edges([("L", "f", 50)])
    run = part_of(made(pair, slow, [0, 1], agents)).simulate()
    later = (run.remaining >= 0.01) & (run.remaining < 1)
    left = np.abs(run.states[1, 0, 0, later])
    assert all(part.fall(q) >= share * (1 - 1e-6) for q, share in zip(run.remaining[later], left, strict=True))
    agreed = part_of(made(star, slow, [1] * (followers + 1), agents, method="perron", v0=[0] + [1] * followers))
    assert "q(0)" in agreed.first_ones and "q(0)" not in part.first_ones


def test_a_run_whose_weights_leave_float64_is_compared_as_far_as_they_go():
    steep = NominalProtocol(T=1, rho1=1, rho2=50, kappa=1)
    agents = Agents(order=2, cascade=90)
    seen = made(ENEMIES, steep, [1, -2, 3], agents, simulation=True).agents_comparison
    assert seen is not None and 0 < seen.decay <= 1 and seen.deviations and all(0 < x <= 1 for x in seen.deviations)


@pytest.mark.few(0)
def test_disturbances_under_sliding_variables_move_nothing():
    sliding = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=6, kappa=1, mu1=3, delta=2)
    certificates = [
        made(TEAM, protocol, [5, 2, 4, -1], Agents(order=2, cascade=2), v0=[1, 0, 0, -2])
        for protocol in (sliding, NominalProtocol(T=2, rho1=1, rho2=6, kappa=1))
    ]
    one, other = map(part_of, certificates)
    assert one.final_state == other.final_state and one.roots == other.roots
    assert one.input is not None and one.input == tuple(x + 3 for x in other.input or ())
    holds(certificates[0])


@pytest.mark.few(0)
def test_a_file_says_what_the_certificate_says(tmp_path: Path):
    first = made(TEAM, FAST, [[5, 1], [2, 2], [4, 3], [-1, 4]], Agents(order=2, cascade=2, offsets=[[0, 1]] * 4))
    first.save(tmp_path / "c.json")
    again = read_certificate(tmp_path / "c.json")
    assert isinstance(again, Certificate) and again == first
    one, other = part_of(first), part_of(again)
    assert one.protocol == other.protocol and one.input == other.input and one.roots == other.roots
    assert np.array_equal(one.deviation_bound(np.array([0.5])), other.deviation_bound(np.array([0.5])))


@pytest.mark.few(0)
def test_velocities_that_were_not_given_are_told_to_be_0():
    agents = Agents(order=2, cascade=2)
    still, moving = made(TEAM, FAST, [5, 2, 4, -1], agents), made(TEAM, FAST, [5, 2, 4, -1], agents, v0=[0, 0, 0, 1])
    assert "x(0) given, v(0) 0\n" in still.summary() and "x(0) given, v(0) given\n" in moving.summary()


def test_the_gain_of_the_protocol_does_not_depend_on_the_graph():
    laws = {
        part_of(made(graph, FAST, None, Agents(order=2, cascade=2))).protocol.latex() for graph in (TEAM, ENEMIES, PAIR)
    }
    assert len(laws) == 1


def test_a_coefficient_of_one_is_not_written():
    protocol = part_of(made(PAIR, FAST, None, Agents(order=2, cascade=1))).protocol
    assert protocol.law() == "(g^2 + g') e + g e' - g x'" and "1 g" not in protocol.latex()


REFUSED: list[tuple[dict[str, Any], dict[str, Any], str]] = [
    ({"order": 3}, {}, "it is proved of agents of order 2; these are of order 3"),
    ({"order": 1}, {}, "it is proved of agents of order 2; these are of order 1"),
    ({"order": 2, "drag": "0.1"}, {}, "double integrators without drag or forces"),
    ({"plant": [1, 0]}, {}, "double integrators without drag or forces"),
    ({"order": 2, "gain_cap": 30}, {}, "leave gain_cap out: it is proved of an unlimited gain"),
    ({"order": 2, "decay": 6}, {}, "leave decay out; its gains are its own"),
    ({"order": 2, "rest": 1}, {}, "leave rest out; it brings agents to rest by itself"),
    ({"order": 2, "cascade": 0}, {}, "cascade = 0 is outside its domain"),
    ({"order": 2, "cascade": -1}, {}, "cascade = -1 is outside its domain"),
    ({"order": 2, "cascade": "nan"}, {}, "cascade"),
    ({"order": 2}, {"v0": [1, 2]}, "2 values for 4 agents"),
    ({"order": 2}, {"at": 1}, "at is for single integrators"),
    ({"order": 2}, {"delta": 1}, "take the sliding-mode protocol"),
    ({"order": 2, "biases": [1, 0, 0, 0]}, {}, "biases fit no formation"),
    ({"order": 2, "cascade": 10**6}, {}, "cascade = 1e+06 is too large to enclose the common motion"),
]


@pytest.mark.parametrize(("agents", "options", "says"), REFUSED)
def test_what_is_not_proved_is_refused_with_the_reason(agents: Any, options: Any, says: str):
    with pytest.raises(ParameterError) as caught:
        made(TEAM, FAST, [5, 2, 4, -1], Agents(**{"cascade": 2, **agents}), **options)
    assert says in str(caught.value) and "\n" not in str(caught.value)


# ---------------------------------------------------------------------- course


@pytest.mark.few(0)
def test_the_course_is_above_the_solution_of_its_equations_and_near_it():
    """``R' = -b R + theta' S``, ``J' = -g J + R``, ``S = e^-G S(0) + J``, by another integrator."""
    for rho1, k, rate, alpha in ((1, 2, 3, 1), (10, 1, "0.2", "0.5"), ("0.01", 6, 2, 3), (3, 2, 7, "0.1")):
        gain = NominalProtocol(T=2, rho1=rho1, rho2=k, kappa=1).gain
        a, b, linear, pole = float(F(alpha)), float(F(rate)) / 2, float(gain.rho1), float(gain.pole)

        def slope(z: float, y: Sequence[float], a: float = a, b: float = b, rho1: float = linear, k: float = pole):
            rest = 2 * math.exp(-z)  # T - t
            eta = rho1 + k / rest
            theta, grows = k / (rest * eta) ** 2, 2 * rho1 * k * rest / (eta * rest) ** 4  # dtheta/ds
            R, J, S0 = y
            S, pace = S0 + J, eta * rest
            return [pace * (-b * R + grows * S), pace * (-(a + theta) * J + R), -pace * (a + theta) * S0]

        remaining = np.array([0.5, 0.1, 1e-3])
        run = solve_ivp(
            slope, (0, 7), [5.0, 0.0, 2.0], t_eval=-np.log(remaining), rtol=1e-11, atol=1e-60, first_step=1e-6
        )
        ours = course(gain, F(rate), F(alpha), Roots(F(2), F(0), F(5), F(0)), remaining)
        for bound, exact in ((ours.combined, run.y[0]), (ours.integral, run.y[1]), (ours.state, run.y[1] + run.y[2])):
            assert (exact <= bound * (1 + 1e-9)).all() and (bound <= 1.3 * exact).all()


def test_eigenvalues_that_lie_far_apart_do_not_loosen_bounds_of_the_cascade():
    """By ``q(0)`` alone the bounds of this team were 160 times its motion, of velocities 48,000 times."""
    wide = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", 200), ("c", "b", 100), ("c", "d", 300)])
    certificate = made(wide, FAST, [0, 1, 2, 3], Agents(order=2, cascade=2), method="best", simulation=True)
    holds(certificate)
    part = part_of(certificate)
    run = part.simulate()
    m = int(np.argmin(np.abs(run.remaining - 0.1)))
    eta = part.protocol.value(float(run.remaining[m]))
    seen = np.abs(run.scaled[:, 0, :, m]).max(axis=0) * [1, eta] * np.exp(-run.rate * run.clock[m] / 2)
    bound = part.deviation_bound(run.remaining[[m]])[:, :, 0].max(axis=0)
    assert (seen <= bound * (1 + 1e-7)).all() and (bound <= 20 * seen).all()


@pytest.mark.few(0)
@pytest.mark.parametrize("agents", [Agents(order=2), Agents(order=2, cascade=2)])
def test_bounds_of_agents_at_no_instant_up_to_the_deadline_are_refused(agents: Agents):
    graph = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    part = certify(graph, NominalProtocol(), [1, 2, 3], agents=agents, asks=Asks(simulation=False)).agents
    assert part is not None and part.deviation_bound(0.5).shape == (3, 2, 1)
    for remaining in (-0.5, math.nan, 2):
        with pytest.raises(ParameterError, match=r"^remaining"):
            part.deviation_bound(remaining)
