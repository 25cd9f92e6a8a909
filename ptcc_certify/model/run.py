"""How a run is integrated: at which instants, how accurately, and what is random in it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar

from ptcc_certify.errors import gated
from ptcc_certify.graphs.option import option
from ptcc_certify.graphs.rationals import Exact

#: How old is what agents hear in a run with late messages.
PATTERNS = ("oldest", "fresh", "varying", "square")
#: How far past the deadline a run goes on, as a share of it.
PAST = 0.25


@gated
@dataclass(frozen=True, kw_only=True)
class Run:
    """How a run is integrated.

    Parameters
    ----------
    times : increasing numbers >= 0, optional
        The instants wanted, in units of time. One that a float cannot tell from ``T`` counts as ``T``.
    remaining : float
        Without ``times``: instants uniform in ``tau`` go from ``1 - t/T = 1`` to this; dimensionless.
    samples : int
        Without ``times``: so many of these instants and half as many uniform in t (with ``rho2 = 0``: so many uniform
        in t over [0, T]), and 0.5 T, 0.9 T, 0.99 T, T.
    past : float
        Without ``times``: go on to ``T (1 + past)``; dimensionless.
    rtol, atol : float
        Tolerances of CVODES; ``atol`` is relative to the largest entry of each column of ``x0``, or to ``delta T`` or
        the bound of the noise under the nominal protocol if that is larger.
    boundary_layer : float, optional
        Sliding mode, for comparison only: integrate ``tanh(sigma/boundary_layer)`` instead of the sign.
    pattern : {"oldest", "fresh", "varying", "square"}
        With late messages: how old is what agents hear.
    seed : int
        Of what is random in ``pattern``.

    Examples
    --------
    >>> Run(times=[0, 1]).samples
    201
    """

    section: ClassVar = "simulation"
    times: Iterable[Exact] | None = None
    remaining: float = 1e-8
    samples: int = option(
        "--samples", "Instants up to T, dense towards it.", default=201, example="201", least=2, most=100_000
    )
    past: float = PAST
    rtol: float = 1e-11
    atol: float = 1e-11
    boundary_layer: Any = option(
        "--boundary-layer W", "Sliding mode: tanh(sigma/W) for the sign, to compare.", example="0.01", kind="float"
    )
    pattern: Any = option(
        "--pattern",
        "With late messages: as old as allowed, fresh, between the two, or now this, now that (with --seed).",
        default="oldest",
        name="age_pattern",
        example='"oldest"',
        choices=PATTERNS,
    )
    seed: int = option(
        "--seed", "Seed of random initial states.", default=0, key="initial_state.seed", example="0", least=0
    )
