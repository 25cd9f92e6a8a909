"""Certify and check large graphs: seconds, memory, ratio, and how the cost grows with size.

    OPENBLAS_NUM_THREADS=1 python benchmarks/scale.py [--real FOLDER] [--largest 1000000] [--runs 1] [--json FILE]
    OPENBLAS_NUM_THREADS=1 python benchmarks/scale.py --late 1000000 [--by-edge]

Three tables. Real networks, through the command line, each command a process of its own. Generated graphs, each in a
process of its own: a tenth of the agents listen to nobody, a twentieth in rings of four, the others to seven random
agents, weights 500 to 2000, three in ten of them opponents. The largest strong components of real networks, as graphs
of their own.
"""

from __future__ import annotations

import argparse
import functools
import json
import math
import os
import platform
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from fractions import Fraction
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import ptcc_certify as ptcc
from ptcc_certify.certificate.certification import certify
from ptcc_certify.checker import check
from ptcc_certify.model.asks import Asks

REAL = ("wiki-elec.txt.gz", "soc-sign-bitcoinotc.csv.gz", "soc-sign-epinions.txt.gz")
CORES = REAL[:2]
SIZES = (1000, 3000, 10_000, 30_000, 100_000, 300_000, 1_000_000)
#: GB that a check may take: a million nodes need 2.
MEMORY = 4
READING = ("--edges", "listens", "--drop-self-loops")


def generated(n: int, rings: bool = True) -> ptcc.SignedDigraph:
    """A random sparse digraph with leaders and followers; without rings all leaders listen to nobody."""
    from scipy import sparse

    rng = np.random.default_rng(n)
    alone, ringed = n // 10, n // 20 // 4 * 4 * rings
    ring = np.arange(alone, alone + ringed)
    following = np.arange(alone + ringed, n)
    target = np.concatenate([ring, np.repeat(following, 7)])
    place = ring - alone
    source = np.concatenate([alone + place - place % 4 + (place + 1) % 4, rng.integers(0, n, 7 * following.size)])
    weight = rng.integers(500, 2001, target.size) * np.where(rng.random(target.size) < 0.3, -1, 1)
    pairs, first = np.unique(target * n + source, return_index=True)
    keep = first[pairs // n != pairs % n]
    W = sparse.csr_array((weight[keep], (target[keep], source[keep])), shape=(n, n))
    return ptcc.SignedDigraph.from_matrix(W, orientation="listens")


def largest_core(path: Path) -> ptcc.SignedDigraph:
    """The largest strong component of a real network."""
    graph = ptcc.read_graph(path, orientation="listens", drop_self_loops=True)
    component = ptcc.analyse(graph).strong_component
    return graph.subgraph(np.flatnonzero(component == np.bincount(component).argmax()))


def smallest_real_part(graph: ptcc.SignedDigraph) -> float:
    """The smallest real part of the nonzero spectrum (numerical).

    By dense eigenvalues of strong components up to 500 agents, by Arnoldi's method with BiCGSTAB for the inverse above.
    """
    from scipy.sparse.linalg import LinearOperator, eigs

    from lmi.sparse_h_matrix import solve

    structure = ptcc.analyse(graph)
    L = graph.laplacian().tocsr()
    number = structure.strong_component
    sizes = np.bincount(number)
    single = L.diagonal()[sizes[number] == 1]
    least = float(np.min(single[single > 0], initial=math.inf))
    balanced = {c.nodes[0] for c in structure.closed_components if c.balanced}
    for k in np.flatnonzero(sizes > 1).tolist():
        nodes = np.flatnonzero(number == k)
        block = L[nodes][:, nodes].tocsr()
        if nodes.size <= 500:
            values = np.sort(np.linalg.eigvals(block.toarray()).real)[int(int(nodes[0]) in balanced) :]
        else:

            def inverse(x: np.ndarray, block: Any = block) -> np.ndarray:
                return solve(block, np.asarray(x).ravel(), block.diagonal())

            operator = LinearOperator(block.shape, matvec=inverse)
            values = eigs(block, k=6, sigma=0, OPinv=operator, return_eigenvectors=False).real
        least = min(least, float(np.min(values)))
    return least


# ---------------------------------------------------------------------- one process each


def one(name: str) -> dict[str, Any]:
    """Certify, write and check one generated graph; everything that is measured."""
    begin = time.perf_counter()
    graph = generated(int(name))
    made = time.perf_counter()
    start = np.random.default_rng(0).uniform(-10, 10, graph.n_nodes).round(3).tolist()
    cert = certify(graph, ptcc.NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), start, asks=Asks(simulation=False))
    certified = time.perf_counter()
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "c.json"
        cert.save(path)
        saved = time.perf_counter()
        size = sum(file.stat().st_size for file in Path(place).iterdir())
        rate, limit, verdict = cert.rate, cert.limit, cert.verdict
        nodes, edges = graph.n_nodes, graph.n_edges
        first = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        del cert, graph
        checking = time.perf_counter()
        report = check(path, memory=MEMORY)
        done = time.perf_counter()
    assert report.accepted, (report.rejected, report.reason)
    return {
        "nodes": nodes,
        "edges": edges,
        "read": made - begin,
        "certify": certified - made,
        "save": saved - certified,
        "check": done - checking,
        "megabytes": size / 1e6,
        "gigabytes": max(first, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) / 1e6,
        "rate": float(rate or 0),
        "limit": None if limit is None else float(limit.value),
        "verdict": verdict,
    }


