"""One screen of text about a structure or a certificate."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import chain, repeat
from typing import TYPE_CHECKING

from lmi.exact.decimal_rounding import down, near, up
from lmi.exact.elementary_enclosures import LARGEST_PUSH
from ptcc_certify.graphs.structure import ClosedComponent, Structure
from ptcc_certify.theorems.claims import Claim

if TYPE_CHECKING:
    from ptcc_certify.bounds.input.effort import Effort
    from ptcc_certify.certificate.certificate import Certificate

_ORIENTATION = {
    "information": "a row a,b: information flows a -> b, b listens",
    "listens": "a row a,b: a listens to b",
    "matrix": "row = listener",
}

#: 1 - t/T and its name, where the screen tells what may be left.
_INSTANTS = ((0.5, "0.5 T"), (0.1, "0.9 T"), (0.01, "0.99 T"), (1e-6, "T(1-1e-6)"), (1e-9, "T(1-1e-9)"))


#: The head of a line, and its text; a line without a head belongs to the one before.
Lines = Iterator[tuple[str, str]]


def structure_lines(structure: Structure, name: str) -> list[str]:
    """Return the lines of ``ptcc classify``."""
    labels = structure.graph.labels

    def lines() -> Lines:
        yield from _graph_lines(structure, name)
        yield "nodes", _shorten_list(labels)
        yield "structure", structure_text(structure)
        for number, component in enumerate(structure.closed_components[:4], start=1):
            yield f"leaders {number}", _leaders_text(component, labels)
        if len(structure.closed_components) > 4:
            yield "", f"... {len(structure.closed_components)} closed components in all"
        if structure.followers.size:
            yield "followers", _shorten_list([labels[v] for v in structure.followers.tolist()])
        yield from _claim_lines([component.claim for component in structure.components])

    return _format_lines(lines())


def certificate_lines(certificate: Certificate, name: str) -> list[str]:
    """Return the lines of ``ptcc certify``: at most 28 for a connected graph."""
    structure, p = certificate.structure, certificate.protocol
    when = f"at T = {near(p.T)}" if p.reaching is None else f"at T_r + T_s = {near(p.T)} whatever the disturbance"

    def lines() -> Lines:
        yield from _graph_lines(structure, name)
        yield "structure", structure_text(structure)
        yield from _claim_lines(certificate.claims, f" {when}")
        names = [name for name in p.to_dict() if name != "kind"]
        yield "protocol", f"{p.kind}: {', '.join(f'{name} {near(getattr(p, name), 12)}' for name in names)}"
        if certificate.initial_state is not None:
            yield "x(0)", _pairs(structure.graph.labels, certificate.initial_state)
        for part in (_sliding_lines, _final_state_lines, _rate_lines, _effort_lines):
            yield from part(certificate)
        yield from zip(chain(["simulated"], repeat("")), _simulated(certificate), strict=False)
        if certificate.cut_off:
            named = f"the time limit of {certificate.time_limit:g} s ended {', '.join(certificate.cut_off)}"
            yield "cut off", f"{named}; what was proved by then stands"
        yield from (("note", note) for note in certificate.notes[:3])
        yield "verdict", certificate.assessment.text

    return _format_lines(lines())


def _graph_lines(structure: Structure, name: str) -> Lines:
    graph, negative = structure.graph, int((structure.graph.sign < 0).sum())
    yield "graph", f"{name}: {graph.n_nodes} nodes, {graph.n_edges} edges, {negative} negative"
    yield "read", "; ".join([_ORIENTATION[graph.read["orientation"]], *remarks_on(structure)])


def _leaders_text(component: ClosedComponent, labels: Sequence[str]) -> str:
    """Tell how a group of leaders splits, or why it does not."""
    nodes = [labels[v] for v in component.nodes]
    if component.negative_cycle is not None:
        steps = " ".join(f"{labels[s]}->{labels[t]}" for s, t in component.negative_cycle[:12])
        more = " ..." if len(component.negative_cycle) > 12 else ""
        return f"{_shorten_list(nodes)}: unbalanced, negative cycle {steps}{more}"
    sides = camps(component)
    text = " against ".join("{" + _shorten_list([labels[v] for v in camp], 40) + "}" for camp in sides)
    return f"balanced, {'camps ' if len(sides) > 1 else 'one camp '}{text}"


def camps(component: ClosedComponent) -> list[list[int]]:
    """Return the camps of a balanced leader group, the one of its first node first."""
    gauge = component.gauge or ()
    both = ([v for v, g in zip(component.nodes, gauge, strict=True) if g == sign] for sign in (1, -1))
    return [camp for camp in both if camp]


def _final_state_lines(certificate: Certificate) -> Lines:
    """Tell where the agents end."""
    result = certificate.final_state
    if result is None:
        return
    kind = "exact" if result.exact else "floating point"
    if result.radius is not None:
        widest = max(result.radius)
        kind = f"to within {up(widest, 2)}, proved" if widest else "exact"
    if kind != "floating point" and any(Fraction(_digits(x)) != x for x in result.states[:100]):
        kind += "; here to 5 digits"
    yield "x(T)", f"{_pairs(certificate.graph.labels, result.states)} ({kind})"
    if result.degenerate:
        groups = ", ".join(map(str, result.degenerate))
        yield "", f"degenerate initial state: leader group {groups} meets at 0, although it is balanced"


def _rate_lines(certificate: Certificate) -> Lines:
    rate, bound, spectral = certificate.rate, certificate.upper_bound, certificate.spectral_rate
    best = "" if bound is None else f"; upper bound {up(bound, 8)}, proved"
    if bound is not None and spectral is not None and bound > Fraction(spectral) * Fraction(101, 100):
        best += f" ({spectral:.6g}, numerical)"
    if certificate.constant:
        invariant = "its state" if certificate.direct else "x - sigma"
        yield "rate", f"no agent listens to another, each keeps {invariant}: there is nothing to decay"
        return
    if rate is None:
        numerical = certificate.numerical_rate
        yield "rate", f"not proved{'' if numerical is None else f'; numerically {numerical:.6g}'}{best}"
        return
    ratio = "" if bound is None else f", optimality ratio at least {down(rate / bound, 4)}"
    yield "rate", f"{down(rate)} per unit of s, proved: V <= e^(-rate s) V(0){best}{ratio}"
    yield from _class_lines(certificate)
    yield from _residual_lines(certificate) if certificate.direct else _reaching_lines(certificate)
    yield from _deviation_lines(certificate)
    arithmetic = "exact arithmetic" if certificate.direct else "exact or ball arithmetic"
    text, report = f"{len(certificate.obligations)} proof obligations proved in {arithmetic}", certificate.checked
    if report is not None:
        text += "; checked without a solver: " + ("accepted" if report.accepted else f"{report.rejected} REJECTED")
    yield "proof", text


def _class_lines(certificate: Certificate) -> Lines:
    """Tell the Lyapunov functions of the envelope: class, rate, overshoot; what was searched; the paper's formula."""
    V, search = certificate.lyapunov, certificate.search
    if V is not None and certificate.proof.rate is not None:
        rho = "" if V.rho is None else f", rho {float(V.rho):.4g}"
        overshoot = f"overshoot constant {up(V.overshoot, 4)} of ||{V.coordinates}||^2"
        yield "", f"paper {down(certificate.proof.rate)} = {V.objective}{rho}; {overshoot}"
    if search.searched:
        searched = [f"{kind} {rate:.4g}" for kind, rate in search.searched.items()]
        limit = "" if search.diagonal_limit is None else f"; diagonal upper bound {search.diagonal_limit:.4g}"
        time = f"; time limit {certificate.time_limit:.3g} s" if math.isfinite(certificate.time_limit) else ""
        yield "", f"searched {', '.join(searched)} (numerical{limit}{time})"
        used = [f"{V.kind} {down(V.proved_rate, 4)} (overshoot {up(V.overshoot, 2)})" for V in search.functions]
        yield "", f"used {', '.join(used) or 'none, no rate was proved'}"


