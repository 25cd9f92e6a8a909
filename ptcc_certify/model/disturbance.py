r"""Bounded disturbances ``d_k(t)`` of the agents ``x_k' = u_k + d_k`` with ``|d_k| <= delta``.

An expression is written in ``t`` and in ``k = 1, ..., N``, the position of the agent
(:mod:`ptcc_certify.model.expression`). The bound ``|d| <= delta`` on the whole horizon is established by interval
arithmetic over balls, bisecting boxes of time, for the expression in real arithmetic.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ptcc_certify.errors import NumberError, ParameterError, gated
from ptcc_certify.graphs.packed_weights import ByValue
from ptcc_certify.graphs.rationals import Exact, as_fraction, nearest_float, shorten, whole_number
from ptcc_certify.model.casadi_latex import to_latex
from ptcc_certify.model.expression import ATOMS, Program, enclosure, floats, parse, symbolic

if TYPE_CHECKING:
    import casadi as ca
    from numpy.typing import ArrayLike

MAX_SWITCHES, MAX_SAMPLES = 10**6, 2 * 10**7
TOLERANCE = 1e-12
_GRID, _BISECTIONS, _BOXES, _INSTANTS, _CHUNK = 513, 48, 40_000, 20_000, 64


class Disturbance:
    """The disturbances of all agents; ``agents`` count from 0, so that ``k = agent + 1``."""

    @property
    @abstractmethod
    def text(self) -> str:
        """A short description, which a certificate shows."""

    @abstractmethod
    def values(self, t: ArrayLike, agents: ArrayLike, signs: ArrayLike) -> np.ndarray:
        """Return ``d_k(t)`` at instants, for agents whose sliding variables have given signs.

        Parameters
        ----------
        t : (M,) array_like
            Instants, in units of time.
        agents : (A,) array_like of int
            Counted from 0.
        signs : (A,) array_like
            ``sign(sigma_k)`` of these agents; only the worst-case disturbance reads it.

        Returns
        -------
        (A, M) array
        """

    @abstractmethod
    def check(self, delta: Fraction, labels: Sequence[str], until: float, slack: float = TOLERANCE) -> str:
        """Return how ``|d_k| <= delta`` was established on [0, until] for the agents of these labels.

        Parameters
        ----------
        delta : Fraction
            The bound, in units of the input.
        labels : sequence of N str
            The agents, by which a message names them.
        until : float
            In units of time.
        slack : float
            Relative excess that is let pass, for the rounding of floats.

        Returns
        -------
        str
            In words: "interval arithmetic", "by definition", ...

        Raises
        ------
        ParameterError
            Names agent, time and value where the bound is broken, or the numbers of signals and agents that differ.
        """

    def breaks(self, until: float) -> np.ndarray:
        """Return the ascending instants in (0, until) where a signal or its slope may jump; none by default.

        Parameters
        ----------
        until : float
            In units of time.

        Returns
        -------
        (B,) array
        """
        return np.empty(0)

    def linear(self, t0: float, t1: float, agents: ArrayLike, signs: ArrayLike) -> tuple[np.ndarray, np.ndarray] | None:
        """Return ``a`` and ``b`` (A,) with ``d = a + b t`` between neighbouring breaks; None if it is not linear.

        Parameters
        ----------
        t0, t1 : float
            Ends of an interval without a break inside, in units of time.
        agents : (A,) array_like of int
            Counted from 0.
        signs : (A,) array_like
            ``sign(sigma_k)`` of these agents.

        Returns
        -------
        pair of (A,) arrays, or None
        """
        return None


@gated
@dataclass(frozen=True, init=False)
class ExpressionDisturbance(Disturbance):
    r"""Disturbances written as expressions of ``k`` and ``t``.

    Known are the constants ``pi`` and ``e``, decimal numbers (the floats nearest to them), ``+ - * / **`` and
    parentheses, which bind as in Python, and the functions sin, cos, tan, atan, tanh, exp, log, sqrt, abs, sign, min
    and max, the last two of two or more arguments.

    Parameters
    ----------
    text_or_texts : str or sequence of str
        One expression for all agents, or one for each; at most 1,000 characters and 50 levels of nesting.

    Attributes
    ----------
    texts : tuple of str
        The expressions, blanks aside.
    common : bool
        Whether one expression is for all agents.

    Raises
    ------
    ParameterError
        Names the column of what is not of this grammar.

    Examples
    --------
    >>> d = ExpressionDisturbance("0.2*sin(2*k*t + pi/3)")
    >>> d.values([0.0, 1.0], [0, 1], [1, -1]).round(4)
    array([[ 0.1732,  0.0189],
           [ 0.1732, -0.1889]])
    >>> d.check(Fraction(1, 5), ["a", "b"], until=3.0)
    'interval arithmetic'
    >>> print(d.latex())
    0.2 \sin\left(2 k t + \frac{\pi}{3}\right)
    """

    texts: tuple[str, ...]
    common: bool
    _programs: dict[str, Program] = field(repr=False, compare=False)

    def __init__(self, text_or_texts: str | Sequence[str]):
        common = isinstance(text_or_texts, str)
        several = list(text_or_texts) if isinstance(text_or_texts, Iterable) else []
        texts: list[Any] = [text_or_texts] if common else several
        if not texts or not all(isinstance(text, str) for text in texts):
            raise ParameterError("a disturbance is one text, or one text for each agent")
        programs = {" ".join(text.split()): parse(text) for text in dict.fromkeys(texts)}
        object.__setattr__(self, "texts", tuple(" ".join(text.split()) for text in texts))
        object.__setattr__(self, "common", common)
        object.__setattr__(self, "_programs", programs)

    @property
    def text(self) -> str:
        """The expression, or the first 400 characters of all expressions."""
        return self.texts[0] if self.common else shorten("; ".join(self.texts), 400)

    def values(self, t: ArrayLike, agents: ArrayLike, signs: ArrayLike = ()) -> np.ndarray:
        """Return ``d_k(t)``: floats (A, M), infinite or nan where the expression is; ``signs`` does not matter."""
        instants, agents = np.asarray(t, dtype=float), np.asarray(agents, dtype=int)
        values = np.empty((agents.size, instants.size))
        for text, rows in self._groups(agents):
            values[rows] = floats(self._programs[text], agents[rows, None] + 1.0, instants[None, :])
        return values

    def casadi(self, t: ca.SX | ca.MX, agent: int) -> ca.SX | ca.MX:
        """Return the CasADi expression of the symbol ``t`` for ``agent`` (from 0), of the type of ``t``."""
        number = type(t)
        atoms = {"k": number(agent + 1), "t": t, "pi": number(math.pi), "e": number(math.e)}
        return symbolic(self._program(agent), atoms)

    def latex(self, agent: int = 0) -> str:
        """Return the LaTeX of the common expression, or of that of ``agent`` (counted from 0).

        Raises
        ------
        ParameterError
            The expression holds a number that is not finite, or a chain of operations too long to be printed.
        """
        import casadi as ca

        try:
            return to_latex(symbolic(self._program(agent), {name: ca.SX.sym(name) for name in ATOMS}))
        except (RecursionError, SystemError):  # the second: CasADi before 3.8
            raise ParameterError(f'disturbance "{shorten(self.text)}" is too long to be printed as LaTeX') from None

    def check(self, delta: Fraction, labels: Sequence[str], until: float, slack: float = TOLERANCE) -> str:
        """Bisect boxes of time until intervals enclose ``d`` in ``[-delta, delta]``; where that fails, sample it.

        Returns
        -------
        str
            "interval arithmetic" or "sampling at 20,000 instants".

        Raises
        ------
        ParameterError
            Names agent, time and value where the bound is broken, or where no bound can be given.
        """
        limit = _Limit(delta, slack, labels)
        budget, sampled = _BOXES, False
        if not self.common:
            limit.refuse_other_count(len(self.texts), "expressions")
        for text, agents in self._groups(np.arange(len(labels))):
            for chunk in _chunks(agents if "k" in self._programs[text] else agents[:1]):
                budget, by_samples = self._check_boxes(text, chunk, limit, until, budget)
                sampled |= by_samples
        return f"sampling at {_INSTANTS:,} instants" if sampled else "interval arithmetic"

    def _groups(self, agents: np.ndarray) -> list[tuple[str, np.ndarray]]:
        """Return each expression with the indices of the agents that it belongs to."""
        groups: dict[str, list[int]] = {}
        for row, agent in enumerate(agents):
            groups.setdefault(self.texts[0 if self.common else agent], []).append(row)
        return [(text, np.array(rows)) for text, rows in groups.items()]

    def _program(self, agent: int) -> Program:
        return self._programs[self.texts[0 if self.common else agent]]

    def _check_boxes(self, text: str, agents: np.ndarray, limit: _Limit, until: float, budget: int) -> tuple[int, bool]:
        """Return the number of boxes left to spend, and whether samples had to do."""
        program, bound = self._programs[text], limit.bound
        place = f'disturbance "{shorten(text)}"'

        def sample(k: np.ndarray, t: np.ndarray) -> None:
            limit.refuse_beyond(floats(program, k + 1.0, t), t, k, place)

        sample(agents[:, None], np.linspace(0, until, _GRID)[None, :])
        boxes, sampled = [(int(agent), 0.0, until) for agent in agents], False
        for level in range(_BISECTIONS + 1):
            ends = {box: enclosure(program, box[0] + 1, *box[1:]) for box in boxes}
            undefined = [box for box, end in ends.items() if end is None]
            boxes = [box for box, end in ends.items() if end is None or not (end[0] >= -bound and end[1] <= bound)]
            if level == _BISECTIONS or 2 * len(boxes) > budget:
                sampled |= len(boxes) > len(undefined)
                boxes = undefined
            if not boxes:
                break
            if level == _BISECTIONS or 2 * len(boxes) > _BOXES:  # undefined ones may overspend: they are few
                where = f"agent {shorten(limit.labels[boxes[0][0]])}, t = {boxes[0][1]:.9g}"
                mend = "is it undefined there? keep clear of divisions by zero, or write sqrt(max(0, ...))"
                raise ParameterError(f"{place}: no bound can be given near {where}; {mend}")
            halves = [(agent, lo, (lo + hi) / 2, hi) for agent, lo, hi in boxes]
            sample(np.array([half[0] for half in halves]), np.array([half[2] for half in halves]))
            boxes = [(agent, *side) for agent, lo, mid, hi in halves for side in ((lo, mid), (mid, hi))]
            budget -= len(boxes)
        if sampled:
            # Not on a lattice, which a fast signal could hide between.
            sample(agents[:, None], np.sort(np.random.default_rng(_INSTANTS).uniform(0, until, _INSTANTS))[None, :])
        return budget, sampled


@gated
@dataclass(frozen=True, init=False, eq=False)
class SampledDisturbance(ByValue, Disturbance):
    """Disturbances given at instants, linear between them, constant before the first and after the last.

    Parameters
    ----------
    times : (M,) array_like
        Ascending, not negative; in units of time.
    values : (M,) or (N, M) array_like
        Common to all agents, or one row for each; in units of the input.
    hold : bool
        Keep each value until the next instant instead.
    text : str, optional
        The description.

    Attributes
    ----------
    samples : (1, M) or (N, M) array
        The values, one row for each signal.

    Raises
    ------
    ParameterError
        The shapes do not fit, a number is not finite, or the times do not ascend.

    Examples
    --------
    >>> d = SampledDisturbance([0, 1, 3], [0, 1, -1])
    >>> d.values([0.5, 2.0, 9.0], [0], [1])
    array([[ 0.5,  0. , -1. ]])
    >>> d.linear(1, 3, [0], [1])
    (array([2.]), array([-1.]))
    """

    times: np.ndarray
    samples: np.ndarray
    hold: bool
    text: str = ""

    def __init__(self, times: ArrayLike, values: ArrayLike, hold: bool = False, text: str = ""):
        try:
            instants, samples = np.array(times, dtype=float), np.array(values, dtype=float)
        except (TypeError, ValueError, OverflowError):
            raise ParameterError(
                "a sampled disturbance needs arrays of numbers: times (M,) and values (N, M)"
            ) from None
        shape = samples.shape
        samples = samples[None] if samples.ndim == 1 else samples
        if instants.ndim != 1 or samples.ndim != 2 or not samples.size or samples.shape[1] != instants.size:
            shapes = f"times {instants.shape} and values {shape}"
            raise ParameterError(f"a sampled disturbance needs times (M,) and values (M,) or (N, M), not {shapes}")
        if not np.isfinite(samples).all():
            row, column = np.argwhere(~np.isfinite(samples))[0]
            raise ParameterError(
                f"sample {column + 1} of signal {row + 1} is {samples[row, column]}; give a finite number"
            )
        if not np.isfinite(instants).all() or instants[0] < 0 or (np.diff(instants) <= 0).any():
            raise ParameterError("the times of a sampled disturbance must be finite, not negative and ascending")
        between = "held" if hold else "linear between"
        parts = {"times": instants, "samples": samples, "hold": bool(hold)}
        for name, part in (parts | {"text": text or f"{instants.size} samples, {between}"}).items():
            object.__setattr__(self, name, part)
        self.lock()

    def values(self, t: ArrayLike, agents: ArrayLike, signs: ArrayLike = ()) -> np.ndarray:
        """Return ``d_k(t)``: floats (A, M); ``signs`` does not matter."""
        t, rows = np.asarray(t, dtype=float), self._rows(agents)
        index = self._index(t)
        if self.hold or self.times.size == 1:
            return rows[:, index]
        index = np.minimum(index, self.times.size - 2)
        share = np.clip((t - self.times[index]) / (self.times[index + 1] - self.times[index]), 0, 1)
        return rows[:, index] * (1 - share) + rows[:, index + 1] * share

    def breaks(self, until: float) -> np.ndarray:
        """Return the instants of the samples in (0, until)."""
        return self.times[(self.times > 0) & (self.times < until)]

    def linear(self, t0: float, t1: float, agents: ArrayLike, signs: ArrayLike = ()) -> tuple[np.ndarray, np.ndarray]:
        """Return ``a`` and ``b`` (A,) with ``d = a + b t`` on [t0, t1], which holds no break inside."""
        middle, rows = (t0 + t1) / 2, self._rows(agents)
        i = int(self._index(middle))
        if self.hold or middle < self.times[0] or i == self.times.size - 1:
            return rows[:, i], np.zeros(len(rows))
        with np.errstate(over="ignore"):
            slope = (rows[:, i + 1] - rows[:, i]) / (self.times[i + 1] - self.times[i])
        slope[~np.isfinite(slope)] = 0.0
        return rows[:, i] - slope * self.times[i], slope

    def check(self, delta: Fraction, labels: Sequence[str], until: float, slack: float = TOLERANCE) -> str:
        """Compare all samples on [0, until], and the values at both ends, with ``delta``."""
        limit = _Limit(delta, slack, labels)
        count = len(self.samples)
        place = f"disturbance ({shorten(self.text)})"
        if count > 1:
            limit.refuse_other_count(count, "signals")
        instants = np.unique([0.0, *self.breaks(until), until])
        for chunk in _chunks(np.arange(count)):
            limit.refuse_beyond(self.values(instants, chunk), instants, chunk[:, None], place)
        return "exact at the samples"

    def _rows(self, agents: ArrayLike) -> np.ndarray:
        agents = np.asarray(agents, dtype=int)
        return self.samples[np.zeros_like(agents) if len(self.samples) == 1 else agents]

    def _index(self, t: Any) -> Any:
        return np.maximum(np.searchsorted(self.times, t, side="right") - 1, 0)


def telegraph_noise(amplitude: float, rate: float, n: int, until: float, seed: int = 0) -> SampledDisturbance:
    """Return random telegraph signals: ``+-amplitude``, switching at the instants of independent Poisson processes.

    Parameters
    ----------
    amplitude, rate : float
        Not negative; ``amplitude`` in units of the input, ``rate`` is the mean number of switches of one agent per
        unit of time.
    n : int
        Number of agents.
    until : float
        Positive, in units of time; the signals keep their last values from here on.
    seed : int
        Equal seeds give equal signals.

    Returns
    -------
    SampledDisturbance
        Constant between its switches.

    Raises
    ------
    ParameterError
        A parameter is outside its domain, or more than 10^6 switches or 2 10^7 samples are to be expected.

    Examples
    --------
    >>> noise = telegraph_noise(0.5, rate=10, n=2, until=1.0, seed=1)
    >>> abs(noise.values([0.0, 0.9], [0, 1]))
    array([[0.5, 0.5],
           [0.5, 0.5]])
    """
    amplitude, rate, until = (
        _number(value, name) for value, name in ((amplitude, "amplitude"), (rate, "rate"), (until, "until"))
    )
    n, seed = whole_number(n, "n", 1, MAX_SAMPLES), whole_number(seed, "seed", 0, 2**63)
    if amplitude < 0 or rate < 0 or until <= 0:
        raise ParameterError("telegraph signals need amplitude >= 0, rate >= 0 and until > 0")
    expected = n * rate * until
    if expected > MAX_SWITCHES or n * expected > MAX_SAMPLES:
        limit = f"the limits are {MAX_SWITCHES:,} switches and {MAX_SAMPLES:,} samples, one of each agent at each"
        raise ParameterError(f"{expected:.3g} switches of {n} telegraph signals are too many; {limit}; lower rate")
    random = np.random.default_rng(seed)
    agents = np.repeat(np.arange(n), random.poisson(rate * until, size=n))
    times, columns = np.unique(np.append(random.uniform(0, until, agents.size), 0.0), return_inverse=True)
    signals = np.ones((n, times.size))
    signals[:, 0] = amplitude * random.choice([-1.0, 1.0], size=n)
    np.multiply.at(signals, (agents, columns[:-1]), -1.0)
    np.cumprod(signals, axis=1, out=signals)
    text = f"random telegraph signals, +-{amplitude:g}, rate {rate:g}, seed {seed}"
    return SampledDisturbance(times, signals, hold=True, text=text)


@dataclass(frozen=True, init=False)
class WorstCaseDisturbance(Disturbance):
    """The worst disturbance against reaching: ``d_k = delta sign(sigma_k)``, zero while sliding.

    Parameters
    ----------
    delta : int, float, str or Fraction
        Not negative; in units of the input.

    Attributes
    ----------
    text : str
        The description.

    Raises
    ------
    ParameterError
        ``delta`` is negative or not a number.

    References
    ----------
    Equation (49) of [Zhu]_: of all ``|d_k| <= delta`` this one makes ``|sigma_k|'`` largest.

    Examples
    --------
    >>> WorstCaseDisturbance("1/2").values([0.0, 1.0], [0, 1], [1, -1])
    array([[ 0.5,  0.5],
           [-0.5, -0.5]])
    """

    delta: Fraction
    text: str = field(default="worst-case disturbance: delta sign(sigma_k)", init=False, repr=False)

    def __init__(self, delta: Exact):
        object.__setattr__(self, "delta", _exact(delta, "delta"))
        if self.delta < 0:
            raise ParameterError(f"delta of the worst-case disturbance is {float(self.delta):g}; give zero or more")

    def values(self, t: ArrayLike, agents: ArrayLike, signs: ArrayLike) -> np.ndarray:
        """Return ``delta sign(sigma_k)``: floats (A, M)."""
        return np.outer(self.linear(0, 0, agents, signs)[0], np.ones(np.size(t)))

    def linear(self, t0: float, t1: float, agents: ArrayLike, signs: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return ``a = delta sign(sigma_k)`` and ``b = 0``."""
        level = nearest_float(self.delta) * np.asarray(signs, dtype=float)
        return level, np.zeros(level.size)

    def check(self, delta: Fraction, labels: Sequence[str], until: float, slack: float = TOLERANCE) -> str:
        """Compare the worst-case disturbance's ``delta`` with that of the protocol."""
        if self.delta > delta:
            value, limit = nearest_float(self.delta), nearest_float(delta)
            raise ParameterError(
                f"the worst-case disturbance's |d_k| = {value!r} of agent {shorten(labels[0])} from t = 0 on is beyond "
                f"delta = {limit!r}; make the worst-case disturbance with that delta"
            )
        return "by definition"


