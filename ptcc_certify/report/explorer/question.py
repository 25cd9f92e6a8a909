"""What the explorer asks ``certify``, and the Python and the command line that ask it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from textwrap import fill
from typing import Any

from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.io.packaged import GRAPHS
from ptcc_certify.graphs.reading import Reading, option_flags
from ptcc_certify.model import Protocol, SlidingModeProtocol
from ptcc_certify.model.disturbance import Disturbance
from ptcc_certify.report.explorer.settings import Settings


@dataclass(frozen=True, eq=False)
class Question:
    """What ``certify`` is asked for some settings.

    Attributes
    ----------
    settings : Settings
    source : mapping or None
        Where the graph was read from and how (``path``, ``orientation``, ...); None of a packaged graph or an object.
    graph : SignedDigraph
    protocol : NominalProtocol or SlidingModeProtocol
    x0 : list of N int
    sigma0 : list of N int, or None
        None for the nominal protocol.
    disturbance : Disturbance or None
    """

    settings: Settings
    source: Mapping[str, Any] | None
    graph: SignedDigraph
    protocol: Protocol
    x0: list[int]
    sigma0: list[int] | None
    disturbance: Disturbance | None

    @property
    def sliding(self) -> dict[str, Any]:
        """What is asked under the sliding-mode protocol alone."""
        return {} if self.sigma0 is None else {"sigma0": self.sigma0, "disturbance": self.disturbance}


def python_of(question: Question) -> str:
    """Return Python that makes the certificate of a question and draws its decay."""
    settings, source, name = question.settings, question.source, question.settings.graph
    lines = ["import ptcc_certify as ptcc"]
    if source is None and name in GRAPHS:
        lines += ["", f'g = "{name}"']
    elif source is None:
        lines += ["", "g = ...  # the graph that was given to explore()"]
    else:
        how = "".join(f", {key}={value!r}" for key, value in source.items() if key != "path")
        lines += ["", f"g = ptcc.read_graph({source['path']!r}{how})"]
    kind = "SlidingModeProtocol" if settings.kind == "sliding-mode" else "NominalProtocol"
    parameters = ", ".join(f"{key}={value!r}" for key, value in _texts(question).items())
    lines += fill(f"p = ptcc.{kind}({parameters})", 80, subsequent_indent="    ").split("\n")
    asks = [] if settings.method == "best" else [f'method="{settings.method}"']
    arguments = [f"x0={question.x0}"]
    if question.sigma0 is not None:
        arguments = [f"x0=ptcc.InitialState({question.x0}, sigma0={question.sigma0})"]
        asks.append(f"disturbance={_disturbance(question)}")
    if asks:
        arguments.append(f"asks=ptcc.Asks({', '.join(asks)})")
    lines += ["cert = ptcc.certify(", "    g,", "    p,", *(f"    {argument}," for argument in arguments), ")"]
    lines += ["print(cert)", 'ptcc.save_figure(ptcc.plot_decay(cert), "decay.png")']
    return "\n".join(lines)


def command_of(question: Question) -> str:
    """Return the ``ptcc certify`` of a question."""
    settings, source = question.settings, dict(question.source or {})
    words = ["ptcc", "certify", str(source.pop("path", settings.graph))]
    words += ["--edges", str(source["orientation"])] if "orientation" in source else []
    words += [word for flag in option_flags(source) for word in flag.split(" ", 1)]
    words += [] if settings.kind == "nominal" else ["--protocol", settings.kind]
    for key, value in _texts(question).items():
        words += [f"--{key.replace('_', '-')}", value]
    words.append(f"--x0={','.join(map(str, question.x0))}")
    if question.sigma0 is not None:
        words += [f"--sigma0={','.join(map(str, question.sigma0))}"] if any(question.sigma0) else []
        words += ["--disturbance", settings.disturbance_text]
        words += ["--seed", str(settings.seed)] if settings.disturbance == "telegraph" else []
    words += [] if settings.method == "best" else ["--method", settings.method]
    return shlex.join(words)


def reading_of(path: str, orientation: str | None, **how: Any) -> dict[str, Any]:
    """Return where a graph was read from and how, but for what is so unless it is told."""
    options = {"orientation": orientation, **how}
    return {"path": path} | {key: value for key, value in options.items() if value != getattr(Reading, key)}


def _texts(question: Question) -> dict[str, str]:
    return {name: str(value) for name, value in question.settings.own.items()}


def _disturbance(question: Question) -> str:
    settings, protocol = question.settings, question.protocol
    if settings.disturbance != "telegraph" or not isinstance(protocol, SlidingModeProtocol):
        return repr(settings.disturbance_text)
    until = 2 * float(protocol.T)
    return (
        f"ptcc.telegraph_noise({float(protocol.delta)}, rate={20 / until!r}, n={len(question.x0)}, "
        f"until={until!r}, seed={settings.seed})"
    )
