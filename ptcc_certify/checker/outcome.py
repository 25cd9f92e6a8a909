"""Verifies where the agents end, and when the sliding variables are 0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from ptcc_certify.checker.reading import (
    Interval,
    RejectedError,
    entries,
    exact,
    fields,
    integers,
    interval,
    need,
    same,
    short,
    shown,
)
from ptcc_certify.checker.structure import MANY_COMPONENTS, StructureCheck
from ptcc_certify.enclosure import decay_integrals_below

SLIDING_BOUND = "||sigma(t)|| <= phi(t,T_r)^(-mu3) e^(-mu2 t) ||sigma(0)||"
SLIDING_CLOCK = "z = ln(T_r / (T_r - t)); null: certain at T_r only"
#: Bits of the bounds that prove reaching times.
REACHING_BITS = 64
#: An interval may be wider than twice what is proved by this share of the largest entry of the start.
WIDEST = Fraction(1, 10**6)


class OutcomeCheck(StructureCheck):
    """The outcome matrix, the final state, the sliding variables."""

    def _state(self, key: str) -> list[Fraction] | None:
        self.at, said = key, self.data[key]
        if said is None:
            return None
        need(list(fields(said, self.labels, key)) == self.labels, "agents are in another order")
        return [exact(x) for x in said.values()]

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
        u = {} if witness is None else fields(witness, ("u",), "the witness")["u"]
        self.u = [exact(x) for x in fields(u, self.labels, "u").values()] if witness is not None else None
        need(self.u is None or (list(u) == self.labels and all(x > 0 for x in self.u)), "u is not positive")
        balanced = [
            (k, g, s) for k, (g, s) in enumerate(zip(self.closed, self.gauges, strict=True), 1) if s is not None
        ]
        grouped = parts["followers"] is None  # no weights of followers: voices of groups alone, and one final state
        listed = [b for b in balanced if len(b[1]) > 1 or not grouped]
        voice = {group[0]: [(Fraction(1), Fraction(0))] for _, group, _ in balanced}
        for entry, (_, group, gauge) in zip(
            entries(parts["components"], "components", len(listed)), listed, strict=True
        ):
            fields(entry, ("nodes", "voices"), "a component")
            need(self._numbers(entry["nodes"], "a component") == group, "another component")
            voice[group[0]] = [interval(x) for x in entries(entry["voices"], "voices", len(group))]
            signed = zip(gauge, voice[group[0]], strict=True)
            self._voices(group, [(g * x, r) for g, (x, r) in signed])
        voices = [voice[group[0]] for _, group, _ in balanced]
        pulls = [] if grouped else self._influence(parts["followers"], balanced)
        if not grouped and not any(r for row in (*voices, *pulls) for _, r in row):
            self.weights_of_leaders = balanced, voices, pulls
        if start is None:
            need(said["final_state"] is None and said["degenerate"] is None, "a final state without a start")
            need(all(final is None for _, final in self.components), "an outcome without a start")
        else:
            moved = [x - s for x, s in zip(start, sigma0 or [Fraction(0)] * self.n, strict=True)]
            values = [
                combined(voice, [(moved[v], Fraction(0)) for v in g])
                for voice, (_, g, _) in zip(voices, balanced, strict=True)
            ]
            final: list[Interval] = [(Fraction(0), Fraction(0))] * self.n
            for (_, group, gauge), (x, r) in zip(balanced, values, strict=True):
                for v, g in zip(group, gauge, strict=True):
                    final[v] = (g * x, r)
            if grouped:
                self._followers(final, said["final_state"])
            for v, row in zip(self.followers, pulls, strict=False):
                final[v] = combined(row, values)
            self._final_state(said, final, WIDEST * max(map(abs, moved)))
            need(all(abs(x) > r or r == 0 for x, r in values), "a value that may or may not be 0")
            at_zero = [k for (k, _, _), (x, _) in zip(balanced, values, strict=True) if x == 0]
            need(same(said["degenerate"], at_zero), "which components meet at 0")
        if self.weights_of_leaders is not None:
            self.done("exact")
        elif start is None:
            self.done("influence of leader groups")
        else:
            self.done(f"enclosed, radius at most {shown(max(r for _, r in final))}")

    def projection(self) -> list[dict[int, Fraction]]:
        """Return the rows of ``Q``, which are exact."""
        need(self.weights_of_leaders is not None, "a distance to an outcome that is not exact")
        balanced, voices, pulls = self.weights_of_leaders
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

    def _followers(self, final: list[Interval], said: Any) -> None:
        """Verify the followers' part of one final state: ``|x_F - mid| <= max_i (|r_i| / (M(L_F) u)_i) u``."""
        if self.u is None:
            raise RejectedError("no witness of the enclosure")
        claimed = fields(said, self.labels, "final_state")
        known = [x for x, _ in final]
        for v in self.followers:
            known[v], _ = interval(claimed[self.labels[v]])
        # Everything as integers: middles and radii over one denominator, u over another.
        (X, R), scale = integers([known, [r for _, r in final]])
        (U,), _ = integers([self.u])
        following = set(self.followers)
        worst, least = 0, 1  # max |r_i| / (M(L_F) u)_i, without the scales
        for v in self.followers:
            left = blur = pushed = 0
            for j, x in self.L[v].items():
                left += x * X[j]
                blur += abs(x) * R[j]
                if j in following:
                    pushed += x * U[j] if j == v else -abs(x) * U[j]
            need(pushed > 0, "u is no witness")
            if (abs(left) + blur) * least > worst * pushed:
                worst, least = abs(left) + blur, pushed
        for v in self.followers:
            final[v] = (known[v], Fraction(worst * U[v], least * scale))

    def _final_state(self, said: dict[str, Any], final: Sequence[Interval], spare: Fraction) -> None:
        """Check that every interval lies within the one that is claimed, here and under ``components``."""
        claimed = fields(said["final_state"], self.labels, "final_state")
        need(list(claimed) == self.labels, "agents are in another order")
        for (label, text), (x, r) in zip(claimed.items(), final, strict=True):
            mid, radius = interval(text)
            if not (x == mid and r == radius) and abs(x - mid) + r > radius:
                raise RejectedError(f"agent {short(label)} ends elsewhere")
            if r != radius and radius > 2 * r + spare:
                raise RejectedError(f"the interval of agent {short(label)} is wider than what is proved")
        for nodes, state in self.components:
            own = {self.labels[v]: claimed[self.labels[v]] for v in nodes}
            grouped = state is None and len(self.components) > MANY_COMPONENTS
            need(grouped or same(state, own), "the outcome of a component")

    def _voices(self, group: Sequence[int], eta: Sequence[Interval]) -> None:
        """Verify ``eta' M(L_k) = 0``, ``eta'1 = 1``: exactly, or within the radii."""
        columns: list[dict[int, int]] = [{} for _ in group]  # of the comparison matrix
        place = {v: i for i, v in enumerate(group)}
        for i, v in enumerate(group):
            for j, x in self.L[v].items():
                columns[place[j]][i] = x if j == v else -abs(x)
        mids, radii = [x for x, _ in eta], [r for _, r in eta]
        if not any(radii):
            need(sum(mids) == 1, "voices do not sum to 1")
            need(all(sum(mids[i] * x for i, x in c.items()) == 0 for c in columns), "voices are not kept by the motion")
            return
        top = max(range(len(mids)), key=lambda i: mids[i])
        if self.u is None or mids[top] <= 0:
            raise RejectedError("no witness of the enclosure")
        z = [x / mids[top] for x in mids]
        u = [Fraction(0) if i == top else self.u[v] for i, v in enumerate(group)]
        error = Fraction(0)  # |exact / exact[top] - z| <= error u, since the rest of M is an M-matrix
        for j, column in enumerate(columns):
            if j != top:
                pushed = sum((u[i] * x for i, x in column.items()), Fraction(0))
                need(pushed > 0, "u is no witness")
                error = max(error, abs(sum((z[i] * x for i, x in column.items()), Fraction(0))) / pushed)
        total, width = sum(z, Fraction(0)), error * sum(u, Fraction(0))
        low, high = total - width, total + width
        need(low > 0, "voices are not enclosed")
        for share, weight, mid, radius in zip(z, u, mids, radii, strict=True):
            ends = (share - error * weight) / high, (share + error * weight) / low
            need(mid - radius <= ends[0] and ends[1] <= mid + radius, "voices are not enclosed")

    def _pulls(self, camp: Mapping[int, int], column: Sequence[Interval]) -> None:
        """Verify ``L_F w = -L_FLk G_k 1``: exactly, or by ``|w - mid| <= max_i (|r_i| / (M(L_F) u)_i) u``."""
        mids = dict(zip(self.followers, (x for x, _ in column), strict=True))
        known = {**{v: Fraction(g) for v, g in camp.items()}, **mids}
        left = {
            v: sum(
                (x * known.get(j, Fraction(0)) for j, x in self.L[v].items()), Fraction(0)
            )  # unbalanced leaders end at 0
            for v in self.followers
        }
        astray = [v for v, r in left.items() if r]
        if not astray:
            return
        if self.u is None:
            raise RejectedError(f"agent {short(self.labels[astray[0]])} is not where its neighbours pull it")
        error = Fraction(0)
        for v in self.followers:
            row, u = self.L[v], self.u
            pushed = sum((u[j] * (x if j == v else -abs(x)) for j, x in row.items() if j in mids), Fraction(0))
            need(pushed > 0, "u is no witness")
            error = max(error, abs(left[v]) / pushed)
        within = all(error * self.u[v] <= r for v, (_, r) in zip(self.followers, column, strict=True))
        need(within, "followers are not enclosed")


def combined(weights: Sequence[Interval], values: Sequence[Interval]) -> Interval:
    """Return an interval that holds the sum of the products."""
    pairs = list(zip(weights, values, strict=True))
    middle = sum((a * x for (a, _), (x, _) in pairs), Fraction(0))
    return middle, sum((abs(a) * s + r * abs(x) + r * s for (a, r), (x, s) in pairs if r or s), Fraction(0))
