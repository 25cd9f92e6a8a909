"""The sliding-mode protocol (47)-(48) of the paper: parameters, closed loop as CasADi expressions, and its LaTeX."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

from lmi.exact.decimal_rounding import near
from ptcc_certify.errors import ParameterError, gated
from ptcc_certify.graphs.declared_option import option
from ptcc_certify.model.base import NominalProtocol, ReachingProtocol, aligned, nominal_rows, position_latex, symbols
from ptcc_certify.model.casadi_latex import to_latex
from ptcc_certify.model.parameters import NotNegative, Positive

if TYPE_CHECKING:
    import casadi as ca


@gated
@dataclass(frozen=True, repr=False)
class SlidingModeProtocol(ReachingProtocol):
    r"""The sliding-mode protocol (47)-(48) of the paper, for agents ``x_k' = u_k + d_k`` with ``|d_k| <= delta``.

        sigma_k = x_k + varsigma_k,   varsigma_k' = -u_k^nom,
        u_k = u_k^nom - mu1 sign(sigma_k) - (mu2 + mu3 kappa/(T_r - t)) sigma_k    (mu2 from T_r on)

    ``u^nom`` is the nominal protocol with the deadline ``T = T_r + T_s``. Whatever the disturbance, every sliding
    variable is 0 from ``T_r`` on, and the agents settle at ``T``.

    The defaults of the parameters are those of the command line.

    Parameters
    ----------
    T_r, T_s : int, float, str or Fraction
        Time to reach the sliding manifold, and time to settle on it; positive, in units of time.
    rho1, rho2, kappa : int, float, str or Fraction
        Of the nominal gain; positive. ``rho1`` in 1/time/weight, ``rho2`` in 1/weight.
    mu1, mu2, mu3 : int, float, str or Fraction
        Positive; ``mu1 > delta``. ``mu1`` in units of the input, ``mu2`` in 1/time.
    delta : int, float, str or Fraction
        Bound of every disturbance, not negative, in units of the input.

    Raises
    ------
    ParameterError
        Names the parameter, its value and its domain.

    Examples
    --------
    >>> p = SlidingModeProtocol(T_r=1, T_s=2, rho1=1, rho2=1, kappa=2, mu1="1.5", mu2=1, mu3=1, delta=1)
    >>> p.T, p.nominal
    (Fraction(3, 1), NominalProtocol(T=3, rho1=1, rho2=1, kappa=2))
    >>> SlidingModeProtocol(T_r=1, T_s=2, rho1=1, rho2=1, kappa=2, mu1=1, mu2=1, mu3=1, delta=1)
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: mu1 = 1 does not exceed delta = 1; a disturbance could outweigh it: give mu1 > 1
    """

    section: ClassVar = "protocol"
    kind = "sliding-mode"
    T_r: Positive = option(
        "--T-r", "Sliding mode: time to reach the manifold.", Positive("0.5"), example="0.5", unit="time"
    )
    T_s: Positive = option(
        "--T-s", "Sliding mode: time on it; the deadline is T_r + T_s.", Positive("0.5"), example="0.5", unit="time"
    )
    rho1: Positive = Positive(1)
    rho2: Positive = Positive(1)
    kappa: Positive = Positive(2)
    mu1: Positive = option("--mu1", "Sliding mode: switching gain, above delta.", Positive(2), example="2")
    mu2: Positive = option("--mu2", "Sliding mode: constant part of the reaching gain.", Positive(1))
    mu3: Positive = option("--mu3", "Sliding mode: factor of its growing part.", Positive(1))
    delta: NotNegative = option(
        "--delta",
        "Bound of every disturbance.",
        NotNegative(1),
        key="disturbance.delta",
        shown="sliding mode: 1; nominal: none",
    )

    def __post_init__(self) -> None:
        if self.mu1 <= self.delta:
            raise ParameterError(
                "mu1",
                f"= {near(self.mu1)} does not exceed delta = {near(self.delta)}; a disturbance could "
                f"outweigh it: give mu1 > {near(self.delta)}",
            )
        _ = self.gain, self.reaching_gain  # refuses what is beyond float64

    @cached_property
    def nominal(self) -> NominalProtocol:
        """The protocol of ``u^nom``, which alone moves the agents on the sliding manifold."""
        return NominalProtocol(self.T, self.rho1, self.rho2, self.kappa)

    def input(
        self,
        graph: Any,
        x: ca.SX | None = None,
        varsigma: ca.SX | None = None,
        t: ca.SX | None = None,
    ) -> ca.SX:
        """Return ``u`` of (48) as a CasADi expression, with ``sign(0) = 0``.

        Parameters
        ----------
        graph : graph-like
            N agents.
        x, varsigma : (N, 1) casadi.SX, optional
            The states and the auxiliary variables of (47); symbols ``x1 ..`` and ``varsigma1 ..`` by default.
        t : casadi.SX, optional
            The instant, in units of time; the symbol ``t`` by default.

        Returns
        -------
        (N, 1) casadi.SX
        """
        import casadi as ca

        from ptcc_certify.graphs.io import as_graph

        graph = as_graph(graph)
        x, t = symbols("x", graph) if x is None else x, ca.SX.sym("t") if t is None else t
        sigma = x + (symbols("varsigma", graph) if varsigma is None else varsigma)
        return _add_reaching_terms(
            self.nominal.input(graph, x, t), sigma, float(self.mu1), self.reaching_gain.expression(t)
        )

    def closed_loop(self, graph: Any) -> dict[str, ca.SX]:
        """Return the closed loop on ``graph`` as CasADi's ``{"t", "x", "p", "ode"}``.

        ``x`` stacks states and auxiliary variables, ``p`` holds the disturbances, and ``ode`` is ``(u + d, -u^nom)``.
        Its right-hand side is discontinuous where a ``sigma_k`` is 0: an integrator that does not know this chatters.

        Examples
        --------
        >>> p = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
        >>> loop = p.closed_loop(SignedDigraph.from_edges([(1, 2, 3)]))
        >>> loop["x"], loop["p"]
        (SX([x1, x2, varsigma1, varsigma2]), SX([d1, d2]))
        """
        import casadi as ca

        from ptcc_certify.graphs.io import as_graph

        graph = as_graph(graph)
        x, varsigma, d, t = *(symbols(name, graph) for name in ("x", "varsigma", "d")), ca.SX.sym("t")
        motion = self.input(graph, x, varsigma, t) + d
        return {
            "t": t,
            "x": ca.vertcat(x, varsigma),
            "p": d,
            "ode": ca.vertcat(motion, -self.nominal.input(graph, x, t)),
        }

    def latex(self, graph: Any = None, places: bool = False) -> str:
        r"""Return the protocol in LaTeX, printed from its expressions; see :meth:`NominalProtocol.latex`.

        Parameters
        ----------
        graph : graph-like, optional
            At most 20 nodes: the rows of every agent, with numbers. Without a graph the row of an agent k, in letters.
        places : bool
            Of agents in a formation: ``x_k - h_k`` in place of ``x_k``.

        Returns
        -------
        str

        Raises
        ------
        ParameterError
            The graph has more than 20 nodes.

        Examples
        --------
        >>> p = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
        >>> print(p.latex())
        \begin{aligned}
        u_{k} &= u_{k}^{\mathrm{nom}} - \mu_{1} \operatorname{sign}\left(\sigma_{k}\right) - h \sigma_{k} \\
        \sigma_{k} &= x_{k} + \varsigma_{k}, \quad \dot\varsigma_{k} = -u_{k}^{\mathrm{nom}} \\
        u_{k}^{\mathrm{nom}} &= \sum_{l=1}^{N} g w_{kl} \left(x_{l} - \operatorname{sign}\left(w_{kl}\right) x_{k}\right) \\
        g &= \begin{cases} \rho_{1} + \frac{\rho_{2} \kappa}{T_{r} + T_{s} - t}, & t < T_{r} + T_{s} \\ \rho_{1}, & t \ge T_{r} + T_{s} \end{cases} \\
        h &= \begin{cases} \mu_{2} + \frac{\mu_{3} \kappa}{T_{r} - t}, & t < T_{r} \\ \mu_{2}, & t \ge T_{r} \end{cases}
        \end{aligned}
        """  # noqa: E501
        import casadi as ca

        numbers = graph is not None
        nominal = r"u_{k}^{\mathrm{nom}}"
        mu1 = float(self.mu1) if numbers else ca.SX.sym("mu1")
        expression = _add_reaching_terms(ca.SX.sym(nominal), ca.SX.sym("sigma_k"), mu1, ca.SX.sym("h"))
        sigma = ca.SX.sym(position_latex("k", places)) + ca.SX.sym("varsigma_k")
        gain = self.gain.latex(numbers=numbers, letters=("T_{r} + T_{s}", "rho1", "rho2", "kappa"))
        reaching = self.reaching_gain.latex(numbers=numbers, letters=("T_r", "mu2", "mu3", "kappa"))
        return aligned(
            [
                f"u_{{k}} &= {to_latex(expression)}",
                rf"\sigma_{{k}} &= {to_latex(sigma)}, \quad \dot\varsigma_{{k}} = -{nominal}",
                *nominal_rows(graph, r"^{\mathrm{nom}}", places),
                f"g &= {gain}",
                f"h &= {reaching}",
            ]
        )


def _add_reaching_terms(nominal: Any, sigma: Any, mu1: Any, gain: Any) -> ca.SX:
    """``u^nom`` with what drives the sliding variables to 0."""
    import casadi as ca

    return nominal - mu1 * ca.sign(sigma) - gain * sigma
