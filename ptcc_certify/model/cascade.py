"""The cascade of double integrators: each tracks the velocity that the paper's protocol commands."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from lmi.exact.decimal_rounding import near
from ptcc_certify.model.agents_protocol import AgentsProtocol
from ptcc_certify.model.base import Protocol, aligned
from ptcc_certify.model.casadi_latex import to_latex

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True)
class CascadeProtocol(AgentsProtocol):
    """The protocol by which double integrators ``x_k'' = u_k`` track ``eta e_k``, the paper's input.

        u_k = d/dt(eta e_k) + alpha eta (eta e_k - x_k') = eta^2 ((alpha + theta) e_k + zeta e_k' - alpha zeta x_k')

    with ``zeta = 1/eta``, ``theta = eta'/eta^2``. Then ``q_k = x_k' - eta e_k`` obeys ``q' = -alpha eta q``, and
    ``X' = -eta L X + q``: the closed loop of single integrators with an input that dies, on every graph, for every
    ``alpha > 0``. Here ``K = (alpha + theta, 1)``, ``f = (0, alpha)``; ``gains`` has the part ``(alpha, 1)``.

    Examples
    --------
    >>> from ptcc_certify.model import NominalProtocol
    >>> base = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    >>> protocol = CascadeProtocol.of(base, Fraction(3), ((Fraction(0),), (Fraction(0),)))
    >>> protocol.closed_loop(SignedDigraph.from_edges([(1, 2, 1)]))["ode"].shape
    (4, 1)
    >>> protocol.law()
    "(3 g^2 + g') e + g e' - 3 g x'"
    """

    @classmethod
    def of(cls, base: Protocol, alpha: Fraction, offsets: Sequence[Sequence[Fraction]]) -> CascadeProtocol:
        """Return the protocol of a rate ``alpha``, in the formation of these offsets."""
        zero = Fraction(0)
        return cls(base, (zero, zero), (zero, alpha), (alpha, Fraction(1)), tuple(map(tuple, offsets)), None)

    @property
    def alpha(self) -> Fraction:
        """``alpha``."""
        return self.own[1]

    @property
    def gains_at_first(self) -> tuple[Fraction, ...]:
        """``(alpha + theta, 1)`` at time 0."""
        return self.alpha + self.gain.first_theta, Fraction(1)

    def gains_at(self, theta: Any) -> tuple[Any, ...]:
        """Return ``(alpha + theta, 1)``."""
        return float(self.alpha) + theta, 1.0

    def agree_if_above(self, slowest: float) -> bool:
        """Tell whether velocities vanish at ``T``: where ``k Re lambda > 1``."""
        return slowest > 1

    def law(self) -> str:
        """Tell the input in one line, ``g`` standing for the gain."""
        alpha = f"{near(self.alpha)} ".removeprefix("1 ")
        return f"({alpha}g^2 + g') e + g e' - {alpha}g x'"

    def latex(self) -> str:
        r"""Return the protocol of an agent k in LaTeX, printed from its expression, with the gains as numbers.

        Examples
        --------
        >>> from ptcc_certify.model import NominalProtocol
        >>> base = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
        >>> print(CascadeProtocol.of(base, Fraction(3), ((Fraction(0),),)).latex().partition(r" \\")[0])
        \begin{aligned}
        u_{k} &= \left(3 g^{2} + \dot{g}\right) e_{k} + g \dot{e}_{k} - 3 g \dot{x}_{k}
        """
        import casadi as ca

        g, slope = ca.SX.sym("g"), ca.SX.sym(r"\dot{g}")
        e, e_dot, v = (ca.SX.sym(name) for name in ("e_{k}", r"\dot{e}_{k}", r"\dot{x}_{k}"))
        alpha = float(self.alpha)
        total = (alpha * g**2 + slope) * e + g * e_dot - alpha * g * v
        return aligned([f"u_{{k}} &= {to_latex(total)}", *self._where()])
