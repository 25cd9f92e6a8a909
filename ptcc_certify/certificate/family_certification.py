"""The steps of ``certify`` for a family of graphs: what every signal does, proved.

A family of one mode with known weights is a graph, and :func:`ptcc_certify.certify` certifies it as one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from lmi import search_time as deadline
from lmi.exact.decimal_rounding import counted
from lmi.search_time import share_of_time
from ptcc_certify.bounds.envelope import FRACTIONS
from ptcc_certify.bounds.final_state.attracting_box import AttractingBox, box_of_family
from ptcc_certify.bounds.final_state.constant_weights import with_means
from ptcc_certify.certificate.certificate import Certificate
from ptcc_certify.certificate.constrained_switching.claims import RateClaim
from ptcc_certify.certificate.constrained_switching.search import STEP, claims_for, require_nominal
from ptcc_certify.certificate.evidence import Observations
from ptcc_certify.certificate.family_proof import ComponentProof, FamilyProof
from ptcc_certify.certificate.functions import ProvedFunction
from ptcc_certify.certificate.request import Question
from ptcc_certify.checker.constrained_switching import reachable_bounds
from ptcc_certify.checker.family import MANY_MODES
from ptcc_certify.checker.matrix_products import LARGEST_ROWS
from ptcc_certify.checker.reading import Interval
from ptcc_certify.checker.row_functions import MANY_FUNCTIONS
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.graphs.rationals import nearest_float, writable
from ptcc_certify.graphs.size_limits import EXACT_NODES
from ptcc_certify.graphs.structure import BIPARTITE_CONSENSUS, STABILITY
from ptcc_certify.lyapunov.common_form_search import (
    CLOSED_ROWS,
    FULL_ROWS,
    Aim,
    CommonFormSearch,
    aimed_functions,
    search_common_forms,
)
from ptcc_certify.lyapunov.common_forms import CommonForm, Quotient
from ptcc_certify.lyapunov.follower_function import follower_functions
from ptcc_certify.lyapunov.follower_rows import leading_group
from ptcc_certify.lyapunov.slow_signals import prove_signal_rate_bound
from ptcc_certify.lyapunov.squares_function import SquaresFunction, squares_function
from ptcc_certify.model import Protocol
from ptcc_certify.model.asks import Case
from ptcc_certify.model.constrained_switching import ClockShares, JointWindows, read_signal
from ptcc_certify.model.reaching_time import ReachingTime
from ptcc_certify.theorems.contractions import refuse_impossible_windows
from ptcc_certify.theorems.family_behaviour import DEPENDS, FamilyComponent, decide

STEPS = ("the decision", "upper bound on the decay rate", "Lyapunov functions", STEP, "independent check")
BOXES = "boxes of followers"
#: Share of the upper bound that ends the search, and share of the time that the bound may take at first.
_ENOUGH, _BOUND_SHARE = Fraction(99, 100), 0.3
#: The same share where what is asked rests on rows, and seconds of work that forms may take then.
_NEARLY, _BESIDE_ROWS = Fraction(9, 10), 8.0
#: Agents and edges of a component up to which ends are told between which each agent stays.
_MANY = 200_000


def refuse_signals(family: Family, case: Case) -> None:
    """Refuse more modes than a certificate holds, and restricted signals that the family or the protocol does not take.

    Raises
    ------
    ParameterError
        Tells which.
    """
    if len(family.modes) > MANY_MODES:
        mend = "put modes whose edges have the same signs into one, with intervals that hold them all; ptcc classify"
        raise ParameterError(
            f"{len(family.modes):,} modes, and a certificate holds {MANY_MODES:,} at most; {mend} and decide take any"
        )
    signal = read_signal(case.signal)
    require_nominal(signal, case.protocol)
    if isinstance(signal, JointWindows):
        refuse_impossible_windows(family, signal)
    if isinstance(signal, ClockShares) and len(signal.shares) != len(family.modes):
        shares = counted(len(signal.shares), "share")
        raise ParameterError(f"{shares} of the clock; give one for each of {len(family.modes)} modes")


def certify_family(
    family: Family,
    question: Question,
    reaching: tuple[ReachingTime, ...] | None,
    progress: Callable[[str], None],
) -> Certificate:
    """Take the steps for a family: what every signal does, proved, with what more is proved for those asked for.

    Parameters
    ----------
    family : Family
        The subject of the question.
    question : Question
    reaching : tuple of N ReachingTime, or None
    progress : callable
        Is told each of :data:`STEPS` as it begins.

    """
    progress(STEPS[0])
    components, request = decide(family), question.request
    parts, notes = [], list(family.notes)
    still = not any(question.sigma0 or ())
    begin = question.initial_state if still else None
    by_rows = request.messages is not None and leading_group(family) is None
    with deadline.time_limit(request.time_limit, work=request.by_work):
        for component in components:
            part = _prove(component, notes, progress, question.protocol, None if by_rows else begin, by_rows)
            parts.append(part if begin is None else _with_means(part))
        if request.signal != "any":
            progress(STEP)
        proof = FamilyProof(
            question=question,
            reaching=reaching,
            parts=tuple(parts),
            boxes=_boxes(parts, begin, notes),
            ranges=_ranges(parts, begin),
            restricted=claims_for(
                request.signal, parts, question.protocol, begin, notes, request.expectations.min_rate
            ),
        )
    notes = [f"{note}: cut off by the time limit" if note in (*STEPS, BOXES) else note for note in notes]
    return _fewer_functions(Certificate(proof, Observations(notes=tuple(dict.fromkeys(notes)))))


def _fewer_functions(certificate: Certificate) -> Certificate:
    """Leave out functions, slower ones first, that the check refuses since they are many or their proofs large.

    Claims for restricted signals that rest on a function left out are left out with it.
    """
    proof = certificate.family_proof
    parts = proof.parts
    functions = [(part, V) for part in parts for V in part.forms]
    work = sum((len(V.nodes) + len(tau)) ** 3 for _, V in functions for tau in V.multipliers)
    few = sum(len(part.functions) for part in parts) <= MANY_FUNCTIONS
    if (few and work <= LARGEST_ROWS**3) or not proof.checkable:
        return certificate
    for most in (1, 0):
        report = certificate.checked
        if report is None or report.accepted:
            break
        note = f"the independent check does not take all functions that were found: {report.reason}"
        claims = proof.restricted
        certificate = certificate.changed(
            parts=tuple(replace(part, functions=part.functions[:most]) for part in parts),
            restricted=tuple(c for c in claims if most or not (isinstance(c, RateClaim) and c.forms is None)),
            notes=tuple(dict.fromkeys((*certificate.observed.notes, note))),
        )
    return certificate


def _boxes(
    parts: Sequence[ComponentProof], state: Sequence[Fraction] | None, notes: list[str]
) -> dict[int, AttractingBox]:
    """Return the boxes of components that depend on the signal and have followers."""
    boxes: dict[int, AttractingBox] = {}
    if state is None:
        return boxes
    for number, part in enumerate(parts):
        if part.component.behaviour == DEPENDS:
            with share_of_time(1.0, BOXES, notes):
                x = [state[v] for v in part.component.nodes.tolist()]
                if (box := box_of_family(part.component.family, x)) is not None:
                    boxes[number] = box
    return boxes


def _ranges(parts: Sequence[ComponentProof], state: Sequence[Fraction] | None) -> dict[int, tuple[Interval, ...]]:
    """Return of components that depend on the signal between which ends each agent stays at all times."""
    ranges: dict[int, tuple[Interval, ...]] = {}
    for number, part in enumerate(parts if state is not None else ()):
        component = part.component
        if component.behaviour == DEPENDS and component.family.n_nodes + component.family.union[0].size <= _MANY:
            edges = zip(*(end.tolist() for end in component.family.union), strict=True)
            x = [state[v] for v in component.nodes.tolist()]  # type: ignore[index]
            ranges[number] = tuple(reachable_bounds(range(len(x)), edges, x).values())
    return ranges


def _with_means(part: ComponentProof) -> ComponentProof:
    """Add weighted means to the functions, where groups of leaders keep none exactly."""
    if all(group.vector is not None for group in part.leading_groups):
        return part
    groups = part.leading_groups
    functions = (with_means(V, groups) if isinstance(V, CommonForm) else V for V in part.functions)
    return replace(part, functions=tuple(functions))


def _squares(component: FamilyComponent, notes: list[str] | None = None) -> list[SquaresFunction]:
    """Return the weighted sum of squares of a component whose agents end at 0, if one is proved."""
    if component.behaviour != STABILITY:
        return []
    found = squares_function(component.family, notes)
    return [] if found is None else [found]


def _dense(component: FamilyComponent, notes: list[str]) -> tuple[ProvedFunction, ...]:
    """Return a dense form of a component of some hundreds of agents, if one is proved."""
    if component.nodes.size > CLOSED_ROWS or component.behaviour not in (STABILITY, BIPARTITE_CONSENSUS):
        return ()
    search = search_common_forms(Quotient.of(component), ["full"])
    notes += search.notes
    return search.functions


def _aim(quotient: Quotient, protocol: Protocol, x: Sequence[Fraction]) -> Aim | None:
    """Return where bounds should be small: at the instants that are reported; None where other functions serve."""
    begin = quotient.coordinates(x)
    if not (1 < len(begin) <= FULL_ROWS and any(begin)):
        return None
    top = max(map(abs, begin))
    clocks = protocol.gain.clock_at_remaining([1 - fraction for fraction in FRACTIONS])
    return Aim(np.array([nearest_float(xi / top) for xi in begin]), np.asarray(clocks))


def _prove(
    component: FamilyComponent,
    notes: list[str],
    progress: Callable[[str], None],
    protocol: Protocol,
    state: Sequence[Fraction] | None,
    by_rows: bool = False,
) -> ComponentProof:
    """Prove what every signal does; ``by_rows`` if what is asked rests on these, and forms tell the rate besides."""
    bare = ComponentProof(component)
    if component.kernel is None or component.nodes.size == 1 or not bare.certifiable:
        return bare
    if component.nodes.size > EXACT_NODES:
        progress(STEPS[2])
        functions: list[ProvedFunction] = []
        with share_of_time(1.0, STEPS[2], notes):
            functions += follower_functions(component, notes=notes)
            functions += _squares(component, notes) if not functions else []
            functions += _dense(component, notes) if not functions else []
        return ComponentProof(component, tuple(functions))
    quotient = Quotient.of(component)
    bound, search = None, CommonFormSearch()
    progress(STEPS[1])
    with share_of_time(_BOUND_SHARE, STEPS[1], notes):
        bound = prove_signal_rate_bound(quotient)
    progress(STEPS[2])
    squares: list[SquaresFunction] = []
    aimed: list[ProvedFunction] = []
    aim = None if state is None else _aim(quotient, protocol, [state[v] for v in component.nodes.tolist()])
    seconds = _BESIDE_ROWS if by_rows else math.inf
    with share_of_time(1.0, STEPS[2], notes), deadline.time_limit(seconds, work=True):
        squares = _squares(component)  # which takes no time to speak of
        enough = None if bound is None else (_NEARLY if by_rows else _ENOUGH) * bound.value
        search = search_common_forms(quotient, enough=enough, slower=aim is None and not by_rows)
        for V in () if aim is None else aimed_functions(quotient, aim, search.functions, notes):
            aimed.append(V)  # kept, whatever comes after
    notes += [*search.notes, *(f"{name}: cut off by the time limit" for name in search.cut_off)]
    rate = max((V.rate for V in search.functions), default=Fraction(0))
    if bound is not None and search.functions and rate < _ENOUGH * bound.value and not by_rows:
        with share_of_time(1.0, STEPS[1], notes):  # signals played against what was found
            again = prove_signal_rate_bound(quotient, search.functions)
            bound = bound if again is None else min(bound, again, key=lambda b: b.value)
    better = [V for V in squares if _ENOUGH * V.rate > rate]
    functions = sorted(filter(_written, (*search.functions, *aimed)), key=lambda V: -V.rate)
    return ComponentProof(component, (*better, *functions), bound)


def _written(V: ProvedFunction) -> bool:
    """Tell whether the entries of a form are short enough for a file, as those of long weights need not be."""
    return not isinstance(V, CommonForm) or all(writable(x) for row in V.matrix for x in row)