@gated
@dataclass(frozen=True)
class StateDependent(Disturbance):
    """A disturbance computed by a Python function of time and state.

    Parameters
    ----------
    function : callable
        ``function(t, x, sigma)`` of a float and two arrays (N,) returns an array (N,) or a number.
    text : str
        The description.

    Examples
    --------
    >>> d = StateDependent(lambda t, x, sigma: 0.1 * np.cos(x))
    >>> d.at(0.0, np.zeros(2), np.zeros(2), Fraction(1, 10), ["a", "b"])
    array([0.1, 0.1])
    """

    function: Callable[[float, np.ndarray, np.ndarray], ArrayLike]
    text: str = "state-dependent (Python)"

    def at(
        self,
        t: float,
        x: np.ndarray,
        sigma: np.ndarray,
        delta: Fraction,
        labels: Sequence[str],
        slack: float = TOLERANCE,
    ) -> np.ndarray:
        """Return the disturbances at one instant.

        Parameters
        ----------
        t : float
            In units of time.
        x, sigma : (N,) arrays
            States and sliding variables.
        delta : Fraction
            The bound, in units of the input.
        labels : sequence of N str
            The agents, by which a message names them.
        slack : float
            Relative excess that is let pass, for the rounding of floats.

        Returns
        -------
        (N,) array

        Raises
        ------
        ParameterError
            The function does not return N numbers; or names agent, time and value beyond ``delta``.
        """
        try:
            value = self.function(t, x, sigma)
        except TypeError as error:
            mend = "give a function of (t, x, sigma)"
            raise ParameterError(f"{self.text} at t = {t:.9g}: {shorten(str(error), 120)}; {mend}") from None
        try:
            values = np.array(value, dtype=float)
        except (TypeError, ValueError, OverflowError):
            raise ParameterError(f"{self.text} at t = {t:.9g}: {shorten(repr(value))} is no array of numbers") from None
        if values.shape not in ((), (len(labels),)):
            hint = f"return a number or shape ({len(labels)},)"
            raise ParameterError(f"{self.text} at t = {t:.9g}: the shape is {values.shape}; {hint}")
        values = np.broadcast_to(values, (len(labels),))
        agents = np.arange(len(labels))
        _Limit(delta, slack, labels).refuse_beyond(values, np.array(t), agents, f"disturbance ({self.text})")
        return values

    def values(self, t: ArrayLike, agents: ArrayLike, signs: ArrayLike) -> np.ndarray:
        """Refuse: without the state there is no value; use :meth:`at`.

        Raises
        ------
        ParameterError
            Always.
        """
        raise ParameterError(f"{self.text}: a disturbance that depends on the state has no values without it; use at")

    def check(self, delta: Fraction, labels: Sequence[str], until: float, slack: float = TOLERANCE) -> str:
        """Leave the check to :meth:`at`."""
        return "at every evaluation of the run"


