"""Random changes of certificates that know nothing of their fields; what comes of them is for a judge to say."""

from __future__ import annotations

import copy
import hashlib
import io
import json
import os
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from mutations import EDGES, GRAPH, Json, at, changed, containers, leaves, of_container, of_keys, of_leaf, resealed
from oracle import number

Rng = np.random.Generator
#: A change of a certificate and its side files, and how often it is taken.
Way = tuple[Callable[[Rng, Json, dict[str, bytes]], Json], float]

SEED = int(os.environ.get("PTCC_FUZZ_SEED", "0"))


def numbers(most: int) -> Iterator[int]:
    """The cases that are drawn."""
    only = os.environ.get("PTCC_FUZZ_ONLY")
    return iter([int(only)] if only else range(int(os.environ.get("PTCC_FUZZ_COUNT", most))))


def fraction(text: Any) -> Fraction | None:
    try:
        return Fraction(text) if isinstance(text, str) and "x" not in text.lower() and len(text) < 500 else None
    except (ValueError, ZeroDivisionError):
        return None


def nudged(rng: Rng, text: str) -> str:
    """Another number: a little or much larger or smaller, of the other sign, or 0."""
    value = fraction(text)
    if value is None:
        return text + "0"
    step = Fraction(1, 2 ** int(rng.integers(1, 60)))
    more = [
        value * (1 + step),
        value * (1 - step),
        value + step,
        value - step,
        value * 2,
        value / 2,
        -value,
        Fraction(0),
    ]
    return str(more[int(rng.choice(len(more), p=[0.25, 0.25, 0.15, 0.15, 0.05, 0.05, 0.05, 0.05]))])


def pick(rng: Rng, items: list[Any]) -> Any:
    return items[int(rng.integers(len(items)))]


def a_leaf(rng: Rng, data: Json, files: dict[str, bytes]) -> Json:
    path, value = pick(rng, list(leaves(data)))
    if isinstance(value, str) and fraction(value) is not None and rng.random() < 0.7:
        return changed(data, path, nudged(rng, value))
    new = of_leaf(value, data["problem"]["graph"]["nodes"], False)
    return changed(data, path, pick(rng, new)) if new else data


def everywhere(rng: Rng, data: Json, files: dict[str, bytes]) -> Json:
    """A number in all places where it stands alike: what is claimed, and the proof of it."""
    texts = [v for path, v in leaves(data) if fraction(v) is not None and path[:2] != GRAPH]
    old = pick(rng, texts)
    new = nudged(rng, old)
    for path, value in list(leaves(data)):
        if value == old and path[:2] != GRAPH:
            data = changed(data, path, new)
    return data


def a_container(rng: Rng, data: Json, files: dict[str, bytes]) -> Json:
    path = pick(rng, list(containers(data)))
    new = [*(of_container(at(data, path)) if path else ()), *(section for _, section in of_keys(at(data, path)))]
    return changed(data, path, pick(rng, new)) if new else data


def a_swap(rng: Rng, data: Json, files: dict[str, bytes]) -> Json:
    """Two numbers, or two containers, in each other's place."""
    if rng.random() < 0.5:
        (one, x), (other, y) = (pick(rng, [e for e in leaves(data) if fraction(e[1]) is not None]) for _ in range(2))
    else:
        one, other = (pick(rng, [p for p in containers(data) if len(p) > 1]) for _ in range(2))
        if one[: len(other)] == other or other[: len(one)] == one:
            return data
        x, y = at(data, one), at(data, other)
    return changed(changed(data, one, y), other, x)


def with_hash(data: Json) -> Json:
    """The same with its edges in order and their SHA-256, by section 5 of the format."""
    nodes, edges = data["problem"]["graph"]["nodes"], data["problem"]["graph"]["modes"][0]["edges"]
    index = {label: v for v, label in enumerate(nodes)}
    edges = sorted(edges, key=lambda edge: (index[edge[1]], index[edge[0]]))
    plain = {"ensure_ascii": False, "separators": (", ", ": ")}
    lines = [json.dumps([label], **plain) for label in sorted(nodes)]
    lines += [json.dumps([s, t, str(number(w))], **plain) for s, t, w in sorted(edges)]
    sha256 = hashlib.sha256("".join(f"{line}\n" for line in lines).encode("utf-8", "surrogatepass")).hexdigest()
    data = changed(data, EDGES, edges)
    return changed(data, (*GRAPH, "sha256"), sha256)


