"""Bad inputs of the command line, as a table; ``python tests/bad_inputs.py`` prints what ``ptcc`` says to each.

Every one of them is refused with exit code 2 and one line that tells what is wrong, and leaves nothing behind.
"""

from __future__ import annotations

import contextlib
import gzip
import io
import os
import socket
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ptcc_certify import cli

Content = bytes | str | Callable[[Path], None]


@dataclass(frozen=True)
class Run:
    """What one call of ``ptcc`` did."""

    code: int
    out: str
    err: str


@dataclass(frozen=True)
class BadInput:
    """A call of ``ptcc``, the files it needs, a pattern that its refusal must show, its standard input."""

    name: str
    args: tuple[str, ...]
    says: str
    files: tuple[tuple[str, Content], ...] = ()
    stdin: bytes = b""


def ptcc(*args: str, stdin: bytes = b"") -> Run:
    """Call ``ptcc_certify.cli.main`` in this process."""
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2))
    before = sys.argv, sys.stdin
    sys.argv, sys.stdin = ["ptcc", *args], io.TextIOWrapper(io.BytesIO(stdin), encoding="utf-8")
    code: Any = 0
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            cli.main()
    except SystemExit as stop:
        code = stop.code
    finally:
        sys.argv, sys.stdin = before
    texts = [stream.buffer.getvalue().decode("utf-8") for stream in (out, err)]  # type: ignore[attr-defined]
    return Run(code, *texts)


def detailed(*args: str) -> Run:
    """Call ``ptcc .. -v``; of what it prints, lines that continue another are joined to it."""
    run = ptcc(*args, "-v")
    lines: list[str] = []
    for line in run.out.splitlines():
        if line.startswith(" " * 11) and lines:
            lines[-1] += " " + line.strip()
        else:
            lines.append(line)
    return Run(run.code, "\n".join(lines) + "\n", run.err)


def write(files: Sequence[tuple[str, Content]], folder: Path) -> None:
    for name, content in files:
        path = folder / name
        if callable(content):
            content(path)
        else:
            path.write_bytes(content.encode() if isinstance(content, str) else content)


