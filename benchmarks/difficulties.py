"""Random problems with three to six difficulties at once: ``python benchmarks/difficulties.py [FIRST LAST]``.

``python benchmarks/difficulties.py pairs [COUNT]`` tries each pair of them until so many (20) are certified, at most
four times as often.

Teams of 2 to 40 agents of every kind, of order 1 to 3, with messages that are late, lost or rounded, uncertain weights,
graphs that switch, leaders that move, disturbances, a cap of the gain, a formation. Each certificate is checked, up to
``SMALL`` agents by the standard library alone, too, and runs of members of the family with the oldest messages and with
those that jump are held against its bounds: deviations up to ``T``, what is left at ``T``, and inputs. The table tells
how many were certified, left open or refused, and why, the largest ratio of what was seen to what was proved, and
seconds. What is above 1 is printed with its seed, and counted in the exit code.
"""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this package, whichever is installed

from generators import all_classes, random_graph
from late_certificates import led_graph

import ptcc_certify as ptcc
from ptcc_certify.checker import check
from ptcc_certify.errors import HypothesisError, ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.simulation.late_messages import can_run
from ptcc_certify.simulation.virtual_positions import follow

#: Up to so many agents are checked by the standard library alone, too.
SMALL = 12
#: What is asked of a problem, by names; each is drawn with these arguments.
DIFFICULTIES = (
    *("late", "lost", "rounded", "uncertain", "switching", "moving", "disturbed", "capped", "team", "formation"),
)
#: What is paired with the others, too.
MORE = ("sliding", "growing")
#: Above this, rounding is no excuse.
MOST = 1 + 1e-6


def problem(seed: int, names: Sequence[str] = ()) -> tuple[Sequence[str], dict[str, Any]]:
    """Return the names of the difficulties, drawn unless they are given, and the arguments of ``certify``."""
    rng = np.random.default_rng(seed)
    names = names or [str(x) for x in rng.permutation(DIFFICULTIES)[: rng.integers(3, 7)]]
    n = int(np.exp(rng.uniform(np.log(2), np.log(40))))
    if rng.random() < 0.6:
        leaders = 1 if "uncertain" in names or "switching" in names or n < 3 else int(rng.integers(1, 3))
        graph = led_graph(rng, leaders, max(n - leaders, 1), signs="gauge" if leaders == 1 else "mixed")
    else:
        kinds = all_classes()
        graph = random_graph(rng, **kinds[rng.integers(len(kinds))][1]).graph
    n, T = graph.n_nodes, 1
    offsets = [int(x) for x in rng.integers(-5, 6, n)] if "formation" in names else None
    messages: dict[str, Any] = {}
    if "late" in names:
        messages["delay"] = f"{10 ** rng.uniform(-4, -1.5):.2g}"
    if "lost" in names:
        messages |= {"period": f"{10 ** rng.uniform(-4, -2):.2g}", "losses": int(rng.integers(1, 4))}
    if "rounded" in names:
        messages["value_error"] = f"{10 ** rng.uniform(-4, -1):.2g}"
    if "capped" in names:
        messages["gain_cap"] = int(rng.integers(10, 100))
    leaders_of: dict[str, Any] = {"speed": f"{rng.uniform(0.05, 1):.2f}"} if "moving" in names else {}
    if "disturbed" in names:
        leaders_of["disturbance"] = f"{rng.uniform(0.05, 1):.2f}"
    if "growing" in names:
        leaders_of["growth"] = f"{rng.uniform(0.05, 1):.2f}"
    asked: dict[str, Any] = {"graph": graph}
    if "switching" in names:
        factors = rng.integers(1, 5, graph.n_edges)
        edges = zip(graph.edges, factors.tolist(), strict=True)
        asked["graph"] = {
            "day": graph,
            "night": SignedDigraph.from_edges([(s, t, w * f) for (s, t, w), f in edges], graph.labels),
        }
    if "uncertain" in names:
        asked["uncertainty"] = f"{rng.integers(1, 30)}%"
    x0, v0 = ([f"{x:.1f}" for x in rng.uniform(-5, 5, n)] for _ in range(2))
    asked["x0"] = x0
    orders = rng.integers(1, 4, n) if "team" in names else None
    if orders is not None:
        still = ("moving" in names) & (graph.in_weight() == 0)
        v0 = ["0" if k or order == 1 else v for v, k, order in zip(v0, still, orders, strict=True)]
        asked["agents"] = ptcc.Agents(orders=orders.tolist(), offsets=offsets)
        asked["x0"] = ptcc.InitialState(x0, v0=v0)
    elif offsets is not None:
        asked["agents"] = ptcc.Agents(1, offsets=offsets)
    cap = messages.pop("gain_cap", None)
    if cap is not None and set(messages) - {"gain_cap"}:
        messages["gain_cap"] = cap
    elif cap is not None:
        asked["limits"] = ptcc.GainLimits(gain_cap=cap)
    if messages:
        asked["messages"] = ptcc.LateMessages(**messages)
    if leaders_of:
        asked["leaders"] = ptcc.MovingLeaders(**leaders_of)
    gains = {"rho1": 1, "rho2": int(rng.integers(2, 12)), "kappa": 1}
    if "sliding" in names:
        asked["protocol"] = ptcc.SlidingModeProtocol(T_r="0.5", T_s="0.5", **gains, mu1=2, mu2=1, mu3=1, delta=1)
    else:
        asked["protocol"] = ptcc.NominalProtocol(T=T, **gains)
    return names, asked


