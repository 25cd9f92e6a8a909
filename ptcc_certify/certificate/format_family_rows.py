"""Lyapunov functions in the file of a family's certificate, and their obligations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ptcc_certify.bounds.attracting_box import AttractingBox
from ptcc_certify.certificate.format_vectors import Writer, factor_entry
from ptcc_certify.checker.reading import Interval, exact
from ptcc_certify.checker.side_files import SideFiles
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.lyapunov.family_function import FamilyFunction
from ptcc_certify.lyapunov.family_rows import FollowerDecay
from ptcc_certify.lyapunov.follower_function import FollowerFunction, LeadingPart
from ptcc_certify.lyapunov.squares_function import SquaresFunction

#: Bits of integers that floats hold.
_FLOAT_BITS = 53


def form_entry(labels: list[str], number: int, V: FamilyFunction) -> dict[str, Any]:
    """Return a quadratic form of the agents ``labels``."""
    return {
        "class": V.kind,
        "component": number,
        "nodes": [labels[v] for v in V.nodes],
        "lower_triangle": [[format_exact(x) for x in row[: i + 1]] for i, row in enumerate(V.matrix)],
        "rate": format_exact(V.rate),
        "inputs": dict(zip(labels, map(format_exact, V.input_constants), strict=True)),
        "coordinates": dict(zip([labels[v] for v in V.nodes], map(format_exact, V.coordinate_constants), strict=True)),
        "means": [
            {
                "weights": {label: format_exact(w) for label, w in zip(labels, q, strict=True) if w},
                "constant": format_exact(constant),
            }
            for q, constant in V.means
        ],
    }


def rows_entry(labels: list[str], number: int, V: FollowerFunction, out: Writer) -> dict[str, Any]:
    """Return a function of the followers of a component of the agents ``labels``."""
    return {
        "class": V.kind,
        "component": number,
        "vector": _vector(V.vector, out),
        "parts": [_part(labels, number, part) for part in V.parts],
        "rate": format_exact(V.rate),
    }


def _vector(d: np.ndarray, out: Writer) -> Any:
    """Write positive integers; a long vector as floats, which hold what was rounded to their bits."""
    odd = max((int(x).bit_length() - (int(x) & -int(x)).bit_length() for x in d.tolist()), default=0)
    if out.aside(d.size) and odd < _FLOAT_BITS and int(d.max()).bit_length() < 1000:
        return out.floats("vector", d.astype(float))
    return [str(x) for x in d.tolist()]


def box_entry(labels: list[str], number: int, box: AttractingBox, out: Writer) -> dict[str, Any]:
    """Return a box of the followers of a component of the agents ``labels``."""
    return {
        "component": number,
        "nodes": [labels[v] for v in box.decay.nodes.tolist()],
        "vector": _vector(box.decay.vector, out),
        "lower": list(map(format_exact, box.lower)),
        "upper": list(map(format_exact, box.upper)),
        "rate": format_exact(2 * box.decay.rate),
    }


def range_entry(number: int, ends: Sequence[Interval]) -> dict[str, Any]:
    """Return a box in which all agents of a component stay."""
    lower, upper = zip(*ends, strict=True)
    return {"component": number, "lower": list(map(format_exact, lower)), "upper": list(map(format_exact, upper))}


def read_range(entry: Mapping[str, Any]) -> tuple[Interval, ...]:
    """Return what :func:`range_entry` has written."""
    return tuple(zip(*(map(exact, entry[key]) for key in ("lower", "upper")), strict=True))


def read_box(entry: Mapping[str, Any], labels: Sequence[str], files: SideFiles) -> AttractingBox:
    """Return a box of an accepted file."""
    index = {label: v for v, label in enumerate(labels)}
    nodes = np.array([index[label] for label in entry["nodes"]], dtype=np.int64)
    d, _ = files.numbers(entry["vector"], "vector", nodes.size).over(range(nodes.size))
    decay = FollowerDecay(nodes, np.array(d, dtype=object), exact(entry["rate"]) / 2)
    lower, upper = (tuple(map(exact, entry[key])) for key in ("lower", "upper"))
    return AttractingBox(decay, lower, upper)


def _part(labels: list[str], number: int, part: LeadingPart) -> dict[str, Any]:
    own = [labels[v] for v in part.agents.tolist()]
    bounds = part.ends | part.speeds
    return {
        "nodes": own,
        "function": form_entry(own, number, part.function),
        "times": format_exact(part.times),
        "bounds": [format_exact(bounds[v]) for v in part.agents.tolist()],
    }


def squares_entry(number: int, V: SquaresFunction, out: Writer) -> dict[str, Any]:
    """Return a weighted sum of squares."""
    vector = out.floats("vector", V.vector)
    return {"class": V.kind, "component": number, "vector": vector, "rate": format_exact(V.rate)}


Step = tuple[str, str, Any, dict[str, str]]


def form_steps(of: str, V: FamilyFunction) -> Iterator[Step]:
    """Yield kind, place, witness and numbers of the obligations of a quadratic form."""
    for mode, rate in enumerate(V.rates):
        multipliers = V.multipliers[mode] if V.multipliers else ()
        witness = {"multipliers": [format_exact(x) for x in multipliers]} if V.kind != "undirected" else None
        yield "family-rate", f"{of}.modes[{mode}]", witness, {"b": format_exact(rate)}


def rows_steps(of: str, V: FollowerFunction) -> Iterator[Step]:
    """Yield the same of a function of followers: of its parts, then of its rows."""
    for j, part in enumerate(V.parts):
        yield from form_steps(f"{of}.parts[{j}]", part.function)
    yield "family-rows", of, None, {"b": format_exact(V.rate)}


def squares_steps(of: str, V: SquaresFunction, out: Writer) -> Iterator[Step]:
    """Yield the same of a weighted sum of squares: of every mode."""
    for mode, factor in enumerate(V.factors):
        witness = {"factor": factor_entry(factor, V.power, out)}
        yield "family-squares", f"{of}.modes[{mode}]", witness, {"b": format_exact(V.rate)}
