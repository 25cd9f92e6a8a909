"""Facts of sliding variables: where they begin, and when they are certainly 0."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from lmi.exact.decimal_rounding import down, up
from lmi.exact.elementary_enclosures import LARGEST_PUSH
from ptcc_certify.certificate.fact import Fact, Facts
from ptcc_certify.errors import labelled
from ptcc_certify.report.text_layout import shorten_list, value_list

if TYPE_CHECKING:
    from ptcc_certify.model.base import ReachingProtocol
    from ptcc_certify.model.reaching_time import ReachingTime


def sliding_facts(
    labels: Sequence[str],
    protocol: ReachingProtocol | None,
    sigma0: Sequence[Fraction] | None,
    reaching: Sequence[ReachingTime] | None,
) -> Facts:
    """Tell ``sigma(0)``, and the last proved reaching time; nothing under the nominal protocol.

    Examples
    --------
    >>> from ptcc_certify.model.reaching_time import ReachingTime
    >>> p = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    >>> print(next(sliding_facts(["a"], p, [Fraction(0)], [ReachingTime(p.T_r, Fraction(0))])).text)
    0: no reaching phase, the agents slide from the beginning
    """
    if protocol is None or reaching is None or sigma0 is None:
        return
    if not any(sigma0):
        yield Fact(head="sigma(0)", note="0: no reaching phase, the agents slide from the beginning", detail=True)
        return
    values = dict(zip(labels, sigma0, strict=True))
    yield Fact(head="sigma(0)", value=values, note=value_list(labels, sigma0), detail=True)
    late = [labelled(label) for label, r in zip(labels, reaching, strict=True) if r.z is None]
    last = max((r for r in reaching if r.z is not None), key=lambda r: r.z or 0, default=None)
    clauses = []
    if last is not None and last.z:
        agent = labelled(labels[list(reaching).index(last)])
        margin = f"{down(last.remaining, 3)} before T_r" if last.remaining else "nearer to T_r than a float tells"
        others = " of others" if late else ""
        clauses.append(f"reaching time{others} at most {up(last.time, 6)}, {margin} (agent {agent})")
    if late:
        pole, push = protocol.mu3 * protocol.kappa, protocol.mu2 * protocol.T_r
        why = "0 is reached nearer to T_r than can be written"
        if pole < 1:
            why = "mu3 kappa < 1 and sigma(0) is large"
        if push + pole > LARGEST_PUSH:
            why = f"mu2 T_r + mu3 kappa is above {LARGEST_PUSH}, where no earlier instant is proved"
        clauses.append(f"reaching time T_r for {shorten_list(late, 40)}: {why}")
    value = None if last is None else last.time
    yield Fact(head="sliding", value=value, side="up", note="; ".join(clauses), detail=True)
