"""Seconds from the move of a control of the explorer to the new image, and to the verdict of the check.

Every control is moved twice on every packaged graph, and every class of bounds is asked for before it was searched.
Drawing, simulation, bound, comparison and independent check are included; a browser is not.

Usage
-----
python benchmarks/explorer.py
"""

from __future__ import annotations

import gc
import os
import platform
import statistics
import time
from importlib.metadata import version
from typing import Any

from ptcc_certify.examples import GRAPHS
from ptcc_certify.lyapunov.search import METHODS
from ptcc_certify.report.explorer import DISTURBANCES, KINDS, Explorer, Settings, controls

GAINS = {"T": (0.5, 0.8), "rho1": (0.5, 1.0), "rho2": (0.3, 0.7), "kappa": (1.5, 2.0)}
SLIDING = {
    "T_r": (0.8, 1.0),
    "T_s": (0.7, 0.9),
    "mu1": (3.0, 4.0),
    "mu2": (0.5, 2.0),
    "mu3": (1.5, 2.0),
    "delta": (0.5, 0.7),
    "sigma(0) random": (False, True),
    "disturbance": DISTURBANCES[::-1],
}
COMMON = {"start seed": (1, 2), "bounds": ("paper", "best")}
MOVES: dict[str, dict[str, Any]] = {
    "nominal": {**GAINS, **COMMON},
    "sliding-mode": {**{name: GAINS[name] for name in ("rho1", "rho2", "kappa")}, **SLIDING, **COMMON},
}


class Panel:
    """The widget, with a clock on its image."""

    def __init__(self, explorer: Explorer, settings: Settings):
        self.box, _, _, self.image = controls(explorer, settings).children
        self.seen: list[float] = []
        self.image.observe(lambda change: self.seen.append(time.perf_counter()), names="value")

    def move(self, name: str, value: Any) -> tuple[float, float]:
        """Return the seconds to the first new image and to the verdict."""
        gc.collect()
        self.seen.clear()
        control = next(child for child in self.box.children if child.description == name)
        began = time.perf_counter()
        control.value = value
        done = time.perf_counter()
        if not self.seen:
            raise RuntimeError(f"{name} = {value} drew nothing")
        return self.seen[0] - began, done - began


def told(label: str, pairs: list[tuple[float, float]]) -> None:
    columns = []
    for seconds in zip(*pairs, strict=True):
        columns.append(f"{statistics.median(seconds):7.2f} {max(seconds):7.2f}")
    print(f"{label:<34}{len(pairs):>6}   {'   '.join(columns)}")


def main() -> None:
    versions = ", ".join(f"{name} {version(name)}" for name in ("matplotlib", "numpy", "casadi", "ipywidgets"))
    print(f"Python {platform.python_version()}, {versions}; {os.cpu_count()} CPUs\n")
    print(f"{'seconds':<34}{'moves':>6}   {'image: median, max':<15}   verdict: median, max")
    everything: list[tuple[float, float]] = []
    for kind in KINDS:
        for graph in GRAPHS:
            panel = Panel(Explorer(), Settings(graph, kind=kind))
            pairs = [panel.move(name, value) for name, values in MOVES[kind].items() for value in values]
            told(f"{graph}, {kind}", pairs)
            everything += pairs
    told("all", everything)
    first = []
    for method in METHODS[1:]:
        panel = Panel(Explorer(), Settings("fig1a", method="paper"))
        panel.move("bounds", method)
        pairs = [panel.move("graph", graph) for graph in GRAPHS[1:]]
        told(f"first view of a graph, {method}", pairs)
        first += pairs
    told("first views", first)


if __name__ == "__main__":
    main()
