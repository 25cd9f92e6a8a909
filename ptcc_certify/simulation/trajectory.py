"""Sampled trajectories of the closed loops: states, clock, input, and how settled they are at the deadline."""

from __future__ import annotations

import csv
import io
import time
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.errors import ParameterError, gated
from ptcc_certify.graphs.labels import import_pandas, position
from ptcc_certify.graphs.packed_weights import ByValue
from ptcc_certify.graphs.rationals import number_within, shorten
from ptcc_certify.lazy_report import Shown, rendered
from ptcc_certify.model.asks import GainLimits
from ptcc_certify.simulation.member_laplacians import Choice, Members
from ptcc_certify.simulation.nominal import Instants

if TYPE_CHECKING:
    import pandas as pd

    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.graphs.family import Family
    from ptcc_certify.model import Protocol, ReachingProtocol
    from ptcc_certify.model.late_messages import LateMessages, MovingLeaders
    from ptcc_certify.model.limited_gain import LimitedGain
    from ptcc_certify.model.virtual_positions import TrackingProtocol
    from ptcc_certify.simulation.cvodes import Tolerances

#: A state at the deadline is settled when its residual is below this multiple of the tolerances.
RESOLVED = 100
#: ``1 - t/T`` just before ``T``.
JUST_BEFORE = 1e-10


class ByAgent:
    """A run, of which the rows of ``states`` are the agents of a graph: a mapping of their labels."""

    graph: SignedDigraph
    states: np.ndarray

    @property
    def labels(self) -> tuple[str, ...]:
        """The N agents, in the order of the rows of ``states``."""
        return self.graph.labels

    def __getitem__(self, label: Hashable) -> np.ndarray:
        """Return the states of one agent, the instants last."""
        return self.states[position(label, self.labels)]

    def __len__(self) -> int:
        return len(self.labels)

    def __iter__(self) -> Iterator[str]:
        return iter(self.labels)

    def __contains__(self, label: object) -> bool:
        return str(label) in self.labels


