"""Certify and check large families of uncertain weights: seconds of CPU, memory, rates.

    OPENBLAS_NUM_THREADS=1 python benchmarks/large_families.py [--nodes 10000 100000] [--uncertainty 10%]

A ring of ten agents leads; every other agent listens to six random ones, a fifth of them to one of the ring; two camps,
weights 1/2 to 2, known up to the uncertainty.
"""

from __future__ import annotations

import argparse
import os
import resource
import time
from fractions import Fraction

from ptcc_certify.certificate.certification import certify

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.packed_weights import Weights
from ptcc_certify.lyapunov.follower_function import follower_decay, least_rate
from ptcc_certify.lyapunov.follower_rows import IntervalRows
from ptcc_certify.model import NominalProtocol

LEADERS, DEGREE = 10, 6


def family_of(n: int, uncertainty: str, seed: int = 0) -> Family:
    """Return the family of the module."""
    rng = np.random.default_rng(seed)
    camps = rng.choice([-1, 1], n)
    listeners = np.repeat(np.arange(LEADERS, n), DEGREE)
    heard = rng.integers(0, n, listeners.size)
    near = np.flatnonzero(rng.random(n - LEADERS) < 0.2) * DEGREE
    heard[near] = rng.integers(0, LEADERS, near.size)
    ring = np.arange(LEADERS)
    source, target = np.concatenate([ring, heard]), np.concatenate([(ring + 1) % LEADERS, listeners])
    key = np.unique((target * n + source)[source != target])
    source, target = key % n, key // n
    hundredths = rng.integers(50, 201, source.size)
    values = [Fraction(int(k), 100) for k in range(50, 201)]
    codes = hundredths - 50 + np.where(camps[source] * camps[target] < 0, len(values), 0)
    weights = Weights([*values, *(-x for x in values)], codes)
    return Family.from_graph(SignedDigraph(tuple(map(str, range(n))), source, target, weights), uncertainty=uncertainty)


def megabytes() -> float:
    """Return the largest memory so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def one(n: int, uncertainty: str) -> None:
    """Print one row: the library's functions by themselves, then the certificate and its check."""
    family = family_of(n, uncertainty)
    print(f"{n} nodes, {family.modes[0].n_edges} edges, {family.modes[0].parameters.size} uncertain")
    start = time.process_time()
    decay = follower_decay(family)
    assert decay is not None
    search = time.process_time() - start
    rows = IntervalRows.of(family.modes, decay.nodes)
    start = time.process_time()
    least_rate(rows, decay.vector)
    exact = time.process_time() - start
    print(f"  followers: rate {float(decay.rate):.6g}; {search:.1f} s, proof {exact:.2f} s")
    protocol = NominalProtocol(T=1, rho1=1, rho2=30, kappa=3)
    start = time.process_time()
    certificate = certify(family, protocol, [k % 7 for k in range(n)])
    _, files = certificate.for_check()
    made, memory = time.process_time() - start, megabytes()
    start = time.process_time()
    report = certificate.checked
    assert report is not None
    seconds = time.process_time() - start
    rate = "none" if certificate.rate is None else f"{float(certificate.rate):.6g}"
    print(f"  certificate: rate {rate}; {made:.1f} s, {memory:.0f} MB, {len(files)} side files")
    print(f"  check: {'accepted' if report.accepted else report.reason}; {seconds:.1f} s, {megabytes():.0f} MB in all")


def main() -> None:
    """Print the rows that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--nodes", type=int, nargs="+", default=[1000, 10_000, 100_000])
    parser.add_argument("--uncertainty", default="10%")
    asked = parser.parse_args()
    for n in asked.nodes:
        one(n, asked.uncertainty)


if __name__ == "__main__":
    main()