def _at_instants(values: Iterable[float], names: Iterable[str]) -> str:
    """List bounds at instants, rounded up."""
    return ", ".join(f"{up(float(x), 2)} at {name}" for x, name in zip(values, names, strict=True))


def _deviation_lines(certificate: Certificate) -> Lines:
    """Tell how far from its final state the farthest agent may be, and every agent at the instant asked for."""
    if certificate.initial_state is None or not any(V.deviation for V in certificate.functions):
        return
    instants = [(q, name) for q, name in _INSTANTS[:4] if certificate.direct or q <= _sliding_share(certificate)]
    worst = certificate.deviation_bound([q for q, _ in instants]).max(axis=0, initial=0.0)
    if instants:
        numerical = "" if certificate.direct else " (numerical, rounded up)"
        bounds = _at_instants(worst, (name for _, name in instants))
        yield "deviation", f"of every agent from its final state at most {bounds}{numerical}"
    if certificate.at is not None:
        each = certificate.deviation_bound([float(1 - certificate.at / certificate.protocol.T)])[:, 0]
        entries = [f"{label} {up(float(x), 2)}" for label, x in zip(certificate.graph.labels, each, strict=True)]
        yield "", f"at t = {near(certificate.at, 12)}: {_shorten_list(entries)}"


def _effort_lines(certificate: Certificate) -> Lines:
    """Tell whether the input stays finite, and how large it gets."""
    effort = certificate.effort
    if effort is None or certificate.constant:
        return
    lower, upper = effort.threshold
    product = f"rho2 kappa min Re lambda >= {down(lower, 5)}" if lower is not None else "nothing else is proved"
    if effort.bounded:
        how = {"rate": f"{product}, 1 is enough", "spectrum": "by the exact spectrum"}[effort.by or "rate"]
        yield "input", f"bounded up to the deadline for every initial state: {how}"
    elif effort.bounded is False:
        below = f" <= {up(upper, 5)}" if upper is not None and effort.by == "upper_bound" else " = 1 or less"
        yield "INPUT", "NOT BOUNDED: the state converges, but from some initial states the input grows without limit"
        enough = "" if certificate.rate is None else f" to {up(2 / certificate.rate, 5)} or more"
        yield "", f"rho2 kappa min Re lambda{below}; it takes 1: raise rho2 * kappa{enough}"
    else:
        yield "input", f"bounded or not is undecided: {product}, it takes 1"
    sizes = []
    if effort.peak is not None:
        most = max(range(len(effort.peak.agents)), key=effort.peak.agents.__getitem__)
        label = certificate.graph.labels[most]
        sizes = [f"|u_k| <= {up(effort.peak.largest, 4)} (k = {label}), ||u|| <= {up(effort.peak.norm, 4)}"]
    sizes += [f"int ||u||^2 dt <= {up(effort.energy.value, 4)}"] if effort.energy is not None else []
    sizes += [f"int ||u|| dt <= {up(effort.path_length.value, 4)}"] if effort.path_length is not None else []
    if sizes:
        whom = "" if effort.initial_set is None else " for all these initial states"
        part = " (integrals of the nominal part)" if effort.sliding is not None else ""
        yield "effort", ", ".join(sizes) + whom + part
    other = bool(certificate.limits) or not certificate.direct  # the initial state that is found is of neither
    worst = None if effort.peak is None or other else certificate.worst_initial_state
    if worst is not None and math.isfinite(worst.size):
        labels = certificate.graph.labels
        where = f"|u_{labels[worst.agent]}| = {worst.size:.4g} at t = {worst.t:.4g}"
        yield "", f"largest found (numerical) {where} from {_pairs(labels, worst.x0.tolist())}"
    if effort.sliding is not None and not effort.sliding.bounded:
        yield "", "mu3 kappa < 1: the sliding part of the input is not bounded for every sigma(0)"
    yield from _limited_lines(certificate, effort)
    if effort.disturbed is not None:
        d, drift = effort.disturbed, effort.disturbed.drift
        ends = "" if drift is None else ", and all end where they would without"
        if drift is not None and any(drift):
            ends = f", every agent ends within {up(max(drift), 4)} of its final state"
        yield "disturbed", f"|d_k| <= {near(d.delta)} adds at most {up(max(d.inputs), 4)} to |u_k|{ends}"
    elif certificate.delta is not None:
        yield "disturbed", "nothing is certified: the rate proves no bounded input"


