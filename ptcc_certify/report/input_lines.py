"""What the long screen tells of the input: bounded or not, how large, under limits and disturbances."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING

from lmi.exact.decimal_rounding import down, near, up
from ptcc_certify.report.structure_text import Lines
from ptcc_certify.report.text_layout import value_list

if TYPE_CHECKING:
    from ptcc_certify.bounds.input.effort import Effort, Limited
    from ptcc_certify.certificate.certificate import Certificate
    from ptcc_certify.checker.input_formulas import InitialSet


def input_lines(certificate: Certificate) -> Lines:
    """Tell whether the input stays finite, and how large it gets."""
    effort = certificate.effort
    if effort is None or certificate.constant:
        return
    lower, upper = effort.threshold
    product = f"rho2 kappa min Re lambda >= {down(lower, 5)}" if lower is not None else "nothing else is proved"
    if effort.bounded:
        how = {"rate": f"{product}, 1 is enough", "spectrum": "by the exact spectrum"}[effort.by or "rate"]
        yield "input", f"bounded up to the deadline for every initial state: {how}"
    elif effort.bounded is False:
        below = f" <= {up(upper, 5)}" if upper is not None and effort.by == "upper_bound" else " = 1 or less"
        yield "INPUT", "NOT BOUNDED: the state converges, but from some initial states the input grows without limit"
        enough = "" if certificate.rate is None else f" to {up(2 / certificate.rate, 5)} or more"
        yield "", f"rho2 kappa min Re lambda{below}, 1 is needed: raise rho2 * kappa{enough}"
    else:
        yield "input", f"not proved bounded: {product}, 1 is needed"
    sizes = []
    if effort.peak is not None:
        label = certificate.graph.labels[effort.peak.agents.index(effort.peak.largest)]
        sizes = [f"|u_k| <= {up(effort.peak.largest, 4)} (k = {label}), ||u|| <= {up(effort.peak.norm, 4)}"]
    sizes += [f"int ||u||^2 dt <= {up(effort.energy.value, 4)}"] if effort.energy is not None else []
    sizes += [f"int ||u|| dt <= {up(effort.path_length.value, 4)}"] if effort.path_length is not None else []
    if sizes:
        whom = "" if effort.initial_set is None else f" for {initial_states_text(effort.initial_set)}"
        part = " (integrals of the nominal part)" if effort.sliding is not None else ""
        yield "effort", ", ".join(sizes) + whom + part
    other = bool(certificate.limits) or not certificate.direct  # the initial state that is found is of neither
    worst = None if effort.peak is None or other else certificate.worst_initial_state
    if worst is not None and math.isfinite(worst.size):
        labels = certificate.graph.labels
        where = f"|u_{labels[worst.agent]}| = {worst.size:.4g} at t = {worst.t:.4g}"
        yield "", f"largest found (numerical) {where} from {value_list(labels, worst.x0.tolist())}"
    if effort.sliding is not None and not effort.sliding.bounded:
        yield "", "mu3 kappa < 1: the sliding part of the input is not bounded for every sigma(0)"
    yield from _limited_lines(certificate, effort)
    yield from disturbed_lines(certificate)


def disturbed_lines(certificate: Certificate) -> Lines:
    """Tell what disturbances add to the input under the nominal protocol, and without limits to the final state."""
    effort = certificate.effort
    if effort is not None and (d := effort.disturbed) is not None:
        held = any(entry.sample_period is not None for entry in certificate.limits)
        text = f"|d_k| <= {down(d.delta, 12)} adds at most {up(max(d.inputs), 4)} to |u_k|"
        if d.drift is None or certificate.limits:
            text += " without a sample period" * held + "; of x(T) nothing is proved"
        else:
            text += f" and moves x_k(T) by at most {up(max(d.drift), 4)}" if any(d.drift) else " and moves no x_k(T)"
        yield "disturbed", text


def _limited_lines(certificate: Certificate, effort: Effort) -> Lines:
    """Tell what is proved under limits of the gain, and under noise with them."""
    for entry in effort.residual:
        agents = "" if entry.agents is None else f", every agent within {up(max(entry.agents), 3)} of its final state"
        largest = "" if entry.largest is None else f", |u_k| <= {up(entry.largest, 4)}"
        yield "limited", f"{limits_text(entry)}: at T ||E|| <= {up(entry.norm, 3)}{agents}{largest}"
        if entry.noise is not None and entry.noisy_norm is not None and entry.noisy_largest is not None:
            noise = f"noise |n_k| <= {near(entry.noise)} leaves ||E|| <= {up(entry.noisy_norm, 3)} at T"
            yield "", f"{noise}, |u_k| <= {up(entry.noisy_largest, 4)}"


def limits_text(entry: Limited) -> str:
    """Name the limits of the gain."""
    limits = entry.limits
    names = (("gain <= ", limits.gain_cap), ("switched off at T - ", limits.stop_before))
    return ", ".join(f"{what}{near(x)}" for what, x in (*names, ("zero-order hold ", limits.sample_period)) if x)


def initial_states_text(initial_set: InitialSet) -> str:
    """Name a set of initial states."""
    R = max(initial_set.radius, default=0)
    cube = R and not initial_set.axes and not any(initial_set.center) and min(initial_set.radius) == R
    return f"all |x_k(0)| <= {near(Fraction(R))}" if cube else "the initial states asked about"
