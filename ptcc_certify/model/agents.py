"""Agents of order n: what they are, and what is asked of their protocol."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

from lmi.exact.decimal_rounding import counted
from ptcc_certify.errors import Change, NumberError, ParameterError, Sentence, gated, joined
from ptcc_certify.graphs.declared_option import option
from ptcc_certify.graphs.rationals import Exact, as_fraction, no_number, shorten, whole_number
from ptcc_certify.model.parameters import parameter, readable

#: Largest order, and largest dimension of space.
MOST_ORDER, MOST_DIMENSION = 8, 8
#: Largest order of agents that track virtual positions.
MOST_TRACKING = 3
#: Largest ``T (1 + max |a_i|)`` of agents that move by themselves, and longest numbers, in bits.
MOST_MOTION, LONGEST_BITS = 100, 2000
#: Largest ``R`` that is asked for.
MOST_DECAY = 1000
#: What agents hear of each other.
EXCHANGES = ("states", "virtual")
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
        of the clock. No gain depends on the graph; see :class:`~ptcc_certify.model.agents_protocol.CascadeProtocol`.
    decay : number or str, optional
        ``R = r rho2 kappa``: deviations decay like ``(1 - t/T)^(R/2)`` near ``T``; above ``2 (n - 1)``. By default
        ``2 n``, from which on the input is bounded; single integrators without it run the paper's protocol, ``K = 1``.
    offsets : state-like, or N rows of numbers, optional
        Places ``h_k`` in a formation, by label or in node order.
    biases : state-like, or N rows of numbers, optional
        What is added to the relative positions ``e_k``, by sensors or by hand: they make a formation, or are refused.
    gain_cap : number or str, optional
        What the gain is at most, in 1/time/weight; then something is left at ``T``.
    exchange : {"states", "virtual"}, optional
        What agents hear of each other: relative positions, velocities and so on, or virtual positions, which each of
        order 2 or 3 tracks by its own state alone. The latter goes with late messages, uncertain weights and leaders
        that move; see :class:`~ptcc_certify.model.virtual_positions.TrackingProtocol`.
    orders : state-like, optional
        Of a mixed team: the order of every agent, 1 to 3, in place of ``order``. They exchange virtual positions.

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

    section: ClassVar = "agents"
    order: int | None = option(
        "--agents KIND",
        "Agents of order n: double-integrator, triple-integrator, or n.",
        key="kind",
        example='"double-integrator"',
        kind="text",
        shown="integrator",
    )
    plant: Sequence[Exact] | None = option(
        "--plant LIST", "Agents: a_1,..,a_n of x^(n) + a_n x^(n-1) + .. + a_1 x = u.", example='"0,0.1"'
    )
    drag: Exact | None = option(
        "--drag NUMBER", "Agents: the force -drag times the highest velocity.", example="0.1", shown="0"
    )
    rest: Exact | None = option("--rest ALPHA", "Double integrators meet at rest: damping of their own velocity.")
    cascade: Exact | None = option(
        "--cascade ALPHA", "Double integrators track the plain protocol's velocity, at this rate."
    )
    decay: Exact | None = option("--decay R", "Agents: deviations fall like (1 - t/T)^(R/2).", example="4", shown="2 n")
    offsets: Any = option("--offsets STATE", "Agents: their places in a formation, like --x0.", example='"offsets.csv"')
    biases: Any = option(
        "--biases STATE", "Agents: what is added to their relative positions, like --x0.", example='"biases.csv"'
    )
    gain_cap: Exact | None = None
    exchange: str | None = option(
        "--exchange",
        "Agents: what they hear of each other; virtual positions may come late.",
        shown="states",
        example='"virtual"',
        choices=EXCHANGES,
    )
    orders: Any = option(
        "--orders STATE", "A mixed team: the order of every agent, 1 to 3, like --x0.", example='"team.csv"'
    )

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
            raise ParameterError(
                "plant", f"has {counted(given, 'number')} for agents of order {order}; give a_1 to a_{order}"
            )
        plant = [Fraction(0)] * order if numbers is None else [_number("plant", x) for x in numbers]
        if self.drag is not None:
            if plant[-1]:
                raise ParameterError("drag", "is the last number of plant; give one of them")
            plant[-1] = _number("drag", self.drag)
        if self.orders is not None and self.exchange is None:
            object.__setattr__(self, "exchange", "virtual")
        values: dict[str, Any] = {"order": order, "plant": tuple(plant), "drag": None}
        for name in ("rest", "cascade", "decay", "gain_cap"):
            value = getattr(self, name)
            values[name] = None if value is None else parameter(name, value)
        for name, value in values.items():
            object.__setattr__(self, name, value)
        self._refuse()

    def _refuse(self) -> None:
        """Refuse what does not fit together."""
        if self.exchange not in (None, *EXCHANGES):
            raise ParameterError("exchange", f"= {shorten(repr(self.exchange))} is none of {', '.join(EXCHANGES)}")
        if self.virtual:
            self._refuse_beside_virtual()
        elif self.orders is not None:
            mend = "are of agents that exchange virtual positions; give "
            raise ParameterError("orders", (mend, Change("exchange", "virtual")))
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

    def _refuse_beside_virtual(self) -> None:
        """Refuse what is not proved where virtual positions are exchanged."""
        if self.degree > MOST_TRACKING or (self.degree == 1 and self.orders is None):
            mend = ": single integrators exchange their positions as they are; leave it out"
            mend = mend if self.degree == 1 else f"; these are of order {self.degree}: not proved yet"
            raise ParameterError("exchange", f"= virtual is proved of agents of order 2 or 3{mend}")
        given = {name: getattr(self, name) for name in ("rest", "cascade", "decay", "biases")}
        name = next((name for name, value in given.items() if value is not None), None)
        name = ("plant" if self.coefficients[0] else "drag") if any(self.coefficients) else name
        if name is not None:
            why = "is not proved yet where virtual positions are exchanged; leave it or "
            raise ParameterError(name, (why, Change("exchange"), " out"))

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
    def virtual(self) -> bool:
        """Whether virtual positions are exchanged."""
        return self.exchange == "virtual"

    @property
    def plain(self) -> bool:
        """Whether these are the paper's agents, ``x' = u``, of which the plain certificate tells everything.

        A gain cap may limit their gain: the plain certificate counts it in as ``limits``, under the nominal protocol.
        """
        return self.of_paper and self.offsets is None and self.biases is None

    @property
    def of_paper(self) -> bool:
        """Whether these are single integrators that run the paper's protocol, about their places if they have any."""
        plain = not any(self.coefficients) and self.decay is None and not self.virtual
        return self.degree == 1 and plain

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
