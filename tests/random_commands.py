"""Random command lines of every kind, over graphs of every class and families, and what a run of one must not do.

    run_case("late", seed, folder)  # raises AssertionError where the program contradicts itself

Sizes are mostly small, with a tail to 400 nodes that holds both sides of the size up to which everything is exact.
"""

from __future__ import annotations

import json
import random
import re
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
from asked import certify_words
from bad_inputs import Run, ptcc
from families import KINDS as FAMILY_KINDS
from families import random_family
from generators import WEIGHTS, all_classes, random_graph, smallest
from late_certificates import grouped_graph, led_graph
from led_families import led_family

from ptcc_certify import Expectations, GainLimits, NominalProtocol, box, ellipsoid
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Mode
from ptcc_certify.graphs.rationals import format_exact

#: What no run prints, whatever is asked.
NEVER = re.compile(
    r"independent check (?:rejects|does not accept)|Traceback|VIOLATED|error of this program|report this"
)
#: Behaviours that are asked for.
BEHAVIOURS = (
    *("stability", "consensus", "bipartite-consensus", "signed-average-consensus", "interval-bipartite-consensus"),
    "bipartite-containment",
)
#: Exit codes that are documented: all but a rejection of what the program wrote itself, or an error of its own.
DOCUMENTED = (0, 2, 3, 4)


@dataclass(frozen=True)
class Command:
    """A command line, and the files that it reads."""

    kind: str
    seed: int
    size: int
    arguments: tuple[str, ...]
    files: dict[str, str] = field(repr=False)


@dataclass(frozen=True)
class Outcome:
    """What became of a command: its exit code, whether a file was written and accepted, and its seconds."""

    command: Command
    code: int
    written: bool
    seconds: float
    text: str = field(repr=False)


class Draw(random.Random):
    """Draws of numbers, options and graphs."""

    def sometimes(self, share: float, *options: str) -> list[str]:
        """Return options, or none."""
        return list(options) if self.random() < share else []

    def number(self, low: float, high: float) -> str:
        """Return a number of two or three digits, or a quotient, between two, spread over their magnitudes."""
        value = low * (high / low) ** self.random()
        if self.random() < 0.1:
            return format_exact(Fraction(f"{value:.2g}") * Fraction(6, 7))
        return f"{value:.3g}" if self.random() < 0.5 else format_exact(Fraction(f"{value:.2g}"))

    def size(self) -> int:
        """Return a number of nodes from 1 to 400."""
        ranges = ((1, 12), (13, 60), (61, 118), (119, 124), (125, 400))
        return self.randint(*self.choices(ranges, (62, 16, 7, 8, 7))[0])

    def graph(self, n: int, only: str = "") -> SignedDigraph:
        """Return a graph of a class whose name begins so, with weights of any law."""
        _, how = self.choice([one for one in all_classes() if one[0].startswith(only)])
        if "n" not in how and not (how.get("isolated") and not how["parts"]):
            how = dict(how, n=max(n, smallest(**how)))
        law = self.choice([*WEIGHTS, "wide"])
        rng = np.random.default_rng(self.getrandbits(32))
        graph = random_graph(rng, **dict(how, weights="units" if law == "wide" else law)).graph
        if law != "wide":
            return graph
        powers = [Fraction(10) ** self.randint(-9, 9) for _ in range(graph.n_edges)]
        rows = zip(graph.edges(), powers, strict=True)
        return SignedDigraph.from_edges([(s, t, w * power) for (s, t, w), power in rows], graph.labels)

    def state(self, labels: tuple[str, ...]) -> list[str]:
        """Return an initial state: random by a seed, of few values, or of one value."""
        way = self.random()
        if way < 0.5:
            return ["--seed", str(self.randint(0, 99))]
        values = ("1",) if way < 0.6 else ("-1", "0", "2") if way < 0.8 else ("1/3", "-0.125", "1e-7", "4e5", "0")
        return ["--x0", ",".join(self.choice(values) for _ in labels)]

    def gain(self) -> list[str]:
        """Return parameters of the gain."""
        options = []
        for name, low, high in (("--T", 0.05, 20), ("--rho1", 0.05, 5), ("--rho2", 0.1, 20), ("--kappa", 1, 4)):
            options += self.sometimes(
                0.6, name, str(self.randint(1, 4)) if name == "--kappa" else self.number(low, high)
            )
        return options

    def asked(self) -> list[str]:
        """Return expectations."""
        asked = self.sometimes(0.3, "--expect", self.choice(BEHAVIOURS))
        asked += self.sometimes(0.2, "--min-rate", self.number(0.01, 10))
        return asked + self.sometimes(0.2, "--max-input", self.number(1, 1e4))


