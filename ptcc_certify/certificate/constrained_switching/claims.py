"""Claims about restricted signals, and what each says of a component."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS
from ptcc_certify.model.constrained_switching import ClockShares, JointWindows, SignalClass
from ptcc_certify.theorems.contractions import ExplicitRate

if TYPE_CHECKING:  # classes of signals are told without the solvers
    from ptcc_certify.bounds.final_state.constant_weights import ValueEnds
    from ptcc_certify.checker.reading import Interval
    from ptcc_certify.lyapunov.mode_forms import ModeForms, ShareForm


@dataclass(frozen=True, eq=False)
class RateClaim:
    """A decay rate of one component for restricted signals.

    Let ``V`` be ``xi' P_i xi`` with the form of the present mode. For constant signals ``V <= e^(-rate s) V(0)``. Under
    a dwell time in ``t``, ``V <= ratio^n e^(-rate s) V(0)`` after ``n`` switches; under one on the clock,
    ``V <= ratio e^(-rate s) V(0)``.

    Attributes
    ----------
    component : int
        Its number.
    signal : "constant" or DwellTime
    forms : ModeForms or None
        None: the functions for every signal have this rate.
    rate : Fraction
        Per unit of the stretched clock.
    bounded : bool
        Whether the rate times ``rho2 kappa`` is at least 2: then the input is bounded for all these signals.
    """

    component: int
    signal: SignalClass
    forms: ModeForms | None
    rate: Fraction
    bounded: bool

    @property
    def ratio(self) -> Fraction:
        """The factor of ``V`` at a switch, at most; 1 for constant signals."""
        return Fraction(1) if self.forms is None or self.signal == "constant" else self.forms.ratio


@dataclass(frozen=True, eq=False)
class LastModeClaim:
    """Where the agents of a component without common states at rest end: where the last mode before ``T`` leads them.

    Attributes
    ----------
    component : int
        Its number.
    signal : "constant" or DwellTime
        The latter in ``t``: finitely many switches.
    behaviours : tuple of str or None
        Of each mode; None where agents need not come to rest as long as its weights move.
    final_states : tuple of (Fraction, Fraction), or None
        Of each node of the component: the ends between which it stays at all times.
    """

    component: int
    signal: SignalClass
    behaviours: tuple[str | None, ...]
    final_states: tuple[Interval, ...] | None


@dataclass(frozen=True, eq=False)
class WindowClaim:
    """What joint windows do to a component without common states at rest.

    Attributes
    ----------
    component : int
        Its number.
    signal : JointWindows
    behaviour : "stability" or "bipartite consensus"
    rate : ExplicitRate
        The contraction in as many windows as there are nodes, or one less.
    final_states : tuple of (Fraction, Fraction), or None
        Of each node of the component.
    """

    component: int
    signal: JointWindows
    behaviour: str
    rate: ExplicitRate
    final_states: tuple[Interval, ...] | None

    @property
    def behaviours(self) -> tuple[str | None, ...]:
        """What they show: one behaviour."""
        return (self.behaviour,)


@dataclass(frozen=True, eq=False)
class ShareClaim:
    """A decay rate of one component whose modes have shares of the clock, whether or not they rest at the same states.

    Attributes
    ----------
    component : int
        Its number.
    signal : ClockShares
    form : ShareForm
    rate : Fraction
        The mean of the rates over the shares, per unit of the stretched clock.
    final_states : tuple of (Fraction, Fraction), or None
        Of each node of the component; None without an initial state, where nothing decays, and where every signal has
        final states.
    mean : tuple of Fraction, or None
        ``q`` of each node of the component, if every signal keeps ``q' X`` and the final states follow from that.
    """

    component: int
    signal: ClockShares
    form: ShareForm
    rate: Fraction
    final_states: tuple[Interval, ...] | None = None
    mean: tuple[Fraction, ...] | None = None

    @property
    def behaviours(self) -> tuple[str | None, ...]:
        """What they show: one behaviour, or None."""
        return (self.behaviour,)

    @property
    def behaviour(self) -> str | None:
        """What the component does under these signals; None if nothing decays."""
        return self.form.behaviour if self.rate > 0 else None


@dataclass(frozen=True, eq=False)
class FinalValueClaim:
    """Where the agents of a component end if mode and weights never change: each mode has ends of its own.

    Attributes
    ----------
    component : int
        Its number.
    values : tuple of ValueEnds or None
        Of each mode; None where it does not come to bipartite consensus.
    """

    component: int
    values: tuple[ValueEnds | None, ...]
    signal: SignalClass = "constant"

    @property
    def behaviours(self) -> tuple[str | None, ...]:
        """Bipartite consensus of each mode that comes to it; None of the others."""
        return tuple(None if ends is None else BIPARTITE_CONSENSUS for ends in self.values)

    @property
    def final_states(self) -> tuple[Interval, ...] | None:
        """Of each node of the component the ends over all modes; None if some mode has none."""
        each = [ends.final_states for ends in self.values if ends is not None]
        if len(each) < len(self.values):
            return None
        return tuple((min(low for low, _ in one), max(high for _, high in one)) for one in zip(*each, strict=True))


Claim = RateClaim | LastModeClaim | WindowClaim | ShareClaim | FinalValueClaim
