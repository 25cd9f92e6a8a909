"""Where the agents begin: their states, sliding variables, velocities and so on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ptcc_certify.errors import gated
from ptcc_certify.graphs.declared_option import option


@gated
@dataclass(frozen=True)
class InitialState:
    """Where the agents begin, where their states alone do not tell it.

    Parameters
    ----------
    x0 : state-like, optional
        The initial state, in node order, or by label where there are labels: whatever :func:`ptcc_certify.as_state`
        takes; of agents of order n N rows of coordinates, too.
    sigma0 : state-like, optional
        Sliding mode: ``sigma(0)``, like ``x0``; without it 0, which leaves no reaching phase.
    v0 : state-like, optional
        Of agents of order n: initial velocities, like ``x0``; without them 0.
    derivatives : sequence of state-like, optional
        Instead of ``v0``: velocities, accelerations and so on.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> robust = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    >>> certify(pair, robust, InitialState([3, 5], sigma0=[1, 0])).final_state
    FinalState(1=-1.5, 2=1.5)
    """

    section: ClassVar = "initial_state"
    x0: Any = option("--x0 STATE", "Initial state: 5,2,-4 | label=value,... | FILE.csv | random", example='"random"')
    sigma0: Any = option(
        "--sigma0 STATE", "Sliding mode: like --x0; 0 leaves no reaching phase.", example="0", shown="0"
    )
    v0: Any = option("--v0 STATE", "Agents: initial velocities, like --x0.", key="agents.v0", example='"0"', shown="0")
    derivatives: Any = None
