"""How far the proved bounds of the input lie above what is seen, and whether the paper's inputs stay bounded.

    OPENBLAS_NUM_THREADS=1 python benchmarks/effort.py [--real FOLDER]

The packaged graphs, and the real graphs of up to 105 nodes of a folder if it is given. ``rho2 kappa`` is 1.5 times the
threshold of each graph. For all initial states with ``||X(0)||_inf <= 1`` and for 20 random ones of them alone, and the
worst: the proved bound over what the motion does, from matrix exponentials at 2000 instants. Then the paper's Examples
1 to 3.
"""

from __future__ import annotations

import argparse
import time
from fractions import Fraction
from pathlib import Path

import numpy as np
from scipy.linalg import expm

from ptcc_certify import NominalProtocol, SignedDigraph, analyse, certify, read_graph
from ptcc_certify.bounds.input.effort import Effort
from ptcc_certify.bounds.input.initial_sets import initial_set_within
from ptcc_certify.bounds.input.worst_initial_state import worst_initial_state
from ptcc_certify.errors import PTCCError
from ptcc_certify.examples import EXAMPLES, GRAPHS, load_graph
from ptcc_certify.model.asks import Asks

LARGEST, STARTS, OVER = 105, 20, Fraction(3, 2)
#: Cells that grow by 7% up to ``z = ln(T/(T - t)) = 20``, ten Gauss nodes in each.
EDGES = np.append(0.0, np.geomspace(1e-6, 20, 200))
NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)
Z = (EDGES[:-1, None] + np.diff(EDGES)[:, None] * (NODES + 1) / 2).ravel()
DZ = (np.diff(EDGES)[:, None] * WEIGHTS / 2).ravel()
KINDS = ("peak of an agent", "largest peak", "peak of the norm", "energy", "path length")
#: Bound over seen, of which less than 1 would be a violation, by kind.
Ratios = dict[str, list[float]]


def motion(graph: SignedDigraph, protocol: NominalProtocol, initial_states: np.ndarray) -> tuple[np.ndarray, ...]:
    """Sizes of every agent's input at most (N, S), of the norm, energy and path length (S,)."""
    L, still = graph.laplacian().toarray(), sum(c.balanced for c in analyse(graph).closed_components)
    basis = np.linalg.svd(L)[0][:, : graph.n_nodes - still]  # of what decays
    inside, E = basis.T @ L @ basis, -basis.T @ L @ initial_states
    gain, T = protocol.gain, float(protocol.T)
    s, before = gain.clock_at_tau(Z), 0.0
    u = gain.value_at_remaining(1.0) * np.abs(basis @ E)
    agents, norm, energy, length = u, np.linalg.norm(u, axis=0), 0.0, 0.0
    for clock, z, dz in zip(s, Z, DZ, strict=True):
        E, before = expm(-inside * (clock - before)) @ E, clock
        u = gain.value_at_remaining(np.exp(-z)) * np.abs(basis @ E)
        size, dt = np.linalg.norm(u, axis=0), dz * T * np.exp(-z)
        agents, norm = np.maximum(agents, u), np.maximum(norm, size)
        energy, length = energy + dt * size**2, length + dt * size
    agents[~L.any(axis=1)] = 0
    return agents, norm, np.asarray(energy), np.asarray(length)


def ratios(effort: Effort, seen: tuple[np.ndarray, ...]) -> Ratios:
    """Bounds over what was seen of the initial states together."""
    assert effort.peak is not None and effort.energy is not None and effort.path_length is not None
    agents = zip(effort.peak.agents, seen[0].max(axis=1), strict=True)
    bounds = (effort.peak.largest, effort.peak.norm, effort.energy.value, effort.path_length.value)
    values = (seen[0].max(), *(x.max() for x in seen[1:]))
    moving = 1e-9 * seen[0].max()  # below, it is rounding that is seen
    found = [[float(b) / x for b, x in agents if x > moving]]
    found += [[float(b) / x] for b, x in zip(bounds, values, strict=True)]
    return dict(zip(KINDS, found, strict=True))


