"""What a figure is drawn from: the certificate, run or structure that its subject is, or holds, or leads to."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from lmi.exact.decimal_rounding import near
from ptcc_certify.certificate.certificate import Certificate, read_certificate
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.io import as_graph
from ptcc_certify.graphs.recognised_files import kind_of
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.report.facts.claim import without_flaws
from ptcc_certify.simulation.trajectory import Trajectory

#: What limits a gain, in the order of the parameters of ``GainLimits``.
_LIMITS = ("gain at most", "off from $T$ -", "held over")
#: What makes the subject of most figures.
_CERTIFY = "give certify(graph, protocol, x0)"


def read_back(subject: Any) -> Any:
    """Return the certificate of a file that is one, and anything else as it is.

    Examples
    --------
    >>> from ptcc_certify.report.plots.subject import read_back
    >>> with TemporaryDirectory() as folder:
    ...     certify("fig1a", NominalProtocol()).save(Path(folder, "c.json"))
    ...     read_back(Path(folder, "c.json")).verdict, read_back("fig1a")
    ('certified', 'fig1a')
    """
    if isinstance(subject, str | os.PathLike) and kind_of(os.fspath(subject)) == "a certificate":
        return read_certificate(Path(subject))
    return subject


def is_of_family(subject: Any) -> bool:
    """Tell whether a subject is a family, or the certificate of one."""
    return isinstance(subject, Family) or certifies_family(subject)


def certifies_family(subject: Any) -> bool:
    """Tell whether a subject is the certificate of a family.

    Examples
    --------
    >>> from ptcc_certify.report.plots.subject import certifies_family
    >>> certifies_family(certify([("a", "b", 1, 2)], NominalProtocol())), certifies_family("fig1a")
    (True, False)
    """
    return isinstance(subject, Certificate) and subject.of_family


def refuse_family(subject: Any) -> None:
    """Refuse a family, or its certificate, where the figure is of one graph.

    Raises
    ------
    ParameterError
        Names the functions that draw families.

    Examples
    --------
    >>> from ptcc_certify.report.plots.subject import refuse_family
    >>> refuse_family(ptcc.as_family([("a", "b", 1, 2)]))
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: this figure is of one graph; of families draw plot_graph, and of their ...
    """
    if is_of_family(subject):
        others = "of their certificates plot_trajectory, plot_decay and plot_input"
        raise ParameterError(f"this figure is of one graph; of families draw plot_graph, and {others}")


def trajectory_of(subject: Any) -> Trajectory:
    """Return the run of what was asked of a certificate, with its limits of the gain, or else :func:`ideal_run_of`."""
    asked = subject.asked_trajectory if isinstance(subject, Certificate) else None
    return ideal_run_of(subject if asked is None else asked)


def ideal_run_of(subject: Any) -> Trajectory:
    """Return a run of one initial state: the subject itself, or that of a certificate, which is simulated if need be.

    Of a certificate it is the run that its bounds over time are of: nothing late, leaders at rest, no limits.

    Raises
    ------
    ParameterError
        The subject is neither, the certificate has no initial state, or the run has several or one that is not finite.

    Examples
    --------
    >>> from ptcc_certify.report.plots.subject import ideal_run_of
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5], asks=Asks(simulation=False))
    >>> ideal_run_of(cert).states[:, 0]
    array([3., 5.])
    """
    run = subject
    refuse_family(subject)
    if isinstance(subject, Certificate):
        run = subject.simulate() if subject.trajectory is None else subject.trajectory
    if not isinstance(run, Trajectory):
        kind = type(subject).__name__
        raise ParameterError(f"this figure is drawn from a trajectory or a certificate, not from {kind}; {_CERTIFY}")
    if run.states.ndim != 2:
        raise ParameterError(f"the trajectory holds {run.states.shape[1]} initial states; draw a run of one")
    if not np.isfinite(run.states).all():
        raise ParameterError("the trajectory holds states that are not finite; draw a run that ends well")
    return run


def certificate_of(subject: Any) -> Certificate:
    """Return the certificate of one graph that a figure is drawn from, or refuse anything else.

    Raises
    ------
    ParameterError
        The subject is no certificate, or one of a family.

    Examples
    --------
    >>> from ptcc_certify.report.plots.subject import certificate_of
    >>> certificate_of("fig1a")
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: this figure is drawn from a certificate, not from str; give certify(...
    """
    refuse_family(subject)
    if not isinstance(subject, Certificate):
        kind = type(subject).__name__
        raise ParameterError(f"this figure is drawn from a certificate, not from {kind}; {_CERTIFY}")
    return subject


def structure_of(subject: Any) -> Structure:
    """Return the structure of a certificate, a trajectory, or anything that :func:`~ptcc_certify.as_graph` takes.

    Examples
    --------
    >>> from ptcc_certify.report.plots.subject import structure_of
    >>> structure_of(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])).balanced
    True
    """
    refuse_family(subject)
    if isinstance(subject, Structure):
        return subject
    return subject.graph_proof.structure if isinstance(subject, Certificate) else analyse(as_graph(subject))


def ideal_text(certificate: Certificate) -> str:
    """Say what of a certificate is not in its bounds over time: limits of the gain, late messages, moving leaders."""
    late, leaders = certificate.proof.late, certificate.proof.asked_leaders
    virtual = late is not None and late.messages.vehicles is not None
    absent = {
        "virtual positions": virtual,
        "no limits": certificate.limits or (late is not None and late.messages.gain_cap is not None),
        without_flaws(None if late is None else late.messages): late is not None and not late.messages.exact,
        "leaders at rest": leaders is not None and leaders.speed > 0,
        "no clipping": leaders is not None and leaders.saturation is not None,
        "no growth": leaders is not None and leaders.growth is not None,
        "no disturbances": leaders is not None and leaders.disturbance > 0,
    }
    return ", ".join(text for text, there in absent.items() if there)


def limits_text(run: Trajectory, certificate: Certificate | None) -> str:
    """Name limits of the gain, late messages, moving leaders of a run; say what of a certificate it is without."""
    met = run.conditions
    limits, messages, leaders = met.actuator, met.messages, met.leaders
    numbers: dict[str, Any] = {}
    if limits is not None:
        numbers = dict(zip(_LIMITS, (limits.gain_cap, limits.stop_before, limits.sample_period), strict=True))
    numbers |= {} if messages is None else {"messages late by up to": messages.age, "off by": messages.value_error}
    named = ["vehicles"] * run.vehicles
    named += [f"{name} {near(number)}" for name, number in numbers.items() if number]
    if leaders is not None:
        values = leaders.speed, leaders.disturbance, leaders.sign_gain, leaders.growth, leaders.saturation
        names = "leaders move at up to", "disturbed by up to", "with sign(e) times", "growth", "clipped to"
        words = dict(zip(names, values, strict=True))
        named += [f"{name} {near(number)}" for name, number in words.items() if number]
    if certificate is not None:
        vehicles, late = run.vehicles, certificate.proof.late
        flawed = "late messages" if late is None else late.messages.name
        forced = certificate.sigma0 is None and met.forcing is None and leaders is None
        absent = {
            "without the limits of the gain": limits is None
            and (certificate.limits or (late and late.tracks and late.gain.bounded)),
            f"without {flawed}": messages is None and late is not None and not (late.messages.exact or vehicles),
            "leaders at rest": leaders is None and certificate.proof.leaders_move,
            "without disturbance": forced and certificate.delta,
            "without noise": forced and certificate.noise,
        }
        named += [text for text, there in absent.items() if there]
    return ", ".join(named)


def require_same(run: Trajectory, certificate: Certificate) -> None:
    """Refuse a certificate that is of something else than a run.

    Raises
    ------
    ParameterError
        It is of another graph, protocol, initial state or ``sigma(0)``.
    """
    for name in ("graph", "protocol"):
        if getattr(certificate, name) != getattr(run, name):
            raise ParameterError(f"the certificate is of another {name} than the trajectory")
    if 0.0 not in run.t[:1]:
        return
    pairs = [("initial state", certificate.initial_state, run.states[:, 0])]
    rounding = np.abs(run.states[:, 0]).max()  # states are told less places or targets, and integrated in units of them
    if run.sliding is not None:
        pairs.append(("sigma(0)", certificate.sigma0, run.sliding.sigma0))
        rounding = rounding + np.abs(run.sliding.sigma0).max()  # the states are sums of two parts
    for name, proved, first in pairs:
        if (
            proved is not None
            and (np.abs(np.array(list(map(float, proved))) - first) > 4 * np.finfo(float).eps * rounding).any()
        ):
            raise ParameterError(f"the certificate is of another {name} than the trajectory")
