"""How followers track leaders that move: exactly at the deadline, and with a sign term ever after.

The target of the followers is ``X_F*(t) = -L_F^-1 L_FL X_L(t)``. With ``D_k u_k - sum_l |w_kl| u_l >= a u_k``, ``u >
0``, ``m = max_k |x_k - x_k*| / u_k``, ``p = a rho2 kappa`` and ``c = (speed + disturbance) / min u``

    m(t) <= e^(-a s(t)) m(0) + c (T - t) (1 - ((T - t)/T)^(p - 1)) / (p - 1)    before T,    m(T) = 0;

from ``T`` on ``m <= c / (a rho1)``. With the sign term the second part is left out, and ``m = 0`` from ``T`` on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from typing import Any

import numpy as np

from lmi.errors import LMIError, NoCertificate
from lmi.exact.decimal_rounding import float_up, up
from ptcc_certify.bounds.envelope import remaining_part
from ptcc_certify.bounds.float_conversion import floats, floats_up
from ptcc_certify.checker.leaders import LeadersAsked, LeadersSection
from ptcc_certify.checker.messages_asked import Moving
from ptcc_certify.checker.obligations import CheckReport
from ptcc_certify.checker.section_declarations import RowVector
from ptcc_certify.checker.side_files import Numbers
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.structure import Structure
from ptcc_certify.lyapunov.late_follower_rows import FollowerRows, RowWitness
from ptcc_certify.model.base import Protocol
from ptcc_certify.model.gain import Gain
from ptcc_certify.model.moving_leaders import MovingLeaders
from ptcc_certify.model.refusals import refuse_leader_groups
from ptcc_certify.theorems.theorem import Obligation

#: Losses of ``a`` that are tried for a more even ``u``; the share of the time that is left where they are compared.
_LOSSES, _JUDGED = (0.01, 0.2, 0.6), 0.05
#: What is added to a bound in floats, relatively, so that it holds.
_MORE = 1 + 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Tracking:
    """What is proved of followers of moving leaders.

    Attributes
    ----------
    leaders : MovingLeaders
    structure : Structure or Family
    protocol : Protocol
    witness : RowWitness
        ``u`` and, as its ``b``, ``a``.
    initial : Fraction
        ``m(0)`` from above.
    relative : bool
        Whether ``initial`` is that of all initial states within 1 of their targets.
    after : Fraction
        ``m`` from ``T`` on, from above.
    input : (N,) array or None
        What bounds ``|gain e_k|`` up to ``T``, with the sign term if there is one; None where nothing does.
    """

    leaders: MovingLeaders
    structure: Structure | Family
    protocol: Protocol
    witness: RowWitness
    initial: Fraction
    relative: bool
    after: Fraction = Fraction(0)
    input: np.ndarray | None = None

    def __repr__(self) -> str:
        return f"Tracking({self.leaders!r}: exact at T, within {up(self.distance_after, 2)} after it)"

    @property
    def pole(self) -> float:
        """``p = a rho2 kappa``: above 1 the input stays bounded."""
        return float(self.witness.b * self.protocol.gain.pole)

    @property
    def bounding_rho2(self) -> str:
        """A ``rho2`` of few digits with which ``p > 1``, so that the input stays bounded."""
        return up(1 / (self.witness.b * self.protocol.kappa) * Fraction(1001, 1000), 3)

    @property
    def drift(self) -> float:
        """``(speed + disturbance) / min u``; 0 with the sign term, which takes it up."""
        return 0.0 if self.leaders.sign_gain is not None else float(self.leaders.total) / float(self.witness.u.min())

    @property
    def distance_after(self) -> float:
        """What bounds ``|x_k - x_k*|`` of every follower from ``T`` on."""
        return float(self.after) * float(self.witness.u.max()) * _MORE

    def distance_bound(self, remaining: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return what bounds ``|x_k - x_k*|`` of followers where ``1 - t/T`` is ``remaining``, ``(F, M)`` floats.

        One number counts as an array of one; from ``T`` on :attr:`distance_after` bounds it.

        Raises
        ------
        ParameterError
            An instant is not from 0 to 1.
        """
        q, T = np.atleast_1d(remaining_part(remaining)), float(self.protocol.T)
        with np.errstate(divide="ignore", invalid="ignore"):
            clock = self.protocol.gain.clock_at_remaining(q)
        m = np.exp(-float(self.witness.b) * clock) * float(self.initial) + self.drift * T * _decayed(q, self.pole)
        return self.witness.u[:, None] * np.where(q > 0, m, 0.0) * _MORE


