"""Where agents end, and the colours of that in every figure that has them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_hex

from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.errors import ParameterError
from ptcc_certify.simulation.agents import AgentsTrajectory
from ptcc_certify.simulation.trajectory import Trajectory

#: Colours of final states, from the least over 0 to the largest: all are legible on white, and white on them.
ENDS = LinearSegmentedColormap.from_list("ends", ["#A84300", "#6A6A6A", "#005A9C"])
#: The least final state that has a colour, as a share of the largest first state.
_SEEN = 1e-3
#: Below this share of the largest state one of a run is 0.
_NOISE = 1e-6


def final_states(certificate: Certificate, run: Any) -> np.ndarray:
    """Return the state of every agent at ``T``, (N,): of an interval its middle, NaN where none is known.

    It is the proved final state, or under a gain cap, with late messages or moving leaders that of the run.
    """
    proof, part = certificate.proof, certificate.proof.agents
    if part is None and run is None and (proof.leaders_move or proof.late is not None):
        return np.full(len(certificate.labels), np.nan)
    if part is None and run is not None and (proof.limits or proof.late is not None or proof.leaders_move):
        return at_deadline(run, run.positions)
    known: list[Any] = []
    if part is not None:  # of agents of order n that of positions; in several dimensions there is no one number
        if run is not None and part.dimension == 1 and part.protocol.gain_cap is not None:
            return at_deadline(run, run.states[:, 0, 0])
        known = [agent[0][0][0] for agent in part.final_state or ()] if part.dimension == 1 else []
    elif certificate.of_family:
        ends_of_family = certificate.family_proof.final_positions
        known = [None if end is None else sum(end) / 2 for end in ends_of_family or ()]
    elif certificate.graph_proof.final_positions is not None:
        known = list(certificate.graph_proof.final_positions.states)
    try:
        ends = [np.nan if end is None else float(end) for end in known]
    except OverflowError:
        raise ParameterError("a final state is beyond the range of float64; nothing is drawn of it") from None
    return np.array(ends or [np.nan] * len(certificate.labels))


def at_deadline(run: Any, values: np.ndarray) -> np.ndarray:
    """Return what values of a run, (N, M), are at ``T``, (N,); what an integrator leaves of 0 is 0."""
    ends = np.array([np.interp(float(run.protocol.gain.T), run.t, own) for own in values])
    return np.where(np.abs(ends) < _NOISE * np.abs(np.nan_to_num(values)).max(initial=0), 0.0, ends)


def colours_of(ends: np.ndarray, largest: float | None = None, first: float = 0) -> list[str]:
    """Return the colours of states up to a largest one, by default theirs; grey of those that are not known.

    Grey, too, are those below a thousandth of the size of the ``first`` states: an integrator's noise has no colour.

    Examples
    --------
    >>> from ptcc_certify.report.plots.final_colours import colours_of
    >>> colours_of(np.array([2.0, 0.0, -2.0])), colours_of(np.array([1e-9]), first=5)
    (['#005a9c', '#6a6a6a', '#a84300'], ['#6a6a6a'])
    """
    known = np.nan_to_num(ends)
    known[np.abs(known) < _SEEN * first] = 0
    largest = largest or float(np.abs(known).max(initial=0)) or 1.0
    return [to_hex(colour) for colour in ENDS(Normalize(-largest, largest)(known))]


def colours_at_end(certificate: Certificate, run: Any) -> list[str] | None:
    """Return the colour of every agent, by its state at ``T``; None of families, and where no state is known there.

    None, too, where one is beyond the range of floats.
    """
    try:
        ends = final_states(certificate, run)
    except ParameterError:
        return None
    if certificate.of_family or np.isnan(ends).all():
        return None
    first = positions_of(run)[:, 0] if run is not None else [float(x) for x in certificate.initial_state or ()]
    return colours_of(ends, first=float(np.abs(first).max(initial=0)))


def positions_of(run: Trajectory | AgentsTrajectory) -> np.ndarray:
    """Return the positions of a run, (N, M), in several dimensions the first coordinate."""
    return run.positions if isinstance(run, Trajectory) else run.states[:, 0, 0]
