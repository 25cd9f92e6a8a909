"""Every benchmark of scale in one run, and a figure of cost against size.

    pip install ".[benchmarks]"
    OPENBLAS_NUM_THREADS=1 python benchmarks/large.py --output FOLDER [--real FOLDER] [--figure-only]

Runs scale.py, diagonal_optimum.py and simulation.py one after the other, each with all its peers, prints their tables,
keeps their measurements as JSON in the folder, and draws ``cost.png`` there: seconds against size, with the exponents
fitted to the larger half of the sizes. ``--figure-only`` draws what an earlier run has measured.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
COLOURS = ("#0072B2", "#B84E00", "#007A5A", "#CC79A7", "#E69F00", "#56B4E9")
MARKERS = "osD^vP"

Curves = dict[str, list[tuple[float, float]]]


def scale_curves(found: dict[str, Any]) -> Curves:
    """Certify and check against the number of nodes."""
    rows = found["generated"]
    return {name: [(row["nodes"], row[name]) for row in rows] for name in ("certify", "check")}


def optimum_curves(found: dict[str, Any]) -> Curves:
    """Every solver against the number of nodes."""
    curves: Curves = {}
    for row in found["results"]:
        if "cpu" in row:
            curves.setdefault(row["solver"], []).append((row["n"], row["cpu"]))
    return curves


def simulation_curves(found: dict[str, Any]) -> Curves:
    """Every method on mild graphs against the number of nodes."""
    curves: Curves = {}
    for row in found["rows"]:
        if row["graph"] == "mild" and row.get("seconds"):
            curves.setdefault(row["method"], []).append((row["N"], row["seconds"]))
    return curves


PANELS = (
    ("scale.json", "Certify, and check the certificate", "agents", scale_curves),
    ("optimum.json", "Diagonal matrix of the best margin", "rows", optimum_curves),
    ("simulation.json", "Simulate to 1 - t/T = 1e-6", "agents", simulation_curves),
)


def exponent(points: list[tuple[float, float]]) -> float | None:
    """The slope in logarithms over the larger half of the sizes."""
    larger = points[len(points) // 2 :] if len(points) > 3 else points
    if len(larger) < 2:
        return None
    sizes, seconds = np.log(np.array(larger)).T
    return float(np.polyfit(sizes, seconds, 1)[0])


def draw(folder: Path) -> None:
    """Draw the figure from the JSON files of a folder."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(PANELS), figsize=(15, 4.6), layout="constrained")
    for ax, (file, title, unit, curves_of) in zip(axes, PANELS, strict=True):
        curves = curves_of(json.loads((folder / file).read_text()))
        for (name, points), colour, marker in zip(curves.items(), COLOURS, MARKERS, strict=False):
            slope = exponent(points)
            label = name if slope is None else f"{name}, $n^{{{slope:.2f}}}$"
            ax.loglog(*zip(*points, strict=True), marker=marker, color=colour, label=label, markersize=5)
        ax.set_title(title)
        ax.set_xlabel(f"number of {unit}")
        ax.set_ylabel("seconds")
        ax.grid(True, which="major", alpha=0.3)
        ax.legend(fontsize=9)
    figure.savefig(folder / "cost.png", dpi=130)


def main() -> None:
    """Run everything."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--real", type=Path)
    parser.add_argument("--cap", default="200", help="seconds of a peer's run (default 200)")
    parser.add_argument("--figure-only", action="store_true")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    real = ["--real", str(options.real)] if options.real else []
    runs = (
        ("scale.py", "scale.json", [*real, "--runs", "3"]),
        ("diagonal_optimum.py", "optimum.json", ["--cap", options.cap, "--rate"]),
        ("simulation.py", "simulation.json", ["--cap", options.cap]),
    )
    if not options.figure_only:
        for script, file, more in runs:
            print(f"\n===== {script}", flush=True)
            words = [sys.executable, str(HERE / script), "--json", str(options.output / file), *more]
            subprocess.run(words, check=True, env={"OPENBLAS_NUM_THREADS": "1", **os.environ})
    draw(options.output)


if __name__ == "__main__":
    main()