def text_of(graph: SignedDigraph, delays: dict[tuple[str, str], Fraction] | None = None) -> str:
    """Write a graph as an edge list, nodes first, with a column of delays if there are some."""
    lines = ["source,target,weight" + (",delay" if delays else ""), *graph.labels]
    for source, target, weight in graph.edges():
        late = f",{format_exact(delays[source, target])}" if delays else ""
        lines.append(f"{source},{target},{format_exact(weight)}{late}")
    return "\n".join(lines) + "\n"


def text_of_mode(mode: Mode, labels: tuple[str, ...]) -> str:
    """Write a mode of a family as an edge list with intervals of weights."""
    pairs: dict[tuple[int, int], tuple[Fraction, Fraction]] = {}
    for edge, pair in enumerate(zip(mode.source.tolist(), mode.target.tolist(), strict=True)):
        sizes = mode.lower.fraction(edge), mode.upper.fraction(edge)
        low, high = sizes if mode.sign[edge] > 0 else (-sizes[1], -sizes[0])
        if pair in pairs:
            low, high = min(low, pairs[pair][0]), max(high, pairs[pair][1])
        pairs[pair] = low, high
    rows = [
        f"{labels[s]},{labels[t]},{format_exact(low)},{format_exact(high)}" for (s, t), (low, high) in pairs.items()
    ]
    return "\n".join(["source,target,weight_min,weight_max", *labels, *rows]) + "\n"


# ---------------------------------------------------------------------- kinds


def _one(draw: Draw, only: str = "", most: int = 400) -> tuple[SignedDigraph, dict[str, str], list[str]]:
    """Return a graph, its file, and the beginning of a command on it."""
    graph = draw.graph(min(draw.size(), most), only)
    return graph, {"g.csv": text_of(graph)}, ["certify", "g.csv"]


def _quick(draw: Draw) -> list[str]:
    limit = draw.sometimes(0.5, "--method", draw.choice(["best", "paper", "perron", "lmi", "full"]))
    return [*limit, *draw.sometimes(0.75, "--no-simulation")]


def nominal(draw: Draw) -> tuple[int, list[str], dict[str, str]]:
    """Return the plain protocol on one graph, with limits, noise, disturbances, and sets of initial states."""
    graph, files, command = _one(draw)
    command += [*draw.gain(), *draw.state(graph.labels), *draw.asked(), *_quick(draw)]
    command += draw.sometimes(0.2, "--initial-bound", draw.number(0.1, 100))
    limits = draw.sometimes(0.25, "--gain-cap", draw.number(2, 200))
    limits += draw.sometimes(0.15, "--stop-before", draw.number(1e-4, 0.04))
    limits += draw.sometimes(0.1, "--sample-period", draw.number(1e-4, 0.04))
    command += limits + draw.sometimes(0.15, "--noise", draw.number(1e-4, 1))
    return graph.n_nodes, [*command, *draw.sometimes(0.2, "--delta", draw.number(1e-3, 5))], files


def sliding_mode(draw: Draw) -> tuple[int, list[str], dict[str, str]]:
    """Return the sliding-mode protocol on one graph."""
    graph, files, command = _one(draw)
    command += ["--protocol", "sliding-mode", *draw.state(graph.labels), *draw.asked(), *_quick(draw)]
    command += draw.sometimes(0.5, "--sigma0", ",".join(draw.choice(["0", "1", "-2/3"]) for _ in graph.labels))
    delta = draw.choice(["0.1", "1", "5"])
    command += ["--delta", delta, "--mu1", format_exact(Fraction(delta) * draw.choice([2, 3]))]
    for name, low, high in (("--T-r", 0.1, 5), ("--T-s", 0.1, 5), ("--mu2", 0.1, 5), ("--mu3", 0.1, 5)):
        command += draw.sometimes(0.5, name, draw.number(low, high))
    command += draw.sometimes(0.5, "--rho2", draw.number(0.1, 10))
    return graph.n_nodes, [*command, *draw.sometimes(0.2, "--initial-bound", draw.number(0.1, 100))], files


