"""Exact proofs of definiteness at scale, and their independent checks.

    OPENBLAS_NUM_THREADS=1 python benchmarks/definiteness.py [--real FOLDER]

Dense matrices of 1,000 rows, and the largest strong component of
Bitcoin OTC (``soc-sign-bitcoinotc.csv.gz`` in FOLDER; skipped without it) as a graph of its own. ``prove`` finds a
witness from floats, for which the kernel decides (:mod:`lmi.definiteness_proofs`); ``check`` hands it to the kernel
alone, by the standard library or by its array twins (:mod:`lmi.exact`). The matrices ``P L + L' P - b P`` are exact:
``p`` in integers, ``b`` dyadic.
"""

from __future__ import annotations

import argparse
import platform
import sys
import time
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from scipy import sparse
from scipy.sparse.linalg import eigsh

import lmi
from lmi.exact import arithmetic
from ptcc_certify import SignedDigraph, analyse, read_graph
from ptcc_certify.theorems.lemmas import left_vector

DENSE_ROWS = 1000
IN_DEGREE = 7
SHARE = 0.999
#: Binary places of ``b``.
PLACES = 17
BITCOIN = "soc-sign-bitcoinotc.csv.gz"


def timed(action: Callable[..., Any], *args: Any, **kwargs: Any) -> tuple[Any, float]:
    start = time.perf_counter()
    result = action(*args, **kwargs)
    return result, time.perf_counter() - start


def report(what: str, prove: float | None, check: float | None, goal: str, holds: bool, note: str = "") -> bool:
    proof, verified = ("-" if x is None else f"{x:.2f}" for x in (prove, check))
    print(f"{what:<44} {proof:>8} {verified:>8}  {goal:<16} {'proved' if holds else 'NOT PROVED'}  {note}".rstrip())
    return holds


# ---------------------------------------------------------------------- dense


def well_conditioned(rng: np.random.Generator) -> np.ndarray:
    X = rng.standard_normal((DENSE_ROWS, DENSE_ROWS))
    return symmetric(X @ X.T / DENSE_ROWS + np.eye(DENSE_ROWS))


def symmetric(S: np.ndarray) -> np.ndarray:
    """The lower triangle and its mirror image: exactly symmetric."""
    return np.tril(S) + np.tril(S, -1).T


def unbalanced_digraph(rng: np.random.Generator, n: int) -> SignedDigraph:
    """A ring, so that it is strongly connected, and six more in-edges of each node; a third of the edges negative."""
    edges = {}
    for target in range(n):
        for source in {(target + 1) % n, *rng.integers(0, n, IN_DEGREE - 1).tolist()} - {target}:
            edges[source, target] = int(rng.integers(1, 1000)) * (-1 if rng.random() < 1 / 3 else 1)
    return SignedDigraph.from_edges([(*ends, weight) for ends, weight in edges.items()])


def lyapunov(graph: SignedDigraph) -> tuple[sparse.csc_array, np.ndarray]:
    """``P L + L' P`` of the Perron certificate in int64, ``p`` in integers of sum 2^30."""
    p = np.maximum(np.rint(left_vector(graph) * 2**30), 1).astype(np.int64)
    L = sparse.coo_array(graph.laplacian())
    assert (L.data == np.rint(L.data)).all()
    S = sparse.csc_array((p[L.row] * L.data.astype(np.int64), (L.row, L.col)), shape=L.shape)
    assert abs(S.astype(float)).max() < 2**61
    return sparse.csc_array(S + S.T), p


def dense(name: str, S: np.ndarray, note: str) -> bool:
    proof, prove = timed(lmi.prove_positive_definite, S)
    values, _ = lmi.dyadic_integers(S.ravel())
    rows = [values[k : k + len(S)] for k in range(0, len(values), len(S))]
    check, seconds = timed(arithmetic().definite, rows)
    bits = max(map(abs, values)).bit_length()
    return report(name, prove, seconds, "5 s together", bool(proof) and check, f"{note}; entries to {bits} bits")