def late(n: int, by_edge: bool) -> None:
    """Certify and check a generated graph whose messages are 0.02 late, or by edge 0.02, 0.01, 0.005 or 0.001.

    Of both also what theorem B2 alone takes: the search for witnesses, and the verification of their rows.
    """
    from ptcc_certify.checker import late_messages as verification
    from ptcc_certify.lyapunov.follower_rows import FollowerRows

    witness = timed(FollowerRows, "witness")
    verified = timed(verification, "_check_rows")
    graph = generated(n, rings=False)
    start = np.random.default_rng(0).uniform(-10, 10, n).round(3).tolist()
    delay: Any = "0.02"
    if by_edge:
        which = np.random.default_rng(1).choice(["0.02", "0.01", "0.005", "0.001"], graph.n_edges).tolist()
        delay = {(s, t): x for (s, t, _), x in zip(graph.edges, which, strict=True)}
    messages, protocol = ptcc.LateMessages(delay=delay), ptcc.NominalProtocol(T=1, rho1=1, rho2=1, kappa=4)
    times = [time.process_time()]
    cert = certify(graph, protocol, start, messages=messages, asks=Asks(simulation=False))
    times.append(time.process_time())
    assert cert.late is not None and cert.checked is not None and cert.checked.accepted, cert.notes
    within, edges = cert.late.largest, graph.n_edges
    with tempfile.TemporaryDirectory() as place:
        cert.save(Path(place) / "c.json")
        del cert, graph, start, messages, delay
        times.append(time.process_time())
        report = check(Path(place) / "c.json", memory=2 * MEMORY)
        times.append(time.process_time())
    assert report.accepted, (report.rejected, report.reason)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    certified, saved, checked = np.diff(times).tolist()
    print(
        f"{n} nodes, {edges} edges, {'by edge' if by_edge else 'one delay'}; CPU seconds: certify {certified:.0f}, save"
    )
    print(f"{saved:.0f}, check {checked:.0f}; peak {peak:.2f} GB; every agent within {within:.3g} at T")
    for what, spent in (("witness", witness), ("rows of a witness verified", verified)):
        print(f"{what}: CPU seconds {', '.join(f'{cpu:.1f}' for cpu, _ in spent)}; by the clock", end=" ")
        print(", ".join(f"{wall:.1f}" for _, wall in spent))


