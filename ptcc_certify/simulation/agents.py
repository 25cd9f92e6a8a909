"""Motions of agents of order n: deviations from the common motion by CVODES, the common motion by itself.

In ``y_k = diag(1, zeta, ..) (xi_k - h_k)`` on the clock ``tau = -ln(1 - t/T)`` nothing has a pole,

    dY/dtau = g (Y A_z' - L Y K'b'),   g = ds/dtau = rho1 T e^-tau + k.

``Y = U w + (Q (x) I) Y``, the columns of ``U`` a basis of the range of ``L``: ``L U = U B``. What is integrated is
``z = e^(r s/2) w``, which neither vanishes nor grows, so that the tolerance acts on the disagreement alone, however
near to ``T``. The common motion is that of one agent without neighbours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.errors import ParameterError, SimulationError
from ptcc_certify.graphs.rationals import shorten, whole_number
from ptcc_certify.model.agents_protocol import AgentsProtocol
from ptcc_certify.model.asks import GainLimits
from ptcc_certify.simulation.cvodes import Motion, Phase, Tolerances
from ptcc_certify.simulation.member_laplacians import Members
from ptcc_certify.simulation.nominal import Instants, sample
from ptcc_certify.simulation.trajectory import ByAgent, csv_text

if TYPE_CHECKING:
    import casadi as ca

    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.model.gain import Gain

#: Numbers that are integrated at most.
MOST_STATES = 3000
#: Singular values of ``L`` below this, relatively, are 0.
_ZERO = 1e-9
#: ``1 - t/T`` that stands for 0 in the common motion.
_NEXT = 1e-17


@dataclass(frozen=True, eq=False, repr=False)
class AgentsTrajectory(ByAgent):
    """A run of agents of order n.

    Attributes
    ----------
    graph : SignedDigraph
    protocol : AgentsProtocol
    t, remaining, clock : (M,) arrays
        Instants, ``1 - t/T``, and ``s``, infinite at ``T`` unless the gain is capped.
    states : (N, d, n, M) array
        Positions, velocities and so on, in every coordinate; ``run[label]`` are those of one agent.
    scaled : (N, d, n, M) array
        ``e^(rate s/2)`` times the deviations from the common motion in the coordinates ``y``; NaN at ``T`` without a
        cap, where the clock is infinite.
    input : (N, d, M) array
        What the agents do, without sliding terms.
    rtol : float
        Of the integrator.
    rate : float
        By which ``scaled`` is weighed.
    """

    graph: SignedDigraph
    protocol: AgentsProtocol
    t: np.ndarray
    remaining: np.ndarray
    clock: np.ndarray
    states: np.ndarray
    scaled: np.ndarray
    input: np.ndarray
    rtol: float
    rate: float

    @property
    def positions(self) -> np.ndarray:
        """(N, d, M) array."""
        return self.states[:, :, 0]

    @property
    def velocities(self) -> np.ndarray:
        """(N, d, M) array; of agents of order 2 or more."""
        return self.states[:, :, 1]

    @property
    def final_state(self) -> np.ndarray:
        """(N, d, n) array: at the last instant, ``T`` or next to it."""
        return self.states[..., -1]

    def in_places(self, places: np.ndarray) -> AgentsTrajectory:
        """Return the run with places (N,) added to the positions, of agents on a line that ran less these."""
        states = self.states.copy()
        states[:, 0, 0] += places[:, None]
        return replace(self, states=states)

    def to_csv(self) -> str:
        r"""Return ``t,remaining,<label>,..,v(<label>),..,u(<label>),..`` as text, one row per instant, floats in full.

        Positions, velocities ``v(..)``, accelerations ``a(..)``, derivatives ``x^(3)(..)`` and so on, and the input
        ``u(..)``, which is ``nan`` at ``T`` itself under an infinite gain; of several coordinates ``<label>[1]`` and so
        on.

        Examples
        --------
        >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
        >>> protocol = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
        >>> run = certify(foes, protocol, [3, 1], agents=Agents(order=2), asks=Asks(method="paper")).agents.simulate()
        >>> run.to_csv().partition("\n")[0]
        't,remaining,a,b,v(a),v(b),u(a),u(b)'
        """
        N, d, n, _ = self.states.shape
        marks = [""] if d == 1 else [f"[{q + 1}]" for q in range(d)]
        names = [f"{label}{mark}" for label in self.graph.labels for mark in marks]
        letters = ["v", "a", *(f"x^({i})" for i in range(3, n))][: n - 1]
        heads = [*names, *(f"{letter}({name})" for letter in (*letters, "u") for name in names)]
        parts = [self.states[:, :, i].reshape(N * d, -1) for i in range(n)]
        table = np.vstack([self.t, self.remaining, *parts, self.input.reshape(N * d, -1) + 0.0])
        return csv_text(["t", "remaining", *heads], table)

    def __repr__(self) -> str:
        N, d, n, M = self.states.shape
        space = f" in {d} dimensions" if d > 1 else ""
        return f"AgentsTrajectory({N} agents of order {n}{space}, {M} instants, t = 0 .. {self.t[-1]:.6g})"


class AgentsMotion(Motion):
    """Numbers of every agent, with a tolerance of the size of the largest.

    Parameters
    ----------
    graph : SignedDigraph
    state : (N, S) array
    rtol : float
        Of CVODES.
    """

    def __init__(self, graph: SignedDigraph, state: np.ndarray, rtol: float):
        largest = float(np.abs(state).max(initial=0)) or 1.0
        super().__init__(Members(graph), state, Tolerances(rtol, rtol * largest))
        self._options |= {"max_num_steps": 200_000}


class _Deviations(AgentsMotion):
    """``z`` on one stretch of time after the other; ``d`` coordinates of ``n`` numbers side by side."""

    def __init__(
        self, graph: SignedDigraph, state: np.ndarray, block: np.ndarray, of: AgentsProtocol, rate: float, rtol: float
    ):
        super().__init__(graph, state, rtol)
        self._block, self._of, self._rate = block, of, rate
        for key in ("newton_scheme", "use_preconditioner", "max_krylov"):
            self._options.pop(key, None)

    def slope(self, x: ca.MX, phase: Phase, z: ca.MX) -> ca.MX:
        """Return the slope of the deviations on the clock of the phase."""
        import casadi as ca

        n = self._of.order
        R = phase.rate(z, ca.exp)
        g = phase.nominal(R)
        zeta = R / g
        theta = phase.shrinking(R)
        A = ca.MX(ca.DM(np.eye(n, k=1) + self._rate / 2 * np.eye(n))) - theta * ca.DM(np.diag(np.arange(float(n))))
        plant, own = (list(map(float, numbers)) for numbers in (self._of.plant, self._of.own))
        last = ca.hcat([-own[i] - plant[i] * zeta ** (n - i) for i in range(n)])
        A = A + ca.mtimes(ca.DM(np.eye(n)[:, [-1]]), last)
        feedback = ca.horzcat(ca.MX(n, n - 1), ca.vertcat(*self._of.gains_at(theta)))  # K'b'
        copies = ca.DM.eye(x.shape[1] // n)
        free = ca.mtimes(x, ca.kron(copies, A.T))
        driven = ca.mtimes(ca.DM(self._block), ca.mtimes(x, ca.kron(copies, feedback)))
        return g * (free - driven)


def simulate_agents(
    graph: SignedDigraph,
    protocol: AgentsProtocol,
    states: Any,
    rate: float = 0.0,
    *,
    remaining: float = 1e-6,
    samples: int = 101,
    steps: int | None = None,
    rtol: float = 1e-10,
) -> AgentsTrajectory:
    """Integrate agents of order n from their initial states to the deadline.

    Parameters
    ----------
    graph : SignedDigraph
    protocol : AgentsProtocol
    states : (N, d, n) array
        Positions, velocities and so on, in every coordinate.
    rate : float
        ``r``, by which deviations are weighed: that of the certificate.
    remaining : float
        Instants uniform in ``tau`` go from ``1 - t/T = 1`` to this; then comes ``T``.
    samples : int
        So many of these, and as many uniform in ``t``.
    steps : int, optional
        Instead: so many equal steps of ``t`` from 0 to ``T``.
    rtol : float
        Of CVODES.

    Raises
    ------
    ParameterError
        ``remaining`` is not between 0 and 1, ``samples`` are below 2 or ``steps`` below 1.
    SimulationError
        The integrator failed, or there are too many agents.
    """
    if not (isinstance(remaining, float | int) and 0 < remaining < 1):
        raise ParameterError("remaining", f"= {shorten(str(remaining))} is not between 0 and 1; give 1e-6, say")
    xi = np.array(states, dtype=float)
    N, d, n = xi.shape
    if N * d * n > MOST_STATES:
        raise SimulationError(f"more than {MOST_STATES} numbers to integrate; simulate fewer agents")
    t, q, reaching = instants_left(protocol.gain, remaining, samples, steps)
    seen = (q > 0) | (protocol.gain_cap is not None)  # at T itself without a cap the clock is infinite
    h = np.array([[float(x) for x in row] for row in protocol.offsets])
    xi[:, :, 0] -= h
    U, kernel, block = _split(graph)
    coordinates = np.linalg.solve(np.hstack([U, kernel]), xi.reshape(N, d * n))
    common = kernel @ coordinates[U.shape[1] :]
    zeta0 = 1 / protocol.value(1.0)
    scale = np.tile(zeta0 ** np.arange(n), d)
    begin = coordinates[: U.shape[1]] * scale
    z = np.where(seen[:, None, None], 0.0, np.full(begin.shape, np.nan))
    if np.abs(begin).max(initial=0):
        limited, instants = GainLimits(gain_cap=protocol.gain_cap).limit(protocol.gain), Instants(t, q, reaching)
        motion = _Deviations(graph, begin, block, protocol, rate, rtol)
        z[seen], _ = sample(motion, limited, Instants(*(values[seen] for values in instants)))
    scaled = np.moveaxis(np.einsum("km,imc->ikc", U, z).reshape(len(q), N, d, n), 0, -1)
    scaled[..., ~seen] = np.nan  # of agents alone, too
    nearly = np.where(seen, q, _NEXT)
    free = np.einsum("mij,kdj->kdim", _free_motion(protocol, nearly), common.reshape(N, d, n))
    clock, eta = protocol.clock(q), np.array([protocol.value(x) for x in nearly])
    deviations = scaled * np.exp(-rate * np.where(seen, clock, 0.0) / 2)
    all_states = free + deviations * eta ** np.arange(n)[:, None]
    if not seen[-1]:
        slowest = np.linalg.eigvals(block).real.min(initial=np.inf) * float(protocol.gain.pole)
        all_states[..., -1] = _at_deadline(protocol, free[..., -1], protocol.agree_if_above(slowest))
    control = _input(graph, protocol, deviations, free, eta)
    all_states[:, :, 0] += h[:, :, None]
    control += float(protocol.plant[0]) * h[:, :, None]
    return AgentsTrajectory(graph, protocol, t, q, clock, all_states, scaled, control, rtol, rate)


def _at_deadline(protocol: AgentsProtocol, free: np.ndarray, agreed: bool) -> np.ndarray:
    """Return the states at ``T``, where deviations are 0; those of derivatives only if they agree."""
    last = free.copy()
    if any(protocol.own):
        last[:, :, 1:] = 0.0  # they rest
    if not agreed:
        last[:, :, 1:] = np.nan
    return last


def instants_left(gain: Gain, remaining: float, samples: int, steps: int | None = None) -> Instants:
    """Return instants: so many uniform in ``tau``, as many in ``t``, and ``T``; or those of equal steps.

    Examples
    --------
    >>> from ptcc_certify.model.gain import Gain
    >>> instants_left(Gain(2, 1, 1, 1), 0.1, 201, steps=4).t
    array([0. , 0.5, 1. , 1.5, 2. ])
    """
    samples = whole_number(samples, "samples", 2, 100_000)
    if steps is not None:
        steps = whole_number(steps, "steps", 1, 100_000)
        q = np.arange(steps, -1, -1) / steps
    else:
        q = np.concatenate([np.geomspace(remaining, 1, samples), np.linspace(remaining, 1, samples), [0.0]])
        q = np.unique(q)[::-1]
    return Instants(float(gain.T) * (1 - q), q, np.zeros(q.size))


def _split(graph: SignedDigraph) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a basis ``U`` of the range of ``L``, one of its kernel, and ``B`` with ``L U = U B``."""
    L = graph.laplacian().toarray()
    left, sizes, right = np.linalg.svd(L)
    rank = int((sizes > _ZERO * max(sizes.max(initial=0.0), 1e-300)).sum())
    U, kernel = left[:, :rank], right[rank:].T
    return U, kernel, U.T @ L @ U


