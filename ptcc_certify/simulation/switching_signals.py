"""Signals: which member of a family acts, from when on.

A signal is piecewise constant on the stretched clock ``s``; a table may name instants of the time ``t`` instead, which
the clock of the gain translates.

A motion led by a signal along the stretched clock, from switch to switch; one graph is a constant signal.

On the clock ``dX/ds = -L(s) X`` has no pole: before ``T`` a run is on it. The state at ``T`` is the limit for ``s`` to
infinity, if there is one; from ``T`` on ``X' = -rho1 L X``.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lmi.exact.decimal_rounding import counted
from ptcc_certify.errors import FormatError, NumberError, ParameterError, SimulationError
from ptcc_certify.graphs.io.decimal_commas import pointed
from ptcc_certify.graphs.io.edge_list import Records
from ptcc_certify.graphs.io.files import Source, name_and_ending, read_bytes
from ptcc_certify.graphs.io.signs import find
from ptcc_certify.graphs.rationals import number_within, parse_exact, shorten, whole_number
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS
from ptcc_certify.model.constrained_switching import DwellTime
from ptcc_certify.model.gain import Gain
from ptcc_certify.simulation.cvodes import ON_CLOCK, Motion, Phase
from ptcc_certify.simulation.member_laplacians import MIDDLE, Choice, Members
from ptcc_certify.theorems.family_behaviour import decide

if TYPE_CHECKING:
    from ptcc_certify.lyapunov.common_forms import CommonForm

#: How random weights lie in their intervals.
WEIGHTS = ("both", "ends", "between")
#: What :func:`as_signal` takes as a word.
WORDS = ("random", "worst-case", "constant")
# The largest entry is imitated by the sum of this power: only the largest entries weigh in its gradient.
_POWER = 15
# Steps of the worst-case search for the time in which agents move.
_STEPS = 10
# Against the largest entry of the initial state: what still moves below is rounding, and the steps grow.
_AT_REST = 1e-11
_SHORTEST, _LONGEST = 1e-12, 1e12

State = Callable[[], np.ndarray]


class Stretch(NamedTuple):
    """A member that acts until a value of the clock, infinite if for ever."""

    choice: Choice
    until: float


class Signal(ABC):
    """What chooses a member of a family at every instant before ``T``; the last one stays.

    Attributes
    ----------
    text : str
        The signal in words.
    """

    text: str

    @abstractmethod
    def play(self, members: Members, gain: Gain, state: State) -> Iterator[Stretch]:
        """Yield the members in their order, and until when each acts; ``state()`` is the present state."""

    def past(self, members: Members, T: float) -> list[tuple[float, Choice]]:
        """Return what is chosen at instants from ``T`` on."""
        return []

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.text})"


class TableSignal(Signal):
    """Members from a table of instants.

    Parameters
    ----------
    rows : sequence of (instant, mode) or (instant, mode, level)
        The first instant is 0, the others ascend. The mode is a name, or a number from 0; the level that of
        :class:`ConstantSignal`.
    clock : bool
        Whether instants are values of the stretched clock, instead of times.

    Raises
    ------
    ParameterError
        A row is none, or the instants do not ascend from 0.

    Examples
    --------
    >>> TableSignal([(0, "day"), (0.5, "night")])
    TableSignal(2 rows over time)
    """

    def __init__(self, rows: Sequence[Sequence[Any]], clock: bool = False):
        self.clock = clock
        self.rows: list[tuple[float, int | str, Any]] = []
        for row in rows:
            if not 2 <= len(row) <= 3:
                raise ParameterError(f"row {shorten(repr(row))} is not (instant, mode) or (instant, mode, level)")
            instant = number_within(row[0], "instant", 0, 1e300)
            if instant <= self.rows[-1][0] if self.rows else instant:
                mend = f"{instant:g} follows {self.rows[-1][0]:g}" if self.rows else f"it begins at {instant:g}"
                raise ParameterError(f"the instants of a signal ascend from 0, and {mend}")
            self.rows.append((instant, row[1], row[2] if len(row) > 2 else MIDDLE))
        if not self.rows:
            raise ParameterError("the table of a signal is empty; give a row for the instant 0")
        self.text = f"{counted(len(self.rows), 'row')} over {'the clock' if clock else 'time'}"

    @classmethod
    def read(cls, path: Source) -> TableSignal:
        r"""Read a table with the columns ``t`` (or ``clock``) and ``mode``, and perhaps ``level``.

        Parameters
        ----------
        path : path or file object
            CSV with a header.

        Raises
        ------
        FormatError
            The header names no such columns, or a cell is no number; the line is named.

        Examples
        --------
        >>> TableSignal.read(StringIO("clock,mode,level\n0,day,1\n2.5,night,0\n"))
        TableSignal(2 rows over the clock)
        """
        name, _ = name_and_ending(path)
        table = Records(read_bytes(path, name), name)
        lines = [(k, [c.strip() for c in row]) for k, row in table if any(row)]
        first = lines[0][1] if lines else []
        time, clock, mode, level = (
            find(first, names, name) for names in (("t", "time"), ("clock", "s"), ("mode",), ("level",))
        )
        instant = clock if time is None else time
        if instant is None or mode is None or (time is not None and clock is not None):
            raise FormatError(f"{name}: the header of a signal names t (or clock) and mode, and perhaps level")
        rows: list[tuple[Any, ...]] = []
        body = [[*cells, *[""] * len(first)] for _, cells in lines[1:]]
        numbers = [["" if k is None else cells[k] for cells in body] for k in (instant, level)]
        told = zip(lines[1:], body, *(pointed(texts, table.commas) for texts in numbers), strict=True)
        for (number, _), cells, at, share in told:
            try:
                where = float(parse_exact(at))
                own = (float(parse_exact(share)),) if share else ()
            except (NumberError, OverflowError) as error:
                raise FormatError(f"{name}, line {number}: {error}; give a number") from None
            rows.append((where, cells[mode], *own))
        try:
            return cls(rows, clock=time is None)
        except ParameterError as error:
            raise FormatError(f"{name}: {error}") from None

    def play(self, members: Members, gain: Gain, state: State) -> Iterator[Stretch]:
        """Yield the rows before ``T``."""
        places = np.array([row[0] for row in self.rows])
        if not self.clock:
            places = np.asarray(gain.clock(places))
        begun = int(np.isfinite(places).sum())
        for (_, mode, level), until in zip(self.rows[:begun], [*places[1:begun], math.inf], strict=True):
            yield Stretch(members.choice(mode, level), float(until))

    def past(self, members: Members, T: float) -> list[tuple[float, Choice]]:
        """Return the rows from ``T`` on."""
        late = [] if self.clock else [row for row in self.rows if row[0] >= T]
        return [(t, members.choice(mode, level)) for t, mode, level in late]


class ConstantSignal(TableSignal):
    """One member for ever.

    Parameters
    ----------
    mode : int or str
        Its number from 0, or its name.
    level : float or sequence of float
        Where the uncertain weights lie: 0 is ``w-``, 1 is ``w+``.
    """

    def __init__(self, mode: int | str = 0, level: float | Sequence[float] = MIDDLE):
        super().__init__([(0, mode, level)], clock=True)
        self.text = f"constant, mode {mode if isinstance(mode, str) else mode + 1}"


class PeriodicSignal(Signal):
    """Members in turn, each for its stretch of the clock.

    Parameters
    ----------
    word : sequence of (mode, duration) or (mode, duration, level)

    Raises
    ------
    ParameterError
        There is none, or a duration is not positive.

    Examples
    --------
    >>> PeriodicSignal([("day", 0.5), ("night", 1)])
    PeriodicSignal(2 modes in turn, period 1.5 of the clock)
    """

    def __init__(self, word: Sequence[Sequence[Any]]):
        if not word or any(not 2 <= len(letter) <= 3 for letter in word):
            raise ParameterError("the word of a signal is a list of (mode, duration) or (mode, duration, level)")
        self.word = [
            (letter[0], number_within(letter[1], "duration", _SHORTEST, _LONGEST), [*letter, MIDDLE][2])
            for letter in word
        ]
        period = sum(duration for _, duration, _ in self.word)
        self.text = f"{counted(len(word), 'mode')} in turn, period {period:.4g} of the clock"

    def play(self, members: Members, gain: Gain, state: State) -> Iterator[Stretch]:
        """Yield the word again and again."""
        choices = [(members.choice(mode, level), duration) for mode, duration, level in self.word]
        clock = 0.0
        while True:
            for choice, duration in choices:
                clock += duration
                yield Stretch(choice, clock)


class RandomSignal(Signal):
    """Random modes with random weights; how long each acts is exponentially distributed on the clock.

    Parameters
    ----------
    seed : int
    dwell : float, optional
        Its mean, on the clock; by default the time in which agents move, 1 over the median in-weight, and once they
        rest in all members as long again as the run so far.
    weights : {"both", "ends", "between"}
        Uncertain weights at ``w-`` or ``w+``, or uniform between, or either way from stretch to stretch.

    Examples
    --------
    >>> RandomSignal(3)
    RandomSignal(random, seed 3)
    """

    def __init__(self, seed: int = 0, dwell: float | None = None, weights: str = "both"):
        if weights not in WEIGHTS:
            raise ParameterError("weights", f"= {shorten(repr(weights))} is unknown; one of {', '.join(WEIGHTS)}")
        self.seed, self.weights = whole_number(seed, "seed", 0, 2**63 - 1), weights
        self.dwell = None if dwell is None else number_within(dwell, "dwell", _SHORTEST, _LONGEST)
        self.text = f"random, seed {self.seed}" + (f", dwell {self.dwell:.4g}" if self.dwell else "")

    def play(self, members: Members, gain: Gain, state: State) -> Iterator[Stretch]:
        """Yield them."""
        rng, clock = np.random.default_rng(self.seed), 0.0
        rest = _largest_at_rest(state())
        while True:
            mode = int(rng.integers(len(members.arrays)))
            levels = rng.random(members.arrays[mode].q)
            if self.weights == "ends" or (self.weights == "both" and rng.random() < 0.5):
                levels = levels.round()
            moves = self.dwell is not None or members.imbalance(state()) > rest
            clock = clock * (1 if moves else 2) + rng.exponential(self.dwell or members.unit)
            yield Stretch(members.choice(mode, levels), clock)


class RandomDwellSignal(Signal):
    """Random modes that keep a dwell time: each acts for it and an exponentially distributed time more.

    Weights change at random meanwhile, as under :class:`RandomSignal`.

    Parameters
    ----------
    promise : DwellTime
        Of time or of the clock.
    seed : int

    Examples
    --------
    >>> RandomDwellSignal(DwellTime("0.3", clock="t"), 2)
    RandomDwellSignal(random, seed 2, at least 0.3 of time between switches)
    """

    def __init__(self, promise: DwellTime, seed: int = 0):
        self.promise, self.seed = promise, whole_number(seed, "seed", 0, 2**63 - 1)
        of = "time" if promise.clock == "t" else "the clock"
        self.text = f"random, seed {self.seed}, at least {float(promise.least):.4g} of {of} between switches"

    def play(self, members: Members, gain: Gain, state: State) -> Iterator[Stretch]:
        """Yield them."""
        rng = np.random.default_rng(self.seed)
        clock, until, instant = 0.0, 0.0, 0.0
        least = float(self.promise.least) * (1 + 1e-9)
        T = float(gain.T)
        on_clock = self.promise.clock == "s"
        at_rest, mode = _largest_at_rest(state()), 0
        while True:
            doubled = 1 if members.imbalance(state()) > at_rest else 2
            if clock >= until:
                mode = int(rng.integers(len(members.arrays)))
                hold = least + rng.exponential(max(least, members.unit if on_clock else T / 10))
                instant += hold
                until = doubled * clock + hold if on_clock else float(gain.clock(instant)) if instant < T else math.inf
            levels = rng.random(members.arrays[mode].q)
            step = rng.exponential(members.unit) if levels.size else math.inf
            clock = min(until, doubled * clock + step)
            yield Stretch(members.choice(mode, levels), clock)


class WorstCaseSignal(Signal):
    """At every step of the clock the member by which a function falls least: a greedy search for the slowest decay.

    Parameters
    ----------
    form : (N, N) array, optional
        ``X' form X`` is the function: see :meth:`against`. Without one, ``max_k |x_k|``; in components that come to
        consensus ``max g_k x_k - min g_k x_k``.
    step : float, optional
        On the clock; by default a tenth of the time in which agents move.

    Examples
    --------
    >>> WorstCaseSignal()
    WorstCaseSignal(worst case)
    """

    def __init__(self, form: np.ndarray | None = None, step: float | None = None):
        self.form = None if form is None else np.asarray(form, dtype=float)
        self.step = None if step is None else number_within(step, "step", _SHORTEST, _LONGEST)
        self.text = "worst case" + (" for a Lyapunov function" if form is not None else "")

    @classmethod
    def against(cls, function: CommonForm, nodes: np.ndarray, n: int, step: float | None = None) -> WorstCaseSignal:
        """Return the search against a Lyapunov function of a component.

        Parameters
        ----------
        function : CommonForm
            Of the component.
        nodes : (m,) int array
            The nodes of the component, among ``n``.
        n : int
        step : float, optional
        """
        quotient = function.quotient
        C = np.zeros((len(quotient.nodes), n))
        for row, v in enumerate(quotient.nodes):
            C[row, nodes[v]] = 1
            for b, pivot in zip(quotient.basis[v], quotient.pivots, strict=True):
                C[row, nodes[pivot]] -= float(b)
        P = np.array([[float(x) for x in row] for row in function.matrix]).reshape(len(C), len(C))
        return cls(C.T @ P @ C, step)

    def play(self, members: Members, gain: Gain, state: State) -> Iterator[Stretch]:
        """Yield the member that is worst at the present state, step by step."""
        n, form = members.family.n_nodes, self.form
        if form is not None and form.shape != (n, n):
            raise ParameterError(f"the form of the worst case is {form.shape}, and the family has {n} nodes")
        step, clock = self.step or members.unit / _STEPS, 0.0
        groups = None if form is not None else _groups(members)
        rest = _largest_at_rest(state())
        while True:
            x = state()
            gradient = form @ x if form is not None else _slope_of_largest(x, groups or [])
            clock = clock + step if members.imbalance(x) > rest else 2 * clock + step
            yield Stretch(members.worst(x, gradient), clock)


def _largest_at_rest(x0: np.ndarray) -> float:
    """Return up to which imbalance agents rest, from their initial state."""
    return _AT_REST * float(np.abs(x0).max())


def _groups(members: Members) -> list[tuple[np.ndarray, np.ndarray | None]]:
    """Return the nodes of each component, and its camps if it comes to consensus."""
    return [
        (
            part.nodes,
            part.gauge.astype(float) if part.behaviour == BIPARTITE_CONSENSUS and part.gauge is not None else None,
        )
        for part in decide(members.family)
    ]


def _slope_of_largest(x: np.ndarray, groups: list[tuple[np.ndarray, np.ndarray | None]]) -> np.ndarray:
    """Return the gradient of a smooth function near to the largest entry of every component, or their spread."""
    gradient = np.zeros(len(x))
    for nodes, camps in groups:
        y = x[nodes] if camps is None else camps * x[nodes]
        if camps is not None:
            y = y - (y.max() + y.min()) / 2
        slope = (y / (np.abs(y).max() or 1.0)) ** _POWER
        gradient[nodes] = slope if camps is None else camps * slope
    return gradient


def as_signal(signal: Any, seed: int = 0) -> Signal:
    r"""Return a signal, or read it.

    Parameters
    ----------
    signal : Signal, str, path, file object or sequence of rows
        ``"random"``, ``"worst-case"``, ``"constant"`` (the first mode, its weights in the middle), a table as
        :meth:`TableSignal.read` reads it, or its rows over time.
    seed : int
        Of the random one.

    Raises
    ------
    ParameterError
        It is none of these.

    Examples
    --------
    >>> as_signal("random", 7), as_signal([(0, "day"), (0.5, "night")])
    (RandomSignal(random, seed 7), TableSignal(2 rows over time))
    """
    if isinstance(signal, Signal):
        return signal
    if signal == "random":
        return RandomSignal(seed)
    if signal == "worst-case":
        return WorstCaseSignal()
    if signal == "constant":
        return ConstantSignal()
    if isinstance(signal, list | tuple):
        return TableSignal(signal)
    try:
        return TableSignal.read(signal)
    except FormatError as error:
        if isinstance(signal, str):
            raise ParameterError("signal", f"{error}; or one of {', '.join(WORDS)}") from None
        raise


#: Choices of a signal before a run is given up, and those after which it does not go on to see where it settles.
MOST_STRETCHES, MOST_SETTLING = 100_000, 2_000
# The state at T is given up beyond this s max(D): the roundings of float64 weights act there like slow modes.
_MAX_CLOCK = 1e13


class Leg(NamedTuple):
    """A part of a run on a clock of its own: its phase, the stretched clock there, and where that has a value."""

    phase: Phase
    clock: Callable[[float], float]
    place: Callable[[float], float]


#: The part of a run that is on the stretched clock itself.
CLOCK_LEG = Leg(ON_CLOCK, float, float)


class Course:
    """A motion led by a signal.

    Parameters
    ----------
    motion : Motion
    play : callable
        As :meth:`Signal.play <ptcc_certify.simulation.switching_signals.Signal.play>`, of the present state alone.

    Attributes
    ----------
    clock : float
        How far the run is.
    choices : list of Choice
        The members that have acted, in their order.
    switches : list of float
        The clock from which on each acted; infinite from ``T`` on.
    acting : list of int
        Which acted at the instants that were sampled.
    """

    def __init__(self, motion: Motion, play: Callable[[State], Iterator[Stretch]]):
        self.motion = motion
        self.clock, self.until, self.stretches = 0.0, 0.0, 0
        self.choices: list[Choice] = []
        self.switches: list[float] = []
        self.acting: list[int] = []
        self._play = play(lambda: self.motion.agents() * np.ravel(self.motion.unit)[0])
        self._begin()

    def _begin(self) -> None:
        choice, self.until = next(self._play)
        self.stretches += 1
        if self.stretches > MOST_STRETCHES:
            raise SimulationError(f"the signal chooses more than {MOST_STRETCHES:,} times; let each member act longer")
        if not self.choices or choice != self.choices[-1]:
            self.switch(choice, self.clock)

    def switch(self, choice: Choice, clock: float) -> None:
        """Let a member act from now on."""
        self.choices.append(choice)
        self.switches.append(clock)
        self.motion.choose(choice)

    def lead(self, motion: Motion) -> None:
        """Lead another motion from now on."""
        self.motion = motion
        motion.choose(self.choices[-1])

    def stay(self, instants: int, clock: float) -> None:
        """Note that the present member has acted at so many instants, up to a value of the clock."""
        self.acting += [len(self.choices) - 1] * instants
        self.clock = clock

    def sample(self, z: np.ndarray, end: float, leg: Leg = CLOCK_LEG, events: Iterable[float] = ()) -> np.ndarray:
        """Move on to the end of a leg; return the (len(z), N, S) states at increasing instants of it."""
        states = np.empty((z.size, *self.motion.state.shape))
        now, before = leg.place(self.clock), 0
        while True:
            stop = min(end, max(now, leg.place(self.until)))
            after = z.size if stop >= end else int(np.searchsorted(z, stop, side="right"))
            states[before:after] = self.motion.sample(leg.phase, z[before:after], stop, now, events)
            self.stay(after - before, leg.clock(end) if stop >= end else self.until)
            if stop >= end:
                return states
            now, before = stop, after
            self._begin()

    def settle(self, goal: float) -> float:
        """Go on to ``T``, doubling the clock, until the residual is small; return it.

        The residual must be small both locally (no agent is away from what it listens to) and over time (groups that
        hardly listen to each other drift slowly).
        """
        self.motion.refine()
        largest, residual = float(self.motion.in_weight.max(initial=0.0)) or 1.0, math.inf
        while True:
            before = self.motion.state
            try:
                self.sample(np.empty(0), max(2 * self.clock, 20 / largest))
            except SimulationError:
                if math.isinf(residual) and math.isinf(self.until):
                    raise
                return residual
            residual = max(float(np.abs(self.motion.state - before).max()), self.imbalance())
            if residual <= goal or self.clock * largest > _MAX_CLOCK or self.stretches >= MOST_SETTLING:
                return residual

    def imbalance(self) -> float:
        """Bound ``max_k |e_k| / (2 D_k)`` over all members, or of the one that stays for ever."""
        alone = math.isinf(self.until)
        state = self.motion.state if alone else self.motion.state[:, 0]
        return self.motion.members.imbalance(state, self.choices[-1] if alone else None)

    def past(self, t: np.ndarray, T: float, rho1: float, changes: Iterable[tuple[float, Choice]]) -> np.ndarray:
        """Move on from ``T``, where members change at instants; return the (M, N, S) states at instants from ``T``."""
        states = [np.empty((0, *self.motion.state.shape))]
        begins = [(T, None), *((max(instant, T), choice) for instant, choice in changes)]
        for (begin, choice), (end, _) in zip(begins, [*begins[1:], (math.inf, None)], strict=True):
            if choice is not None:
                self.switch(choice, math.inf)
            here = t[(t <= end) & ((t > begin) if choice is not None else True)]
            stop = rho1 * (min(end, float(t[-1])) - begin)
            states.append(self.motion.sample(ON_CLOCK, rho1 * (here - begin), max(stop, 0.0)))
            self.stay(here.size, math.inf)
        return np.concatenate(states)
