"""Mutants of a certificate: every field outside ``unverified`` changed in several ways."""

from __future__ import annotations

import copy
import json
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from ptcc_certify.certificate.json_schema import json_schema
from ptcc_certify.checker import check, digest

Path = tuple[str | int, ...]
Json = dict[str, Any]

#: Where the graph stands, and the edges of one fixed graph.
GRAPH: Path = ("problem", "graph")
EDGES: Path = (*GRAPH, "modes", 0, "edges")


def part_of(path: Path) -> str | int:
    """The part of a certificate that a path leads into, or the part of its problem."""
    return path[1] if path[0] == "problem" and len(path) > 1 else path[0]


def leaves(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Every value that is no container, and every empty container, with its path."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    found = False
    for key, item in items:
        if path or key not in ("unverified", "digest"):
            yield from leaves(item, (*path, key))
        found = True
    if not found:
        yield path, value


def containers(value: Any, path: Path = ()) -> Iterator[Path]:
    """Every list or object, with its path."""
    if isinstance(value, dict | list):
        yield path
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            if path or key not in ("unverified", "digest"):
                yield from containers(item, (*path, key))


def at(data: Any, path: Path) -> Any:
    for key in path:
        data = data[key]
    return data


def changed(data: Json, path: Path, new: Any) -> Json:
    """A copy of ``data`` with another value at ``path``; only what leads there is copied."""
    if not path:
        return new
    result: Any = copy.copy(data)
    result[path[0]] = changed(data[path[0]], path[1:], new) if path[1:] else new
    return result


def without(data: Json, path: Path) -> Json:
    """A copy of ``data`` without a key that is there."""
    *inside, key = path
    part = dict(at(data, tuple(inside)))
    del part[key]
    return changed(data, tuple(inside), part)


@cache
def sections() -> list[tuple[set[str], set[str]]]:
    """The keys that every kind of section must have, and those that it may have."""
    found, todo = [], [json_schema()]
    for part in todo:
        if isinstance(part, dict) and part.get("additionalProperties") is False:
            found.append((set(part["required"]), set(part["properties"])))
        todo += part.values() if isinstance(part, dict) else part if isinstance(part, list) else ()
    return found


def of_keys(value: Any) -> list[tuple[str, Any]]:
    """A section without a key that may be absent, or with one that is; and the key."""
    if not isinstance(value, dict):
        return []
    fit = [(needed, known) for needed, known in sections() if needed <= set(value) <= known]
    free = sorted({key for needed, known in fit for key in known - needed})
    less = [(key, {k: x for k, x in value.items() if k != key}) for key in free if key in value]
    return less + [(key, {**value, key: x}) for key in free if key not in value for x in ("1", {}, 0, None)]


def of_leaf(value: Any, labels: list[str], long: bool) -> list[Any]:
    """Other values for a leaf."""
    if isinstance(value, bool):
        return [not value, int(value), None]
    if isinstance(value, int):
        return [-value, value + 1, True, str(value), 10**17]
    if value is None:
        return ["1", {}, 0]
    if isinstance(value, str):
        new: list[Any] = [value + " ", None]
        if value[-1:].isdigit():
            new = [value[:-1] + str((int(value[-1]) + 1) % 10), value[:-1] + str((int(value[-1]) - 1) % 10)]
            new += [value[1:] if value.startswith("-") else "-" + value, "nan", value + "0", [value]]
        if value in labels:
            new.append(labels[labels.index(value) - 1] if len(labels) > 1 else "another")
        if long:
            new += ["1e999999999", "9" * 5000, "1/0", "0x1p99999"]
        return [x for x in new if x != value and (number(x) is None or number(x) != number(value))]
    return [None, "1", [[]], {"a": 1}]


def number(text: Any) -> Fraction | None:
    """The rational that a text writes as ``p`` or ``p/q``: ``00`` is no other number than ``0``."""
    plain = isinstance(text, str) and re.fullmatch(r"-?[0-9]{1,400}(/[0-9]*[1-9][0-9]*)?", text)
    return Fraction(text) if plain else None


def of_container(value: Any) -> list[Any]:
    """A container with an entry less, more, twice, or two in the other order."""
    if isinstance(value, list):
        new = [value[:-1], [*value, value[-1]], [*value, None], value[::-1]] if value else [[None]]
        if len(value) > 1:
            new.append([value[1], value[0], *value[2:]])
    else:
        keys = list(value)
        new = [{**value, "more": None}]
        if keys:
            new += [{k: value[k] for k in keys[:-1]}, {k: value[k] for k in keys[1:]}]
            if len(keys) > 1:
                new.append(dict(zip(keys, [value[k] for k in [*keys[1:], keys[0]]], strict=True)))
    return [x for x in new if x != value]


def mutants(data: Json, every: int = 1, start: int = 0, long: bool = False) -> Iterator[tuple[Path, Json]]:
    """Single changes: of every leaf and of every container, one of ``every`` from ``start`` on."""
    labels, count = data["problem"]["graph"]["nodes"], start
    for path, value in leaves({k: v for k, v in data.items() if k not in ("unverified", "digest")}):
        for new in of_leaf(value, labels, long):
            count += 1
            if count % every == 0:
                yield path, changed(data, path, new)
    for path in containers({k: v for k, v in data.items() if k not in ("unverified", "digest")}):
        if path:
            for new in of_container(at(data, path)):
                count += 1
                if count % every == 0:
                    yield path, changed(data, path, new)
    for path in containers(data):
        for key, new in of_keys(at(data, path)):
            count += 1
            if count % every == 0:
                yield (*path, key), changed(data, path, new)


def without_instants(data: Json) -> Json:
    """A certificate of agents without what it says of instants on the way."""
    proof = [step for step in data["proof"] if step["kind"] != "agent-instants"]
    return resealed({key: x for key, x in data.items() if key != "instants"} | {"proof": proof})


def resealed(data: Json) -> Json:
    """The same with a digest that fits, as a forger would write it."""
    return {**data, "digest": digest(data)}


def same_claim(one: Json, other: Json) -> bool:
    """Whether two certificates say the same outside ``unverified``; the order of the keys of an object says nothing."""
    return json.dumps(one, sort_keys=True) == json.dumps(other, sort_keys=True)


def judged_mutants(
    data: Json, changes: Iterator[tuple[Any, Json]], false_claims: Callable[[Json], list[str]]
) -> tuple[int, Counter[str]]:
    """Check mutants, with digests that fit; whatever is accepted must be true. Return their number, and what was."""
    count, passed = 0, Counter[str]()
    for path, mutant in changes:
        if same_claim(mutant, data):
            continue
        count += 1
        mutant = resealed(mutant)
        if check(mutant, stdlib=bool(count % 2)).accepted:
            assert false_claims(mutant) == [], path
            passed[re.sub(r"\d+", "k", ".".join(map(str, path[:3])))] += 1
    return count, passed


def nudged(
    data: Json, parts: Sequence[str], seed: int, count: int, again: Callable[[Json, Any, str], Json]
) -> Iterator[tuple[Any, Json]]:
    """Numbers of some parts, a little larger or smaller or of the other sign; ``again`` tells them once more."""
    rng = np.random.default_rng(seed)
    places = [(path, x) for path, x in leaves(data) if part_of(path) in parts]
    places = [(path, x) for path, x in places if isinstance(x, str) and re.fullmatch(r"-?[0-9./]+", x)]
    for _ in range(count):
        path, text = places[int(rng.integers(len(places)))]
        value, step = Fraction(text), Fraction(1, 2 ** int(rng.integers(1, 60)))
        more = [value * (1 + step), value * (1 - step), value + step, value - step, value * 2, value / 2, -value]
        new = str([*more, Fraction(0)][int(rng.integers(8))])
        yield path, again(changed(data, path, new), path, new)
