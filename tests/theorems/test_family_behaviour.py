"""What families do under every signal: the decision against members, products and replayed counterexamples."""

from __future__ import annotations

import random
from fractions import Fraction

import numpy as np
import pytest
from families import KINDS, random_family
from oracle_families import (
    has_common_kernel,
    member_laplacians,
    member_masks,
    replay,
    rest_behaviour,
    signed_edges,
    slowest_product,
)
from scipy.linalg import expm

from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.theorems.agreeing_groups import FamilyGroups
from ptcc_certify.theorems.contractions import explicit_rate
from ptcc_certify.theorems.family_behaviour import DEPENDS, FamilyComponent, decide

CHAIN = ("bipartite consensus", "interval bipartite consensus", "bipartite containment")
ALL = ("stability", *CHAIN)


def families(count: int, first: int = 0, wide: bool = True):
    for seed in range(first, first + count):
        rng = random.Random(seed)
        kind = KINDS[seed % len(KINDS)]
        yield rng, random_family(rng, kind, wide=wide and seed % 4 == 0)


def small_components(count: int, first: int = 0, signal: str = "any"):
    """Components of families of at most 5 nodes, with weights of one magnitude."""
    for seed in range(first, first + count):
        rng = random.Random(seed)
        made = random_family(rng, KINDS[seed % len(KINDS)], nodes=rng.randint(1, 5))
        for component in decide(made.family, signal):
            yield rng, component


def agrees_with_members(rng: random.Random, component: FamilyComponent, products: bool) -> bool:
    """Whether the definition gives the same: members have one kernel, and no product of many stays off it."""
    members = member_laplacians(component.family, rng)
    common, dimension = has_common_kernel(members, component.family.n_nodes)
    if component.behaviour == DEPENDS:
        return not common
    if not common or component.behaviour != rest_behaviour(component.family, dimension):
        return False
    if products:
        few = members if len(members) <= 8 else [members[0], *rng.sample(members[1:], 7)]
        before, after = slowest_product(few, 40), slowest_product(few, 160)
        return after < 0.8 * before + 1e-9
    return True


def replays(component: FamilyComponent) -> bool:
    """Whether each behaviour holds or is refuted by what is replayed as a counterexample."""
    for behaviour in ALL:
        witness = component.refutation(behaviour)
        if component.holds(behaviour) is None or (witness is None) != component.holds(behaviour):
            return False
        if witness is not None and not replay(component, witness):
            return False
    return True


# ---------------------------------------------------------------------- the decision


def test_families_do_what_they_were_built_to_do():
    for _, made in families(60):
        if made.behaviour is not None:
            components = decide(made.family)
            assert [c.behaviour for c in components] == [made.behaviour]


@pytest.mark.few(0)
def test_the_decision_agrees_with_kernels_of_members_and_with_slowest_products():
    for rng, component in small_components(24):
        assert agrees_with_members(rng, component, products=True)


def test_every_behaviour_holds_or_its_counterexample_replays_exactly():
    for _, made in families(24, 1000):
        for component in decide(made.family):
            assert replays(component)


@pytest.mark.campaign
def test_the_decision_agrees_on_many_families():
    for rng, component in small_components(2000, 10_000):
        assert agrees_with_members(rng, component, products=True)
    for _, made in families(2000, 20_000):
        for signal in ("any", "constant"):
            assert all(replays(component) for component in decide(made.family, signal))


@pytest.mark.few(0)
def test_a_family_of_one_graph_does_what_the_graph_does():
    for _, made in families(24, 3000):
        graph = made.family.modes[0].mandatory
        expected = [(c.nodes, c.claim) for c in analyse(graph).components]
        for signal in ("any", "constant"):
            for component, (nodes, claim) in zip(decide(Family.from_graph(graph), signal), expected, strict=True):
                assert tuple(component.nodes.tolist()) == nodes
                assert all(component.holds(b) == claim.holds(b) for b in ALL)


