"""What a family of signed digraphs does under every signal: decided exactly, with a counterexample where it is refuted.

The *mandatory graph* of a mode has its mandatory edges at ``w-``. With the kernel ``K`` of the Laplacian of the first
one, and its basis ``B`` whose row ``B_k`` belongs to node ``k``, these are equivalent (docs/theory/families.md):

- every mandatory graph has the kernel ``K``, and every uncertain edge of every mode has ``B_k = sgn(w_kl) B_l``;
- ``K`` is at rest in every member, and every solution under every signal comes to ``K`` exponentially, on the stretched
  clock: exactly at the deadline.

``K = {0}`` is stability, ``K = span g`` with camps ``g`` bipartite consensus: both are decided on edges alone, in
linear time. Otherwise agents that follow several groups, or a group of which they are no camp, have rows of ``B`` that
are rational numbers.

A *constant* signal is one member, which nobody knows: then each behaviour is decided on edges alone.

Where agents end under signals that switch finitely often before the deadline: where the last mode leads them.

The stretched clock is infinite after the last switch. So the last mode does what it does by itself, from the state in
which the others left the agents (docs/theory/families.md, "The last mode").
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from lmi.exact.decimal_rounding import counted
from ptcc_certify.errors import ParameterError, unlabelled
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.io import as_family
from ptcc_certify.graphs.rationals import nearest_float, shorten
from ptcc_certify.graphs.structure import (
    BIPARTITE_CONSENSUS,
    BIPARTITE_CONTAINMENT,
    CONSENSUS,
    CONTAINMENT,
    INTERVAL_BIPARTITE_CONSENSUS,
    SIGNED_AVERAGE_CONSENSUS,
    STABILITY,
    Edge,
    Structure,
    analyse,
    find_camps,
    weak_components,
)
from ptcc_certify.lazy_report import Shown, rendered
from ptcc_certify.theorems.kernel import Kernel, StateEnclosure, TooLarge, first_answer

__all__ = ["DEPENDS", "SIGNALS", "Counterexample", "FamilyComponent", "Kernel", "TooLarge", "decide"]

DEPENDS = "depends on the signal"
#: Mode and weights change arbitrarily, or are fixed and unknown.
SIGNALS = ("any", "constant")
#: Each implies those after it.
CHAIN = (BIPARTITE_CONSENSUS, INTERVAL_BIPARTITE_CONSENSUS, BIPARTITE_CONTAINMENT)
#: The behaviour of which each special case is one.
GENERAL = {
    CONSENSUS: BIPARTITE_CONSENSUS,
    SIGNED_AVERAGE_CONSENSUS: BIPARTITE_CONSENSUS,
    CONTAINMENT: BIPARTITE_CONTAINMENT,
}
#: Kinds of counterexamples.
CLOSED_SET, TWO_COMPONENTS, NO_CAMPS = "balanced closed set", "two closed components", "no camps"
DIFFERENT, MOVING, STABLE = "different kernels", "moving rest state", "stable member"


@dataclass(frozen=True)
class Counterexample:
    """What refutes a behaviour for every signal; each kind is verified in exact arithmetic from the family alone.

    Attributes
    ----------
    kind : str
        - "balanced closed set": no mandatory edge of a mode enters ``nodes``, and all its mandatory edges among them
          keep ``camps``: held constant with the optional edges off, it stays at the camps, and does not come to 0;
        - "two closed components": a mode has two; held constant, they do not meet;
        - "no camps": signs along ``cycle``, a closed walk of edges, multiply to -1: no camps keep all of these edges.
          They may be of any modes; where signals are constant, they are of the mode ``mode``, in which all agents hear
          one closed component: a member with one of the edges on has no camps;
        - "different kernels": the mandatory graphs of two modes have kernels of different dimensions;
        - "moving rest state": a state is at rest in the mandatory graph of the first mode, and moves in another member;
        - "stable member": the member of the mode with the edges ``off`` off and all others on has no state at rest but
          0: the signs along a closed walk in each of its closed components multiply to -1.
    mode, other : int
        Numbers of the modes, from 0; of the member in which the state moves, ``other``.
    nodes : tuple of int
        The balanced closed set, or one node of each of the two components.
    camps : tuple of +1/-1
        Those of ``nodes``.
    cycle : tuple of (source, target)
    edge : int or None
        The uncertain edge of the mode ``other`` that is at ``w+`` in that member; None if none is.
    column : int or None
        The balanced closed component of the first mode at the camps of which the state is, the others being at 0.
    state : tuple of N Fraction, or None
        The state that moves; None where it takes a solve of too many rows.
    enclosure : StateEnclosure or None
        Then an enclosed state that moves. None also where floats find none: then edges alone tell, for one end of an
        edge is in a camp of ``column`` for all weights of the first mode, and the other is not.
    off : tuple of int
        Optional edges of ``mode``.

    References
    ----------
    docs/theory/families.md, "Refutations".
    """

    kind: str
    mode: int = 0
    other: int = 0
    nodes: tuple[int, ...] = ()
    camps: tuple[int, ...] = ()
    cycle: tuple[Edge, ...] = ()
    edge: int | None = None
    column: int | None = None
    state: tuple[Fraction, ...] | None = None
    enclosure: StateEnclosure | None = None
    off: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class FamilyComponent(Shown):
    """One weakly connected component of the union of all modes, and what it does under every signal.

    Attributes
    ----------
    nodes : (n,) int array
        Indices, ascending. Nodes of the attributes below are numbered within it.
    family : Family
        The family on these nodes.
    behaviour : str or None
        ``stability``, ``bipartite consensus``, ``interval bipartite consensus``, ``bipartite containment`` or
        ``depends on the signal``; None where it is not decided. See :func:`decide`.
    gauge : (n,) int8 array or None
        Camps that all edges of all modes keep, the first node +1; None if there are none.
    kernel : Kernel or None
        The states at rest in every member; None where there may be none in common.
    counterexample : Counterexample or None
        Where it depends on the signal: why there is no common kernel; of constant signals, a member that is stable
        where another is not.
    signal : {"any", "constant"}
    """

    nodes: np.ndarray
    family: Family
    behaviour: str | None
    gauge: np.ndarray | None
    kernel: Kernel | None
    counterexample: Counterexample | None
    signal: str = "any"

    def __repr__(self) -> str:
        signals = {"any": "every signal", "constant": "constant signals"}[self.signal]
        whom = "" if self.behaviour in (None, DEPENDS) else f" for {signals}"
        size = counted(self.nodes.size, "node")
        if len(self.family.modes) > 1:
            size += f", {len(self.family.modes)} modes"
        return f"FamilyComponent({size}, {self.behaviour or 'not decided'}{whom})"

    @cached_property
    def structures(self) -> tuple[Structure, ...]:
        """The structure of the mandatory graph of every mode."""
        return tuple(analyse(mode.mandatory) for mode in self.family.modes)

    @cached_property
    def special(self) -> tuple[str, ...]:
        """The sharper behaviours that every signal shows, the sharpest last.

        - Signed-average consensus: bipartite consensus where each edge of each mode is undirected, both directions one
          parameter or known: ``g' X`` stays what it is.
        - Consensus, and containment: all edges of all modes are positive.

        References
        ----------
        Corollaries 1 to 5 of [Zhu]_; docs/theory/families.md.

        Examples
        --------
        >>> decide(Family.from_intervals([("a", "b", 1, 2)], undirected=True))[0].special
        ('signed-average consensus', 'consensus')
        """
        if self.behaviour not in CHAIN:
            return ()
        positive = bool((self.family.union[2] > 0).all())
        if self.behaviour != BIPARTITE_CONSENSUS:
            return (CONTAINMENT,) if positive else ()
        pairs = zip(self.family.modes, self.structures, strict=True)
        undirected = all(mode.tied or (mode.known.all() and s.undirected) for mode, s in pairs) and self.nodes.size > 1
        special = [SIGNED_AVERAGE_CONSENSUS] if undirected else []
        if positive:
            special.append(CONSENSUS)
        return tuple(special)

    @property
    def sharpest(self) -> str:
        """The sharpest behaviour, or that none is decided.

        Examples
        --------
        >>> decide([("a", "b", 1, 2)])[0].sharpest
        'consensus'
        """
        return (self.behaviour or "not decided", *self.special)[-1]

    @property
    def camps(self) -> list[np.ndarray]:
        """The camps that all edges of all modes keep, that of the first node first; one or two, or none."""
        if self.gauge is None:
            return []
        return [side for sign in (1, -1) if (side := np.flatnonzero(self.gauge == sign)).size]

    def holds(self, behaviour: str) -> bool | None:
        """Tell whether every signal shows ``behaviour``, special cases included; None if undecided.

        Examples
        --------
        >>> pair = decide(Family.from_intervals([("a", "b", 0, 1), ("b", "a", 1, 2)]))[0]
        >>> pair.behaviour, pair.holds("containment"), pair.holds("signed-average consensus")
        ('bipartite consensus', True, False)
        """
        if behaviour in GENERAL:
            general = self.holds(GENERAL[behaviour])
            special = behaviour in self.special or (behaviour == CONTAINMENT and CONSENSUS in self.special)
            return special if general else general
        if self.behaviour is None and behaviour in CHAIN[1:]:
            return False if self.refutation(behaviour) else None
        chain = CHAIN[CHAIN.index(self.behaviour) :] if self.behaviour in CHAIN else (self.behaviour,)
        return behaviour in chain

    def refutation(self, behaviour: str) -> Counterexample | None:
        """Return what refutes ``behaviour`` for every signal; None if it holds, or is not decided.

        None also where a special case alone does not hold.

        Examples
        --------
        >>> pair = Family.from_intervals([("a", "b", 0, 1), ("b", "a", 1, 2)])
        >>> decide(pair)[0].refutation("stability").kind
        'balanced closed set'
        """
        behaviour = GENERAL.get(behaviour, behaviour)
        if self.behaviour is not None and self.holds(behaviour):
            return None
        if behaviour == STABILITY:
            return self._balanced_closed_set()
        if behaviour == BIPARTITE_CONSENSUS:
            return self._two_components() or self._negative_cycle()
        if self.behaviour == STABILITY:
            return _stable_member(0, self.family.modes[0])
        two = self._two_components() if behaviour == INTERVAL_BIPARTITE_CONSENSUS else None
        return two or self.counterexample

    def plot(self, behaviour: str | None = None, **keywords: Any) -> Any:
        """Draw what refutes a behaviour: a run from the state, under the signal, that the counterexample names.

        Parameters
        ----------
        behaviour : str, optional
            By default the counterexample of the component is drawn, why its behaviour depends on the signal.
        **keywords : Any
            ``ax``, ``protocol`` and ``time_unit`` of
            :func:`~ptcc_certify.report.plots.counterexample.plot_counterexample`.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ParameterError
            There is no counterexample, or no state of it is known.

        Examples
        --------
        >>> decide(Family.from_intervals([("a", "b", 1, 2)]))[0].plot("stability").get_ylabel()
        'state $x_k$'
        """
        why = self.counterexample if behaviour is None else self.refutation(behaviour)
        return rendered("plots.counterexample.plot_counterexample", self, why=why, **keywords)

    def _balanced_closed_set(self) -> Counterexample | None:
        for number, structure in enumerate(self.structures):
            for closed in structure.closed_components:
                if closed.gauge is not None:
                    return Counterexample(CLOSED_SET, number, nodes=closed.nodes, camps=closed.gauge)
        return None

    def _two_components(self) -> Counterexample | None:
        for number, structure in enumerate(self.structures):
            if len(structure.closed_components) > 1:
                one, two = structure.closed_components[:2]
                return Counterexample(TWO_COMPONENTS, number, nodes=(one.nodes[0], two.nodes[0]))
        return None

    def _negative_cycle(self) -> Counterexample | None:
        edges = [self.family.union]
        if self.signal == "constant":
            edges = [(mode.source, mode.target, mode.sign) for mode in self.family.modes]
        for number, some in enumerate(edges):
            _, violated, negative_cycle = find_camps(self.family.n_nodes, *some)
            if violated.size:
                return Counterexample(NO_CAMPS, number, cycle=negative_cycle(int(violated[0])))
        return None


def decide(family: Any, signal: str = "any") -> tuple[FamilyComponent, ...]:
    """Decide what every weakly connected component of a family does under every signal.

    Stability and bipartite consensus are always decided. Whether a component keeps one kernel of other rows is decided
    up to 120 rows that edges do not tell. Above, it is refuted by edges, or by an enclosed state that moves, and proved
    where edges tell: uncertain edges join agents in one camp, or whose news come through one agent, and in every mode
    agents weigh what they hear in the same shares. What remains undecided are rows that agree by a coincidence of
    weights, or nearly. Under constant signals everything is decided.

    Parameters
    ----------
    family : family-like
        Whatever :func:`ptcc_certify.as_family` takes.
    signal : {"any", "constant"}
        ``any``: modes and weights change at any instants, arbitrarily often. ``constant``: they are those of one
        member, which is not known. A claim for constant signals does not hold for others.

    Returns
    -------
    tuple of FamilyComponent
        Ordered by smallest node.

    Raises
    ------
    ParameterError
        No signals are called so.
    GraphError
        It is no family and no graph.

    References
    ----------
    docs/theory/families.md, "The decision".

    Examples
    --------
    >>> from ptcc_certify.graphs.digraph import SignedDigraph
    >>> day = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    >>> night = SignedDigraph.from_edges([("c", "a", -2), ("a", "b", 1)])
    >>> [c.behaviour for c in decide(Family.switching([day, night]))]
    ['bipartite consensus']
    >>> spoiled = SignedDigraph.from_edges([("c", "a", 2), ("a", "b", 1)])
    >>> component = decide(Family.switching([day, spoiled]))[0]
    >>> component.behaviour, component.counterexample.kind
    ('depends on the signal', 'moving rest state')
    >>> decide(Family.switching([day, spoiled]), signal="constant")[0].behaviour
    'bipartite consensus'
    """
    if signal not in SIGNALS:
        raise ParameterError(f'signals are "any" or "constant", not "{shorten(str(signal))}"')
    family = as_family(family)
    n = family.n_nodes
    source, target, _ = family.union
    result = []
    for nodes in weak_components(n, source, target):
        part = family if nodes.size == n else family.restricted(nodes)
        result.append(_decide_connected(nodes, part, signal))
    return tuple(result)


def _decide_connected(nodes: np.ndarray, family: Family, signal: str) -> FamilyComponent:
    structures = tuple(analyse(mode.mandatory) for mode in family.modes)
    camps = structures[0].gauge
    if structures[0].graph.n_edges < family.union[0].size:  # of all modes, and edges that may fail
        gauge, violated, _ = find_camps(family.n_nodes, *family.union)
        camps = None if violated.size else gauge
    if signal == "constant":
        behaviour, kernel, counterexample = _under_constant_signals(family, structures)
    else:
        behaviour, kernel, counterexample = _under_any_signal(family, structures, camps)
    component = FamilyComponent(nodes, family, behaviour, camps, kernel, counterexample, signal)
    component.__dict__["structures"] = structures
    return component


def _under_any_signal(
    family: Family, structures: tuple[Structure, ...], camps: np.ndarray | None
) -> tuple[str | None, Kernel | None, Counterexample | None]:
    one_component = all(len(s.closed_components) == 1 for s in structures)
    dimensions = [sum(c.balanced for c in s.closed_components) for s in structures]
    if not any(dimensions):
        return STABILITY, Kernel(structures[0]), None
    if camps is not None and one_component:
        return BIPARTITE_CONSENSUS, Kernel(structures[0]), None
    if len(set(dimensions)) > 1:
        most, least = int(np.argmax(dimensions)), int(np.argmin(dimensions))
        return DEPENDS, None, Counterexample(DIFFERENT, most, least)
    common = Kernel(structures[0])
    try:
        if counterexample := moving_rest_state(family, common):
            return DEPENDS, None, counterexample
    except TooLarge:
        return None, None, None
    return INTERVAL_BIPARTITE_CONSENSUS if one_component else BIPARTITE_CONTAINMENT, common, None


def moving_rest_state(family: Family, kernel: Kernel) -> Counterexample | None:
    """Return a state of a mandatory graph's kernel that moves in some member of the family; None if there is none.

    Raises
    ------
    TooLarge
        None is found, and there may be one.

    Examples
    --------
    >>> pair = Family.from_intervals([("a", "b", 1, 1), ("b", "a", -1, 0)])
    >>> moving_rest_state(pair, Kernel(analyse(pair.modes[0].mandatory))).edge
    0
    """
    unknown = False
    for number, mode in enumerate(family.modes):
        uncertain = np.flatnonzero(~mode.known)
        ends = (end[uncertain] for end in (mode.source, mode.target, mode.sign))
        own = mode.mandatory is kernel.structure.graph
        rows = ((None, question) for question in kernel.row_questions(mode.mandatory)) if not own else ()
        edges = ((int(uncertain[edge]), question) for edge, question in kernel.edge_questions(*ends))
        try:
            # An edge tells only where the mandatory graph of its mode leaves the state at rest.
            if answer := first_answer(kernel, rows) or first_answer(kernel, edges):
                edge, column, question = answer
                state = None if column is None else kernel.column(column)
                enclosure = kernel.enclosure if state is None and kernel.moves_enclosed(question) else None
                return Counterexample(MOVING, 0, number, edge=edge, column=column, state=state, enclosure=enclosure)
        except TooLarge:
            unknown = True
    if unknown:
        raise TooLarge
    return None


# ---------------------------------------------------------------------- constant signals


def _under_constant_signals(
    family: Family, structures: tuple[Structure, ...]
) -> tuple[str | None, Kernel | None, Counterexample | None]:
    """Return what every member does.

    An edge that is added to a graph only destroys balanced closed sets. So all members are stable iff the mandatory
    graphs are, and each has a balanced closed component iff it has one with all optional edges on, whatever their signs
    (:func:`_stable_member`). If the mandatory graph of a mode has one closed component, so has every member; otherwise
    it is itself a member with two. With one, its camps are those of all agents: consensus iff every edge keeps them.
    """
    if not any(c.balanced for s in structures for c in s.closed_components):
        return STABILITY, Kernel(structures[0]), None
    for number, mode in enumerate(family.modes):
        if counterexample := _stable_member(number, mode):
            return DEPENDS, None, counterexample
    if any(len(s.closed_components) > 1 for s in structures):
        return BIPARTITE_CONTAINMENT, None, None
    camps = (find_camps(family.n_nodes, mode.source, mode.target, mode.sign) for mode in family.modes)
    agree = not any(violated.size for _, violated, _ in camps)
    return BIPARTITE_CONSENSUS if agree else INTERVAL_BIPARTITE_CONSENSUS, None, None


def _stable_member(number: int, mode: Mode) -> Counterexample | None:
    """Return a stable member of a mode; None if every member has a balanced closed component.

    All optional edges are on, of two with opposite signs one. A closed component of that graph that is balanced holds a
    balanced one of every member, unless two edges of opposite signs lie in it: taking the other one spoils its camps,
    for a strongly connected graph stays connected without the edge. Both directions of an undirected one, however, are
    taken together, and spoil nothing if nothing else joins their ends.
    """
    double = np.flatnonzero((mode.source[1:] == mode.source[:-1]) & (mode.target[1:] == mode.target[:-1]))
    on = np.ones(mode.n_edges, dtype=bool)
    on[double + 1] = False
    structure = analyse(mode.member(on))
    strong = structure.strong_component
    inside = double[strong[mode.source[double]] == strong[mode.target[double]]]
    spoils = {}
    if mode.tied and inside.size:
        bridges = _bridges(mode)
        inside = np.array([e for e in inside.tolist() if _ends(mode, e) not in bridges], dtype=np.int64)
    for edge in inside.tolist():
        spoils[int(strong[mode.target[edge]])] = edge
    for closed in structure.closed_components:
        if closed.balanced:
            edge = spoils.get(int(strong[closed.nodes[0]]))
            if edge is None:
                return None
            pair = [e for e in double.tolist() if e == edge or (mode.tied and _ends(mode, e) == _ends(mode, edge))]
            on[pair], on[np.array(pair) + 1] = False, True
    return Counterexample(STABLE, number, off=tuple(np.flatnonzero(~on).tolist()))


def _ends(mode: Mode, edge: int) -> frozenset[int]:
    return frozenset((int(mode.source[edge]), int(mode.target[edge])))


def _bridges(mode: Mode) -> set[frozenset[int]]:
    """Return the pairs of nodes that nothing joins but the edges between them."""
    import networkx as nx

    pairs = nx.Graph(zip(mode.source.tolist(), mode.target.tolist(), strict=True))
    return set(map(frozenset, nx.bridges(pairs)))


#: Names that are listed, edges of a closed walk, and characters of a name.
_LISTED, _STEPS, _WIDTH = 4, 8, 24
#: Characters of a sentence about a state, of which fewer values are listed rather than that its end is cut off.
_SENTENCE = 105


def counterexample_text(component: FamilyComponent, why: Counterexample, mark: Callable[[str], str] = str) -> str:
    """Tell in one sentence what refutes a behaviour of a component for every signal.

    Parameters
    ----------
    component : FamilyComponent
        Whose nodes and modes ``why`` numbers.
    why : Counterexample
    mark : callable
        How a label or the name of a mode is marked.

    Returns
    -------
    str
        Without a full stop.

    Examples
    --------
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> (pair,) = decide(Family.from_intervals([("a", "b", 0, 1), ("b", "a", 1, 2)]))
    >>> counterexample_text(pair, pair.refutation("stability"))
    'held constant and its optional edges off, b hears nobody else and keeps its value'
    """
    family, names = component.family, [mark(shorten(label, _WIDTH)) for label in component.family.labels]
    where = f"held in {mark(mode_name(family, why.mode))}" if len(family.modes) > 1 else "held constant"
    if why.kind == CLOSED_SET:
        without = " and its optional edges off" if family.modes[why.mode].optional.any() else ""
        group = [names[v] for v in why.nodes]
        if len(group) == 1:
            return f"{where}{without}, {group[0]} hears nobody else and keeps its value"
        return f"{where}{without}, {_listed(group)} hear nobody else and stay at {_camps(group, why.camps)}"
    if why.kind == TWO_COMPONENTS:
        first, second = (names[v] for v in why.nodes)
        return f"{where}, the leader groups of {first} and {second} do not hear each other, and do not meet"
    if why.kind == NO_CAMPS:
        steps = list(dict.fromkeys(f"{names[source]} -> {names[target]}" for source, target in why.cycle))
        if len(steps) == 1:
            return f"{steps[0]} has both signs, so that no camps keep it"
        return f"the signs of {_first(steps, _STEPS)} multiply to -1, so that no camps keep them"
    if why.kind == DIFFERENT:
        return _different(component, why, mark)
    if why.kind == STABLE:
        off = [_edge(family.modes[why.mode], edge, names) for edge in why.off]
        states_of_edges = f"with {_listed(off)} off and every other edge on" if off else "with every edge on"
        mode = mark(mode_name(family, why.mode))
        return f"{mode if len(family.modes) > 1 else 'the graph'} {states_of_edges} is stable: all its agents end at 0"
    return _moving(family, names, why, mark)


def mode_name(family: Family, number: int) -> str:
    """Return what a mode is called.

    Examples
    --------
    >>> mode_name(Family.from_intervals([("a", "b", 1, 2)]), 0)
    'the graph'
    """
    return shorten(family.modes[number].name or (f"mode {number + 1}" if len(family.modes) > 1 else "the graph"), 40)


def _different(component: FamilyComponent, why: Counterexample, mark: Callable[[str], str]) -> str:
    """Tell how many leader groups keep values in one mode and in another."""
    counts = [
        sum(c.balanced for c in component.structures[number].closed_components) for number in (why.mode, why.other)
    ]
    first, second = (mark(mode_name(component.family, number)) for number in (why.mode, why.other))
    groups = f"{counts[0]} leader group{'s keep values' if counts[0] > 1 else ' keeps its value'} in {first}"
    return f"{groups}, {counts[1]} in {second}" if counts[1] else f"{groups}, none in {second} (every agent ends at 0)"


def _moving(family: Family, names: Sequence[str], why: Counterexample, mark: Callable[[str], str]) -> str:
    """Tell which state is at rest in one member and moves in another."""
    modes = (f"in {mark(mode_name(family, number))} " for number in (why.mode, why.other))
    first, second = modes if len(family.modes) > 1 else ("", "")
    if why.edge is not None:
        optional = family.modes[why.other].optional[why.edge]
        second += f"with {_edge(family.modes[why.other], why.edge, names)} {'on' if optional else 'at its largest'}"
        if why.mode == why.other:
            first += "at the least weights "
    if why.state is not None:
        size = max(map(abs, why.state)) or Fraction(1)
        values = [f"{name}={_number(x / size)}" for name, x in zip(names[:_LISTED], why.state, strict=False)]
        for listed in range(len(values), 0, -1):
            state = values[:listed] if listed == len(names) else [*values[:listed], "..."]
            sentence = f"the state {', '.join(state)} rests {first}and moves {second}".rstrip()
            if len(unlabelled(sentence)) <= _SENTENCE:
                return sentence
    group = "" if why.column is None else f" at the camps of leader group {why.column + 1}"
    return f"a state{group} rests {first}and moves {second}".rstrip()


def _number(x: Fraction) -> str:
    short = abs(x.numerator) < 1000 and x.denominator < 1000
    return str(x) if short else f"{nearest_float(x):.4g}"


def _edge(mode: Mode, edge: int, names: Sequence[str]) -> str:
    return f"{names[mode.source[edge]]} -> {names[mode.target[edge]]}"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _LISTED:,} more" if len(names) > _LISTED else ""
    return ", ".join(names[:_LISTED]) + more


def _first(names: Sequence[str], count: int) -> str:
    return ", ".join(names if len(names) <= count else (*names[:count], "..."))


def _camps(names: Sequence[str], camps: Sequence[int]) -> str:
    signs = [f"{name}={sign}" for name, sign in zip(names[:_LISTED], camps, strict=False)]
    return ", ".join(signs if len(names) <= _LISTED else (*signs, "..."))


def last_mode_behaviours(component: FamilyComponent) -> tuple[str | None, ...]:
    """Return what each mode does to all agents of a component if it acts for ever, its weights still changing.

    None for a mode that has uncertain weights and neither brings all agents to 0 nor to one value up to camps: where
    its weights move on, its agents need not come to rest.

    Examples
    --------
    >>> from ptcc_certify.graphs.family import Family
    >>> from ptcc_certify.theorems.family_behaviour import decide
    >>> day, outage = SignedDigraph.from_edges([("a", "b", 1)]), SignedDigraph.from_edges([], nodes="ab")
    >>> last_mode_behaviours(decide(Family.switching([day, outage]))[0])
    ('bipartite consensus', 'bipartite containment')
    """
    result: list[str | None] = []
    for mode, structure in zip(component.family.modes, component.structures, strict=True):
        closed = structure.closed_components
        camps_fit = not find_camps(component.family.n_nodes, mode.source, mode.target, mode.sign)[1].size
        if not any(c.balanced for c in closed):
            result.append(STABILITY)
        elif len(closed) == 1 and camps_fit:
            result.append(BIPARTITE_CONSENSUS)
        elif not mode.known.all():
            result.append(None)
        else:
            result.append(INTERVAL_BIPARTITE_CONSENSUS if len(closed) == 1 else BIPARTITE_CONTAINMENT)
    return tuple(result)


def last_mode_shows(own: str | None, behaviour: str, positive: bool = False) -> bool | None:
    """Tell whether a mode that does ``own`` shows a behaviour, special cases included; None if that is not known.

    Consensus and containment are bipartite ones without negative edges.

    Parameters
    ----------
    own : str or None
        One of :func:`last_mode_behaviours`.
    behaviour : str
    positive : bool
        Whether all edges by which they do it are positive.

    Examples
    --------
    >>> last_mode_shows("bipartite consensus", "bipartite containment"), last_mode_shows("stability", "consensus")
    (True, False)
    >>> last_mode_shows("bipartite consensus", "consensus", positive=True)
    True
    """
    if own is None:
        return None
    general = GENERAL.get(behaviour, behaviour)
    if general not in (CHAIN[CHAIN.index(own) :] if own in CHAIN else (own,)):
        return False
    if behaviour not in GENERAL or (positive and behaviour != SIGNED_AVERAGE_CONSENSUS):
        return True
    return False if behaviour == CONSENSUS else None
