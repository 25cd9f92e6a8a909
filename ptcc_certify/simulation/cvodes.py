"""CasADi's CVODES, made to fail with a cause: it moves agents from one instant to the next on a clock without poles."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ptcc_certify.errors import SimulationError
from ptcc_certify.graphs.rationals import number_within
from ptcc_certify.simulation.interrupt import interruptible

if TYPE_CHECKING:
    import casadi as ca

    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.protocols.disturbance import Disturbance

# Beyond this many agents the Newton steps are solved by GMRES: a sparse factor of a random graph fills up
# (N = 1,000: 3.4 s against 0.05 s), whereas below it a factor copes with weights over many decades.
DIRECT_UP_TO = 200
# With CasADi's 10, GMRES fails where in-weights span three decades, and the steps shrink (Bitcoin OTC: 30 s, not 3 s).
_KRYLOV = 30
_MAX_STEPS = 5000
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


class Motion(ABC):
    """Columns of agents moved by CVODES from stop to stop of a phase; the jumps of what drives them are stops, too.

    Attributes
    ----------
    state : (N, S) array
        The present states.
    sources : tuple of Disturbance
        What drives the agents.
    """

    sources: tuple[Disturbance, ...] = ()

    def __init__(self, graph: SignedDigraph, state: np.ndarray, columns: int, tolerances: Tolerances):
        import casadi as ca

        self.state = state
        self.laplacian = graph.laplacian()
        self.in_weight = graph.in_weight()
        self.stats = {"steps": 0, "rhs": 0}
        self._options: dict[str, Any] = {
            "reltol": tolerances.rtol,
            "abstol": tolerances.atol,
            "max_num_steps": _MAX_STEPS,
            "linear_solver": "csparse",
            "disable_internal_warnings": True,
            "show_eval_warnings": False,
        }
        if large := graph.n_nodes > DIRECT_UP_TO:
            self._options |= {"newton_scheme": "gmres", "use_preconditioner": False, "max_krylov": _KRYLOV}
        part, n = self.laplacian.tocsc(), graph.n_nodes
        laplacian = ca.DM(ca.Sparsity(n, n, part.indptr.tolist(), part.indices.tolist()), part.data)
        self._product = (_product_without_pattern if large else _product)(laplacian, columns)

    def imbalance(self, states: np.ndarray) -> float:
        """Return ``max_k |e_k| / (2 D_k)``; nobody moves the agents with ``D_k = 0``."""
        listeners = self.in_weight > 0
        pull = np.abs(self.laplacian @ states)[listeners] / (2 * self.in_weight[listeners, None])
        return float(pull.max(initial=0.0))

    def sample(
        self, phase: Phase, z: np.ndarray, end: float, begin: float = 0.0, events: Iterable[float] = ()
    ) -> np.ndarray:
        """Return the (len(z), N, S) states at instants of a phase, those outside ``begin .. end`` as at these two.

        The state at ``begin`` is the present one; that at ``end`` becomes it.
        """
        jumps = np.concatenate([np.empty(0), *(source.breaks(phase.end) for source in self.sources)])
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

    @abstractmethod
    def slope(self, x: ca.MX, phase: Phase, clock: ca.MX, ends: tuple[float, float]) -> ca.MX:
        """Return ``dX/dz`` between two neighbouring stops."""

    def _advance(self, phase: Phase, z: np.ndarray, start: float) -> np.ndarray:
        """Return the (len(z), N, S) states at increasing instants ``z > start``."""
        import casadi as ca

        x, clock = ca.MX.sym("x", self.state.size), ca.MX.sym("z")
        ode = self.slope(ca.reshape(x, *self.state.shape), phase, clock, (start, float(z[-1])))
        integrator = self._integrator({"x": x, "t": clock, "ode": ca.vec(ode)}, start, z)
        return self._call(integrator, (z[-1] - start) * phase.stiffness(self.in_weight.max()))

    @interruptible()
    def _integrator(self, problem: dict[str, Any], start: float, z: np.ndarray, **options: Any) -> Any:
        """Return CVODES for a problem on its clock, to report at increasing instants ``z > start``."""
        import casadi as ca

        return ca.integrator("run", "cvodes", problem, start, z.tolist(), self._options | options)

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
