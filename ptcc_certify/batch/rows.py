"""The row of one graph: what its certificate says in numbers and words, or why there is none.

The columns, in this order; an entry that does not apply, or was not proved, is empty:

==================  =====  ============================================================================================
graph               text   path, or ``spec.toml#i`` for graph ``i`` of an ensemble; control characters as escape codes
sha256              text   of the canonical edge list (:attr:`SignedDigraph.sha256`)
nodes               int
edges               int
negative            int    edges of negative weight
connectivity        text   strong, quasi-strong, weak or disconnected
components          int    weakly connected components
leaders             int    nodes in closed components
followers           int
closed_components   int
balanced_leaders    int    closed components that are balanced
balanced            bool   whether the whole graph is balanced
theorem             text   of a disconnected graph those of its components, each once, joined by ``"; "``
behaviour           text   likewise
verdict             text   certified or undecided
useful              bool   whether the bound leaves at most 1 % at 0.99 T with these gains; empty if undecided
asked               text   met, refuted or left open: what was expected, and the least rate; empty if nothing was
rate                float  proved, rounded down; per unit of the stretched clock
upper_bound         float  proved upper bound on the decay rate, rounded up
optimality_ratio    float  rate over upper_bound, rounded down
fastest             text   class of the Lyapunov function with that rate: paper, perron, lmi or full
overshoot           float  its overshoot constant, rounded up
paper_rate          float  of the paper's own certificate, proved, rounded down
diagonal_rate       float  largest proved rate of a diagonal matrix, rounded down
input_bounded       bool   whether the input stays bounded up to the deadline for every initial state
peak_input          float  proved bound of every ``|u_k|`` from the initial state or set, rounded up
seed                int    of the random state: ``ptcc certify GRAPH --x0 random --seed SEED`` certifies the same
largest_final_state float  largest ``|x_k|`` at the deadline
degenerate          bool   whether some balanced closed component meets at 0
reaching_time       float  sliding mode: when the last sliding variable is proved to be 0
worst_ratio         float  numerical: largest simulated ``sqrt(V)`` over its bound
bound_kept          bool   numerical: whether the simulated run exceeds no bound
obligations         int    proof obligations proved
cut_off             text   the searches that the time limit ended, which a row of more time may do better
note                text   what kept the verdict from certified, and other remarks
seconds             float  that the row took
error               text   why there is no certificate, in one line; empty if there is one
==================  =====  ============================================================================================
"""

from __future__ import annotations

import io
import math
import threading
import time
from dataclasses import asdict
from fractions import Fraction
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import ptcc_certify
from lmi.exact.decimal_rounding import float_down, float_up
from ptcc_certify.batch.sources import Settings, StateLike
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.certification import certify
from ptcc_certify.errors import PTCCError, explain, one_line
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io import random_states, read_graph, read_state
from ptcc_certify.model.asks import Asks, Expectations, InitialState

#: A row: column by column, None where an entry is empty.
Row = dict[str, Any]
#: The columns in their order, and of which type their entries are.
COLUMNS: dict[str, type] = {
    name: kind
    for kind, names in (
        (str, "graph sha256"),
        (int, "nodes edges negative"),
        (str, "connectivity"),
        (int, "components leaders followers closed_components balanced_leaders"),
        (bool, "balanced"),
        (str, "theorem behaviour verdict"),
        (bool, "useful"),
        (str, "asked"),
        (float, "rate upper_bound optimality_ratio"),
        (str, "fastest"),
        (float, "overshoot paper_rate diagonal_rate"),
        (bool, "input_bounded"),
        (float, "peak_input"),
        (int, "seed"),
        (float, "largest_final_state"),
        (bool, "degenerate"),
        (float, "reaching_time worst_ratio"),
        (bool, "bound_kept"),
        (int, "obligations"),
        (str, "cut_off note"),
        (float, "seconds"),
        (str, "error"),
    )
    for name in names.split()
}
# python-flint keeps one working precision for a whole process: its threads take turns.
_ONE_AT_A_TIME = threading.Lock()


def certified_row(name: str, payload: Any, settings: Settings) -> Row:
    """Return the row of one graph; whatever goes wrong is told in it.

    Parameters
    ----------
    name : str
    payload : bytes, pair (Ensemble, int), SignedDigraph or PTCCError
        The content of a file, or what stands for a graph, or why there is none.
    settings : Settings
    """
    began = time.perf_counter()
    row: Row = dict.fromkeys(COLUMNS)
    row["graph"] = printable(name)
    try:
        with _ONE_AT_A_TIME, threadpool_limits(limits=1, user_api="blas"):  # processes are better than threads
            graph = _graph(name, payload, settings)
            negative = int((graph.sign < 0).sum())
            row |= {"sha256": graph.sha256, "nodes": graph.n_nodes, "edges": graph.n_edges, "negative": negative}
            row["seed"] = settings.seed_of(graph)
            row |= _columns(_certificate(graph, settings, row["seed"]))
    except Exception as error:
        row["error"] = explain(error)
    row["seconds"] = round(time.perf_counter() - began, 6)
    return row


