"""The proved checker beside the reference checker: processor seconds of whole processes, and their ratio.

    python benchmarks/verified.py [--runs 3] [--largest 10000]

Needs the executable of ``formal/``. Certificates of the paper's graphs of 6 and 16 agents, of random graphs of 48 and
120 with balanced and unbalanced leader groups, and of the generated graphs of ``scale.py`` with single leaders, and
with rings of four besides. The least of the runs, which take turns; the start of the process is part of it.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from generators import random_graph
from scale import generated

import ptcc_certify as ptcc
from ptcc_certify.certificate.certification import certify
from ptcc_certify.cli.proved_checker import executable
from ptcc_certify.examples import load_graph
from ptcc_certify.model.asks import Asks

PROTOCOL = ptcc.NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)


def graphs(largest: int) -> Iterator[tuple[str, ptcc.SignedDigraph]]:
    """Name and graph of every case."""
    for name in ("fig1a", "fig5a"):
        graph = load_graph(name)
        yield f"{graph.n_nodes}, {name}", graph
    for n in (48, 120):
        yield f"{n}, random", random_graph(np.random.default_rng(n), "weak", "mixed", n=n).graph
    yield f"{largest}, single leaders", generated(largest, rings=False)
    yield f"{largest}, rings of four too", generated(largest)


def seconds(words: list[str]) -> float:
    """Processor seconds of a command, which must accept."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run = subprocess.run(words, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if run.returncode:
        raise SystemExit(f"{' '.join(words)}: exit code {run.returncode}\n{run.stdout}{run.stderr}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--largest", type=int, default=10_000)
    options = parser.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    print(f"{'nodes':28}{'obligations':>12}{'verified':>10}{'check':>8}{'--stdlib':>10}{'ratio':>8}")
    with tempfile.TemporaryDirectory() as folder:
        for name, graph in graphs(options.largest):
            start = np.random.default_rng(0).integers(-9, 10, graph.n_nodes).tolist()
            file = Path(folder) / "c.json"
            certify(graph, PROTOCOL, start, asks=Asks(simulation=False)).save(file)
            check = [sys.executable, "-m", "ptcc_certify.checker", str(file)]
            commands = ([str(executable()), str(file)], check, [*check, "--stdlib"])
            least = [math.inf] * len(commands)
            for _ in range(options.runs):
                least = [min(old, seconds(words)) for old, words in zip(least, commands, strict=True)]
            count = len(json.loads(file.read_text("utf-8"))["proof"])
            columns = f"{least[0]:10.2f}{least[1]:8.2f}{least[2]:10.2f}{least[0] / least[1]:8.2f}"
            print(f"{name:28}{count:12}{columns}", flush=True)


if __name__ == "__main__":
    main()
