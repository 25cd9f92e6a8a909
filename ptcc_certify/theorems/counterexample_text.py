"""Counterexamples of families in words, with the names of modes and agents."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction

from ptcc_certify.errors import unlabelled
from ptcc_certify.graphs.family import Family, Mode
from ptcc_certify.graphs.rationals import nearest_float, shorten
from ptcc_certify.theorems.family_behaviour import (
    CLOSED_SET,
    DIFFERENT,
    NO_CAMPS,
    STABLE,
    TWO_COMPONENTS,
    Counterexample,
    FamilyComponent,
)

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
