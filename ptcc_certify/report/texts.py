"""Numbers, labels and words of a report, as HTML; numbers that were proved are rounded to the safe side.

Texts of the file are escaped here, whatever they hold.
"""

from __future__ import annotations

import html
import re
from collections import Counter
from collections.abc import Sequence
from decimal import Decimal, localcontext
from fractions import Fraction

from lmi.exact.rounding import down, up
from ptcc_certify.bounds.input import Limited, Starts
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.graphs.rationals import format_exact, nearest_float, writable
from ptcc_certify.graphs.structure import ClosedComponent
from ptcc_certify.protocols import Protocol
from ptcc_certify.theorems.claims import Claim

#: Labels of a list that are written out, and characters of a label.
LISTED, CHARACTERS = 30, 48
AUTHORS = "Zhen-Hua Zhu, Huaiyu Wu, Zhi-Hong Guan, Zhi-Wei Liu, Yang Chen, Xiujuan Zheng"
TITLE = "Robust prescribed-time coordination control of cooperative-antagonistic networks with disturbances"

_MINUS = "\N{MINUS SIGN}"

# ---------------------------------------------------------------------- texts of the file


def printable(text: str, limit: int = CHARACTERS) -> str:
    """Return a text of the file fit to be shown: cut, and what is not printable written as its code."""
    cut = text if len(text) <= limit else text[: limit - 1] + "\N{HORIZONTAL ELLIPSIS}"
    return "".join(c if c.isprintable() else f"\\u{{{ord(c):x}}}" for c in cut)


def escaped(text: str, limit: int = 2000) -> str:
    """Return a text of the file as HTML."""
    return html.escape(printable(text, limit))


def label_html(text: str) -> str:
    """Return a label; ``bdi`` keeps its direction of writing to itself."""
    return f"<bdi>{escaped(text, CHARACTERS)}</bdi>"


def labels_html(labels: Sequence[str]) -> str:
    """Return up to 30 labels, and how many more there are."""
    more = f" and {len(labels) - LISTED:,} more" if len(labels) > LISTED else ""
    return ", ".join(map(label_html, labels[:LISTED])) + more


# ---------------------------------------------------------------------- numbers


def plural(number: int, what: str) -> str:
    """Return a number of things: ``1 agent``, ``2 agents``."""
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def rational(x: Fraction) -> str:
    """Write a rational: as a decimal or a quotient if that is short, else with six digits, marked as near."""
    left = x.denominator
    for prime in (2, 5):
        while left % prime == 0:
            left //= prime
    if left == 1 and writable(x):
        with localcontext(prec=5000):
            text = f"{Decimal(x.numerator) / Decimal(x.denominator):f}"
        if len(text) <= 12:
            return text.replace("-", _MINUS)
    if writable(x) and len(text := format_exact(x)) <= 14:
        return text.replace("-", _MINUS)
    return _near(x)


def _near(x: Fraction) -> str:
    if abs(x) > 10**300:
        return "beyond 10<sup>300</sup>" if x > 0 else f"beyond {_MINUS}10<sup>300</sup>"
    return f"\N{ALMOST EQUAL TO} {power(f'{nearest_float(x):.6g}')}"


def power(text: str) -> str:
    """Write ``3e-07`` as a product with a power of ten, and a true minus sign."""
    mantissa, _, exponent = text.partition("e")
    product = f"{mantissa} \u00d7 10<sup>{int(exponent)}</sup>" if exponent else mantissa
    return product.replace("-", _MINUS)


def above(x: Fraction | float, digits: int = 4) -> str:
    """Write a positive number, rounded up."""
    return power(up(x, digits))


def below(x: Fraction | float, digits: int = 6) -> str:
    """Write a positive number, rounded down."""
    return power(down(x, digits))


