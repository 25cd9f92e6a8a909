"""Trajectories of a coordination protocol, integrated by CasADi's CVODES.

Before the deadline the integrator runs in ``tau = -ln(1 - t/T)``, where the pole of the gain at ``T`` is gone:

    dX/dtau = -(rho1 T e^-tau + rho2 kappa) L X,      t = T (1 - e^-tau)

The state at ``T`` is the limit for ``tau`` to infinity, and from ``T`` on ``X' = -rho1 L X``. A simulation
corroborates a certificate; it proves nothing.
"""

from __future__ import annotations

import csv
import io
import math
import re
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.errors import NumberError, ParameterError, SimulationError
from ptcc_certify.rationals import as_fraction, shorten

if TYPE_CHECKING:
    from scipy import sparse

    from ptcc_certify.graph import Exact, SignedDigraph
    from ptcc_certify.protocols import NominalProtocol

# Beyond this many agents the Newton steps are solved by GMRES: a sparse factor of a random graph fills up
# (N = 1,000: 3.4 s against 0.05 s), whereas below it a factor copes with weights over many decades.
_DIRECT_UP_TO = 200
_MAX_STEPS = 5000
# The state at T is given up beyond this s max(D): the roundings of float64 weights act there like slow modes.
_MAX_CLOCK = 1e13
_MAX_TAU = 1e300
_RESOLVED = 100
_PAST_SAMPLES = 5
# Beyond this the steps' linear systems are singular in float64.
_MAX_STIFFNESS = 1e15
_TOO_LARGE = "the weights or gains are too large"
_CAUSES = {
    "CV_TOO_MUCH_WORK": f"more than {_MAX_STEPS} steps between two instants: {_TOO_LARGE}, or span too many decades",
    "CV_TOO_MUCH_ACC": "the tolerances are tighter than float64 can serve; raise rtol and atol",
    "CV_ERR_FAILURE": f"no step is small enough for the tolerances: {_TOO_LARGE}",
    "CV_CONV_FAILURE": f"a step's linear system could not be solved: {_TOO_LARGE}, or span too many decades",
}


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """The states of N agents at M instants.

    Attributes
    ----------
    graph : SignedDigraph
    protocol : NominalProtocol
    t : (M,) array
        Instants, in units of time.
    remaining : (M,) array
        ``max(0, 1 - t/T)``, accurate where ``t`` itself no longer tells it from 0.
    clock : (M,) array
        ``s``; infinite from ``T`` on unless ``rho2 = 0``.
    states : (N, M) or (N, S, M) array
        ``X``, or S columns of states.
    rtol, atol : float
        The integrator's tolerances; ``atol`` is relative to the largest entry of each starting column.
    deadline_index : int or None
        Which instant is ``T``; None if none is, or if there is no deadline.
    deadline_residual : float or None
        How far from settled the state at ``T`` is: the larger of ``max_k |e_k|/(2 D_k)`` and of the change over the
        last doubling of ``tau``, relative to the largest entry of the start. None if ``T`` was not reached.
    stats : mapping
        ``steps``, ``rhs`` (evaluations of the right-hand side), ``seconds``.
    """

    graph: SignedDigraph
    protocol: NominalProtocol
    t: np.ndarray
    remaining: np.ndarray
    clock: np.ndarray
    states: np.ndarray
    rtol: float
    atol: float
    deadline_index: int | None
    deadline_residual: float | None
    stats: Mapping[str, float]

    def __post_init__(self) -> None:
        for array in (self.t, self.remaining, self.clock, self.states):
            array.flags.writeable = False

    @property
    def labels(self) -> tuple[str, ...]:
        """The N agents, in the order of the rows of ``states``."""
        return self.graph.labels

    @property
    def deadline_resolved(self) -> bool:
        """Whether the state at ``T`` has settled to within 100 tolerances; False if ``T`` was not reached.

        A float cannot see motion some 15 decades slower than the fastest: where links of very different weight almost
        balance, ask the exact outcome.
        """
        settled = _RESOLVED * max(self.rtol, self.atol)
        return self.deadline_residual is not None and self.deadline_residual <= settled

    @property
    def final_state(self) -> np.ndarray:
        """(N,) or (N, S) array: the state at the deadline ``T``.

        Raises
        ------
        ParameterError
            ``T`` is not among the instants, or there is no deadline.
        """
        if self.deadline_index is None:
            why = "T is not among the instants" if self.protocol.prescribed else "with rho2 = 0 there is no deadline"
            raise ParameterError(f"there is no state at the deadline: {why}")
        return self.states[..., self.deadline_index]

    @property
    def error(self) -> np.ndarray:
        """``E = -L X``, of the shape of ``states``."""
        flat = self.states.reshape(len(self.labels), -1)
        return -(self.graph.laplacian() @ flat).reshape(self.states.shape)

    @property
    def input(self) -> np.ndarray:
        """``u = gain E``, of the shape of ``states``; the gain is ``rho1`` from ``T`` on."""
        return self.protocol.gain.value_at_remaining(self.remaining) * self.error

    def at(self, fraction: float) -> np.ndarray:
        """Return the state at the sampled instant ``t = fraction T``.

        Raises
        ------
        ParameterError
            No instant of the trajectory is there: give it to :func:`simulate` as one of ``times``.
        """
        if fraction == 1 and self.deadline_index is not None:
            return self.final_state
        wanted = fraction * float(self.protocol.T)
        near = np.flatnonzero(np.isclose(self.t, wanted, rtol=1e-14, atol=0))
        if not near.size:
            raise ParameterError(f"no instant of the trajectory is {fraction} T; simulate with times=[{wanted}]")
        return self.states[..., near[0]]

    def to_csv(self) -> str:
        r"""Return ``t,remaining,<label>,...`` as text, one row per instant, floats in full.

        Columns of a start with S columns are headed ``<label>[1] .. <label>[S]``.

        Examples
        --------
        >>> from ptcc_certify.graph import SignedDigraph
        >>> from ptcc_certify.protocols import NominalProtocol
        >>> pair = SignedDigraph.from_edges([("a", "b", 1)])
        >>> simulate(pair, NominalProtocol(1, 1, 1, 1), [1, 0], times=[0]).to_csv()
        't,remaining,a,b\n0.0,1.0,1.0,0.0\n'
        """
        names = list(self.labels)
        if self.states.ndim == 3:
            names = [f"{label}[{column}]" for label in names for column in range(1, self.states.shape[1] + 1)]
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["t", "remaining", *names])
        table = np.vstack([self.t, self.remaining, self.states.reshape(len(names), -1)])
        writer.writerows(table.T.tolist())
        return text.getvalue()

    def __repr__(self) -> str:
        runs = f" x {self.states.shape[1]} columns" if self.states.ndim == 3 else ""
        span = f"t = {self.t[0]:.6g} .. {self.t[-1]:.6g}" if self.t.size else "none"
        if self.deadline_residual is None:
            deadline = "deadline not reached" if self.protocol.prescribed else "no deadline"
        else:
            word = "settled" if self.deadline_resolved else "NOT settled"
            deadline = f"{word} at T = {float(self.protocol.T):.6g} (residual {self.deadline_residual:.1e})"
        return f"Trajectory({len(self.labels)} agents{runs}, {self.t.size} instants, {span}, {deadline})"


