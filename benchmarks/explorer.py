"""Seconds from the move of a control of the explorer to the new image and text, and to the verdict of the check.

Wall time, and beside it CPU time of the server and of the processes that it has ended, which other work on the machine
changes little. Every control is moved twice on every packaged graph and on one of 40 nodes, through the server of the
page: settings in, text and figures out, both in one answer. With a browser (playwright and Chromium) a slider is moved
there besides, and the seconds are those until text and first image on the page have changed, and until the last image.

Usage
-----
python benchmarks/explorer.py [--browser]
"""

from __future__ import annotations

import argparse
import gc
import http.client
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import numpy as np

import ptcc_certify as ptcc
from ptcc_certify.examples import GRAPHS
from ptcc_certify.report.explorer import Explorer, Settings
from ptcc_certify.report.explorer.server import ExplorerServer
from ptcc_certify.report.explorer.settings import DISTURBANCES, KINDS

FORTY = "40 nodes"
GAINS = {"T": (0.5, 0.8), "rho1": (0.5, 1.0), "rho2": (0.3, 0.7), "kappa": (1.5, 2.0)}
SLIDING = {
    "T_r": (0.8, 1.0),
    "T_s": (0.7, 0.9),
    "mu1": (3.0, 4.0),
    "mu2": (0.5, 2.0),
    "mu3": (1.5, 2.0),
    "delta": (0.5, 0.7),
    "reaching": ("false", "true"),
    "disturbance": DISTURBANCES[::-1],
}
COMMON = {"seed": (1, 2), "method": ("paper", "best")}
MOVES: dict[str, dict[str, Any]] = {
    "nominal": {**GAINS, **COMMON},
    "sliding-mode": {**{name: GAINS[name] for name in ("rho1", "rho2", "kappa")}, **SLIDING, **COMMON},
}


def random_graph(n: int) -> ptcc.SignedDigraph:
    """Return a ring with chords of both signs."""
    rng = np.random.default_rng(1)
    edges = {(k, (k + 1) % n): 1 for k in range(n)}
    for source, target in rng.integers(0, n, size=(2 * n, 2)).tolist():
        if source != target:
            edges[source, target] = int(rng.choice([-2, -1, 1, 2]))
    return ptcc.SignedDigraph.from_edges([(s, t, w) for (s, t), w in edges.items()])


class Client:
    """What the page asks of its server, with a clock."""

    def __init__(self, server: ExplorerServer, graph: str, kind: str):
        self.server, self.settings = server, {"graph": graph, "kind": kind}
        self.connection = http.client.HTTPConnection("127.0.0.1", server.server_port)
        self.move("seed", 0)

    def move(self, name: str, value: Any) -> tuple[float, float, float, float]:
        """Return the seconds to image and text and to the verdict, of the wall, then of the CPU."""
        self.settings[name] = value
        gc.collect()
        began, wall, cpu = (time.perf_counter(), cpu_seconds()), [], []
        for what in ("preview", "view"):
            self.connection.request("GET", f"{self.server.root}{what}?{urlencode(self.settings)}")
            answer = self.connection.getresponse()
            if b'"panels"' not in answer.read():
                raise RuntimeError(f"{name} = {value} drew nothing")
            wall.append(time.perf_counter() - began[0])
            cpu.append(cpu_seconds() - began[1])
        return wall[0], wall[1], cpu[0], cpu[1]


def cpu_seconds() -> float:
    """Return the CPU time of this process and of its children that have ended."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def tell(label: str, moves: Sequence[tuple[float, ...]]) -> None:
    columns = [f"{statistics.median(seconds):7.2f} {max(seconds):7.2f}" for seconds in zip(*moves, strict=True)]
    print(f"{label:<34}{len(moves):>6}   {'   '.join(columns)}", flush=True)


def in_browser() -> None:
    """Move a slider on the page of ``ptcc explore`` ten times, with every graph and protocol, after one to warm up."""
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as tools:
        rows = [f"{source},{target},{weight}" for source, target, weight in random_graph(40).edges]
        path = Path(folder, f"{FORTY}.csv")
        path.write_text("\n".join(["source,target,weight", *rows]) + "\n", encoding="utf-8")
        command = [sys.executable, "-m", "ptcc_certify", "explore", str(path), "--no-browser"]
        explorer = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert explorer.stdout is not None
        address = next(word for line in explorer.stdout for word in line.split() if word.startswith("http://"))
        browser = tools.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto(address)
        graphs = page.eval_on_selector_all("#graph option", "options => options.map(option => option.value)")
        for kind in KINDS:
            page.select_option("#kind", kind)
            for graph in graphs:
                page.select_option("#graph", graph)
                seconds = []
                for k in range(11):
                    page.wait_for_selector("#verdict:not(.open)")
                    told = page.evaluate(MOVE_ON_PAGE, str(0.5 + k / 10))
                    seconds.append(tuple(milliseconds / 1000 for milliseconds in told))
                tell(f"{graph}, {kind}, in Chromium", seconds[1:])
        browser.close()
        explorer.terminate()
        explorer.wait()


#: Moves the slider of rho2, and tells the milliseconds until image and text are painted, and until the last image is.
MOVE_ON_PAGE = """value => new Promise(resolve => {
  const image = document.querySelector("#panel-states img"), text = document.querySelector('dd[data-head="error"]');
  const before = [image.src, text.textContent], began = performance.now();
  const last = document.querySelector("#panel-input img"), lastBefore = last.src, seen = [];
  const look = () => seen.length ? last.src !== lastBefore && last.complete
    : image.src !== before[0] && text.textContent !== before[1] && image.complete;
  const watch = new MutationObserver(() => look() && requestAnimationFrame(() => setTimeout(() => {
    if (look()) seen.push(performance.now() - began);
    if (seen.length < 2) return;
    watch.disconnect();
    resolve(seen);
  })));
  watch.observe(document.body, { subtree: true, childList: true, characterData: true, attributes: true });
  const slider = document.querySelector('[data-of="rho2"]');
  slider.value = value;
  slider.dispatchEvent(new Event("input", { bubbles: true }));
})"""


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--browser", action="store_true", help="move a slider in Chromium too")
    browser = arguments.parse_args().browser
    versions = ", ".join(f"{name} {version(name)}" for name in ("matplotlib", "numpy", "casadi"))
    print(f"Python {platform.python_version()}, {versions}; {os.cpu_count()} CPUs, load {os.getloadavg()[0]:.1f}\n")
    heads = ("image and text", "verdict", "image: CPU", "verdict: CPU")
    print(f"{'seconds: median, max':<34}{'moves':>6}   {'   '.join(f'{head:<15}' for head in heads)}".rstrip())
    server = ExplorerServer(Explorer(random_graph(40), FORTY), Settings(FORTY), 0)
    server.warm_up()
    threading.Thread(target=server.serve_forever, daemon=True).start()
    everything: list[tuple[float, ...]] = []
    for kind in KINDS:
        for graph in (*GRAPHS, FORTY):
            client = Client(server, graph, kind)
            moves = [client.move(name, value) for name, values in MOVES[kind].items() for value in values]
            tell(f"{graph}, {kind}", moves)
            everything += moves
    tell("all", everything)
    server.shutdown()
    server.server_close()
    if browser:
        in_browser()


if __name__ == "__main__":
    main()