def examine(name: str, graph: SignedDigraph) -> tuple[Ratios, Ratios] | None:
    """Ratios for single initial states, and for the box with the worst initial state among those tried."""
    began = time.perf_counter()
    proved = certify(graph, NominalProtocol(1, 1, 1, 1), [0] * graph.n_nodes, asks=Asks(simulation=False))
    if proved.rate is None:
        print(f"{name:<26} N {graph.n_nodes:>3}  nothing decays, or nothing was proved")
        return None
    k = OVER * 2 / proved.rate.limit_denominator(10**9)
    cert = proved.changed(protocol=NominalProtocol(1, Fraction(1, 2) * k, k, 1), initial_set=None)
    rng = np.random.default_rng(graph.n_nodes)
    states = rng.integers(-100, 101, (graph.n_nodes, STARTS)) / 100
    boxed = cert.changed(initial_set=initial_set_within(cert.structure, 1))
    assert boxed.initial_set is not None
    worst = worst_initial_state(cert.structure, cert.protocol, boxed.initial_set)
    points = np.column_stack([states, worst.x0])
    seen = motion(graph, cert.protocol, points)  # type: ignore[arg-type]
    alone: Ratios = {kind: [] for kind in KINDS}
    for i in range(STARTS + 1):
        effort = cert.changed(initial_state=tuple(Fraction(float(x)) for x in points[:, i])).effort
        assert effort is not None
        one = (seen[0][:, i : i + 1], *(x[i : i + 1] for x in seen[1:]))
        if one[1].max() > 0:
            for kind, own in ratios(effort, one).items():
                alone[kind] += own
    assert boxed.effort is not None
    together = ratios(boxed.effort, seen)
    sides = "  ".join(f"{kind} {together[kind][0]:.3f}" for kind in KINDS[1:])
    print(f"{name:<26} N {graph.n_nodes:>3}  {sides}  {time.perf_counter() - began:.1f} s", flush=True)
    return alone, together


def report(title: str, found: list[Ratios]) -> int:
    """Print quartiles and return the number of violations."""
    print(f"\n{title}: proved over seen")
    print(f"{'':<18}{'count':>7}{'25%':>10}{'50%':>10}{'75%':>10}{'max':>10}{'min':>14}")
    broken = 0
    for kind in KINDS:
        own = [x for one in found for x in one[kind]]
        q = "".join(f"{x:>10.4g}" for x in np.quantile(own, [0.25, 0.5, 0.75, 1]))
        print(f"{kind:<18}{len(own):>7}{q}{min(own):>14.9f}")
        broken += sum(x < 1 - 1e-9 for x in own)
    return broken


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--real", help="folder of edge lists, of which those up to 105 nodes are taken")
    options = parser.parse_args()
    graphs = [(name, load_graph(name)) for name in GRAPHS]
    for path in sorted(Path(options.real).glob("*.csv")) if options.real else ():
        try:
            graph = read_graph(path)
        except PTCCError as error:
            print(f"{path.name}: {error}")
            continue
        if graph.n_nodes <= LARGEST:
            graphs.append((path.name, graph))
    print("all initial states within 1: proved over the largest seen of 20 random initial states and the worst")
    found = [pair for name, graph in graphs if (pair := examine(name, graph)) is not None]
    broken = report("every initial state alone", [alone for alone, _ in found])
    broken += report("all initial states within 1", [together for _, together in found])
    print(f"\nviolations: {broken}\n\nExamples 1 to 3: rho2 kappa min Re lambda, bounded from 1 on")
    for number in (1, 2, 3):
        for name in EXAMPLES[number].graphs:
            protocol = EXAMPLES[number].protocol()
            effort = certify(load_graph(name), protocol, asks=Asks(simulation=False)).effort
            assert effort is not None
            low, high = (float("nan") if x is None else float(x) for x in effort.threshold)
            print(f"{number} {name:<8}{'bounded' if effort.bounded else 'UNBOUNDED':<10} {low:.6f} .. {high:.6f}")
    if broken:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