def an_edge(rng: Rng, data: Json, files: dict[str, bytes]) -> Json:
    """Another graph with the same claims: an edge less, more, turned, of another sign or weight."""
    edges = data["problem"]["graph"]["modes"][0]["edges"]
    if not isinstance(edges, list) or not edges:
        return data
    edges, k = copy.deepcopy(edges), int(rng.integers(len(edges)))
    way = int(rng.integers(5))
    if way == 0:
        del edges[k]
    elif way == 1:
        edges[k] = [edges[k][1], edges[k][0], edges[k][2]]
    elif way == 2:
        edges[k][2] = str(-Fraction(edges[k][2]))
    elif way == 3:
        edges[k][2] = nudged(rng, edges[k][2])
    else:
        edges.append([*rng.choice(data["problem"]["graph"]["nodes"], 2).tolist(), "1"])
    ends = [(s, t) for s, t, _ in edges]
    if len(set(ends)) < len(ends) or any(s == t for s, t in ends) or not all(Fraction(w) for _, _, w in edges):
        return data
    return with_hash(changed(data, EDGES, edges))


def a_label(rng: Rng, data: Json, files: dict[str, bytes]) -> Json:
    """A node of another name, wherever it is named."""
    edges = data["problem"]["graph"]["modes"][0]["edges"]
    old, new = (
        pick(rng, data["problem"]["graph"]["nodes"]),
        pick(rng, ["another", "", "0x1p3", '"\\', "é\U0001f600", "count"]),
    )
    if new in data["problem"]["graph"]["nodes"] or not isinstance(edges, list):
        return data

    def renamed(value: Any) -> Any:
        if isinstance(value, dict):
            return {new if key == old and key not in ("u",) else key: renamed(x) for key, x in value.items()}
        return [renamed(x) for x in value] if isinstance(value, list) else new if value == old else value

    renewed = {**data, **{key: renamed(data[key]) for key in data if key != "rates"}}
    return with_hash(changed(renewed, ("problem", "gain"), data["problem"]["gain"]))


def a_side_file(rng: Rng, data: Json, files: dict[str, bytes]) -> Json:
    """Another entry of a side file, with a hash that fits; or another count, or scale."""
    paths = [p for p in containers(data) if isinstance(at(data, p), dict) and "file" in at(data, p)]
    if not paths:
        return data
    path = pick(rng, paths)
    said = at(data, path)
    if said["file"] not in files:
        return data
    values = np.load(io.BytesIO(files[said["file"]]))
    k, way = int(rng.integers(values.size)), int(rng.integers(8))
    if way == 0:
        values = values[:-1]
    elif way == 1:
        values = np.append(values, values[-1:])
    elif way == 2 and values.dtype.kind == "i":
        values = values.astype("<f8")
    elif way == 3:
        values[k] = -values[k]
    elif way == 4:
        values[[k, 0]] = values[[0, k]]
    elif values.dtype.kind == "f":
        values[k] *= 1 + float(rng.choice([-1, 1])) * 2.0 ** -int(rng.integers(0, 53))
    else:
        values[k] += int(rng.choice([-1, 1])) * 2 ** int(rng.integers(0, 40))
    head = f"{{'descr': '{values.dtype.str}', 'fortran_order': False, 'shape': ({values.size},), }}".ljust(117) + "\n"
    content = b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head.encode() + values.tobytes()
    sha256 = hashlib.sha256(content).hexdigest()
    files[f"{sha256[:16]}.npy"] = content
    new = {**said, "file": f"{sha256[:16]}.npy", "sha256": sha256}
    if "count" in said and rng.random() < 0.5:
        new["count"] = values.size
    return changed(data, path, new)


WAYS: list[Way] = [
    (a_leaf, 0.35),
    (everywhere, 0.2),
    (a_container, 0.12),
    (a_swap, 0.05),
    (an_edge, 0.06),
    (a_label, 0.03),
    (a_side_file, 0.15),
]


def mutant(rng: Rng, data: Json, files: dict[str, bytes], among: Sequence[Way] = WAYS) -> tuple[Json, list[str]]:
    """A certificate changed in one place or several, with a digest that fits; and how."""
    ways = []
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        shares = np.array([share for _, share in among])
        way = among[int(rng.choice(len(among), p=shares / shares.sum()))][0]
        ways.append(way.__name__)
        try:
            data = way(rng, data, files)
        except (KeyError, IndexError, TypeError, ValueError, AttributeError):
            continue  # what was changed before does not fit any more
    return resealed(data), ways