def ratios(made: Any, rng: np.random.Generator) -> list[tuple[str, float]]:
    """Return what runs of members show over what is proved."""
    late, protocol = made.late, made.protocol
    if late is None or not late.says_something or not can_run(protocol, late.messages):
        return []
    if late.forms and not late.messages.settles:  # targets walk; tests/checker/test_leader_groups.py runs about them
        return []
    if late.leaders is not None and late.leaders.growth:  # whose runs are in tests/bounds/test_growth.py
        return []
    if late.leaders is not None and not late.rows:  # disturbances of groups of leaders, of which there is no run
        return []
    of, members = late.case.structure, []
    for mode in of.modes if isinstance(of, Family) else ():
        largest = np.ones(mode.n_edges, dtype=bool) if mode.tied else rng.random(mode.n_edges) < 0.5
        members.append(mode.member(largest))
    found, x0 = [], [float(x) for x in made.initial_state]
    known = late.case.ends is not None and not any(radius for _, radius in late.case.ends)
    ends = np.array([[float(middle)] for middle, _ in late.case.ends]) if known else None
    for member in members or [late.case.graph]:
        for pattern in ("oldest", ("square", int(rng.integers(1000)))):
            run = ptcc.simulate_late(member, protocol, late.messages, x0, pattern=pattern, leaders=late.leaders)
            if late.vehicles is not None:
                run = follow(run, late.tracking_protocol, late.messages.vehicles)
            aims = ends if run.targets is None else run.targets
            if aims is None:
                continue
            followers = late.followers if late.rows else np.arange(len(run.states))
            off = np.abs(run.states - aims)[followers]
            early = run.t < 0.999 * float(protocol.gain.T)
            small = 1e-6 * (1 + np.abs(run.states).max())
            if late.rows:
                bound = late.deviation_bound(run.t[early])
                found.append(("deviation", float((off[:, early] / (bound + small)).max(initial=0))))
            at_T = int(np.argmax(run.remaining == 0))
            left = np.min([x[followers] for x in late.residuals], axis=0) if late.residuals else None
            if left is not None:
                found.append(("left", float((off[:, at_T] / (left + small)).max(initial=0))))
            push = late.inputs
            if push is not None:
                seen = np.nanmax(np.abs(run.input[:, run.remaining > 0]), axis=1)[followers]
                found.append(("input", float((seen / (push[followers] + small)).max(initial=0))))
    return found


