"""How near the certified rates come to the best possible one, and the bounds to the true norm, class by class.

    OPENBLAS_NUM_THREADS=1 python benchmarks/rate_ratio.py [--per-case 10] [--jobs 2] [--real FOLDER] [--output FILE]

An ensemble of random signed digraphs (generator and seeds below), and the real graphs of a folder if it is given. For
each class of Lyapunov functions: the ratio of the proved rate to the spectral one, and the proved bound of
``||E(t)|| / ||E(0)||`` over ``||exp(-L s)||`` on the range of ``L``, from ball arithmetic. Every bound is compared with
that norm, and the deviation of every agent from its final state with its own bound, from a random initial state.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from fractions import Fraction
from pathlib import Path
from typing import Any

import flint
import numpy as np

from ptcc_certify import NominalProtocol, SignedDigraph, analyse, certify, read_graph
from ptcc_certify.errors import PTCCError
from ptcc_certify.lyapunov.error_system import ErrorSystem
from ptcc_certify.lyapunov.search import LARGEST_OVERSHOOT, search_functions
from ptcc_certify.model.asks import Asks

CASES = ("1.1", "1.2", "2.1 one leader", "2.1 several", "2.2", "3.1 single leaders", "3.1 mixed", "3.2")
DECADES = (1, 6)
NEGATIVE = (0.3, 0.5)
CLASSES = ("paper", "perron", "lmi", "full", "best")
INSTANTS, EARLY = (0.5, 0.9, 0.99), (0.001, 0.05)
PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
SMALLEST, LARGEST = 3, 60


# ---------------------------------------------------------------------- the ensemble


def ensemble(per_case: int) -> list[tuple[str, int, int, float]]:
    """Case, seed, decades of weight, share of negative edges; the seed alone determines the graph of a case."""
    return [
        (case, 1_000_000 * c + 10_000 * d + 1_000 * n + k, DECADES[d], NEGATIVE[n])
        for c, case in enumerate(CASES)
        for d in range(len(DECADES))
        for n in range(len(NEGATIVE))
        for k in range(per_case)
    ]


def make(case: str, seed: int, decades: int, negative: float) -> SignedDigraph:
    """Draw a graph: N = 3..60, in-degree 1 to 4, weights log-uniform over the decades to three digits."""
    rng = np.random.default_rng(seed)
    size = int(rng.integers(SMALLEST, LARGEST + 1))
    groups = leader_groups(case, size, rng)
    edges: dict[tuple[int, int], int] = {}
    node = 0
    leaders: list[list[int]] = []
    for count, balanced in groups:
        nodes = list(range(node, node + count))
        edges.update(strong(nodes, balanced, negative, rng))
        leaders.append(nodes)
        node += count
    known = [v for nodes in leaders for v in nodes]
    followers = list(range(node, size))
    for i, v in enumerate(followers):
        # The first follower listens to every group, so that the graph is weakly connected.
        sources = {int(rng.choice(nodes)) for nodes in leaders} if i == 0 else {int(rng.choice(known))}
        others = [u for u in range(size) if u != v]
        wanted = int(rng.integers(1, 5))
        while len(sources) < min(wanted, len(others)):
            sources.add(int(rng.choice(others)))
        edges.update({(u, v): -1 if rng.random() < negative else 1 for u in sources})
        known.append(v)
    rows = [(u, v, weight(sign, decades, rng)) for (u, v), sign in sorted(edges.items())]
    return SignedDigraph.from_edges(rows)


def leader_groups(case: str, size: int, rng: np.random.Generator) -> list[tuple[int, bool]]:
    """Sizes and balance of the closed components of a case."""
    if case in ("1.1", "1.2"):
        return [(size, case == "1.1")]
    if case == "2.1 one leader":
        return [(1, True)]
    if case in ("2.1 several", "2.2"):
        return [(int(rng.integers(2, max(size // 2, 2) + 1)), case != "2.2")]
    if case == "3.1 single leaders":
        return [(1, True)] * int(rng.integers(2, min(4, size - 1) + 1))
    few = 2 if size >= 5 else 1
    share = max(size // 3, few)
    if case == "3.1 mixed":  # one balanced group, one of any kind
        other = bool(rng.random() < 0.5)
        first = int(rng.integers(1, share + 1))
        return [(first, True), (max(int(rng.integers(1, share + 1)), 1 if other else 2), other)]
    return [(max(int(rng.integers(2, share + 1)), 2) if share > 2 else 2, False) for _ in range(2)]


def strong(nodes: list[int], balanced: bool, negative: float, rng: np.random.Generator) -> dict[tuple[int, int], int]:
    """A ring and random in-edges up to in-degree 1 to 4, with signs; keys are (source, target)."""
    if len(nodes) == 1:
        return {}
    ring = [int(v) for v in rng.permutation(nodes)]
    pairs = {(ring[i - 1], ring[i]) for i in range(len(ring))}
    for v in nodes:
        wanted = int(rng.integers(1, 5))
        for u in rng.choice(nodes, size=min(wanted, len(nodes)), replace=False)[: wanted - 1]:
            if int(u) != v:
                pairs.add((int(u), v))
    if balanced:
        # Camps of such sizes that the share of edges between them is the wanted one.
        share = (1 - math.sqrt(1 - 2 * negative)) / 2
        camp = {v: -1 if rng.random() < share else 1 for v in nodes}
        return {(u, v): camp[u] * camp[v] for u, v in sorted(pairs)}
    signs = {pair: -1 if rng.random() < negative else 1 for pair in sorted(pairs)}
    if analyse(SignedDigraph.from_edges([(u, v, s) for (u, v), s in signs.items()])).balanced:
        first = next(iter(signs))  # every edge lies on a cycle: one sign more breaks the balance
        signs[first] = -signs[first]
    return signs


def weight(sign: int, decades: int, rng: np.random.Generator) -> str:
    return f"{sign * 10.0 ** rng.uniform(-decades / 2, decades / 2):.3g}"


# ---------------------------------------------------------------------- one graph


def ball(x: Fraction) -> flint.arb:
    return flint.arb(x.numerator) / flint.arb(x.denominator)


def log_norm(system: ErrorSystem, clock: float) -> float:
    """``ln ||exp(-A s)||`` on the error's subspace, from balls."""
    A = system.exact_matrix
    K = system.exact_basis or [[Fraction(int(i == j)) for j in range(len(A))] for i in range(len(A))]
    bits = 256
    while True:
        flint.ctx.prec = bits
        power = (flint.arb_mat([[ball(x) for x in row] for row in A]) * -flint.arb(clock)).exp()
        rows = (power * flint.arb_mat([[ball(x) for x in row] for row in K])).tolist()
        largest = rows[0][0]
        for x in (abs(x).mid() for row in rows for x in row):
            largest = x if x > largest else largest
        scaled = [[x / largest for x in row] for row in rows] if largest > 0 else []
        if scaled and max(float(x.rad()) for row in scaled for x in row) <= 1e-12:
            break
        bits *= 2
        if bits > 20_000:
            raise ArithmeticError("the exponential is not resolved")
    F = np.array([[float(x.mid()) for x in row] for row in scaled])
    R = np.linalg.qr(np.array([[float(x) for x in row] for row in K]), mode="r")
    return float(largest.log()) + math.log(float(np.linalg.norm(np.linalg.solve(R.T, F.T), 2)))


