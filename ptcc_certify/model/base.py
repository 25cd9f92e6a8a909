"""Protocols, nominal and sliding-mode, and what each is asked: gain, nominal phase, closed loop, LaTeX.

A kind of protocol is a frozen dataclass of exact parameters; by its ``kind`` a file names it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

from lmi.exact.decimal_rounding import near
from ptcc_certify.errors import ParameterError, gated
from ptcc_certify.graphs.declared_option import option
from ptcc_certify.graphs.rationals import format_exact, shorten
from ptcc_certify.model.casadi_latex import to_latex
from ptcc_certify.model.parameters import NotNegative, Parameters, Positive

if TYPE_CHECKING:
    import casadi as ca
    import numpy as np

    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.model.gain import Gain


class Protocol(Parameters, ABC):
    """A coordination protocol: what each agent does with what it hears.

    Attributes
    ----------
    kind : str
        How files name this kind of protocol.
    T : Fraction
        The deadline, in units of time.
    rho1, rho2, kappa : Fraction
        Of the gain, ``rho1 + rho2 kappa/(T - t)``.
    """

    kind: ClassVar[str]
    _kinds: ClassVar[dict[str, type[Protocol]]] = {}
    T: Fraction
    rho1: Fraction
    rho2: Fraction
    kappa: Fraction

    def __init_subclass__(cls) -> None:
        if "kind" in cls.__dict__:
            Protocol._kinds[cls.kind] = cls

    @cached_property
    def gain(self) -> Gain:
        """The gain of the nominal input and its clock; its pole is at ``T``."""
        from ptcc_certify.model.gain import Gain

        return Gain(self.T, self.rho1, self.rho2, self.kappa)

    @property
    def prescribed(self) -> bool:
        """Whether there is a deadline: ``rho2 > 0``."""
        return self.rho2 > 0

    @property
    def span(self) -> Fraction:
        """How long the nominal phase lasts, which alone moves the agents at its end: from 0, or ``T_r``, to ``T``."""
        return self.T

    @property
    def nominal(self) -> Protocol:
        """The protocol of the nominal phase."""
        return self

    @property
    def reaching(self) -> ReachingProtocol | None:
        """The protocol, if sliding variables reach 0 before its nominal phase; None if that begins at 0."""
        return None

    @abstractmethod
    def closed_loop(self, graph: Any) -> dict[str, ca.SX]:
        """Return the closed loop on ``graph`` as CasADi's ``{"t", "x", "ode"}``, with ``"p"`` for disturbances."""

    @abstractmethod
    def latex(self, graph: Any = None, places: bool = False) -> str:
        """Return the protocol in LaTeX, printed from its expressions: of an agent k, or of every agent of a graph.

        With ``places`` that of a formation, in which ``x_k - h_k`` stands where ``x_k`` does.
        """

    def _repr_latex_(self) -> str:
        return f"$${self.latex()}$$"

    def to_dict(self) -> dict[str, str]:
        """Return ``kind`` and the parameters as exact strings."""
        return {"kind": self.kind} | {name: format_exact(value) for name, value in self.parameters.items()}

    @staticmethod
    def from_dict(data: Mapping[str, Any]) -> Protocol:
        """Return the protocol of ``data``, as :meth:`to_dict` writes it.

        Raises
        ------
        ParameterError
            The kind is unknown, or a parameter is missing, unknown or outside its domain.

        Examples
        --------
        >>> Protocol.from_dict(NominalProtocol(T=1, rho1=1, rho2="1/2", kappa=1).to_dict())
        NominalProtocol(T=1, rho1=1, rho2=0.5, kappa=1)
        """
        parameters = dict(data)
        kind = parameters.pop("kind", None)
        if kind not in Protocol._kinds:
            raise ParameterError(f'protocol "{shorten(str(kind))}" is unknown; one of {", ".join(Protocol._kinds)}')
        names = [field.name for field in fields(Protocol._kinds[kind])]  # type: ignore[arg-type]
        for what, odd in (("no", set(names) - set(parameters)), ("an unknown", set(parameters) - set(names))):
            if odd:
                named = ", ".join(sorted(map(shorten, odd)))
                raise ParameterError(f"protocol {kind} has {what} {named}; it has {', '.join(names)}")
        return Protocol._kinds[kind](**parameters)