def _modes(draw: Draw) -> tuple[int, tuple[str, ...], dict[str, str]]:
    """Return size, labels and files of a random family of one or more modes."""
    n = draw.randint(1, 9) if draw.random() < 0.8 else draw.randint(10, 60)
    family = random_family(draw, draw.choice(FAMILY_KINDS), n, draw.random() < 0.15).family
    files = {f"m{k}.csv": text_of_mode(mode, family.labels) for k, mode in enumerate(family.modes)}
    return family.n_nodes, family.labels, files


def family(draw: Draw) -> tuple[int, list[str], dict[str, str]]:
    """Return a family: modes, weights in intervals, a share of uncertainty, edges that may fail."""
    command = [*draw.gain(), *draw.asked()]
    if draw.random() < 0.7:
        n, labels, files = _modes(draw)
        command = ["certify", *files, "--switching", *command, *draw.sometimes(0.2, "--signal", "constant")]
    else:
        graph, files, begin = _one(draw)
        n, labels = graph.n_nodes, graph.labels
        edges = [f"{s},{t}" for s, t, _ in graph.edges()]
        fails = draw.sample(edges, min(len(edges), draw.choice([0, 1, 2])))
        share = draw.choice(["1%", "10%", "1/3", "60%"])
        command = [*begin, *command, "--uncertainty", share, *(x for edge in fails for x in ("--optional", edge))]
    if draw.random() < 0.3:
        command = [x for name, x in pairwise(["", *command]) if "--T" not in (name, x)]
        command += ["--protocol", "sliding-mode", "--sigma0", ",".join(draw.choice(["0", "1", "-2/3"]) for _ in labels)]
    return n, [*command, *draw.state(labels)], files


def restricted(draw: Draw) -> tuple[int, list[str], dict[str, str]]:
    """Return a family under restricted signals: dwell times, windows, shares of the clock."""
    n, labels, files = _modes(draw)
    command = ["certify", *files, "--switching", *draw.gain(), *draw.asked(), *draw.state(labels)]
    way = draw.choice(["--dwell", "--clock-dwell", "--clock-window", "--share"])
    if way == "--clock-window":
        command += [way, draw.number(1, 20), "--window-on", draw.number(0.1, 0.9)]
    elif way == "--share":
        shares = [draw.randint(1, 9) for _ in files]
        command += [x for share in shares for x in (way, f"{share}/{sum(shares)}")]
    else:
        command += [way, draw.number(0.01, 2)]
    return n, command, files


def _agents(draw: Draw, labels: tuple[str, ...]) -> list[str]:
    """Return options of agents of any order."""
    dimension = draw.choice([1, 1, 1, 2, 3])
    order = draw.choice(["1", "2", "double-integrator", "triple-integrator", "3", "4"])

    def state(values: tuple[str, ...]) -> str:
        return ",".join(draw.choice(values) for _ in range(dimension * len(labels)))

    options = ["--agents", order, "--dimension", str(dimension)] if dimension > 1 else ["--agents", order]
    options += draw.sometimes(0.5, "--x0", state(("1", "-2", "0.25", "3"))) if dimension == 1 else []
    options += ["--x0", state(("1", "-2", "1/3"))] if dimension > 1 else []
    options += draw.sometimes(0.4, "--offsets", state(("0", "1", "-1/2")))
    if order != "1":
        options += draw.sometimes(0.5, "--v0", state(("0", "1", "-1")))
        options += draw.sometimes(0.2, "--drag", draw.number(0.1, 2)) if order != "4" else []
        options += draw.sometimes(0.3, "--decay", str(draw.randint(7, 16)))
    if order in ("2", "double-integrator"):
        options += draw.choice([[], [], ["--rest", draw.number(0.2, 4)], ["--cascade", draw.number(2, 12)]])
    if draw.random() < 0.2:
        options += ["--protocol", "sliding-mode", "--delta", "0.5", "--mu1", "1"]
    else:
        options += draw.sometimes(0.25, "--gain-cap", draw.number(5, 100))
    return options


def agents(draw: Draw) -> tuple[int, list[str], dict[str, str]]:
    """Return agents of order n, in formation, at rest, with drag, in cascade."""
    graph, files, command = _one(draw, most=180)
    command += [*draw.sometimes(0.5, "--rho2", draw.number(0.5, 8)), *_agents(draw, graph.labels), *draw.asked()]
    return graph.n_nodes, [*command, *_quick(draw)], files


