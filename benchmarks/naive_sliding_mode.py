"""Example 4, event by event and the naive way: errors, evaluations and seconds from one run.

The naive way integrates (47)-(48) as printed, ``x' = u + d`` and ``varsigma' = -u^nom``, in plain time with NumPy's
``sign``: by SciPy's adaptive methods and by RK4 with a fixed step. The yardstick is the exact final state
``Q (x(0) - sigma(0))`` at ``T_r + T_s``. Every row runs in a process of its own, and a naive run that stalls is
stopped by a cap of seconds or of evaluations.

Usage
-----
python benchmarks/naive_sliding_mode.py [--cap SECONDS] [--evaluations NUMBER]
"""

from __future__ import annotations

import argparse
import contextlib
import multiprocessing
import os
import platform
import statistics
import time
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
from scipy import integrate

import ptcc_certify as ptcc
from ptcc_certify.examples import EXAMPLES, load_graph

EXAMPLE = EXAMPLES[4]
PROTOCOL: Any = EXAMPLE.protocol()
X0, SIGMA0 = (np.array(str(text).split(","), dtype=float) for text in (EXAMPLE.x0, EXAMPLE.sigma0))
METHODS: dict[str, tuple[str, dict[str, float]]] = {
    "event by event": ("ours", {}),
    "boundary layer 1e-2": ("ours", {"boundary_layer": 1e-2}),
    "RK45, defaults": ("RK45", {}),
    "RK45, 1e-6/1e-9": ("RK45", {"rtol": 1e-6, "atol": 1e-9}),
    "Radau, defaults": ("Radau", {}),
    "BDF, defaults": ("BDF", {}),
    "LSODA, defaults": ("LSODA", {}),
    **{f"RK4 {h}, t = i h": ("RK4", {"step": float(h)}) for h in ("1e-2", "1e-3", "1e-4", "1e-5")},
    **{f"RK4 {h}, t += h": ("RK4", {"step": float(h), "add": True}) for h in ("1e-2", "1e-3", "1e-4", "1e-5")},
}
OURS = next(iter(METHODS))
COLUMNS = ("method", "error at T", "least error", "|sigma|", "evaluations", "seconds", "x eval.", "x sec.", "came to")
FAST = 5.0  # seconds; a naive run that takes longer is timed once


@dataclass
class Run:
    """One run: its error at T, the least error and the largest |sigma| of all its steps past T_r, and its cost."""

    error: float | None
    least: float | None
    sigma: float | None
    evaluations: int
    seconds: float
    note: str


class NaiveLoop:
    """The closed loop (47)-(48) of Example 4 as printed; ``v`` stacks x and varsigma."""

    def __init__(self, graph: ptcc.SignedDigraph):
        if EXAMPLE.disturbance != "sin(2*k*t + pi/3)":
            raise ValueError("Example 4 has another disturbance than the one written below")
        p = PROTOCOL
        self.n, self.L, self.agents = graph.n_nodes, graph.laplacian().toarray(), np.arange(1, graph.n_nodes + 1)
        self.T_r, self.T = float(p.T_r), float(p.T)
        self.rho1, self.pole = float(p.rho1), float(p.rho2 * p.kappa)
        self.mu1, self.mu2, self.reaching_pole = float(p.mu1), float(p.mu2), float(p.mu3 * p.kappa)
        self.evaluations = 0

    def __call__(self, t: float, v: np.ndarray) -> np.ndarray:
        self.evaluations += 1
        x, sigma = v[: self.n], self.sigma(v)
        gain = self.rho1 + (self.pole / (self.T - t) if t < self.T else 0)
        reaching = self.mu2 + (self.reaching_pole / (self.T_r - t) if t < self.T_r else 0)
        nominal = -gain * (self.L @ x)
        d = np.sin(2 * self.agents * t + np.pi / 3)
        return np.concatenate([nominal - self.mu1 * np.sign(sigma) - reaching * sigma + d, -nominal])

    def sigma(self, v: np.ndarray) -> np.ndarray:
        return v[: self.n] + v[self.n :]


class RK4:
    """The classical Runge-Kutta method with a fixed step, with the interface of SciPy's solvers.

    The instants are ``i step``, or sums of steps if ``add``: the rounding decides how close to a pole a stage falls.
    """

    def __init__(self, f: NaiveLoop, t: float, y: np.ndarray, t_bound: float, step: float, add: bool = False):
        self.f, self.t, self.y, self.status = f, t, y, "running"
        self.i, self.h, self.last, self.add = 0, step, round(t_bound / step), add

    def step(self) -> None:
        f, t, y, h = self.f, self.t, self.y, self.h
        a = f(t, y)
        b = f(t + h / 2, y + h / 2 * a)
        c = f(t + h / 2, y + h / 2 * b)
        d = f(t + h, y + h * c)
        self.i += 1
        self.t, self.y = t + h if self.add else self.i * h, y + h / 6 * (a + 2 * b + 2 * c + d)
        self.status = "running" if self.i < self.last else "finished"