class ReachingProtocol(Protocol):
    """A protocol under which sliding variables reach 0 by ``T_r``, whatever the disturbance within ``delta``.

        sigma_k' = -mu1 sign(sigma_k) - (mu2 + mu3 kappa/(T_r - t)) sigma_k + d_k

    Attributes
    ----------
    T_r, T_s : Fraction
        Time to reach the sliding manifold, and time to settle on it, in units of time; ``T = T_r + T_s``.
    mu1, mu2, mu3, delta : Fraction
        Of the equation, ``|d_k| <= delta < mu1``.
    """

    T_r: Fraction
    T_s: Fraction
    mu1: Fraction
    mu2: Fraction
    mu3: Fraction
    delta: Fraction

    @property
    def T(self) -> Fraction:  # type: ignore[override]
        """The deadline ``T_r + T_s``."""
        return self.T_r + self.T_s

    @property
    def span(self) -> Fraction:
        """``T_s``."""
        return self.T_s

    @property
    def reaching(self) -> ReachingProtocol:
        """The protocol itself."""
        return self

    @cached_property
    def reaching_gain(self) -> Gain:
        """``mu2 + mu3 kappa/(T_r - t)``; by its clock ``c``, ``||sigma|| <= e^-c ||sigma(0)||`` (Proposition 1)."""
        from ptcc_certify.model.gain import Gain

        return Gain(self.T_r, self.mu2, self.mu3, self.kappa)

    def clock_while_reaching(self, z: np.ndarray) -> np.ndarray:
        """Return the stretched clock at instants ``z = ln(T_r/(T_r - t))``; an infinite one is ``T_r``."""
        import numpy as np

        T, T_r, T_s = float(self.T), float(self.T_r), float(self.T_s)
        return self.gain.clock_at_remaining((T_s + T_r * np.exp(-z)) / T)


def refuse_no_protocol(protocol: Any) -> None:
    """Refuse what is no protocol.

    Raises
    ------
    ParameterError
        Tells how to make one.

    Examples
    --------
    >>> refuse_no_protocol(0.6)
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: protocol = 0.6 is none; give NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), say
    """
    if not isinstance(protocol, Protocol):
        given = shorten(repr(protocol))
        raise ParameterError("protocol", f"= {given} is none; give NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), say")


# ---------------------------------------------------------------------- expressions


def symbols(name: str, graph: SignedDigraph) -> ca.SX:
    """Return the column ``name1 .. nameN`` of CasADi symbols."""
    import casadi as ca

    return ca.vertcat(*(ca.SX.sym(f"{name}{k}") for k in range(1, graph.n_nodes + 1)))


def position_latex(index: int | str, places: bool) -> str:
    r"""Return the LaTeX of an agent's state, in a formation less its place.

    Examples
    --------
    >>> print(position_latex("k", False), position_latex(2, True))
    x_{k} \left(x_{2} - h_{2}\right)
    """
    return rf"\left(x_{{{index}}} - h_{{{index}}}\right)" if places else f"x_{{{index}}}"


def aligned(rows: list[str]) -> str:
    """Return equations in LaTeX, one below the other."""
    return "\\begin{aligned}\n" + " \\\\\n".join(rows) + "\n\\end{aligned}"


_LATEX_NODES = 20


