"""The protocols of agents of order n: by relative positions, velocities and so on, and the cascade."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi.exact.decimal_rounding import near
from ptcc_certify.graphs.io import as_graph
from ptcc_certify.model.base import Protocol, aligned, coupling, position_latex
from ptcc_certify.model.casadi_latex import to_latex
from ptcc_certify.model.gain import Gain

if TYPE_CHECKING:
    import casadi as ca


@dataclass(frozen=True)
class AgentsProtocol:
    """The protocol of agents of order n, with the gain and the clock of a protocol for single integrators.

        u_k = sum_i eta^(n-i+1) (K_i e_k^(i-1) - f_i (x_k - h_k)^(i-1)) + a_1 h_k,   eta = min(gain, gain_cap),
        e_k = sum_l w_kl ((x_l - h_l) - sign(w_kl) (x_k - h_k))

    so that agents need the relative positions, velocities and so on of those they listen to, and no more if ``f = 0``.
    Under a sliding-mode protocol this is the nominal part of the input.

    Attributes
    ----------
    base : Protocol
        Gain, clock and deadline, and the sliding terms if there are any.
    plant, own, gains : tuple of n Fraction
        ``a``, ``f`` and ``K``.
    offsets : tuple of N tuples of d Fraction
        ``h_k``.
    gain_cap : Fraction or None

    Examples
    --------
    >>> from ptcc_certify.model import NominalProtocol
    >>> base, zero, K = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), Fraction(0), (Fraction(3), Fraction(2))
    >>> protocol = AgentsProtocol(base, (zero, zero), (zero, zero), K, ((zero,), (zero,)), None)
    >>> loop = protocol.closed_loop(SignedDigraph.from_edges([(1, 2, 1)]))
    >>> loop["x"], loop["ode"].shape
    (SX([x1, x2, x1_1, x2_1]), (4, 1))
    """

    base: Protocol
    plant: tuple[Fraction, ...]
    own: tuple[Fraction, ...]
    gains: tuple[Fraction, ...]
    offsets: tuple[tuple[Fraction, ...], ...]
    gain_cap: Fraction | None

    @property
    def order(self) -> int:
        """``n``."""
        return len(self.plant)

    @property
    def gain(self) -> Gain:
        """The gain without a cap, and its clock."""
        return self.base.gain

    def value(self, remaining: float) -> float:
        """Return ``eta`` where ``1 - t/T`` is ``remaining``, before ``T``, or at ``T`` under a cap."""
        cap, free = self.gain_cap, float(self.gain.value_at_remaining(remaining))
        if cap is None:
            return free
        return float(cap) if remaining <= self.capped_from else min(free, float(cap))

    @property
    def capped_from(self) -> float:
        """``1 - t/T`` from which on the gain is capped; 0 if it never is."""
        cap, gain = self.gain_cap, self.gain
        if cap is None:
            return 0.0
        return 1.0 if cap <= gain.first else float(gain.pole / (gain.T * (cap - gain.rho1)))

    def clock(self, remaining: np.ndarray) -> np.ndarray:
        """Return ``s``, the integral of ``eta``, where ``1 - t/T`` is ``remaining``."""
        q, turn = np.asarray(remaining, dtype=float), self.capped_from
        cap = 0.0 if self.gain_cap is None else float(self.gain_cap)
        return self.gain.clock_at_remaining(np.maximum(q, turn)) + cap * float(self.gain.T) * np.maximum(turn - q, 0)

    def shrinking(self, eta: np.ndarray) -> np.ndarray:
        """Return ``theta = (1 - rho1/eta)^2/k``, minus the derivative of ``1/eta``, while the gain is not capped."""
        return (1 - float(self.gain.rho1) / eta) ** 2 / float(self.gain.pole)

    @property
    def first_gain(self) -> Fraction:
        """``eta(0)``."""
        return self.gain.first if self.gain_cap is None else min(self.gain.first, self.gain_cap)

    @property
    def gains_at_first(self) -> tuple[Fraction, ...]:
        """``K`` at time 0."""
        return self.gains

    def gains_at(self, theta: Any) -> tuple[Any, ...]:
        """Return ``K`` where ``d(1/eta)/dt = -theta``: here the same at all times."""
        return tuple(map(float, self.gains))

    def agree_if_above(self, slowest: float) -> bool:
        """Tell whether derivatives agree at ``T`` where ``k Re lambda`` is this at least: gains as designed do it."""
        return True

    def law(self) -> str:
        """Tell the input in one line, ``g`` standing for the gain.

        Examples
        --------
        >>> from ptcc_certify.model import NominalProtocol
        >>> base, zero = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), Fraction(0)
        >>> AgentsProtocol(base, (zero,) * 2, (zero, Fraction(1)), (Fraction(3), Fraction(2)), ((zero,),), None).law()
        "3 g^2 e + 2 g e' - 1 g x'"
        """
        n = self.order
        terms = [f"{near(K)} {_power(n - i)}{_primed('e', i)}" for i, K in enumerate(self.gains)]
        own = [f" - {near(f)} {_power(n - i)}{_primed('x', i)}" for i, f in enumerate(self.own) if f]
        return " + ".join(terms) + "".join(own)

    def input(self, graph: Any, states: Sequence[ca.SX], t: ca.SX, coordinate: int = 0) -> ca.SX:
        """Return ``u`` in one coordinate of space as a CasADi expression.

        Parameters
        ----------
        graph : graph-like
            N agents.
        states : n columns of N casadi.SX
            Positions, velocities and so on.
        t : casadi.SX
            The instant, in units of time.
        coordinate : int
            Which coordinate of space, from 0.

        Returns
        -------
        (N, 1) casadi.SX
        """
        import casadi as ca

        graph = as_graph(graph)
        eta = self.gain.capped_expression(t, self.gain_cap)
        n = self.order
        gains = self.gains_at(ca.jacobian(eta, t) / eta**2)
        h = ca.vertcat(*(float(row[coordinate]) for row in self.offsets))
        total = float(self.plant[0]) * ca.SX(h)
        for i in range(n):
            y = states[i] - h if i == 0 else states[i]
            total = total + eta ** (n - i) * (gains[i] * coupling(graph, y) - float(self.own[i]) * y)
        return total

    def closed_loop(self, graph: Any, coordinate: int = 0) -> dict[str, ca.SX]:
        """Return the closed loop in one coordinate as CasADi's ``{"t", "x", "ode"}``, before ``T``.

        ``x`` stacks positions ``x1 .. xN``, velocities ``x1_1 ..``, and so on.
        """
        import casadi as ca

        graph = as_graph(graph)
        t = ca.SX.sym("t")
        n = self.order
        marks = ["", *(f"_{i}" for i in range(1, n))]
        states = [ca.vertcat(*(ca.SX.sym(f"x{k + 1}{mark}") for k in range(graph.n_nodes))) for mark in marks]
        last = self.input(graph, states, t, coordinate)
        for a, state in zip(self.plant, states, strict=True):
            last -= float(a) * state
        return {"t": t, "x": ca.vertcat(*states), "ode": ca.vertcat(*states[1:], last)}

    def latex(self) -> str:
        r"""Return the protocol of an agent k in LaTeX, printed from its expression, with the gains as numbers.

        Examples
        --------
        >>> from ptcc_certify.model import NominalProtocol
        >>> base, zero = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), Fraction(0)
        >>> protocol = AgentsProtocol(base, (zero,) * 2, (zero,) * 2, (Fraction(3), Fraction(2)), ((zero,),), None)
        >>> print(protocol.latex())
        \begin{aligned}
        u_{k} &= 3 g^{2} e_{k} + 2 g \dot{e}_{k} \\
        e_{k} &= \sum_{l=1}^{N} w_{kl} \left(x_{l} - \operatorname{sign}\left(w_{kl}\right) x_{k}\right) \\
        g &= \begin{cases} 1 + \frac{2}{1 - t}, & t < 1 \\ 1, & t \ge 1 \end{cases}
        \end{aligned}
        """
        import casadi as ca

        g, n = ca.SX.sym("g"), self.order
        shown = any(any(row) for row in self.offsets)
        own = position_latex("k", shown)
        total = ca.SX(0)
        for i, (K, f) in enumerate(zip(self.gains, self.own, strict=True)):
            total += float(K) * g ** (n - i) * ca.SX.sym(_derivative("e_{k}", i))
            total -= float(f) * g ** (n - i) * ca.SX.sym(_derivative(own if i == 0 else "x_{k}", i)) if f else 0
        total += float(self.plant[0]) * ca.SX.sym("h_{k}") if self.plant[0] and shown else 0
        return aligned([f"u_{{k}} &= {to_latex(total)}", *self._where()])

    def _where(self) -> list[str]:
        """Return the LaTeX of the relative positions and of the gain."""
        shown = any(any(row) for row in self.offsets)
        listener, source = (position_latex(v, shown) for v in "kl")
        pull = rf"\left({source} - \operatorname{{sign}}\left(w_{{kl}}\right) {listener}\right)"
        error = rf"\sum_{{l=1}}^{{N}} w_{{kl}} {pull}"
        return [f"e_{{k}} &= {error}", f"g &= {self.gain.capped_latex(self.gain_cap)}"]

    def _repr_latex_(self) -> str:
        return f"$${self.latex()}$$"


def _power(m: int) -> str:
    return "g " if m == 1 else f"g^{m} "


def _primed(letter: str, i: int) -> str:
    return letter + ("'" * i if i < 4 else f"^({i})")


def _derivative(letter: str, i: int) -> str:
    """Return the LaTeX of a derivative of a letter with one index."""
    if i == 0:
        return letter
    head, _, index = letter.partition("_")
    accent = {1: "dot", 2: "ddot", 3: "dddot"}.get(i)
    return rf"\{accent}{{{head}}}_{index}" if accent else f"{letter}^{{({i})}}"


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
