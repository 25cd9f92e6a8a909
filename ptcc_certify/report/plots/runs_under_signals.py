"""Runs that are drawn of a family: under many signals, of the kind that its certificate is about."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.runs_against_bounds import worst_case_signals
from ptcc_certify.errors import Change, ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.model.constrained_switching import ClockShares, DwellTime, JointWindows
from ptcc_certify.report.plots.style import RUN
from ptcc_certify.report.plots.subject import certifies_family, trajectory_of
from ptcc_certify.simulation.run import simulate
from ptcc_certify.simulation.switching_signals import (
    ConstantSignal,
    PeriodicSignal,
    RandomDwellSignal,
    RandomSignal,
    Signal,
)
from ptcc_certify.simulation.trajectory import Trajectory
from ptcc_certify.theorems.family_behaviour import DEPENDS

#: Random signals that are drawn beside the worst cases.
_RANDOM = 8
#: Periods of the clock in which modes have their shares.
_PERIODS = (0.25, 0.5, 1.0, 2.0, 4.0)
#: Samples of runs that begin off the sliding manifold: half as many, since there are as many again before ``T_r``.
_SAMPLES = 101


def sample_runs(certificate: Certificate, signals: Iterable[Signal] | None = None) -> list[Trajectory]:
    """Return runs from a certificate's initial state.

    Parameters
    ----------
    certificate : Certificate
    signals : iterable of Signal, optional
        By default eight random ones, and worst cases; of a certificate for constant signals, a dwell time, shares or
        windows signals of that kind.

    Raises
    ------
    ParameterError
        The certificate has no initial state.
    """
    if certificate.initial_state is None:
        raise ParameterError("the certificate has no initial state; certify the family with x0")
    chosen = _signals(certificate) if signals is None else signals
    start = [float(x) for x in certificate.initial_state]
    more: dict[str, Any] = {}
    if certificate.sigma0 is not None:
        more = {"sigma0": [float(s) for s in certificate.sigma0], "samples": _SAMPLES}
    family, offsets = certificate.family_proof.family, certificate.proof.offsets
    runs = [simulate(family, certificate.protocol, start, signal, **more) for signal in chosen]
    places = None if offsets is None else np.array([float(h) for h in offsets])
    return runs if places is None else [run.in_places(places) for run in runs]


def _signals(certificate: Certificate) -> list[Signal]:
    """Return signals of the kind that was asked for; where that is any random ones, and worst cases."""
    return _of_the_kind(certificate) or [*map(RandomSignal, range(_RANDOM)), *worst_case_signals(certificate)]


def _of_the_kind(certificate: Certificate) -> list[Signal]:
    """Return signals that keep what a certificate was asked of; none where that is any, or where none is known."""
    signal, modes = certificate.family_proof.signal, certificate.family_proof.family.modes
    if isinstance(signal, DwellTime):
        return [RandomDwellSignal(signal, seed) for seed in range(_RANDOM)]
    if signal == "constant":
        levels = (0.0, 0.5, 1.0) if not all(mode.known.all() for mode in modes) else (0.5,)
        members = [ConstantSignal(i, level) for i in range(len(modes)) for level in levels]
        return list(members[:: math.ceil(len(members) / _RANDOM)])
    if isinstance(signal, ClockShares):
        shares = [(i, float(share)) for i, share in enumerate(signal.shares) if share]
        return [PeriodicSignal([(i, share * period) for i, share in shares]) for period in _PERIODS]
    if isinstance(signal, JointWindows) and len(modes) * signal.on <= signal.length:
        word = [(i, float(signal.length) / len(modes)) for i in range(len(modes))]
        return [PeriodicSignal(word[k:] + word[:k]) for k in range(min(len(word), _RANDOM))]
    return []


def keeps_promise(certificate: Certificate, runs: Sequence[Trajectory]) -> bool:
    """Tell whether runs are those under signals of the kind that a certificate was asked of."""
    own = {signal.text for signal in _of_the_kind(certificate)}
    return all(run.signal in own for run in runs)


def runs_of(subject: Any, runs: Sequence[Trajectory] | None = None) -> list[Trajectory]:
    """Return runs that are given, or those that are drawn by default: of a family under many signals, else one.

    Raises
    ------
    ParameterError
        The subject leads to no run, or runs are given that are not of its family.
    """
    if not certifies_family(subject):
        if runs is not None:
            raise ParameterError("runs are of the certificate of a family; leave them out")
        return [trajectory_of(subject)]
    if subject.late is not None or subject.leaders_move:
        why = "no run of a family is made with late messages or leaders that move; draw what is proved of these: "
        raise ParameterError((why, Change("what", subject.main_figure)))
    result = sample_runs(subject) if runs is None else list(runs)
    if not result or not all(_is_of(run, subject.family) for run in result):
        raise ParameterError("runs are what simulate returned for the family of the certificate")
    return result


def _is_of(run: Any, family: Family) -> bool:
    return isinstance(run, Trajectory) and run.played is not None and run.played.family == family


def bound_label(certificate: Certificate) -> str:
    """Name bounds for every signal; while sliding variables move they are integrated in floats: numerical."""
    return "proved for every signal" if certificate.direct else "bound for every signal (numerical)"


def count_of_signals(certificate: Certificate, runs: Sequence[Trajectory]) -> str:
    """Tell how many signals are drawn, and where some are promised, whether these keep the promise or are any."""
    kept = " of the kind asked for" if keeps_promise(certificate, runs) else " of any kind"
    return f"{len(runs)} signals{'' if certificate.family_proof.signal == 'any' else kept}"


def no_bound_text(certificate: Certificate) -> str:
    """Say that no bound for every signal is drawn, and why: none exists, or none is proved.

    Where the behaviour depends on the signal, switching shortly before ``T`` still moves agents from some states.
    """
    depends = any(part.component.behaviour == DEPENDS for part in certificate.family_proof.parts)
    exists = "exists for all states and signals" if certificate.family_proof.signal == "any" else "is proved"
    return f"no bound {exists}: the behaviour {DEPENDS}" if depends else "no bound is proved"


def is_worst(run: Trajectory) -> bool:
    """Tell whether a run is under a worst case."""
    return run.signal.startswith("worst")


def line_of(run: Trajectory) -> dict[str, Any]:
    """Return how the one quantity of a run is drawn among others."""
    worst = is_worst(run)
    return {"color": "black" if worst else RUN, "linewidth": 0.9 if worst else 0.6, "zorder": 3 if worst else 2}
