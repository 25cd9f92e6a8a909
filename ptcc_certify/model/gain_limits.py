"""Limits of the gain: a cap, switch-off before the deadline, zero-order hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from ptcc_certify.checker.input_formulas import Limits
from ptcc_certify.errors import gated
from ptcc_certify.graphs.declared_option import option
from ptcc_certify.model.parameters import Given, Parameters

if TYPE_CHECKING:
    from ptcc_certify.model.gain import Gain
    from ptcc_certify.model.limited_gain import LimitedGain


@gated
@dataclass(frozen=True, repr=False)
class GainLimits(Parameters, Limits):
    """What an actuator leaves of a gain: a cap, switch-off, zero-order hold; None for what it does not.

    Parameters
    ----------
    gain_cap : int, float, str or Fraction, optional
        Positive: the gain is at most this; 1/time/weight.
    stop_before : int, float, str or Fraction, optional
        Positive and below ``T``, in units of time: the input is 0 from ``T - stop_before`` on, for ever.
    sample_period : int, float, str or Fraction, optional
        Positive, in units of time: gain and input change at its multiples only, and at ``T - stop_before`` or ``T``.

    Raises
    ------
    ParameterError
        Names the parameter, its value and its domain.

    References
    ----------
    These limit the gain of the protocol (4) of [Zhu]_.

    Examples
    --------
    >>> from ptcc_certify.model.gain import Gain
    >>> limits = GainLimits(gain_cap=11, stop_before="0.01")
    >>> limits
    GainLimits(gain_cap=11, stop_before=1/100)
    >>> limits.limit(Gain(T=1, rho1=1, rho2=1, kappa=1)).value([0, 0.9, 0.95, 0.99])
    array([ 2., 11., 11.,  0.])
    """

    section: ClassVar = "limits"
    gain_cap: Given = option("--gain-cap G", "Nominal: the gain is at most G.", Given(), example="100")
    stop_before: Given = option(
        "--stop-before EPS", "Nominal: the input is 0 from T - EPS on.", Given(), example="0.01", unit="time"
    )
    sample_period: Given = option(
        "--sample-period H", "Nominal: gain and input are held over periods H.", Given(), example="0.001", unit="time"
    )

    @property
    def ideal(self) -> bool:
        """Whether it limits nothing."""
        return not self.parameters

    def limit(self, gain: Gain) -> LimitedGain:
        """Return what these limits leave of a gain.

        Parameters
        ----------
        gain : Gain
            Of the protocol.

        Returns
        -------
        LimitedGain

        Raises
        ------
        ParameterError
            ``stop_before`` is not below ``T``, or a limit acts only where ``1 - t/T`` is below 1e-300.
        """
        from ptcc_certify.model.limited_gain import LimitedGain

        return LimitedGain(gain, self)
