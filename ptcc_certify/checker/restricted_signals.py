"""Verifies what is claimed of a family for restricted signals: under a dwell time, or if nothing ever changes.

Section 19 of the format, "Restricted signals". In mode ``i`` the value ``xi' P_i xi`` decays at the rate ``b_i`` for
all members, and at a switch ``P_j <= ratio P_i`` bounds what it becomes.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from lmi.exact.decimal_rounding import down
from lmi.exact.definite import Arithmetic
from lmi.exact.elementary_enclosures import log
from lmi.exact.numbers import integers
from ptcc_certify.checker.family import Component, Family
from ptcc_certify.checker.family_function import decreases, quotient_of
from ptcc_certify.checker.family_rows import Function
from ptcc_certify.checker.matrix_products import Matrix, combined, need_rows
from ptcc_certify.checker.proof_cursor import Document
from ptcc_certify.checker.reading import entries, exact, fields, need, triangle

#: Claims that are read.
MANY_CLAIMS = 100
KEYS = ("claim", "signals", "component", "forms", "ratio", "rate", "bounded")
#: Longest ratio, in bits, of which the logarithm is enclosed.
RATIO_BITS = 4000

Form = tuple[Matrix, int]


def check_restricted(doc: Document, family: Family, functions: Sequence[Function], gains: dict[str, Fraction]) -> None:
    """Verify every claim for restricted signals."""
    if "restricted" not in doc.data:
        return
    items = entries(doc.section("restricted"), "restricted")
    need(0 < len(items) <= MANY_CLAIMS, f"no claim for restricted signals, or more than {MANY_CLAIMS}")
    for k, entry in enumerate(items):
        doc.at = of = f"restricted[{k}]"
        need(isinstance(entry, dict) and entry.get("claim") == "rate", "an unknown claim")
        fields(entry, KEYS, "a claim")
        _check_rate(doc, family, functions, gains, entry, of)


def _component(family: Family, number: Any) -> Component:
    need(type(number) is int and 0 <= number < len(family.components), "an unknown component")
    return family.components[number]


def _dwell(entry: Any) -> tuple[Fraction, str] | None:
    """Return a dwell time and its clock; None: mode and weights never change."""
    if entry == "constant":
        return None
    fields(entry, ("dwell", "clock"), "signals")
    least, clock = exact(entry["dwell"]), entry["clock"]
    need(least > 0 and clock in ("t", "s"), "a dwell time that is not positive, or of an unknown clock")
    return least, clock


def _check_rate(
    doc: Document, family: Family, functions: Sequence[Function], gains: dict[str, Fraction], entry: Any, of: str
) -> None:
    component, dwell = _component(family, entry["component"]), _dwell(entry["signals"])
    need(not component.depends and len(component.nodes) > 1, "a rate where nothing, or no common kernel, decays")
    ratio, rate = exact(entry["ratio"]), exact(entry["rate"])
    forms: list[Form] = []
    if entry["forms"] is None:
        own = [V.rate for V in functions if V.component is component]
        need(bool(own), "no function of this component")
        most = max(own)
    else:
        forms, rates = _forms(doc, family, component, entry["forms"], of)
        most = min(rates)
    doc.open("restricted-rate", of)
    need(ratio >= 1 and (bool(forms and dwell) or ratio == 1), "the ratio is not 1, or less")
    if dwell is not None:
        _check_ratio(doc.exact, forms, ratio)
        if dwell[1] == "s" and ratio > 1:
            need(max(map(int.bit_length, ratio.as_integer_ratio())) <= RATIO_BITS, "a ratio that is too long")
            most -= log(ratio)[1] / dwell[0]
    need(rate <= most, "the rate is not proved")
    enough = rate * gains["rho2"] * gains["kappa"] >= 2
    need(entry["bounded"] is (True if enough else None), "whether the input is bounded")
    doc.done(f"rate {down(rate)}" if rate > 0 else "nothing decays")


def _forms(
    doc: Document, family: Family, component: Component, section: Any, of: str
) -> tuple[list[Form], list[Fraction]]:
    """Verify the forms of all modes with their rates."""
    pivots = set(component.pivots.values())
    nodes = [v for v in component.nodes if v not in pivots]
    need(bool(nodes), "a form of no agents")
    need_rows(len(nodes))
    forms, rates = [], []
    for k, lower in enumerate(entries(section, "forms", len(family.modes))):
        form = integers(triangle(lower, len(nodes)))
        need(doc.exact.definite(form[0]), "P is not proved definite")
        numbers = doc.open("family-rate", f"{of}.modes[{k}]", ["b"], witness=True)
        mode = quotient_of(family, k, component, nodes)
        decreases(doc.exact, mode, form, component.whole[1], numbers["b"], numbers["witness"])
        doc.done(f"b = {down(numbers['b'])}")
        forms.append(form)
        rates.append(numbers["b"])
    return forms, rates


def _check_ratio(judge: Arithmetic, forms: Sequence[Form], ratio: Fraction) -> None:
    """Verify ``P_j <= ratio P_i`` for all pairs of forms."""
    p, q = ratio.as_integer_ratio()
    distinct: list[Form] = []
    for form in forms:
        if form not in distinct:
            distinct.append(form)
    for i, (P, unit) in enumerate(distinct):
        for j, (Q, scale) in enumerate(distinct):
            if i != j:
                S = combined("the ratio of forms", (p * scale, P), (-q * unit, Q))
                need(judge.definite(S), "the ratio of two forms is not proved")