def failed_row(name: str, why: str) -> Row:
    """Return the row of a graph of which nothing is known but why."""
    return dict.fromkeys(COLUMNS) | {"graph": printable(name), "seconds": 0.0, "error": why}


def package_version() -> str:
    """Return the version of this package, on which rows depend."""
    return str(ptcc_certify.__version__)


def _graph(name: str, payload: Any, settings: Settings) -> SignedDigraph:
    if isinstance(payload, PTCCError):
        raise payload
    if isinstance(payload, SignedDigraph):
        return payload
    if isinstance(payload, tuple):
        ensemble, i = payload
        return ensemble.graph(i)
    file = io.BytesIO(payload)
    file.name = name if name != "-" else "./-"  # its ending tells the format, and - is not standard input here
    return read_graph(file, **asdict(settings.reading))


def _certificate(graph: SignedDigraph, settings: Settings, seed: int) -> Certificate:
    return certify(
        graph,
        settings.protocol,
        # The seeds are those of `ptcc certify --x0 random --sigma0 random --seed SEED`.
        InitialState(
            _read_initial_state(settings.x0, seed, graph), _read_initial_state(settings.sigma0, [seed, 1], graph)
        ),
        asks=Asks(
            method=settings.method,
            simulation=settings.simulation,
            initial_set=settings.initial_bound,
            time_limit=None if settings.time_limit is None else float(settings.time_limit),
            expectations=Expectations(settings.expect, settings.min_rate),
            disturbance=settings.disturbance_of(graph.n_nodes, seed),
        ),
    )


def _read_initial_state(initial_state: StateLike, seed: Any, graph: SignedDigraph) -> Any:
    if not isinstance(initial_state, str):
        return initial_state
    if initial_state != "random":
        return [Fraction(0)] * graph.n_nodes if initial_state.strip() == "0" else read_state(initial_state, graph)
    return [x for (x,) in random_states(seed, graph.n_nodes)]


def _columns(certificate: Certificate) -> Row:
    proof = certificate.graph_proof
    structure, effort, comparison, rate = proof.structure, proof.effort, certificate.comparison, proof.rate
    result, reaching = proof.final_state, proof.reaching
    return {
        "connectivity": structure.connectivity,
        "components": len(structure.components),
        "leaders": int(structure.leaders.size),
        "followers": int(structure.followers.size),
        "closed_components": len(structure.closed_components),
        "balanced_leaders": sum(c.balanced for c in structure.closed_components),
        "balanced": structure.balanced,
        "theorem": "; ".join(dict.fromkeys(claim.theorem for claim in proof.claims)),
        "behaviour": "; ".join(dict.fromkeys(claim.behaviour for claim in proof.claims)),
        "verdict": certificate.verdict,
        "useful": certificate.assessment.useful,
        "asked": certificate.assessment.asked,
        "rate": _down(rate),
        "upper_bound": _up(proof.upper_bound),
        "optimality_ratio": proof.optimality_ratio,
        "fastest": None if rate is None else proof.fastest.kind,
        "overshoot": _up(proof.overshoot),
        "paper_rate": _down(proof.paper_rate),
        "diagonal_rate": _down(proof.diagonal_rate),
        "input_bounded": None if effort is None else effort.bounded,
        "peak_input": None if effort is None or effort.peak is None else _up(Fraction(effort.peak.largest)),
        "largest_final_state": None if result is None else _finite(float(np.abs(np.asarray(result)).max())),
        "degenerate": None if result is None else bool(result.degenerate),
        "reaching_time": None if reaching is None else max(r.time for r in reaching),
        "worst_ratio": None if comparison is None else _finite(comparison.worst_ratio),
        "bound_kept": None if comparison is None else not comparison.violated,
        "obligations": len(certificate.obligations),
        "cut_off": one_line("; ".join(certificate.observed.cut_off)) or None,
        "note": one_line("; ".join(certificate.observed.notes)) or None,
    }


def _down(x: Fraction | None) -> float | None:
    """Round a proved number so that it stays true as a lower bound; None beyond float64."""
    return None if x is None else _finite(float_down(x))


def _up(x: Fraction | None) -> float | None:
    """Round a proved number so that it stays true as an upper bound; None beyond float64."""
    return None if x is None else _finite(float_up(x))


def _finite(x: float) -> float | None:
    return float(x) if math.isfinite(x) else None


def printable(name: str) -> str:
    """Write as escape codes what is no character in the name of a file, or would break the line of a table."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in name)