def deviations(graph: SignedDigraph, x0: list[Fraction], final: list[Fraction], clock: float) -> np.ndarray:
    """``|x_k - final_state_k|`` at a value of the clock, from balls."""
    flint.ctx.prec = 2048
    L = flint.arb_mat([[ball(x) for x in row] for row in graph.exact_laplacian()])
    X = (L * -flint.arb(clock)).exp() * flint.arb_mat([[ball(x)] for x in x0])
    if max(float(X[k, 0].rad()) for k in range(len(x0))) > 1e-270:
        raise ArithmeticError("the trajectory is not resolved")
    return np.array([float(abs(X[k, 0] - ball(final[k])).lower()) for k in range(len(x0))])


def examine(name: str, graph: SignedDigraph) -> dict[str, Any]:
    """Everything the table needs about one graph."""
    structure = analyse(graph)
    clocks = [float(PROTOCOL.gain.clock_at_remaining(1 - fraction)) for fraction in INSTANTS]
    rng = np.random.default_rng(len(graph.labels))
    x0 = [Fraction(int(v), 100) for v in rng.integers(-1000, 1001, graph.n_nodes)]
    started = time.perf_counter()
    best = certify(graph, PROTOCOL, x0, asks=Asks(simulation=False))
    seconds = time.perf_counter() - started
    if best.constant or best.spectral_rate is None:
        return {"name": name, "n": graph.n_nodes, "skipped": "nothing decays or no spectral rate"}
    system, spectral = ErrorSystem(structure), best.spectral_rate
    norms = [log_norm(system, s) for s in clocks]
    # Early, where Lyapunov functions of small overshoot constants are tight, the bounds are compared with the norm too.
    early = [float(PROTOCOL.gain.clock_at_remaining(1 - fraction)) for fraction in EARLY]
    judged = [*zip(early, [log_norm(system, s) for s in early], strict=True), *zip(clocks, norms, strict=True)]
    found = {kind: search_functions(system, kind, clocks) for kind in ("perron", "lmi", "full")}
    paper = [m for m in best.envelope.functions if m.kind == "paper"]
    functions = {
        "paper": paper,
        **{kind: list(search.functions) for kind, search in found.items()},
        "best": list(best.envelope.functions),
    }
    result: dict[str, Any] = {"name": name, "n": graph.n_nodes, "spectral": spectral, "seconds": seconds}
    result["verdict"] = best.verdict
    result["notes"] = [note for note in best.notes if "class" in note]
    worst, agents = 0.0, 0.0
    for kind, own in functions.items():
        in_error = [m for m in own if m.coordinates == "E"]
        rates = [m.rate_below for m in own]
        useful = [m.rate_below for m in own if m.overshoot <= LARGEST_OVERSHOOT]
        bounds = [
            min((math.log(m.overshoot) / 2 - m.rate_below * s / 2 for m in in_error), default=math.inf) for s in clocks
        ]
        result[kind] = {
            "ratio": max(rates, default=0.0) / spectral,
            "useful": max([0.0, *useful]) / spectral,
            "over": [math.exp(min(b - v, 700.0)) for b, v in zip(bounds, norms, strict=True)],
        }
        for m in in_error:
            for s, v in judged:
                worst = max(worst, math.exp(v - 0.5 * math.log(m.overshoot) + m.rate_below * s / 2))
    if best.final_state is not None:
        bound = best.deviation_bound([1 - fraction for fraction in INSTANTS])
        final = [Fraction(x) for x in best.final_state.states]
        for column, s in enumerate(clocks):
            if bound[:, column].min() > 1e-250:
                agents = max(agents, float((deviations(graph, x0, final, s) / bound[:, column]).max()))
    result["worst"], result["agents"] = worst, agents
    limit, reached = found["lmi"].diagonal_limit, found["lmi"].searched.get("lmi")
    result["gap"] = None if limit is None or reached is None else limit / reached - 1
    proved = [float(m.rate) for m in found["lmi"].functions]
    result["proved_of_limit"] = None if limit is None else max(proved, default=0.0) / limit
    useful = [float(m.rate) for m in found["lmi"].functions if m.overshoot <= LARGEST_OVERSHOOT]
    several = len(structure.closed_components) > 1 or structure.followers.size > 0
    result["composite"] = max(useful, default=0.0) / limit if several and limit else None
    result["undirected"] = structure.undirected
    return result