def listing(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


# ---------------------------------------------------------------------- files


def _graph(name: str, content: Content, says: str, *options: str, file: str = "g.csv") -> BadInput:
    return BadInput(name, ("certify", file, "-o", "out.json", *options), says, ((file, content),))


def _array(array: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=True)
    return buffer.getvalue()


def _archive(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def _unreadable(path: Path) -> None:
    """Something at ``path`` that cannot be read: for root, whom no permission stops, a socket."""
    if os.name != "posix":
        path.mkdir()
    elif os.geteuid() == 0:
        here = Path.cwd()
        os.chdir(path.parent)  # the name of a socket must be short
        try:
            socket.socket(socket.AF_UNIX).bind(path.name)
        finally:
            os.chdir(here)
    else:
        path.write_text("a,b,1\n")
        path.chmod(0)


def _folder(path: Path) -> None:
    path.mkdir()


def _graphml(edges: str, default: str = "directed", key: str = "weight") -> str:
    return (
        '<?xml version="1.0"?><graphml xmlns="http://graphml.graphdrawing.org/xmlns">'
        f'<key id="w" for="edge" attr.name="{key}" attr.type="double"/>'
        f'<graph edgedefault="{default}"><node id="a"/><node id="b"/>{edges}</graph></graphml>'
    )


_EDGE = '<edge source="a" target="b"><data key="w">1</data></edge>'
_BOMB = (
    '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">'
    + "".join(f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True))
    + "]><graphml>&i;</graphml>"
)
_GML = 'graph [ directed 0 node [ id 1 label "a" ] node [ id 2 label "b" ] edge [ source 1 target 2 weight 1 ] ]'
_PAJEK = '*Vertices 2\n1 "a"\n2 "b"\n'
_MTX = "%%MatrixMarket matrix coordinate real general\n"
_PAIR: tuple[tuple[str, Content], ...] = (("g.csv", "a,b,1\nb,a,-1\n"),)

FILES = [
    _graph("weight NaN", "a,b,nan\n", "not a finite number"),
    _graph("weight infinite", "a,b,1\nb,a,-inf\n", "line 2"),
    _graph("weight a text", "a,b,1\nb,a,friend\n", '"friend"'),
    _graph("weight zero", "a,b,1\nb,a,0.0\n", "neither ally nor opponent"),
    _graph("weight empty", "a,b,1\nb,a,\n", "has no weight"),
    _graph("weight a division by zero", "a,b,1/0\n", "divides by zero"),
    _graph("weight with a decimal comma", "a b 0,5\n", "decimals with a point"),
    _graph("weight in digits that are not ASCII", "a,b,١٢\n", "not a number"),
    _graph("weight with underscores", "a,b,1_000\n", "not a number"),
    _graph("weight 1e999999999", "a,b,1e999999999\n", "exponent"),
    _graph("weight 1e-999999999", "a,b,1e-999999999\n", "exponent"),
    _graph("weight 1e-400", "a,b,1e-400\n", "outside the range of float64"),
    _graph("weight 1e400", "a,b,1e400\n", "outside the range of float64"),
    _graph("weight of 10^7 digits", "a,b," + "7" * 10**7 + "\n", "longer than"),
    _graph("weight of 5000 digits", "a,b," + "7" * 5000 + "\n", "too long"),
    _graph("a line of 10^6 columns", ",".join(["a"] * 10**6) + "\n", "longer than"),
    _graph("file empty", "", "no edge and no node"),
    _graph("file of comments only", "# one\n% two\n", "no edge and no node"),
    _graph("file of blanks only", " \n\t\n\n", "no edge and no node"),
    _graph("header only", "source,target,weight\n", "no edge and no node"),
    _graph("header without a weight", "source,target,time\na,b,1\n", "names no weight"),
    _graph("rows of two columns", "a,b\nb,a\n", "has no weight"),
    _graph("row without a target", "a,b,1\na,,1\n", "target is empty"),
    _graph("row twice", "a,b,1\nb,a,1\na,b,1\n", "second row"),
    _graph("rows that add up to zero", "a,b,1\nb,a,1\na,b,-1\n", "neither ally nor opponent", "--duplicates", "sum"),
    _graph("pair twice, undirected", "a,b,1\nb,a,1\n", "second row", "--undirected"),
    _graph("self-loop", "a,b,1\nb,b,1\n", "self-loop"),
    _graph("quote that is not closed", 'a,"b,1\nb,a,1\n', "quote"),
    _graph("binary file", bytes(range(256)) * 40, "line 1"),
    _graph("Latin-1 text", "é,b,1\n".encode("latin-1"), "not UTF-8"),
    _graph("UTF-16 text", "a,b,1\n".encode("utf-16"), "UTF-8"),
    _graph("directory", _folder, "is a folder"),
    _graph("unreadable file", _unreadable, "g.csv"),
    BadInput("missing file", ("certify", "nowhere.csv", "-o", "out.json"), "no such file"),
    BadInput("standard input empty", ("certify", "-", "-o", "out.json"), "no edge and no node"),
    BadInput("standard input not a graph", ("classify", "-"), "standard input, line 1", stdin=b"a,b\n"),
    _graph("gzip cut short", gzip.compress(b"a,b,1\n" * 1000)[:-20], "gzip", file="g.csv.gz"),
    _graph("gzip in name only", "a,b,1\n", "not a gzip file", file="g.csv.gz"),
    _graph("GraphML multigraph", _graphml(_EDGE + _EDGE), "second row", file="g.graphml"),
    _graph("GraphML undirected", _graphml(_EDGE, "undirected"), "--undirected", file="g.graphml"),
    _graph("GraphML without weights", _graphml(_EDGE, key="colour"), "has no weight", file="g.graphml"),
    _graph("GraphML that is CSV", "a,b,1\n", "GraphML", file="g.graphml"),
    _graph("XML nested 10^5 deep", "<a>" * 10**5 + "</a>" * 10**5, "not GraphML", file="g.graphml"),
    _graph("XML nested and cut short", "<a>" * 10**5, "GraphML", file="g.graphml"),
    _graph("XML entity bomb", _BOMB, "DOCTYPE", file="g.graphml"),
    _graph("GML undirected", _GML, "--undirected", file="g.gml"),
    _graph("GML cut short", _GML[:-8], "GML", file="g.gml"),
    _graph("GML nested 10^5 deep", "graph " + "[ a\n" * 10**5, "GML|nested", file="g.gml"),
    _graph("Pajek undirected", _PAJEK + "*Edges\n1 2 1\n", "--undirected", file="g.net"),
    _graph("Pajek arc to nowhere", _PAJEK + "*Arcs\n1 3 1\n", "3", file="g.net"),
    _graph("Pajek of 10^9 nodes", "*Vertices 999999999\n", "more than", file="g.net"),
    _graph("Matrix Market pattern", _MTX.replace("real", "pattern") + "2 2 1\n1 2\n", "pattern", file="g.mtx"),
    _graph("Matrix Market cut short", _MTX + "2 2 2\n1 2 1\n", "not whole", file="g.mtx"),
    _graph("matrix not square", _array(np.ones((2, 3))), "square", file="g.npy"),
    _graph("matrix of three dimensions", _array(np.ones((2, 2, 2))), "square", file="g.npy"),
    _graph("matrix with NaN", _array(np.array([[0.0, np.nan], [1.0, 0.0]])), "finite", file="g.npy"),
    _graph("matrix with a diagonal", _array(np.eye(2)), "self-loop", file="g.npy"),
    _graph("matrix of complex numbers", _array(np.array([[0, 1j], [1, 0]])), "complex128", file="g.npy"),
    _graph("matrix of objects (pickle)", _array(np.array([[0, "x"], [1, 0]], dtype=object)), "Object", file="g.npy"),
    _graph("matrix cut short", _array(np.ones((9, 9)))[:-64], "NumPy", file="g.npy"),
    _graph("archive of two matrices", _archive(A=np.ones((2, 2)), B=np.ones((3, 3))), "--variable NAME", file="g.npz"),
    _graph("archive without a matrix", _archive(text=np.array(["a"])), "no square", file="g.npz"),
    _graph("archive that is no archive", b"PK\x03\x04 nonsense", ".npz", file="g.npz"),
    _graph("MATLAB file of zeros", bytes(500), "MATLAB", file="g.mat"),
    BadInput("unknown --edges of a matrix", ("certify", "g.npy", "--edges", "rows"), "listens",
             (("g.npy", _array(np.array([[0.0, 1.0], [1.0, 0.0]]))),)),
]  # fmt: skip

# ---------------------------------------------------------------------- values and options


def _option(name: str, says: str, *options: str, command: str = "certify", graph: str = "fig1b") -> BadInput:
    output = "out.csv" if command == "simulate" else "out.json"
    return BadInput(name, (command, graph, *options, "-o", output), says, _PAIR)


def _start(name: str, content: str, says: str) -> BadInput:
    return BadInput(name, ("certify", "g.csv", "--x0", "x0.csv", "-o", "out.json"), says, (*_PAIR, ("x0.csv", content)))


OPTIONS = [
    _option("T zero", "T = 0", "--T", "0"),
    _option("T negative", "T = -1", "--T", "-1"),
    _option("T NaN", "T = nan", "--T", "nan"),
    _option("T infinite", "T = inf", "--T", "inf"),
    _option("T a text", "T = soon", "--T", "soon"),
    _option("T empty", "T = ", "--T", ""),
    _option("T 1e301", "1e300", "--T", "1e301"),
    _option("rho1 negative", "rho1 = -0.5", "--rho1", "-0.5"),
    _option("rho1 zero", "rho1 = 0", "--rho1", "0"),
    _option("rho2 negative", "rho2 = -1", "--rho2", "-1"),
    _option("rho2 zero: no deadline", "rho2 = 0", "--rho2", "0"),
    _option("kappa zero", "kappa = 0", "--kappa", "0"),
    _option("kappa NaN", "kappa = nan", "--kappa", "nan"),
    BadInput("kappa without a value", ("certify", "fig1b", "--kappa"), "--kappa"),
    _option("x0 too short", "5 values.* 6 nodes", "--x0", "1,2,3,4,5"),
    _option("x0 too long", "7 values.* 6 nodes", "--x0", "1,2,3,4,5,6,7"),
    _option("x0 empty", "initial state", "--x0", ""),
    _option("x0 of an unknown node", 'node "?zeta', "--x0", "1=1,2=2,3=3,4=4,5=5,zeta=6"),
    _option("x0 of a node twice", "two values", "--x0", "1=1,2=2,3=3,4=4,5=5,5=6"),
    _option("x0 of a node missing", "no value.*6|6 has no value", "--x0", "1=1,2=2,3=3,4=4,5=5"),
    _option("x0 NaN", "not a finite number", "--x0", "1,2,3,4,5,nan"),
    _option("x0 a text", '"six" is not a number', "--x0", "1,2,3,4,5,six"),
    _option("x0 of 400 digits", "1e300", "--x0", "9" * 400 + ",2,3,4,5,6"),
    _option("x0 of 10^5 digits", "characters", "--x0", "9" * 10**5 + ",2,3,4,5,6"),
    _option("x0 file missing", "nowhere.csv", "--x0", "nowhere.csv"),
    _start("x0 file: unknown node", "node,value\na,1\nb,2\nc,3\n", 'x0.csv, line 4: node "?c'),
    _start("x0 file: node twice", "a,1\nb,2\na,3\n", "two values"),
    _start("x0 file: node missing", "a,1\n", "no value: b|b has no value"),
    _start("x0 file: value a text", "a,1\nb,high\n", "line 2"),
    _start("x0 file: one column", "a\nb\n", "node,value"),
    _start("x0 file empty", "", "no value"),
    _option("seed negative", "--seed", "--seed", "-1"),
    _option("seed a text", "--seed", "--seed", "lucky"),
    _option("seed a fraction", "--seed", "--seed", "1.5"),
    _option("--edges unknown", "--edges", "--edges", "sideways", graph="g.csv"),
    _option("--duplicates unknown", "--duplicates", "--duplicates", "first", graph="g.csv"),
    _option("--protocol unknown", "--protocol", "--protocol", "magic"),
    _option("--expect unknown", "unknown behaviour", "--expect", "peace"),
    _option("--expect of two lines", "unknown behaviour", "--expect", "stability\nor not"),
    _option("--min-rate a text", "--min-rate", "--min-rate", "fast"),
    _option("--min-rate NaN", "--min-rate", "--min-rate", "nan"),
    _option("--min-rate 1e999", "--min-rate", "--min-rate", "1e999"),
    _option("unknown option", "--frobnicate", "--frobnicate"),
    _option("unknown control character in an option", "No such option", "--\x1b[31m"),
    _option("two graphs", "fig1a", "fig1a"),
    _option("--dimension zero", "--dimension", "--dimension", "0", command="simulate"),
    _option("--dimension 10^9", "--dimension", "--dimension", "1000000000", command="simulate"),
    _option("--samples one", "--samples", "--samples", "1", command="simulate"),
    _option("--samples 10^9", "--samples", "--samples", "1000000000", command="simulate"),
    _option("x0 for two dimensions too short", "12 numbers", "--dimension", "2", "--x0", "1,2,3", command="simulate"),
    _option("x0 for two dimensions a text", "--x0", "--dimension", "2", "--x0", "x," * 11 + "x", command="simulate"),
    _option("simulated x0 of 400 digits", "x0", "--x0", "9" * 400 + ",2,3,4,5,6", command="simulate"),
    BadInput("no certificate", ("check",), "CERTIFICATE"),
    BadInput(
        "reading options without a graph",
        ("check", "c.json", "--edges", "listens"),
        "name it: ptcc check CERT GRAPH",
        (("c.json", "{}"),),
    ),
    BadInput("missing certificate", ("check", "nowhere.json"), "nowhere.json: not a readable certificate"),
    BadInput("certificate that is a folder", ("check", "c.json"), "is a folder", (("c.json", _folder),)),
    BadInput("certificate cut short", ("check", "c.json"), "not a readable", (("c.json", '{"schema": "ptcc-'),)),
    BadInput("another schema", ("check", "c.json"), "ptcc-certificate/3", (("c.json", '{"schema": "x/9"}'),)),
    BadInput("a graph for a certificate", ("check", "g.csv"), "not a readable certificate", _PAIR),
    BadInput("no graph", ("certify",), "GRAPH"),
    BadInput("unknown command", ("predict", "fig1b"), "predict"),
    BadInput("unknown example", ("examples", "fig9z"), "fig9z"),
    BadInput("unknown theorem", ("cite", "7.7"), "7.7"),
    BadInput("output into a missing folder", ("certify", "fig1b", "-o", "nowhere/out.json"), "folder"),
    BadInput("output a directory", ("certify", "fig1b", "-o", "there"), "directory", (("there", _folder),)),
    BadInput("output below a file", ("certify", "fig1b", "-o", "g.csv/out.json"), "folder", _PAIR),
    BadInput(
        "output over the graph", ("certify", "g", "-o", "./g"), "is read by the command itself", (("g", "a\tb\t1\n"),)
    ),
    BadInput("certificate named as an archive", ("certify", "fig1b", "-o", "c.zip"), "end in .json"),
    BadInput("output named -", ("certify", "fig1b", "-o", "-"), "-o names a file"),
    BadInput("CSV into a missing folder", ("simulate", "fig1b", "-o", "nowhere/out.csv"), "folder"),
    BadInput("figure of an unknown kind", ("simulate", "fig1b", "-o", "out.jpg"), "out.jpg"),
    BadInput("figure of two dimensions", ("simulate", "fig1b", "-o", "out.png", "--dimension", "2"), "--dimension"),
    BadInput("examples into a file", ("examples", "1", "-o", "g.csv"), "g.csv", _PAIR),
    BadInput("examples below a file", ("examples", "1", "-o", "g.csv/deeper"), "g.csv/deeper", _PAIR),
]


def _sliding(name: str, says: str, *args: str, command: str = "certify") -> BadInput:
    return BadInput(name, (command, "fig1a", "--protocol", "sliding-mode", *args), says)


def _disturbed(name: str, says: str, text: str, *more: str) -> BadInput:
    return _sliding(f"disturbance: {name}", says, "--disturbance", text, *more)


def _input(name: str, says: str, *args: str, command: str = "certify") -> BadInput:
    return BadInput(name, (command, "fig1a", *args), says)


INPUT = [
    _input("initial-bound of 0", "bound of initial states", "--initial-bound", "0"),
    _input("initial-bound of words", "--initial-bound", "--initial-bound", "far"),
    _input("max-input of words", "--max-input", "--max-input", "1 V"),
    _input("max-input of 0", "--max-input", "--max-input", "0"),
    _input("gain-cap below 0", "gain_cap", "--gain-cap", "-3"),
    _input("gain-cap that is no number", "--gain-cap", "--gain-cap", "nan"),
    _input("stop-before beyond the deadline", "--stop-before", "--stop-before", "2"),
    _input("sample-period beyond the deadline", "--sample-period", "--sample-period", "1.5"),
    _input("delta of 0 under the nominal protocol", "delta", "--delta", "0"),
    _input("gain-cap of the sliding mode", "--gain-cap", "--protocol", "sliding-mode", "--gain-cap", "9"),
    _input("simulate: stop-before beyond the deadline", "--stop-before", "--stop-before", "1", command="simulate"),
    _input("simulate: a disturbance without delta", "delta", "--disturbance", "t", command="simulate"),
    _input("simulate: a disturbance beyond delta", "beyond", "--disturbance", "2", "--delta", "1", command="simulate"),
    _input("design without limits", "--max-input", command="design"),
    _input("design without a deadline", "--deadline", "--max-input", "1", "--initial-bound", "1", command="design"),
    _input(
        "design with both deadlines",
        "ask for two things",
        "--max-input",
        "1",
        "--initial-bound",
        "1",
        "--deadline",
        "1",
        "--shortest-deadline",
        command="design",
    ),
    _input(
        "design within nothing",
        "max_input",
        "--max-input",
        "0",
        "--initial-bound",
        "1",
        "--deadline",
        "1",
        command="design",
    ),
    _input(
        "design with an odd curve",
        "curve",
        "--max-input",
        "1",
        "--initial-bound",
        "1",
        "--deadline",
        "1",
        "--curve",
        "x.gif",
        command="design",
    ),
]

SLIDING = [
    _disturbed("beyond delta, with no run to show it", "beyond delta", "2", "--x0", "1,1,1,1,1,1", "--no-simulation"),
    _disturbed("code", "__import__", "__import__('os')"),
    _disturbed("an attribute", "column", "t.__class__"),
    _disturbed("a string", "column", "'t'"),
    _disturbed("an index", "column", "t[0]"),
    _disturbed("lambda", "lambda", "lambda: 1"),
    _disturbed("10^5 parentheses", "too long", "(" * 10**5),
    _disturbed("400 parentheses", "nested", "(" * 400 + "t" + ")" * 400),
    _disturbed("10^5 minus signs", "too long", "-" * 10**5 + "1"),
    _disturbed("a tower of powers", "not finite", "9**9**9**9"),
    _disturbed("300 powers", "nested", "1**" * 300 + "1"),
    _disturbed("a huge number", "range", "1e999"),
    _disturbed("an unknown name", "spam", "spam"),
    _disturbed("an unknown function", "gamma", "gamma(t)"),
    _disturbed("division by zero", "not finite", "1/0"),
    _disturbed("a pole on the horizon", "agent", "0.01/(t - 0.3)"),
    _disturbed("a pole at the start", "t = 0", "1/t"),
    _disturbed("the root of a negative number", "agent", "sqrt(t - 0.5)"),
    _disturbed("beyond delta", "agent", "1.5*sin(t)"),
    _disturbed("beyond delta for one agent", "agent 6", "k/5.5"),
    _disturbed("beyond delta late", "0.9", "t/0.99"),
    _disturbed("empty", "number", ""),
    _disturbed("two words", r"cannot stand here; .* sin\(\.\.\.\) for a function", "sin t t"),
    _disturbed("an open parenthesis", "never closed", "sin(t"),
    _disturbed("a comma", ",", "sin(t, 1)"),
    _disturbed("a caret", "write a power", "t^2"),
    _disturbed("digits of another script", "column", "\u0663"),
    _disturbed("a control character", "column", "t\x1b[31m"),
    _sliding("disturbance of the nominal protocol", "--disturbance", "--protocol", "nominal", "--disturbance", "t"),
    _sliding("sigma0 of the nominal protocol", "--sigma0", "--protocol", "nominal", "--sigma0", "0"),
    _sliding("T-r of the nominal protocol", "--T-r", "--protocol", "nominal", "--T-r", "1"),
    _sliding("mu1 of the nominal protocol", "--mu1", "--protocol", "nominal", "--mu1", "1"),
    _sliding("T of the sliding-mode protocol", "--T-r", "--T", "1"),
    _sliding("mu1 equal to delta", "mu1 = 1 does not exceed delta", "--mu1", "1"),
    _sliding("mu1 below delta", "mu1", "--mu1", "1", "--delta", "1.0000001"),
    _sliding("mu2 zero", "mu2", "--mu2", "0"),
    _sliding("mu3 negative", "mu3", "--mu3=-1"),
    _sliding("delta negative", "delta", "--delta=-1"),
    _sliding("T-s zero", "T_s", "--T-s", "0"),
    _sliding("T-r a text", "T_r", "--T-r", "soon"),
    _sliding("T-r empty", "T_r", "--T-r", ""),
    _sliding("rho2 zero", "rho2", "--rho2", "0"),
    _sliding("sigma0 too short", "sigma0", "--sigma0", "1,2"),
    _sliding("sigma0 NaN", "sigma0", "--sigma0", "nan,1,2,3,4,5"),
    _sliding("sigma0 beyond 1e300", "sigma0", "--sigma0", "1e301,1,2,3,4,5"),
    _sliding("simulated: sigma0 too short", "sigma0", "--sigma0", "1,2", command="simulate"),
    _sliding("simulated: two dimensions", "--dimension", "--dimension", "2", command="simulate"),
    _sliding("simulated: layer zero", "--boundary-layer", "--boundary-layer", "0", command="simulate"),
    _sliding("simulated: layer NaN", "--boundary-layer", "--boundary-layer", "nan", command="simulate"),
    _sliding(
        "simulated: layer of the nominal protocol",
        "--boundary-layer belongs to --protocol sliding-mode",
        "--protocol",
        "nominal",
        "--boundary-layer",
        "1",
        command="simulate",
    ),
]

BAD_INPUTS = FILES + OPTIONS + INPUT + SLIDING


def main() -> None:
    with tempfile.TemporaryDirectory() as base:
        for number, case in enumerate(BAD_INPUTS):
            folder = Path(base, str(number))
            folder.mkdir()
            os.chdir(folder)
            write(case.files, folder)
            before, started = listing(folder), time.perf_counter()
            run = ptcc(*case.args, stdin=case.stdin)
            seconds = time.perf_counter() - started
            left = sorted(set(listing(folder)) - set(before))
            odd = f"  STDOUT {run.out[:60]!r}" * bool(run.out) + f"  LEFT {left}" * bool(left)
            print(f"{case.name:<42} {run.code}  {seconds:5.2f} s  {run.err.rstrip()}{odd}")
        os.chdir("/")


if __name__ == "__main__":
    main()