def as_disturbance(value: Any, n: int, delta: Exact, until: float, seed: int = 0) -> Disturbance:
    """Read a disturbance of ``n`` agents.

    Parameters
    ----------
    value : Disturbance, str, number, callable or sequence
        An expression of ``k`` and ``t``; "none"; "worst-case"; "telegraph" (amplitude ``delta``, 20 switches of each
        agent to be expected until ``until``); a constant; ``n`` expressions or constants; or a function of
        ``(t, x, sigma)``.
    n : int
        Number of agents.
    delta : int, float, str or Fraction
        The bound of the protocol.
    until : float
        End of the horizon.
    seed : int
        Of the telegraph signals.

    Raises
    ------
    ParameterError
        ``value`` is none of these, or not of ``n`` items.

    Examples
    --------
    >>> as_disturbance("worst-case", 2, "0.1", 1.0).text
    'worst-case disturbance: delta sign(sigma_k)'
    >>> as_disturbance([0.1, "1/3"], 2, 1, 1.0)
    Traceback (most recent call last):
    ...
    ptcc_certify.errors.ParameterError: texts and numbers are mixed; write the numbers as texts too
    """
    if isinstance(value, Disturbance):
        return value
    if isinstance(value, str):
        word = value.strip()
        if word == "none":
            return SampledDisturbance([0], [0], text="none")
        if word == "worst-case":
            return WorstCaseDisturbance(delta)
        if word == "telegraph":
            horizon = _number(until, "until")
            rate = 20 / horizon if horizon > 0 else 0.0
            return telegraph_noise(nearest_float(_exact(delta, "delta")), rate, n, horizon, seed)
        return ExpressionDisturbance(value)
    if callable(value):
        return StateDependent(value)
    if isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim):
        items = list(value)
        if len(items) != n:
            raise ParameterError(f"{len(items)} disturbances for {n} agents; give one for each, or one for all")
        texts = sum(isinstance(item, str) for item in items)
        if 0 < texts < n:
            raise ParameterError("texts and numbers are mixed; write the numbers as texts too")
        if texts:
            return ExpressionDisturbance(items)
        levels = [[_number(item, f"disturbance of agent {i}")] for i, item in enumerate(items, 1)]
        return SampledDisturbance([0], levels, text="constant")
    level = _number(value, "the disturbance")
    return SampledDisturbance([0], [level], text=f"constant {level!r}")


