"""CasADi's CVODES, made to fail with a cause: it moves agents from one instant to the next on a clock without poles."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ptcc_certify.errors import SimulationError
from ptcc_certify.graphs.rationals import number_within
from ptcc_certify.model.disturbance import Disturbance, ExpressionDisturbance, WorstCaseDisturbance
from ptcc_certify.simulation.interrupt import interruptible
from ptcc_certify.simulation.member_laplacians import Choice, Members

if TYPE_CHECKING:
    import casadi as ca

# Beyond this many agents the Newton steps are solved by GMRES: a sparse factor of a random graph fills up
# (N = 1,000: 3.4 s against 0.05 s), whereas below it a factor copes with weights over many decades.
DIRECT_UP_TO = 200
# With CasADi's 10, GMRES fails where in-weights span three decades, and the steps shrink (Bitcoin OTC: 30 s, not 3 s).
_KRYLOV = 30
_MAX_STEPS = 5000
# A disturbance may be fast: so many steps between two instants.
MANY_STEPS = 500_000
# The length of a stretch for CasADi, which takes instants for equal that are less than 1e-9 apart.
_FINE = 1e3
# Instants of a stretch of a signal up to which each is a step of an integrator that is kept.
_FEW = 12
# Beyond this product of in-weights and the length of such a step implicit steps are cheaper.
_STIFF = 10.0
# No tolerance is made finer than this on the way to the state at T.
_FINEST = 1e-13
# Beyond this the steps' linear systems are singular in float64.
_MAX_STIFFNESS = 1e15
_TOO_LARGE = "the weights or gains are too large"
_CAUSES = {
    "CV_TOO_MUCH_WORK": f"too many steps between two instants: {_TOO_LARGE}, or span too many decades",
    "CV_TOO_MUCH_ACC": "the tolerances are tighter than float64 can serve; raise rtol and atol",
    "CV_ERR_FAILURE": f"no step is small enough for the tolerances: {_TOO_LARGE}",
    "CV_CONV_FAILURE": f"a step's linear system could not be solved: {_TOO_LARGE}, or span too many decades",
}


class Tolerances(NamedTuple):
    """Of CVODES; ``atol`` is relative to the size of the initial state."""

    rtol: float
    atol: float

    @classmethod
    def within(cls, rtol: Any, atol: Any) -> Tolerances:
        """Refuse tolerances that CVODES cannot serve."""
        return cls(*(number_within(x, name, 1e-15, 0.1) for name, x in (("rtol", rtol), ("atol", atol))))


@dataclass(frozen=True)
class Phase:
    """A stretch of a motion on its own clock ``z``, on which no gain has a pole.

        t = start + span (1 - e^-z),   R = dt/dz = span e^-z     towards a pole at start + span
        t = start + span z,            R = span                  past all poles

    The nominal gain times ``R`` is ``rho1 R + pole R/(gap + R)``, where ``gap + R`` is the time until ``T``; that of
    the sliding variables is ``mu2 R + reaching_pole``.
    """

    start: float
    span: float
    rho1: float
    pole: float = 0.0
    gap: float = 0.0
    mu2: float = 0.0
    reaching_pole: float = 0.0
    past: bool = False

    def rate(self, z: Any, exp: Any) -> Any:
        """Return ``R``."""
        return self.span if self.past else self.span * exp(-z)

    def time(self, z: Any, exp: Any) -> Any:
        """Return ``t``."""
        return self.start + (self.span * z if self.past else self.span - self.span * exp(-z))

    def nominal(self, R: Any) -> Any:
        """Return the nominal gain times ``R``."""
        return self.rho1 * R + (self.pole * R / (self.gap + R) if self.pole else 0)

    def shrinking(self, R: Any) -> Any:
        """Return minus the derivative of 1 over the nominal gain: ``(1 - rho1/gain)^2/pole`` towards its pole."""
        return (1 - self.rho1 * R / self.nominal(R)) ** 2 / self.pole if self.pole else 0.0

    def stiffness(self, in_weight: float) -> float:
        """Bound the rates, per unit of ``z``, of agents that listen with ``in_weight`` at most."""
        return (self.rho1 * self.span + self.pole) * in_weight + self.mu2 * self.span + self.reaching_pole

    @property
    def end(self) -> float:
        """The pole, or infinity past all poles."""
        return math.inf if self.past else self.start + self.span

    def clock(self, t: np.ndarray) -> np.ndarray:
        """Return the ``z`` of instants before the pole."""
        share = (t - self.start) / self.span
        return share if self.past else -np.log1p(-share)


#: The stretched clock ``s``, on which nothing but a graph is at work: ``t`` stands for it.
ON_CLOCK = Phase(0.0, 1.0, 1.0, past=True)


class Forcing(NamedTuple):
    """What is added to ``x'`` and to every measurement, in words, how large it gets, and whether there is noise."""

    disturbance: Disturbance
    noise: Disturbance
    text: str
    size: float
    noisy: bool