def test_adding_any_optional_edges_to_a_stable_family_leaves_it_stable():
    for seed in range(20):
        rng = random.Random(seed)
        graph = random_family(rng, "stability").family.modes[0].mandatory
        have = {(s, t) for s, t, _ in graph.edges}
        rows = [(s, t, w, w) for s, t, w in graph.edges]
        rows += [(s, t, -1, 1) for s in graph.labels for t in graph.labels if s != t and (s, t) not in have]
        assert decide(Family.from_intervals(rows))[0].behaviour == "stability"


def test_scaling_the_weights_of_a_mode_changes_no_behaviour():
    rows = [("a", "c", 1, 1), ("b", "c", 2, 2)]
    slow, fast = Family.from_intervals(rows), Family.from_intervals([(s, t, 7 * w, 7 * w) for s, t, w, _ in rows])
    assert decide(Family.switching([slow, fast]))[0].behaviour == "bipartite containment"


# ---------------------------------------------------------------------- large kernels


def chain_of_followers(n: int, change: Fraction = Fraction(0), uncertain: tuple[int, int] | None = None) -> Family:
    """Two leaders and ``n`` agents between them, each with its own row; the last has a mirror that hears it alone."""
    names = ["left", *(f"f{k}" for k in range(n)), "right"]
    rows = []
    for k in range(1, n + 1):
        rows += [(names[k - 1], names[k], k, k), (names[k + 1], names[k], k + 1, k + 1)]
    rows.append((names[n], "mirror", 1, 2))
    more = [] if uncertain is None else [(names[uncertain[0]], names[uncertain[1]], 0, 1)]
    first = Family.from_intervals([*rows, *more], names)
    second = [(s, t, 3 * a, 3 * b) for s, t, a, b in rows]
    second[2] = (*second[2][:2], second[2][2] + change, second[2][3] + change)
    return Family.switching([first, Family.from_intervals(second, names)])


def test_rows_in_equal_shares_are_common_however_many_they_are():
    assert decide(chain_of_followers(300))[0].behaviour == "bipartite containment"


@pytest.mark.parametrize("n", [20, 300, *(pytest.param(n, marks=pytest.mark.campaign) for n in (1500, 20_000))])
@pytest.mark.parametrize(("change", "uncertain"), [(Fraction(1, 10), None), (Fraction(0), (3, 9))])
def test_other_shares_or_an_edge_between_other_rows_are_refuted_at_any_size(n, change, uncertain):
    component = decide(chain_of_followers(n, change, uncertain))[0]
    assert component.behaviour == DEPENDS
    assert (component.counterexample.enclosure is None) == (n == 20)
    assert replay(component, component.counterexample)


@pytest.mark.few(0)
def test_a_false_enclosure_does_not_replay():
    component = decide(chain_of_followers(200, Fraction(1, 10)))[0]
    q = component.counterexample.enclosure
    radius = tuple(0 for _ in q.radius)
    forged = type(component.counterexample)(
        **{**vars(component.counterexample), "enclosure": type(q)(q.values, q.middle, radius, q.unit)}
    )
    assert not replay(component, forged)


def test_rows_that_agree_by_coincidence_are_undecided_when_many():
    family = chain_of_followers(300)
    rows = [(s, t, w, w) for s, t, w in family.modes[1].mandatory.edges]
    # Two agents of equal pull from both leaders, whatever the others do.
    rows += [(leader, agent, 1, 1) for leader in ("left", "right") for agent in ("twin", "other")]
    component = decide(Family.from_intervals([*rows, ("twin", "other", 0, 1)]))[0]
    assert component.behaviour is None
    assert component.holds("bipartite containment") is None
    assert component.holds("stability") is False
    assert component.refutation("bipartite consensus").kind == "two closed components"


# ---------------------------------------------------------------------- constant signals


def member_behaviours(rng: random.Random, component: FamilyComponent) -> list[str]:
    """What every member of a small family does, edges on and off."""
    result = []
    for mode in component.family.modes:
        for on in member_masks(mode, rng, 512):
            edges = [(mode.labels[s], mode.labels[t], w) for s, t, w in signed_edges(mode, on)]
            structure = analyse(SignedDigraph.from_edges(edges, nodes=mode.labels))
            closed = structure.closed_components
            if not any(c.balanced for c in closed):
                result.append("stability")
            elif len(closed) > 1:
                result.append("bipartite containment")
            else:
                result.append("bipartite consensus" if structure.balanced else "interval bipartite consensus")
    return result


