"""Simulate to 1 - t/T = 1e-6: CVODES here against SciPy's integrators on the plain clock, and expm_multiply.

    OPENBLAS_NUM_THREADS=1 python benchmarks/simulation.py [--largest 100000] [--cap SECONDS] [--json FILE]

The states at 50 instants, uniform in tau = -ln(1 - t/T), T = 1, gain 1 + 2/(1 - t), are wanted to within 1e-6 of the
largest entry of the initial state. Every integrator begins with rtol = atol = 1e-6 and goes on to 1e-7 .. 1e-11 until
it is that accurate; the row is that last run, the median of three if it is short. Each row runs in a process of its
own; a run that takes longer than the cap, or needs more than 12 GB, is stopped. Seconds are CPU time of one thread, so
that other work on the machine disturbs them little; the cap is on the wall clock.

Graphs: those of scale.py, a tenth of the agents listening to nobody, a twentieth in rings of four, the others to seven
random agents. *mild*: weights 0.5 to 2; *stiff*: weights log-uniform over three decades, 0.1 to 100.

Methods: ``CVODES`` is ``ptcc.simulate``, its set-up included. ``RK45``, ``LSODA``, ``BDF`` are SciPy's ``solve_ivp`` on
x' = -gain(t) L x with ``L`` sparse; BDF is given the sparse Jacobian, LSODA has no way to take one. ``expm_multiply``
goes on the clock s from instant to instant. Evaluations: products with ``L``, those within GMRES included; those of
BDF's sparse and LSODA's dense factors are not products and not counted.

Reference: Taylor series of exp(-L s) with steps of norm at most 4 until a term is below 1e-17, on the clock s. Its
roundings stay below e^4 times 1e-16 a step, as the norm of exp(-L s) never exceeds 1; for N = 100 it is compared with
``scipy.linalg.expm``.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
import platform
import resource
import statistics
import tempfile
import time
from collections.abc import Callable
from fractions import Fraction
from importlib.metadata import version
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scale import generated
from scipy import integrate, linalg, sparse
from scipy.sparse.linalg import expm_multiply

import ptcc_certify as ptcc

PROTOCOL = ptcc.NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
LEFT = 10 ** (-6 * np.arange(1, 51) / 50)  # 1 - t/T
CLOCK = PROTOCOL.gain.clock_at_remaining(LEFT)
TARGET = 1e-6
TOLERANCES = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)
METHODS = ("CVODES", "RK45", "LSODA", "BDF", "expm_multiply")
COLUMNS = ("graph", "N", "edges", "method", "tolerance", "error", "evaluations", "seconds", "x eval.", "x sec.", "note")
MEMORY = 12 * 10**9  # bytes of a run: sparse factors of random graphs fill up
SHORT = 3.0  # seconds; a run that takes longer is timed once


def graph_of(family: str, n: int) -> ptcc.SignedDigraph:
    W = sparse.csr_array(generated(n).adjacency()).astype(float)
    if family == "mild":
        W.data /= 1000
    else:
        W.data = np.sign(W.data) * 10 ** np.random.default_rng(n + 1).uniform(-1, 2, W.data.size)
    return ptcc.SignedDigraph.from_matrix(W, orientation="listens")


def start_of(n: int) -> np.ndarray:
    return np.random.default_rng(0).uniform(-1, 1, n)


def reference(L: Any, x: np.ndarray) -> np.ndarray:
    """Return the (N, 50) states by Taylor series on the clock ``s``."""
    norm, states = abs(L).sum(axis=1).max(), []
    for span in np.diff(CLOCK, prepend=0.0):
        steps = math.ceil(span * norm / 4)
        for _ in range(steps):
            term, power = x, 0
            while np.abs(term).max() > 1e-17:
                power += 1
                term = L @ term * (-span / steps / power)
                x = x + term
        states.append(x)
    return np.stack(states, axis=1)


class Counted(sparse.csr_array):
    """A sparse matrix that counts its products with a vector."""

    products = 0

    def _matmul_vector(self, other: np.ndarray) -> np.ndarray:
        Counted.products += 1
        return super()._matmul_vector(other)


def cvodes(graph: ptcc.SignedDigraph, x0: np.ndarray, tolerance: float) -> tuple[np.ndarray, int]:
    times = [1 - Fraction(left) for left in LEFT]
    run = ptcc.simulate(graph, PROTOCOL, x0, times=times, rtol=tolerance, atol=tolerance)
    return run.states, int(run.stats["rhs"])


def plain_clock(method: str, graph: ptcc.SignedDigraph, x0: np.ndarray, tolerance: float) -> tuple[np.ndarray, int]:
    L, J = graph.laplacian().tocsr(), -graph.laplacian().tocsc()

    def gain(t: float) -> float:
        return 1 + 2 / (1 - t)

    more: dict[str, Any] = {"jac": lambda t, _: gain(t) * J} if method == "BDF" else {}
    t = 1 - LEFT
    run = integrate.solve_ivp(
        lambda t, x: -gain(t) * (L @ x), (0, t[-1]), x0, method, t, rtol=tolerance, atol=tolerance, **more
    )
    if not run.success:
        raise RuntimeError(run.message)
    return run.y, run.nfev


def exponentials(graph: ptcc.SignedDigraph, x: np.ndarray, _: float) -> tuple[np.ndarray, int]:
    Counted.products, states = 0, []
    A = Counted(-graph.laplacian())
    for span in np.diff(CLOCK, prepend=0.0):
        x = expm_multiply(A * span, x, traceA=A.trace() * span)
        states.append(x)
    return np.stack(states, axis=1), Counted.products


def run_of(method: str) -> Callable[[ptcc.SignedDigraph, np.ndarray, float], tuple[np.ndarray, int]]:
    named = {"CVODES": cvodes, "expm_multiply": exponentials}
    return named.get(method) or (lambda graph, x0, tolerance: plain_clock(method, graph, x0, tolerance))


def measure(send: Any, family: str, n: int, method: str, states: str) -> None:
    """Run a method with tighter and tighter tolerances; send what each of them came to."""
    np.seterr(all="ignore")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    graph, x0, exact, run = graph_of(family, n), start_of(n), np.load(states), run_of(method)
    run(graph_of(family, 100), start_of(100), TARGET)  # imports and the like
    send.send({})
    try:
        for tolerance in TOLERANCES:
            seconds, error, count = [], math.inf, 0
            while not seconds or (error <= TARGET and seconds[0] < SHORT and len(seconds) < 3):
                began = time.process_time()
                found, count = run(graph, x0, tolerance)
                seconds.append(time.process_time() - began)
                error = float(np.abs(found - exact).max() / np.abs(x0).max())
            row = {"tolerance": tolerance, "error": error, "evaluations": count, "seconds": statistics.median(seconds)}
            done = error <= TARGET or method == "expm_multiply" or tolerance == TOLERANCES[-1]
            send.send(row | {"done": done})
            if done:
                return
    except Exception as error:
        send.send({"note": f"{type(error).__name__}: {error}"[:60], "done": True})


def in_own_process(family: str, n: int, method: str, states: str, cap: float) -> dict[str, Any]:
    """Return the row of a method; what it came to so far if a run meets the cap."""
    context = multiprocessing.get_context("spawn")
    receive, send = context.Pipe(duplex=False)
    process = context.Process(target=measure, args=(send, family, n, method, states), daemon=True)
    process.start()
    send.close()
    row: dict[str, Any] = {}
    limit = cap + 60  # the first message says that the graph is made
    try:
        while not row.get("done"):
            if not receive.poll(limit):
                row["note"] = f"stopped after {cap:g} s" + (" at the next tolerance" if "error" in row else "")
                break
            # A short run is repeated before it is told.
            row, limit = row | receive.recv(), cap + 3 * SHORT
    except EOFError:
        row["note"] = "the process died"
    process.kill()
    process.join()
    return {"graph": family, "N": n, "method": method} | row


def written(row: dict[str, Any], ours: dict[str, Any]) -> tuple[str, ...]:
    def number(key: str, form: str) -> str:
        return format(row[key], form) if key in row else "-"

    def ratio(key: str) -> str:
        return f"{row[key] / ours[key]:.3g}" if key in row and ours.get(key) else "-"

    tolerance = "-" if row["method"] == "expm_multiply" else number("tolerance", ".0e")
    sizes = tolerance, number("error", ".1e"), number("evaluations", "d"), number("seconds", ".3f")
    head = row["graph"], str(row["N"]), str(row["edges"]), row["method"]
    return *head, *sizes, ratio("evaluations"), ratio("seconds"), row.get("note", "")


def main() -> None:
    parser = argparse.ArgumentParser(description="Simulate to 1 - t/T = 1e-6, here and with SciPy.")
    parser.add_argument("--largest", type=int, default=100_000, help="agents, 100 to 100000 (default 100000)")
    parser.add_argument("--cap", type=float, default=120, help="seconds of a run (default 120)")
    parser.add_argument("--json", type=Path, help="write the rows to this file")
    wanted = parser.parse_args()
    versions = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "casadi"))
    print(f"Python {platform.python_version()}, {versions}; {platform.machine()}, {os.cpu_count()} CPUs\n")
    widths = (5, 6, 6, 13, 9, 7, 11, 8, 7, 7)
    line = "  ".join(f"{{:{'<' if i in (0, 3) else '>'}{w}}}" for i, w in enumerate(widths)) + "  {}"
    print(line.format(*COLUMNS).rstrip())
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for family, most in (("mild", 100_000), ("stiff", 10_000)):
            for n in (n for n in (100, 1000, 10_000, 100_000) if n <= min(most, wanted.largest)):
                graph = graph_of(family, n)
                exact, states = reference(graph.laplacian().tocsr(), start_of(n)), f"{folder}/{family}{n}.npy"
                np.save(states, exact)
                if n == 100:
                    last = linalg.expm(-graph.laplacian().toarray() * CLOCK[-1]) @ start_of(n)
                    assert np.abs(exact[:, -1] - last).max() < 1e-11
                ours: dict[str, Any] = {}
                for method in METHODS:
                    row = in_own_process(family, n, method, states, wanted.cap) | {"edges": graph.n_edges}
                    ours = ours or row
                    rows.append(row)
                    print(line.format(*written(row, ours)).rstrip(), flush=True)
    if wanted.json:
        wanted.json.write_text(json.dumps({"versions": versions, "rows": rows}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
