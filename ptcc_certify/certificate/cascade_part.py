"""What a certificate says of double integrators of the cascade: where they end, bounds over time, and the input."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from lmi.exact.decimal_rounding import down, float_down, float_up, near, up
from ptcc_certify.bounds.agents.cascade import (
    Roots,
    Values,
    course,
    drive_integral,
    input_from,
    instant_roots,
    roots_of,
)
from ptcc_certify.bounds.agents.common_motion import LARGEST_DECAY, common_motion
from ptcc_certify.bounds.agents.each_agent import States, root_product
from ptcc_certify.bounds.agents.run_against_bounds import AgentsComparison, compare_with_bounds
from ptcc_certify.bounds.float_conversion import numbers
from ptcc_certify.bounds.instants import remaining_part
from ptcc_certify.certificate.agents_answer import AgentsAnswer, final_states, read, rows_of, use, written
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.checker.agent_cascade import CascadeSection, TrackedSection, input_is_bounded
from ptcc_certify.errors import Change, ParameterError, Sentence
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.function import LyapunovFunction
from ptcc_certify.model import Protocol
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.agents_protocol import CascadeProtocol
from ptcc_certify.simulation.agents import AgentsTrajectory
from ptcc_certify.theorems.theorem import Obligation


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class CascadePart(AgentsAnswer):
    """What is proved of double integrators of the cascade; see :class:`AgentsAnswer`.

    All functions that decay are used. Final states are of positions alone where velocities are not proved to vanish.

    Attributes
    ----------
    protocol : CascadeProtocol
    roots : tuple of Roots
        Of every function used; empty without an initial state.
    instants : tuple of tuples of Fraction or None
        Bounds of ``sqrt(V)`` of positions and of ``r``, of each function used.
    """

    protocol: CascadeProtocol
    roots: tuple[Roots, ...]

    @property
    def settles(self) -> bool:
        """Whether the behaviour of the claim is proved at ``T``, of positions less their places in a formation."""
        return self.structure.graph.n_edges == 0 or bool(self.functions)

    @property
    def alpha(self) -> Fraction:
        """``alpha``."""
        return self.protocol.alpha

    @property
    def rate(self) -> None:
        """There is none: what decays is driven by what decays at another rate."""
        return

    @property
    def best(self) -> Fraction:
        """The largest rate of a function used; 0 without one."""
        return max((V.proved_rate for V in self.functions), default=Fraction(0))

    @property
    def weighing_rate(self) -> float:
        """What decays most slowly, by the bounds."""
        slowest = 2 * (self.alpha + 1 / self.protocol.gain.pole)
        return float(min(self.best, slowest) if self.functions else slowest)

    @property
    def derivatives_agree(self) -> bool:
        """Whether velocities are proved to vanish at ``T``."""
        return not self.structure.graph.n_edges or self.best * self.protocol.gain.pole > 2

    @property
    def unbounded(self) -> tuple[tuple[str, Change], ...]:
        """What leaves the input without a bound, and what mends it; empty where nothing does."""
        k, best = self.protocol.gain.pole, self.best
        reasons = []
        if not self.functions or any(input_is_bounded(k, V.proved_rate, self.alpha) for V in self.functions):
            return ()
        if best * k < 4:
            rho2 = up(4 / (best * self.protocol.base.kappa), 4)
            reasons.append((f"rate {down(best)} is below 4/(rho2 kappa) = {up(4 / k, 4)}", Change("rho2", rho2)))
            k = Fraction(rho2) * self.protocol.base.kappa
        if not input_is_bounded(k, best, self.alpha):
            least = up(1 / k, 4)
            mend = least if input_is_bounded(k, best, Fraction(least)) else up(2 / k, 4)
            limit = f"below 1/(rho2 kappa) = {least}" if self.alpha * k < 1 else "just 1/(rho2 kappa), as is rate/4"
            reasons.append((f"cascade {down(self.alpha)} is {limit}", Change("cascade", mend)))
        return tuple(reasons)

    @property
    def bounding_rho2(self) -> Fraction | None:
        """Of the least ``rho2`` half as much again: just above that one the bound of the input is large."""
        if not self.unbounded:
            return None
        return Fraction(up(Fraction(3, 2) * max(4 / self.best, 1 / self.alpha) / self.protocol.base.kappa, 4))

    @property
    def nearer(self) -> Sentence:
        """What leaves less by ``T``."""
        return "a larger ", Change("rho2"), f", such as {up(2 * self.protocol.base.rho2, 4)}, leaves less"

    @property
    def in_place(self) -> bool:
        """Whether agents begin in agreement, at rest."""
        return not self.begins_moving and not any(x for root in self.roots for x in root)

    @property
    def gains_text(self) -> str:
        """``alpha``."""
        return f"alpha {near(self.alpha)}"

    @property
    def proof_text(self) -> tuple[str, str]:
        """What the long screen tells of gains and of the proof."""
        proof = "no Lyapunov function is used"
        if self.functions:
            proof = (
                f"sqrt V <= e^(-r s/2) sqrt V(x(0)) + I sqrt V(q(0)), r up to {down(self.best)}; q = x' - g e falls "
            )
            proof += f"like e^(-{near(self.alpha)} s)"
        return self.gains_text, proof

    @property
    def obligations(self) -> list[Obligation]:
        """What proves the decay: obligations with numbers or a witness."""
        return [Obligation("agent-cascade", "agents", {"alpha": self.alpha})]

    @property
    def section(self) -> CascadeSection:
        """The section ``agents``."""
        roots: list[tuple[Fraction | None, Fraction | None]] = [(root.state, root.drive) for root in self.roots]
        functions = [
            TrackedSection(function=one.number, inputs=numbers(one.inputs), initial=initial, drive=drive)
            for one, (initial, drive) in zip(self.used, roots or [(None, None)] * len(self.used), strict=True)
        ]
        return CascadeSection(cascade=self.alpha, functions=functions, **written(self))

    # ------------------------------------------------------------------ bounds over time

    def fall(self, remaining: float) -> float:
        """Return what deviations are of :attr:`first_ones` at most, in the norm of ``V``.

        Without an initial state, or from one in agreement, that is the larger of ``sqrt V(x(0))`` and
        ``sqrt V(q(0))/eta(0)``.
        """
        ones = [Roots(Fraction(1), self.protocol.gain.first)] * len(self.functions)
        roots = self.roots if any(root.state for root in self.roots) else ones
        q = np.atleast_1d(np.asarray(remaining, dtype=float))
        values = self._least_values(q) if roots is self.roots else self._values(roots, q)
        pairs = zip(values, roots, strict=True)
        return min((float(x[0]) / float_down(r.state) for x, r in pairs if r.state), default=1.0)

    @property
    def first_ones(self) -> str:
        """What :meth:`fall` is a share of."""
        own = any(root.state for root in self.roots)
        return "the first ones" if own else "the larger of the first ones and of q(0)/g(0)"

    def _values(self, roots: Sequence[Roots], q: np.ndarray) -> list[np.ndarray]:
        """Return bounds of ``sqrt(V)`` of every function used, from the beginning."""
        gain = self.protocol.gain
        clock, found = gain.clock_at_remaining(q), []
        for V, root in zip(self.functions, roots, strict=True):
            own = float_up(root.state) * np.exp(-float_down(V.proved_rate) / 2 * clock)
            own += float_up(root.drive) * drive_integral(gain, V.proved_rate, self.alpha, q)
            if root.combined is not None:
                own = np.minimum(own, course(gain, V.proved_rate, self.alpha, root, q).state)
            found.append(own)
        return found

    def _least_values(self, q: np.ndarray) -> list[np.ndarray]:
        """Return bounds of ``sqrt(V)`` of every function used, from the beginning and from instants."""
        begun = enumerate(self._values(self.roots, q))
        return [np.minimum(own, self._from_instants(number, q)[0]) for number, own in begun]

    def _from_instants(self, number: int, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return bounds of ``S`` and of ``R + g S`` of a function used, each from the last instant that tells of it."""
        V, state, speed = self.functions[number], np.full(len(q), np.inf), np.full(len(q), np.inf)
        known = dict[float, Roots]()
        for i, row in enumerate(self.instants, start=1):
            S, R = row[2 * number : 2 * number + 2]
            if S is not None and R is not None:
                known[2.0**-i] = Roots(S, Fraction(0), R)
        ends = [*known, 0.0][1:]
        for (begin, roots), end in zip(known.items(), ends, strict=True):
            if (late := (q <= begin) & (q > end)).any():
                own = course(self.protocol.gain, V.proved_rate, self.alpha, roots, q[late], begin)
                state[late], speed[late] = own.state, own.combined + own.pull * own.state
        return state, speed

    def deviation_bound(self, remaining: np.ndarray) -> np.ndarray:
        """Return (N, 2, M) bounds of the deviation of positions and velocities from the common motion.

        Of positions ``sqrt(c_k V)``. Of velocities the least of ``eta sqrt(c_k^E V) + e^(-alpha s) sqrt(c_k V(q(0)))``
        and what the course of ``r`` tells, by each function. Infinite where nothing is proved, or without an initial
        state.
        """
        q = np.atleast_1d(remaining_part(remaining))
        if not self.roots:
            return np.full((self.structure.graph.n_nodes, 2, len(q)), np.inf)
        N, gain = self.structure.graph.n_nodes, self.protocol.gain
        near, fast, errors, drive, integral, begin = (np.full((N, len(q)), np.inf) for _ in range(6))
        fading = np.exp(-float_down(self.alpha) * gain.clock_at_remaining(q))
        each = zip(self.functions, self.roots, self._values(self.roots, q), self.error_constants, strict=True)
        for number, (V, root, from_start, constants) in enumerate(each):
            curve = course(gain, V.proved_rate, self.alpha, root, q)
            state, later = self._from_instants(number, q)
            value = np.minimum(from_start, state)
            if V.deviation is not None:
                c = np.array([float_up(root_product(x)) for x in V.deviation.agents])
                near = np.minimum(near, np.outer(c, value))
                fast = np.minimum(fast, np.outer(c, np.minimum(curve.combined + curve.pull * curve.state, later)))
                drive = np.minimum(drive, np.outer(c, float_up(root.drive) * fading))
                begin = np.minimum(begin, np.outer(c, float_up(root.velocity or Fraction(0)) * fading))
            if constants is not None:
                c = np.array([float_up(root_product(x)) for x in constants])
                errors = np.minimum(errors, np.outer(c, value))
                integral = np.minimum(integral, np.outer(c, curve.integral))
        eta = np.array([self.protocol.value(x) for x in q])
        speeds = np.min([eta * fast, eta * errors + drive, eta * integral + begin], axis=0)
        return np.stack([near, speeds], axis=1) * (1 + 1e-9)

    def compare(self, run: AgentsTrajectory) -> AgentsComparison | None:
        """Compare a run with what is proved of it; None where nothing disagrees."""
        if not any(x for root in self.roots for x in root):
            return None
        return compare_with_bounds(
            self.structure, self.functions, self._least_values, self.deviation_bound, self.input, run
        )

    @property
    def _summary(self) -> str:
        return f"alpha = {near(self.alpha)}"


