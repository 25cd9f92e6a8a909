"""Agents of order n: what they are, and the protocol that moves them by relative positions, velocities and so on."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from lmi.exact.decimal_rounding import near
from ptcc_certify.errors import Change, NumberError, ParameterError, Sentence, gated, joined
from ptcc_certify.graphs.digraph import Exact
from ptcc_certify.graphs.io import as_graph
from ptcc_certify.graphs.rationals import as_fraction, no_number, shorten, whole_number
from ptcc_certify.protocols.base import Protocol, aligned, position_latex
from ptcc_certify.protocols.casadi_latex import to_latex
from ptcc_certify.protocols.gain import Gain
from ptcc_certify.protocols.nominal import coupling
from ptcc_certify.protocols.parameters import parameter, readable

if TYPE_CHECKING:
    import casadi as ca

#: Largest order, and largest dimension of space.
MOST_ORDER, MOST_DIMENSION = 8, 8
#: Largest ``T (1 + max |a_i|)`` of agents that move by themselves, and longest numbers, in bits.
MOST_MOTION, LONGEST_BITS = 100, 2000
#: Largest ``R`` that is asked for.
MOST_DECAY = 1000
#: Derivatives of a position by their names.
DERIVATIVES = ("position", "velocity", "acceleration", "jerk")
PLURALS = ("positions", "velocities", "accelerations", "jerks")


@gated
@dataclass(frozen=True)
class Agents:
    """Agents of order n, one equation for each coordinate of space, and what is asked of their protocol.

        x_k^(n) + a_n x_k^(n-1) + .. + a_1 x_k = u_k

    Parameters
    ----------
    order : int, optional
        ``n``, 1 to 8; 2 are double integrators, if ``plant`` does not tell.
    plant : n numbers, optional
        ``a_1`` to ``a_n``; without it 0: chains of integrators.
    drag : number or str, optional
        ``a_n`` alone, such as the drag of a vehicle; may be negative.
    rest : number or str, optional
        ``alpha > 0``: agents of order 2 meet at rest, by ``-alpha eta`` times their own velocity; gains as designed.
    cascade : number or str, optional
        ``alpha > 0``: double integrators track the velocity that the paper's protocol commands, at this rate per unit
        of the clock. No gain depends on the graph; see :class:`~ptcc_certify.protocols.cascade.CascadeProtocol`.
    decay : number or str, optional
        ``R = r rho2 kappa``: deviations decay like ``(1 - t/T)^(R/2)`` near ``T``; above ``2 (n - 1)``. By default
        ``2 n``, from which on the input is bounded; single integrators without it run the paper's protocol, ``K = 1``.
    offsets : state-like, or N rows of numbers, optional
        Places ``h_k`` in a formation, by label or in node order.
    biases : state-like, or N rows of numbers, optional
        What is added to the relative positions ``e_k``, by sensors or by hand: they make a formation, or are refused.
    gain_cap : number or str, optional
        What the gain is at most, in 1/time/weight; then something is left at ``T``.

    Raises
    ------
    ParameterError
        Names the parameter, its value and its domain.

    Examples
    --------
    >>> Agents(order=2, drag="0.1").plant
    (Fraction(0, 1), Fraction(1, 10))
    >>> Agents(order=2, decay=2)
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: decay = 2 is not above 2 (n - 1) = 2: velocities would not agree at T; \
give 4, from which on the input is bounded
    """

    order: int | None = None
    plant: Sequence[Exact] | None = None
    drag: Exact | None = None
    rest: Exact | None = None
    cascade: Exact | None = None
    decay: Exact | None = None
    offsets: Any = None
    biases: Any = None
    gain_cap: Exact | None = None

    def __post_init__(self) -> None:
        listed = getattr(self.plant, "ndim", 1) == 1 and isinstance(self.plant, Collection)
        if self.plant is not None and (isinstance(self.plant, str | bytes) or not listed):
            raise ParameterError("plant", f"= {shorten(repr(self.plant))} is no list; give a_1 to a_n, [0, 0.1] say")
        numbers = None if self.plant is None else list(self.plant)
        given = 2 if numbers is None else len(numbers)
        if not given:
            raise ParameterError("plant", "is empty; give a_1 to a_n, or leave it out for chains of integrators")
        order = whole_number(given if self.order is None else self.order, "order", 1, MOST_ORDER)
        if given != order and numbers is not None:
            count = f"{given} number{'s' * (given > 1)}"
            raise ParameterError("plant", f"has {count} for agents of order {order}; give a_1 to a_{order}")
        plant = [Fraction(0)] * order if numbers is None else [_number("plant", x) for x in numbers]
        if self.drag is not None:
            if plant[-1]:
                raise ParameterError("drag", "is the last number of plant; give one of them")
            plant[-1] = _number("drag", self.drag)
        values: dict[str, Any] = {"order": order, "plant": tuple(plant), "drag": None}
        for name in ("rest", "cascade", "decay", "gain_cap"):
            value = getattr(self, name)
            values[name] = None if value is None else parameter(name, value)
        for name, value in values.items():
            object.__setattr__(self, name, value)
        self._refuse()

    def _refuse(self) -> None:
        """Refuse what does not fit together."""
        if self.cascade is not None:
            self._refuse_beside_cascade()
        n, decay = self.degree, self.decay_rate
        if decay > MOST_DECAY:
            raise ParameterError("decay", f"= {float(decay):.6g} is above {MOST_DECAY}; no input follows such gains")
        if decay <= 2 * (n - 1) and self.gain_cap is None:
            plural = PLURALS[n - 1] if n <= len(PLURALS) else f"derivatives {n - 1}"
            raise ParameterError(
                "decay",
                f"= {readable(decay)} is not above 2 (n - 1) = {2 * (n - 1)}: {plural} would not agree at T; "
                f"give {2 * n}, from which on the input is bounded",
            )
        if self.biases is not None and self.coefficients[0]:
            raise ParameterError(
                "biases", ("agents with a force towards 0 (a_1) take no formation by them; give ", Change("offsets"))
            )
        if self.rest is not None:
            why: Sentence = ""
            if n != 2:
                why = f"agents of order 2; these are of order {n}"
            elif self.coefficients[0]:
                why = "agents without a force towards 0 (a_1 = 0)"
            elif self.gain_cap is not None:
                why = ("an unlimited gain; leave ", Change("gain_cap"), " out")
            if why:
                begin = f"= {readable(self.alpha)}: meeting at rest is proved for "
                raise ParameterError("rest", joined("", (begin, why)))

    def _refuse_beside_cascade(self) -> None:
        """Refuse what the cascade does not take."""
        own = "; its gains are its own" if self.decay is not None else "; it brings agents to rest by itself"
        given = next((name for name in ("rest", "decay", "gain_cap") if getattr(self, name) is not None), None)
        why: Sentence = ""
        if given is not None:
            own = own if given != "gain_cap" else ": it is proved of an unlimited gain"
            why = ("leave ", Change(given), f" out{own}")
        elif self.degree != 2:
            why = f"it is proved of agents of order 2; these are of order {self.degree}"
        elif any(self.coefficients):
            why = "it is proved of double integrators without drag or forces; cancel them by the input, or leave it out"
        if why:
            raise ParameterError("cascade", joined(": ", (f"= {readable(self.alpha)}", why)))

    @property
    def degree(self) -> int:
        """``n``."""
        return int(self.order or 2)

    @property
    def coefficients(self) -> tuple[Fraction, ...]:
        """``a_1`` to ``a_n``."""
        return tuple(self.plant or ())  # type: ignore[arg-type]

    @property
    def alpha(self) -> Fraction:
        """``alpha`` of the own velocity; 0 if the agents need not rest."""
        value = self.rest if self.cascade is None else self.cascade
        return Fraction(0) if value is None else Fraction(value)

    @property
    def own(self) -> tuple[Fraction, ...]:
        """``f_1`` to ``f_n``: what each agent feeds back of its own state."""
        return tuple(self.alpha if i == 1 else Fraction(0) for i in range(self.degree))

    @property
    def cap(self) -> Fraction | None:
        """What the gain is at most."""
        return None if self.gain_cap is None else Fraction(self.gain_cap)

    @property
    def decay_rate(self) -> Fraction:
        """``R``."""
        return Fraction(2 * self.degree) if self.decay is None else Fraction(self.decay)

    @property
    def plain(self) -> bool:
        """Whether these are the paper's agents, ``x' = u``, of which the plain certificate tells everything.

        A gain cap may limit their gain: the plain certificate counts it in as ``limits``, under the nominal protocol.
        """
        return self.of_paper and self.offsets is None and self.biases is None

    @property
    def of_paper(self) -> bool:
        """Whether these are single integrators that run the paper's protocol, about their places if they have any."""
        return self.degree == 1 and not any(self.coefficients) and self.decay is None

    def text(self) -> str:
        """Tell the agents in a few words.

        Examples
        --------
        >>> Agents(order=2, drag="0.1").text(), Agents(order=3).text(), Agents(plant=[4, 0]).text()
        ('double integrators with drag 1/10', 'triple integrators', "agents x'' + 4 x = u")
        """
        return plant_text(self.coefficients)

    def refuse_motion(self, T: Fraction) -> None:
        """Refuse agents that move too far by themselves until ``T``.

        Raises
        ------
        ParameterError
            ``T (1 + max |a_i|)`` is above 100.
        """
        size = T * (1 + max(map(abs, self.coefficients)))
        if any(self.coefficients) and size > MOST_MOTION:
            raise ParameterError(
                "plant",
                f"T (1 + max |a_i|) = {float(size):.4g} is above {MOST_MOTION}: by itself an agent may move by "
                f"e^{MOST_MOTION}; take a shorter deadline or another unit of time",
            )


