"""The diagonal Lyapunov matrix of the best margin: our interior-point method and general solvers through cvxpy.

    pip install ".[benchmarks]"
    OPENBLAS_NUM_THREADS=1 python benchmarks/diagonal_optimum.py [--sizes 50,100] [--cap 300] [--json FILE]

    maximise t   subject to   Omega L + L' Omega >= t I,   0 <= Omega <= I

for the Laplacians ``L`` of random digraphs: a ring and two random in-edges of each node, weights 0.5 to 2, 30% of
them negative (so that they are strongly connected and unbalanced). Every solve has a process of its own: ``MB`` is the
peak of its memory, with the interpreter and all imports. ``seconds`` begin with ``L`` and end with ``omega``, imports
excluded: what cvxpy spends on the program is contained; the median of three where one takes less than 5 s. ``CPU`` is
the processor time of the same, which a busy machine disturbs less; the cap is on it. All solvers run with their
default settings. One that meets a cap, or fails, is not asked for larger sizes.

``objective`` is proved: ``omega``, its largest entry 1, is rounded to multiples of 2^-30, and
``Omega L + L' Omega - t I`` is shown to be positive definite in exact arithmetic
(:func:`lmi.prove_sparse_positive_definite`), ``t`` a multiple of 2^-40. ``short`` is what it lacks of the best one of
that size, ``proved/found`` compares ``t`` with the smallest eigenvalue in floating point. ``--rate`` adds our optimum
of the best rate, with its dual bound.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import math
import os
import platform
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

import lmi

SIZES = (50, 100, 150, 300, 600, 1000, 2000)
OURS, RATE = "ours", "ours, best rate"
PEERS = {"Clarabel": "CLARABEL", "SDPA": "SDPA", "CVXOPT": "CVXOPT", "SCS": "SCS"}
PACKAGES = ("numpy", "scipy", "clarabel", "sdpa-python", "cvxopt", "scs")
#: Binary places of weights, of ``omega`` and of ``t``: the products are floats without rounding.
WEIGHT_PLACES, OMEGA_PLACES, T_PLACES = 10, 30, 40
LOSSES = (1e-10, 1e-9, 1e-8, 1e-7, 1e-6)
#: A solve that takes less is repeated.
SHORT_SECONDS, REPETITIONS = 5.0, 3


def laplacian(n: int) -> np.ndarray:
    rng = np.random.default_rng(n)
    W = np.zeros((n, n))
    for target in range(n):
        others = np.delete(np.arange(n), [target, (target + 1) % n])
        for source in ((target + 1) % n, *rng.choice(others, 2, replace=False)):
            weight = int(rng.integers(2 ** (WEIGHT_PLACES - 1), 2 ** (WEIGHT_PLACES + 1), endpoint=True))
            W[target, source] = weight / 2**WEIGHT_PLACES * (-1 if rng.random() < 0.3 else 1)
    return np.diag(np.abs(W).sum(axis=1)) - W


# ---------------------------------------------------------------------- one solve, in a process of its own


def by_cvxpy(L: np.ndarray, solver: str) -> np.ndarray:
    import cvxpy as cp

    n = len(L)
    omega, t = cp.Variable(n), cp.Variable()
    product = cp.diag(omega) @ sparse.csr_array(L)
    problem = cp.Problem(cp.Maximize(t), [product + product.T - t * np.eye(n) >> 0, omega >= 0, omega <= 1])
    problem.solve(solver=solver)
    if omega.value is None:
        raise RuntimeError(f"status {problem.status}")
    return np.maximum(omega.value, 0.0)


def solve_once(name: str, L: np.ndarray) -> tuple[np.ndarray, dict[str, float]]:
    if name == RATE:
        found = lmi.diagonal_lyapunov(L, objective="rate")
        return found.omega, {"rate": found.rate, "upper": found.upper}
    if name == OURS:
        return lmi.diagonal_lyapunov(L, solver="interior-point").omega, {}
    return by_cvxpy(L, PEERS[name]), {}


def proved_objective(L: np.ndarray, omega: np.ndarray) -> dict[str, Any]:
    """Return the largest ``t`` that is proved of ``omega / max(omega)``, and what floating point sees."""
    omega = np.rint(omega / omega.max() * 2**OMEGA_PLACES) / 2**OMEGA_PLACES
    S = sparse.csc_array(omega[:, None] * L)
    S = sparse.csc_array(S + S.T)
    found = float(np.linalg.eigvalsh(S.toarray())[0])
    for loss in LOSSES:
        t = math.floor((found - abs(found) * loss) * 2**T_PLACES) / 2**T_PLACES
        lowered = sparse.csc_array(S - t * sparse.eye_array(len(omega)))
        if lmi.prove_sparse_positive_definite(lowered) is not None:
            return {"objective": t, "found": found, "proved": True}
    return {"objective": found, "found": found, "proved": False}


def child(name: str, n: int, cap: int, memory: int) -> None:
    """Print the measurements of one solver at one size as JSON."""
    resource.setrlimit(resource.RLIMIT_AS, (memory * 2**30, memory * 2**30))
    if name in PEERS:
        import cvxpy  # noqa: F401
    L, seconds, cpu = laplacian(n), [], []
    solve_once(name, laplacian(5))  # what is imported only when it is used
    while len(seconds) < (REPETITIONS if not seconds or seconds[0] < SHORT_SECONDS else 1):
        used = math.ceil(time.process_time())
        resource.setrlimit(
            resource.RLIMIT_CPU, (used + cap, resource.RLIM_INFINITY)
        )  # beyond, SIGXCPU ends the process
        start, start_cpu = time.perf_counter(), time.process_time()
        omega, more = solve_once(name, L)
        seconds.append(time.perf_counter() - start)
        cpu.append(time.process_time() - start_cpu)
        resource.setrlimit(resource.RLIMIT_CPU, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10
    result = {"seconds": float(np.median(seconds)), "cpu": float(np.median(cpu)), "runs": len(seconds), "MB": peak}
    result |= more
    if name != RATE:
        result |= proved_objective(L, omega)
    print(json.dumps(result))


# ---------------------------------------------------------------------- the table


def measure(name: str, n: int, cap: int, memory: int) -> dict[str, Any]:
    command = [sys.executable, __file__, "--child", name, str(n), "--cap", str(cap), "--memory", str(memory)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = done.stdout.strip().splitlines()
    if done.returncode == 0 and lines and lines[-1].startswith("{"):
        return {"solver": name, "n": n, **json.loads(lines[-1])}
    if done.returncode == -signal.SIGXCPU:
        stopped = f"cap {cap} s"
    elif any(word in done.stderr for word in ("MemoryError", "bad_alloc", "memory allocation")):
        stopped = f"cap {memory} GB"
    else:
        stopped = f"failed: {(done.stderr.strip().splitlines() or [f'exit {done.returncode}'])[-1][:60]}"
    return {"solver": name, "n": n, "stopped": stopped}


def line(result: dict[str, Any], ours: dict[str, Any], best: float) -> str:
    head = f"{result['n']:>5}  {result['solver']:<16}"
    if "stopped" in result:
        return f"{head} {result['stopped']}"
    head += f" {result['seconds']:>9.3f} {result['cpu']:>8.3f}"
    if result["solver"] == RATE:
        gap = result["upper"] / result["rate"] - 1
        return f"{head} {'':>8} {result['MB']:>7.0f}  rate {result['rate']:.9f}, none exceeds it by more than {gap:.1e}"
    ratio = f"{result['seconds'] / ours['seconds']:.1f}" if "seconds" in ours else ""
    short = 1 - result["objective"] / best
    proved = f"1 - {1 - result['objective'] / result['found']:.0e}" if result["proved"] else "NOT PROVED"
    return f"{head} {ratio:>8} {result['MB']:>7.0f}  {result['objective']:.9f}  {max(short, 0):>8.1e}  {proved}"


def machine() -> str:
    models = [
        row.split(":")[1].strip() for row in Path("/proc/cpuinfo").read_text().splitlines() if "model name" in row
    ]
    threads = os.environ.get("OPENBLAS_NUM_THREADS", "all")
    return f"{models[0] if models else platform.machine()}, {os.cpu_count()} cores, BLAS threads: {threads}"


def versions() -> str:
    import cvxpy  # is of the distribution cvxpy-base, or of cvxpy, or of both

    found = [f"Python {platform.python_version()}", f"cvxpy {cvxpy.__version__}"]
    for package in PACKAGES:
        try:
            found.append(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            found.append(f"{package} missing")
    return ", ".join(found)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default=",".join(map(str, SIZES)), help="numbers of nodes (default %(default)s)")
    parser.add_argument("--solvers", default=",".join(PEERS), help="besides ours (default %(default)s)")
    parser.add_argument("--cap", type=int, default=300, help="CPU seconds of a solve (default 300)")
    parser.add_argument("--memory", type=int, default=16, help="GB of a process (default 16)")
    parser.add_argument("--rate", action="store_true", help="the best rate besides, ours only")
    parser.add_argument("--json", type=Path, help="file for the measurements")
    parser.add_argument("--child", nargs=2, metavar=("SOLVER", "N"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    peers = [name for name in options.solvers.split(",") if name]
    if unknown := set(peers) - set(PEERS):
        parser.error(f"unknown: {', '.join(sorted(unknown))}")
    if options.child:
        child(options.child[0], int(options.child[1]), options.cap, options.memory)
        return 0
    print(f"{machine()}\n{versions()}\n")
    columns = ("n", "solver", "seconds", "CPU", "to ours", "MB", "objective", "short", "proved/found")
    print("{:>5}  {:<16} {:>9} {:>8} {:>8} {:>7}  {:<11}  {:>8}  {}".format(*columns))
    names = [OURS, *peers, *([RATE] if options.rate else [])]
    results: list[dict[str, Any]] = []
    for n in map(int, options.sizes.split(",")):
        here = []
        for name in names:
            earlier = [r for r in results if r["solver"] == name and "stopped" in r]
            if earlier:
                here.append({"solver": name, "n": n, "stopped": f"{earlier[-1]['stopped']}"})
            else:
                here.append(measure(name, n, options.cap, options.memory))
        best = max((r["objective"] for r in here if r.get("proved")), default=math.nan)
        for result in here:
            print(line(result, here[0], best), flush=True)
        results += here
        if options.json:
            report = {"machine": machine(), "versions": versions(), "cap": options.cap, "results": results}
            options.json.write_text(json.dumps(report, indent=1) + "\n")
    proved = all(r["proved"] for r in results if r["solver"] == OURS and "proved" in r)
    return 0 if proved and not any("stopped" in r for r in results if r["solver"] == OURS) else 1


if __name__ == "__main__":
    sys.exit(main())