def _limited_lines(certificate: Certificate, effort: Effort) -> Lines:
    """Tell what is proved under limits of the gain, and under noise with them."""
    for entry in effort.residual:
        names = (("gain <= ", entry.limits.gain_cap), ("switched off at T - ", entry.limits.stop_before))
        limits = [f"{what}{near(x)}" for what, x in (*names, ("zero-order hold ", entry.limits.sample_period)) if x]
        agents = "" if entry.agents is None else f", every agent within {up(max(entry.agents), 3)} of its final state"
        largest = "" if entry.largest is None else f", |u_k| <= {up(entry.largest, 4)}"
        yield "limited", f"{', '.join(limits)}: at T ||E|| <= {up(entry.norm, 3)}{agents}{largest}"
        if entry.noise is not None and entry.noisy_norm is not None and entry.noisy_largest is not None:
            noise = f"noise |n_k| <= {near(entry.noise)} leaves ||E|| <= {up(entry.noisy_norm, 3)} at T"
            yield "", f"{noise}, |u_k| <= {up(entry.noisy_largest, 4)}"
    if certificate.noise is not None and not any(entry.noise for entry in effort.residual):
        yield "noise", "not certified: noise times an infinite gain; saturate the gain, or switch it off before T"
    if effort.longest_period is not None:
        yield "limited", f"not certified with this period; with {down(effort.longest_period, 4)} it is"
    elif len(effort.residual) < len(certificate.limits):
        yield "limited", "nothing is certified under these limits"