def late(draw: Draw) -> tuple[int, list[str], dict[str, str]]:
    """Return late messages: of single leaders, leader groups, or any graph under a capped gain."""
    rng, way, n, delays = np.random.default_rng(draw.getrandbits(32)), draw.random(), draw.size(), None
    if way < 0.6:
        signs = draw.choice(["mixed", "positive", "gauge"])
        leaders = draw.randint(1, 5)
        graph = led_graph(rng, leaders, max(1, n - leaders), acyclic=draw.random() < 0.6, signs=signs)
    elif way < 0.75:
        graph, delays = grouped_graph(rng, draw.randint(1, 30))
    else:
        graph = draw.graph(min(n, 130))
    command = ["certify", "g.csv", *draw.gain(), *draw.state(graph.labels), *draw.asked(), *_quick(draw)]
    when = ["--delay", "delay"] if delays else ["--delay", draw.number(1e-4, 0.2)]
    when = draw.choice([when, when, when, ["--quantisation", draw.number(1e-3, 1)]])
    if draw.random() < 0.25:
        when += ["--period", draw.number(1e-3, 0.05), *draw.sometimes(0.5, "--packet-loss", str(draw.randint(0, 4)))]
    command += when + draw.sometimes(0.3 if way < 0.75 else 0.9, "--gain-cap", draw.number(2, 50))
    command += draw.sometimes(0.3, "--own-delay") if "--gain-cap" in command else []
    if way < 0.6 and draw.random() < 0.25:
        command += ["--leader-speed", draw.number(0.01, 2), *draw.sometimes(0.3, "--sign-gain", draw.number(1, 5))]
    command += draw.sometimes(0.25, "--max-residual", draw.number(1e-6, 1))
    command += draw.sometimes(0.2, "--delta", draw.number(0.01, 1)) + draw.sometimes(0.2, "--noise", "0.01")
    return graph.n_nodes, command, {"g.csv": text_of(graph, delays)}


def leaders(draw: Draw) -> tuple[int, list[str], dict[str, str]]:
    """Return leaders that move, of which there are one or more."""
    rng, count = np.random.default_rng(draw.getrandbits(32)), draw.randint(1, 5)
    graph = led_graph(rng, count, max(1, draw.size() - count), acyclic=draw.random() < 0.5)
    command = ["certify", "g.csv", *draw.gain(), *draw.state(graph.labels), *draw.asked(), *_quick(draw)]
    speed = draw.number(0.01, 2)
    command += ["--leader-speed", speed, *draw.sometimes(0.3, "--delta", draw.number(0.01, 1))]
    command += draw.sometimes(0.3, "--sign-gain", draw.number(0.1, 5))
    command += draw.sometimes(0.3, "--gain-cap", draw.number(2, 50)) + draw.sometimes(0.2, "--noise", "0.01")
    return graph.n_nodes, command, {"g.csv": text_of(graph)}


def beside(draw: Draw) -> tuple[int, list[str], dict[str, str]]:
    """Return late messages, leaders that move, caps, disturbances and noise of a family of which members agree."""
    rng, count = np.random.default_rng(draw.getrandbits(32)), draw.randint(1, 3)
    family = led_family(rng, count, draw.randint(1, 12), draw.randint(1, 3), common=count > 1 and draw.random() < 0.4)
    files = {f"m{k}.csv": text_of_mode(mode, family.labels) for k, mode in enumerate(family.modes)}
    command = ["certify", *files, "--switching", *draw.gain(), *draw.state(family.labels), *draw.asked()]
    late = draw.random() < 0.7
    if late:
        command += draw.choice([["--delay", draw.number(1e-4, 0.2)], ["--quantisation", draw.number(1e-3, 1)]])
        command += draw.sometimes(0.3, "--period", draw.number(1e-3, 0.05), "--packet-loss", str(draw.randint(0, 4)))
        command += draw.sometimes(0.25, "--max-residual", draw.number(1e-6, 1))
    command += draw.sometimes(0.5, "--gain-cap", draw.number(2, 50))
    if draw.random() < (0.4 if late else 0.6):
        command += ["--leader-speed", draw.number(0.01, 2), *draw.sometimes(0.3, "--sign-gain", draw.number(0.1, 5))]
    command += draw.sometimes(0.3, "--delta", draw.number(0.01, 1))
    command += draw.sometimes(0.3, "--noise", draw.number(0.001, 0.1))
    return family.n_nodes, command, files


