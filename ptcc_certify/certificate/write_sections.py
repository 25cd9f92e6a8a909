"""Writes the sections of a certificate as the independent check declares them: :mod:`ptcc_certify.checker.sections`."""

from __future__ import annotations

from dataclasses import is_dataclass
from fractions import Fraction
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np

from ptcc_certify.certificate.format_vectors import Writer, interval_text
from ptcc_certify.checker.sections import Pattern, Rule, declared
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.graphs.rationals import format_exact


def write(kind: Any, value: Any, out: Writer, key: str = "a vector") -> Any:
    """Return what stands in the file for a value of this declaration.

    Parameters
    ----------
    kind : declaration
    value : object
        A section, or anything with attributes of these names: numbers as Fraction, or as floats, which are the dyadic
        numbers that they are; vectors as sequences or arrays.
    out : Writer
        Where long vectors go.
    key : str
        Under which it stands, which names its side file.
    """
    if value is None:
        return None
    if get_origin(kind) in (Union, UnionType):
        kinds = [one for one in get_args(kind) if one is not NoneType]
        return write(next((one for one in kinds if _fits(one, value)), kinds[0]), value, out, key)
    value = value.values if isinstance(value, Numbers) else value
    if get_origin(kind) is Annotated:
        return _annotated(*get_args(kind), value=value, out=out, key=key)
    if get_origin(kind) is tuple:
        return [write(inner, one, out, key) for inner, one in zip(get_args(kind), value, strict=True)]
    if kind is Fraction:
        return _text(value)
    if isinstance(kind, type) and is_dataclass(kind):
        pairs = ((f, getattr(value, f.name)) for f in declared(kind))
        return {f.key: write(f.kind, one, out, f.key) for f, one in pairs if not (f.optional and one is None)}
    return value


def _fits(kind: Any, value: Any) -> bool:
    """Tell whether a value is of one of several kinds."""
    if get_origin(kind) is Annotated:
        return _fits(get_args(kind)[0], value)
    if get_origin(kind) is Literal:
        return value in get_args(kind)
    kind = get_origin(kind) or kind
    return kind is Any or (isinstance(kind, type) and isinstance(value, kind))


def _text(value: Fraction | float) -> str:
    """Write a number exactly; a float as the dyadic number that it is."""
    if isinstance(value, float):
        return value.hex() if value else "0"
    return format_exact(value)


def _annotated(inner: Any, note: Any, *rest: str, value: Any, out: Writer, key: str) -> Any:
    if isinstance(note, Rule | Pattern):
        return write(inner, value, out, key)
    if note == "a ball":
        return interval_text(value)
    if note == "a list":
        return [write(get_args(inner)[0], one, out, key) for one in value]
    if note == "ends by agent":
        return dict(zip(out.labels, map(interval_text, zip(*value, strict=True)), strict=True))
    if note == "lower triangle":
        return [list(map(_text, row[: k + 1])) for k, row in enumerate(value)]
    if note == "by some agents":
        return {label: write(get_args(inner)[1], x, out, key) for label, x in value.items()}
    if note == "a label":
        return out.labels[value]
    if note == "nodes":
        return [out.labels[v] for v in value]
    if note == "many nodes":
        return out.nodes(value)
    if note in ("integers", "integers of followers"):
        return out.integers(key, np.asarray(value))
    if note == "numbers" and not isinstance(value, np.ndarray):  # whose length the file does not tell
        return list(map(format_exact, value))
    if note.startswith("numbers"):
        return _numbers(value, out, key)
    if inner is Numbers and not rest and isinstance(value, np.ndarray) and out.aside(value.size):
        return out.vector(key, value)
    if inner is Numbers and not rest and not isinstance(value, np.ndarray):
        return out.state(key, value)
    labels, each = out.followers if note == "by follower" else out.labels, Fraction if inner is Numbers else None
    values = value.tolist() if isinstance(value, np.ndarray) else value
    kind = each or get_args(inner)[0]
    return {label: write(kind, x, out, key) for label, x in zip(labels, values, strict=True)}


def _numbers(value: Any, out: Writer, key: str) -> Any:
    if isinstance(value, np.ndarray):
        return out.floats(key, value)
    return format_exact(value) if isinstance(value, Fraction) else out.numbers(key, value)
