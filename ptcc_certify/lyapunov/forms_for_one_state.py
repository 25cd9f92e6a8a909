"""Forms for one initial state and a few instants: what is proved of deviations and inputs there is made small.

A form of rate ``r`` bounds ``|y'xi|`` at the clock ``s`` by ``|y|_* sqrt(V(0)) e^(-r s / 2)``, ``|y|_*^2 = y'P^-1 y``.
Among all forms of a rate that is a little below the largest, those of least ``V(0)`` are taken that have ``|y|_* <= 1``
for the coordinates, and for the rows of inputs.

References
----------
docs/theory/families.md, "Common quadratic functions".
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from lmi.common_lyapunov import least_value
from ptcc_certify.lyapunov.common_form_search import prove_certificate
from ptcc_certify.lyapunov.common_forms import CommonForm
from ptcc_certify.lyapunov.quotient import Quotient
from ptcc_certify.lyapunov.search_failures import failures_told

#: Losses of the rate, for late instants and earlier ones.
_LOSSES = (1e-3, 0.03, 0.2)
#: By what factor a form must improve a bound at some instant.
_WORTH = 1.1
#: What of the identity is added to a sum of squares of rows, against its trace.
_REST = 1e-6


@dataclass(frozen=True, eq=False)
class Aim:
    """Where bounds should be small.

    Attributes
    ----------
    begin : (n,) array
        The initial state in quotient coordinates, up to a factor; not 0.
    clocks : (M,) array
        Instants of the stretched clock.
    """

    begin: np.ndarray
    clocks: np.ndarray


def aimed_functions(
    quotient: Quotient, aim: Aim, known: Sequence[CommonForm], notes: list[str]
) -> Iterator[CommonForm]:
    """Yield proved functions, each of which improves a bound of an aim over those before it.

    Parameters
    ----------
    quotient : Quotient
        Of 2 to 24 rows.
    aim : Aim
    known : sequence of CommonForm
        Functions at hand; nothing is yielded without one that decays.
    notes : list of str
        Is told what failed.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> from ptcc_certify.lyapunov.common_form_search import search_common_forms
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> chain = Family.from_intervals([("a", "b", 1, 2), ("b", "c", 1, 2)])
    >>> quotient = Quotient.of(decide(chain)[0])
    >>> known, aim = search_common_forms(quotient, slower=False).functions, Aim(np.array([1.0, 0.0]), np.array([2.0]))
    >>> [V.kind for V in aimed_functions(quotient, aim, known, [])]
    ['full', 'full']
    """
    top = max((float(V.rate) for V in known), default=0.0)
    if top <= 0:
        return
    numbers = [number for number, mode in enumerate(quotient.modes) if not mode.at_rest]
    modes = [quotient.modes[number] for number in numbers]
    rows = np.array([[float(x) for x in row] for mode in modes for row in mode.rows if any(row)])
    rows /= np.abs(rows).max()
    best = np.min([_log_bounds(np.array(V.matrix, dtype=float), float(V.rate), aim, rows) for V in known], axis=0)
    units = np.eye(len(aim.begin))
    squares = rows.T @ rows
    floors = (units, squares + _REST * np.trace(squares) * units)
    arrays = [mode.array for mode in modes]
    for rate, floor in product((top * (1 - loss) for loss in _LOSSES), floors):
        form = None
        with failures_told(notes, "full"):  # a smaller rate is easier
            form = least_value(arrays, [rate] * len(arrays), aim.begin, floor)
        if form is None:
            continue
        bounds = _log_bounds(form.matrix, form.rate, aim, rows)
        if (bounds < best - math.log(_WORTH)).any():
            function = prove_certificate(quotient, "full", form, numbers)
            if function is None:
                notes.append(f"class full: the rate {form.rate:.6g} is not proved")
            else:
                best = np.minimum(best, bounds)
                yield function


def _log_bounds(P: np.ndarray, rate: float, aim: Aim, rows: np.ndarray) -> np.ndarray:
    """Return logarithms of the bounds of the largest coordinate and row, up to a factor, at the instants, (2, M)."""
    inverse = np.linalg.inv(P)
    sizes = inverse.diagonal().max(), np.einsum("ki,ij,kj->k", rows, inverse, rows).max()
    value = float(aim.begin @ P @ aim.begin)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((np.log(np.array(sizes)[:, None] * value) - rate * aim.clocks) / 2)
