"""The time-varying gain of the prescribed-time protocols, and the stretched clock that it drives.

    phi(t)  = (T/(T - t))^kappa  on [0, T),  1 from T on
    gain(t) = rho1 + rho2 phi'/phi = rho1 + rho2 kappa/(T - t)  on [0, T),  rho1 from T on
    s(t)    = integral of the gain = rho1 t + rho2 kappa ln(T/(T - t)),  infinite from T on

``tau = -ln(1 - t/T)`` resolves the last instants before the deadline, which ``t`` itself cannot: a float ``t`` comes
no nearer to ``T`` than ``1 - t/T = 1e-16``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ptcc_certify.checker.input_formulas import PrescribedGain
from ptcc_certify.errors import ParameterError, gated
from ptcc_certify.graphs.rationals import Exact, shorten
from ptcc_certify.model.casadi_latex import to_latex
from ptcc_certify.model.parameters import NotNegative, Parameters, Positive, parameter, refuse_out_of_range

if TYPE_CHECKING:
    import casadi as ca
    from numpy.typing import ArrayLike

_PARAMETERS = ("T", "rho1", "rho2", "kappa")


@gated
@dataclass(frozen=True, repr=False)
class Gain(Parameters):
    r"""``gain(t) = rho1 + rho2 kappa/(T - t)`` before the deadline ``T``, ``rho1`` from there on.

    With ``rho2 = 0`` the gain is ``rho1`` for ever: the asymptotic baseline without a deadline.

    Parameters
    ----------
    T, rho1, kappa : int, float, str or Fraction
        Positive; a text obeys the exact grammar. ``T`` in units of time, ``rho1`` in 1/time/weight.
    rho2 : int, float, str or Fraction
        Not negative, 1/weight.

    Raises
    ------
    ParameterError
        Names the parameter, its value and its domain.

    References
    ----------
    Lemma 6 and equation (4) of [Zhu]_.

    Examples
    --------
    >>> gain = Gain(T="0.6", rho1="0.1", rho2="0.3", kappa=1)
    >>> gain.value([0, 0.3, 0.6]).round(12)
    array([0.6, 1.1, 0.1])
    >>> print(gain.latex())
    \begin{cases} 0.1 + \frac{0.3}{0.6 - t}, & t < 0.6 \\ 0.1, & t \ge 0.6 \end{cases}
    """

    T: Positive = Positive()
    rho1: Positive = Positive()
    rho2: NotNegative = NotNegative()
    kappa: Positive = Positive()

    def __post_init__(self) -> None:
        size = self.pole / self.T
        for name, value in (("rho1 T", self.rho1 * self.T), ("rho2 kappa", self.pole), ("rho2 kappa/T", size)):
            refuse_out_of_range(name, value)

    @property
    def pole(self) -> Fraction:
        """``rho2 kappa``, the strength of the pole at ``T``: the two enter the gain only as this product."""
        return self.rho2 * self.kappa

    @cached_property
    def exact(self) -> PrescribedGain:
        """The same gain as proofs enclose it, for ``rho2 > 0``."""
        return PrescribedGain(self.T, self.rho1, self.pole)

    @property
    def first(self) -> Fraction:
        """The gain at 0, ``rho1 + rho2 kappa/T``."""
        return self.rho1 + self.pole / self.T

    @property
    def first_theta(self) -> Fraction:
        """``gain'/gain^2 = (1 - rho1/gain)^2/(rho2 kappa)`` at 0."""
        return (1 - self.rho1 / self.first) ** 2 / self.pole

    # ------------------------------------------------------------------ numbers

    def __call__(self, t: ArrayLike) -> np.ndarray:
        """Return the gain at ``t``, as :meth:`value` does."""
        return self.value(t)

    def phi(self, t: ArrayLike) -> np.ndarray:
        """Return ``phi(t) = (T/(T - t))^kappa`` on [0, T), 1 from T on; floats of the shape of ``t``."""
        q = self._remaining(t)
        with np.errstate(over="ignore"):
            return np.where(q > 0, np.where(q > 0, q, 1) ** -float(self.kappa), 1.0)

    def value(self, t: ArrayLike) -> np.ndarray:
        """Return the gain at ``t``; floats of the shape of ``t``."""
        return self.value_at_remaining(self._remaining(t))

    def value_at_remaining(self, q: ArrayLike) -> np.ndarray:
        """Return the gain where ``1 - t/T = q``, however small; ``rho1`` where ``q <= 0``."""
        q = np.asarray(q, dtype=float)
        with np.errstate(over="ignore"):
            return float(self.rho1) + np.where(q > 0, float(self.pole / self.T) / np.where(q > 0, q, 1), 0.0)

    def clock(self, t: ArrayLike) -> np.ndarray:
        """Return ``s(t) = rho1 t + rho2 kappa ln(T/(T - t))``, infinite from ``T`` on unless ``rho2 = 0``."""
        t = np.asarray(t, dtype=float)
        return float(self.rho1) * t + (float(self.pole) * self.tau(t) if self.rho2 else 0.0)

    def clock_at_tau(self, tau: ArrayLike) -> np.ndarray:
        """Return ``s = rho1 T (1 - e^-tau) + rho2 kappa tau``, the clock at ``t = T (1 - e^-tau)``."""
        return float(self.rho1) * self.time_at_tau(tau) + (float(self.pole) * np.asarray(tau) if self.rho2 else 0.0)

    def clock_at_remaining(self, q: ArrayLike) -> np.ndarray:
        """Return the clock where ``1 - t/T = q``, accurate for ``q`` far below the resolution of ``t``.

        Examples
        --------
        >>> Gain(1, 1, 1, 1).clock_at_remaining(1e-100).round(6)
        np.float64(231.258509)
        """
        with np.errstate(divide="ignore"):
            return self.clock_at_tau(-np.log(np.asarray(q, dtype=float)))

    def tau(self, t: ArrayLike) -> np.ndarray:
        """Return ``tau = -ln(1 - t/T)``, infinite from ``T`` on."""
        share = np.minimum(np.asarray(t, dtype=float) / float(self.T), 1)
        with np.errstate(divide="ignore"):
            return -np.log1p(-share)

    def time_at_tau(self, tau: ArrayLike) -> np.ndarray:
        """Return ``t = T (1 - e^-tau)``."""
        return -float(self.T) * np.expm1(-np.asarray(tau, dtype=float))

    def _remaining(self, t: ArrayLike) -> np.ndarray:
        return 1 - np.asarray(t, dtype=float) / float(self.T)

    # ------------------------------------------------------------------ expressions

    def expression(self, t: ca.SX) -> ca.SX:
        """Return the gain as a CasADi expression of the symbol ``t``."""
        return self._expressions(t, self._numbers())["gain"]

    def capped_expression(self, t: ca.SX, cap: Fraction | None) -> ca.SX:
        """Return the gain under a cap, if there is one, as a CasADi expression of the symbol ``t``.

        Parameters
        ----------
        t : casadi.SX
            In units of time.
        cap : Fraction or None
            The largest gain, per unit of time.
        """
        import casadi as ca

        free = self.expression(t)
        return free if cap is None else ca.fmin(free, float(cap))

    def capped_latex(self, cap: Fraction | None) -> str:
        """Return the LaTeX of the gain under a cap, if there is one, with the parameters as numbers.

        Parameters
        ----------
        cap : Fraction or None
            The largest gain, per unit of time.
        """
        free = self.latex()
        return free if cap is None else rf"\min\left({float(cap):g}, {free}\right)"

    def phi_expression(self, t: ca.SX) -> ca.SX:
        """Return ``phi`` as a CasADi expression of the symbol ``t``."""
        return self._expressions(t, self._numbers())["phi"]

    def clock_expression(self, t: ca.SX) -> ca.SX:
        """Return the clock ``s`` as a CasADi expression of the symbol ``t``."""
        return self._expressions(t, self._numbers())["clock"]

    def latex(
        self,
        of: Literal["gain", "phi", "clock"] = "gain",
        *,
        numbers: bool = True,
        letters: Iterable[str] = _PARAMETERS,
    ) -> str:
        r"""Return the LaTeX of the expression itself, with the parameters as numbers or as letters.

        Parameters
        ----------
        of : {"gain", "phi", "clock"}
        numbers : bool
            Print the values of the parameters; otherwise their letters.
        letters : four str
            What to call ``T``, ``rho1``, ``rho2`` and ``kappa``, for a gain whose parameters are called otherwise.

        Returns
        -------
        str

        Raises
        ------
        ParameterError
            ``of`` is another word.

        Examples
        --------
        >>> print(Gain(1, 1, 1, 1).latex("clock", numbers=False))
        \begin{cases} \rho_{1} t + \rho_{2} \kappa \ln\left(\frac{T}{T - t}\right), & t < T \\ \infty, & t \ge T \end{cases}
        """  # noqa: E501
        import casadi as ca

        parameters = dict(zip(_PARAMETERS, map(ca.SX.sym, letters), strict=True))
        forms = self._expressions(ca.SX.sym("t"), self._numbers() if numbers else parameters)
        if of not in forms:
            raise ParameterError(f'LaTeX of "{shorten(str(of))}" is unknown; use "gain", "phi" or "clock"')
        return to_latex(forms[of])

    def _numbers(self) -> dict[str, Any]:
        return {name: float(value) for name, value in self.parameters.items()}

    def _expressions(self, t: ca.SX, p: dict[str, Any]) -> dict[str, ca.SX]:
        """Return gain, ``phi`` and clock for parameters by name, numbers or symbols."""
        import casadi as ca

        T = p["T"]
        rho1 = p["rho1"]
        pole = p["rho2"] * p["kappa"]
        before = t < p["T"]
        phi = ca.if_else(before, (T / (T - t)) ** p["kappa"], 1)
        if not self.rho2:
            return {"gain": ca.SX(rho1), "phi": phi, "clock": rho1 * t}
        return {
            "gain": ca.if_else(before, rho1 + pole / (T - t), rho1),
            "phi": phi,
            "clock": ca.if_else(before, rho1 * t + pole * ca.log(T / (T - t)), float("inf")),
        }


