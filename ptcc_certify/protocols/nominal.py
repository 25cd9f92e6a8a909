"""The paper's control protocols: parameters, closed loops as CasADi expressions, and their LaTeX."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import Exact
from ptcc_certify.graphs.rationals import format_exact
from ptcc_certify.protocols.gain import Gain, parameter, parameters_text, readable
from ptcc_certify.protocols.latex import to_latex

if TYPE_CHECKING:
    import casadi as ca

    from ptcc_certify.graphs.digraph import SignedDigraph

_LATEX_NODES = 20
_PARAMETERS = ("T", "rho1", "rho2", "kappa")
_SLIDING_PARAMETERS = ("T_r", "T_s", "rho1", "rho2", "kappa", "mu1", "mu2", "mu3", "delta")


@dataclass(frozen=True, init=False, repr=False)
class NominalProtocol:
    """The nominal protocol (4) of the paper: every agent steers by what it hears from those it listens to.

        u_k = gain(t) sum_l w_kl (x_l - sign(w_kl) x_k),
        gain(t) = rho1 + rho2 kappa/(T - t)  before T,  rho1 from T on

    The agents settle at ``T``, whatever the start. ``rho2 = 0`` is allowed: then the gain is constant and they settle
    only as ``t`` goes to infinity (the asymptotic baseline).

    Parameters
    ----------
    T, rho1, kappa : int, float, str or Fraction
        Positive; kept as exact rationals, a text obeys the exact grammar. ``T`` in units of time, ``rho1`` in
        1/time/weight.
    rho2 : int, float, str or Fraction
        Not negative, 1/weight.

    Raises
    ------
    ParameterError
        Names the parameter, its value and its domain.

    Examples
    --------
    >>> protocol = NominalProtocol(T="0.6", rho1="0.1", rho2="0.3", kappa=1)
    >>> protocol
    NominalProtocol(T=3/5, rho1=1/10, rho2=3/10, kappa=1)
    >>> protocol.to_dict()
    {'kind': 'nominal', 'T': '3/5', 'rho1': '1/10', 'rho2': '3/10', 'kappa': '1'}
    """

    T: Fraction
    rho1: Fraction
    rho2: Fraction
    kappa: Fraction

    def __init__(self, T: Exact, rho1: Exact, rho2: Exact, kappa: Exact):
        gain = Gain(T, rho1, rho2, kappa)
        for name in _PARAMETERS:
            object.__setattr__(self, name, getattr(gain, name))

    @property
    def kind(self) -> str:
        """``"nominal"``."""
        return "nominal"

    @property
    def prescribed(self) -> bool:
        """Whether there is a deadline: ``rho2 > 0``."""
        return self.rho2 > 0

    @cached_property
    def gain(self) -> Gain:
        """The gain and its clock."""
        return Gain(self.T, self.rho1, self.rho2, self.kappa)

    @property
    def settling_time(self) -> Fraction | None:
        """``T``, or None for the asymptotic baseline."""
        return self.T if self.prescribed else None

    def input(self, graph: SignedDigraph, x: ca.SX | None = None, t: ca.SX | None = None) -> ca.SX:
        """Return ``u = gain(t) E``, ``E = -L x``, as a CasADi expression.

        Parameters
        ----------
        graph : SignedDigraph
            N agents.
        x : (N, 1) casadi.SX, optional
            The states; symbols ``x1 .. xN`` by default.
        t : casadi.SX, optional
            The instant, in units of time; the symbol ``t`` by default.

        Returns
        -------
        (N, 1) casadi.SX

        Examples
        --------
        >>> from ptcc_certify.graphs.digraph import SignedDigraph
        >>> pair = SignedDigraph.from_edges([(1, 2, -3)])
        >>> NominalProtocol(T=1, rho1=2, rho2=0, kappa=1).input(pair)
        SX([0, (-6*(x1+x2))])
        """
        import casadi as ca

        x, t = _symbols("x", graph) if x is None else x, ca.SX.sym("t") if t is None else t
        return self.gain.expression(t) * _coupling(graph, x)

    def closed_loop(self, graph: SignedDigraph) -> dict[str, ca.SX]:
        """Return ``x' = u`` on ``graph`` as CasADi's ``{"t", "x", "ode"}``, for ``casadi.integrator`` (before ``T``).

        Examples
        --------
        >>> from ptcc_certify.graphs.digraph import SignedDigraph
        >>> loop = NominalProtocol(T=1, rho1=2, rho2=0, kappa=1).closed_loop(SignedDigraph.from_edges([(1, 2, 3)]))
        >>> loop["x"], loop["ode"]
        (SX([x1, x2]), SX([0, (6*(x1-x2))]))
        """
        import casadi as ca

        x, t = _symbols("x", graph), ca.SX.sym("t")
        return {"t": t, "x": x, "ode": self.input(graph, x, t)}

    def latex(self, graph: SignedDigraph | None = None) -> str:
        r"""Return the protocol in LaTeX, printed from its expressions: for an agent k, or for every agent of a graph.

        Parameters
        ----------
        graph : SignedDigraph, optional
            At most 20 nodes. Agents are numbered from 1 in the order of ``graph.labels``, and the parameters are
            numbers; without a graph they are letters.

        Raises
        ------
        ParameterError
            The graph has more than 20 nodes.

        Examples
        --------
        >>> from ptcc_certify.graphs.digraph import SignedDigraph
        >>> protocol = NominalProtocol(T=1, rho1=2, rho2=3, kappa=1)
        >>> print(protocol.latex())
        \begin{aligned}
        u_{k} &= \sum_{l=1}^{N} g w_{kl} \left(x_{l} - \operatorname{sign}\left(w_{kl}\right) x_{k}\right) \\
        g &= \begin{cases} \rho_{1} + \frac{\rho_{2} \kappa}{T - t}, & t < T \\ \rho_{1}, & t \ge T \end{cases}
        \end{aligned}
        >>> print(protocol.latex(SignedDigraph.from_edges([(1, 2, -3), (2, 1, 1)])))
        \begin{aligned}
        u_{1} &= g \left(x_{2} - x_{1}\right) \\
        u_{2} &= g \left(-3 \left(x_{1} + x_{2}\right)\right) \\
        g &= \begin{cases} 2 + \frac{3}{1 - t}, & t < 1 \\ 2, & t \ge 1 \end{cases}
        \end{aligned}
        """
        rows = _nominal_rows(graph, "")
        return _aligned([*rows, f"g &= {self.gain.latex(numbers=graph is not None)}"])

    def _repr_latex_(self) -> str:
        return f"$${self.latex()}$$"

    def to_dict(self) -> dict[str, str]:
        """Return ``kind`` and the parameters as exact strings."""
        return {"kind": self.kind} | {name: format_exact(getattr(self, name)) for name in _PARAMETERS}

    def __repr__(self) -> str:
        return f"NominalProtocol({parameters_text(self, _PARAMETERS)})"


@dataclass(frozen=True, init=False, repr=False)
class SlidingModeProtocol:
    r"""The sliding-mode protocol (47)-(48) of the paper, for agents ``x_k' = u_k + d_k`` with ``|d_k| <= delta``.

        sigma_k = x_k + varsigma_k,   varsigma_k' = -u_k^nom,
        u_k = u_k^nom - mu1 sign(sigma_k) - (mu2 + mu3 kappa/(T_r - t)) sigma_k    (mu2 from T_r on)

    ``u^nom`` is the nominal protocol with the deadline ``T = T_r + T_s``. Whatever the disturbance, every sliding
    variable is 0 from ``T_r`` on, and the agents settle at ``T``.

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

    T_r: Fraction
    T_s: Fraction
    rho1: Fraction
    rho2: Fraction
    kappa: Fraction
    mu1: Fraction
    mu2: Fraction
    mu3: Fraction
    delta: Fraction

    def __init__(
        self,
        T_r: Exact,
        T_s: Exact,
        rho1: Exact,
        rho2: Exact,
        kappa: Exact,
        mu1: Exact,
        mu2: Exact,
        mu3: Exact,
        delta: Exact,
    ):
        given = (T_r, T_s, rho1, rho2, kappa, mu1, mu2, mu3, delta)
        for name, value in zip(_SLIDING_PARAMETERS, given, strict=True):
            object.__setattr__(self, name, parameter(name, value, zero_allowed=name == "delta"))
        if self.mu1 <= self.delta:
            raise ParameterError(
                f"mu1 = {readable(self.mu1)} does not exceed delta = {readable(self.delta)}; a disturbance could "
                f"outweigh it: give mu1 > {readable(self.delta)}"
            )
        _ = self.gain, self.reaching_gain  # refuses what is beyond float64

    @property
    def kind(self) -> str:
        """``"sliding-mode"``."""
        return "sliding-mode"

    @property
    def prescribed(self) -> bool:
        """True: there is a deadline."""
        return True

    @property
    def T(self) -> Fraction:
        """The deadline ``T_r + T_s``."""
        return self.T_r + self.T_s

    @property
    def settling_time(self) -> Fraction:
        """``T_r + T_s``."""
        return self.T

    @cached_property
    def nominal(self) -> NominalProtocol:
        """The protocol of ``u^nom``, which alone moves the agents on the sliding manifold."""
        return NominalProtocol(self.T, self.rho1, self.rho2, self.kappa)

    @property
    def gain(self) -> Gain:
        """The gain of ``u^nom`` and its clock; its pole is at ``T_r + T_s``."""
        return self.nominal.gain

    @cached_property
    def reaching_gain(self) -> Gain:
        """``mu2 + mu3 kappa/(T_r - t)``; by its clock ``c``, ``||sigma|| <= e^-c ||sigma(0)||`` (Proposition 1)."""
        return Gain(self.T_r, self.mu2, self.mu3, self.kappa)

    def input(
        self,
        graph: SignedDigraph,
        x: ca.SX | None = None,
        varsigma: ca.SX | None = None,
        t: ca.SX | None = None,
    ) -> ca.SX:
        """Return ``u`` of (48) as a CasADi expression, with ``sign(0) = 0``.

        Parameters
        ----------
        graph : SignedDigraph
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

        x, t = _symbols("x", graph) if x is None else x, ca.SX.sym("t") if t is None else t
        sigma = x + (_symbols("varsigma", graph) if varsigma is None else varsigma)
        return _driven(self.nominal.input(graph, x, t), sigma, float(self.mu1), self.reaching_gain.expression(t))

    def closed_loop(self, graph: SignedDigraph) -> dict[str, ca.SX]:
        """Return the closed loop on ``graph`` as CasADi's ``{"t", "x", "p", "ode"}``.

        ``x`` stacks states and auxiliary variables, ``p`` holds the disturbances, and ``ode`` is ``(u + d, -u^nom)``.
        Its right-hand side is discontinuous where a ``sigma_k`` is 0: an integrator that does not know this chatters.

        Examples
        --------
        >>> from ptcc_certify.graphs.digraph import SignedDigraph
        >>> p = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
        >>> loop = p.closed_loop(SignedDigraph.from_edges([(1, 2, 3)]))
        >>> loop["x"], loop["p"]
        (SX([x1, x2, varsigma1, varsigma2]), SX([d1, d2]))
        """
        import casadi as ca

        x, varsigma, d, t = *(_symbols(name, graph) for name in ("x", "varsigma", "d")), ca.SX.sym("t")
        motion = self.input(graph, x, varsigma, t) + d
        return {
            "t": t,
            "x": ca.vertcat(x, varsigma),
            "p": d,
            "ode": ca.vertcat(motion, -self.nominal.input(graph, x, t)),
        }

    def latex(self, graph: SignedDigraph | None = None) -> str:
        r"""Return the protocol in LaTeX, printed from its expressions; see :meth:`NominalProtocol.latex`.

        Parameters
        ----------
        graph : SignedDigraph, optional
            At most 20 nodes: the rows of every agent, with numbers. Without a graph the row of an agent k, in letters.

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
        driven = _driven(ca.SX.sym(nominal), ca.SX.sym("sigma_k"), mu1, ca.SX.sym("h"))
        sigma = ca.SX.sym("x_k") + ca.SX.sym("varsigma_k")
        gain = self.gain.latex(numbers=numbers, letters=("T_{r} + T_{s}", "rho1", "rho2", "kappa"))
        reaching = self.reaching_gain.latex(numbers=numbers, letters=("T_r", "mu2", "mu3", "kappa"))
        return _aligned(
            [
                f"u_{{k}} &= {to_latex(driven)}",
                rf"\sigma_{{k}} &= {to_latex(sigma)}, \quad \dot\varsigma_{{k}} = -{nominal}",
                *_nominal_rows(graph, r"^{\mathrm{nom}}"),
                f"g &= {gain}",
                f"h &= {reaching}",
            ]
        )

    def _repr_latex_(self) -> str:
        return f"$${self.latex()}$$"

    def to_dict(self) -> dict[str, str]:
        """Return ``kind`` and the parameters as exact strings."""
        return {"kind": self.kind} | {name: format_exact(getattr(self, name)) for name in _SLIDING_PARAMETERS}

    def __repr__(self) -> str:
        return f"SlidingModeProtocol({parameters_text(self, _SLIDING_PARAMETERS)})"


