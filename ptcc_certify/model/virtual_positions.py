"""Vehicles that exchange virtual positions, which move as single integrators, and track these.

    z_k' = gamma e_k,   e_k = sum_l w_kl (z_l - sign(w_kl) z_k),   z_k(0) = x_k(0)             what is exchanged
    r_1 = x_k - z_k,   r_(i+1) = d_i + a_i g r_i,   d_i = r_i' with z_k and g constant
    r_n' = -a_n g r_n                                                        by the input u_k = x_k^(n) of a vehicle

``gamma`` is the gain that acts, ``g`` that up to ``T``, which from there on stays what it came to under a cap. Of order
2 that is ``r_2 = x_k' + a_1 g (x_k - z_k)`` and ``u_k = -a_1 g' (x_k - z_k) - a_1 g (x_k' - z_k') - a_2 g r_2``: the
vehicle is the virtual agent as it is seen through filters of the first order. A team may be mixed, of orders 1 to 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.io import as_graph
from ptcc_certify.model.base import aligned, coupling, position_latex, symbols
from ptcc_certify.model.casadi_latex import to_latex
from ptcc_certify.model.gain import Gain

if TYPE_CHECKING:
    import casadi as ca


@dataclass(frozen=True)
class Vehicles:
    """Vehicles that track virtual states.

    Attributes
    ----------
    v0 : tuple of N Fraction
        Their initial velocities; 0 of order 1.
    orders : tuple of N int
        1 to 3: 2 are double integrators.
    a0 : tuple of N Fraction or None
        Their initial accelerations, where any is of order 3; 0 of others.
    disturbance : Fraction
        ``|d_k|`` at most, of order 2 and 3: ``x_k^(n) = u_k + d_k``, d measurable.
    """

    v0: tuple[Fraction, ...]
    orders: tuple[int, ...]
    a0: tuple[Fraction, ...] | None = None
    disturbance: Fraction = Fraction(0)

    @property
    def team(self) -> tuple[int, ...] | None:
        """The orders of a mixed team, or one of order 3; None of double integrators."""
        return None if set(self.orders) == {2} else self.orders

    @property
    def begun(self) -> tuple[np.ndarray, np.ndarray]:
        """Sizes of the initial velocities and accelerations, in floats from above."""
        from lmi.exact.decimal_rounding import float_up

        rest = self.a0 or (Fraction(0),) * len(self.v0)
        return np.array([float_up(abs(x)) for x in self.v0]), np.array([float_up(abs(x)) for x in rest])


def tracking_input(gains: Sequence[Any], own: Sequence[Any], z: Any, moved: Any, g: Any, slope: Any) -> Any:
    """Return ``u`` of vehicles of order n: numbers, arrays or expressions.

    Parameters
    ----------
    gains : sequence
        ``a_1`` to ``a_n``, or more.
    own : sequence of length n
        Position, velocity and so on.
    z, moved
        ``z`` and ``z'``.
    g, slope
        The gain and its derivative.

    Examples
    --------
    >>> tracking_input([2, 3], [1, 0], 0, 0, 1, 0), tracking_input([1, 1, 1], [1, 0, 0], 0, 0, 2, 0)
    (-6, -8)
    """
    if len(own) == 1:
        return moved
    x, v = own[:2]
    a1, a2 = gains[:2]
    first, second = x - z, v + a1 * g * (x - z)
    turned = a1 * (slope * first + g * (v - moved))  # the derivative of a_1 g r_1
    if len(own) == 2:
        return -turned - a2 * g * second
    third = own[2] + a1 * g * v + a2 * g * second
    return -a1 * (slope * v + g * own[2]) - a2 * (slope * second + g * (own[2] + turned)) - gains[2] * g * third


@dataclass(frozen=True)
class TrackingProtocol:
    """The protocol of vehicles that exchange virtual positions; in a formation ``x_k`` is less its place.

    Attributes
    ----------
    gain : Gain
        Without a cap; deadline and clock are its.
    gains : tuple of Fraction
        ``a_1``, ``a_2`` and, if any is of order 3, ``a_3``: how fast they track, per unit of the clock of the gain.
    gain_cap : Fraction or None
    orders : tuple of N int, optional
        Of a mixed team; by default double integrators.

    Examples
    --------
    >>> protocol = TrackingProtocol(Gain(T=1, rho1=1, rho2=1, kappa=2), (Fraction(4), Fraction(3)), None)
    >>> loop = protocol.closed_loop(SignedDigraph.from_edges([(1, 2, 1)]))
    >>> loop["x"], loop["ode"].shape
    (SX([x1, x2, v1, v2, z1, z2]), (6, 1))
    """

    gain: Gain
    gains: tuple[Fraction, ...]
    gain_cap: Fraction | None = None
    orders: tuple[int, ...] | None = None

    def closed_loop(self, graph: Any) -> dict[str, ca.SX]:
        """Return the closed loop as CasADi's ``{"t", "x", "ode"}``, before ``T``.

        ``x`` holds the positions of all, velocities of those of order 2 and more, accelerations of those of order 3,
        and virtual positions of all that are not of order 1. What is exchanged is heard at once here.
        """
        import casadi as ca

        graph = as_graph(graph)
        orders = self.orders or (2,) * graph.n_nodes
        t, gains = ca.SX.sym("t"), [float(a) for a in self.gains]
        x, v, a, z = (symbols(name, graph) for name in "xvaz")
        heard = ca.vertcat(*[x[k] if n == 1 else z[k] for k, n in enumerate(orders)])
        g = self.gain.capped_expression(t, self.gain_cap)
        moved, slope = g * coupling(graph, heard), ca.jacobian(g, t)
        derivatives = []
        for k, n in enumerate(orders):
            u = tracking_input(gains, [x[k], v[k], a[k]][:n], z[k], moved[k], g, slope)
            derivatives.append([*[v[k], a[k]][: n - 1], u])
        states, slopes = [x], [each[0] for each in derivatives]
        for i, one in enumerate((v, a), start=1):
            chosen = [k for k, n in enumerate(orders) if n > i]
            states += [one[k] for k in chosen]
            slopes += [derivatives[k][i] for k in chosen]
        tracked = [k for k, n in enumerate(orders) if n > 1]
        states += [z[k] for k in tracked]
        return {"t": t, "x": ca.vertcat(*states), "ode": ca.vertcat(*slopes, *[moved[k] for k in tracked])}

    def latex(self, places: bool = False) -> str:
        r"""Return the protocol of an agent k in LaTeX, printed from its expressions, of each order that is there.

        With ``places`` that of a formation, in which ``x_k - h_k`` stands where ``x_k`` does.

        Examples
        --------
        >>> base = Gain(T=1, rho1=1, rho2=1, kappa=2)
        >>> rows = TrackingProtocol(base, (Fraction(4), Fraction(3))).latex().split(r"\\")
        >>> print(rows[1].partition(r"\left(")[0].strip())
        \dot{z}_{k} &= g \sum_{l=1}^{N} w_{kl}
        """
        import casadi as ca

        position = position_latex("k", places)
        own = [ca.SX.sym(name) for name in (position, r"\dot{x}_{k}", r"\ddot{x}_{k}")]
        others = [ca.SX.sym(name) for name in ("z_{k}", r"\dot{z}_{k}", "g", r"\dot{g}")]
        present, rows = sorted(set(self.orders or (2,))), []
        for n in present:
            of = rf" && \text{{order }} {n}" if len(present) > 1 else ""
            u = tracking_input([float(a) for a in self.gains], own[:n], *others)
            rows.append(f"u_{{k}} &= {to_latex(u)}{of}")
        pull = r"z_{l} - \operatorname{sign}\left(w_{kl}\right) z_{k}"
        begin = r"x_{k}(0) - h_{k}" if places else "x_{k}(0)"
        rows += [
            rf"\dot{{z}}_{{k}} &= g \sum_{{l=1}}^{{N}} w_{{kl}} \left({pull}\right), \quad z_{{k}}(0) = {begin}",
            f"g &= {self.gain.capped_latex(self.gain_cap)}",
        ]
        return aligned(rows)

    def _repr_latex_(self) -> str:
        return f"$${self.latex()}$$"


def one_cap(caps: Sequence[Fraction | None]) -> Fraction | None:
    """Return the one cap of the gain that is given, or refuse two."""
    found = {cap for cap in caps if cap is not None}
    if len(found) > 1:
        raise ParameterError("gain_cap", "of agents, limits and messages there are two; give one")
    return next(iter(found), None)