def constant_agrees(rng: random.Random, component: FamilyComponent) -> bool:
    behaviours = set(member_behaviours(rng, component))
    if "stability" in behaviours:
        return component.behaviour == ("stability" if len(behaviours) == 1 else DEPENDS)
    return component.behaviour == max(behaviours, key=CHAIN.index)


@pytest.mark.few(0)
def test_constant_signals_do_what_every_member_does():
    for rng, component in small_components(18, 500, "constant"):
        assert constant_agrees(rng, component)


@pytest.mark.campaign
def test_constant_signals_do_what_every_member_does_on_many_families():
    for rng, component in small_components(3000, 50_000, "constant"):
        assert constant_agrees(rng, component)


def test_what_every_signal_does_constant_signals_do():
    for _, made in families(12, 7000):
        for one, other in zip(decide(made.family), decide(made.family, "constant"), strict=True):
            assert all(other.holds(b) for b in ALL if one.holds(b))
            assert replays(other)


def test_an_undirected_edge_of_unknown_sign_keeps_camps_unless_something_else_joins_its_ends():
    pair = [("a", "b", -1, 1)]
    joined = [("a", "b", -1, 1), ("b", "c", 1, 2), ("c", "a", 1, 2)]
    assert decide(Family.from_intervals(pair, undirected=True), "constant")[0].behaviour == "bipartite containment"
    assert decide(Family.from_intervals(joined, undirected=True), "constant")[0].behaviour == DEPENDS
    assert decide(Family.from_intervals([*pair, ("b", "a", -1, 1)]), "constant")[0].behaviour == DEPENDS


@pytest.mark.parametrize("least", [1, -2])
def test_of_an_edge_of_unknown_sign_the_one_that_breaks_the_camps_is_taken(least):
    family = Family.from_intervals([("a", "b", least, least + 1), ("b", "a", -1, 1)])
    component = decide(family, "constant")[0]
    assert component.behaviour == DEPENDS
    assert replay(component, component.counterexample)


def test_signals_of_another_name_are_refused():
    with pytest.raises(ValueError, match="slow"):
        decide(Family.from_intervals([("a", "b", 1, 2)]), "slow")


# ---------------------------------------------------------------------- groups


def run(rng: random.Random, component: FamilyComponent, x: np.ndarray, rounds: int, greedy: int | None) -> np.ndarray:
    """Return the last states of a signal: random, or one that keeps the size of an agent's state large."""
    members = [np.array(L, dtype=float) for L in member_laplacians(component.family, rng, 4)]
    letters = [expm(-0.7 * L) for L in members]
    tail = []
    for step in range(rounds):
        options = [P @ x for P in letters]
        x = options[rng.randrange(len(options))] if greedy is None else max(options, key=lambda y: abs(y[greedy]))
        if step >= rounds // 2:
            tail.append(x)
    return np.array(tail)


def groups_hold(rng: random.Random, component: FamilyComponent) -> bool:
    groups, n = FamilyGroups(component), component.family.n_nodes
    assert groups.bounded.tolist() == [v for v in range(n) if groups.bounded_by(v)]
    start = np.array([rng.choice((-1, 1)) * rng.uniform(0.5, 1) for _ in range(n)])
    start[groups.at_zero] *= 100
    for greedy in (None, rng.randrange(n)):
        tail = run(rng, component, start, 600, greedy)
        values = []
        for group in groups.agreeing:
            common = tail[:, group.nodes] * group.camps
            if np.ptp(common, axis=1)[-1] > 1e-6:
                return False
            values.append(abs(float(common[-1, 0])))
        if np.abs(tail[-1, groups.at_zero]).max(initial=0) > 1e-6:
            return False
        for node in range(n):
            bound = groups.bounded_by(node)
            limit = (
                np.abs(start[groups.sources]).max(initial=0)
                if bound is None
                else max((values[g] for g in bound), default=0)
            )
            if abs(tail[-1, node]) > limit + 1e-6:
                return False
    return True


