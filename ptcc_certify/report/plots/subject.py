"""What a figure is drawn from: the certificate, run or structure that its subject is, or holds, or leads to."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from lmi.exact.decimal_rounding import near
from ptcc_certify.certificate.certificate import Certificate, read_certificate
from ptcc_certify.certificate.family_certificate import FamilyCertificate
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.io import as_graph
from ptcc_certify.graphs.kinds_of_file import kind_of
from ptcc_certify.graphs.structure import Structure, analyse
from ptcc_certify.simulation.trajectory import Trajectory

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
    if isinstance(subject, Family | FamilyCertificate):
        others = "of their certificates plot_family, plot_family_decay and plot_input"
        raise ParameterError(f"this figure is of one graph; of families draw plot_graph, and {others}")


def trajectory_of(subject: Any) -> Trajectory:
    """Return a run of one initial state: the subject itself, or that of a certificate, which is simulated if need be.

    Raises
    ------
    ParameterError
        The subject is neither, the certificate has no initial state, or the run has several or one that is not finite.

    Examples
    --------
    >>> from ptcc_certify.report.plots.subject import trajectory_of
    >>> pair = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=1, kappa=1), [3, 5], simulation=False)
    >>> trajectory_of(cert).states[:, 0]
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
    return subject.structure if isinstance(subject, Certificate) else analyse(as_graph(subject))


def limits_text(run: Trajectory, certificate: Certificate | None) -> str:
    """Name what limits the gain of a run, or say what of a certificate is not in it: limits, late messages, motion."""
    limits = run.actuator
    if limits is None and certificate is not None:
        absent = {
            "without the limits of the gain": certificate.limits,
            "without late messages": certificate.late,
            "leaders at rest": certificate.leaders_move,
            "less places in the formation": certificate.offsets,
        }
        return ", ".join(text for text, there in absent.items() if there)
    if limits is None:
        return ""
    numbers = (limits.gain_cap, limits.stop_before, limits.sample_period)
    named = zip(("gain at most", "off from $T$ -", "held over"), numbers, strict=True)
    return ", ".join(f"{name} {near(number)}" for name, number in named if number is not None)


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
    rounding = np.abs(run.states[:, 0])  # runs are integrated in units of the initial state
    if run.sliding is not None:
        pairs.append(("sigma(0)", certificate.sigma0, run.sliding.sigma0))
        rounding = rounding + np.abs(run.sliding.sigma0)  # the states are sums of two parts
    for name, proved, first in pairs:
        if (
            proved is not None
            and (np.abs(np.array(list(map(float, proved))) - first) > 4 * np.finfo(float).eps * rounding).any()
        ):
            raise ParameterError(f"the certificate is of another {name} than the trajectory")