class Drive:
    """A disturbance of N agents as the integrator has it: between two of its jumps a function of time and sign.

    The line between two samples is a parameter of the integrator.
    """

    def __init__(self, source: Disturbance, n: int):
        import casadi as ca

        self.source, self._agents = source, np.arange(n)
        self._worst, self._function = isinstance(source, WorstCaseDisturbance), None
        if isinstance(source, ExpressionDisturbance):
            instant = ca.SX.sym("t")
            values = ca.vertcat(*(source.casadi(instant, k) for k in range(n)))  # type: ignore[arg-type]
            self._function = ca.Function("d", [instant], [values])
        self.symbols = ca.MX.sym("line", 0 if self._worst or self._function else n, 2)

    def numbers(self, begin: float, end: float) -> list[float]:
        """Return the parameters between two instants."""
        if not self.symbols.numel():
            return []
        linear = self.source.linear(begin, end, self._agents, np.zeros(self._agents.size))
        assert linear is not None
        return np.concatenate(linear).tolist()

    def __call__(self, t: Any, sign: Any) -> Any:
        """Return the disturbances at an instant, where sliding variables have a sign."""
        if self._worst:
            return float(self.source.delta) * sign  # type: ignore[attr-defined]
        return self.symbols[:, 0] + self.symbols[:, 1] * t if self._function is None else self._function(t)