def work(task: tuple[str, Any]) -> dict[str, Any]:
    name, what = task
    try:
        graph = read_graph(what) if isinstance(what, str) else make(*what)
    except PTCCError as error:
        return {"name": name, "skipped": str(error)}
    started = time.perf_counter()
    try:
        found = examine(name, graph)
    except Exception as error:  # one failure is reported and does not cost the others
        return {"name": name, "n": graph.n_nodes, "skipped": f"FAILED: {type(error).__name__}: {error}"}
    return {**found, "measured": time.perf_counter() - started}


# ---------------------------------------------------------------------- the table


def quartiles(values: list[float]) -> str:
    q = np.quantile(values, [0.25, 0.5, 0.75]) if values else [math.nan] * 3
    return " ".join(f"{x:>9.4g}" for x in q)


def report(results: list[dict[str, Any]], title: str) -> list[str]:
    lines = [f"{title}: {len(results)} graphs, N = {min(r['n'] for r in results)}..{max(r['n'] for r in results)}", ""]
    lines.append(f"{'quartiles':<10}{'ratio':^30}{'overshoot <= 1e6':^30}")
    lines += [
        f"{kind:<10}" + " ".join(quartiles([r[kind][what] for r in results]) for what in ("ratio", "useful"))
        for kind in CLASSES
    ]
    lines += ["", f"{'bound / true norm':<18}" + "".join(f"{f'at {f:g} T':^30}" for f in INSTANTS)]
    for kind in CLASSES:
        own = [r for r in results if kind != "paper" or r["paper"]["over"][0] < 1e300]
        columns = [quartiles([r[kind]["over"][i] for r in own]) for i in range(len(INSTANTS))]
        left_out = f"  ({len(own)} graphs)" if len(own) < len(results) else ""
        lines.append(f"{kind:<18}" + " ".join(columns) + left_out)
    gaps = [r["gap"] for r in results if r["gap"] is not None]
    proved = [r["proved_of_limit"] for r in results if r["proved_of_limit"] is not None]
    composite = [r["composite"] for r in results if r["composite"] is not None]
    lines += [
        "",
        f"best diagonal rate: dual gap at most 1e-4 on {sum(g <= 1e-4 for g in gaps)} of {len(results)}, "
        f"median {np.median(gaps):.1e}, largest {max(gaps):.1e}",
        f"proved share of the dual limit: quartiles {quartiles(proved)}, least {min(proved):.4g}",
        f"composites, class lmi at overshoot constant <= 1e6 over the slowest block: quartiles {quartiles(composite)}",
        f"worst true norm over a Lyapunov function's bound {max(r['worst'] for r in results):.9f}",
        f"worst deviation of an agent over its bound {max(r['agents'] for r in results):.9f}",
        f"verdicts: {sum(r['verdict'] == 'certified' for r in results)} certified; "
        f"notes: {sum(bool(r['notes']) for r in results)}; seconds of certify: quartiles "
        f"{quartiles([r['seconds'] for r in results])}, longest {max(r['seconds'] for r in results):.1f}",
        "",
    ]
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--per-case", type=int, default=10, help="graphs per case, decades and share of negative edges")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--real", help="folder of edge lists, of which those up to 105 nodes are taken")
    parser.add_argument("--output", help="write everything measured to this JSON file")
    options = parser.parse_args()
    tasks: list[tuple[str, Any]] = [
        (f"{case} {seed}", (case, seed, d, f)) for case, seed, d, f in ensemble(options.per_case)
    ]
    if options.real:
        tasks += [(path.name, str(path)) for path in sorted(Path(options.real).glob("*.csv"))]
    results = []
    with ProcessPoolExecutor(options.jobs) as pool:
        for k, result in enumerate(pool.map(work, tasks, chunksize=1), start=1):
            results.append(result)
            if sys.stderr.isatty():
                print(f"\r{k} of {len(tasks)}", end="", file=sys.stderr)
    if options.output:
        Path(options.output).write_text(json.dumps(results, indent=1), encoding="utf-8")
    done = [r for r in results if "skipped" not in r]
    for r in results:
        if "skipped" in r:
            print(f"{r['name']}: {r['skipped']}")
    drawn = [r for r in done if not r["name"].endswith(".csv")]
    print("\n".join(report(drawn, "ensemble")))
    for case in CASES:
        own = [r for r in drawn if r["name"].startswith(case)]
        medians = "  ".join(f"{kind} {np.median([r[kind]['ratio'] for r in own]):.3f}" for kind in CLASSES)
        print(f"{case:<20} median ratio  {medians}")
    for decades, at in zip(DECADES, range(len(DECADES)), strict=True):
        own = [r for r in drawn if int(r["name"].split()[-1]) // 10_000 % 100 == at]
        over = np.median([r["best"]["over"][1] for r in own])
        print(
            f"{decades} decade(s): median ratio lmi {np.median([r['lmi']['ratio'] for r in own]):.3f}, "
            f"best {np.median([r['best']['ratio'] for r in own]):.3f}, bound / true norm at 0.9 T {over:.2f}"
        )
    if real := [r for r in done if r["name"].endswith(".csv")]:
        print()
        print("\n".join(report(real, "real graphs")))
        for r in real:
            row = "  ".join(f"{kind} {r[kind]['ratio']:.4f}" for kind in CLASSES)
            print(
                f"{r['name']:<24}N {r['n']:>3}  {row}  over at 0.9 T {r['best']['over'][1]:.2f}  {r['seconds']:.1f} s"
            )


if __name__ == "__main__":
    main()
