"""Whether what a certificate says of late messages, and of leaders that move, is true: judged without the checker.

Two ways, which share nothing with it: the inequalities of section 22 in rationals and balls, row by row from the edges;
and motions of the closed loop as the file states it (:mod:`late_motion`), under the largest delays, random ones, square
waves, and delays and errors chosen against the agents. Bounds over time are tested from below: one that a motion
exceeds is false.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import Any

import flint
import late_motion
import numpy as np
from late_motion import Flight, Gain, LateMotion, Moving
from oracle import Oracle, ball, number
from scipy.linalg import expm

Json = dict[str, Any]
#: A bound may lie below what floats find by this share, and by this much for states of size 1.
SLACK, FLOOR = 1e-8, 1e-9
#: By this share of the latency what is heard may be younger where a least age is tried.
YOUNGER = 0.05


class Runs:
    """Motions of one closed loop: states at all instants, for each pattern of delays."""

    def __init__(self, times: np.ndarray, states: list[np.ndarray], gain: Gain, flight: Flight | None = None):
        self.times, self.states, self.gain, self.flight = times, states, gain, flight

    @cached_property
    def largest(self) -> np.ndarray:
        """The largest and least states over all patterns, (2, N, times)."""
        return np.array([np.max(self.states, axis=0), np.min(self.states, axis=0)])

    def away(self, target: np.ndarray) -> np.ndarray:
        """The largest distance from a target over all patterns, (N, times); from where leaders are if they move."""
        if self.flight is not None:
            return np.max([np.abs(X - self.flight.targets(X)) for X in self.states], axis=0)
        return np.abs(self.largest - target[None, :, None]).max(axis=0)


@lru_cache(maxsize=400)
def late_runs(
    W: bytes,
    x0: bytes,
    target: bytes,
    gains: tuple[Gain, ...],
    oldest: bytes,
    error: float,
    late: bool,
    end: float,
    at_once: tuple[int, ...] = (),
    moving: tuple[float, float] | None = None,
) -> Runs:
    """Motions for delays up to the ages of ``oldest``, by listener and source, and errors up to ``error``.

    ``moving``: how fast leaders move, and what disturbs followers.
    """
    start, aim = np.frombuffer(x0), np.frombuffer(target)
    N = len(start)
    weights, taubar = np.frombuffer(W).reshape(N, N), np.frombuffer(oldest).reshape(N, N)
    delay = float(taubar.min())
    T = max(g.T for g in gains)
    capped = max(g.cap for g in gains) < math.inf
    times = np.arange(0, T, min(delay, T) / 3) if capped else late_motion.instants(T, delay)
    times = np.unique(np.concatenate([times, [g.T for g in gains], np.arange(T, end, min(delay, T) / 3)]))
    rng = np.random.default_rng(0)
    flight = None if moving is None else Flight(weights, *moving)
    aims: late_motion.Target = aim if flight is None else flight.targets
    motion = LateMotion(weights, list(gains), taubar, times, late, at_once, flight)
    patterns = [
        late_motion.oldest_of_all,
        late_motion.by_chance(rng),
        late_motion.square_wave(5, rng.integers(0, 9, (N, N))),
        late_motion.worst(weights, aims),
    ]
    off = late_motion.worst_errors(error, aims) if error else None
    return Runs(times, [motion.run(start, ages, off) for ages in patterns], gains[0], flight)


class LateOracle(Oracle):
    """One certificate with late messages, or with leaders that move."""

    def judged(self) -> None:
        super().judged()
        if "messages" in self.data:
            self.messages()

    # ------------------------------------------------------------------ reading

    @cached_property
    def single(self) -> bool:
        return all(len(part) == 1 for part in self.closed)

    @cached_property
    def follow(self) -> list[int]:
        return [v for v in range(self.n) if self.L[v][v]]

    @cached_property
    def among(self) -> dict[int, list[tuple[int, Fraction]]]:
        """What followers hear of followers: sources and sizes of weights."""
        return {v: [(s, abs(self.L[v][s])) for s in self.follow if s != v and self.L[v][s]] for v in self.follow}

    def by_follower(self, said: Any) -> dict[int, Fraction]:
        return dict(zip(self.follow, self.listed(said), strict=True))

    def witness(self, of: str) -> Json:
        steps = [step for step in self.data["proof"] if step["of"] == of]
        self.require(len(steps) == 1, f"one obligation of {of}")
        return steps[0]

    @cached_property
    def target(self) -> list[Fraction] | None:
        """``Q X(0)``; None without a state."""
        if "final_state" not in self.data:
            return None
        return [sum((q * x for q, x in zip(row, self.start or [], strict=True)), Fraction(0)) for row in self.Q]

    def far(self, v: int) -> Fraction:
        """``|x_v(0) - x*_v|``."""
        return Fraction(1) if self.target is None or self.start is None else abs(self.start[v] - self.target[v])

    def starts(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Initial states and where they end: that of the file, or some with ``|x - x*| <= 1``."""
        if self.target is not None and self.start is not None:
            yield np.array(list(map(float, self.start))), np.array(list(map(float, self.target)))
            return
        Q = np.array([[float(x) for x in row] for row in self.Q])
        rng = np.random.default_rng(1)
        for _ in range(2):
            target = Q @ rng.normal(size=self.n)
            off = np.zeros(self.n)
            off[self.follow] = rng.choice([-1.0, 1.0], len(self.follow))
            yield target + off, target

    @cached_property
    def weight_array(self) -> np.ndarray:
        W = np.zeros((self.n, self.n))
        for (s, t), w in self.weights.items():
            W[t, s] = float(w)
        return W

    # ------------------------------------------------------------------ late messages

    @property
    def said(self) -> Json:
        return self.data["messages"]

    @cached_property
    def latencies(self) -> dict[tuple[int, int], Fraction]:
        said, pairs = self.said["latency"], self.pairs
        each = [number(said)] * len(pairs) if isinstance(said, str) else self.listed(said)
        return dict(zip(pairs, each, strict=True))

    @cached_property
    def pairs(self) -> list[tuple[int, int]]:
        """Edges in the order of the file."""
        return [(s, t) for s, t, _ in self.edges(self.data["problem"]["graph"]["modes"][0]["edges"])]

    @cached_property
    def delay(self) -> Fraction:
        oldest, packets = max(self.latencies.values()), self.said.get("packets")
        return oldest + ((number(packets["losses"]) + 1) * number(packets["period"]) if packets else 0)

    @cached_property
    def ages(self) -> dict[tuple[int, int], Fraction]:
        """How old is what is heard over every edge, at most."""
        held = self.delay - max(self.latencies.values())
        return {pair: latency + held for pair, latency in self.latencies.items()}

    @cached_property
    def error(self) -> Fraction:
        return number(self.said["value_error"])

    @cached_property
    def fled(self) -> tuple[Fraction, Fraction] | None:
        """How fast leaders move, and what disturbs followers; None if they rest."""
        said = self.said.get("leaders")
        return None if said is None else (number(said["speed"]), number(said["disturbance"]))

    @cached_property
    def sign(self) -> Fraction | None:
        """What followers add times ``sign(e_k)``; None without that."""
        said = self.said.get("leaders", {}).get("sign_gain")
        return None if said is None else number(said)

    @property
    def push(self) -> Fraction:
        """How fast a follower and its target may part; the sign term takes that up."""
        return Fraction(0) if self.fled is None or self.sign is not None else sum(self.fled, Fraction(0))

    @property
    def tracks(self) -> bool:
        """Whether leaders move, and nothing is late or off."""
        return self.fled is not None and not self.delay and not self.error

    @property
    def wrong(self) -> Fraction:
        """How far what is heard of a target is off."""
        return self.error + (self.fled[0] * self.delay if self.fled else 0)

    @cached_property
    def cap(self) -> Fraction | None:
        return number(self.said["gain_cap"]) if "gain_cap" in self.said else None

    def messages(self) -> None:
        packets = self.said.get("packets")
        if packets is not None:
            losses = number(packets["losses"])
            self.require(number(packets["period"]) > 0 and losses >= 0 and losses.denominator == 1, "packets")
        self.require(min(self.latencies.values()) >= 0 and number(self.said["delay"]) == self.delay, "delay")
        self.require(self.error >= 0 and (self.delay or self.error or self.fled), "value_error")
        self.require(self.cap is None or self.cap > 0, "gain_cap")
        late = self.said["own"] == "late"
        self.require(not late or self.cap is not None, "a late own state without a cap")
        self.require(not any(self.sigma0), "sliding variables that move")
        for key in ("rows", "steps", "missed", "staged"):
            self.require(not self.said.get(key) or (self.single and not late and self.follow), key)
        if self.fled is not None:
            self.require(min(self.fled) >= 0 and "mu1" not in self.gains, "leaders: what they need")
            self.require(self.sign is None or self.sign >= sum(self.fled), "sign_gain")
            self.require(self.sign is None or not (late or "steps" in self.said), "a sign term: what it needs")
            self.require(
                not any(key in self.said for key in ("missed", "staged", "settling", "form", "lmi")), "leaders move"
            )
        self.above_rows()
        if self.fled is not None:
            self.kept_after()
        if "residual" in self.said:
            self.above_residual()
        if "missed" in self.said:
            self.away_at_the_deadline()
        if "staged" in self.said:
            self.deadlines()
        if "settling" in self.said:
            self.behind_settling_leaders()
        if "form" in self.said:
            self.small_delays()
        if "lmi" in self.said:
            self.delay_lmi()
        if self.tracks and not self.false:
            self.tracked()
        elif "input" in self.said:
            self.slopes()

    def slopes(self) -> None:
        """Motions whose states change as fast as their inputs."""
        most = np.array(list(map(float, self.vector(self.said["input"]))))
        self.require(self.cap is not None and (most >= 0).all(), "input: what it needs")
        for runs, _ in self.loop():
            way = np.abs(np.diff(runs.states))
            add = np.zeros(self.n)
            if self.fled is not None:
                add[:] = float(self.fled[0])
                add[self.follow] = float(self.fled[1])
            allowed = (most + add)[:, None] * np.diff(runs.times) * (1 + SLACK) + FLOOR
            self.require(not np.any(way > allowed), "input: a motion")

    def clock(self, cap: Fraction | None, t: Fraction | None = None) -> Any:
        """The integral of ``min(gain, cap)`` up to ``t``, or ``T``, a ball."""
        T, rho1, k = self.gain
        t, turn = T if t is None else t, T if cap is None else Fraction(0)
        if cap is not None and cap > rho1 + k / T:
            turn = T - k / (cap - rho1)
        early = min(t, turn)
        whole = ball(rho1 * early) - ball(k) * ball(1 - early / T).log()
        return whole + (ball(cap * (t - early)) if cap is not None and t > early else 0)

    def loop(
        self, runs_to: float | None = None, gains: tuple[Gain, ...] | None = None, error: bool = True
    ) -> Iterator[tuple[Runs, np.ndarray]]:
        """Motions under the delays of the file, and where they are to end."""
        T, rho1, k = map(float, self.gain)
        gain = Gain(T, rho1, k, math.inf if self.cap is None else float(self.cap))
        # what leaders at rest said is never old
        ages = np.full((self.n, self.n), float(self.delay))
        for (s, t), age in self.ages.items():
            at_rest = not self.L[s][s] and self.single and self.fled is None
            ages[t, s] = float(self.delay) if at_rest or t in self.at_once else float(age)
        if ages.min() < T / 400:
            return  # what is held for so short a time takes too many steps
        for x0, target in self.starts():
            yield (
                late_runs(
                    self.weight_array.tobytes(),
                    x0.tobytes(),
                    target.tobytes(),
                    gains or (gain,) * self.n,
                    ages.tobytes(),
                    float(self.error) if error else 0.0,
                    self.said["own"] == "late",
                    runs_to or T,
                    self.at_once,
                    None if self.fled is None else (float(self.fled[0]), float(self.fled[1])),
                ),
                target,
            )

    @cached_property
    def at_once(self) -> tuple[int, ...]:
        """Leaders in groups all of whom hear each other at once and exactly; none if one does not."""
        leading = tuple(v for part in self.closed if len(part) > 1 for v in part)
        late = (
            self.error != 0 or self.said["own"] == "late" or any(self.ages[s, t] for s, t in self.pairs if t in leading)
        )
        return () if late else leading

    def power(self, q: Fraction, s: int, v: int) -> Any:
        """``q`` to the power of the age of what ``v`` hears of ``s`` over the largest age."""
        share = self.ages[s, v] / self.delay if self.delay else Fraction(1)
        return ball(q) if share == 1 else (ball(q).log() * ball(share)).exp()

    def above_rows(self) -> None:
        for i, entry in enumerate(self.said["rows"]):
            at = f"messages.rows[{i}]"
            step = self.witness(at)
            q, b = (number(step["numbers"][key]) for key in ("q", "b"))
            u = self.by_follower(step["witness"]["u"])
            initial, left, floor = (number(entry[key]) for key in ("initial", "left", "floor"))
            cap = number(entry["cap"]) if "cap" in entry else None
            self.require(min(u.values()) > 0 and b > 0 and q >= 1, f"{at}: signs")
            for v, x in u.items():
                heard = sum((w * u[s] for s, w in self.among[v]), Fraction(0))
                D = self.L[v][v]
                later = sum((self.power(q, s, v) * ball(w * u[s]) for s, w in self.among[v]), ball(Fraction(0)))
                self.require(not ball(D * x - b * x) < later, f"{at}: row {v}")
                self.require(initial * x >= self.far(v), f"{at}: initial of {v}")
                self.require(floor * (D * x - heard) >= self.wrong * D, f"{at}: floor of {v}")
                if self.fled is not None:
                    slowest = min(x for x in (self.gain[1], self.cap) if x is not None)
                    enough = number(entry["after"]) * (D * x - heard) >= self.push / slowest
                    self.require(enough, f"{at}: after of {v}")
            self.require(initial >= 0 and floor >= 0, f"{at}: negative")
            if self.delay:
                self.require(cap is not None and cap > 0, f"{at}: cap")
                self.require(not ball(b * (cap or 0) * self.delay) > ball(q).log(), f"{at}: b cap delay")
            limit = min((x for x in (cap, self.cap) if x is not None), default=None)
            if limit is None:
                self.require(left == 0 and "clock" not in entry, f"{at}: left")
            else:
                clock = number(entry["clock"])
                self.require(clock >= 0 and not ball(clock) > self.clock(limit), f"{at}: clock")
                self.require(not ball(left) < (-ball(b * clock)).exp(), f"{at}: left")
            for runs, target in self.loop():
                T, rho1, k = map(float, self.gain)
                slow = Gain(T, rho1, k, math.inf if limit is None else float(limit))
                z = np.array([math.exp(-float(b) * min(slow.clock(t), 1e4)) for t in runs.times])
                if limit is not None:
                    z[-1] = float(left) if runs.times[-1] == T else z[-1]
                bound = float(initial) * z + float(floor)
                if self.fled is not None:
                    bound = bound + self.drifted(b, slow, runs.times) * float(self.push / min(u.values()))
                    whole = float(number(entry["drift"]) + floor + initial * left)
                    self.require(bound[-1] <= whole * (1 + SLACK), f"{at}: drift")
                for v, x in u.items():
                    seen = runs.away(target)[v]
                    self.require(not np.any(seen > float(x) * bound * (1 + SLACK) + FLOOR), f"{at}: motion of {v}")

    def drifted(self, b: Fraction, gain: Gain, times: np.ndarray) -> np.ndarray:
        """``int_0^t e^(-b (s(t) - s(r))) dr`` at instants, by quadrature on the pieces between them."""
        nodes, weights = np.polynomial.legendre.leggauss(12)
        found, clocks = np.zeros(len(times)), [gain.clock(t) for t in times]
        for j in range(len(times) - 1):
            r = times[j] + (times[j + 1] - times[j]) * (1 + nodes) / 2
            if math.isinf(clocks[j + 1]):
                continue
            parts = np.exp(-float(b) * np.array([clocks[j + 1] - gain.clock(x) for x in r]))
            found[j + 1] = found[j] * math.exp(-float(b) * (clocks[j + 1] - clocks[j]))
            found[j + 1] += (times[j + 1] - times[j]) / 2 * float(weights @ parts)
        return found

    def kept_after(self) -> None:
        """Motions beyond ``T`` of leaders that go on, beside every entry of ``rows``."""
        T = float(self.gain[0])
        for runs, target in self.loop(1.4 * T):
            seen = runs.away(target)[:, runs.times >= T].max(axis=1)
            for i, entry in enumerate(self.said["rows"]):
                u = self.by_follower(self.witness(f"messages.rows[{i}]")["witness"]["u"])
                factor = number(entry["initial"]) * number(entry["left"])
                factor += number(entry["floor"]) + number(entry["after"])
                for v, x in u.items():
                    most = float(x * factor) * (1 + SLACK) + FLOOR
                    self.require(seen[v] <= most, f"messages.rows[{i}]: after, a motion of {v}")

    def above_residual(self) -> None:
        bound = np.array(list(map(float, self.vector(self.said["residual"]))))
        self.require(not any(bound[v] for v in range(self.n) if v not in self.follow), "a residual of a leader")
        for runs, target in self.loop():
            self.require(not np.any(runs.away(target)[:, -1] > bound * (1 + SLACK) + FLOOR), "residual")
        if (
            self.delay
            and self.wrong == 0
            and self.cap is None
            and not self.fled
            and self.camps(self.follow) is not None
        ):
            self.require(not np.any(self.attained() > bound * (1 + 1e-6) + FLOOR), "residual that is attained")

    def attained(self) -> np.ndarray:
        """What the largest delays leave at ``T`` where some camps fit the followers and start on one side each."""
        camps = self.camps(self.follow) or {}
        if self.target is None or self.start is None:
            return np.zeros(self.n)
        off = {v: camps[v] * (self.start[v] - self.target[v]) for v in self.follow}
        if min(off.values()) < 0 < max(off.values()):
            return np.zeros(self.n)
        return self.left_below(lambda v: abs(off[v]), float(self.delay))

    def left_below(self, size: Any, late: float) -> np.ndarray:
        """``sum_l (|w_kl|/D_k) e^(-D_l s(T - late)) size_l`` in floats."""
        T, rho1, k = map(float, self.gain)
        s, found = Gain(T, rho1, k).clock(max(T - late, 0.0)), np.zeros(self.n)
        for v in self.follow:
            parts = (float(w / self.L[v][v] * size(x)) * math.exp(-float(self.L[x][x]) * s) for x, w in self.among[v])
            found[v] = sum(parts)
        return found

    def away_at_the_deadline(self) -> None:
        said = self.said["missed"]
        agent, bound = self.index[said["agent"]], number(said["bound"])
        ideal = self.cap is None and self.error == 0 and self.said["own"] == "fresh" and self.target is not None
        self.require(ideal and bound > 0 and agent in self.follow, "missed: what it needs")
        if not ideal or self.start is None or self.target is None:
            return
        camps, fits, todo = {agent: 1}, True, [agent]
        for v in todo:
            for s, _ in self.among[v]:
                if s not in camps:
                    camps[s] = camps[v] * (1 if self.weights[s, v] > 0 else -1)
                    todo.append(s)
        for v in todo:
            fits &= all(camps[s] * camps[v] * self.weights[s, v] > 0 for s, _ in self.among[v])
        heard = {s for v in todo for s, _ in self.among[v]}
        off = {v: self.start[v] - self.target[v] for v in self.follow}
        sides = {camps[v] * (off[v] > 0) - camps[v] * (off[v] < 0) for v in heard} - {0}
        self.require(fits and len(sides) <= 1, "missed: signs")
        T: Fraction = self.gain[0]
        total: Any = flint.arb(0)
        for v, w in self.among[agent]:
            late = self.latencies[v, agent]
            self.require(late > 0, "missed: a message that is not late")
            t = max(T - late, Fraction(0))
            total += (
                ball(w / self.L[agent][agent]) * (-ball(self.L[v][v]) * self.clock(None, t)).exp() * ball(abs(off[v]))
            )
        self.require(not ball(bound) > total, "missed: bound")
        self.youngest(agent, float(bound))

    def youngest(self, agent: int, bound: float) -> None:
        """Motions whose messages are no younger than nearly the latency: none comes near."""
        T, rho1, k = map(float, self.gain)
        least = min(map(float, self.latencies.values()))
        if least < T / 60 or least > T / 2:
            return
        young = least * (1 - YOUNGER)
        times = np.unique(
            np.concatenate(
                [np.arange(0, T, least * YOUNGER / 2), late_motion.grid(T, least * YOUNGER / 2, 1e-7, 60), [T]]
            )
        )
        x0, target = (np.array(list(map(float, x or []))) for x in (self.start, self.target))

        def ages(X: np.ndarray, oldest: np.ndarray, j: int) -> np.ndarray:
            newest = max(int(np.searchsorted(times, times[j] - young * (1 - 1e-12), side="right")) - 1, 0)
            return np.minimum(np.maximum(newest, oldest), j)

        X = LateMotion(self.weight_array, [Gain(T, rho1, k)] * self.n, float(self.delay), times).run(x0, ages)
        gain, D = Gain(T, rho1, k), max(float(self.L[v][v]) for v in self.follow)
        share = math.exp(-D * (gain.clock(T - young) - gain.clock(T - least)))
        self.require(abs(X[agent, -1] - target[agent]) >= bound * share * (1 - SLACK) - FLOOR, "missed: a motion")

    def deadlines(self) -> None:
        T, rho1, k = self.gain
        own = {self.index[label]: number(x) for label, x in self.said["staged"].items()}
        self.require(sorted(own) == self.follow and min(own.values()) > 0, "staged: who, and when")
        self.require(self.error == 0 and self.cap is None and self.said["own"] == "fresh", "staged: what it needs")
        self.require(max(own.values()) == T, "staged: the last deadline")
        for v, heard in self.among.items():
            self.require(all(own[v] >= own[s] + self.delay for s, _ in heard), "staged: a deadline too early")
        if self.false:
            return
        gains = tuple(Gain(float(own.get(v, T)), float(rho1), float(k)) for v in range(self.n))
        for runs, target in self.loop(float(T) * 1.2, gains):
            for v, t in own.items():
                after = runs.away(target)[v][runs.times >= float(t)]
                self.require(after.max() <= 1e-7, f"staged: motion of {v}")

    def small_delays(self) -> None:
        said = self.said["form"]
        capped = self.cap is not None or not (self.delay or self.error)
        self.require(capped and self.target is not None, "form: what it needs")
        self.require(not self.error or self.said["own"] == "fresh", "form: a late own state that is off")
        if self.false:
            return
        step = self.witness("messages.form")
        q, b, kap = (number(step["numbers"][key]) for key in ("q", "b", "kap"))
        k, phi = step["witness"]["function"], self.vector(step["witness"]["phi"])
        function, (F, P, _, nodes) = self.data["decays"][k], self.forms[k]
        r, h = number(function["rate"]), (self.cap or 0) * self.delay
        self.require(function["coordinates"] == "E" and b > 0 and not ball(q) < ball(b * h).exp(), "form: q")
        inverse = np.array([[float(x) for x in row] for row in P])
        constants = dict(zip(nodes, np.diag(np.linalg.inv(inverse)).tolist(), strict=True))
        late = self.said["own"] == "late"
        B = [[abs(x) if late or i != j else Fraction(0) for j, x in enumerate(row)] for i, row in enumerate(self.L)]
        pushed = [sum((x * y for x, y in zip(row, phi, strict=True)), Fraction(0)) for row in B]
        for v in range(self.n):
            least = math.sqrt(constants.get(v, 0.0)) * (1 - 1e-9) + float(h * q * pushed[v])
            self.require(float(phi[v]) >= least * (1 - 1e-12) and phi[v] >= 0, f"form: phi of {v}")
        # |L'P L| = |F|
        value = sum((abs(F[i][j]) * pushed[i] * pushed[j] for i in range(self.n) for j in range(self.n)), Fraction(0))
        self.require(kap >= 0 and kap**2 >= value and b + h * q * kap <= r / 2, "form: kap")
        floor = Fraction(0)
        self.require(("floor" in said) == ("psi" in step["witness"]) == (self.error > 0), "form: floor and psi")
        if self.error and not self.false:
            floor, psi = number(said["floor"]), self.vector(step["witness"]["psi"])
            off = [
                sum((h * abs(x) * psi[j] + self.error * abs(x) for j, x in enumerate(row) if j != i), Fraction(0))
                for i, row in enumerate(self.L)
            ]
            for v in range(self.n):
                least = math.sqrt(constants.get(v, 0.0)) * (1 - 1e-9) * float(floor) + float(off[v])
                self.require(float(psi[v]) >= least * (1 - 1e-12), f"form: psi of {v}")
            value = sum((abs(F[i][j]) * off[i] * off[j] for i in range(self.n) for j in range(self.n)), Fraction(0))
            self.require(floor >= 0 and (floor * r / 2) ** 2 >= value, "form: floor")
        if self.cap is None:
            self.require(number(said["left"]) == 0, "form: left")
            return
        self.require(not ball(number(said["left"])) < (-ball(b) * self.clock(self.cap)).exp(), "form: left")
        self.decays_along_motions("form", np.array([[float(x) for x in row] for row in F]), float(b), float(floor))

    def decays_along_motions(self, name: str, A: np.ndarray, b: float, floor: float = 0.0) -> None:
        """Motions beside ``x'A x``, its rate ``2 b`` and what errors add, and how far agents are drawn away."""
        said, T = self.said[name], float(self.gain[0])
        keys = "moved", "away", "residual"
        moved, away, residual = (np.array(list(map(float, self.vector(said[key])))) for key in keys)
        Q = np.array([[float(x) for x in row] for row in self.Q])
        for runs, target in self.loop(1.2 * T):
            for X in runs.states:
                V = np.sqrt(np.maximum(np.einsum("it,ij,jt->t", X, A, X), 0))
                z = np.array([math.exp(-b * runs.gain.clock(min(t, T))) for t in runs.times])
                ok = runs.times <= T
                self.require(not np.any(((V[0] * z + floor) * (1 + 1e-6) + FLOOR < V)[ok]), f"{name}: a motion")
                off = np.abs(Q @ (X - X[:, :1]))[:, ok if self.error else ...]
                self.require(not np.any(off > moved[:, None] * (1 + 1e-6) + FLOOR), f"{name}: moved")
                end = np.abs(X[:, runs.times == T] - target[:, None])
                self.require(not np.any(end > residual[:, None] * (1 + 1e-6) + FLOOR), f"{name}: residual")
        for runs, target in self.loop():
            z = np.array([math.exp(-b * runs.gain.clock(t)) for t in runs.times])
            most = (moved[:, None] + away[:, None] * z) * (1 + 1e-6) + FLOOR
            self.require(not np.any(runs.away(target) > most), f"{name}: away")

    def delay_lmi(self) -> None:
        """Motions, and the inequality with a column for every late edge, by eigenvalues."""
        said = self.said["lmi"]
        self.require(self.cap is not None and self.target is not None, "lmi: what it needs")
        self.require(not self.error or self.said["own"] == "fresh", "lmi: a late own state that is off")
        if self.false or self.cap is None:
            return
        step = self.witness("messages.lmi")
        b, lower = number(step["numbers"]["b"]), step["witness"]["matrix"]
        self.require(b > 0 and not ball(number(said["left"])) < (-ball(b) * self.clock(self.cap)).exp(), "lmi: left")
        L, Q = (np.array([[float(x) for x in row] for row in S]) for S in (self.L, self.Q))
        first = [min(part) for part in self.closed if any(self.Q[min(part)])]
        free = [v for v in range(self.n) if v not in first]
        C = (np.eye(self.n) - Q[:, first] / np.diag(Q)[first] @ np.eye(self.n)[first])[free]
        P = np.array([[float(number(lower[max(i, j)][min(i, j)])) for j in range(len(free))] for i in range(len(free))])
        own, late = self.said["own"] == "late", list[tuple[np.ndarray, np.ndarray, float, float]]()
        for (s, t), x in zip(self.pairs, step["witness"]["tau"], strict=True):
            w, h = float(self.weights[s, t]), float(self.cap * self.ages[s, t])
            if float(number(x)) > 0:
                m = np.eye(self.n)[s] - (np.sign(w) * np.eye(self.n)[t] if own else 0)
                late.append((w * np.eye(self.n)[t], m, h, float(number(x))))
            else:
                self.require(h == 0 or (not own and not self.L[s][s]), "lmi: a late edge without a multiplier")
        floor = 0.0
        self.require(("floor" in said) == ("errors" in step["witness"]) == (self.error > 0), "lmi: floor and errors")
        if self.error and not self.false:
            taus = {v: x for v, x in enumerate(self.vector(step["witness"]["errors"])) if self.L[v][v]}
            for v, x in taus.items():  # channels of no lateness, by which values are off
                late.append((float(self.L[v][v]) * np.eye(self.n)[v], np.zeros(self.n), 0.0, float(x)))
            floor = float(number(said["floor"]))
            made = float(self.error) ** 2 * sum(map(float, taus.values()))
            self.require(2 * float(b) * floor**2 >= made * (1 - 1e-9) and min(taus.values()) > 0, "lmi: floor")
        W, M = (np.array([e[k] for e in late]).reshape(len(late), self.n) for k in (0, 1))
        h, each = (np.array([e[k] for e in late]) for k in (2, 3))
        A, Z = C @ L[:, free], np.hstack([L[:, free], -W.T])
        c = each * h * np.expm1(2 * float(b) * h) / (2 * float(b))
        N = np.block([[P @ A + A.T @ P - 2 * float(b) * P, -P @ C @ W.T], [-(P @ C @ W.T).T, np.diag(each)]])
        walk = np.hstack([np.zeros((len(first), len(free))), Q[first] @ W.T])
        N = N - (M @ Z).T * c @ (M @ Z) - walk.T @ walk
        size = np.sqrt(np.abs(np.diag(N)) + 1e-300)
        self.require(np.linalg.eigvalsh(N / np.outer(size, size))[0] > -1e-7, "lmi: the inequality")
        self.decays_along_motions("lmi", C.T @ P @ C, float(b), floor)

    def behind_settling_leaders(self) -> None:
        said, step = self.said["settling"], self.witness("messages.settling")
        q, b = (number(step["numbers"][key]) for key in ("q", "b"))
        cap, clock, left = (number(said[key]) for key in ("cap", "clock", "left"))
        u, leading = self.vector(step["witness"]["u"]), {v for part in self.closed for v in part}
        follow = [v for v in range(self.n) if v not in leading]
        self.require(all(self.ages[s, t] == 0 for s, t in self.pairs if t in leading), "settling: leaders hear late")
        self.require(self.error == 0 and self.said["own"] == "fresh" and self.target is not None, "settling: needs")
        self.require(self.delay > 0 and b > 0 and cap > 0 and follow, "settling: signs")
        if self.false or self.start is None or self.target is None:
            return
        self.require(not ball(b * cap * self.delay) > ball(q).log(), "settling: b cap delay")
        limit = cap if self.cap is None else min(cap, self.cap)
        self.require(clock >= 0 and not ball(clock) > self.clock(limit), "settling: clock")
        self.require(not ball(left) < (-ball(b * clock)).exp(), "settling: left")
        for v in follow:
            parts = (self.power(q, s, v) * ball(abs(w) * u[s]) for (s, t), w in self.weights.items() if t == v)
            heard, D = sum(parts, ball(Fraction(0))), self.L[v][v]
            self.require(not ball(D * u[v] - b * u[v]) < heard, f"settling: row {v}")
            self.require(u[v] >= self.far(v) and u[v] > 0, f"settling: start of {v}")
        self.leaders_settle(b, u, sorted(leading))
        T, rho1, k = map(float, self.gain)
        slow = Gain(T, rho1, k, float(limit))
        for runs, target in self.loop():
            z = np.array([math.exp(-float(b) * min(slow.clock(t), 1e4)) for t in runs.times])
            z[-1] = float(left) if runs.times[-1] == T else z[-1]
            seen, bound = runs.away(target), np.array(list(map(float, u)))[:, None] * z
            self.require(not np.any(seen > bound * (1 + SLACK) + FLOOR), "settling: a motion")

    def leaders_settle(self, b: Fraction, u: list[Fraction], leading: list[int]) -> None:
        """The exact motion of the leaders on the clock, beside ``u_l e^(-b s)``."""
        A = np.array([[float(self.L[i][j]) for j in leading] for i in leading])
        x0, end = (np.array([float((x or [])[v]) for v in leading]) for x in (self.start, self.target))
        rate = max(float(np.abs(np.diag(A)).max(initial=0.0)), 1e-9)
        for s in np.concatenate([np.linspace(0, 3 / rate, 40), np.geomspace(3, 12, 40) / rate]):
            away = np.abs(expm(-A * s) @ x0 - end)
            most = np.array([float(u[v]) for v in leading]) * math.exp(-float(b) * s)
            self.require(not np.any(away > most * (1 + SLACK) + FLOOR), f"settling: leaders at {s}")

    # ------------------------------------------------------------------ leaders that move

    def tracked(self) -> None:
        """Motions of followers that hear at once of leaders that move, and what is stated of their inputs."""
        self.require(self.single and self.follow, "leaders: groups")
        if self.false:
            return
        inputs = None if "input" not in self.said else self.vector(self.said["input"])
        least = [Fraction(0)] * self.n if inputs is None else None
        for i, entry in enumerate(self.said["rows"]):
            step = self.witness(f"messages.rows[{i}]")
            b, u = number(step["numbers"]["b"]), self.by_follower(step["witness"]["u"])
            bounds = self.uncapped(entry, b, u) if self.cap is None and inputs is not None else None
            if bounds is not None:
                least = bounds if least is None else [min(pair) for pair in zip(least, bounds, strict=True)]
            for x0, _ in self.starts():
                self.in_motion(x0, np.array([float(u[v]) for v in self.follow]), float(b), entry, inputs)
        if self.cap is None:
            self.require(least is not None, "leaders: an input that may grow")
            for v in self.follow if least is not None else ():
                self.require(inputs is None or inputs[v] >= least[v], f"leaders: input of {v}")

    def uncapped(self, entry: Json, b: Fraction, u: dict[int, Fraction]) -> list[Fraction] | None:
        """What a row proves of inputs without a cap; None where these may grow."""
        (T, rho1, k), p = self.gain, b * self.gain[2]
        if p < 1 or (p == 1 and self.push):
            return None
        y = (rho1 + k / T) * number(entry["initial"])
        y += self.push / min(u.values()) * (rho1 * T + k) / (p - 1) if self.push else 0
        found = [Fraction(0)] * self.n
        for v, x in u.items():
            heard = sum((w * u[s] for s, w in self.among[v]), Fraction(0))
            found[v] = (self.L[v][v] * x + heard) * y + (self.sign or 0)
        return found

    def in_motion(self, x0: np.ndarray, u: np.ndarray, b: float, entry: Json, inputs: Any) -> None:
        T, rho1, k = map(float, self.gain)
        assert self.fled is not None
        initial, left, after = (float(number(entry[key])) for key in ("initial", "left", "after"))
        sign = None if self.sign is None else float(self.sign)
        L = np.array([[float(x) for x in row] for row in self.L])
        leaders = [v for v in range(self.n) if v not in self.follow]
        gain = Gain(T, rho1, k, math.inf if self.cap is None else float(self.cap))
        motion, layer = Moving(L, leaders, self.follow, gain, *map(float, self.fled)), 0.0
        if sign is None:
            times = late_motion.grid(T, T / 60, 1e-5, 200)
            X, aims = motion.run(x0, times, u)
            begin = X[:, -1].copy()
            if self.cap is None:
                begin[self.follow] = motion.targets @ x0[leaders]
                begin[leaders] = x0[leaders]
            later = np.linspace(T, 2 * T, 60)
            more = motion.run(begin, later, u)
            times, X, aims = np.append(times, later), np.hstack([X, more[0]]), np.hstack([aims, more[1]])
        else:
            layer = 1e-2 * max(float(np.abs(x0).max()), 1.0)
            times, X, aims = motion.run_sign(x0, u, sign, layer)
        m = (np.abs(X[self.follow] - aims) / u[:, None]).max(axis=0)
        # with a sign gain the last thousandth before T is left out, and what it would take away stays
        skipped = 0.0 if sign is None else initial * math.exp(-b * gain.clock(T * (1 - 2.5e-3)))
        early = times[times < T]
        drift = float(self.push) / u.min() * self.drifted(Fraction(b), gain, early)
        for j, (t, seen, x) in enumerate(zip(times, m, X.T, strict=True)):
            if t >= T:
                kept = max(layer / (b * u.min()), skipped)
                self.require(seen <= (initial * left + after + kept) * 1.01 + FLOOR, f"leaders: after, at {t}")
                continue
            bound = initial * math.exp(-b * gain.clock(t)) + drift[j]
            allowed = max(bound, layer / (b * u.min())) * (1 + 1e-6) + FLOOR + (0.01 * bound if sign is not None else 0)
            self.require(seen <= allowed, f"leaders: a motion at {t}: {seen} above {bound}")
            if inputs is not None:
                e = gain.value(t) * np.abs(L @ x)[self.follow] + (sign or 0)
                most = np.array([float(inputs[v]) for v in self.follow])
                self.require(
                    not np.any(e > most * (1 + 1e-6) + FLOOR + gain.value(t) * layer), f"leaders: input at {t}"
                )


def late_claims(data: Json, files: Mapping[str, bytes] | None = None) -> list[str]:
    """Say what is false in an accepted certificate; an empty list if nothing is."""
    oracle = LateOracle(data, files or {})
    oracle.judged()
    return oracle.false