def _free_motion(protocol: AgentsProtocol, q: np.ndarray) -> np.ndarray:
    """Return (M, n, n): the motion of one agent without neighbours from 0 to the instants."""
    from scipy.integrate import solve_ivp
    from scipy.linalg import expm

    n, T = protocol.order, float(protocol.gain.T)
    A = np.eye(n, k=1)
    A[-1] = [-float(a) for a in protocol.plant]
    if not any(protocol.own):
        return np.array([expm(A * T * (1 - x)) for x in q.tolist()])
    own, gain = list(map(float, protocol.own)), protocol.gain

    def slope(tau: float, flat: np.ndarray) -> np.ndarray:
        rest = math.exp(-tau)
        R, X = T * rest, flat.reshape(n, n)
        eta = float(gain.value_at_remaining(rest))
        result = R * (A @ X)
        result[-1] -= sum(f * eta ** (n - i) * R * X[i] for i, f in enumerate(own))
        return result.ravel()

    tau = -np.log(q)
    run = solve_ivp(slope, (0.0, float(tau[-1])), np.eye(n).ravel(), "LSODA", t_eval=tau, rtol=1e-12, atol=1e-14)
    if not run.success:
        raise SimulationError("the common motion could not be integrated")
    return run.y.T.reshape(len(q), n, n)


def _input(
    graph: SignedDigraph, protocol: AgentsProtocol, deviations: np.ndarray, free: np.ndarray, eta: np.ndarray
) -> np.ndarray:
    """Return ``eta^n (K eps - f'y)``, (N, d, M), of deviations in the coordinates ``y`` and the common motion."""
    n, N = protocol.order, len(deviations)
    gains = np.array(np.broadcast_arrays(*protocol.gains_at(protocol.shrinking(eta))))
    own = np.array(list(map(float, protocol.own)))
    eps = -(graph.laplacian() @ deviations.reshape(N, -1)).reshape(deviations.shape)
    y = deviations + free / eta ** np.arange(n)[:, None]
    return eta**n * (
        np.einsum("im,kdim->kdm" if gains.ndim > 1 else "i,kdim->kdm", gains, eps) - np.einsum("i,kdim->kdm", own, y)
    )
