"""Options of agents of order n, and what they make of them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from lmi.exact.decimal_rounding import counted
from ptcc_certify.cli import click_options as declared
from ptcc_certify.cli.options import Options, read_initial_state, with_prejudices
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.model.agents import Agents
from ptcc_certify.model.asks import Case, InitialState
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders

if TYPE_CHECKING:
    from fractions import Fraction

    from ptcc_certify.graphs.digraph import SignedDigraph
    from ptcc_certify.graphs.family import Family
    from ptcc_certify.model import Protocol
    from ptcc_certify.simulation.agents import AgentsTrajectory
    from ptcc_certify.simulation.trajectory import Trajectory


#: Agents by their names, and their orders.
NAMES = {"integrator": 1, "double-integrator": 2, "triple-integrator": 3}
#: The largest order, which the library refuses to exceed.
_MOST_ORDER = 8
#: Options that need ``--agents``.
_OWN = (*declared.names_of(Agents)[1:], "v0", "a0")

#: Where agents of order 2 or 3 may do so, and what is proved of those that do.
_EXCHANGE = "let them exchange virtual positions: --exchange virtual; or"
_OF_VEHICLES = {*declared.names_of(LateMessages), *declared.names_of(MovingLeaders)} - {"own_delay", "sign_gain"}
#: What is said where late messages are asked of agents of order n; then what makes them such is named.
_MESSAGES = "late messages are proved of single integrators and of virtual positions: leave it out, or leave out"
#: Options that are of single integrators alone, and what to do instead.
_OF_SINGLE_INTEGRATORS = {
    "stop_before": "leave it out, or cap the gain with --gain-cap",
    "sample_period": "leave it out, or cap the gain with --gain-cap",
    "noise": "leave it out",
    "at": "leave it out; -v tells bounds at several instants",
    "initial_bound": "bounds are from one initial state, --x0; leave it out",
    **dict.fromkeys([name for name in declared.names_of(LateMessages) if name != "own_delay"], _MESSAGES),
    **dict.fromkeys(declared.names_of(MovingLeaders), "leave it out; their leaders move as their plant does"),
}

agents_options = declared.together(
    declared.options_for(Agents, asked=True), declared.one_of(InitialState, "v0"), declared.click_option(declared.A0)
)
#: Of commands that take vectors of agents of order n alone.
dimension_option = declared.click_option(declared.DIMENSION)


def agents_of(options: Options) -> Agents | None:
    """Return agents of order n, or in a formation; None for single integrators, which the plain options tell."""
    agents = _named_agents(options)
    return None if agents is None or agents.plain else agents


def _named_agents(options: Options) -> Agents | None:
    """Return the agents that the options name, single integrators among them; None if they name none."""
    kind = options["agents"] or ("double-integrator" if options["orders"] is not None else None)
    if kind is None:
        given = [name for name in _OWN if options[name] is not None]
        if given and not {"offsets", "biases"} & set(given):
            named = "triple-integrator" if options["a0"] is not None else "double-integrator"
            raise ParameterError(f"{declared.flag_of(given[0])}: is for agents of order n; give --agents {named}, say")
        if not given:
            return None
        kind = "integrator"
    order = str(NAMES.get(kind, kind))
    if not (order.isascii() and order.isdecimal() and 1 <= int(order[:9]) <= _MOST_ORDER):
        named = f"{', '.join(NAMES)}, or an order from 1 to {_MOST_ORDER}"
        raise ParameterError(f'--agents: "{shorten(kind)}" is unknown; one of {named}')
    plant = None
    if options["plant"] is not None:
        plant = [declared.exact_number(text, "--plant") for text in options["plant"].split(",")]
    numbers = {name: options[name] for name in ("drag", "rest", "cascade", "decay", "exchange")}
    mixed = options["orders"]
    for least, (name, quantity) in enumerate((("v0", "velocity"), ("a0", "acceleration")), start=2):
        told = options[name] is not None and options[name].strip() != "0"
        if told and mixed is None and int(order) < least:
            why = f"agents of order {order} have no {quantity} to begin with"
            raise ParameterError(f"{declared.flag_of(name)}: {why}; leave it out, or give --agents {least}")
    return Agents(
        int(order),
        plant,
        offsets=options["offsets"],
        biases=options["biases"],
        gain_cap=options["gain_cap"],
        **numbers,
        orders=mixed,
    )


def agents_and_states(
    options: Options, graph: SignedDigraph, certified: bool = False
) -> tuple[Agents, InitialState] | tuple[None, None]:
    """Return agents and where they begin; nothing for single integrators.

    What is certified of single integrators is certified of their formations on a line, too.
    """
    agents = agents_of(options)
    if agents is None:
        return None, None
    d = options["dimension"] or 1
    if not (certified and d == 1 and (agents.of_paper or agents.virtual)):
        _refuse_unproved(options, certified)
    agents = _in_places(agents, options, graph, d)
    if isinstance(agents.orders, str):
        from dataclasses import replace

        agents = replace(agents, orders=read_initial_state(agents.orders, None, graph, "--orders"))
    given = [options["v0"], options["a0"]]
    later = [
        None if text is None or text.strip() == "0" else read_vectors(text, [options["seed"], i + 2], graph, d, flag)
        for i, (text, flag) in enumerate(zip(given, ("--v0", "--a0"), strict=True))
    ]
    while later and later[-1] is None:
        later.pop()
    x0 = with_prejudices(read_vectors(options["x0"], options["seed"], graph, d, "--x0"), options, graph)
    told = later or any(text is not None for text in given)
    return agents, InitialState(x0, derivatives=later if told else None)


def places_of(options: Options, graph: SignedDigraph, protocol: Protocol) -> Sequence[Fraction] | None:
    """Return the places of single integrators on a line, less which they run as plain ones do; None for others."""
    from ptcc_certify.certificate.agents_request import read_offsets

    agents, d = agents_of(options), options["dimension"] or 1
    if agents is None or not agents.of_paper or d > 1:
        return None
    return tuple(h for (h,) in read_offsets(_in_places(agents, options, graph, d), graph, d, protocol.gain))


def run_in_places(
    graph: SignedDigraph | Family, protocol: Protocol, x0: Any, places: Sequence[Fraction] | None, **options: Any
) -> Trajectory:
    """Run single integrators; in a formation, if they have places: less these they move as they do without."""
    import numpy as np

    from ptcc_certify.simulation.run import simulate

    if places is None:
        return simulate(graph, protocol, x0, **options)
    less = [x - h for x, h in zip(x0, places, strict=True)]
    return simulate(graph, protocol, less, **options).in_places(np.array([float(h) for h in places]))


def _in_places(agents: Agents, options: Options, graph: SignedDigraph, dimension: int) -> Agents:
    """Return agents with the places and biases that the options give."""
    from dataclasses import replace

    for i, name in enumerate(("offsets", "biases")):
        if options[name] is not None:
            rows = read_vectors(options[name], [options["seed"], 4 + i], graph, dimension, f"--{name}")
            agents = replace(agents, **{name: rows})
    return agents


def exchanges_virtual(options: Options) -> bool:
    """Tell whether agents exchange virtual positions: what is certified then is of families, too."""
    agents = agents_of(options)
    return agents is not None and agents.virtual


def agents_flags(options: Options) -> str:
    """Return the options without which agents are single integrators, as they were given."""
    return " and ".join(declared.flag_of(name) for name in ("agents", *_OWN) if options[name] is not None)


def refuse_agents_of_family(options: Options, verb: str) -> None:
    """Refuse agents of order n where a family of graphs is given, by the options that make them or belong to them."""
    taken = ("offsets", "biases", "exchange", "orders", "v0", "a0")  # beside what families take, or advised with it
    alone = [name for name in _OWN if options[name] is not None and name not in taken]
    if options["agents"] is None and options["exchange"] is None and alone:  # no agents are advised, to be refused then
        why = f"is for agents of order n, which families of graphs do not take yet; leave it out, or {verb} one graph"
        raise ParameterError(f"{declared.flag_of(alone[0])}: {why}")
    agents = agents_of(options)
    if agents is None or (verb == "certify" and agents.virtual):
        return
    if agents.of_paper and options["biases"] is None:  # in a formation
        if (options["dimension"] or 1) > 1:
            why = "a formation of a family is on a line; what is proved of one coordinate holds for each"
            raise ParameterError(f"--dimension: {why}: leave it out, and give one coordinate")
        return
    if agents.of_paper:
        raise ParameterError("--biases: of a family make other places in every graph; give --offsets instead")
    flags = agents_flags({**options, "offsets": None})
    verbs = ("is", "it") if " and " not in flags else ("are", "them")
    mend = f"leave {verbs[1]} out, or {verb} one graph"
    if verb == "certify" and _may_exchange(options):
        mend = f"{_EXCHANGE} {mend}"
    raise ParameterError(f"{flags}: {verbs[0]} not for families of graphs yet; {mend}")


def _may_exchange(options: Options) -> bool:
    """Tell whether agents are of an order in which they could exchange virtual positions, of which more is proved."""
    plain = all(options[name] is None for name in _OWN if name not in ("v0", "a0", "offsets"))
    plain = plain and not options.get("own_delay") and options.get("kind") == "nominal"
    return str(NAMES.get(options["agents"], options["agents"])) in ("2", "3") and plain


def _refuse_unproved(options: Options, certified: bool) -> None:
    """Refuse what is asked of single integrators alone, by the names of the options: those with one mend at once."""
    given = [name for name in _OF_SINGLE_INTEGRATORS if options.get(name) is not None]
    several, virtual = (options["dimension"] or 1) > 1, exchanges_virtual(options)
    late = bool(set(given) & _OF_VEHICLES) and (options["agents"] is None or _may_exchange(options))
    if certified and several and (virtual or late):
        what = "vehicles that exchange virtual positions" if virtual else "late messages and leaders that move"
        mend = "leave it out, and certify each coordinate alone"
        raise ParameterError(f"--dimension: {what} take one coordinate at a time, for none acts on another; {mend}")
    if virtual:
        raise ParameterError(
            "--exchange: of vehicles that exchange virtual positions this is not built yet; "
            "ptcc certify -o c.json takes one coordinate at a time, ptcc plot c.json draws that; or leave it out"
        )
    if given:
        mend = _OF_SINGLE_INTEGRATORS[given[0]]
        flags = [declared.flag_of(name) for name in given if _OF_SINGLE_INTEGRATORS[name] == mend]
        mend += f" {agents_flags(options)}" if mend == _MESSAGES else ""
        if certified and not several and set(given) <= _OF_VEHICLES and _may_exchange(options):
            mend = f"{_EXCHANGE} leave it out"
        verb, mend = ("is", mend) if len(flags) == 1 else ("are", mend.replace("leave it", "leave them"))
        whom = "in a formation" if options["agents"] is None else "of order n"
        raise ParameterError(f"{' and '.join(flags)}: {verb} not proved of agents {whom}; {mend}")
    if options["kind"] == "nominal" and options.get("delta") is not None:
        mend = "take --protocol sliding-mode, under which disturbances within delta move nothing"
        raise ParameterError(f"--delta: is not proved of agents of order n under the nominal protocol; {mend}")


def refuse_dimension(options: Options, command: str) -> None:
    """Refuse vectors where there are no agents of order n."""
    if options["dimension"] not in (None, 1) and agents_of(options) is None:
        why = f"ptcc {command} takes single integrators of one component"
        mend = "what is proved of one holds for each: leave it out, and give one coordinate"
        raise ParameterError(f"--dimension: {why}; {mend}")


def run_of_agents(case: Case, samples: int, steps: int | None, **pattern: Any) -> AgentsTrajectory:
    """Run agents of order n with the gains that ``ptcc certify`` proves, from their initial states to the deadline.

    At so many instants or in so many equal steps; with late messages and moving leaders at instants of their own up to
    ``T``, messages as old as the ``pattern`` tells.
    """
    import numpy as np

    from ptcc_certify.certificate.certification import certify_case

    certificate: Any = certify_case(case)
    late = certificate.late
    if late is not None and (tracking := late.tracking_protocol) is not None:
        from ptcc_certify.simulation import virtual_positions

        x0, vehicles = [float(x) for x in certificate.initial_state], late.vehicles.vehicles
        if late.messages.exact and late.leaders is None:
            motion = virtual_positions.simulate_vehicles(
                certificate.graph, tracking, x0, vehicles, samples=samples, steps=steps
            )
        else:
            beside = certificate.protocol, late.messages, x0, late.leaders
            run = virtual_positions.run_virtual_positions(certificate.graph, *beside, **pattern)
            motion = virtual_positions.follow_in_motion(run, tracking, vehicles)
        places = certificate.offsets
        return motion if places is None else motion.in_places(np.array([float(h) for h in places]))
    part = certificate.agents
    if part is None or (case.graph.n_edges and not part.functions):
        raise ParameterError("no gains of these agents are proved; ptcc certify tells why")
    return part.simulate(samples=samples, steps=steps)


def read_vectors(text: str, seed: Any, graph: SignedDigraph, dimension: int, name: str) -> Any:
    """Return N rows of ``dimension`` exact numbers: agent after agent, of a file ``node,x,y``, or random."""
    from ptcc_certify.graphs.io.states import draw_states, read_vectors_of_file, still_of
    from ptcc_certify.graphs.stubborn import agent_nodes, completed

    if text == "random":
        return draw_states(seed, graph, name, dimension)
    if dimension == 1:
        return [[x] for x in read_initial_state(text, seed, graph, name)]
    if os.path.isfile(text):  # noqa: PTH113 - that of Path refuses texts that are longer than the names of files
        return read_vectors_of_file(text, graph, dimension, still_of(name))
    texts = text.split(",")
    agents = len(agent_nodes(graph))
    if len(texts) not in (agents * dimension, graph.n_nodes * dimension):
        raise ParameterError(
            f"{name} has {counted(len(texts), 'value')} for {counted(agents, 'agent')} of dimension "
            f"{dimension}; give {agents * dimension} numbers, agent after agent, or a file node,x,y"
        )
    numbers = [declared.exact_number(text, name) for text in texts]
    still = still_of(name)
    rows = [numbers[k : k + dimension] for k in range(0, len(numbers), dimension)]
    return completed(rows, graph, None if still is None else [still] * dimension)