def enclosed(value: tuple[Fraction, Fraction]) -> str:
    """Write a proved interval: exactly, or a decimal with a radius that takes its rounding in."""
    middle, radius = value
    if radius == 0:
        text = rational(middle)
        return f"{_near(middle)} ({text})" if "/" in text else text
    text = f"{nearest_float(middle):.9g}"
    if "inf" in text:
        return _near(middle)
    return f"{power(text)} \u00b1 {above(radius + abs(middle - Fraction(text)), 2)}"


def subscripts(text: str) -> str:
    """Set ``T_r`` and ``T_s`` with subscripts."""
    return re.sub(r"T_([rs])\b", r"T<sub>\1</sub>", text)


# ---------------------------------------------------------------------- words


def coordinates(saved: Certificate) -> str:
    """Return the letter of what decays: the error, or the deviation from the weighted signed mean."""
    return "E" if saved.envelope.coordinates == "E" else "\u03b5"


def parameter_names(protocol: Protocol) -> list[str]:
    """Return the names of a protocol's parameters, in their order."""
    return [name for name in protocol.to_dict() if name != "kind"]


def claim_text(claim: Claim) -> str:
    """Say what is claimed, and by which corollaries."""
    special = f", {', '.join(claim.special)}" if claim.special else ""
    number = "Corollary" if len(claim.corollaries) == 1 else "Corollaries"
    by = f" ({number} {', '.join(claim.corollaries)})" if claim.corollaries else ""
    return f"{claim.behaviour.capitalize()}{special}{by}"


def agent_parts(saved: Certificate) -> list[str]:
    """Say of every agent which part of the graph it is in."""
    parts = ["follower"] * saved.graph.n_nodes
    groups = saved.structure.closed_components
    for k, component in enumerate(groups, start=1):
        name = f"leader of group {k}" if len(groups) > 1 else "leader"
        for v, sign in zip(component.nodes, component.gauge or [0] * len(component.nodes), strict=True):
            parts[v] = name + {1: ", camp 1", -1: ", camp 2", 0: ", unbalanced"}[sign]
    return parts


def balance_text(component: ClosedComponent, labels: Sequence[str]) -> str:
    """Say how a leader group splits, or why it does not."""
    if component.negative_cycle is not None:
        cycle = component.negative_cycle[:LISTED]
        steps = ", ".join(f"{label_html(labels[s])} \u2192 {label_html(labels[t])}" for s, t in cycle)
        return f"unbalanced; negative cycle {steps}{', ...' if len(component.negative_cycle) > LISTED else ''}"
    camps = [
        [labels[v] for v, g in zip(component.nodes, component.gauge or (), strict=True) if g == sign]
        for sign in (1, -1)
    ]
    said = " against ".join(f"{{{labels_html(camp)}}}" for camp in camps if camp)
    return f"balanced; {'camps' if camps[1] else 'one camp'} {said}"


def kinds_text(saved: Certificate) -> str:
    """Count the Lyapunov functions by their class."""
    names = {"paper": "the article's", "perron": "Perron vectors", "lmi": "best diagonal", "full": "full matrices"}
    counted = Counter(m.kind for m in saved.envelope.members)
    return ", ".join(f"{count} {names[kind]}" for kind, count in counted.items())


def common_bound(starts: Starts) -> Fraction | None:
    """Return ``R`` of a set that is all starts with ``|x_k(0)| <= R``; None of another one."""
    same = len(set(starts.radius)) == 1 and not any(starts.center) and not starts.axes
    return starts.radius[0] if same else None


def limits_text(entry: Limited) -> str:
    """Name limits of the gain."""
    limits = entry.limits
    said = [f"gain \u2264 {rational(limits.gain_cap)}"] if limits.gain_cap is not None else []
    said += [f"input 0 from T \u2212 {rational(limits.stop_before)} on"] if limits.stop_before is not None else []
    said += [f"input held for {rational(limits.sample_period)}"] if limits.sample_period is not None else []
    return ", ".join(said)