def _exact(value: Any, name: str) -> Fraction:
    try:
        return as_fraction(value, name)
    except NumberError as error:
        raise ParameterError(f"{error}; give a finite number, or a text such as 0.1*sin(t)") from None


def _chunks(agents: np.ndarray) -> Iterator[np.ndarray]:
    return (agents[start : start + _CHUNK] for start in range(0, agents.size, _CHUNK))


def _number(value: Any, name: str) -> float:
    number = nearest_float(_exact(value, name))
    if math.isinf(number):
        raise ParameterError(name, "is beyond the range of floats; give a smaller number")
    return number


class _Limit(NamedTuple):
    """The bound of the disturbance of the agents of these labels, and how far floats may exceed it, relatively."""

    delta: Fraction
    slack: float
    labels: Sequence[str]

    @property
    def bound(self) -> float:
        return nearest_float(self.delta) * (1 + self.slack)

    def refuse_other_count(self, count: int, what: str) -> None:
        n = len(self.labels)
        if count != n:
            raise ParameterError(f"the disturbance has {count} {what} for {n} agents; give one for each")

    def refuse_beyond(self, values: np.ndarray, t: np.ndarray, agents: np.ndarray, place: str) -> None:
        """Refuse values that are not finite or beyond ``delta``; the three arrays broadcast."""
        size = np.where(np.isfinite(values), np.abs(values), np.inf)
        worst = int(size.argmax())
        if size.flat[worst] <= self.bound:
            return
        agent, instant = (np.broadcast_to(array, size.shape).flat[worst] for array in (agents, t))
        value, delta = float(values.flat[worst]), nearest_float(self.delta)
        where = f"{place} of agent {shorten(self.labels[agent])} at t = {float(instant):.9g}"
        if not math.isfinite(value):
            raise ParameterError(f"{where} is {value}, not finite; keep clear of poles and of the ends of domains")
        raise ParameterError(f"{where} is {value!r}, beyond delta = {delta!r}; lower it or raise delta")