def csv_text(heads: Sequence[str], table: np.ndarray) -> str:
    """Return a table with one column for each row of an array as text, floats in full."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(heads)
    writer.writerows(table.T.tolist())
    return text.getvalue()


@dataclass(frozen=True, eq=False, repr=False)
class Sliding(ByValue):
    """The sliding variables of a run under the sliding-mode protocol, of the Filippov solution or its imitation.

    Attributes
    ----------
    protocol : ReachingProtocol
    sigma : (N, M) array
        The sliding variables; exactly 0 from each reaching time on.
    disturbance : (N, M) array
        ``d_k`` at the instants.
    sigma0 : (N,) array
        ``sigma(0)``.
    reaching_remaining : (M,) array
        ``max(0, 1 - t/T_r)``, accurate where ``t`` itself no longer tells it from 0.
    reaching_z : (N,) array
        ``ln(T_r/(T_r - t))`` where each sliding variable reaches 0; 0 for one that starts there, infinite for one that
        is 0 at ``T_r`` only.
    source : str
        The disturbance in words.
    bounded_by : str
        How ``|d_k| <= delta`` was established.
    boundary_layer : float or None
        Width ``w`` of the imitation ``tanh(sigma/w)`` of the sign; None for the true solution.
    reads_states : bool
        Whether the disturbance depends on the states: then reaching times are as accurate as the integrator, otherwise
        roots of scalar equations to near machine precision.

    References
    ----------
    The network (2) under the protocol (47)-(48) of [Zhu]_.
    Filippov, Differential Equations with Discontinuous Righthand Sides, Kluwer 1988.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
    >>> run = simulate(foes, robust, [3, 1], sigma0=[1, 0], disturbance="sin(9*t)", times=[0, 1, 2])
    >>> run.sliding.sigma  # exactly 0 from the reaching time on
    array([[1., 0., 0.],
           [0., 0., 0.]])
    >>> bool(0 < run.sliding.reaching_times[0] < 1), float(run.sliding.reaching_times[1])
    (True, 0.0)
    """

    protocol: ReachingProtocol
    sigma: np.ndarray
    disturbance: np.ndarray
    sigma0: np.ndarray
    reaching_remaining: np.ndarray
    reaching_z: np.ndarray
    source: str
    bounded_by: str
    boundary_layer: float | None
    reads_states: bool

    def __post_init__(self) -> None:
        self.lock()

    @property
    def reaching_times(self) -> np.ndarray:
        """(N,) array: the instants at which the sliding variables reach 0, at most ``T_r``."""
        return -float(self.protocol.T_r) * np.expm1(-self.reaching_z)

    @property
    def reaching_left(self) -> np.ndarray:
        """(N,) array: ``T_r`` minus the reaching times, accurate however small."""
        return float(self.protocol.T_r) * np.exp(-self.reaching_z)

    def switching_input(self, nominal: np.ndarray) -> np.ndarray:
        """Return the input (48) to the letter, with ``sign(0) = 0``; sliding, it jumps by up to ``mu1``.

        Parameters
        ----------
        nominal : (N, M) array
            The nominal part of the input.

        Returns
        -------
        (N, M) array
        """
        return self._with_reaching_terms(nominal, np.sign(self.sigma))

    def input(self, nominal: np.ndarray) -> np.ndarray:
        """Return the input as the Filippov solution has it.

        The input (48) before a sliding variable is 0; from then on the *equivalent control* ``u^nom - d``, the mean of
        what the switching does, which keeps it there.

        Parameters
        ----------
        nominal : (N, M) array
            The nominal part of the input.

        Returns
        -------
        (N, M) array
        """
        if self.boundary_layer is not None:
            return self._with_reaching_terms(nominal, np.tanh(self.sigma / self.boundary_layer))
        return np.where(self.sigma != 0, self.switching_input(nominal), nominal - self.disturbance)

    def _with_reaching_terms(self, nominal: np.ndarray, sign: np.ndarray) -> np.ndarray:
        gain = self.protocol.reaching_gain.value_at_remaining(self.reaching_remaining)
        return nominal - float(self.protocol.mu1) * sign - gain * self.sigma


@dataclass(frozen=True, eq=False, repr=False)
class Played(ByValue):
    """The members of a family that acted over a run.

    Attributes
    ----------
    family : Family
    signal : str
        The signal in words.
    choices : tuple of Choice
        The members in the order in which they acted.
    switches : (P,) array
        The value of the clock from which on each acted; infinite from ``T`` on.
    acting : (M,) int array
        Which of them acted at the instants, or last before them.

    References
    ----------
    docs/theory/families.md, "What may change".
    """

    family: Family
    signal: str
    choices: tuple[Choice, ...]
    switches: np.ndarray
    acting: np.ndarray

    def __post_init__(self) -> None:
        self.lock()

    @property
    def modes(self) -> np.ndarray:
        """(M,) int array: the mode that acts at every instant, from 0."""
        return np.array([choice.mode for choice in self.choices])[self.acting]

    def error(self, states: np.ndarray) -> np.ndarray:
        """Return ``E = -L X`` of (N, M) states, with the member that acts."""
        members, result = Members(self.family), np.empty_like(states)
        for k in np.unique(self.acting).tolist():
            at = self.acting == k
            result[:, at] = -(members.laplacian(self.choices[k]) @ states[:, at])
        return result

    def clock_of_modes(self, clock: np.ndarray) -> np.ndarray:
        """Return how much of the clock has been spent in every mode until its (M,) values, (modes, M).

        It is infinite from ``T`` on in the last.
        """
        ends = np.append(self.switches[1:], np.inf)
        spent = np.zeros((len(self.family.modes), clock.size))
        for choice, begin, end in zip(self.choices, self.switches.tolist(), ends.tolist(), strict=True):
            if np.isfinite(begin):
                spent[choice.mode] += np.clip(clock, begin, end) - begin
        return spent


@dataclass(frozen=True, eq=False)
class Conditions(ByValue):
    """What a run meets besides its graph, protocol and sliding variables.

    Attributes
    ----------
    actuator : GainLimits or None
        What limits the nominal protocol's gain.
    forcing : str or None
        Disturbance and measurement noise of the nominal protocol in words.
    messages : LateMessages or None
        How late messages are.
    leaders : MovingLeaders or None
        How leaders move.
    places : (N,) array or None
        Those of a formation; then the ``states`` of a run are less these, and tables and figures tell its positions.
    tracking : TrackingProtocol or None
        By which the agents are vehicles that track those of another run.
    """

    actuator: GainLimits | None = None
    forcing: str | None = None
    messages: LateMessages | None = None
    leaders: MovingLeaders | None = None
    places: np.ndarray | None = None
    tracking: TrackingProtocol | None = None

    def __post_init__(self) -> None:
        self.lock()


@dataclass(frozen=True)
class Setup:
    """Who runs under what, at which instants: the gain that acts there, its clock, and what comes of it.

    Attributes
    ----------
    graph : SignedDigraph
    protocol : Protocol
    instants : Instants
    conditions : Conditions
    begin : float
        When the run was begun, for its ``seconds``.
    """

    graph: SignedDigraph
    protocol: Protocol
    instants: Instants
    conditions: Conditions = Conditions()
    begin: float = field(default_factory=time.perf_counter)

    @cached_property
    def gain(self) -> LimitedGain:
        """The gain that acts."""
        return (self.conditions.actuator or GainLimits()).limit(self.protocol.gain)

    @cached_property
    def gains(self) -> np.ndarray:
        """(M,) array: the gain that acts at the instants."""
        return self.gain.value(self.instants.t, self.instants.remaining)

    @cached_property
    def clock(self) -> np.ndarray:
        """(M,) array: the stretched clock at the instants."""
        return self.gain.clock(self.instants.t, self.instants.remaining)

    def gains_before(self) -> np.ndarray:
        """Return the gain that acts at the instants, at ``T`` that just before it, infinite if it has its pole."""
        gains, T = self.gains.copy(), float(self.protocol.T)
        gains[self.instants.t == T] = self.gain.value(T, JUST_BEFORE) if self.gain.bounded else np.inf
        return gains

    def trajectory(
        self,
        states: np.ndarray,
        tolerances: Tolerances,
        deadline_residual: float | None,
        stats: Mapping[str, float],
        **more: Any,
    ) -> Trajectory:
        """Return what was run, with whatever else a :class:`Trajectory` keeps."""
        return Trajectory(
            graph=self.graph,
            protocol=self.protocol,
            t=self.instants.t,
            remaining=self.instants.remaining,
            clock=self.clock,
            states=states,
            tolerances=tolerances,
            deadline_residual=deadline_residual,
            stats={**stats, "seconds": time.perf_counter() - self.begin},
            conditions=self.conditions,
            **more,
        )

    def stepped(self, states: np.ndarray, tolerances: Tolerances, **more: Any) -> Trajectory:
        """Return what was run in steps of closed form, from (N, M) states."""
        size, end = max(float(np.abs(states[:, 0]).max()), 1e-300), int(np.argmax(self.instants.remaining == 0))
        residual = Members(self.graph).imbalance(states[:, end], Choice(0)) / size
        count = self.instants.t.size - 1
        return self.trajectory(states, tolerances, residual, {"steps": count, "rhs": count}, **more)


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(ByAgent, ByValue, Shown):
    """The states of N agents at M instants.

    Attributes
    ----------
    graph : SignedDigraph
    protocol : Protocol
    t : (M,) array
        Instants, in units of time.
    remaining : (M,) array
        ``max(0, 1 - t/T)``, accurate where ``t`` itself no longer tells it from 0.
    clock : (M,) array
        ``s``; infinite from ``T`` on unless ``rho2 = 0``. Behind an actuator the integral of the gain that acts.
    states : (N, M) or (N, S, M) array
        ``X``, or S columns of states; in a formation less the places of its agents, see :attr:`positions`.
    tolerances : Tolerances
        Those of the integrator; ``atol`` is relative to the largest entry of each initial state.
    deadline_residual : float or None
        How far from settled the state at ``T`` is: the larger of ``max_k |e_k|/(2 D_k)`` and of the change over the
        last doubling of the clock, relative to the largest entry of the initial state. None if ``T`` was not reached.
        If the gain is bounded, the former alone, at the first instant from ``T`` on.
    stats : mapping
        ``steps``, ``rhs`` (evaluations of the right-hand side, and of its derivatives in GMRES), ``seconds``.
    sliding : Sliding or None
        The sliding variables, if there are any.
    played : Played or None
        Which members of a family acted; None of one graph.
    conditions : Conditions
        What else the run met.
    held_input : (N, M) or (N, S, M) array or None
        The input where it is not that of the states: under zero-order hold, of late messages, of leaders that move.
    targets : (N, M) array or None
        Where leaders move, ``-L_F^-1 L_FL X_L`` of followers, of leaders their states.

    References
    ----------
    The network (3) under the protocol (4) of [Zhu]_.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> run = simulate(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 1], times=[0, 0.5, 1, 2])
    >>> run.states.shape, run.deadline_index, run.deadline_resolved
    ((2, 4), 2, True)
    >>> run.final_state.round(9), run.input[:, 0]
    (array([ 1., -1.]), array([-8., -8.]))
    """

    graph: SignedDigraph
    protocol: Protocol
    t: np.ndarray
    remaining: np.ndarray
    clock: np.ndarray
    states: np.ndarray
    tolerances: Tolerances
    deadline_residual: float | None
    stats: Mapping[str, float] = field(compare=False)
    sliding: Sliding | None = field(default=None, kw_only=True)
    played: Played | None = field(default=None, kw_only=True)
    conditions: Conditions = field(default=Conditions(), kw_only=True)
    held_input: np.ndarray | None = field(default=None, kw_only=True)
    targets: np.ndarray | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        self.lock()

    @property
    def rtol(self) -> float:
        """The relative tolerance of the integrator."""
        return self.tolerances.rtol

    @property
    def vehicles(self) -> bool:
        """Whether these are vehicles that track the agents of another run."""
        return self.conditions.tracking is not None

    @property
    def signal(self) -> str:
        """The signal in words."""
        return "constant" if self.played is None else self.played.signal

    @property
    def deadline_index(self) -> int | None:
        """Which instant is ``T``; None if none is, or if there is no deadline."""
        at = np.flatnonzero((self.remaining == 0) & (self.t == float(self.protocol.T)) & self.protocol.prescribed)
        return int(at[0]) if at.size else None

    @property
    def positions(self) -> np.ndarray:
        """Where agents are: in a formation ``states`` and their places."""
        return self._in_places(self.states)

    def in_places(self, places: np.ndarray) -> Trajectory:
        """Return the run of a formation, whose agents have places.

        Parameters
        ----------
        places : (N,) array
            In units of the states.

        Returns
        -------
        Trajectory
        """
        return replace(self, conditions=replace(self.conditions, places=places))

    def _in_places(self, values: np.ndarray) -> np.ndarray:
        """Return values of the N agents with their places in the formation, if they are in one."""
        places = self.conditions.places
        return values if places is None else values + places[..., None]

    @property
    def deadline_resolved(self) -> bool:
        """Whether the state at ``T`` has settled to within 100 tolerances; False if ``T`` was not reached.

        A float cannot see motion some 15 decades slower than the fastest: where links of very different weight almost
        balance, ask the exact final state.
        """
        settled = RESOLVED * max(self.tolerances)
        return self.deadline_residual is not None and self.deadline_residual <= settled

    @property
    def final_state(self) -> np.ndarray:
        """(N,) or (N, S) array: the state at the deadline ``T``; in a formation less places, as ``states`` is.

        Raises
        ------
        ParameterError
            ``T`` is not among the instants, or there is no deadline.
        """
        if self.deadline_index is None:
            why = "T is not among the instants" if self.protocol.prescribed else "with rho2 = 0 there is no deadline"
            raise ParameterError(f"there is no state at the deadline: {why}")
        return self.states[..., self.deadline_index]

    @cached_property
    def error(self) -> np.ndarray:
        """``E = -L X`` with the member that acts, of the shape of ``states``."""
        if self.played is not None:
            return self.played.error(self.states)
        flat = self.states.reshape(len(self.labels), -1)
        return -(self.graph.laplacian() @ flat).reshape(self.states.shape)

    @property
    def input(self) -> np.ndarray:
        """``u = gain E``, of the shape of ``states``; the gain is ``rho1`` from ``T`` on.

        Behind an actuator with the gain that acts, or its zero-order hold. Measurement noise is left out. With sliding
        variables as :meth:`Sliding.input` tells.
        """
        return self._nominal_input if self.sliding is None else self.sliding.input(self._nominal_input)

    @property
    def switching_input(self) -> np.ndarray:
        """(N, M) array: ``u`` of (48) to the letter; without sliding variables :attr:`input`."""
        return self.input if self.sliding is None else self.sliding.switching_input(self._nominal_input)

    @property
    def _nominal_input(self) -> np.ndarray:
        actuator = self.conditions.actuator
        if self.held_input is not None:
            return self.held_input
        if actuator is not None:
            return actuator.limit(self.protocol.gain).value(self.t, self.remaining) * self.error
        return self.protocol.gain.value_at_remaining(self.remaining) * self.error

    def at(self, fraction: float) -> np.ndarray:
        """Return the state at the sampled instant ``t = fraction T``.

        Parameters
        ----------
        fraction : float
            ``t/T`` of one of the instants.

        Returns
        -------
        (N,) or (N, S) array

        Raises
        ------
        ParameterError
            No instant of the trajectory is there: give it to :func:`simulate` as one of ``times``.
        """
        fraction = number_within(fraction, "fraction", 0, 1e300)
        if fraction == 1 and self.deadline_index is not None:
            return self.final_state
        wanted = fraction * float(self.protocol.T)
        near = np.flatnonzero(np.isclose(self.t, wanted, rtol=1e-14, atol=0))
        if not near.size:
            raise ParameterError(f"no instant of the trajectory is {fraction} T; simulate with times=[{wanted}]")
        return self.states[..., near[0]]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self.states, dtype=dtype)

    def plot(self, what: str = "states", **keywords: Any) -> Any:
        """Draw the run: its ``"states"``, ``"input"`` or ``"graph"``.

        Parameters
        ----------
        what : str
        **keywords : Any
            ``ax`` and others of :func:`ptcc_certify.plot_trajectory`, ``plot_input``, ``plot_graph``.

        Returns
        -------
        matplotlib.axes.Axes
        """
        return rendered("page_figures.plot", self, what, **keywords)

    def to_pandas(self, what: str = "states") -> pd.DataFrame:
        """Return the states as a DataFrame: one row per instant, indexed by ``t``, one column per agent.

        Of S components or initial states the columns are pairs ``(label, 1 .. S)``.

        Parameters
        ----------
        what : {"states", "input", "error", "sigma", "disturbance"}
            The last two under the sliding-mode protocol only.

        Raises
        ------
        ParameterError
            The run has nothing that is called so, or pandas is not installed.

        Examples
        --------
        >>> pair = SignedDigraph.from_edges([("a", "b", 1)])
        >>> run = simulate(pair, NominalProtocol(1, 1, 1, 1), [1, 0], times=[0])
        >>> run.to_pandas().loc[0.0].to_dict(), run.to_pandas("input").loc[0.0, "b"]
        ({'a': 1.0, 'b': 0.0}, np.float64(2.0))
        """
        slid = ["sigma", "disturbance"] if self.sliding is not None else []
        there = ["states", "input", "error", *slid]
        if what not in there:
            raise ParameterError("what", f"= {shorten(repr(what))} is unknown; one of {', '.join(there)}")
        pandas, columns = import_pandas(), list(self.labels)
        names: Any = pandas.Index(columns, name="node")
        if self.states.ndim == 3:
            numbers = range(1, self.states.shape[1] + 1)
            names = pandas.MultiIndex.from_product([columns, numbers], names=["node", "component"])
        values = self.positions if what == "states" else getattr(self.sliding if what in slid else self, what)
        return pandas.DataFrame(
            values.reshape(-1, self.t.size).T + 0.0,
            index=pandas.Index(self.t, name="t"),
            columns=names,
        )

    @gated
    def to_csv(self) -> str:
        r"""Return ``t,remaining,<label>,...,u(<label>),...`` as text, one row per instant, floats in full.

        The states, of S initial states headed ``<label>[1] .. <label>[S]``; the sliding variables, ``sigma(<label>)``;
        the :attr:`input`, ``u(..)`` around the name of each state.

        Examples
        --------
        >>> pair = SignedDigraph.from_edges([("a", "b", 1)])
        >>> simulate(pair, NominalProtocol(1, 1, 1, 1), [1, 0], times=[0]).to_csv()
        't,remaining,a,b,u(a),u(b)\n0.0,1.0,1.0,0.0,0.0,2.0\n'
        """
        names = list(self.labels)
        if self.states.ndim == 3:
            names = [f"{label}[{column}]" for label in names for column in range(1, self.states.shape[1] + 1)]
        more = self._more_columns()
        heads = ["t", "remaining", *names, *(name for name, _ in more), *(f"u({name})" for name in names)]
        states, inputs = (values.reshape(len(names), -1) for values in (self.positions, self.input + 0.0))
        table = np.vstack([self.t, self.remaining, states, *(values for _, values in more), inputs])
        return csv_text(heads, table)

    def _more_columns(self) -> list[tuple[str, np.ndarray]]:
        """Return the mode that acts, sliding variables and targets, as far as there are any."""
        mode = [] if self.played is None else [("mode", self.played.modes + 1)]
        sigma = [] if self.sliding is None else [*zip(self.labels, self.sliding.sigma, strict=True)]
        targets = [] if self.targets is None else [*zip(self.labels, self._in_places(self.targets), strict=True)]
        rows = [("sigma", *one) for one in sigma] + [("target", *one) for one in targets]
        return mode + [(f"{name}({label})", row) for name, label, row in rows]

    def __repr__(self) -> str:
        runs = f" x {self.states.shape[1]} columns" if self.states.ndim == 3 else ""
        span = f"t = {self.t[0]:.6g} .. {self.t[-1]:.6g}" if self.t.size else "none"
        if self.deadline_residual is None:
            deadline = "deadline not reached" if self.protocol.prescribed else "no deadline"
        else:
            word = "settled" if self.deadline_resolved else "NOT settled"
            deadline = f"{word} at T = {float(self.protocol.T):.6g} (residual {self.deadline_residual:.1e})"
        signal = None if self.played is None else f"signal: {self.played.signal}"
        parts = (self.conditions.actuator, self.conditions.forcing, signal)
        more = "".join(f", {part}" for part in parts if part is not None)
        return f"Trajectory({len(self.labels)} agents{runs}, {self.t.size} instants, {span}, {deadline}{more})"