class Motion:
    """Columns of agents moved by CVODES from stop to stop of a phase, along ``dX/dz = -(gain R) L (X + n) + R d``.

    ``R = dt/dz`` is that of the phase, ``L`` that of the member of a family that acts. The jumps of ``d`` and ``n`` are
    stops.

    Parameters
    ----------
    members : Members
    state : (N, S) array
        In units of ``unit``.
    tolerances : Tolerances
    forcing : Forcing or None
        ``d`` and ``n``; None: 0.
    unit : float or (S,) array
        Size of the initial states.

    Attributes
    ----------
    state : (N, S) array
        The present states.
    drives : list of Drive
        What drives the agents.
    """

    #: Columns of the state that graphs move.
    moved: int | None = None

    def __init__(
        self,
        members: Members,
        state: np.ndarray,
        tolerances: Tolerances,
        forcing: Forcing | None = None,
        unit: float | np.ndarray = 1.0,
    ):
        import casadi as ca

        self.members, self.state, self.unit, self.in_weight = members, state, unit, members.in_weight
        sources = () if forcing is None else (forcing.disturbance, forcing.noise)
        self.drives = [Drive(source, len(state)) for source in sources]
        self.stats = {"steps": 0, "rhs": 0}
        self._largest = float(self.in_weight.max(initial=0.0))
        self._options: dict[str, Any] = {
            "reltol": tolerances.rtol,
            "abstol": tolerances.atol,
            "max_num_steps": _MAX_STEPS,
            "linear_solver": "csparse",
            "disable_internal_warnings": True,
            "show_eval_warnings": False,
        }
        n = members.graph.n_nodes
        if large := n > DIRECT_UP_TO:
            self._options |= {"newton_scheme": "gmres", "use_preconditioner": False, "max_krylov": _KRYLOV}
        self._steps: dict[tuple[Phase, bool], Any] = {}
        self._data: list[float] = []
        indptr, indices = members.pattern
        pattern = ca.Sparsity(n, n, indptr.tolist(), indices.tolist())
        columns = self.moved or state.shape[1]
        if members.alone:
            self._weights = ca.MX(0, 1)
            data = members.laplacian(Choice(0)).data
            self._product = (_product_without_pattern if large else _product)(ca.DM(pattern, data), columns)
        else:
            self._weights = ca.MX.sym("weights", indices.size)
            self._product = functools.partial(ca.mtimes, ca.MX(pattern, self._weights))

    def choose(self, choice: Choice) -> None:
        """Let a member act from now on."""
        self._data = [] if self.members.alone else self.members.data(choice).tolist()

    def agents(self) -> np.ndarray:
        """Return the (N,) present states of the first column, in units of ``unit``."""
        return self.state[:, 0]

    @contextmanager
    def at_rest(self) -> Iterator[None]:
        """Let nothing but the graph move the agents meanwhile."""
        drives, self.drives = self.drives, []
        self._steps.clear()
        try:
            yield
        finally:
            self.drives = drives
            self._steps.clear()

    def sample(
        self, phase: Phase, z: np.ndarray, end: float, begin: float = 0.0, events: Iterable[float] = ()
    ) -> np.ndarray:
        """Return the (len(z), N, S) states at instants of a phase, those outside ``begin .. end`` as at these two.

        The state at ``begin`` is the present one; that at ``end`` becomes it.
        """
        jumps = np.concatenate([np.empty(0), *(drive.source.breaks(phase.end) for drive in self.drives)])
        inner = np.concatenate([phase.clock(jumps[jumps > phase.start]), list(events)])
        stops = np.unique([begin, *inner[(inner > begin) & (inner < end)], end])
        z, states = np.minimum(z, end), np.empty((z.size, *self.state.shape))
        states[z <= begin] = self.state
        for a, b in pairwise(stops.tolist()):
            inside = (z > a) & (z <= b)
            later = np.unique(np.append(z[inside], b))
            later_states = self._advance(phase, later, a)
            states[inside] = later_states[np.searchsorted(later, z[inside])]
            self.state = later_states[-1]
        return states

    def slope(self, x: ca.MX, phase: Phase, z: ca.MX) -> ca.MX:
        """Return ``dX/dz`` between two neighbouring stops."""
        import casadi as ca

        R, t = phase.rate(z, ca.exp), phase.time(z, ca.exp)
        if not self.drives:
            return -phase.nominal(R) * self._product(x)
        per_unit = ca.DM(1 / np.broadcast_to(self.unit, x.shape[1])).T
        d, noise = (ca.mtimes(drive(t, 0), per_unit) for drive in self.drives)
        return R * d - phase.nominal(R) * self._product(x + noise)

    def symbols(self) -> list[ca.MX]:
        """Return the parameters of an integrator: the weights of the member that acts, and what drives the agents."""
        return [self._weights, *(drive.symbols for drive in self.drives)]

    def numbers(self, phase: Phase, start: float, end: float) -> list[float]:
        """Return these parameters between two neighbouring stops."""
        begin, last = (float(phase.time(z, math.exp)) for z in (start, end))
        return [*self._data, *(number for drive in self.drives for number in drive.numbers(begin, last))]

    def _advance(self, phase: Phase, z: np.ndarray, start: float) -> np.ndarray:
        """Return the (len(z), N, S) states at increasing instants ``z > start``.

        Short stretches are steps of one integrator that is kept; one integrator for all instants of a long one costs
        less than a step for each.
        """
        if self.members.alone or z.size > _FEW:
            return self._over(phase, start, float(z[-1]), (z - start) / (z[-1] - start))
        states = np.empty((z.size, *self.state.shape))
        for k, (a, b) in enumerate(pairwise([start, *z.tolist()])):
            states[k] = self.state = self._over(phase, a, b, np.ones(1))[0]
        return states

    def _over(self, phase: Phase, start: float, end: float, shares: np.ndarray) -> np.ndarray:
        """Return the states at shares of the way from the present state at ``start`` to ``end``."""
        stiffness = (end - start) * phase.stiffness(self._largest)
        explicit = not self.members.alone and shares.size == 1 and stiffness <= _STIFF
        key = phase, explicit
        integrator = self._steps.get(key) if shares.size == 1 else None
        if integrator is None:
            length = 1.0 if shares.size == 1 else _FINE * max(1.0, stiffness)
            integrator = self._integrator(phase, shares * length, explicit)
            if shares.size == 1:
                self._steps[key] = integrator
        return self._call(integrator, stiffness, [*self.numbers(phase, start, end), start, end - start])

    @interruptible()
    def _integrator(self, phase: Phase, outputs: np.ndarray, explicit: bool) -> Any:
        """Return CVODES for a stretch of a phase that ends at the last of the outputs."""
        import casadi as ca

        x, at, begin, span = (ca.MX.sym(*one) for one in (("x", self.state.size), ("at",), ("begin",), ("span",)))
        rate = span / float(outputs[-1])
        slope = self.slope(ca.reshape(x, *self.state.shape), phase, begin + rate * at)
        p = ca.vertcat(*map(ca.vec, self.symbols()), begin, span)
        problem = {"x": x, "t": at, "p": p, "ode": rate * ca.vec(slope)}
        more: dict[str, Any] = {"max_num_steps": MANY_STEPS} if self.drives else {}
        if explicit:
            more |= {"linear_multistep_method": "adams", "nonlinear_solver_iteration": "functional"}
        return ca.integrator("run", "cvodes", problem, 0.0, outputs.tolist(), self._options | more)

    def refine(self) -> None:
        """Take tolerances under which a run settles to within them in every agent of a large graph.

        CVODES bounds the root of the mean square of the errors; that of one agent can be sqrt(N) times as large.
        """
        if len(self.state) > DIRECT_UP_TO:
            share = math.sqrt(len(self.state))
            for name in ("reltol", "abstol"):
                self._options[name] = min(self._options[name], max(self._options[name] / share, _FINEST))
            self._steps.clear()

    def _call(self, integrator: Any, stiffness: float, parameters: Sequence[float] = ()) -> np.ndarray:
        """Return the (instants, N, S) states that an integrator reaches from the present one."""
        if not stiffness <= _MAX_STIFFNESS:
            raise SimulationError(
                f"the integrator was not started: {_TOO_LARGE} (gain x weight x span = {stiffness:.1e})"
            )
        try:
            with interruptible():
                states = np.array(integrator(x0=self.state.ravel(order="F"), p=parameters)["xf"])
        except RuntimeError as error:
            flag = re.search(r"CV_\w+", str(error))
            name = flag[0] if flag else "no CVODES flag"
            cause = _CAUSES.get(name, f"an unforeseen failure; perhaps {_TOO_LARGE}")
            raise SimulationError(f"the integrator stopped: {cause} ({name})") from None
        if not np.isfinite(states).all():
            raise SimulationError(f"the integrator returned numbers that are not finite: {_TOO_LARGE}")
        counts = integrator.stats()
        self.stats["steps"] += counts["nsteps"]
        self.stats["rhs"] += counts["nfevals"] + counts.get("n_call_jtimesF", 0)
        return states.reshape(*self.state.T.shape, -1).transpose(2, 1, 0)