def naive(graph: ptcc.SignedDigraph, exact: np.ndarray, method: str, options: Any, cap: float, most: int) -> Run:
    """Step SciPy's solver, as ``solve_ivp`` does, or RK4, until the end or a cap."""
    loop, note = NaiveLoop(graph), ""
    times, states = [0.0], [np.concatenate([X0, SIGMA0 - X0])]
    began = time.perf_counter()
    kind: Any = RK4 if method == "RK4" else getattr(integrate, method)
    solver = kind(loop, 0.0, states[0], loop.T, **options)
    while solver.status == "running" and not note:
        solver.step()
        times.append(solver.t)
        states.append(solver.y)
        if time.perf_counter() - began > cap:
            note = f"cap of {cap:g} s"
        elif loop.evaluations > most:
            note = f"cap of {most:g} evaluations"
    seconds = time.perf_counter() - began
    after = np.array(states)[np.array(times) > loop.T_r].T
    errors = np.abs(after[: loop.n] - exact[:, None]).max(axis=0)
    least, sigma = (float(errors.min()), float(np.abs(loop.sigma(after)).max())) if errors.size else (None, None)
    if solver.status == "finished":
        return Run(float(errors[-1]), least, sigma, loop.evaluations, seconds, "T")
    left = loop.T - solver.t
    where = f"t = {solver.t:.6f}" if left > 1e-6 else f"T - {left:.1e}"
    return Run(None, least, sigma, loop.evaluations, seconds, f"{where}, stopped: {note or 'step too small'}")


def ours(graph: ptcc.SignedDigraph, exact: np.ndarray, options: Any) -> Run:
    began = time.perf_counter()
    run = ptcc.simulate(graph, PROTOCOL, X0, sigma0=SIGMA0, disturbance=EXAMPLE.disturbance, **options)
    seconds = time.perf_counter() - began
    after = (run.t > float(PROTOCOL.T_r)) & (run.t <= float(PROTOCOL.T))
    errors = np.abs(run.states[:, after] - exact[:, None]).max(axis=0)
    sigma = float(np.abs(run.sliding.sigma[:, after]).max())
    return Run(float(errors[-1]), float(errors.min()), sigma, run.stats["rhs"], seconds, "T")


def measure(send: Any, graph_name: str, label: str, cap: float, most: int) -> None:
    """Run a method, in its own process, and again if it is fast; send the run with the median of the seconds."""
    np.seterr(all="ignore")
    graph, (method, options) = load_graph(graph_name), METHODS[label]
    ends = ptcc.final_state(ptcc.analyse(graph), (X0 - SIGMA0).astype(int).tolist())
    exact = np.array(ends.states, dtype=float)
    if method == "ours":
        first = ours(graph, exact, options)
        seconds = [first.seconds, *(ours(graph, exact, options).seconds for _ in range(4))]
        first.note += f", first call {first.seconds:.2f} s"
    else:
        first = naive(graph, exact, method, options, cap, most)
        again = 2 if first.seconds < FAST else 0
        seconds = [first.seconds]
        seconds += [naive(graph, exact, method, options, cap, most).seconds for _ in range(again)]
    first.seconds = statistics.median(seconds)
    send.send(first)


def in_own_process(graph_name: str, label: str, cap: float, most: int) -> Run:
    """Return the run, or an empty one if not even a single step of it ends in time."""
    context = multiprocessing.get_context("spawn")
    receive, send = context.Pipe(duplex=False)
    process = context.Process(target=measure, args=(send, graph_name, label, cap, most))
    process.start()
    send.close()
    limit, run = cap + 60, Run(None, None, None, 0, float("nan"), "nothing: the process died")
    if not receive.poll(limit):
        run.note = f"nothing: killed after {limit:g} s"
    else:
        with contextlib.suppress(EOFError):
            run = receive.recv()
    process.kill()
    process.join()
    return run


def row(label: str, run: Run, ours: Run) -> tuple[str, ...]:
    sizes = ("-" if value is None else f"{value:.1e}" for value in (run.error, run.least, run.sigma))
    ratios = run.evaluations / max(ours.evaluations, 1), run.seconds / ours.seconds
    return label, *sizes, str(run.evaluations), f"{run.seconds:.3f}", *(f"{r:.3g}" for r in ratios), run.note


def table(rows: list[tuple[str, ...]]) -> str:
    """Align the columns: texts to the left, numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    last = len(widths) - 1
    return "\n".join(
        "  ".join(
            cell.ljust(w) if i in (0, last) else cell.rjust(w)
            for i, (cell, w) in enumerate(zip(r, widths, strict=True))
        ).rstrip()
        for r in rows
    )


def main() -> None:
    parser = argparse.ArgumentParser(description="Example 4, event by event and the naive way.")
    parser.add_argument("--cap", type=float, default=60, help="seconds of a naive run (default 60)")
    parser.add_argument("--evaluations", type=int, default=5_000_000, help="evaluations of a naive run (default 5e6)")
    wanted = parser.parse_args()
    versions = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "casadi"))
    print(f"Python {platform.python_version()}, {versions}; {os.cpu_count()} CPUs")
    for graph_name, behaviour in zip(EXAMPLE.graphs, EXAMPLE.behaviours, strict=True):
        runs = {label: in_own_process(graph_name, label, wanted.cap, wanted.evaluations) for label in METHODS}
        print(f"\nExample 4, {graph_name} ({behaviour})\n")
        print(table([COLUMNS, *(row(label, run, runs[OURS]) for label, run in runs.items())]), flush=True)


if __name__ == "__main__":
    main()
