"""Verifies what is said of the input: whether it stays bounded, how large it gets, what limits of actuators leave."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from lmi.exact.rounding import down, up
from lmi.exact.spectrum import nonzero_spectrum_beyond, tractable
from lmi.exact.work import spend
from ptcc_certify.checker.input_bounds import (
    Form,
    InputBounds,
    Limits,
    PrescribedGain,
    Reaching,
    Starts,
    energy_above,
    integral_above,
    length_above,
    peak_above,
    root_above,
)
from ptcc_certify.checker.lyapunov import LyapunovCheck
from ptcc_certify.checker.reading import (
    RejectedError,
    entries,
    exact,
    fields,
    integers,
    longest,
    need,
    short,
    sized,
    triangle,
)
from ptcc_certify.checker.vectors import Numbers, beside

KEYS = ("bounded", "threshold", "starts", "constants", "peak", "energy", "path_length", "sliding")
#: Graphs up to this size have bounds of the input.
INPUT_NODES = 400
#: Limits of actuators that are read.
MANY_LIMITS = 100


class EffortCheck(LyapunovCheck):
    """Every claim about the input ``u = gain E``, of the nominal part under the sliding-mode protocol."""

    def effort(self) -> None:
        """Verify the section ``effort``."""
        self.at, said = "effort", self.data["effort"]
        proved = self.data["rates"]["certified"] is not None or not self.moving
        need((said is not None) == proved, "the input is spoken of iff the decay is proved")
        if said is None:
            return
        fields(said, (*KEYS, "residual", "disturbed"), "effort")
        g = self.gains
        T = g["T_r"] + g["T_s"] if self.is_sliding else g["T"]
        self.gain = PrescribedGain(T, g["rho1"], g["rho2"] * g["kappa"])
        self._threshold(said)
        constants = self._constants(entries(said["constants"], "constants", len(self.forms)))
        self._sliding_part(said["sliding"])
        starts = self._starts(said["starts"])
        if starts is None:
            for key in ("peak", "energy", "path_length", "disturbed"):
                need(said[key] is None, f"{key} without a start, or of too large a graph")
            need(said["residual"] == [], "limits without a start, or of too large a graph")
            return
        try:
            self._sized(said, self._bounds(starts, constants))
        except ValueError as error:
            raise RejectedError(str(error)) from None

    def _bounds(self, starts: Starts, constants: list[list[Fraction] | None]) -> InputBounds:
        """Return what bounds the input over the starts."""
        whole, _ = integers([starts.center, starts.radius, *starts.axes])
        own, each = self.digraph.bits + self.digraph.unit.bit_length(), longest(x for row in whole for x in row)
        count = self.digraph.n_edges + self.n
        sized(count, own, "the rows of L")
        spend(len(whole) * count, own + each, own + each, "the starts")
        rows = [{j: Fraction(x, self.digraph.unit) for j, x in self.digraph.row(v).items()} for v in range(self.n)]
        return InputBounds(
            rows, self.gain, self.forms, constants, starts, self._reaching() if self.is_sliding else None
        )

    def _reaching(self) -> Reaching | None:
        """Return how the sliding variables move, by the reaching times that were verified; None if they do not."""
        g, sigma0 = self.gains, list(self._by_agent(self.data["sigma0"], "sigma0"))
        if not any(sigma0):
            return None
        times = [z for z, s in zip(self.data["reaching_time"]["z"].values(), sigma0, strict=True) if s]
        last = None if None in times else max(map(exact, times))
        return Reaching(sigma0, g["T_r"], g["T_s"], g["mu2"], g["mu3"] * g["kappa"], g["mu1"] + g["delta"], last)

    def _sized(self, said: Mapping[str, Any], bounds: InputBounds) -> None:
        """Verify how large the input gets."""
        self._peak(said["peak"], bounds)
        for key, kind, of in (
            ("energy", "input-energy", energy_above),
            ("path_length", "input-length", length_above),
        ):
            self.at = f"effort.{key}"
            if said[key] is not None:
                if kind == "input-energy" and isinstance(self._next().get("witness"), dict):
                    least = self._integral(bounds)
                else:
                    step = self.open(kind, "effort", ["z"], witness=True)
                    least = bounds.bound(of, None, self._member(step["witness"]), step["z"])
                need(exact(said[key]) >= least, "the bound is not proved")
                self.done(f"at most {up(exact(said[key]))}")
        need(len(entries(said["residual"], "residual")) <= MANY_LIMITS, f"more than {MANY_LIMITS} limits")
        for k, entry in enumerate(said["residual"]):
            self._limited(entry, f"effort.residual[{k}]", said["peak"], bounds)
        self._disturbed(said["disturbed"], bounds)

    def _integral(self, bounds: InputBounds) -> Fraction:
        """Verify two Lyapunov inequalities, ``L'W + W L - c W > m I`` on the range of ``L``; return what they bound."""
        step = self.open("input-energy", "effort", ["p", "m0", "m1"], witness=True)
        said = fields(step["witness"], ("W0", "W1"), "the witness")
        need(bounds.reaching is None, "sliding variables move")
        self._bounded_size(self.n)
        found = []
        for key, m, c in (("W0", step["m0"], Fraction(0)), ("W1", step["m1"], 1 / self.gain.k)):
            rows = triangle(said[key], len(self.moving))
            W, scale = integers(rows)
            forms = [self._remainder(W, m * scale, c)] + ([W] if c else [])  # W0 > 0 need not be known: E tends to 0
            for S in forms:
                need(m > 0 and self.exact.definite(self._on_range(S)), f"the inequality of {key} is not proved")
            found.append(bounds.largest_form(rows) / m)
        even, grown = found
        return integral_above(self.gain, even, grown, step["p"])

    def _remainder(self, W: Sequence[Sequence[int]], m: Fraction, c: Fraction) -> list[list[int]]:
        """Return ``W L + L'W - c W - m I`` on the nodes that listen, times a positive integer."""
        place, n, unit = {v: i for i, v in enumerate(self.moving)}, len(W), self.digraph.unit
        columns: list[dict[int, int]] = [{} for _ in range(n)]
        for i, v in enumerate(self.moving):
            for j, x in self.digraph.row(v).items():
                if j in place:
                    columns[place[j]][i] = x
        spend(n * sum(map(len, columns)), longest(x for row in W for x in row), self.digraph.bits, "W L + L'W")
        moved = [[sum(row[i] * x for i, x in column.items()) for column in columns] for row in W]
        scale = math.lcm((c * unit).denominator, (m * unit).denominator)
        own, diagonal = int(c * unit * scale), int(m * unit * scale)
        bits, each, ratio = longest(x for row in W for x in row), self.digraph.bits, longest((scale, own, diagonal))
        sized(n * n, bits + each + ratio, "W L + L'W")
        spend(2 * n * n, bits + each, ratio, "W L + L'W")
        return [
            [scale * (moved[i][j] + moved[j][i]) - own * W[i][j] - diagonal * (i == j) for j in range(n)]
            for i in range(n)
        ]

    def _on_range(self, S: list[list[int]]) -> list[list[int]]:
        """Return a form of ``E``, on the nodes that listen, where ``E`` lives: ``L'S L`` on ``kept``, times a scale.

        Where only single nodes are balanced closed components, ``E`` may be anything on the nodes that listen.
        """
        if all(len(group) == 1 or gauge is None for group, gauge in zip(self.closed, self.gauges, strict=True)):
            return S
        named = zip(self.moving, (dict(zip(self.moving, row, strict=True)) for row in S), strict=True)
        F = self._state_form(dict(named))
        return [[F[i][j] for j in self.kept] for i in self.kept]

    def _next(self) -> dict[str, Any]:
        """Return the obligation that comes next, not verified."""
        step = self.data["proof"][self.next] if self.next < len(self.data["proof"]) else None
        return step if isinstance(step, dict) else {}

    def _member(self, k: Any) -> int:
        """Return the number of a member."""
        if type(k) is not int or not 0 <= k < len(self.forms):
            raise RejectedError("there is no such member")
        return k

    # ------------------------------------------------------------------ bounded or not

    def _threshold(self, said: Mapping[str, Any]) -> None:
        """Verify whether the input stays bounded for every start, and the bounds of the threshold."""
        ends, k = fields(said["threshold"], ("lower", "upper"), "threshold"), self.gain.k
        best, limit = self.data["rates"]["certified"], self.data["rates"]["limit"]
        known = {"lower": best, "upper": limit}
        for key, rate in known.items():
            value = None if rate is None else k * exact(rate) / 2
            need((None if ends[key] is None else exact(ends[key])) == value, f"the {key} end is not the proved one")
        if said["bounded"] is None:
            return
        need(isinstance(said["bounded"], bool), "bounded is no truth value")
        by = self.open("input-threshold", "effort", witness=True)["witness"]
        if by == "rate":
            holds = not self.moving or (best is not None and exact(best) * k >= 2)
            need(said["bounded"] and holds, "no rate proves that the input stays bounded")
        elif by == "limit":
            below = limit is not None and exact(limit) * k < 2
            need(not said["bounded"] and below, "no limit of rates proves that the input grows")
        else:
            need(by == "spectrum", "another proof")
            place = self._spectrum(1 / k)
            need(said["bounded"] == (place in ("beyond", "on")), f"the spectrum is {place} the line")
        self.done("the input stays bounded" if said["bounded"] else "the input of some start grows without limit")

    def _spectrum(self, line: Fraction) -> str:
        """Return where the nonzero eigenvalues of ``L`` lie, exactly."""
        rows = [dict(self.digraph.row(v)) for v in range(min(self.n, INPUT_NODES))]
        need(
            self.n <= INPUT_NODES and tractable(rows, self.digraph.unit, line), "too large a graph, or too long numbers"
        )
        components, seen = [], [False] * self.n
        for v in range(self.n):
            if not seen[v]:
                there, back = (self.digraph.reached([v], way) for way in (False, True))
                components.append([w for w in range(self.n) if there[w] and back[w]])
                for w in components[-1]:
                    seen[w] = True
        balanced = [group for group, gauge in zip(self.closed, self.gauges, strict=True) if gauge is not None]
        still = {k for k, nodes in enumerate(components) if nodes in balanced}
        return nonzero_spectrum_beyond(rows, self.digraph.unit, components, still, line, self.exact.characteristic)

    # ------------------------------------------------------------------ starts and constants

    def _each(self, said: Any, what: str) -> Numbers:
        """Read numbers by agent, which are in no side file here."""
        need(not beside(said), f"{what} in a side file")
        return self._by_agent(said, what)

    def _starts(self, said: Any) -> Starts | None:
        """Read the set of starts; None if there is none, or the graph is too large."""
        self.at = "effort.starts"
        if said is None:
            known = self.data["initial_state"] is not None and self.n <= INPUT_NODES and bool(self.moving)
            return Starts(list(self._by_agent(self.data["initial_state"], "initial_state"))) if known else None
        need(self.n <= INPUT_NODES and bool(self.moving), "starts of too large a graph, or of one that does not move")
        shape = "axes" if isinstance(said, dict) and "axes" in said else "radius"
        fields(said, ("center", shape), "starts")
        center = list(self._each(said["center"], "center"))
        if shape == "axes":
            axes = entries(said["axes"], "axes")
            need(len(axes) <= INPUT_NODES, "too many axes")
            return Starts(center, axes=[list(self._each(x, "an axis")) for x in axes])
        radius = list(self._each(said["radius"], "radius"))
        need(all(r >= 0 for r in radius), "a radius is negative")
        return Starts(center, radius)

    def _constants(self, said: Sequence[Any]) -> list[list[Fraction] | None]:
        """Verify ``e_k^2 <= c_k V`` for full matrices; for diagonal ones the constants follow."""
        found: list[list[Fraction] | None] = []
        for k, (given, form) in enumerate(zip(said, self.forms, strict=True)):
            self.at = f"effort.constants[{k}]"
            if given is None:
                found.append(None)
                continue
            if form is None or form.matrix is None:
                raise RejectedError("constants that follow from a diagonal")
            self.open("input-constants", f"lyapunov.members[{k}]")
            found.append(list(self._each(given, "constants")))
            P, scale = integers(form.matrix)
            place, forms = {v: i for i, v in enumerate(form.nodes)}, []
            for v, c in enumerate(found[-1] or []):
                p, q = (c / scale).as_integer_ratio()
                sized(v + 1, longest((q, q * p)), "constants")
                row = [0] * len(P)
                if v in place:
                    row[place[v]] = q
                forms.append((row, q * p))
            failed = self.exact.bounded(P, forms)
            need(failed is None, f"the constant of agent {short(self.labels[failed or 0])} is not proved")
            self.done(f"at most {up(max(found[-1] or []))}")
        return found

    # ------------------------------------------------------------------ peak

    def _peak(self, said: Any, bounds: InputBounds) -> None:
        """Verify the peak of every agent's input and of their norm."""
        self.at = "effort.peak"
        if said is None:
            return
        fields(said, ("agents", "largest", "norm"), "peak")
        step = self.open("input-peak", "effort", ["z"], witness=True)
        witness = fields(step["witness"], ("agents", "norm"), "the witness")
        need(list(fields(witness["agents"], self.labels, "agents")) == self.labels, "agents are in another order")
        own = self._own() if self.is_sliding else [Fraction(0)] * self.n
        claimed = self._each(said["agents"], "agents")
        for v, how in enumerate(witness["agents"].values()):
            k, z = entries(how, "an agent", 2)
            least = bounds.bound(peak_above, v, self._member(k), exact(z)) + own[v]
            need(claimed[v] >= least, f"the peak of agent {short(self.labels[v])} is not proved")
        need(exact(said["largest"]) == max(claimed), "the largest peak is another")
        least = bounds.bound(peak_above, None, self._member(witness["norm"]), step["z"])
        least += root_above(sum((x * x for x in own), Fraction(0)))
        need(exact(said["norm"]) >= least, "the peak of the norm is not proved")
        self.done(f"at most {up(max(claimed))}, norm {up(exact(said['norm']))}")

    def _own(self) -> list[Fraction]:
        """Return what the sliding-mode protocol adds to the input of every agent at most."""
        g, sigma0 = self.gains, self._by_agent(self.data["sigma0"], "sigma0")
        bounded = g["mu3"] * g["kappa"] >= 1
        need(bounded or not any(sigma0), "the sliding part is not bounded")
        push = g["mu2"] + g["mu3"] * g["kappa"] / g["T_r"]
        return [g["mu1"] + push * abs(s) for s in sigma0]

    def _sliding_part(self, said: Any) -> None:
        """Verify the sliding part of the input."""
        self.at = "effort.sliding"
        need((said is not None) == self.is_sliding, "a sliding part belongs to the sliding-mode protocol")
        if said is None:
            return
        fields(said, ("bounded", "agents"), "sliding")
        bounded = self.gains["mu3"] * self.gains["kappa"] >= 1
        need(said["bounded"] is bounded, "bounded for every start iff mu3 kappa >= 1")
        if said["agents"] is not None:
            self.open("input-sliding", "effort")
            for label, x, own in zip(self.labels, self._each(said["agents"], "agents"), self._own(), strict=True):
                need(x >= own, f"the sliding part of agent {short(label)} is not proved")
            self.done("for every disturbance within delta")

    # ------------------------------------------------------------------ limits of actuators

    def _limited(self, said: Any, of: str, peak: Any, bounds: InputBounds) -> None:
        """Verify what is left at the deadline under limits of the gain, and the largest input."""
        self.at = of
        keys = ("gain_cap", "stop_before", "sample_period", "clock", "norm", "agents", "largest", "noise")
        fields(said, keys, of)
        need(not self.is_sliding, "limits are for the nominal protocol")
        cap, stop, period = (None if said[key] is None else exact(said[key]) for key in keys[:3])
        need(all(x is None or x > 0 for x in (cap, stop, period)), "a limit is not positive")
        need(stop is None or stop < self.gain.T, "a stop before the start")
        need(period is None or period <= self.gain.T, "a period beyond the deadline")
        limits = Limits(cap, stop, period)
        top = limits.largest_gain(self.gain)
        if top is None:
            raise RejectedError("nothing limits the gain")
        step = self.open("limited-gain", of, ["growth"], witness=True)
        noisy = said["noise"] is not None
        chosen = entries(step["witness"], "the witness", 2) if noisy else [step["witness"]]
        k = self._member(chosen[0])
        form = bounds.form(k)
        need(period is not None or step["growth"] == 0, "growth belongs to a held gain")
        if period is not None:
            self._growth(form, step["growth"])
        clock = exact(said["clock"])
        need(0 <= clock <= limits.clock_below(self.gain), "the clock does not come so far")
        left = bounds.share(k, limits, clock, step["growth"]) * bounds.start(k)
        need(exact(said["norm"]) >= bounds.root_constant(k, None) * left, "what is left is not proved")
        if said["agents"] is not None:
            distance = self.data["lyapunov"]["members"][k]["distance"]
            need(distance is not None, "distances without constants")
            roots = map(root_above, self._each(distance["agents"], "agents"))
            most = None if period is not None else self._largest_deviation(bounds.starts)
            for label, x, root in zip(self.labels, self._each(said["agents"], "agents"), roots, strict=True):
                kept = most is not None and x >= most
                need(kept or x >= root * left, f"what is left of agent {short(label)} is not proved")
        need((said["largest"] is None) == (period is not None), "the largest input is bounded unless it is held")
        if said["largest"] is not None:
            ends = [top * max(bounds.held)] + ([exact(peak["largest"])] if peak is not None else [])
            need(exact(said["largest"]) >= min(ends), "the largest input is not proved")
        if noisy:
            need(period is None, "noise of a held gain")
            noise = {key: exact(x) for key, x in fields(said["noise"], ("bound", "norm", "largest"), "noise").items()}
            need(noise["bound"] > 0, "noise of no size")
            whole, each = bounds.noisy(self._member(chosen[1]), noise["bound"])
            need(noise["norm"] >= bounds.root_constant(k, None) * left + whole, "what is left by noise is not proved")
            largest = exact(said["largest"]) + top * max(each)
            need(noise["largest"] >= largest, "the largest input under noise is not proved")
        self.done(f"||E|| at most {up(exact(said['norm']))} at the deadline")

    def _largest_deviation(self, starts: Starts) -> Fraction:
        """Return ``sup max_k |x_k(0) - (Q x(0))_k|``, which no deviation exceeds where the input is not held."""
        rows = [{j: (i == j) - row.get(j, Fraction(0)) for j in {i, *row}} for i, row in enumerate(self.projection())]
        bits = longest(n for row in rows for x in row.values() for n in x.as_integer_ratio())
        bits += longest(n for x in starts.center for n in x.as_integer_ratio())
        spend(5 * sum(map(len, rows)) * (2 + len(starts.axes)), bits, bits, "deviations of all starts")
        return max(map(starts.largest, rows))

    def _growth(self, form: Form, growth: Fraction) -> None:
        """Verify ``m F - L'F L > 0`` on ``kept`` for the form ``F = L'P L`` of the state."""
        self._bounded_size(self.n)
        need(form.coordinates == "E", "deviations say nothing of a step")
        size = len(form.nodes)
        matrix = form.matrix or [
            [w if i == j else Fraction(0) for j in range(size)] for i, w in enumerate(form.diagonal or [])
        ]
        P, _ = integers(matrix)
        F = self._state_form({v: dict(zip(form.nodes, row, strict=True)) for v, row in zip(form.nodes, P, strict=True)})
        moved = [self.digraph.row(v) for v in range(self.n)]
        p, q = (growth * self.digraph.unit**2).as_integer_ratio()
        bits, own, ratio = longest(x for row in F for x in row), self.digraph.bits, longest((p, q))
        sized(self.n**2, bits + 2 * own + ratio, "L'F L")
        spend(2 * self.n * sum(map(len, moved)), bits + own, own, "L'F L")
        spend(2 * len(self.kept) ** 2, bits + 2 * own, ratio, "L'F L")
        right = [[0] * self.n for _ in range(self.n)]  # F L
        for row, total in zip(F, right, strict=True):
            for x, laplacian in zip(row, moved, strict=True):
                if x:
                    for j, y in laplacian.items():
                        total[j] += x * y
        step = [[0] * self.n for _ in range(self.n)]  # L'F L
        for laplacian, row in zip(moved, right, strict=True):
            for i, y in laplacian.items():
                step[i] = [a + y * x for a, x in zip(step[i], row, strict=True)]
        S = [[p * F[i][j] - q * step[i][j] for j in self.kept] for i in self.kept]
        need(self.exact.definite(S), "the growth of a step is not proved")

    # ------------------------------------------------------------------ disturbances of the nominal protocol

    def _disturbed(self, said: Any, bounds: InputBounds) -> None:
        """Verify what disturbances within ``delta`` add under the nominal protocol."""
        self.at = "effort.disturbed"
        if said is None:
            return
        need(not self.is_sliding, "the sliding-mode protocol has its own claims")
        fields(said, ("delta", "inputs", "drift"), "disturbed")
        step = self.open("nominal-disturbed", "effort", ["delta"], witness=True)
        delta = exact(said["delta"])
        need(delta == step["delta"] and delta > 0, "another delta")
        inputs = bounds.disturbed(self._member(step["witness"]), delta)
        for label, x, least in zip(self.labels, self._each(said["inputs"], "inputs"), inputs, strict=True):
            need(x >= least, f"the input of agent {short(label)} is not proved")
        if said["drift"] is not None:
            drift = self._each(said["drift"], "drift")
            for label, x, row in zip(self.labels, drift, self.projection(), strict=True):
                moved = delta * self.gain.T * sum(map(abs, row.values()), Fraction(0))
                need(x >= moved, f"the drift of agent {short(label)} is not proved")
        self.done(f"for every disturbance within {down(delta)}")