def test_groups_agree_others_follow_and_the_rest_ends_at_0_under_greedy_signals():
    for rng, component in small_components(12, 900):
        assert groups_hold(rng, component)


@pytest.mark.campaign
def test_groups_agree_under_greedy_signals_on_many_families():
    for rng, component in small_components(1000, 90_000):
        assert groups_hold(rng, component)


def agreeing_sets(component: FamilyComponent) -> set[frozenset[int]]:
    """The largest sets that agree, by trying all sets of nodes."""
    family, n = component.family, component.family.n_nodes
    source, target, _ = family.union
    found: list[frozenset[int]] = []
    for bits in range(1, 2**n):
        nodes = np.flatnonzero([bits >> v & 1 for v in range(n)])
        inside = set(nodes.tolist())
        if all(s in inside for s, t in zip(source.tolist(), target.tolist(), strict=True) if t in inside):
            part = decide(family.restricted(nodes))
            if len(part) == 1 and part[0].behaviour == "bipartite consensus":
                found.append(frozenset(inside))
    return {one for one in found if not any(one < other for other in found)}


@pytest.mark.few(0)
def test_no_larger_set_agrees_by_the_theorem():
    for _, component in small_components(12, 1200):
        groups = FamilyGroups(component)
        assert {frozenset(g.nodes.tolist()) for g in groups.agreeing} == agreeing_sets(component)


# ---------------------------------------------------------------------- the explicit rate


def rate_holds(rng: random.Random, component: FamilyComponent) -> bool:
    """Whether windows of random signals leave at most what the rate says, and carry edges of one mode by eta."""
    rate, n = explicit_rate(component), component.family.n_nodes
    if rate is None:
        return n == 1 or component.behaviour not in ("stability", "bipartite consensus")
    members = [np.array(L, dtype=float) for L in member_laplacians(component.family, rng, 4)]
    h = float(rate.window) / rate.exponent
    whole = np.eye(n)
    for _ in range(rate.exponent):
        lengths = np.diff([0, *sorted(rng.uniform(0, h) for _ in range(rng.randint(0, 3))), h])
        step = np.eye(n)
        for length in lengths:
            step = expm(-rng.choice(members) * length) @ step
        if np.diag(step).min() < float(rate.eta) - 1e-12:
            return False
        whole = step @ whole
    if component.behaviour == "stability":
        left = np.abs(whole).sum(axis=1).max()
    else:
        g = component.gauge.astype(float)
        P = g[:, None] * whole * g
        left = max(np.maximum(P[k] - P[j], 0).sum() for k in range(n) for j in range(n))
    return left <= float(rate.contraction) + 1e-12 and rate.factor(rate.window * 3) == rate.contraction**3


@pytest.mark.few(0)
def test_no_product_of_exponentials_leaves_more_than_the_explicit_rate():
    for rng, component in small_components(48, 4000):
        assert rate_holds(rng, component)


def test_the_explicit_rate_of_two_agents_is_within_its_constants_of_the_slowest_signal():
    rate = explicit_rate(decide(Family.from_intervals([("a", "b", 1, 2)]))[0])
    slowest = np.exp(-0.5)  # weight 1 over a window of 1/2
    assert slowest <= rate.contraction == Fraction(5, 6)
    assert 1 - rate.contraction > (1 - slowest) / 3


def test_only_completed_windows_count_and_large_families_keep_their_numbers_apart():
    names = [f"v{k}" for k in range(3000)]
    chain = Family.from_intervals([(names[k], names[k + 1], 1, 2) for k in range(2999)])
    rate = explicit_rate(decide(chain)[0])
    assert (rate.eta, rate.exponent, rate.multiple) == (Fraction(1, 6), 2999, 1)
    assert rate.log10_decay_rate == pytest.approx(-2999 * np.log10(6) - np.log10(2999 / 2))
    assert rate.factor(rate.window / 2) == 1
