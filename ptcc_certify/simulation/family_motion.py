"""The agents of a family of graphs, moved by CasADi's CVODES along stretches of the clock on which one member acts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.simulation.cvodes import Motion, Phase, Tolerances
from ptcc_certify.simulation.family_members import Choice, Members

if TYPE_CHECKING:
    import casadi as ca

# Beyond this product of in-weights and the stretch of the clock implicit steps are cheaper.
_STIFF = 10.0


class FamilyMotion(Motion):
    """The agents of a family, moved by the members that a signal chooses.

    Parameters
    ----------
    members : Members
    state : (N, 1) array
        In units of ``unit``.
    tolerances : Tolerances
    """

    def __init__(self, members: Members, state: np.ndarray, tolerances: Tolerances):
        import casadi as ca

        super().__init__(members.family.modes[0].mandatory, state, 1, tolerances)
        self.members, self.in_weight, n = members, members.in_weight, len(state)
        self._largest = float(self.in_weight.max(initial=0.0))
        self._pattern = ca.Sparsity(n, n, members.indptr.tolist(), members.indices.tolist())
        self._parameters = self._weights = ca.MX.sym("weights", members.indices.size)
        self._steps: dict[bool, Any] = {}
        self._data = np.zeros(members.indices.size)

    def choose(self, choice: Choice) -> None:
        """Let a member act from now on."""
        self._data = self.members.data(choice)

    def slope(self, x: ca.MX, phase: Phase, clock: ca.MX, ends: tuple[float, float]) -> ca.MX:
        """Return ``dX/dz`` on a stretch of length 1; its true length is a factor of the weights."""
        import casadi as ca

        return -ca.mtimes(ca.MX(self._pattern, self._weights), x)

    def move(self, span: float) -> None:
        """Move on by a stretch of the clock."""
        if span <= 0 or not self._largest:
            return
        stiffness = span * self._largest
        self.state = self._call(self._step(stiffness > _STIFF), stiffness, self._values(span))[0]

    def agents(self) -> np.ndarray:
        """Return the (N,) state of the agents."""
        return self.state[:, 0]

    def _values(self, span: float) -> list[float]:
        """Return the parameters of the integrator."""
        return (self._data * span).tolist()

    def _step(self, stiff: bool) -> Any:
        """Return CVODES for stretches of length 1, with implicit steps if they are stiff."""
        import casadi as ca

        if stiff not in self._steps:
            x, clock = ca.MX.sym("x", self.state.size), ca.MX.sym("z")
            ode = self.slope(x, Phase(0, 1, 1, past=True), clock, (0.0, 1.0))
            problem = {"x": x, "t": clock, "p": self._parameters, "ode": ode}
            explicit = {"linear_multistep_method": "adams", "nonlinear_solver_iteration": "functional"}
            self._steps[stiff] = self._integrator(problem, 0.0, np.ones(1), **({} if stiff else explicit))
        return self._steps[stiff]