def prove_cascade(
    proof: GraphProof,
    base: Protocol,
    agents: Agents,
    offsets: Sequence[Sequence[Fraction]],
    initial_state: States | None,
) -> CascadePart:
    """Prove what double integrators of the cascade do, by the Lyapunov functions of their graph.

    Parameters
    ----------
    proof : GraphProof
        Of the graph; its Lyapunov functions are used.
    base : Protocol
        Gain, clock and deadline.
    agents : Agents
        With ``cascade``.
    offsets : N rows of d Fraction
    initial_state : N tuples of d tuples of 2 Fraction, or None

    Raises
    ------
    ParameterError
        ``alpha rho1 T`` is beyond what the common motion is enclosed for.
    """
    falls = base.gain.rho1 * base.gain.T
    if agents.alpha * falls > LARGEST_DECAY:
        raise ParameterError(
            "cascade",
            f"= {near(agents.alpha)} is too large to enclose the common motion: beyond "
            f"{LARGEST_DECAY}/(rho1 T); take at most {down(LARGEST_DECAY / falls, 4)}",
        )
    fields = use(proof.structure, proof.functions, [k for k, V in enumerate(proof.functions) if V.proved_rate > 0])
    protocol = CascadeProtocol.of(base, agents.alpha, offsets)
    roots: tuple[Roots, ...] = ()
    if initial_state is not None:
        roots = roots_of(proof.structure, protocol, fields["functions"], initial_state)
    motion = common_motion(agents.coefficients, agents.own, base.gain)
    part = CascadePart(protocol=protocol, roots=roots, initial_state=initial_state, motion=motion, **fields)
    final = None
    if initial_state is not None and part.settles:
        final = final_states(part, proof.influence)
        if final is not None and not part.derivatives_agree:
            final = tuple(tuple(chain[:1] for chain in agent) for agent in final)
    instants: tuple[Values, ...] = ()
    if initial_state is not None and any(root.state or root.drive for root in roots):
        instants = instant_roots(proof.structure, protocol, part.functions, initial_state)
    return replace(part, final_state=final, input=_input(part), instants=instants)


