"""Real graphs up to 120 nodes: seconds, verdict, and how far the proved bounds lie above what the motion does.

    OPENBLAS_NUM_THREADS=1 python benchmarks/real_graphs.py FOLDER.. [--json FILE] [--before FILE] [--cap 60]

``certify`` with everything: best method, CVODES run, independent check; default gains, ``rho2 kappa = 2``, a random
initial state. Each graph in a process of its own, which is ended after ``--cap`` seconds; CPU seconds are those of
the one call and its processes, without imports. Bound over true: the energy of the input, and the largest deviation
of an agent from its final state at T/2, by matrix exponentials. ``--before`` compares with the JSON of an earlier
run, such as one of another version (PYTHONPATH) on the same machine.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import expm

LARGEST = 120
#: Cells that grow by 7% up to ``z = ln(T/(T - t)) = 20``, ten Gauss nodes in each.
EDGES = np.append(0.0, np.geomspace(1e-6, 20, 200))
NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)
Z = (EDGES[:-1, None] + np.diff(EDGES)[:, None] * (NODES + 1) / 2).ravel()
DZ = (np.diff(EDGES)[:, None] * WEIGHTS / 2).ravel()


def energy(L: np.ndarray, still: int, protocol: Any, x: np.ndarray) -> float:
    """``int ||u||^2 dt`` of an initial state."""
    basis = np.linalg.svd(L)[0][:, : len(L) - still]  # of what decays
    inside, E, gain, T = basis.T @ L @ basis, -basis.T @ (L @ x), protocol.gain, float(protocol.T)
    total, before = 0.0, 0.0
    for clock, z, dz in zip(gain.clock_at_tau(Z), Z, DZ, strict=True):
        E, before = expm(-inside * (clock - before)) @ E, clock
        total += dz * T * np.exp(-z) * (gain.value_at_remaining(np.exp(-z)) * np.linalg.norm(E)) ** 2
    return total


def one(path: str) -> dict[str, Any]:
    """Everything about one graph; nothing of one that is too large or refused."""
    import cvxpy  # noqa: F401  its import is not counted

    from ptcc_certify import NominalProtocol, certify, read_graph
    from ptcc_certify.errors import PTCCError

    try:
        graph = read_graph(path)
    except PTCCError as error:
        return {"refused": str(error)}
    if graph.n_nodes > LARGEST:
        return {"refused": f"{graph.n_nodes} nodes"}
    protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    x0 = (np.random.default_rng(0).integers(-1000, 1001, graph.n_nodes) / 100).tolist()
    began, wall = sum(os.times()[:4]), time.perf_counter()
    cert = certify(graph, protocol, x0)
    verdict = cert.verdict
    seconds, wall = sum(os.times()[:4]) - began, time.perf_counter() - wall
    L = graph.laplacian().toarray()
    ends = np.asarray(cert.final_state)
    true = np.abs(expm(-L * protocol.gain.clock(0.5)) @ np.array(x0) - ends)
    bound = cert.deviation_bound([0.5])[:, 0]
    effort = cert.effort
    proved = effort.energy.value if effort is not None and effort.energy is not None else math.nan
    seen = energy(L, sum(c.balanced for c in cert.structure.closed_components), protocol, np.array(x0))
    moves = true > 1e-9 * np.abs(x0).max()  # below, it is rounding that is seen
    ratios = np.quantile(bound[moves] / true[moves], [0.25, 0.5, 0.75]).tolist() if moves.any() else []
    return {
        "nodes": graph.n_nodes,
        "seconds": seconds,
        "wall": wall,
        "verdict": verdict,
        "share": float(cert.rate) / cert.spectral_rate if cert.rate and cert.spectral_rate else math.nan,
        "energy": float(proved) / seen if seen > 0 else math.nan,
        "deviation": float(bound.max() / true.max()) if moves.any() else math.nan,
        "agents": ratios,
    }


def row(path: Path, cap: float) -> dict[str, Any]:
    """The same in a process of its own."""
    command = [sys.executable, __file__, "--one", str(path)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=cap, check=False)
    except subprocess.TimeoutExpired:
        return {"refused": f"no answer in {cap:g} s"}
    return json.loads(done.stdout) if done.returncode == 0 else {"refused": done.stderr.splitlines()[-1]}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--before", type=Path)
    parser.add_argument("--cap", type=float, default=60.0)
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(one(str(options.folders[0]))))
        return
    before = json.loads(options.before.read_text()) if options.before else {}
    keys = ("seconds", "share", "energy", "deviation")
    print(f"{'graph':<30}{'N':>4}" + "".join(f"{key:>12}{'before':>10}" for key in keys) + "  verdict")
    found: dict[str, Any] = {}
    for path in sorted(p for folder in options.folders for p in folder.glob("*.csv")):
        this = found[path.stem] = row(path, options.cap)
        if "refused" in this:
            print(f"{path.stem:<30}     {this['refused']}", flush=True)
            continue
        past = before.get(path.stem, {})
        pairs = "".join(f"{this[k]:>12.6g}{past.get(k, math.nan):>10.4g}" for k in keys)
        print(f"{path.stem:<30}{this['nodes']:>4}{pairs}  {this['verdict']}", flush=True)
    for key in keys:
        for name, table in (("", found), (" before", before)):
            values = [r[key] for r in table.values() if math.isfinite(r.get(key, math.nan))]
            if values:
                q = ", ".join(f"{x:.4g}" for x in np.quantile(values, [0.25, 0.5, 0.75, 1]))
                print(f"{key + name:<18} of {len(values)} graphs: quartiles and largest {q}")
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
