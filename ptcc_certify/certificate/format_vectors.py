"""Vectors and long numbers of a certificate's file: in the JSON, or beside it; exact, or as balls."""

from __future__ import annotations

import hashlib
import io
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from lmi.exact.decimal_rounding import float_up
from lmi.exact.definite import SparseFactor
from ptcc_certify.bounds.final_state import Influence, enclosed_ends
from ptcc_certify.checker.dominance import FactorSection
from ptcc_certify.checker.reading import RejectedError, exact
from ptcc_certify.checker.side_files import Numbers, SideFiles, beside
from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.io.files import read_bytes
from ptcc_certify.graphs.rationals import format_exact, writable
from ptcc_certify.graphs.structure import Structure

#: Vectors above this length go to side files.
LONG = 50_000
#: Bits of numerator and denominator up to which an interval is written as it is.
_SHORT_BITS = 256
#: Decimals of the middle of a ball, and its radius, where an exact number would be too long.
_DECIMALS, _RADIUS = 120, Fraction(1, 10**60)

Interval = tuple[Fraction, Fraction]


class Writer:
    """Writes the vectors of a document: in the JSON, or the long ones to side files.

    Parameters
    ----------
    labels : sequence of str
        Of the nodes.
    files : bool
        Whether vectors of more than ``LONG`` entries go to side files.
    followers : sequence of str
        The labels of followers.

    Attributes
    ----------
    files : dict of str to bytes
        Names and contents of the side files, ``.npy`` vectors of 64-bit numbers.
    written_groups : set of tuple
        The proofs of leader groups that are written already: first row, rate, weights.
    """

    def __init__(self, labels: Sequence[str], files: bool = False, followers: Sequence[str] = ()):
        self.labels, self.followers, self._aside = labels, followers, files
        self.files: dict[str, bytes] = {}
        self.written_groups: set[tuple[int, Fraction, bytes]] = set()

    def aside(self, length: int) -> bool:
        """Tell whether a vector of this length goes to a side file."""
        return self._aside and length > LONG

    def file(self, name: str, values: np.ndarray) -> dict[str, Any]:
        """Put int64 or float64 numbers into a side file; return its name and hash."""
        content = io.BytesIO()
        np.save(content, values.astype("<f8" if values.dtype.kind == "f" else "<i8"), allow_pickle=False)
        sha256 = hashlib.sha256(content.getvalue()).hexdigest()
        file = f"{sha256[:16]}-{name}.npy"
        self.files[file] = content.getvalue()
        return {"file": file, "sha256": sha256}

    def vector(self, name: str, values: np.ndarray) -> dict[str, Any]:
        """Put int64 or float64 numbers into a side file; return what stands for the vector."""
        return {**self.file(name, values), "count": values.size}

    def nodes(self, nodes: Sequence[int] | np.ndarray) -> Any:
        """Write node indices as labels, or as a side file of indices."""
        if self.aside(len(nodes)):
            return self.vector("nodes", np.asarray(nodes, dtype=np.int64))
        return [self.labels[v] for v in np.asarray(nodes, dtype=np.int64).tolist()]

    def floats(self, name: str, values: np.ndarray) -> Any:
        """Write floats as the dyadic numbers that they are."""
        if self.aside(values.size):
            return self.vector(name, values)
        return [x.hex() for x in values.tolist()]

    def integers(self, name: str, values: np.ndarray) -> Any:
        """Write int64 numbers."""
        return self.vector(name, values.astype(np.int64)) if self.aside(values.size) else values.tolist()

    def state(self, name: str, state: Sequence[Fraction] | None) -> Any:
        """Write one number of each agent: by label, or as a side file of integers over a common denominator."""
        if state is None:
            return None
        return self._over_scale(name, state) or dict(zip(self.labels, map(format_exact, state), strict=True))

    def numbers(self, name: str, values: Sequence[Fraction]) -> Any:
        """Write numbers as texts, or as a side file of integers over a common denominator."""
        return self._over_scale(name, values) or [format_exact(x) for x in values]

    def _over_scale(self, name: str, values: Sequence[Fraction]) -> dict[str, Any] | None:
        """Put many numbers into a side file of integers over a common denominator; None where int64 is too short."""
        if not self.aside(len(values)):
            return None
        scale = math.lcm(*{x.denominator for x in values})
        if scale.bit_length() >= 63:
            return None
        whole = [x.numerator * (scale // x.denominator) for x in values]
        if max(map(abs, whole)) >= 2**63:
            return None
        return {**self.vector(name, np.array(whole, dtype=np.int64)), "scale": str(scale)}


def floats(numbers: Numbers) -> np.ndarray:
    """Return the floats nearest to numbers, each rounded once."""
    return np.array([float(x) if numbers.scale is None else x / numbers.scale for x in numbers.values])


def numbers(values: Sequence[Fraction] | np.ndarray | None) -> Numbers | None:
    """Return numbers as the sections have them; None of None."""
    return None if values is None else Numbers(values)


def fractions(values: Numbers | None) -> tuple[Fraction, ...] | None:
    """Return numbers that were read; None of None."""
    return None if values is None else tuple(values)


def floats_up(numbers: Numbers | None) -> np.ndarray | None:
    """Return floats that numbers do not exceed; None of None."""
    return None if numbers is None else np.array([float_up(x) for x in numbers])


class Reader:
    """Reads the vectors of an accepted document; the check has verified that every part is there.

    Parameters
    ----------
    labels : sequence of str
        Of the nodes.
    files : mapping of str to bytes
        The side files.
    """

    def __init__(self, labels: Sequence[str], files: Mapping[str, bytes]):
        self.files, self._count = SideFiles(Path(), files), len(labels)
        self._index = {label: i for i, label in enumerate(labels)}

    def nodes(self, section: Any) -> tuple[int, ...]:
        """Read node indices."""
        if beside(section):
            return tuple(self.files.integers(section, "nodes", section["count"]))
        return tuple(self._index[label] for label in section)

    def floats(self, section: Any, length: int) -> np.ndarray:
        """Read a vector as the floats nearest to its numbers, each rounded once."""
        return floats(self.files.numbers(section, "a vector", length))

    def state(self, section: Any) -> tuple[Fraction, ...] | None:
        """Read one number of each agent: by label, or from a side file."""
        if section is None:
            return None
        if beside(section):
            return tuple(self.files.numbers(section, "a vector", self._count))
        return tuple(map(exact, section.values()))

    def numbers(self, section: Any, count: int) -> tuple[Fraction, ...]:
        """Read what :meth:`Writer.numbers` wrote."""
        return tuple(self.files.numbers(section, "a vector", count))

    def agents(self, section: Any) -> tuple[Fraction, ...]:
        """Read one number of each agent, which is there."""
        return self.state(section) or ()


def read_side_files(document: Mapping[str, Any], folder: Path) -> dict[str, bytes]:
    """Return the side files of a document that was accepted, by name; what is ``unverified`` names none.

    Raises
    ------
    FormatError
        One was changed or removed since the check.
    """
    named = dict(_side_files([part for key, part in document.items() if key != "unverified"]))
    files = {name: read_bytes(folder / name, name) for name in named}
    for name, content in files.items():
        if hashlib.sha256(content).hexdigest() != named[name]:
            raise FormatError(f"{name}: was changed while the certificate was read; try again")
    return files


def _side_files(value: Any) -> Iterator[tuple[str, str]]:
    """Yield name and hash of every side file; two numbers of agents called ``file`` and ``sha256`` are none."""
    if isinstance(value, dict) and re.fullmatch("[0-9a-f]{64}", str(value.get("sha256"))) and "file" in value:
        yield value["file"], value["sha256"]
    for part in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from _side_files(part)


def factor_section(factor: SparseFactor, power: int, parents: np.ndarray | None = None) -> FactorSection:
    """Return what is written of a sparse factor of ``2^power`` times a matrix."""
    return FactorSection(
        order=factor.order,
        indptr=factor.indptr,
        indices=factor.indices,
        data=factor.data,
        exponents=factor.exponents,
        bits=factor.bits,
        power=power,
        weights=factor.weights,
        parents=parents,
    )


def text(value: Fraction | None) -> str | None:
    """Write a rational, or null."""
    return None if value is None else format_exact(value)


def number(digits: str | None) -> Fraction | None:
    """Read what :func:`text` wrote."""
    return None if digits is None else exact(digits)


def readable(read: Callable[[], Any]) -> Any:
    """Return what is read from a part of any content; None where it cannot be."""
    try:
        return read()
    except (RejectedError, ArithmeticError, LookupError, TypeError, ValueError, AttributeError):
        return None


def finite(value: float | None) -> float | None:
    """Return a float that JSON holds, or None."""
    return value if value is not None and math.isfinite(value) else None


# ---------------------------------------------------------------------- balls


def exact_or_ball(value: Fraction) -> str | dict[str, str]:
    """Write a rational exactly, or as a ball ``{mid, radius}`` that contains it where the text would be too long.

    Examples
    --------
    >>> exact_or_ball(Fraction(1, 3))
    '1/3'
    >>> sorted(exact_or_ball(Fraction(1, 3**9000)))
    ['mid', 'radius']
    """
    return format_exact(value) if writable(value) else _ball_text((value, _RADIUS))


def interval_text(interval: Interval) -> str | dict[str, str]:
    """Write an interval: exactly if its radius is 0, or its numbers are short; otherwise as a ball that contains it."""
    if interval[1] == 0:
        return exact_or_ball(interval[0])
    if all(map(writable, interval)) and all(
        _odd_bits(n) <= _SHORT_BITS for x in interval for n in x.as_integer_ratio()
    ):
        return {"mid": format_exact(interval[0]), "radius": format_exact(interval[1])}
    return _ball_text(interval)


def _odd_bits(n: int) -> int:
    """Return the bits of an integer but for a power of two."""
    return n.bit_length() - (n & -n).bit_length()


def _ball_text(interval: Interval) -> dict[str, str]:
    """Write an interval as a ball that contains it, with short decimals."""
    middle, radius = interval
    unit = 10**_DECIMALS
    mid = round(middle * unit)
    wide = math.ceil((radius + abs(middle - Fraction(mid, unit))) * unit)
    return {"mid": f"{mid}e-{_DECIMALS}", "radius": f"{wide}e-{_DECIMALS}"}


def weighted_sum(weights: Sequence[Interval], values: Sequence[Interval]) -> Interval:
    """Return an interval that contains the sum of the products; of radius 0 where all of them are.

    Examples
    --------
    >>> middle, radius = weighted_sum([(Fraction(2), Fraction(1))], [(Fraction(3), Fraction(0))])
    >>> str(middle), str(radius)
    ('6', '3')
    """
    pairs = [(*weight, *value) for weight, value in zip(weights, values, strict=True)]
    middle = sum((w * x for w, _, x, _ in pairs), Fraction(0))
    return middle, sum((abs(w) * s + r * (abs(x) + s) for w, r, x, s in pairs), Fraction(0))


def influence_balls(matrix: Influence) -> tuple[list[list[Interval]], list[list[Interval]]]:
    """Return left null vectors and containment weights as intervals: of radius 0, unless too long to write."""
    left_null_vectors = [_balls([Fraction(w) for w in null_vector]) for null_vector in matrix.left_null_vectors]
    rows = matrix.containment_weights or ()
    columns = [_balls([Fraction(row[k]) for row in rows]) for k in range(len(matrix.left_null_vectors))]
    containment_weights = [list(row) for row in zip(*columns, strict=True)] if columns else [[] for _ in rows]
    return left_null_vectors, containment_weights


def agents_ends(matrix: Influence, begin: Sequence[Interval]) -> list[Interval]:
    """Return ``Q x`` for intervals ``x`` of the agents.

    Raises
    ------
    NotEnclosedError
        Of a large graph, whose ``Q`` is enclosed: its equations are too ill-conditioned for floats.
    """
    if not matrix.exact:
        return enclosed_ends(matrix, begin)
    left_null_vectors, containment_weights = influence_balls(matrix)
    groups = list(zip(matrix.balanced, left_null_vectors, strict=True))
    values = [weighted_sum(null_vector, [begin[v] for v in c.nodes]) for c, null_vector in groups]
    ends = [(Fraction(0), Fraction(0))] * len(begin)
    for component, (middle, radius) in zip(matrix.balanced, values, strict=True):
        for v, g in zip(component.nodes, component.gauge or (), strict=True):
            ends[v] = g * middle, radius
    for v, row in zip(matrix.structure.followers.tolist(), containment_weights, strict=True):
        ends[v] = weighted_sum(row, values)
    return ends


def _balls(values: Sequence[Fraction]) -> list[Interval]:
    if all(map(writable, values)):
        return [(x, Fraction(0)) for x in values]
    unit = 10**_DECIMALS
    return [(Fraction(round(x * unit), unit), _RADIUS) for x in values]


def final_state_witness(structure: Structure, matrix: Influence) -> tuple[Fraction, ...] | None:
    """Return ``u > 0`` with ``M u > 0`` on followers and on leader groups less one agent, if balls need it.

    ``M`` is the comparison matrix of ``L_F``, and that of ``L_k`` transposed. From it follows how far a ball's middle
    may be from the truth.
    """
    left_null_vectors, containment_weights = influence_balls(matrix)
    if not any(r for row in (*left_null_vectors, *containment_weights) for _, r in row):
        return None
    u = np.ones(structure.graph.n_nodes)
    L = structure.graph.laplacian().toarray()
    M = np.diag(np.diag(L)) * 2 - np.abs(L)
    groups = [(structure.followers.tolist(), M)]
    for component, null_vector in zip(matrix.balanced, left_null_vectors, strict=True):
        top = max(range(len(null_vector)), key=lambda i: abs(null_vector[i][0]))
        groups.append(([v for i, v in enumerate(component.nodes) if i != top], M.T))
    for nodes, block in groups:
        if nodes:
            own = block[np.ix_(nodes, nodes)]
            u[nodes] = np.abs(np.linalg.solve(own / np.diag(own)[:, None], np.ones(len(nodes))))
    return tuple(map(Fraction, u.tolist()))