def _sliding_share(certificate: Certificate) -> float:
    """Return ``1 - t/T`` at ``T_r``."""
    p = certificate.protocol
    return float(p.span / p.T)


def _residual_lines(certificate: Certificate) -> Lines:
    envelope, at = certificate.envelope, certificate.at
    proved = _at_instants((envelope.residual(q) for q, _ in _INSTANTS), (name for _, name in _INSTANTS))
    if at is not None:
        own = envelope.residual(float(1 - at / certificate.protocol.T))
        proved = f"{up(own, 3)} at t = {near(at, 12)}, {proved}"
    yield "error", f"||{envelope.coordinates}(t)|| / ||{envelope.coordinates}(0)|| at most {proved}"
    slowest = [certificate.best_possible_residual(q) for q, _ in _INSTANTS]
    if slowest[-1] is not None:
        yield "", "slowest mode (numerical) " + ", ".join(f"{x or 0.0:.2g}" for x in slowest)


def _reaching_lines(certificate: Certificate) -> Lines:
    """Tell what the proved rate leaves where the sliding variables drive the agents until ``T_r``."""
    if certificate.initial_state is None:
        return
    share = _sliding_share(certificate)
    instants = [(share, "T_r"), *((q, name) for q, name in _INSTANTS if q < share)]
    bounds = _at_instants(certificate.norm_bound([q for q, _ in instants]), (name for _, name in instants))
    z = certificate.envelope.coordinates
    yield "error", f"||{z}(t)|| at most {bounds}; T = T_r + T_s (numerical, rounded up)"


def _simulated(certificate: Certificate) -> Iterator[str]:
    """Tell what the run showed."""
    run, comparison = certificate.trajectory, certificate.comparison
    if run is None:
        return
    if comparison is not None and not certificate.constant:
        verdict = (
            "VIOLATED" if comparison.violated else "kept" if comparison.judged else "not tested, all is below the floor"
        )
        resolved = f"until 1 - t/T = {comparison.resolved_until:.1e}" if comparison.resolved_until else "throughout"
        ratio = f"worst ratio {comparison.worst_ratio:.4g}, above integrator tolerance {resolved}"
        yield f"CVODES to 1 - t/T = {comparison.stop:.0e}: bound {verdict}, {ratio}"
    if comparison is not None and (slid := run.sliding) is not None and not certificate.direct:
        last = int(slid.reaching_z.argmax())
        when = "at T_r only"
        if math.isfinite(slid.reaching_z[last]):
            when = f"at t = {slid.reaching_times[last]:.6g}, {slid.reaching_left[last]:.3g} before T_r"
        reaching = "kept" if comparison.reaching_kept else "VIOLATED"
        ratio = f"worst |sigma| ratio {comparison.sliding_ratio or 0:.4g}"
        yield f"reaching times {reaching}, the last {when} (agent {run.labels[last]}); {ratio}"
    if certificate.final_state is not None:
        gap = float(abs(run.final_state - certificate.final_state.values).max())
        remark = "" if run.deadline_resolved else " (the run had not settled)"
        yield f"end state within {gap:.1e} of the final state{remark}"


def _claim_lines(claims: Sequence[Claim], when: str = "") -> Lines:
    counts = sorted(Counter(claims).items(), key=lambda item: item[0].theorem)
    for head, (claim, count) in zip(chain(["claim"], repeat("")), counts, strict=False):
        yield head, f"{count} component(s): " * (len(claims) > 1) + _claim_text(claim, when)


