"""What was asked for that the law, as it is displayed, leaves out."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lmi.exact.decimal_rounding import near
from ptcc_certify.checker.input_formulas import Limits
from ptcc_certify.report.facts.claim import asked_messages
from ptcc_certify.report.facts.input import limits_text
from ptcc_certify.report.facts.late import leaders_text

if TYPE_CHECKING:
    from ptcc_certify.certificate.certificate import Certificate


def beside_law(certificate: Certificate) -> list[str]:
    """Tell in sentences what was asked for that the displayed law leaves out: limits, late values, moving leaders."""
    messages, leaders, told = asked_messages(certificate), certificate.proof.asked_leaders, list[str]()
    limits = list(certificate.limits)
    if messages is not None:
        if messages.age > 0:
            whose = "and the own value" if messages.own_delay else "but not the own value"
            told.append(
                f"Here nothing is late; with late messages what is heard, {whose}, is up to {near(messages.age)} old."
            )
        if messages.value_error > 0:
            off = f"with inexact ones what is heard is off by up to {near(messages.value_error)}"
            told.append(f"Here messages are exact; {off}.")
        if messages.gain_cap is not None and messages.vehicles is None and not limits:
            limits = [Limits(gain_cap=messages.gain_cap)]
    if leaders is not None and not leaders.idle:
        rest = "leaders are at rest; of those that move was asked:"
        driven = "; followers then move by x_k' = u_k + d_k" if leaders.disturbance > 0 else ""
        what = rest if leaders.speed else "nothing disturbs; asked was:"
        what = "nothing is clipped; asked was:" if leaders.clipped else "f = 0; asked was:" if leaders.growth else what
        text = leaders_text(leaders).removeprefix("at rest; ")
        if certificate.proof.late is not None and certificate.proof.late.forms:  # of agents that all follow each other
            text, driven = (words.replace("followers", "agents") for words in (text, driven))
        told.append(f"Here {what} {text}{driven}.")
    if certificate.noise is not None:
        told.append(f"With noise e_k is that of x + n, any |n_k| <= {near(certificate.noise)}.")
    if limits:
        each = "; or ".join(dict.fromkeys(map(limits_text, limits)))
        told.append(f"Where limits are named, the gain g is limited: {each}.")
    return told