def _decayed(remaining: np.ndarray, p: float) -> np.ndarray:
    """Return ``int ((T - t)/(T - r))^p dr/T`` from 0 to ``t``, where ``1 - t/T`` is ``remaining``; 0 at ``T``."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(remaining > 0, (1 - remaining ** (p - 1)) / (p - 1) if p != 1 else -np.log(remaining), 0.0)
    return np.asarray(remaining * np.maximum(share, 0))


def drift_integral(gain: Gain, b: float, cap: Fraction | None, t: np.ndarray) -> np.ndarray:
    """Bound ``int_0^t e^(-b (s_c(t) - s_c(r))) dr`` at instants up to ``T``, in floats.

    Parameters
    ----------
    gain : Gain
    b : float
    cap : Fraction or None
        ``s_c`` is the integral of ``min(gain, cap)``; None: of the gain.
    t : (M,) array
        In units of time, up to ``T``.

    Returns
    -------
    (M,) array
        In units of time.

    Examples
    --------
    >>> gain = Gain(T=1, rho1=1, rho2=2, kappa=1)
    >>> drift_integral(gain, 1.0, Fraction(2), np.array([0, 1])).round(4)  # (1 - e^-2)/2
    array([0.    , 0.4323])
    """
    T, p = float(gain.T), b * float(gain.pole)
    turn = 0.0
    if cap is not None:
        turn = 1.0 if cap <= gain.first else float(gain.pole / (cap - gain.rho1) / gain.T)
    q = np.maximum(1 - t / T, 0)
    before = T * _decayed(np.maximum(q, turn), p)
    if cap is None:
        return before
    left = np.exp(-b * float(cap) * T * np.maximum(turn - q, 0))
    return np.asarray(before * left + (1 - left) / (b * float(cap)))


def bound_tracking(
    structure: Structure | Family,
    protocol: Protocol,
    leaders: MovingLeaders,
    initial_state: Sequence[Fraction] | None = None,
    ends: Sequence[tuple[Fraction, Fraction]] | None = None,
) -> Tracking:
    """Bound how followers track leaders that move.

    Parameters
    ----------
    structure : Structure or Family
        All leaders are single nodes; of a family bounds are for every signal.
    protocol : Protocol
        The nominal one.
    leaders : MovingLeaders
    initial_state : sequence of N Fraction, optional
    ends : sequence of N (middle, radius), optional
        Of ``Q X(0)``, the targets at first; without it ``initial`` is for all initial states within 1 of these.

    Raises
    ------
    HypothesisError
        A leader belongs to a group, so that it is not free to move.
    NoCertificate
        No vector for the followers was found.

    Examples
    --------
    >>> structure = analyse(SignedDigraph.from_edges([(1, 2, 1), (2, 3, -1)]))
    >>> tracking = bound_tracking(structure, NominalProtocol(T=1, rho1=1, rho2=4, kappa=1), MovingLeaders(speed=1))
    >>> tracking.distance_bound([1e-3, 0]).max(axis=0) < 2e-3
    array([ True,  True])
    """
    if isinstance(structure, Structure):
        refuse_leader_groups(structure, "leaders that move as they like: a bound")
    rows = FollowerRows(structure)
    given = None if initial_state is None or ends is None else zip(initial_state, ends, strict=True)
    every = None if given is None else np.array([float_up(abs(x - mid) + radius) for x, (mid, radius) in given])
    first = np.ones(rows.D.size) if every is None else every[rows.followers]
    found: list[Tracking] = []
    for loss in _LOSSES:
        with suppress(LMIError):
            bound = Tracking(leaders, structure, protocol, rows.witness(Fraction(1), loss), Fraction(0), every is None)
            found.append(_tracking(rows, bound, first))
    if not found:
        raise NoCertificate("no vector for the followers was found")
    return min(found, key=lambda one: (one.input is None, float(one.distance_bound(np.array([_JUDGED])).max())))


def _tracking(rows: FollowerRows, bound: Tracking, first: np.ndarray) -> Tracking:
    """Return what the vector of a bound proves."""
    witness, gain, leaders, sign = bound.witness, bound.protocol.gain, bound.leaders, bound.leaders.sign_gain
    initial = Fraction(float((first / witness.u).max()) * _MORE)
    c, p = leaders.total / Fraction(float(witness.u.min())), witness.b * gain.pole
    after = Fraction(0) if sign is not None else c / (witness.b * gain.rho1)
    whole = None
    if p > 1 or (sign is not None and p >= 1):
        most = gain.first * initial + (0 if sign is not None else c * (gain.rho1 * gain.T + gain.pole) / (p - 1))
        whole = np.zeros(rows.n_nodes)
        whole[rows.followers] = rows.largest(witness.u) * float_up(most) * _MORE + float(sign or 0)
        whole[rows.followers] *= _MORE
    return replace(bound, initial=initial, after=after, input=whole)


def tracking_obligations(tracking: Tracking | None) -> Iterator[Obligation]:
    """Yield what was proved of moving leaders."""
    if tracking is not None:
        witness = tracking.witness
        yield Obligation("tracking", "leaders", {"a": witness.b}, RowVector(u=Numbers(witness.u)))


def asked_leaders(leaders: MovingLeaders | None, kind: type[Moving] = LeadersAsked) -> Any:
    """Return how leaders move, as files have it in a section of this kind; None of leaders at rest."""
    return None if leaders is None else kind(**{one.name: getattr(leaders, one.name) for one in fields(kind)})


def read_leaders(section: Moving) -> MovingLeaders:
    """Return what a certificate says of how leaders move, in a section of any kind."""
    told = {one.name for one in fields(MovingLeaders)}
    return MovingLeaders(**{name: value for name, value in vars(section).items() if name in told})


def leaders_section(tracking: Tracking) -> LeadersSection:
    """Return what is proved with moving leaders, as files have it."""
    asked, bound = vars(asked_leaders(tracking.leaders)), None if tracking.input is None else Numbers(tracking.input)
    return LeadersSection(**asked, initial=tracking.initial, input=bound, after=tracking.after)


def read_tracking(
    report: CheckReport, structure: Structure | Family, protocol: Protocol, relative: bool
) -> Tracking | None:
    """Return what an accepted certificate says of moving leaders; None if it says nothing."""
    section: LeadersSection | None = report.sections.get("leaders")
    if section is None:
        return None
    step = report.proved["tracking", "leaders"]
    rows = RowWitness(Fraction(1), step["a"], floats(step["witness"].u))
    leaders, bound = read_leaders(section), floats_up(section.input)
    return Tracking(leaders, structure, protocol, rows, section.initial, relative, section.after, bound)