def _sliding_lines(certificate: Certificate) -> Lines:
    """Tell ``sigma(0)``, what is proved of the sliding variables, and which disturbance the run met."""
    reaching, labels, run = certificate.reaching, certificate.graph.labels, certificate.trajectory
    if reaching is None or certificate.sigma0 is None:
        return
    if certificate.direct:
        yield "sigma(0)", "0: no reaching phase, the agents slide from the beginning"
    else:
        yield "sigma(0)", _pairs(labels, certificate.sigma0)
        late = [label for label, r in zip(labels, reaching, strict=True) if r.z is None]
        last = max((r for r in reaching if r.z is not None), key=lambda r: r.z or 0, default=None)
        clauses = []
        if last is not None and last.z:
            agent = labels[reaching.index(last)]
            margin = f"{down(last.remaining, 3)} before T_r" if last.remaining else "nearer to T_r than a float tells"
            clauses.append(
                f"reaching time{' of others' * bool(late)} at most {up(last.time, 6)}, {margin} (agent {agent})"
            )
        if late and (p := certificate.protocol.reaching) is not None:
            pole, push = p.mu3 * p.kappa, p.mu2 * p.T_r
            why = "0 is reached nearer to T_r than can be written"
            if pole < 1:
                why = "mu3 kappa < 1 and sigma(0) is large"
            if push + pole > LARGEST_PUSH:
                why = f"mu2 T_r + mu3 kappa is above {LARGEST_PUSH}, where no earlier instant is proved"
            clauses.append(f"reaching time T_r for {_shorten_list(late, 40)}: {why}")
        yield "sliding", "; ".join(clauses)
    if run is not None and (slid := run.sliding) is not None:
        yield "disturbed", f"the run meets d = {slid.source}; |d| <= delta: {slid.bounded_by}"


def _claim_text(claim: Claim, when: str) -> str:
    numbers = ", ".join(claim.corollaries)
    also = f"; {', '.join(claim.special)} (Corollary {numbers})" if claim.special else ""
    if claim.corollaries and not claim.special:
        also = f"; Corollary {numbers}"
    return f"{claim.behaviour}{when} (Theorem {claim.theorem}{also})"


def structure_text(structure: Structure) -> str:
    """Return connectivity, closed components, leaders and followers, and balance in one line."""
    words = {"strong": "strongly connected", "quasi-strong": "quasi-strongly connected", "weak": "weakly connected"}
    connectivity = words.get(structure.connectivity, f"disconnected, {len(structure.components)} components")
    closed = structure.closed_components
    balanced = sum(c.balanced for c in closed)
    groups = f"{len(closed)} closed component{'s' if len(closed) > 1 else ''} ({balanced} balanced)"
    followers = f"{structure.leaders.size} leaders, {structure.followers.size} followers"
    return f"{connectivity}; {groups}; {followers}; whole graph {'balanced' if structure.balanced else 'unbalanced'}"


def remarks_on(structure: Structure) -> list[str]:
    """Return what is particular about a graph and about how it was read."""
    read, some = structure.graph.read, structure.graph.n_edges > 0
    remarks = (
        (structure.undirected and some, "undirected"),
        (structure.all_positive and some, "all weights positive"),
        (not structure.sign_symmetric, "sign-asymmetric"),
        (not some, "no edges, is this the right file?"),
        (read["duplicates"] != "refused", f"duplicates {read['duplicates']}"),
        (read["self_loops"] != "refused", f"self-loops {read['self_loops']}"),
    )
    return [*(text for holds, text in remarks if holds), *read["notes"]]


def _pairs(labels: Sequence[str], values: Iterable[object]) -> str:
    return _shorten_list([f"{label}={_digits(value)}" for label, value in zip(labels, values, strict=True)])


def _digits(value: object) -> str:
    """Write a number with five digits, to nearest."""
    return f"{float(value):.5g}"  # type: ignore[arg-type]


def _shorten_list(words: Sequence[str], width: int = 90) -> str:
    text = ""
    for word in words:
        if len(text) + len(word) > width:
            return f"{text}, ... ({len(words)} in all)" if text else f"{word[:width]}..."
        text += (", " if text else "") + word
    return text


def _format_lines(lines: Lines) -> list[str]:
    return [f"{head:<10} {''.join(c if c.isprintable() else '?' for c in text)}" for head, text in lines]
