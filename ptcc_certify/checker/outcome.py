"""Verifies where the agents end, and when the sliding variables are 0."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from operator import mul
from typing import Any

from lmi.exact.enclosure import decay_integrals_below
from lmi.exact.rounding import up
from lmi.exact.work import spend
from ptcc_certify.checker.reading import (
    Interval,
    RejectedError,
    entries,
    exact,
    fields,
    integers,
    interval,
    longest,
    need,
    same,
    short,
    sized,
)
from ptcc_certify.checker.structure import MANY_COMPONENTS, StructureCheck
from ptcc_certify.checker.vectors import Numbers, beside

SLIDING_BOUND = "||sigma(t)|| <= phi(t,T_r)^(-mu3) e^(-mu2 t) ||sigma(0)||"
SLIDING_CLOCK = "z = ln(T_r / (T_r - t)); null: certain at T_r only"
#: Bits of the bounds that prove reaching times.
REACHING_BITS = 64
#: An interval may be wider than twice what is proved by this share of the largest entry of the start.
WIDEST = Fraction(1, 10**6)
#: Bits to which the values of leader groups are rounded, beyond the common scale of states, in the large form.
GRID_BITS = 128
#: Products of short integers that an instant of a reaching time costs, about.
EACH_INSTANT = 12_000
#: The voices of a group of one.
ALONE = [(Fraction(1), Fraction(0))]


class OutcomeCheck(StructureCheck):
    """The outcome matrix, the final state, the sliding variables."""

    def _state(self, key: str) -> Numbers | None:
        self.at, said = key, self.data[key]
        return None if said is None else self._by_agent(said, key)

    def _by_agent(self, said: Any, what: str) -> Numbers:
        """Read a number for every agent: an object in their order, or a side vector."""
        if beside(said):
            return self.files.numbers(said, what, self.n)
        need(list(fields(said, self.labels, what)) == self.labels, "agents are in another order")
        return Numbers([exact(x) for x in said.values()])

    def sliding(self) -> None:
        """Verify Proposition 1 and every reaching time."""
        sigma0 = self._state("sigma0")
        self.at, said = "reaching_time", self.data["reaching_time"]
        need(
            (sigma0 is not None) == self.is_sliding, "sigma(0) belongs to the sliding-mode protocol, and is part of it"
        )
        if sigma0 is None:
            need(said is None, "reaching times without sliding variables")
            return
        fields(said, ("bound", "clock", "z"), "reaching_time")
        need(said["bound"] == SLIDING_BOUND and said["clock"] == SLIDING_CLOCK, "another bound or clock")
        need(list(fields(said["z"], self.labels, "z")) == self.labels, "agents are in another order")
        self.open("sliding-bound", "protocol")
        self.done("for every disturbance within delta")
        z = [None if x is None else exact(x) for x in said["z"].values()]
        if not any(x is not None and s for x, s in zip(z, sigma0, strict=True)):
            need(all(not x for x in z), "a reaching time of a variable that is 0 from the start")
            return
        self.open("reaching-time", "reaching_time")
        g = self.gains
        need(all(end is None or end >= 0 for end in z), "a reaching time before the start")
        asked = [end for end, s in zip(z, sigma0, strict=True) if s and end is not None]
        spend(len(set(asked)) * EACH_INSTANT, what="the reaching times of many agents")
        known = decay_integrals_below(g["T_r"], g["mu2"], g["mu3"] * g["kappa"], asked, REACHING_BITS)
        for label, size, end in zip(self.labels, map(abs, sigma0), z, strict=True):
            if end is None or not size:
                need(end is None or end == 0, f"agent {short(label)} starts at 0")
                continue
            need(size <= (g["mu1"] - g["delta"]) * known[end], f"agent {short(label)} need not be there by then")
        self.done(f"{sum(1 for x in z if x is not None)} of {self.n} agents before T_r")

    def outcome(self) -> None:
        """Verify ``Q``, and the final state as ``Q (X(0) - sigma(0))``."""
        start, sigma0 = self._state("initial_state"), self._state("sigma0")
        self.at, said = "outcome", self.data["outcome"]
        self.weights_of_leaders: Any = None  # where they are exact
        if said is None:
            need(all(final is None for _, final in self.components), "an outcome of a component alone")
            return
        witness = self.open("outcome", "graph", witness=True)["witness"]
        said = fields(said, ("final_state", "degenerate", "influence"), "outcome")
        parts = fields(said["influence"], ("components", "followers"), "influence")
        self.u = None if witness is None else self._by_agent(fields(witness, ("u",), "the witness")["u"], "u")
        need(self.u is None or self.u.positive(), "u is not positive")
        balanced = [
            (k, g, s) for k, (g, s) in enumerate(zip(self.closed, self.gauges, strict=True), 1) if s is not None
        ]
        grouped = parts["followers"] is None  # no weights of followers: voices of groups alone, and one final state
        listed = [b for b in balanced if len(b[1]) > 1 or not grouped]
        voice = {}
        for entry, (k, group, gauge) in zip(
            entries(parts["components"], "components", len(listed)), listed, strict=True
        ):
            fields(entry, ("nodes", "voices"), "a component")
            need(self._numbers(entry["nodes"], "a component") == group, "another component")
            voice[k] = [interval(x) for x in entries(entry["voices"], "voices", len(group))]
            self._voices(group, gauge, voice[k])
        if start is None:
            need(said["final_state"] is None and said["degenerate"] is None, "a final state without a start")
            need(all(final is None for _, final in self.components), "an outcome without a start")
        voices = [voice[k] for k, _, _ in listed]
        pulls = [] if grouped else self._influence(parts["followers"], balanced)
        if not grouped and not any(r for row in (*voices, *pulls) for _, r in row):
            self.weights_of_leaders = balanced, voices, pulls
        widest = Fraction(0)
        if start is not None:
            moved = start if sigma0 is None else Numbers([x - s for x, s in zip(start, sigma0, strict=True)])
            values = {k: combined(voice.get(k, ALONE), [(moved[v], Fraction(0)) for v in g]) for k, g, _ in balanced}
            need(all(abs(x) > r or r == 0 for x, r in values.values()), "a value that may or may not be 0")
            need(same(said["degenerate"], [k for k, (x, _) in values.items() if x == 0]), "which components meet at 0")
            claimed, spare = self._claimed(said["final_state"]), WIDEST * moved.largest()
            for k, (group, signs) in enumerate(zip(self.closed, self.gauges, strict=True), 1):
                x, r = (Fraction(0), Fraction(0)) if signs is None else values[k]
                widest = max(widest, r)
                for v, g in zip(group, signs or [0] * len(group), strict=True):
                    self._holds(v, claimed, (g * x, r), spare)
            if grouped and self.followers:
                widest = max(widest, self._followers(values, claimed, spare))
            for v, row in zip(self.followers, pulls, strict=False):
                x, r = combined(row, list(values.values()))
                widest = max(widest, r)
                self._holds(v, claimed, (x, r), spare)
            self._outcomes(said["final_state"])
        if self.weights_of_leaders is not None:
            self.done("exact")
        elif start is None:
            self.done("influence of leader groups")
        else:
            self.done(f"enclosed, radius at most {up(widest)}")

    def projection(self) -> list[dict[int, Fraction]]:
        """Return the rows of ``Q``, which are exact."""
        need(self.weights_of_leaders is not None, "a distance to an outcome that is not exact")
        balanced, *parts = self.weights_of_leaders
        voices, pulls = parts
        self._bounded_size(self.n)
        each, more = (2 * longest(n for row in rows for x, _ in row for n in x.as_integer_ratio()) for rows in parts)
        entries = self.n * sum(len(group) for _, group, _ in balanced)
        sized(entries, each + more, "the weights of leaders")
        spend(entries, each + more, each + more, "the weights of leaders")
        Q: list[dict[int, Fraction]] = [{} for _ in range(self.n)]
        for k, (_, group, gauge) in enumerate(balanced):
            weights = {v: Fraction(g) for v, g in zip(group, gauge, strict=True)}
            weights |= {v: row[k][0] for v, row in zip(self.followers, pulls, strict=True)}
            for v, weight in weights.items():
                if weight:
                    Q[v] |= {j: weight * x for j, (x, _) in zip(group, voices[k], strict=True)}
        return Q

    def _influence(self, said: Any, balanced: Sequence[tuple[int, list[int], list[int]]]) -> list[list[Interval]]:
        """Verify the weights of every follower on the balanced closed components."""
        labels = [self.labels[v] for v in self.followers]
        need(list(fields(said, labels, "followers")) == labels, "followers are in another order")
        pulls = [[interval(x) for x in entries(row, "a row", len(balanced))] for row in said.values()]
        for column, (_, group, gauge) in enumerate(balanced):
            self._pulls(dict(zip(group, gauge, strict=True)), [row[column] for row in pulls])
        return pulls

    def _claimed(self, said: Any) -> tuple[Numbers, Numbers]:
        """Read middles and radii of the final state: two side vectors, or intervals by agent."""
        if isinstance(said, dict) and beside(said.get("mid")):
            fields(said, ("mid", "radius"), "final_state")
            need(beside(said["radius"]), "radius is not a side vector")
            mid, radius = (self.files.numbers(said[key], key, self.n) for key in ("mid", "radius"))
            need(all(r >= 0 for r in radius.values), "a radius is negative")
            return mid, radius
        need(list(fields(said, self.labels, "final_state")) == self.labels, "agents are in another order")
        intervals = [interval(x) for x in said.values()]
        return Numbers([x for x, _ in intervals]), Numbers([r for _, r in intervals])

    def _holds(self, v: int, claimed: tuple[Numbers, Numbers], found: Interval, spare: Fraction) -> None:
        """Check that an interval lies within the one that is claimed, which is not much wider."""
        mid, radius = claimed[0][v], claimed[1][v]
        x, r = found
        if x == mid and r == radius:
            return
        if abs(x - mid) + r > radius:
            raise RejectedError(f"agent {short(self.labels[v])} ends elsewhere")
        if r != radius and radius > 2 * r + spare:
            raise RejectedError(f"the interval of agent {short(self.labels[v])} is wider than what is proved")

    def _followers(self, values: Mapping[int, Interval], claimed: tuple[Numbers, Numbers], spare: Fraction) -> Fraction:
        """Verify the followers' part of one final state: ``|x_F - mid| <= max_i (|r_i| / (M(L_F) u)_i) u``.

        All in integers: states over ``grid``, to which values of leaders are rounded where they do not fit, and ``u``
        over another scale. Returns the largest radius that is proved.
        """
        if self.u is None:
            raise RejectedError("no witness of the enclosure")
        F, graph = self.followers, self.digraph
        (mids, scale), (radii, fine), (U, _) = (numbers.over(F) for numbers in (*claimed, self.u))
        alone = {self.closed[k - 1][0]: x for k, (x, _) in values.items() if len(self.closed[k - 1]) == 1}
        groups = {k: value for k, value in values.items() if len(self.closed[k - 1]) > 1}
        (own,), other = integers([list(alone.values())])
        grid = math.lcm(scale, other)
        if any(r or grid % x.denominator for x, r in groups.values()):
            grid <<= GRID_BITS
        X, R, u = [0] * self.n, [0] * self.n, [0] * self.n
        for v, x in zip(alone, own, strict=True):
            X[v] = x * (grid // other)
        for v, x, weight in zip(F, mids, U, strict=True):
            X[v], u[v] = x * (grid // scale), weight
        for k, (value, r) in groups.items():
            middle = math.floor(value * grid)
            wide = math.ceil(r * grid) + (middle != value * grid)
            for v, g in zip(self.closed[k - 1], self.gauges[k - 1] or (), strict=True):
                X[v], R[v] = g * middle, wide
        diagonal, heard, pushing = graph.diagonal, graph.heard(X, signed=True), graph.heard(u)
        blur = graph.heard(R) if any(R) else R
        worst, least = 0, 1  # max |r_i| / (M(L_F) u)_i, without the scales
        for v in F:
            pushed = diagonal[v] * u[v] - pushing[v]
            need(pushed > 0, "u is no witness")
            left = abs(diagonal[v] * X[v] - heard[v]) + blur[v]
            if left * least > worst * pushed:
                worst, least = left, pushed
        # The radius that is proved is worst u / (least grid); all over least grid fine
        room, share = math.floor(spare * (least * grid * fine)), least * grid
        for v, said, weight in zip(F, radii, U, strict=True):
            proved, radius = worst * fine * weight, share * said
            if proved > radius:
                raise RejectedError(f"agent {short(self.labels[v])} ends elsewhere")
            if proved != radius and radius > 2 * proved + room:
                raise RejectedError(f"the interval of agent {short(self.labels[v])} is wider than what is proved")
        return Fraction(worst * max(U), share)

    def _outcomes(self, claimed: Any) -> None:
        """Check the outcome of every weak component, which repeats the final state where that is no side vector."""
        for nodes, state in self.components:
            if len(self.components) > MANY_COMPONENTS or beside(claimed.get("mid")):
                need(state is None, "the outcome of a component")
            else:
                own = {self.labels[v]: claimed[self.labels[v]] for v in nodes}
                need(same(state, own), "the outcome of a component")

    def _voices(self, group: Sequence[int], gauge: Sequence[int], voices: Sequence[Interval]) -> None:
        """Verify ``eta' M(L_k) = 0``, ``eta'1 = 1``: exactly, or within the radii; all in integers."""
        (eta, radii), scale = integers(
            [[g * x for g, (x, _) in zip(gauge, voices, strict=True)], [r for _, r in voices]]
        )
        left = self._kept(group, eta)
        if not any(radii):
            need(sum(eta) == scale, "voices do not sum to 1")
            need(not any(left), "voices are not kept by the motion")
            return
        top = max(range(len(eta)), key=eta.__getitem__)
        if self.u is None or eta[top] <= 0:
            raise RejectedError("no witness of the enclosure")
        u, _ = self.u.over(group)
        u[top] = 0
        # |exact / exact[top] - eta / eta[top]| <= worst / (least eta[top]) u, since the rest of M is an M-matrix
        worst, least = 0, 1
        for i, (x, pushed) in enumerate(zip(left, self._kept(group, u), strict=True)):
            if i != top:
                need(pushed > 0, "u is no witness")
                if abs(x) * least > worst * pushed:
                    worst, least = abs(x), pushed
        middle, width = least * sum(eta), worst * sum(u)
        low, high = middle - width, middle + width
        need(low > 0, "voices are not enclosed")
        for x, weight, radius in zip(eta, u, radii, strict=True):
            below, above = least * x - worst * weight, least * x + worst * weight
            need(
                (x - radius) * high <= scale * below and scale * above <= (x + radius) * low, "voices are not enclosed"
            )

    def _kept(self, group: Sequence[int], x: Sequence[int]) -> list[int]:
        """Return ``x' M(L_k)``, times ``unit``."""
        sums = dict.fromkeys(group, 0)
        spend(sum(len(self.digraph.row(v)) for v in group), self.digraph.bits, longest(x), "voices")
        for v, weight in zip(group, x, strict=True):
            for j, a in self.digraph.row(v).items():
                sums[j] += weight * (a if j == v else -abs(a))
        return list(sums.values())

    def _pulls(self, camp: Mapping[int, int], column: Sequence[Interval]) -> None:
        """Verify ``L_F w = -L_FLk G_k 1``: exactly, or by ``|w - mid| <= max_i (|r_i| / (M(L_F) u)_i) u``."""
        (scaled,), scale = integers([[x for x, _ in column]])
        mids = dict(zip(self.followers, scaled, strict=True))
        known = {**{v: g * scale for v, g in camp.items()}, **mids}  # unbalanced leaders end at 0
        rows = {v: self.digraph.row(v) for v in self.followers}
        spend(sum(map(len, rows.values())), self.digraph.bits, longest(known.values()), "followers")
        left = {v: sum(x * known.get(j, 0) for j, x in row.items()) for v, row in rows.items()}
        astray = [v for v, r in left.items() if r]
        if not astray:
            return
        if self.u is None:
            raise RejectedError(f"agent {short(self.labels[astray[0]])} is not where its neighbours pull it")
        each, _ = self.u.over(self.followers)
        u = dict(zip(self.followers, each, strict=True))
        spend(2 * sum(map(len, rows.values())), self.digraph.bits, longest(each), "followers")
        worst, least = 0, 1  # max |r_i| / (M(L_F) u)_i, without the scales
        for v, row in rows.items():
            pushed = sum(u[j] * (x if j == v else -abs(x)) for j, x in row.items() if j in u)
            need(pushed > 0, "u is no witness")
            if abs(left[v]) * least > worst * pushed:
                worst, least = abs(left[v]), pushed
        error = Fraction(worst, least * scale)
        within = all(error * u[v] <= r for v, (_, r) in zip(self.followers, column, strict=True))
        need(within, "followers are not enclosed")


def combined(weights: Sequence[Interval], values: Sequence[Interval]) -> Interval:
    """Return an interval that holds the sum of the products."""
    if len(weights) == 1:
        ((a, r),), ((x, s),) = weights, values
        return a * x, abs(a) * s + r * abs(x) + r * s
    (A, R), fine = integers([[a for a, _ in weights], [r for _, r in weights]])
    (X, S), scale = integers([[x for x, _ in values], [s for _, s in values]])
    spend(4 * len(A), longest(A) + longest(R), longest(X) + longest(S), "sums of intervals")
    radius = sum(abs(a) * s + r * abs(x) + r * s for a, r, x, s in zip(A, R, X, S, strict=True)) if any(R + S) else 0
    return Fraction(sum(map(mul, A, X)), fine * scale), Fraction(radius, fine * scale)