def dense_cases() -> bool:
    rng = np.random.default_rng(1)
    S = well_conditioned(rng)
    values = np.linalg.eigvalsh(S)
    good = dense(f"dense {DENSE_ROWS}, random", S, f"condition {values[-1] / values[0]:.1e}")
    L = lyapunov(unbalanced_digraph(rng, DENSE_ROWS))[0].toarray()
    hard = L - int(SHARE * np.linalg.eigvalsh(L.astype(float))[0]) * np.eye(DENSE_ROWS, dtype=np.int64)
    values = np.linalg.eigvalsh(hard.astype(float))
    note = f"b = {SHARE} lambda_min, condition {values[-1] / values[0]:.1e}"
    return dense(f"dense {DENSE_ROWS}, P L + L'P - b I", hard, note) and good


# ---------------------------------------------------------------------- a real core


def real_core(folder: Path) -> bool:
    graph = read_graph(folder / BITCOIN, orientation="listens")
    component = analyse(graph).strong_component
    core = graph.subgraph(np.flatnonzero(component == np.bincount(component).argmax()))
    S, p = lyapunov(core)
    P = sparse.csc_array((p, (np.arange(len(p)), np.arange(len(p)))), shape=S.shape)
    found = eigsh(S.astype(float), 1, P.astype(float), sigma=0, which="LM", return_eigenvectors=False)
    smallest = float(found[0])
    assert abs(S.astype(float)).max() < 2.0 ** (62 - PLACES)
    b = Fraction(int(SHARE * smallest * 2**PLACES), 2**PLACES)
    lowered = sparse.csc_array(S * 2**PLACES - P * int(b * 2**PLACES))
    proof, prove = timed(lmi.prove_sparse_positive_definite, lowered)
    if proof is None:
        return report("Bitcoin OTC", prove, 0.0, "", False)
    lower = sparse.coo_array(sparse.tril(lowered))
    values, power = lmi.dyadic_integers(lower.data)
    holds = True
    for path, numpy in (("NumPy", True), ("standard library", False)):
        judge = arithmetic(stdlib=not numpy).residual_definite
        check, seconds = timed(judge, core.n_nodes, (lower.row, lower.col, values), proof, power)
        note = f"n {core.n_nodes}, factor {len(proof.data)} nonzeros at {proof.bits} bits"
        holds &= report(f"Bitcoin OTC core, check by {path}", prove if numpy else None, seconds, "", check, note)
    above = sparse.csc_array(S * 2**PLACES - P * (int(smallest * 2**PLACES) + 1))
    spectral = 2 * float(smallest_real_part(core))
    print(
        f"{'':<44} b = {b} = {float(b):.9g}, {b / smallest:.6f} of the smallest generalized eigenvalue {smallest:.9g},"
    )
    print(f"{'':<44} {b / spectral:.4f} of the spectral rate {spectral:.9g} (numerical)")
    refused = lmi.prove_sparse_positive_definite(above) is None
    print(
        f"{'':<44} the next multiple of 2^-{PLACES} above the eigenvalue is {'refused' if refused else 'PROVED: WRONG'}"
    )
    return holds and refused


def smallest_real_part(graph: SignedDigraph) -> float:
    L = sparse.csc_matrix(graph.laplacian())
    values = sparse.linalg.eigs(L, 6, sigma=0, which="LM", return_eigenvectors=False)
    return values.real.min()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--real", type=Path, help="folder with soc-sign-bitcoinotc.csv.gz")
    options = parser.parse_args()
    print(f"Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}\n")
    print(f"{'seconds':<44} {'prove':>8} {'check':>8}  goal")
    holds = dense_cases()
    if options.real is None or not (options.real / BITCOIN).exists():
        print(f"Bitcoin OTC skipped: no {BITCOIN}, see --real")
    else:
        holds &= real_core(options.real)
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