def timed(owner: Any, name: str) -> list[tuple[float, float]]:
    """Return a list that fills with the CPU and wall seconds of every call of a function from now on."""
    function, spent = getattr(owner, name), []

    @functools.wraps(function)
    def clocked(*arguments: Any) -> Any:
        began = time.process_time(), time.perf_counter()
        result = function(*arguments)
        spent.append((time.process_time() - began[0], time.perf_counter() - began[1]))
        return result

    setattr(owner, name, clocked)
    return spent


def core(path: Path) -> dict[str, Any]:
    """Every step for one strong component, and the whole."""
    from ptcc_certify.lyapunov.dominance import prove_group
    from ptcc_certify.theorems.lemmas import laplacian_spectrum, left_vector

    graph = largest_core(path)
    structure = ptcc.analyse(graph)
    times = [time.perf_counter()]
    left_vector(graph)
    times.append(time.perf_counter())
    spectral = laplacian_spectrum(structure).spectral_rate
    times.append(time.perf_counter())
    proof = prove_group(graph, structure.balanced)
    times.append(time.perf_counter())
    cert = certify(graph, ptcc.NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), asks=Asks(simulation=False))
    times.append(time.perf_counter())
    report = check(cert.to_dict(), memory=MEMORY)
    times.append(time.perf_counter())
    assert report.accepted, (report.rejected, report.reason)
    names = ("left vector", "spectrum", "proof", "certify", "check")
    return {
        **dict(zip(names, np.diff(times).tolist(), strict=True)),
        "nodes": graph.n_nodes,
        "edges": graph.n_edges,
        "balanced": structure.balanced,
        "rate": float(cert.rate or 0),
        "spectral": spectral,
        "factor": 0 if proof.factor is None else int(proof.factor.data.size),
        "verdict": cert.verdict,
    }


# ---------------------------------------------------------------------- tables


def child(*words: str) -> dict[str, Any]:
    """Run this script for one graph."""
    done = subprocess.run([sys.executable, __file__, *words], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr.strip().splitlines()[-1])
    return json.loads(done.stdout)


