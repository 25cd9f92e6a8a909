"""Bounds of agents of order n against integrated motions: ``python benchmarks/agent_bounds.py [FIRST LAST]``.

The random cases are those of ``tests/agent_cases.py``: every class of graphs, n = 2 and 3, drag, unstable agents,
formations, caps. Ratios are of ``e^(r s/2)`` times what is bounded, so that nothing is below a floor; the rate is
compared with the spectral rate of the same gains, ``-2 max Re spec(A_0 - lambda b K)`` over the nonzero eigenvalues.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from agent_cases import agent_case

from ptcc_certify.certificate.agents_part import AgentsPart
from ptcc_certify.certificate.certification import certify
from ptcc_certify.model.asks import Asks, InitialState


def spectral_ratio(part: AgentsPart) -> float | None:
    """Return the proved rate over the spectral rate of the same gains at the deadline; None without a finite one."""
    n, k = part.order, float(part.protocol.gain.pole)
    if part.protocol.gain_cap is not None or not part.functions:
        return None
    A = np.eye(n, k=1) - np.diag(np.arange(n)) / k
    A[-1] -= list(map(float, part.protocol.own))
    K = np.array(list(map(float, part.protocol.gains)))
    values = np.linalg.eigvals(part.structure.graph.laplacian().toarray())
    values = values[np.abs(values) > 1e-7 * max(np.abs(values).max(), 1e-300)]
    slowest = max(np.linalg.eigvals(A - x * np.outer(np.eye(n)[-1], K)).real.max() for x in values)
    return float(part.matrix.rate) / (-2 * slowest)


def main() -> None:
    """Print the worst ratio of each kind, and quartiles."""
    first, last = (int(x) for x in (sys.argv[1:3] if len(sys.argv) > 2 else (0, 330)))
    ratios: dict[str, list[float]] = {"V": [], "x": [], "x'": [], "x''": [], "K eps": [], "u": [], "rate": []}
    accepted, begin = 0, time.perf_counter()
    for seed in range(first, last):
        case = agent_case(seed)
        initial, asks = InitialState(case.x0, derivatives=case.derivatives), Asks(method="paper")
        certificate = certify(case.graph, case.protocol, initial, agents=case.agents, asks=asks)
        part, seen = certificate.agents, certificate.agents_comparison
        accepted += certificate.verdict == "certified"
        if part is None or seen is None:
            continue
        ratios["V"].append(seen.decay)
        for name, value in zip(("x", "x'", "x''"), seen.deviations, strict=False):
            ratios[name].append(value)
        for name, value in (("K eps", seen.relative_input), ("u", seen.input), ("rate", spectral_ratio(part))):
            ratios[name] += [] if value is None else [value]
        if seed % 20 == 19 or seed == last - 1:
            tell(ratios, seed + 1 - first, accepted, time.perf_counter() - begin)


def tell(ratios: dict[str, list[float]], cases: int, accepted: int, seconds: float) -> None:
    """Print what was met so far."""
    print(f"{cases} cases, {accepted} certified, {seconds:.0f} s")
    for name, values in ratios.items():
        if not values:
            continue
        quartiles = ", ".join(f"{x:.4f}" for x in np.quantile(values, [0, 0.25, 0.5, 0.75, 1]))
        print(f"{name:6} {len(values):4}  {quartiles}", flush=True)


if __name__ == "__main__":
    main()