class Tries:
    """What came of certifying problems, and of comparing runs with what was proved."""

    def __init__(self) -> None:
        self.counted, self.why = Counter[str](), Counter[str]()
        self.seconds, self.checks, self.sizes = list[float](), list[float](), list[int]()
        self.seen: dict[str, list[float]] = {}
        self.failures = 0

    def add(self, seed: int, names: Sequence[str], asked: dict[str, Any]) -> None:
        """Certify one problem, check it by all routes, and hold runs against it."""
        begin = time.perf_counter()
        try:
            made = ptcc.certify(
                asked.pop("graph"), asked.pop("protocol"), asked.pop("x0"), asks=ptcc.Asks(simulation=False), **asked
            )
        except (ParameterError, HypothesisError) as error:
            self.counted["refused"] += 1
            self.why[str(error).partition(";")[0][:110]] += 1
            return
        self.seconds.append(time.perf_counter() - begin)
        self.sizes.append(len(made.labels))
        code = int(made.assessment.exit_code)
        self.counted[{0: "certified", 3: "refuted", 4: "left open"}[code]] += 1
        document = json.loads(made.to_json())
        begin = time.perf_counter()
        routes = [check(document)] + ([check(document, stdlib=True)] if len(made.labels) <= SMALL else [])
        self.checks.append(time.perf_counter() - begin)
        if not all(report.accepted for report in routes):
            self.failures += 1
            print(f"REJECTED {seed} {names} {[report.reason for report in routes]}", flush=True)
        for kind, ratio in ratios(made, np.random.default_rng(seed)):
            self.seen.setdefault(kind, []).append(ratio)
            if ratio > MOST:
                self.failures += 1
                print(f"ABOVE {seed} {names} {kind} {ratio}", flush=True)


def pairs(count: int = 20) -> int:
    """Try each pair of difficulties; return how many bounds were exceeded."""
    failures = 0
    print("| pair | certified, open, refused | runs | seen/proved: most, median | most refused |")
    print("|---|---|---|---|---|")
    for place, names in enumerate(combinations((*DIFFICULTIES, *MORE), 2)):
        tries = Tries()
        for seed in range(4 * count):
            if tries.counted["certified"] < count:
                tries.add(seed, *problem(10_000 * (place + 1) + seed, names))
        values = [x for kind in tries.seen.values() for x in kind]
        ratio = f"{max(values):.4f}, {np.median(values):.3f}" if values else ""
        numbers = ", ".join(str(tries.counted[key]) for key in ("certified", "left open", "refused"))
        reasons = "; ".join(f"{reason} ({times})" for reason, times in tries.why.most_common(1))
        print(f"| {' and '.join(names)} | {numbers} | {len(values)} | {ratio} | {reasons} |", flush=True)
        failures += tries.failures
    return failures


def main(first: int = 0, last: int = 600) -> int:
    """Try the seeds from the first up to the last; return how many bounds were exceeded."""
    tries = Tries()
    for seed in range(first, last):
        tries.add(seed, *problem(seed))
    print(f"{last - first} problems: {dict(tries.counted)}")
    for reason, count in tries.why.most_common(12):
        print(f"  refused {count:4d}  {reason}")
    for name, values in (("certify", tries.seconds), ("check", tries.checks)):
        told = (f"{np.quantile(values, q):.2f}" for q in (0.5, 0.9, 1))
        sizes = f"{min(tries.sizes)} to {max(tries.sizes)}"
        print(f"{name}: seconds at the median, 90 % and most {', '.join(told)}; agents {sizes}")
    for kind, values in tries.seen.items():
        print(f"{kind}: {len(values)} runs, seen/proved at most {max(values):.4f}, median {np.median(values):.3f}")
    return tries.failures


if __name__ == "__main__":
    words = sys.argv[1:]
    of_pairs = words[:1] == ["pairs"]
    exceeded = (pairs if of_pairs else main)(*map(int, words[of_pairs:]))
    sys.exit(min(exceeded, 100))