def _input(part: CascadePart) -> tuple[Fraction, ...] | None:
    """Return the least bounds of the whole input, agent by agent; None where none is proved."""
    gain, begin = part.protocol.gain, part.initial_state
    if begin is None:
        return None
    speeds = [root_product(sum((chain[1] ** 2 for chain in agent), Fraction(0))) for agent in begin]
    bounds = [
        input_from(gain, part.alpha, V.proved_rate, constants, root.state, root.combined or Fraction(0), speeds)
        for V, constants, root in zip(part.functions, part.error_constants, part.roots, strict=True)
        if constants is not None and input_is_bounded(gain.pole, V.proved_rate, part.alpha)
    ]
    if not bounds:
        return None
    return tuple(min(each) + part.sliding_terms for each in zip(*bounds, strict=True))


def read_cascade(
    section: CascadeSection, structure: Structure, base: Protocol, functions: Sequence[LyapunovFunction]
) -> CascadePart:
    """Return what an accepted certificate says of the cascade."""
    fields, roots = read(section, structure, functions), tuple[Roots, ...]()
    protocol = CascadeProtocol.of(base, section.cascade, rows_of(section.offsets))
    if (begin := fields["initial_state"]) is not None:
        pairs = zip(section.functions, roots_of(structure, protocol, fields["functions"], begin), strict=True)
        roots = tuple(Roots(one.initial or Fraction(0), one.drive or Fraction(0), *root[2:]) for one, root in pairs)
    return CascadePart(protocol=protocol, roots=roots, **fields)
