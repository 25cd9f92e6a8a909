"""Facts of opinions in steps of time: whether they settle, where, how soon, who decides whom."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np

from lmi.exact.decimal_rounding import counted, up
from ptcc_certify.bounds.final_state.in_steps import OpinionsInSteps
from ptcc_certify.bounds.final_state.opinions import disagreement, polarisation
from ptcc_certify.certificate.fact import Fact, Facts, Standing
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.stubborn import agent_nodes
from ptcc_certify.report.facts.influence import influence_facts
from ptcc_certify.report.text_layout import agent_text, short_number, shorten_list, value_list

#: Columns of a list of names, and of values.
_NAMES, _VALUES = 60, 220


def steps_facts(found: OpinionsInSteps, steps: int, within: Fraction) -> Facts:
    r"""Tell what becomes of opinions, and where they are after so many steps.

    Examples
    --------
    >>> from ptcc_certify.report.facts.in_steps import steps_facts
    >>> from ptcc_certify.bounds.final_state.in_steps import opinions_in_steps
    >>> found = opinions_in_steps([("a", "b", 1), ("b", "a", 1), ("c", "d", 1)], [3, 1, 2, 5])
    >>> for fact in steps_facts(found, 4, Fraction(1, 100)):
    ...     print(f"{fact.head}: {fact.text}")
    model: x(t+1) = A x(t) in steps of time; sum |a_kl| = 1
    settles: not from every x(0): a, b go on in rounds of 2 steps
    means: a=2, b=2 in the long run (exact)
    ends: c=2, d=2 (exact)
    error: at most 0 after 4 steps, and 0.01 after 1 step: d, who hears, in the end, only who rests
    x(4): a=3, b=1, c=2, d=2 (a run, numerical)
    decides: not told, for not everybody settles
    """
    graph, agents, end = found.graph, agent_nodes(found.graph), found.final_state
    labels = graph.labels
    yield Fact(head="model", note="x(t+1) = A x(t) in steps of time; sum |a_kl| = 1")
    yield from _settling_facts(found, agents)
    kind = "exact" if end.exact else "numerical" if end.radius is None else f"within {up(max(end.radius), 2)}, proved"
    restless = [k for k in agents if found.restless[k]]
    for head, some, more in (
        ("means", restless, " in the long run"),
        ("ends", [k for k in agents if not found.restless[k]], ""),
    ):
        if some:
            names, states = [labels[k] for k in some], [end.states[k] for k in some]
            text = f"{value_list(names, states, _VALUES)}{more} ({kind})"
            standing: Standing = "unproved" if end.intervals is None else "proved"
            yield Fact(head=head, value=dict(zip(names, states, strict=True)), standing=standing, note=text)
    yield from _error_facts(found, steps, within)
    yield Fact(
        head=f"x({steps})",
        standing="observed",
        note=f"{value_list([labels[k] for k in agents], found.run(steps)[-1][agents], _VALUES)} (a run, numerical)",
    )
    if not found.converges:
        yield Fact(head="decides", note="not told, for not everybody settles")
        return
    try:
        for fact in influence_facts(found.influence):
            yield replace(fact, head="X") if fact.head == "x(T)" else fact
    except ParameterError as error:  # too many weights
        yield Fact(head="decides", note=f"not told: {error}")
    if end.exact:
        begin = found.initial_state
        values = {f.__name__: [f(graph, begin), f(graph, end.states)] for f in (polarisation, disagreement)}
        text = ", ".join(f"{name} {short_number(x)} -> {short_number(y)}" for name, (x, y) in values.items())
        yield Fact(head="opinions", value=values, note=f"from X: {text}")


def _settling_facts(found: OpinionsInSteps, agents: list[int]) -> Facts:
    labels = found.graph.labels
    if found.converges:
        yield Fact(head="settles", note="from every x(0), decided exactly")
        return
    for nodes, steps in found.periods.items():
        names = shorten_list([agent_text(labels[k]) for k in nodes], _NAMES)
        yield Fact(head="settles", value=steps, note=f"not from every x(0): {names} go on in rounds of {steps} steps")
    inside = {v for nodes in found.periods for v in nodes}
    if hearing := [agent_text(labels[k]) for k in agents if found.restless[k] and k not in inside]:
        verb = "hears" if len(hearing) == 1 else "hear"
        yield Fact(head="settles", note=f"nor {shorten_list(hearing, _NAMES)}, who {verb} of them")


def _error_facts(found: OpinionsInSteps, steps: int, within: Fraction) -> Facts:
    """Tell how near opinions are by when, and of whom that is proved."""
    moving = int((np.bincount(found.graph.target, minlength=found.graph.n_nodes) > 0).sum())
    if (decay := found.decay) is None:
        if moving:
            note = "no bound is proved; bounds are of agents that hear, in the end, only who rests"
            yield Fact(head="error", standing="unproved", note=note)
        return
    whom = "every agent"
    if moving > len(decay.weights):
        names = shorten_list([agent_text(found.graph.labels[k]) for k in decay.weights], _NAMES)
        whom = f"{names}, who {'hears' if len(decay.weights) == 1 else 'hear'}, in the end, only who rests"
    soon = decay.steps(within)
    bound = f"at most {_up(decay.after(steps))} after {counted(steps, 'step')}"
    note = f"{bound}, and {_up(within)} after {counted(soon, 'step')}: {whom}"
    yield Fact(head="error", value=soon, side="up", note=note)


def _up(x: Fraction) -> str:
    return up(x, 4) if x else "0"