@gated
@dataclass(frozen=True, repr=False)
class NominalProtocol(Protocol):
    """The nominal protocol (4) of the paper: every agent steers by what it hears from those it listens to.

        u_k = gain(t) sum_l w_kl (x_l - sign(w_kl) x_k),
        gain(t) = rho1 + rho2 kappa/(T - t)  before T,  rho1 from T on

    The agents settle at ``T``, whatever the initial state. ``rho2 = 0`` is allowed: then the gain is constant and they
    settle only as ``t`` goes to infinity (the asymptotic baseline).

    Parameters
    ----------
    T, rho1, kappa : int, float, str or Fraction
        Positive; kept as exact rationals, a text obeys the exact grammar. ``T`` in units of time, ``rho1`` in
        1/time/weight. The defaults are those of the command line.
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

    section: ClassVar = "protocol"
    kind = "nominal"
    T: Positive = option("--T", "Nominal: the deadline.", Positive(1), unit="time")
    rho1: Positive = option("--rho1", "Constant part of the gain.", Positive(1))
    rho2: NotNegative = option("--rho2", "Factor of the growing part of the gain.", NotNegative(1))
    kappa: Positive = option("--kappa", "Exponent of the time scaling.", Positive(2), example="2")

    def __post_init__(self) -> None:
        _ = self.gain  # refuses what is beyond float64

    def input(self, graph: Any, x: ca.SX | None = None, t: ca.SX | None = None) -> ca.SX:
        """Return ``u = gain(t) E``, ``E = -L x``, as a CasADi expression.

        Parameters
        ----------
        graph : graph-like
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
        >>> pair = SignedDigraph.from_edges([(1, 2, -3)])
        >>> NominalProtocol(T=1, rho1=2, rho2=0, kappa=1).input(pair)
        SX([0, (-6*(x1+x2))])
        """
        import casadi as ca

        from ptcc_certify.graphs.io import as_graph

        graph = as_graph(graph)
        x, t = symbols("x", graph) if x is None else x, ca.SX.sym("t") if t is None else t
        return self.gain.expression(t) * coupling(graph, x)

    def closed_loop(self, graph: Any) -> dict[str, ca.SX]:
        """Return ``x' = u`` on ``graph`` as CasADi's ``{"t", "x", "ode"}``, for ``casadi.integrator`` (before ``T``).

        Examples
        --------
        >>> loop = NominalProtocol(T=1, rho1=2, rho2=0, kappa=1).closed_loop(SignedDigraph.from_edges([(1, 2, 3)]))
        >>> loop["x"], loop["ode"]
        (SX([x1, x2]), SX([0, (6*(x1-x2))]))
        """
        import casadi as ca

        from ptcc_certify.graphs.io import as_graph

        graph = as_graph(graph)
        x, t = symbols("x", graph), ca.SX.sym("t")
        return {"t": t, "x": x, "ode": self.input(graph, x, t)}

    def latex(self, graph: Any = None, places: bool = False) -> str:
        r"""Return the protocol in LaTeX, printed from its expressions: for an agent k, or for every agent of a graph.

        Parameters
        ----------
        graph : graph-like, optional
            At most 20 nodes. Agents are numbered from 1 in the order of ``graph.labels``, and the parameters are
            numbers; without a graph they are letters.
        places : bool
            Of agents in a formation: ``x_k - h_k`` in place of ``x_k``.

        Raises
        ------
        ParameterError
            The graph has more than 20 nodes.

        Examples
        --------
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
        rows = nominal_rows(graph, places=places)
        return aligned([*rows, f"g &= {self.gain.latex(numbers=graph is not None)}"])


def nominal_rows(graph: Any, mark: str = "", places: bool = False) -> list[str]:
    """Return the rows of the nominal input, of an agent k or of every agent; ``mark`` is put behind each ``u``."""
    import casadi as ca

    from ptcc_certify.graphs.io import as_graph

    g = ca.SX.sym("g")
    if graph is None:
        names = ("w_kl", position_latex("k", places), position_latex("l", places))
        summand = g * _pull(*map(ca.SX.sym, names))
        return [rf"u_{{k}}{mark} &= \sum_{{l=1}}^{{N}} {to_latex(summand)}"]
    graph = as_graph(graph)
    if graph.n_nodes > _LATEX_NODES:
        raise ParameterError(f"LaTeX of {graph.n_nodes} agents is too long; the limit is {_LATEX_NODES} nodes")
    states = ca.vertcat(*(ca.SX.sym(position_latex(k + 1, places)) for k in range(graph.n_nodes)))
    inputs = g * coupling(graph, states)
    return [rf"u_{{{k + 1}}}{mark} &= {to_latex(inputs[k])}" for k in range(graph.n_nodes)]


def _pull(weight: Any, listener: ca.SX, source: ca.SX) -> ca.SX:
    """``w_kl (x_l - sign(w_kl) x_k)``: how source l moves listener k."""
    import casadi as ca

    return weight * (source - ca.sign(weight) * listener)


def coupling(graph: SignedDigraph, x: ca.SX) -> ca.SX:
    """``E``, the sum of the containment weights on every agent."""
    import casadi as ca

    entries = [ca.SX(0)] * graph.n_nodes
    for k, source, weight in zip(graph.target.tolist(), graph.source.tolist(), graph.weights.tolist(), strict=True):
        entries[k] = entries[k] + _pull(weight, x[k], x[source])
    return ca.vertcat(*entries)


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
