"""Certify and check large graphs: seconds, memory, tightness, and how the cost grows with size.

    OPENBLAS_NUM_THREADS=1 python benchmarks/scale.py [--real FOLDER] [--largest 100000]

Each graph runs in a process of its own. Generated graphs: a tenth of the agents listen to nobody, a twentieth in rings
of four, the others to seven random agents, weights 500 to 2000, three in ten of them opponents.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import ptcc_certify as ptcc
from ptcc_certify.certificate import certify
from ptcc_certify.checker import check

REAL = ("wiki-elec.txt.gz", "soc-sign-bitcoinotc.csv.gz", "soc-sign-epinions.txt.gz")


def generated(n: int) -> ptcc.SignedDigraph:
    """A random sparse digraph with leaders and followers."""
    from scipy import sparse

    rng = np.random.default_rng(n)
    alone, ringed = n // 10, n // 20 // 4 * 4
    ring = np.arange(alone, alone + ringed)
    following = np.arange(alone + ringed, n)
    target = np.concatenate([ring, np.repeat(following, 7)])
    place = ring - alone
    source = np.concatenate([alone + place - place % 4 + (place + 1) % 4, rng.integers(0, n, 7 * following.size)])
    weight = rng.integers(500, 2001, target.size) * np.where(rng.random(target.size) < 0.3, -1, 1)
    pairs, first = np.unique(target * n + source, return_index=True)
    keep = first[pairs // n != pairs % n]
    W = sparse.csr_array((weight[keep], (target[keep], source[keep])), shape=(n, n))
    return ptcc.SignedDigraph.from_matrix(W)


def one(name: str, folder: Path | None) -> dict[str, object]:
    """Certify and check one graph; everything that is measured."""
    begin = time.perf_counter()
    if name.isdigit():
        graph = generated(int(name))
    else:
        assert folder is not None
        graph = ptcc.read_graph(folder / name, orientation="listens", drop_self_loops=True)
    read = time.perf_counter()
    start = np.random.default_rng(0).uniform(-10, 10, graph.n_nodes).round(3).tolist()
    cert = certify(graph, ptcc.NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), start, simulation=False)
    made = time.perf_counter()
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "c.json"
        cert.save(path)
        saved = time.perf_counter()
        size = sum(file.stat().st_size for file in Path(place).iterdir())
        report = check(path)
        done = time.perf_counter()
    assert report.accepted, (report.rejected, report.reason)
    return {
        "nodes": graph.n_nodes,
        "edges": graph.n_edges,
        "read": read - begin,
        "certify": made - read,
        "save": saved - made,
        "check": done - saved,
        "megabytes": size / 1e6,
        "gigabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
        "rate": float(cert.rate or 0),
        "limit": None if cert.limit is None else float(cert.limit.value),
        "verdict": cert.verdict,
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--real", type=Path)
    parser.add_argument("--largest", type=int, default=100_000)
    parser.add_argument("--one")
    options = parser.parse_args()
    if options.one:
        print(json.dumps(one(options.one, options.real)))
        return
    names = [str(n) for n in (1000, 3000, 10_000, 30_000, 100_000, 300_000, 1_000_000) if n <= options.largest]
    names += [name for name in REAL if options.real and (options.real / name).exists()]
    print(f"Python {platform.python_version()}, numpy {np.__version__}; {os.cpu_count()} CPUs; seconds\n")
    heads = (
        "graph",
        "nodes",
        "edges",
        "read",
        "certify",
        "save",
        "check",
        "file MB",
        "peak GB",
        "rate",
        "limit",
        "verdict",
    )
    print("{:<28}{:>9}{:>9}{:>7}{:>9}{:>7}{:>7}{:>9}{:>9}{:>10}{:>10}  {}".format(*heads))
    sizes, costs = [], []
    for name in names:
        words = [sys.executable, __file__, "--one", name, *(["--real", str(options.real)] if options.real else [])]
        done = subprocess.run(words, capture_output=True, text=True)
        if done.returncode:
            print(f"{name:<28} failed: {done.stderr.strip().splitlines()[-1]}")
            continue
        f = json.loads(done.stdout)
        limit = "-" if f["limit"] is None else f"{f['limit']:.6g}"
        print(
            f"{name if not name.isdigit() else 'generated':<28}{f['nodes']:>9}{f['edges']:>9}{f['read']:>7.1f}"
            f"{f['certify']:>9.1f}{f['save']:>7.1f}{f['check']:>7.1f}{f['megabytes']:>9.1f}{f['gigabytes']:>9.2f}"
            f"{f['rate']:>10.6g}{limit:>10}  {f['verdict']}",
            flush=True,
        )
        if name.isdigit():
            sizes.append(math.log(f["nodes"]))
            costs.append(math.log(f["certify"] + f["check"]))
    if len(sizes) > 2:
        print(f"\ncertify and check grow like n^{np.polyfit(sizes[-4:], costs[-4:], 1)[0]:.2f} (the four largest)")


if __name__ == "__main__":
    main()
