"""CasADi's CVODES, made to fail with a cause, and the nominal motion that it integrates."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ptcc_certify.errors import ParameterError, SimulationError
from ptcc_certify.simulation.interrupt import interruptible
from ptcc_certify.simulation.trajectory import RESOLVED

if TYPE_CHECKING:
    from scipy import sparse

    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.protocols.gain import Gain

# Beyond this many agents the Newton steps are solved by GMRES: a sparse factor of a random graph fills up
# (N = 1,000: 3.4 s against 0.05 s), whereas below it a factor copes with weights over many decades.
_DIRECT_UP_TO = 200
# With CasADi's 10, GMRES fails where in-weights span three decades, and the steps shrink (Bitcoin OTC: 30 s, not 3 s).
_KRYLOV = 30
_MAX_STEPS = 5000
# No tolerance is made finer than this on the way to the state at T.
_FINEST = 1e-13
# The state at T is given up beyond this s max(D): the roundings of float64 weights act there like slow modes.
_MAX_CLOCK = 1e13
_MAX_TAU = 1e300
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

    def check(self) -> None:
        """Refuse tolerances that CVODES cannot serve."""
        for name, tolerance in self._asdict().items():
            if not 1e-15 <= tolerance <= 0.1:
                raise ParameterError(
                    f"{name} = {tolerance} is outside its domain; {name} must be between 1e-15 and 0.1"
                )


class Motion:
    """What every motion shares: CVODES with its options, and its failures with their causes."""

    def __init__(
        self, graph: SignedDigraph, state: np.ndarray, columns: int, tolerances: Tolerances, max_steps: int = _MAX_STEPS
    ):
        self.state = state
        self.laplacian = graph.laplacian()
        self.in_weight = graph.in_weight()
        self.stats = {"steps": 0, "rhs": 0}
        self._options: dict[str, Any] = {
            "reltol": tolerances.rtol,
            "abstol": tolerances.atol,
            "max_num_steps": max_steps,
            "linear_solver": "csparse",
            "disable_internal_warnings": True,
            "show_eval_warnings": False,
        }
        if graph.n_nodes > _DIRECT_UP_TO:
            self._options |= {"newton_scheme": "gmres", "use_preconditioner": False, "max_krylov": _KRYLOV}
            self._product = _product_without_pattern(self.laplacian, columns)
        else:
            self._product = _product(self.laplacian, columns)

    def imbalance(self, states: np.ndarray) -> float:
        """Return ``max_k |e_k| / (2 D_k)``; nobody moves the agents with ``D_k = 0``."""
        heard = self.in_weight > 0
        pull = np.abs(self.laplacian @ states)[heard] / (2 * self.in_weight[heard, None])
        return float(pull.max(initial=0.0))

    @interruptible()
    def _integrator(self, problem: dict[str, Any], start: float, z: np.ndarray, **options: Any) -> Any:
        """Return CVODES for a problem on its clock, to report at increasing instants ``z > start``."""
        import casadi as ca

        return ca.integrator("run", "cvodes", problem, start, z.tolist(), self._options | options)

    def _call(self, integrator: Any, state: np.ndarray, parameters: list[float], stiffness: float) -> np.ndarray:
        """Return the (entries, instants) states that an integrator reaches."""
        if not stiffness <= _MAX_STIFFNESS:
            raise SimulationError(
                f"the integrator was not started: {_TOO_LARGE} (gain x weight x span = {stiffness:.1e})"
            )
        try:
            with interruptible():
                reached = np.array(integrator(x0=state, p=parameters)["xf"])
        except RuntimeError as error:
            flag = re.search(r"CV_\w+", str(error))
            name = flag[0] if flag else "no CVODES flag"
            cause = _CAUSES.get(name, f"an unforeseen failure; perhaps {_TOO_LARGE}")
            raise SimulationError(f"the integrator stopped: {cause} ({name})") from None
        if not np.isfinite(reached).all():
            raise SimulationError(f"the integrator returned numbers that are not finite: {_TOO_LARGE}")
        counts = integrator.stats()
        self.stats["steps"] += counts["nsteps"]
        self.stats["rhs"] += counts["nfevals"] + counts.get("n_call_jtimesF", 0)
        return reached


class NominalMotion(Motion):
    """One start, or several, moved along ``dX/dz = -(a e^(-c z) + b) L X``."""

    def __init__(self, graph: SignedDigraph, state: np.ndarray, tolerances: Tolerances):
        super().__init__(graph, state, state.shape[1], tolerances)
        self._leap: Any = None

    def sample(self, a: float, b: float, c: float, z: np.ndarray) -> np.ndarray:
        """Return the (len(z), N, S) states at increasing ``z >= 0``; the last one becomes the present state."""
        later = np.unique(z[z > 0])
        states = np.empty((later.size + 1, *self.state.shape))
        states[0] = self.state
        if later.size:
            states[1:] = self._integrate(self._integrator(self._problem(), 0.0, later), a, b, c, later[-1])
            self.state = states[-1]
        return states[np.searchsorted(later, z, side="right")]

    def settle(self, a: float, b: float, tau: float) -> float:
        """Move to the limit for ``tau`` to infinity, doubling ``tau`` until the residual is small; return it.

        The residual must be small both locally (no agent is away from what it listens to) and over time (groups that
        hardly listen to each other drift slowly).
        """
        goal = RESOLVED / 10 * max(self._options["reltol"], self._options["abstol"])
        largest, residual = self.in_weight.max(), math.inf
        while True:
            span = max(tau, 20.0)
            previous = self.state
            self._leap = self._leap or self._integrator(self._problem(), 0.0, np.ones(1), **self._finer())
            try:
                # One unit of the integrator's clock is the whole span.
                self.state = self._integrate(self._leap, a * math.exp(-tau) * span, b * span, span, 1.0)[0]
            except SimulationError:
                if residual == math.inf:
                    raise
                return residual
            tau += span
            residual = max(float(np.abs(self.state - previous).max()), self.imbalance(self.state))
            if residual <= goal or b * tau * largest > _MAX_CLOCK or tau > _MAX_TAU:
                return residual

    def past_deadline(
        self, gain: Gain, remaining: float, tau: np.ndarray, late: np.ndarray
    ) -> tuple[np.ndarray, float | None]:
        """Return the (M, N, S) states under a gain from ``remaining`` before ``T`` on, and the residual at ``T``.

        Before ``T`` at instants ``tau = ln(remaining/(T - t))``, then at instants ``late``; without these no residual.
        """
        rho1, pole, T = float(gain.rho1), float(gain.pole), float(gain.T)
        before = self.sample(rho1 * remaining, pole, 1.0, tau)
        if not late.size:
            return before, None
        residual = self.settle(rho1 * remaining, pole, tau[-1] if tau.size else 0.0)
        return np.concatenate([before, self.sample(0.0, rho1 * T, 0.0, np.maximum(late / T - 1, 0))]), residual

    def _finer(self) -> dict[str, Any]:
        """Return the options of a run that settles to within the tolerances in every agent of a large graph.

        CVODES bounds the root of the mean square of the errors; that of one agent can be sqrt(N) times as large.
        """
        if len(self.state) <= _DIRECT_UP_TO:
            return {}
        share = math.sqrt(len(self.state))
        return {n: min(self._options[n], max(self._options[n] / share, _FINEST)) for n in ("reltol", "abstol")}

    @interruptible()
    def _problem(self) -> dict[str, Any]:
        import casadi as ca

        x, clock, p = ca.MX.sym("x", self.state.size), ca.MX.sym("z"), ca.MX.sym("p", 3)
        columns = ca.reshape(x, *self.state.shape)
        ode = -(p[0] * ca.exp(-p[2] * clock) + p[1]) * ca.vec(self._product(columns))
        return {"x": x, "t": clock, "p": p, "ode": ode}

    def _integrate(self, integrator: Any, a: float, b: float, c: float, end: float) -> np.ndarray:
        """Return the (instants, N, S) states that the integrator reaches from the present one, the last at ``end``."""
        stiffness = (a + b) * end * self.in_weight.max()
        reached = self._call(integrator, self.state.ravel(order="F"), [a, b, c], stiffness)
        n, columns = self.state.shape
        return reached.reshape(columns, n, -1).transpose(2, 1, 0)


def _product(laplacian: sparse.csr_array, columns: int) -> Any:
    """Return the CasADi function ``X -> L X`` of (N, columns) matrices."""
    import casadi as ca

    X = ca.MX.sym("X", laplacian.shape[0], columns)
    return ca.Function("product", [X], [ca.densify(ca.mtimes(_to_casadi(laplacian), X))])


def _product_without_pattern(laplacian: sparse.csr_array, columns: int) -> Any:
    """Return the same function, its dependencies kept from CasADi; it must outlive the integrators that call it.

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
            moved = _product(laplacian, shape[1] * directions)(seeds)
            return ca.Function(name, [X, Y, seeds], [moved], inputs, outputs, options)

    return Product()


def _to_casadi(matrix: sparse.csr_array) -> Any:
    import casadi as ca

    columns = matrix.tocsc()
    columns.sort_indices()
    n: int = matrix.shape[0]
    starts: list[int] = columns.indptr.tolist()
    rows: list[int] = columns.indices.tolist()
    return ca.DM(ca.Sparsity(n, n, starts, rows), columns.data)
