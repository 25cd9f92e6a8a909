"""The energy of the input, bounded by two Lyapunov equations, which are solved in floating point."""

from __future__ import annotations

import math
import warnings
from fractions import Fraction

import numpy as np

from ptcc_certify.bounds.input.effort import EnergyIntegral
from ptcc_certify.bounds.input.tightest_bound import INSTANT_BITS, log, round_up
from ptcc_certify.checker.input_formulas import InputBounds, Rows, integral_above, rounded
from ptcc_certify.graphs.rationals import nearest_float
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.error_system import ErrorSystem

#: Bits of the matrices that bound the energy, and by how much these exceed what solves the equations.
MATRIX_BITS, EXCESSES = 48, (1e-6, 1e-4, 1e-2)


def energy_integral(structure: Structure, bounds: InputBounds) -> EnergyIntegral | None:
    """Bound the energy by two Lyapunov equations; None if it is infinite, or floats do not solve them well enough."""
    if bounds.reaching is not None:
        return None
    gain = bounds.gain
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a singular equation: what comes of it is judged by its remainder
            system = ErrorSystem(structure)
            (first, m0), (second, m1) = (_lyapunov(system, c) for c in (0.0, nearest_float(1 / gain.k)))
        even, grown = bounds.largest_form(first) / m0, bounds.largest_form(second) / m1
        # The best p is ln(grown / even).
        most = gain.rho1 * gain.T / gain.k
        best = max(log(grown) - log(even), 0.0) if even and grown else 0.0
        p = min(rounded(Fraction(best), INSTANT_BITS), most)
        return EnergyIntegral(round_up(integral_above(gain, even, grown, p)), p, (first, second), (m0, m1))
    except (ValueError, ArithmeticError):
        return None


def _lyapunov(system: ErrorSystem, c: float) -> tuple[Rows, Fraction]:
    """Return ``W`` in integers and ``m`` with ``A'W + W A - c W > m I`` on the subspace of ``E``, near to equality.

    The remainder is formed in floats, after rounding; what these may be off by is left between it and ``m``, so that
    the independent check proves it.

    Raises
    ------
    ValueError
        Floats do not find such a ``W > 0``.
    """
    from scipy.linalg import solve_continuous_lyapunov

    A, basis = system.matrix, system.basis
    B = np.eye(len(A)) if basis is None else basis
    inner = B.T @ A @ B - c / 2 * np.eye(B.shape[1])
    W = B @ solve_continuous_lyapunov(inner.T, np.eye(B.shape[1])) @ B.T
    order = np.argsort(system.nodes)
    W, A, B = W[np.ix_(order, order)], A[np.ix_(order, order)], B[order]
    top = float(np.abs(W).max())
    if not 0 < top < 1e100:
        raise ValueError("the equation is not solved")
    unit = 2.0 ** (MATRIX_BITS - math.ceil(math.log2(top)))
    W = np.round((W + W.T) / 2 * unit) / unit
    least = [float(np.linalg.eigvalsh(B.T @ S @ B)[0]) for S in (W, W @ A + A.T @ W - c * W)]
    size = float(np.linalg.norm(W))
    noise = 100 * len(A) * 2.0**-52 * size * np.array([1.0, 2 * float(np.linalg.norm(A)) + c])
    for excess in EXCESSES:
        if least[0] > noise[0] and least[1] - noise[1] > 1 - excess:
            rows = [[Fraction(int(x)) for x in row] for row in (W * unit).tolist()]
            return rows, rounded(Fraction(unit * (1 - excess)), INSTANT_BITS)
    raise ValueError("the equation is not solved well enough")