def _product(laplacian: ca.DM, columns: int) -> Any:
    """Return the CasADi function ``X -> L X`` of (N, columns) matrices."""
    import casadi as ca

    X = ca.MX.sym("X", laplacian.shape[0], columns)
    return ca.Function("product", [X], [ca.densify(ca.mtimes(laplacian, X))])


def _product_without_pattern(laplacian: ca.DM, columns: int) -> Any:
    """Return the same function, its dependencies hidden from CasADi; it must outlive the integrators that call it.

    CasADi prepares the Jacobian of every right-hand side, which takes long (N = 100,000: 9 s) and which GMRES without
    a preconditioner never evaluates: it takes the exact derivatives in single directions, products with ``L`` again.
    So the Jacobian is declared diagonal.
    """
    import casadi as ca

    product = _product(laplacian, columns)
    shape = product.size_in(0)

    class Product(ca.Callback):
        def __init__(self) -> None:
            super().__init__()
            self._buffer, self._evaluate = product.buffer()
            self.construct("product", {"enable_fd": False})

        def get_sparsity_in(self, _: int) -> Any:
            return ca.Sparsity.dense(*shape)

        def get_sparsity_out(self, _: int) -> Any:
            return ca.Sparsity.dense(*shape)

        def has_jac_sparsity(self, *_: int) -> bool:
            return True

        def get_jac_sparsity(self, *_: int) -> Any:
            return ca.Sparsity.diag(shape[0] * shape[1])

        def has_eval_buffer(self) -> bool:
            return True

        def eval_buffer(self, arg: Any, res: Any) -> int:
            self._buffer.set_arg(0, arg[0])
            self._buffer.set_res(0, res[0])
            self._evaluate()
            return 0

        def has_forward(self, _: int) -> bool:
            return True

        def get_forward(
            self, directions: int, name: str, inputs: Sequence[str], outputs: Sequence[str], options: Any
        ) -> Any:
            X, Y = ca.MX.sym("X", *shape), ca.MX.sym("Y", ca.Sparsity(*shape))
            seeds = ca.MX.sym("seeds", shape[0], shape[1] * directions)
            derivatives = _product(laplacian, shape[1] * directions)(seeds)
            return ca.Function(name, [X, Y, seeds], [derivatives], inputs, outputs, options)

    return Product()