def prescribed_time_bound(V0: ArrayLike, a: float, b: float, t: ArrayLike, T: Exact, kappa: Exact) -> np.ndarray:
    """Return the bound ``phi(t)^-b e^(-a t) V0`` on [0, T), 0 from ``T`` on.

    It holds for every ``V >= 0`` with ``V' <= -a V - b (phi'/phi) V``, with equality where that is an equality.
    Lemma 6 of the paper asks for ``kappa > 2``; ``kappa > 0`` is enough.

    Parameters
    ----------
    V0, t : float or array of any shapes
        Broadcast against each other; ``t >= 0`` in units of time.
    a, b : float
        Positive; 1/time and 1.
    T, kappa : int, float, str or Fraction
        Positive; ``T`` in units of time.

    Returns
    -------
    array
        Of the shape to which ``V0`` and ``t`` broadcast, in units of ``V0``.

    Raises
    ------
    ParameterError
        ``a``, ``b``, ``T`` or ``kappa`` is not positive and finite.

    Examples
    --------
    >>> prescribed_time_bound(8.0, 1e-9, 3, [0, 0.5, 1, 2], T=1, kappa=1).round(6)
    array([8., 1., 0., 0.])
    """
    rates = {"a": a, "b": b, "T": T, "kappa": kappa}
    decay, power, deadline, exponent = (float(parameter(name, value)) for name, value in rates.items())
    t = np.asarray(t, dtype=float)
    q = np.maximum(1 - t / deadline, 0)
    return np.asarray(V0, dtype=float) * q ** (exponent * power) * np.exp(-decay * t)
