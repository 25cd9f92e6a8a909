"""Double integrators that exchange virtual positions, which move as single integrators, and track these.

    z_k' = gamma e_k,   e_k = sum_l w_kl (z_l - sign(w_kl) z_k),   z_k(0) = x_k(0)             what is exchanged
    u_k = -a_1 g' (x_k - z_k) - a_1 g (x_k' - z_k') - a_2 g (x_k' + a_1 g (x_k - z_k))         what moves the vehicle

``gamma`` is the gain that acts, ``g`` that up to ``T``, which from there on stays what it came to under a cap. With
``r = x_k' + a_1 g (x_k - z_k)`` it is ``r' = -a_2 g r``, ``x_k' = -a_1 g (x_k - z_k) + r``: the vehicle is the virtual
agent as it is seen through two filters of the first order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.io import as_graph
from ptcc_certify.model.base import aligned, coupling, position_latex, symbols
from ptcc_certify.model.casadi_latex import to_latex
from ptcc_certify.model.gain import Gain

if TYPE_CHECKING:
    import casadi as ca


@dataclass(frozen=True)
class Vehicles:
    """Double integrators that track virtual states.

    Attributes
    ----------
    v0 : tuple of N Fraction
        Their initial velocities.
    """

    v0: tuple[Fraction, ...]


@dataclass(frozen=True)
class TrackingProtocol:
    """The protocol of double integrators that exchange virtual positions; in a formation ``x_k`` is less its place.

    Attributes
    ----------
    gain : Gain
        Without a cap; deadline and clock are its.
    a1, a2 : Fraction
        How fast they track, per unit of the clock of the gain.
    gain_cap : Fraction or None

    Examples
    --------
    >>> protocol = TrackingProtocol(Gain(T=1, rho1=1, rho2=1, kappa=2), Fraction(4), Fraction(3), None)
    >>> loop = protocol.closed_loop(SignedDigraph.from_edges([(1, 2, 1)]))
    >>> loop["x"], loop["ode"].shape
    (SX([x1, x2, v1, v2, z1, z2]), (6, 1))
    """

    gain: Gain
    a1: Fraction
    a2: Fraction
    gain_cap: Fraction | None = None

    def input(self, x: ca.SX, v: ca.SX, z: ca.SX, moved: ca.SX, g: ca.SX, slope: ca.SX) -> ca.SX:
        """Return ``u``; ``moved`` is ``z'``, ``g`` the gain and ``slope`` its derivative."""
        a1, a2 = float(self.a1), float(self.a2)
        return -a1 * slope * (x - z) - a1 * g * (v - moved) - a2 * g * (v + a1 * g * (x - z))

    def closed_loop(self, graph: Any) -> dict[str, ca.SX]:
        """Return the closed loop as CasADi's ``{"t", "x", "ode"}``, before ``T``: positions, velocities, virtual ones.

        What is exchanged is heard at once here.
        """
        import casadi as ca

        graph = as_graph(graph)
        t = ca.SX.sym("t")
        x, v, z = (symbols(name, graph) for name in "xvz")
        g = self.gain.capped_expression(t, self.gain_cap)
        moved = g * coupling(graph, z)
        u = self.input(x, v, z, moved, g, ca.jacobian(g, t))
        return {"t": t, "x": ca.vertcat(x, v, z), "ode": ca.vertcat(v, u, moved)}

    def latex(self, places: bool = False) -> str:
        r"""Return the protocol of an agent k in LaTeX, printed from its expressions.

        With ``places`` that of a formation, in which ``x_k - h_k`` stands where ``x_k`` does.

        Examples
        --------
        >>> base = Gain(T=1, rho1=1, rho2=1, kappa=2)
        >>> rows = TrackingProtocol(base, Fraction(4), Fraction(3)).latex().split(r"\\")
        >>> print(rows[1].partition(r"\left(")[0].strip())
        \dot{z}_{k} &= g \sum_{l=1}^{N} w_{kl}
        """
        import casadi as ca

        position = position_latex("k", places)
        names = (position, r"\dot{x}_{k}", "z_{k}", r"\dot{z}_{k}", "g", r"\dot{g}")
        u = self.input(*map(ca.SX.sym, names))
        pull = r"z_{l} - \operatorname{sign}\left(w_{kl}\right) z_{k}"
        begin = r"x_{k}(0) - h_{k}" if places else "x_{k}(0)"
        rows = [
            f"u_{{k}} &= {to_latex(u)}",
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