def plant_text(plant: Sequence[Fraction]) -> str:
    """Tell the equation of one agent in a few words."""
    n = len(plant)
    chain = {1: "single integrators", 2: "double integrators", 3: "triple integrators"}
    name = chain.get(n, f"chains of {n} integrators")
    if not any(plant):
        return name
    if n == 2 and not plant[0]:
        return f"{name} with drag {readable(plant[1])}"
    marks = [f"x^({i})" if i > 3 else "x" + "'" * i for i in range(n + 1)]
    terms = [f"{'-' if a < 0 else '+'} {readable(abs(a))} {marks[i]}" for i, a in reversed(list(enumerate(plant))) if a]
    return f"agents {marks[n]} {' '.join(terms)} = u"


def _number(name: str, value: Any) -> Fraction:
    """Return a number of any sign, or refuse it by name."""
    try:
        number = as_fraction(value, name)
    except NumberError as error:
        raise ParameterError(name, no_number(value, error)) from None
    if number.numerator.bit_length() + number.denominator.bit_length() > LONGEST_BITS:
        raise ParameterError(name, "has too many digits for exact proofs; round it, to 17 digits say")
    return number


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
    >>> from ptcc_certify.protocols import NominalProtocol
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
        >>> from ptcc_certify.protocols import NominalProtocol
        >>> base, zero = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), Fraction(0)
        >>> AgentsProtocol(base, (zero,) * 2, (zero, Fraction(1)), (Fraction(3), Fraction(2)), ((zero,),), None).law()
        "3 g^2 e + 2 g e' - 1 g x'"
        """
        n = self.order
        terms = [f"{near(K)} {_power(n - i)}{_primed('e', i)}" for i, K in enumerate(self.gains)]
        own = [f" - {near(f)} {_power(n - i)}{_primed('x', i)}" for i, f in enumerate(self.own) if f]
        return " + ".join(terms) + "".join(own)

    def _gain(self, t: ca.SX) -> ca.SX:
        import casadi as ca

        free = self.gain.expression(t)
        return free if self.gain_cap is None else ca.fmin(free, float(self.gain_cap))

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

        graph, eta, n = as_graph(graph), self._gain(t), self.order
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

        graph, t, n = as_graph(graph), ca.SX.sym("t"), self.order
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
        >>> from ptcc_certify.protocols import NominalProtocol
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
        gain = self.gain.latex(numbers=True)
        if self.gain_cap is not None:
            gain = rf"\min\left({float(self.gain_cap):g}, {gain}\right)"
        return [f"e_{{k}} &= {error}", f"g &= {gain}"]

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