def vehicles(draw: Draw) -> tuple[int, list[str], dict[str, str]]:
    """Return double integrators that exchange virtual positions: late, led, with uncertain weights, in families."""
    rng, count = np.random.default_rng(draw.getrandbits(32)), draw.randint(1, 4)
    if draw.random() < 0.5:
        family = led_family(rng, count, draw.randint(1, 12), draw.randint(1, 3))
        n, labels = family.n_nodes, family.labels
        files = {f"m{k}.csv": text_of_mode(mode, labels) for k, mode in enumerate(family.modes)}
        command, delay = ["certify", *files, "--switching"], draw.number(1e-4, 0.1)
        follows = {labels[t] for mode in family.modes for t in mode.target.tolist()}
    else:
        graph = led_graph(rng, count, max(1, min(draw.size(), 130) - count), acyclic=draw.random() < 0.5)
        n, labels = graph.n_nodes, graph.labels
        delays = {(s, t): Fraction(draw.choice(["0", "1/100", "0.03"])) for s, t, _ in graph.edges()}
        command, files = ["certify", "g.csv"], {"g.csv": text_of(graph, delays if draw.random() < 0.4 else None)}
        delay = "delay" if "delay" in files["g.csv"].partition("\n")[0] else draw.number(1e-4, 0.1)
        command += draw.choice([_quick(draw), ["--uncertainty", draw.choice(["1%", "10%", "1/3"])]])
        follows = {t for _, t, _ in graph.edges()}
    command += ["--agents", "double-integrator", "--exchange", "virtual", *draw.gain(), *draw.asked()]
    command += draw.sometimes(0.8, "--delay", delay) + draw.sometimes(0.3, "--leader-speed", draw.number(0.01, 2))
    command += draw.sometimes(0.2, "--quantisation", draw.number(1e-3, 1))
    command += draw.sometimes(0.5, "--gain-cap", draw.number(2, 50)) + draw.sometimes(0.3, "--max-residual", "0.1")
    values = ("0", "1", "-2", "0.25")
    command += draw.sometimes(0.7, "--x0", ",".join(draw.choice(values) for _ in labels))
    velocities = ",".join(draw.choice(values) if label in follows else "0" for label in labels)
    return n, [*command, *draw.sometimes(0.4, "--v0", velocities)], files


def design(draw: Draw) -> tuple[int, list[str], dict[str, str]]:
    """Return a search of gains within a limit of the input."""
    graph, files, _ = _one(draw, most=60)
    if draw.random() < 0.3:
        command = ["design", "g.csv", "--max-input", draw.number(1, 1e4), "--shortest-deadline"]
        command += _agents(draw, graph.labels)
        more = ["--residual", draw.number(0.001, 1)] if "--gain-cap" in command else []
        return graph.n_nodes, [*command, *more], files
    command = ["design", "g.csv", "--max-input", draw.number(1, 1e4), "--initial-bound", draw.number(0.1, 10)]
    command += draw.choice([["--shortest-deadline"], ["--deadline", draw.number(0.05, 10)]])
    command += draw.sometimes(0.3, "--residual", draw.number(1e-6, 1)) + draw.sometimes(0.2, "--input-norm", "2")
    return graph.n_nodes, command, files


def stubborn(draw: Draw) -> tuple[int, list[str], dict[str, str]]:
    """Return a command of another kind, on whose graph some agents are stubborn, or all."""
    n, command, files = KINDS[draw.choice([kind for kind in KINDS if kind not in ("stubborn", "restricted")])](draw)
    theta = draw.choice([draw.number(0.01, 10), draw.number(0.01, 10), "0.3..0.5"])
    first = next(iter(files.values())).splitlines()[1]  # nodes stand before edges
    return n, [*command, "--stubborn", draw.choice([theta, f"{first}={theta}", f"{first}={theta}"])], files


KINDS: dict[str, Callable[[Draw], tuple[int, list[str], dict[str, str]]]] = {
    "nominal": nominal,
    "sliding mode": sliding_mode,
    "family": family,
    "restricted": restricted,
    "agents": agents,
    "late": late,
    "leaders": leaders,
    "beside": beside,
    "vehicles": vehicles,
    "design": design,
    "stubborn": stubborn,
}


# ---------------------------------------------------------------------- a run