#: Any of the paper's protocols.
Protocol = NominalProtocol | SlidingModeProtocol


def _driven(nominal: Any, sigma: Any, mu1: Any, gain: Any) -> ca.SX:
    """``u^nom`` with what drives the sliding variables to 0."""
    import casadi as ca

    return nominal - mu1 * ca.sign(sigma) - gain * sigma


def _symbols(name: str, graph: SignedDigraph) -> ca.SX:
    import casadi as ca

    return ca.vertcat(*(ca.SX.sym(f"{name}{k}") for k in range(1, graph.n_nodes + 1)))


def _aligned(rows: list[str]) -> str:
    return "\\begin{aligned}\n" + " \\\\\n".join(rows) + "\n\\end{aligned}"


def _nominal_rows(graph: SignedDigraph | None, mark: str) -> list[str]:
    """Return the rows of the nominal input, of an agent k or of every agent; ``mark`` is put behind each ``u``."""
    import casadi as ca

    g = ca.SX.sym("g")
    if graph is None:
        summand = g * _pull(*(ca.SX.sym(name) for name in ("w_kl", "x_k", "x_l")))
        return [rf"u_{{k}}{mark} &= \sum_{{l=1}}^{{N}} {to_latex(summand)}"]
    if graph.n_nodes > _LATEX_NODES:
        raise ParameterError(f"LaTeX of {graph.n_nodes} agents is too long; the limit is {_LATEX_NODES} nodes")
    inputs = g * _coupling(graph, _symbols("x", graph))
    return [rf"u_{{{k + 1}}}{mark} &= {to_latex(inputs[k])}" for k in range(graph.n_nodes)]


def _pull(weight: Any, listener: ca.SX, source: ca.SX) -> ca.SX:
    """``w_kl (x_l - sign(w_kl) x_k)``: how source l moves listener k."""
    import casadi as ca

    return weight * (source - ca.sign(weight) * listener)


def _coupling(graph: SignedDigraph, x: ca.SX) -> ca.SX:
    """``E``, the sum of the pulls on every agent."""
    import casadi as ca

    entries = [ca.SX(0)] * graph.n_nodes
    for k, source, weight in zip(graph.target.tolist(), graph.source.tolist(), graph.weights.tolist(), strict=True):
        entries[k] = entries[k] + _pull(weight, x[k], x[source])
    return ca.vertcat(*entries)