def simulate(
    graph: SignedDigraph,
    protocol: NominalProtocol,
    x0: Any,
    *,
    times: Iterable[Exact] | None = None,
    remaining: float = 1e-8,
    samples: int = 201,
    past: float = 0.25,
    rtol: float = 1e-11,
    atol: float = 1e-11,
) -> Trajectory:
    """Integrate ``X' = -gain(t) L X`` from ``X(0) = x0`` to the deadline and past it.

    Parameters
    ----------
    graph : SignedDigraph
        N agents.
    protocol : NominalProtocol
        With ``rho2 = 0`` the run is on the plain clock ``t``, without a deadline.
    x0 : (N,) or (N, S) array of numbers
        The start in the order of ``graph.labels``; S columns are S starts, or the S components of vector-valued
        agents: the protocol acts as ``L kron I_S``, so both evolve alike.
    times : increasing numbers >= 0, optional
        The instants wanted. One that a float cannot tell from ``T`` counts as ``T``.
    remaining, samples : float, int
        Without ``times``: ``samples`` instants uniform in ``tau`` from ``1 - t/T = 1`` to ``remaining`` and half as
        many uniform in t (with ``rho2 = 0``: ``samples`` uniform in t over [0, T]), and 0.5 T, 0.9 T, 0.99 T, T.
    past : float
        Without ``times``: go on to ``T (1 + past)``.
    rtol, atol : float
        Tolerances of CVODES; ``atol`` is relative to the largest entry of each column of ``x0``.

    Returns
    -------
    Trajectory

    Raises
    ------
    ParameterError
        ``x0`` has a wrong shape or an entry that is not finite, or an option is outside its domain.
    SimulationError
        The integrator failed; the message names the cause.

    Examples
    --------
    >>> from ptcc_certify.graph import SignedDigraph
    >>> from ptcc_certify.protocols import NominalProtocol
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> run = simulate(foes, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 1])
    >>> run.final_state.round(9)
    array([ 1., -1.])
    """
    started = time.perf_counter()
    start = _start(graph, x0)
    for name, tolerance in (("rtol", rtol), ("atol", atol)):
        if not 1e-15 <= tolerance <= 0.1:
            raise ParameterError(f"{name} = {tolerance} is outside its domain; {name} must be between 1e-15 and 0.1")
    t, left = _default_instants(protocol, remaining, samples, past) if times is None else _instants(protocol, times)
    scale = np.abs(start).max(axis=0)
    scale[scale == 0] = 1
    run = _Run(graph, start / scale, rtol, atol)
    gain, T = protocol.gain, float(protocol.T)
    residual = None
    if protocol.prescribed:
        before = left > 0
        # Whichever of 1 - t/T and t is the small one holds the digits.
        tau = np.where(left > 0.5, gain.tau(t), -np.log(np.where(before, left, 1)))[before]
        parts = [run.sample(float(gain.rho1) * T, float(gain.pole), 1.0, tau)]
        if not before.all():
            residual = run.settle(float(gain.rho1) * T, float(gain.pole), tau[-1] if tau.size else 0.0)
            parts.append(run.sample(0.0, float(gain.rho1) * T, 0.0, np.maximum(t[~before] / T - 1, 0)))
        clock = np.append(gain.clock_at_tau(tau), np.full(t.size - tau.size, np.inf))
        at_deadline = np.flatnonzero((left == 0) & (t == T))
    else:
        parts = [run.sample(0.0, float(gain.rho1) * T, 0.0, t / T)]
        clock = gain.clock(t)
        at_deadline = np.zeros(0, dtype=int)
    states = np.moveaxis(np.concatenate(parts), 0, -1) * scale[:, None]
    return Trajectory(
        graph=graph,
        protocol=protocol,
        t=t,
        remaining=left,
        clock=clock,
        states=states[:, 0] if np.ndim(x0) == 1 else states,
        rtol=rtol,
        atol=atol,
        deadline_index=int(at_deadline[0]) if at_deadline.size else None,
        deadline_residual=residual,
        stats=run.stats | {"seconds": time.perf_counter() - started},
    )