def random_command(kind: str, seed: int, time_limit: int = 4) -> Command:
    """Return the command of a kind and a seed.

    Parameters
    ----------
    kind : one of KINDS
    seed : int
    time_limit : int
        Seconds of searches.
    """
    draw = Draw(f"{kind} {seed}")
    size, arguments, files = KINDS[kind](draw)
    if arguments[0] == "certify":
        arguments += ["--time-limit", str(time_limit)]
    return Command(kind, seed, size, (*arguments, "-o", "c.json"), files)


def run_command(command: Command, folder: Path) -> Outcome:
    """Run a command in a folder, which is the working one, and check what it wrote.

    Raises
    ------
    AssertionError
        The exit code is none of the documented ones, the program says that its own check rejects what it claims, a
        refusal is not one line, or the check does not accept the file.
    """
    for name, text in command.files.items():
        (folder / name).write_text(text)
    path, begin = folder / "c.json", time.perf_counter()
    path.unlink(missing_ok=True)
    run = ptcc(*command.arguments)
    where = f"{command.kind!r} {command.seed}: ptcc {' '.join(command.arguments)}"[:600]
    _judge(where, run, path)
    return Outcome(command, run.code, path.exists(), time.perf_counter() - begin, run.out + run.err)


def run_set(seed: int, folder: Path) -> Outcome:
    """Certify from a box or an ellipsoid of initial states, which the library alone takes, and check what it wrote.

    Raises
    ------
    AssertionError
        As in :func:`run_command`.
    """
    draw = Draw(f"set {seed}")
    graph, begin, path = draw.graph(min(draw.size(), 130)), time.perf_counter(), folder / "c.json"
    n, values = graph.n_nodes, ("0", "1", "-1", "2.5", "1/3", "-7e-3")
    center = [Fraction(draw.choice(values)) for _ in range(n)]
    if draw.random() < 0.5:
        widths = [abs(Fraction(draw.choice(values))) for _ in range(n)]
        low, high = ([x + s * r for x, r in zip(center, widths, strict=True)] for s in (-1, 1))
        initial_set = box(low, high)
    else:
        initial_set = ellipsoid(center, [[draw.choice(values) for _ in range(n)] for _ in range(draw.randint(1, 4))])
    protocol = NominalProtocol(T=draw.number(0.05, 20), rho1=1, rho2=draw.number(0.1, 20), kappa=2)
    asked = Expectations(max_input=Fraction(draw.number(1, 1e4)))
    caps = [GainLimits(gain_cap=draw.number(2, 100))] if draw.random() < 0.4 else []
    options = {"initial_set": initial_set, "limits": caps, "expectations": asked, "time_limit": 4}
    path.unlink(missing_ok=True)
    try:
        made = certify_words(graph, protocol, center, simulation=False, **options)
        made.save(path)
        run = Run(int(made.assessment.exit_code), made.summary(), "")
    except ParameterError as error:  # weights that are too long for exact proofs
        run = Run(2, "", f"ptcc: {error}\n")
    _judge(f"'set' {seed}", run, path)
    command = Command("set", seed, n, (), {})
    return Outcome(command, run.code, path.exists(), time.perf_counter() - begin, run.out + run.err)


def run_case(kind: str, seed: int, folder: Path) -> Outcome:
    """Run what a kind and a seed stand for: a command of :data:`KINDS`, or a "set" of initial states."""
    return run_set(seed, folder) if kind == "set" else run_command(random_command(kind, seed), folder)


def _judge(where: str, run: Run, path: Path) -> None:
    """Judge what a run printed and wrote."""
    told, written = run.out + run.err, path.exists()
    assert run.code in DOCUMENTED, f"{where}: exit code {run.code}: {told[-800:]}"
    assert not NEVER.search(" ".join(told.split())), f"{where}: {told[-800:]}"
    if run.code == 2:
        refusals = [line for line in run.err.splitlines() if line.startswith("ptcc: ")]
        assert len(refusals) == 1 and not run.out, f"{where}: {told[-800:]}"
        assert not written, f"{where}: a file was written though it was refused"
    elif run.code == 0:
        assert written, f"{where}: certified, and no file"
    if written:
        checked = ptcc("check", "c.json", "--memory", "4")
        assert checked.code in (0, 4), f"{where}: check: {checked.code}: {checked.out[-800:]}{checked.err[-800:]}"
        verdict = json.loads(path.read_text())["verdict"]
        assert (checked.code == 0) == (verdict == "certified"), f"{where}: check: {checked.code}, {verdict}"
