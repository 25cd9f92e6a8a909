"""What the explorer tells of a certificate: the same few rows for all settings, so that each has its place."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from lmi.exact.decimal_rounding import down, near, up
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.errors import Change
from ptcc_certify.graphs.rationals import shorten

#: The rows, and what stands in those for which a certificate has nothing to tell.
HEADS = ("claim", "x(T)", "error", "rate", "input", "sliding", "simulated")
NOTHING = "-"
#: The verdict before the independent check.
UNCHECKED = "not checked yet"
#: ``1 - t/T`` and its name, where bounds are told.
_INSTANTS = ((0.5, "0.5 T"), (0.1, "0.9 T"), (0.01, "0.99 T"))
_LABELS_SHOWN = 24


def facts_of(certificate: Certificate) -> dict[str, str]:
    """Return what a certificate claims by :data:`HEADS`; no verdict, and nothing of the run unless it was compared.

    Parameters
    ----------
    certificate : Certificate
        With an initial state.

    Returns
    -------
    dict of str to str
    """
    facts = {"claim": _claim(certificate), "x(T)": _final_state(certificate)}
    facts |= {"error": _error(certificate), "rate": _rate(certificate), "input": _input(certificate)}
    facts |= {"sliding": _sliding(certificate), "simulated": NOTHING}
    return facts


def run_of(certificate: Certificate) -> str:
    """Tell what the comparison of the run with the bound showed."""
    comparison = certificate.comparison
    if comparison is None or certificate.constant:
        return NOTHING
    if not comparison.judged:
        return "bound not tested, all is below the integrator's floor"
    return f"bound {'VIOLATED' if comparison.violated else 'kept'}, worst ratio {comparison.worst_ratio:.4g}"


def of_controls(change: Change) -> str:
    """Name a change of the controls.

    Examples
    --------
    >>> of_controls(Change("rho2", "1.38")), of_controls(Change("method", "best"))
    ('rho2 = 1.38', 'bounds = best')
    """
    name = "bounds" if change.field == "method" else change.field
    return f"{name} = {change.number}" if change.number else name


def _claim(certificate: Certificate) -> str:
    p, behaviours = certificate.protocol, dict.fromkeys(claim.sharpest for claim in certificate.claims)
    when = f"T = {near(p.T)}" if p.reaching is None else f"T_r + T_s = {near(p.T)} whatever the disturbance"
    which = certificate.theorems_named if certificate.claim is None else certificate.claim.reference
    return f"{', '.join(behaviours)} at {when} ({which})"


def _final_state(certificate: Certificate) -> str:
    result, labels = certificate.final_state, certificate.graph.labels
    if result is None:
        return NOTHING
    values = [f"{value:.5g}" for value in np.asarray(result)]
    pairs = [f"{shorten(label, 12)}={value}" for label, value in zip(labels, values, strict=True)]
    more = f", ... ({len(pairs)} in all)" if len(pairs) > _LABELS_SHOWN else ""
    exact = result.exact and all(Fraction(value) == x for value, x in zip(values, result.states, strict=True))
    kind = "exact" if exact else "to 5 digits"
    return f"{kind}: {', '.join(pairs[:_LABELS_SHOWN])}{more}"


def _error(certificate: Certificate) -> str:
    envelope, direct = certificate.envelope, certificate.direct
    if certificate.constant or not envelope.functions:
        return "no agent listens to another: there is nothing to decay" if certificate.constant else "nothing proved"
    z, share = envelope.coordinates, 1.0 if direct else float(certificate.protocol.span / certificate.protocol.T)
    instants = _INSTANTS if direct else [(share, "T_r"), *((q, name) for q, name in _INSTANTS if q < share)]
    if direct:
        bounds = np.array([envelope.residual(q) for q, _ in instants])
    else:
        bounds = certificate.norm_bound([q for q, _ in instants])
    of = f"||{z}(t)|| / ||{z}(0)||" if direct else f"||{z}(t)||"
    return f"{of} at most " + ", ".join(
        f"{up(x, 2)} at {at}" for x, (_, at) in zip(bounds.tolist(), instants, strict=True)
    )


def _rate(certificate: Certificate) -> str:
    rate, limit = certificate.rate, certificate.upper_bound
    if certificate.constant or rate is None:
        return NOTHING
    return f"{down(rate)} per unit of s" + ("" if limit is None else f"; upper bound {up(limit)}")


def _input(certificate: Certificate) -> str:
    effort = certificate.effort
    if effort is None or certificate.constant:
        return NOTHING
    if effort.bounded:
        peak = "" if effort.peak is None else f": |u_k| <= {up(effort.peak.largest, 4)}"
        return f"bounded up to the deadline{peak}"
    if effort.bounded is None:
        return "bounded or not is undecided"
    enough = "" if certificate.rate is None else f"; rho2 kappa >= {up(2 / certificate.rate, 5)} bounds it"
    return f"NOT BOUNDED from some initial states{enough}"


def _sliding(certificate: Certificate) -> str:
    if certificate.reaching is None:
        return NOTHING
    if certificate.direct:
        return "no reaching phase: the agents slide from the beginning"
    last = max(certificate.reaching, key=lambda reaching: reaching.time)
    agent = certificate.graph.labels[certificate.reaching.index(last)]
    return f"every sigma_k is 0 by t = {up(last.time, 6)} (the last: agent {shorten(agent, 12)})"