# ---------------------------------------------------------------------- start and instants


def _start(graph: SignedDigraph, x0: Any) -> np.ndarray:
    """Return the start as an (N, S) float array."""
    try:
        array = np.asarray(x0)
    except ValueError:
        raise ParameterError("the start x0 has rows of different lengths") from None
    n = graph.n_nodes
    if array.ndim not in (1, 2) or array.shape[0] != n or array.size == 0:
        shape = " x ".join(map(str, array.shape)) or "a single number"
        raise ParameterError(f"the start x0 has shape {shape}; give {n} numbers, or {n} rows, one for each agent")
    if array.dtype.kind == "O":
        try:
            array = np.array([float(as_fraction(v, "x0")) for v in array.ravel()]).reshape(array.shape)
        except (NumberError, OverflowError) as error:
            raise ParameterError(f"the start x0: {error}") from None
    if array.dtype.kind not in "iuf":
        raise ParameterError(f"the start x0 holds real numbers, not {array.dtype}")
    array = array.astype(float).reshape(n, -1)
    if not np.isfinite(array).all():
        row, column = np.argwhere(~np.isfinite(array))[0]
        raise ParameterError(
            f"the start of agent {shorten(graph.labels[row])} is {array[row, column]}, not a finite number"
        )
    return array


def _default_instants(
    protocol: NominalProtocol, remaining: float, samples: int, past: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return (t, 1 - t/T)."""
    if not 1e-300 <= remaining < 1:
        raise ParameterError(f"remaining = {remaining} is outside its domain; it must be between 1e-300 and 1")
    if samples < 2:
        raise ParameterError(f"samples = {samples} is outside its domain; it must be at least 2")
    if not 0 <= past <= 1e6:
        raise ParameterError(f"past = {past} is outside its domain; it must be between 0 and 1e6")
    T = float(protocol.T)
    marks = [0.5, 0.1, 0.01]
    if protocol.prescribed:
        uniform = np.exp(np.linspace(0, math.log(remaining), samples))
        uniform = np.append(uniform, np.linspace(1, uniform[-1], samples // 2))  # for figures in t
    else:
        uniform = np.linspace(1, 0, samples)
    left = np.unique(np.concatenate([uniform, marks, [0.0]]))[::-1]
    later = T * (1 + past * np.arange(1, _PAST_SAMPLES + 1) / _PAST_SAMPLES) if past else np.zeros(0)
    return np.append(T * (1 - left), later), np.append(left, np.zeros(later.size))


def _instants(protocol: NominalProtocol, times: Iterable[Exact]) -> tuple[np.ndarray, np.ndarray]:
    """Return (t, 1 - t/T) of the instants wanted, the latter from exact rationals."""
    try:
        wanted = [as_fraction(t, "an instant") for t in times]  # type: ignore[arg-type]
        t = np.array([float(value) for value in wanted])
    except (NumberError, TypeError, OverflowError) as error:
        raise ParameterError(f"times: {error}") from None
    if not wanted:
        raise ParameterError("times is empty; give at least one instant")
    if wanted[0] < 0:
        raise ParameterError(f"times starts at {t[0]}; instants must be >= 0")
    for earlier, later in pairwise(wanted):
        if later <= earlier:
            raise ParameterError(f"times is not increasing: {float(later)} follows {float(earlier)}")
    left = np.array([max(0.0, float(1 - value / protocol.T)) for value in wanted])
    left[t == float(protocol.T)] = 0
    return t, left


# ---------------------------------------------------------------------- the integrator


class _Run:
    """One start, moved along ``dX/dz = -(a e^(-c z) + b) L X``."""

    def __init__(self, graph: SignedDigraph, state: np.ndarray, rtol: float, atol: float):
        self.laplacian = graph.laplacian()
        self.in_weight = graph.in_weight()
        self.state = state
        self.stats = {"steps": 0, "rhs": 0}
        self._options: dict[str, Any] = {
            "reltol": rtol,
            "abstol": atol,
            "max_num_steps": _MAX_STEPS,
            "linear_solver": "csparse",
            "disable_internal_warnings": True,
            "show_eval_warnings": False,
        }
        if graph.n_nodes > _DIRECT_UP_TO:
            self._options |= {"newton_scheme": "gmres", "use_preconditioner": False}
        self._leap: Any = None

    def sample(self, a: float, b: float, c: float, z: np.ndarray) -> np.ndarray:
        """Return the (len(z), N, S) states at increasing ``z >= 0``; the last one becomes the present state."""
        later = np.unique(z[z > 0])
        states = np.empty((later.size + 1, *self.state.shape))
        states[0] = self.state
        if later.size:
            states[1:] = self._integrate(self._integrator(later), a, b, c, later[-1])
            self.state = states[-1]
        return states[np.searchsorted(later, z, side="right")]

    def settle(self, a: float, b: float, tau: float) -> float:
        """Move to the limit for ``tau`` to infinity, doubling ``tau`` until the residual is small; return it.

        The residual must be small both locally (no agent is away from what it listens to) and over time (groups that
        hardly listen to each other drift slowly).
        """
        goal = _RESOLVED / 10 * max(self._options["reltol"], self._options["abstol"])
        largest, residual = self.in_weight.max(), math.inf
        while True:
            span = max(tau, 20.0)
            previous = self.state
            self._leap = self._leap or self._integrator(np.ones(1))
            try:
                # One unit of the integrator's clock is the whole span.
                self.state = self._integrate(self._leap, a * math.exp(-tau) * span, b * span, span, 1.0)[0]
            except SimulationError:
                if residual == math.inf:
                    raise
                return residual
            tau += span
            residual = max(float(np.abs(self.state - previous).max()), self._imbalance())
            if residual <= goal or b * tau * largest > _MAX_CLOCK or tau > _MAX_TAU:
                return residual

    def _imbalance(self) -> float:
        """Return ``max_k |e_k| / (2 D_k)``; nobody moves the agents with ``D_k = 0``."""
        heard = self.in_weight > 0
        pull = np.abs(self.laplacian @ self.state)[heard] / (2 * self.in_weight[heard, None])
        return float(pull.max(initial=0.0))

    def _integrator(self, z: np.ndarray) -> Any:
        import casadi as ca

        x = ca.MX.sym("x", self.state.size)
        columns = ca.reshape(x, *self.state.shape)
        clock, p = ca.MX.sym("z"), ca.MX.sym("p", 3)
        ode = -(p[0] * ca.exp(-p[2] * clock) + p[1]) * ca.vec(ca.mtimes(_to_casadi(self.laplacian), columns))
        return ca.integrator("run", "cvodes", {"x": x, "t": clock, "p": p, "ode": ode}, 0.0, z.tolist(), self._options)

    def _integrate(self, integrator: Any, a: float, b: float, c: float, end: float) -> np.ndarray:
        """Return the (instants, N, S) states that the integrator reaches from the present one, the last at ``end``."""
        stiffness = (a + b) * end * self.in_weight.max()
        if not stiffness <= _MAX_STIFFNESS:
            raise SimulationError(
                f"the integrator was not started: {_TOO_LARGE} (gain x weight x span = {stiffness:.1e})"
            )
        try:
            reached = np.array(integrator(x0=self.state.ravel(order="F"), p=[a, b, c])["xf"])
        except RuntimeError as error:
            flag = re.search(r"CV_\w+", str(error))
            name = flag[0] if flag else "no CVODES flag"
            cause = _CAUSES.get(name, f"an unforeseen failure; perhaps {_TOO_LARGE}")
            raise SimulationError(f"the integrator stopped: {cause} ({name})") from None
        if not np.isfinite(reached).all():
            raise SimulationError(f"the integrator returned numbers that are not finite: {_TOO_LARGE}")
        counts = integrator.stats()
        self.stats["steps"] += counts["nsteps"]
        self.stats["rhs"] += counts["nfevals"]
        n, columns = self.state.shape
        return reached.reshape(columns, n, -1).transpose(2, 1, 0)


def _to_casadi(matrix: sparse.csr_array) -> Any:
    import casadi as ca

    columns = matrix.tocsc()
    columns.sort_indices()
    n: int = matrix.shape[0]
    starts: list[int] = columns.indptr.tolist()
    rows: list[int] = columns.indices.tolist()
    return ca.DM(ca.Sparsity(n, n, starts, rows), columns.data)