def command(*words: str) -> tuple[float, float, int]:
    """Run ``ptcc`` once: seconds, peak memory in GB, exit code."""
    begin = time.perf_counter()
    process = subprocess.Popen([str(Path(sys.executable).parent / "ptcc"), *words], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    return time.perf_counter() - begin, used.ru_maxrss / 1e6, os.waitstatus_to_exitcode(status)


def real_table(folder: Path, names: list[str], runs: int) -> list[dict[str, Any]]:
    """``ptcc certify`` and ``ptcc check`` on real networks."""
    print("\nptcc certify --edges listens --no-simulation, ptcc check with the graph: medians, seconds and peak GB")
    head = ("graph", "nodes", "edges", "certify", "GB", "check", "GB", "both", "rate", "spectral", "ratio")
    print("{:<28}{:>8}{:>8}{:>9}{:>6}{:>7}{:>6}{:>7}{:>11}{:>11}{:>11}  verdict".format(*head))
    rows = []
    for name in names:
        file = str(folder / name)
        with tempfile.TemporaryDirectory() as place:
            out = str(Path(place) / "c.json")
            made = [command("certify", file, *READING, "--no-simulation", "-o", out) for _ in range(runs)]
            checked = [command("check", out, file, *READING, "--memory", str(MEMORY)) for _ in range(runs)]
            assert all(code == 0 for _, _, code in checked), checked
            data = json.loads(Path(out).read_text())
        graph = ptcc.read_graph(file, orientation="listens", drop_self_loops=True)
        row = {
            "graph": name,
            "nodes": graph.n_nodes,
            "edges": graph.n_edges,
            "certify": statistics.median(s for s, _, _ in made),
            "certify GB": max(m for _, m, _ in made),
            "check": statistics.median(s for s, _, _ in checked),
            "check GB": max(m for _, m, _ in checked),
            "rate": float(Fraction(data["rates"]["proved"])),
            "spectral": 2 * smallest_real_part(graph),
            "verdict": data["verdict"],
        }
        rows.append(row)
        print(
            f"{name:<28}{row['nodes']:>8}{row['edges']:>8}{row['certify']:>9.1f}{row['certify GB']:>6.2f}"
            f"{row['check']:>7.1f}{row['check GB']:>6.2f}{row['certify'] + row['check']:>7.1f}{row['rate']:>11.7f}"
            f"{row['spectral']:>11.7f}{row['rate'] / row['spectral']:>11.7f}  {row['verdict']}",
            flush=True,
        )
    return rows


def generated_table(largest: int) -> list[dict[str, Any]]:
    """Generated graphs of growing size."""
    print("\ngenerated graphs: seconds")
    head = ("nodes", "edges", "certify", "save", "check", "file MB", "peak GB", "B/edge", "rate", "limit")
    print("{:>9}{:>9}{:>9}{:>7}{:>7}{:>9}{:>9}{:>8}{:>10}{:>10}  verdict".format(*head))
    rows = []
    for n in SIZES:
        if n > largest:
            continue
        f = child("--one", str(n))
        rows.append(f)
        limit = "-" if f["limit"] is None else f"{f['limit']:.6g}"
        print(
            f"{f['nodes']:>9}{f['edges']:>9}{f['certify']:>9.1f}{f['save']:>7.1f}{f['check']:>7.1f}"
            f"{f['megabytes']:>9.1f}{f['gigabytes']:>9.2f}{1e9 * f['gigabytes'] / f['edges']:>8.0f}"
            f"{f['rate']:>10.6g}{limit:>10}  {f['verdict']}",
            flush=True,
        )
    if len(rows) > 2:
        sizes = np.log([r["nodes"] for r in rows[-3:]])
        costs = np.log([r["certify"] + r["check"] for r in rows[-3:]])
        print(f"certify and check grow like n^{np.polyfit(sizes, costs, 1)[0]:.2f} (the three largest)")
    return rows


def core_table(folder: Path, names: list[str]) -> list[dict[str, Any]]:
    """Largest strong components as graphs of their own."""
    print("\nlargest strong components: seconds")
    head = ("graph", "nodes", "edges", "vector", "spectrum", "proof", "certify", "check", "factor", "rate", "ratio")
    print("{:<28}{:>7}{:>7}{:>8}{:>9}{:>7}{:>9}{:>7}{:>9}{:>11}{:>11}  verdict".format(*head))
    rows = []
    for name in names:
        f = child("--core", name, "--real", str(folder))
        rows.append({"graph": name, **f})
        print(
            f"{name:<28}{f['nodes']:>7}{f['edges']:>7}{f['left vector']:>8.2f}{f['spectrum']:>9.2f}{f['proof']:>7.2f}"
            f"{f['certify']:>9.2f}{f['check']:>7.2f}{f['factor']:>9}{f['rate']:>11.7f}"
            f"{f['rate'] / f['spectral']:>11.7f}  {f['verdict']}",
            flush=True,
        )
    return rows


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--real", type=Path)
    parser.add_argument("--largest", type=int, default=1_000_000)
    parser.add_argument("--runs", type=int, default=1)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--late", type=int, metavar="NODES")
    parser.add_argument("--by-edge", action="store_true")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    parser.add_argument("--core", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.late:
        late(options.late, options.by_edge)
        return
    if options.one:
        print(json.dumps(one(options.one)))
        return
    if options.core:
        print(json.dumps(core(options.real / options.core)))
        return
    print(f"Python {platform.python_version()}, numpy {np.__version__}; {os.cpu_count()} CPUs")
    found: dict[str, Any] = {}
    if options.real:
        names = [name for name in REAL if (options.real / name).exists()]
        found["real"] = real_table(options.real, names, options.runs)
        found["cores"] = core_table(options.real, [name for name in CORES if name in names])
    found["generated"] = generated_table(options.largest)
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
