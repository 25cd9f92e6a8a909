"""The run that belongs to what was asked where messages are late, or leaders move."""

from __future__ import annotations

from typing import Any

from ptcc_certify.bounds.delay.late_messages import LateBounds
from ptcc_certify.certificate.family_proof import FamilyProof
from ptcc_certify.certificate.graph_proof import GraphProof
from ptcc_certify.simulation.late_messages import can_run, simulate_late
from ptcc_certify.simulation.moving_leaders import simulate_tracking
from ptcc_certify.simulation.trajectory import Trajectory
from ptcc_certify.simulation.virtual_positions import follow, run_virtual_positions


def late_run(proof: GraphProof | FamilyProof, late: LateBounds, **options: Any) -> Trajectory | None:
    """Return the run of what is proved of one graph with late messages or moving leaders, from its initial state.

    Of a graph that has something proved as a family of one mode there is one where nothing is late or off.

    Messages are as late as allowed, leaders move away from the farthest follower as fast as they may, and vehicles that
    exchange virtual positions track the run of these.

    Parameters
    ----------
    proof : GraphProof or FamilyProof
        With an initial state.
    late : LateBounds
        What is proved.
    **options : Any
        ``pattern`` of :func:`ptcc_certify.simulate_late`, ``steps`` of that or of
        :func:`ptcc_certify.simulate_tracking`.

    Returns
    -------
    Trajectory or None
        None where delays are too short for one, and of families.

    Raises
    ------
    ParameterError, SimulationError
        There are too many agents, or the run fails.

    Examples
    --------
    >>> pair = SignedDigraph.from_edges([(1, 2, 1)])
    >>> cert = certify(pair, NominalProtocol(T=1, rho1=1, rho2=2, kappa=1), [1, 0], messages=LateMessages(delay="0.1"))
    >>> late_run(cert.proof, cert.late).states[:, -1].round(3)
    array([1., 1.])
    """
    graph, protocol, messages = late.graph, proof.protocol, late.messages
    if graph is None or (isinstance(proof, FamilyProof) and (late.forms or not late.tracks)):
        return None
    assert proof.initial_state is not None
    start = [float(x) for x in proof.initial_state]
    if late.tracks and late.leaders is not None:
        u = late.rows[0].witness.u if late.rows else None
        return simulate_tracking(graph, protocol, late.leaders, start, u=u, gain_cap=messages.gain_cap, **options)
    if not can_run(protocol, messages):
        return None
    if late.tracking_protocol is not None and messages.vehicles is not None:
        virtual = run_virtual_positions(graph, protocol, messages, start, late.leaders, **options)
        return follow(virtual, late.tracking_protocol, messages.vehicles)
    return simulate_late(graph, protocol, messages, start, leaders=late.leaders, **options)
