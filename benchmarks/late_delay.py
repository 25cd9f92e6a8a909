"""The delay that is proved to do, over the one that does: ``python benchmarks/late_delay.py [FIRST LAST]``.

Random graphs of single leaders and one to six followers, of mixed, positive and camp-like signs. What may be left at
the deadline is 5 % of the largest deviation from the final states at first. The delay that does is the longest constant
one of which a run leaves no more; those that are proved are the longest ones by rows (any size) and by steps.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from late_certificates import led_graph

from ptcc_certify.bounds.final_state import final_state
from ptcc_certify.bounds.late_messages import LateBounds, bound_late
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.protocols import NominalProtocol
from ptcc_certify.protocols.late_messages import LateMessages
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
            each = residuals(bound_late(structure, protocol, LateMessages(delay=delay), x0, found.intervals))
            return float(np.min(each, axis=0).max()) if each else math.inf

        return left

    does = longest(float(T), run, most)
    if does is None or does > 0.98 * float(T):
        return None
    by_rows = longest(float(T), proved(lambda bounds: [row.residual() for row in bounds.rows]), most)
    by_steps = longest(float(T), proved(lambda bounds: [] if bounds.steps is None else [bounds.steps.bounds[-1]]), most)
    return (by_rows or 0) / does, (by_steps or 0) / does, rho2 >= 2


def main() -> None:
    """Print quartiles over all seeds."""
    first, last = (int(x) for x in (sys.argv[1:3] if len(sys.argv) > 2 else (0, 200)))
    found = [case for seed in range(first, last) if (case := shares(seed)) is not None]
    print(f"{last - first} graphs, {len(found)} with a longest delay between 0.002 T and T; share of it that is proved")
    print(f"{'':22}{'least':>8}{'1/4':>8}{'1/2':>8}{'3/4':>8}{'largest':>9}")
    for what, cases in (("all", found), ("rho2 >= 2", [case for case in found if case[2]])):
        for k, name in enumerate(("rows", "steps")):
            quartiles = np.quantile([case[k] for case in cases], [0, 0.25, 0.5, 0.75, 1])
            print(f"{what:10}{len(cases):5}  {name:5}" + "".join(f"{x:8.3f}" for x in quartiles), flush=True)


if __name__ == "__main__":
    main()
