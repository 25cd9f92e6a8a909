"""How near the rates certified for every signal come to the best possible one, on random and on published graphs.

    OPENBLAS_NUM_THREADS=1 python benchmarks/families.py [--count 100] [--time-limit 30] [--real FOLDER]

Random families with a common kernel (``tests/common_kernel_families.py``): N = 3..16, one to three modes, uncertain and
optional weights. The ratio is the rate that is proved for every signal over the proved upper bound on such rates. Of a
folder of published graphs those that are named below, every weight known up to 10 and 30 %.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from ptcc_certify import NominalProtocol, read_graph
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.certificate.family_proof import ComponentProof
from ptcc_certify.graphs.family import Family
from ptcc_certify.model.asks import Asks

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from common_kernel_families import KINDS, random_family

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
SIZES = range(3, 17)
SHARES, OPTIONAL = (Fraction(0), Fraction(1, 10), Fraction(3, 10)), (0.0, 0.3)
PUBLISHED = ("sampson_t4", "bales", "highland_tribes", "regulatory_192")
UNCERTAIN = ("10%", "30%")


def ensemble(count: int) -> Iterator[tuple[str, Family]]:
    """Yield kinds and families; sizes, modes, shares of uncertainty and optional edges take turns."""
    for seed in range(count):
        rng = np.random.default_rng(seed)
        kind, n = KINDS[seed % len(KINDS)], SIZES[seed % len(SIZES)]
        modes, share = 1 + seed // 2 % 3, SHARES[seed // 3 % len(SHARES)]
        if modes == 1 and not share:
            share = SHARES[1]
        yield kind, random_family(rng, kind, n, modes, share, OPTIONAL[seed // 5 % 2])


def ratio(certificate: Certificate) -> float:
    """Return the least ratio of the components in which something moves; 0 where no rate is proved."""
    parts = [part for part in certificate.parts if part.component.nodes.size > 1]
    ratios = [float(p.rate / p.upper_bound.value) if p.rate and p.upper_bound else 0.0 for p in parts]
    return min(ratios, default=float("nan"))


def certified(family: Family, limit: float) -> tuple[Certificate, float]:
    """Return the certificate and the seconds it took."""
    begin = time.perf_counter()
    certificate = certify(family, PROTOCOL, [1] * family.n_nodes, asks=Asks(time_limit=limit))
    assert certificate.verdict in ("certified", "undecided")
    return certificate, time.perf_counter() - begin


def quartiles(values: Any) -> str:
    """Return the least value, quartiles and the largest value in columns."""
    return "".join(f"{x:10.4g}" for x in np.quantile(np.asarray(values, dtype=float), (0, 0.25, 0.5, 0.75, 1)))


def random_part(count: int, limit: float) -> None:
    """Print quartiles over the random families, by kind and by size."""
    table: dict[str, list[float]] = defaultdict(list)
    seconds, without, cut = [], 0, 0
    for kind, family in ensemble(count):
        certificate, took = certified(family, limit)
        value = ratio(certificate)
        if np.isnan(value):
            continue
        seconds.append(took)
        without += value == 0
        cut += value == 0 and any("time limit" in note for note in certificate.notes)
        size = "N = 3..8" if family.n_nodes <= 8 else "N = 9..16"
        for name in ("all", kind, size, f"{len(family.modes)} modes" if len(family.modes) > 1 else "1 mode"):
            table[name].append(value)
    print(f"\n{count} random families, N = {SIZES[0]}..{SIZES[-1]}: proved rate over proved upper bound")
    print(f"{'':<14}{'families':>9}{'least':>10}{'quarter':>10}{'median':>10}{'3/4':>10}{'largest':>10}")
    for name, values in table.items():
        print(f"{name:<14}{len(values):>9}{quartiles(values)}")
    print(f"{'seconds':<14}{len(seconds):>9}{quartiles(seconds)}")
    print(f"no rate proved: {without}, of which searches were cut off after {limit:g} s: {cut}")


def published_part(folder: Path, limit: float) -> None:
    """Print a line for each published graph and share of uncertainty."""
    print(f"\n{'graph':<18}{'nodes':>6}{'edges':>6}{'':>6}{'seconds':>9}  ratio by component, behaviour")
    for name in PUBLISHED:
        graph = read_graph(folder / f"{name}.csv")
        for share in UNCERTAIN:
            certificate, took = certified(Family.from_graph(graph, uncertainty=share), limit)
            parts = [part for part in certificate.parts if part.component.nodes.size > 1]
            told = [_told(part) for part in parts]
            print(f"{name:<18}{graph.n_nodes:>6}{graph.n_edges:>6}{'+-' + share:>6}{took:>9.1f}  {', '.join(told)}")


def _told(part: ComponentProof) -> str:
    share = part.rate / part.upper_bound.value if part.rate and part.upper_bound else None
    return f"{'none' if share is None else format(float(share), '.4f')} {part.component.behaviour}"


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--time-limit", type=float, default=30)
    parser.add_argument("--real", type=Path)
    given = parser.parse_args()
    begin = time.perf_counter()
    if given.count:
        random_part(given.count, given.time_limit)
    if given.real is not None:
        published_part(given.real, given.time_limit)
    print(f"\n{time.perf_counter() - begin:.0f} seconds")


if __name__ == "__main__":
    main()
