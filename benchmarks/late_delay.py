"""The delay that is proved to do, over the one that does: ``python benchmarks/late_delay.py [FIRST LAST] [--whole]``.

Random graphs of single leaders and one to six followers, of mixed, positive and camp-like signs. What may be left at
the deadline is 5 % of the largest deviation from the final states at first. The delay that does is the longest constant
one of which a run leaves no more; those that are proved are the longest ones by rows (any size) and by steps.

With ``--whole``: graphs with a leader group, everything late, the own state too, under a capped gain. The delay that
does is the largest constant one at which a constant gain settles; those that are proved are the longest ones that some
function of the graph as it stands forgives, and that the delay LMI forgives.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from late_certificates import grouped_graph, led_graph

from ptcc_certify.bounds.delay.case import LateCase
from ptcc_certify.bounds.delay.delay_lmi import DelayLMIBounds
from ptcc_certify.bounds.delay.late_messages import LateBounds, bound_late
from ptcc_certify.bounds.delay.small_delays import SmallDelayBounds, delay_threshold
from ptcc_certify.bounds.final_state.of_graph import final_state
from ptcc_certify.certificate.certification import certify
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.model import NominalProtocol
from ptcc_certify.model.asks import Asks
from ptcc_certify.model.late_messages import LateMessages
from ptcc_certify.simulation.late_messages import simulate_late

#: What may be left, over the largest deviation at first; delays are found to 2 %.
LEFT, HALVINGS, SHORTEST = 0.05, 9, 2e-3


def longest(T: float, left: Callable[[Fraction], float], most: float) -> float | None:
    """Return about the longest delay that leaves no more than ``most``; None if none above 0.002 T does."""
    low, high, best = math.log(SHORTEST * T), math.log(T), None
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if left(Fraction(f"{math.exp(middle):.3e}")) <= most:
            best, low = math.exp(middle), middle
        else:
            high = middle
    return best


def shares(seed: int) -> tuple[float, float, bool] | None:
    """Return the longest delays proved by rows and by steps over that of the run, and whether ``rho2`` is 2 or more."""
    rng = np.random.default_rng(seed)
    signs = str(rng.choice(["mixed", "positive", "gauge"]))
    structure = analyse(led_graph(rng, int(rng.integers(1, 4)), int(rng.integers(1, 7)), signs=signs))
    T, rho1, rho2 = (Fraction(int(rng.integers(low, high)), 10) for low, high in ((2, 30), (1, 20), (2, 60)))
    protocol = NominalProtocol(T=T, rho1=rho1, rho2=rho2, kappa=1)
    x0 = [Fraction(int(x), 10) for x in rng.integers(-100, 100, structure.graph.n_nodes)]
    found = final_state(structure, x0)
    start, ends = np.array(x0, dtype=float), np.asarray(found, dtype=float)
    followers = structure.followers
    most = LEFT * float(np.abs(start - ends)[followers].max())

    def run(delay: Fraction) -> float:
        motion = simulate_late(structure.graph, protocol, LateMessages(delay=delay), start.tolist(), steps=300)
        return float(np.abs(motion.states[:, -1] - ends)[followers].max())

    def proved(residuals: Callable[[LateBounds], list[np.ndarray]]) -> Callable[[Fraction], float]:
        def left(delay: Fraction) -> float:
            each = residuals(bound_late(LateCase(structure, protocol, LateMessages(delay=delay), x0, found.intervals)))
            return float(np.min(each, axis=0).max()) if each else math.inf

        return left

    does = longest(float(T), run, most)
    if does is None or does > 0.98 * float(T):
        return None
    by_rows = longest(float(T), proved(lambda bounds: [row.residual() for row in bounds.rows]), most)
    by_steps = longest(float(T), proved(lambda bounds: [] if bounds.steps is None else [bounds.steps.bounds[-1]]), most)
    return (by_rows or 0) / does, (by_steps or 0) / does, rho2 >= 2


def whole_shares(seed: int) -> tuple[float, float]:
    """Return the longest delays that functions and the delay LMI forgive of a whole graph, over what it bears."""
    rng = np.random.default_rng(seed)
    graph, _ = grouped_graph(rng, int(rng.integers(1, 5)))
    x0 = [Fraction(int(x), 10) for x in rng.integers(-100, 100, graph.n_nodes)]
    protocol = NominalProtocol(T=1, rho1=1, rho2=3, kappa=1)
    messages = LateMessages("0.001", own_delay=True, gain_cap=20)
    cert = certify(graph, protocol, x0, asks=Asks(simulation=False))
    case = LateCase(cert.structure, protocol, messages, x0, influence=cert.influence, forms=cert.decaying_forms)
    by_functions = SmallDelayBounds(case).longest_delay()
    does = delay_threshold(cert.structure, 20)
    return by_functions / does, DelayLMIBounds(case).longest_delay() / does


def main() -> None:
    """Print quartiles over all seeds."""
    words = [word for word in sys.argv[1:] if word != "--whole"]
    first, last = (int(x) for x in (words if len(words) == 2 else (0, 200)))
    if len(words) < len(sys.argv[1:]):
        shares_of_all = np.array([whole_shares(seed) for seed in range(first, last)])
        print(f"{last - first} graphs; share of the delay that a constant gain bears, and the second over the first")
        columns = {"functions": shares_of_all[:, 0], "delay LMI": shares_of_all[:, 1]}
        columns["ratio"] = columns["delay LMI"] / columns["functions"]
        for name, column in columns.items():
            print(f"{name:10}" + "".join(f"{x:9.4f}" for x in np.quantile(column, [0, 0.25, 0.5, 0.75, 1])))
        return
    found = [case for seed in range(first, last) if (case := shares(seed)) is not None]
    print(f"{last - first} graphs, {len(found)} with a longest delay between 0.002 T and T; share of it that is proved")
    print(f"{'':22}{'least':>8}{'1/4':>8}{'1/2':>8}{'3/4':>8}{'largest':>9}")
    for what, cases in (("all", found), ("rho2 >= 2", [case for case in found if case[2]])):
        for k, name in enumerate(("rows", "steps")):
            quartiles = np.quantile([case[k] for case in cases], [0, 0.25, 0.5, 0.75, 1])
            print(f"{what:10}{len(cases):5}  {name:5}" + "".join(f"{x:8.3f}" for x in quartiles), flush=True)


if __name__ == "__main__":
    main()