def limited_text(entry: Limited) -> str:
    """Say what is proved under limits of the gain, and under noise with them."""
    said = [f"\u2016E(T)\u2016 \u2264 {above(entry.norm, 3)}"]
    said += [f"every agent within {above(max(entry.agents), 3)} of its outcome"] if entry.agents is not None else []
    said += [f"|u<sub>k</sub>| \u2264 {above(entry.largest)}"] if entry.largest is not None else []
    if entry.noise is not None and entry.noisy_norm is not None and entry.noisy_largest is not None:
        said.append(
            f"with noise |n<sub>k</sub>| \u2264 {rational(entry.noise)}: "
            f"\u2016E(T)\u2016 \u2264 {above(entry.noisy_norm, 3)}, "
            f"|u<sub>k</sub>| \u2264 {above(entry.noisy_largest)}"
        )
    return "; ".join(said)


def caveats(saved: Certificate, no_run: str) -> list[str]:
    """Say what a reader might take for proved and is not, for this certificate."""
    effort, sliding = saved.effort, saved.protocol.reaching is not None
    residual = () if effort is None else effort.residual
    said = []
    if saved.verdict != "certified":
        notes = saved.document["unverified"].get("notes")
        own = [escaped(note, 300) for note in notes[:5] if isinstance(note, str)] if isinstance(notes, list) else []
        word = f" The file remarks, unverified: {'; '.join(own)}." if own else ""
        said.append(f"The certificate is undecided: that the agents behave so by the deadline is not certified.{word}")
    said.append(
        "The model: agents are single integrators, weights are exact and constant, every agent knows the states it "
        "listens to without delay" + ("." if any(e.noise for e in residual) else " and without noise.")
    )
    if any(e.limits.sample_period for e in residual):
        said.append("Sampling is certified with the periods named above, and with no others.")
    else:
        said.append("Continuous time: nothing is said of an input that is sampled and held.")
    if not saved.constant:
        gain = "The gain is infinite at the deadline. No device follows it to the end; "
        said.append(
            gain + ("what the limits named above leave is proved." if residual else "what a cap leaves was not asked.")
        )
    if sliding:
        said.append(
            "Disturbances must stay within \u03b4, and \u03b4 must be known. The sign in the input is ideal: a device "
            "that switches with a delay chatters, and what that does is not said."
        )
    elif effort is None or effort.disturbed is None:
        said.append("There are no disturbances in the model, and nothing is said of what they would do.")
    if saved.start is None:
        said.append("No start was given: there is no final state, and no bound of the input in numbers.")
    elif effort is not None and effort.starts is not None:
        said.append("Bounds of the input are for the set of starts, the final state for the one start alone.")
    elif not saved.constant:
        said.append("Final state and bounds in numbers are for this start; behaviour and rate are for every start.")
    if effort is not None and not saved.constant:
        if effort.bounded is False:
            said.append("The input is not bounded: the deadline is met in the model, and by no actuator with a limit.")
        elif effort.bounded is None:
            said.append("Whether the input stays bounded is not decided.")
        elif effort.peak is None and saved.start is not None:
            said.append("The input stays bounded, but by which number is not proved.")
    if saved.final_state is not None and any(radius for _, radius in saved.final_state):
        said.append("The final state is proved to lie in the intervals, and no nearer.")
    if saved.rate is not None and saved.upper_bound is None:
        said.append("No upper bound on the rate is proved: a faster certificate may exist.")
    if len(saved.claims) > 1:
        said.append(
            "The article leaves disconnected graphs out; components are treated one by one, by the same proofs."
        )
    if saved.trajectory is None:
        said.append(f"No run was simulated for this page: {escaped(no_run)}.")
    else:
        said.append("Simulated curves and everything called numerical are floating point, and no part of the proof.")
    said.append(
        "The theorems are those of the article: verified are their hypotheses, and the inequalities and numbers "
        "listed. The SHA-256 values show that a file was not changed; they are no signature. "
        "Whether the graph is the one you mean, only you can tell."
    )
    return said
