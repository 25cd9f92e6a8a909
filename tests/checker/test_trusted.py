"""The trusted files: a list that is complete, that runs alone, and that computes without floats."""

from __future__ import annotations

import ast
import json
import os
import shutil
import subprocess
import sys
from fractions import Fraction
from functools import cache
from pathlib import Path

import pytest
from agent_documents import Setting, document
from asked import certify_family
from selection import thinned

import ptcc_certify
from ptcc_certify.certificate.certification import certify
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.model import NominalProtocol
from ptcc_certify.model.asks import Asks
from ptcc_certify.model.late_messages import LateMessages, MovingLeaders

ROOT = Path(ptcc_certify.__file__).parents[1]
LISTED = (ROOT / "ptcc_certify/checker/TRUSTED").read_text(encoding="utf-8").splitlines()
ALL = [line for line in LISTED if not line.startswith("#")]
TWINS = [line for line in ALL if line.endswith(("/fast.py", "/array_digraph.py", "/array_stepwise_bounds.py"))]
PLAIN = [line for line in ALL if line not in TWINS]
MODULES = [line for line in PLAIN if line.endswith(".py")]

STANDARD = {
    *("__future__", "array", "bisect", "collections", "contextlib", "contextvars", "dataclasses", "decimal"),
    *(
        "fractions",
        "functools",
        "gc",
        "hashlib",
        "io",
        "itertools",
        "json",
        "math",
        "numbers",
        "operator",
        "pathlib",
    ),
    *("re", "sys", "textwrap", "typing"),
}
#: Functions of ``math`` that give integers.
EXACT_MATH = {"ceil", "comb", "factorial", "floor", "gcd", "isqrt", "lcm", "perm", "prod"}
#: Where floats may stand, and what for. Nothing that is decided depends on one, but for limits of time and memory.
FLOATS = {
    ("lmi/exact/decimal_rounding.py", "float_up"): "the float next to a number",
    ("lmi/exact/decimal_rounding.py", "_write"): "prints a number; the digits come from a Decimal",
    ("ptcc_certify/checker/__init__.py", "main"): "GB that are allowed",
    ("ptcc_certify/checker/__init__.py", "_report"): "tells the GB that were needed",
    ("ptcc_certify/checker/obligations.py", ""): "tells the GB that were needed",
    ("ptcc_certify/checker/reading.py", "number"): "JSON numbers of `unverified`, which nothing reads",
    ("ptcc_certify/checker/side_files.py", "column"): "side files of floats: finite",
}


def tree(name: str) -> ast.Module:
    return ast.parse((ROOT / name).read_text(encoding="utf-8"))


def imports(name: str) -> set[str]:
    """The modules that a file imports, anywhere in it."""
    found = set()
    for node in ast.walk(tree(name)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module
            found.add(node.module)
            inside = ROOT / node.module.replace(".", "/")
            found |= {f"{node.module}.{a.name}" for a in node.names if (inside / f"{a.name}.py").exists()}
        elif isinstance(node, ast.Name):
            assert node.id not in ("__import__", "eval", "exec", "compile", "pickle", "import_module", "importlib"), (
                name
            )
    return found


def file_of(module: str) -> str:
    path = module.replace(".", "/")
    return f"{path}/__init__.py" if (ROOT / path).is_dir() else f"{path}.py"


def test_the_list_is_what_the_checker_imports():
    todo, seen = ["ptcc_certify/checker/__main__.py"], set()
    while todo:
        name = todo.pop()
        if name not in seen:
            seen.add(name)
            for module in imports(name):
                if module.split(".")[0] in ("lmi", "ptcc_certify"):
                    todo.append(file_of(module))
                else:
                    assert module.split(".")[0] in STANDARD | ({"numpy", "flint"} if name in TWINS else set()), name
    assert sorted(ALL) == sorted([*seen, "ptcc_certify/checker/obligations.json"])
    assert all(name.startswith(("lmi/exact/", "ptcc_certify/checker/")) for name in ALL)
    assert {str(p.relative_to(ROOT)) for p in (ROOT / "ptcc_certify/checker").glob("*.py")} <= set(ALL)


def test_each_file_of_the_list_is_there_once():
    arrays = [f"ptcc_certify/checker/array_{name}.py" for name in ("digraph", "stepwise_bounds")]
    assert ["lmi/exact/fast.py", *arrays] == TWINS and ALL[-3:] == TWINS
    assert len(set(ALL)) == len(ALL) and all((ROOT / name).is_file() for name in ALL)


# ---------------------------------------------------------------------- no floats


class Floats(ast.NodeVisitor):
    """Finds float literals, the names ``float`` and ``complex``, and functions of ``math`` that give floats.

    Annotations may say ``float``. A quotient or a power may be a float too: see :class:`Watched`.
    """

    def __init__(self) -> None:
        self.inside, self.found = [""], set[str]()

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        self.inside.append(node.name)
        for part in (*node.args.defaults, *(d for d in node.args.kw_defaults if d), *node.body):
            self.visit(part)
        self.inside.pop()

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value:
            self.visit(node.value)

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        assert node.module != "math" or {a.name for a in node.names} <= EXACT_MATH
        assert node.module not in ("cmath", "random", "statistics", "time")

    def visit_Constant(self, node: ast.Constant) -> None:
        if isinstance(node.value, float | complex):
            self.found.add(self.inside[-1])

    def visit_Name(self, node: ast.Name) -> None:
        if node.id in ("float", "complex"):
            self.found.add(self.inside[-1])

    def visit_Attribute(self, node: ast.Attribute) -> None:
        if isinstance(node.value, ast.Name) and node.value.id == "math" and node.attr not in EXACT_MATH:
            self.found.add(self.inside[-1])
        self.generic_visit(node)


@pytest.mark.parametrize("name", MODULES)
def test_no_floats_but_where_it_is_said(name: str):
    visitor = Floats()
    visitor.visit(tree(name))
    assert {(name, inside) for inside in visitor.found} == {where for where in FLOATS if where[0] == name}


class Watched(ast.NodeTransformer):
    """Passes every quotient and every power through a function that refuses floats."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        if not isinstance(node.op, ast.Div | ast.Pow):
            return node
        call = ast.Call(ast.Name("_exact", ast.Load()), [node], [])
        return ast.copy_location(call, node)


WATCH = """
def _exact(x):
    assert type(x) not in (float, complex), x
    return x
"""


# ---------------------------------------------------------------------- alone


@cache
def families() -> list[str]:
    """The JSON of certificates of families: by a Lyapunov function, by a basis of the kernel, by a state that moves."""
    day = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1)])
    night = SignedDigraph.from_edges([("c", "a", -2), ("a", "b", 1)])
    apart = [("a", "c", 1, 1), ("b", "c", 2, 2), ("c", "d", 1, 3)]
    protocol, found = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), []
    for family in (
        Family.switching({"day": day, "night": night}),
        Family.from_intervals(apart),
        Family.from_intervals([*apart, ("a", "d", 0, 1)]),
    ):
        found.append(json.dumps(certify_family(family, protocol, [1, 2, 3, 4][: family.n_nodes]).to_dict()))
    return found


@cache
def agents() -> list[str]:
    """The JSON of certificates of agents of order n: drag, at rest, capped, and what is used of full matrices."""
    pair = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", -2), ("a", "f", 3)])
    half = Fraction(1, 2)
    settings = (
        Setting(plant=(Fraction(0), half)),
        Setting(damping=half, plant=(Fraction(0), half)),
        Setting(cap=Fraction(5), method="full"),
    )
    return [json.dumps(document(pair, setting)) for setting in settings]


@cache
def of_messages() -> list[str]:
    """The JSON of certificates of late messages by rows and steps, by a Lyapunov function, and of moving leaders."""
    chain = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1), ("a", "c", 2)])
    protocol, x0 = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), [1, 3, 4]
    late = LateMessages(delay="0.02"), LateMessages(delay="0.001", gain_cap=4, own_delay=True)
    made = [
        certify(chain, protocol, x0, messages=messages, asks=Asks(simulation=False, method="paper"))
        for messages in late
    ]
    made.append(
        certify(chain, protocol, x0, leaders=MovingLeaders(speed=1), asks=Asks(simulation=False, method="paper"))
    )
    group = SignedDigraph.from_edges([("a", "b", 1), ("b", "a", -1), ("b", "c", 2), ("c", "d", 1), ("d", "c", 1)])
    apart = LateMessages({("b", "c"): "0.01", ("c", "d"): "0.02", ("d", "c"): "0.02"})
    made.append(certify(group, protocol, [1, 3, 4, 2], messages=apart, asks=Asks(simulation=False, method="paper")))
    kinds = {step["kind"] for one in made for step in json.loads(one.to_json())["proof"]}
    assert {
        "late-rows",
        "late-steps",
        "late-residual",
        "late-staged",
        "late-form",
        "late-lmi",
        "late-input",
        "late-settling",
    } <= kinds
    return [one.to_json() for one in made]


def stored() -> list[str]:
    """Certificates of the paper's graphs under either protocol, some by one kind of function alone."""
    graphs = ["fig1a", "fig1b", "fig3a", "fig3b", "fig5a", "fig5b", "diagonal", "full"]
    names = [*graphs, "sliding", "sliding-rest", "sliding-containment", "sliding-late-reaching"]
    return [(ROOT / f"tests/corpus/{name}.json").read_text(encoding="utf-8") for name in names]


#: The checker's command, for one file after the other: exit code and output of each.
CHECKS = """
import contextlib, io, json, runpy

for name in sys.argv[1:]:
    sys.argv, said = ["checker", *filter(None, [name])], io.StringIO()
    try:
        with contextlib.redirect_stdout(said):
            runpy.run_module("ptcc_certify.checker", run_name="__main__")
    except SystemExit as stop:
        print(json.dumps([stop.code, said.getvalue()]))
"""


@pytest.mark.parametrize("watched", thinned([True, False]))
def test_the_examples_are_accepted_by_these_files_alone(watched: bool, tmp_path: Path):
    """Copied into an empty folder, isolated from all that is installed: no NumPy, no flint, no solver.

    Once more with every quotient and power watched: none that is formed is a float.
    """
    for name in PLAIN:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        if watched and name.endswith(".py"):
            whole = tree(name)
            future = next(k for k, node in enumerate(whole.body) if isinstance(node, ast.ImportFrom | ast.Import))
            changed = ast.fix_missing_locations(Watched().visit(whole))
            changed.body[future + 1 : future + 1] = ast.parse(WATCH).body
            (tmp_path / name).write_text(ast.unparse(changed), encoding="utf-8")
        else:
            shutil.copy(ROOT / name, tmp_path / name)

    def run(program: str, *words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-I", "-S", "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r}); {program}"]
        return subprocess.run([*command, *words], capture_output=True, text=True, cwd=tmp_path, env=dict(os.environ))

    for name in (
        "numpy",
        "scipy",
        "casadi",
        "cvxpy",
        "clarabel",
        "flint",
        "ptcc_certify.errors",
        "lmi.definiteness_proofs",
    ):
        assert "ModuleNotFoundError" in run(f"import {name}").stderr
    texts = (*families(), *agents(), *of_messages(), *stored())
    false = json.dumps(json.loads(texts[-1]) | {"verdict": "undecided"})
    files = [f"{k}.json" for k in range(len(texts) + 1)]
    for name, text in zip(files, (*texts, false), strict=True):
        (tmp_path / name).write_text(text, encoding="utf-8")
    done = run(CHECKS, *files, "")
    *accepted, rejected, unnamed = map(json.loads, done.stdout.splitlines())
    assert len(accepted) == len(texts), done.stderr
    for code, said in accepted:
        assert code == 0, said
        assert said.splitlines()[-1].startswith("accepted   certified;")
        assert said.splitlines()[-1].endswith("by standard library")
    assert rejected[0] == 1 and rejected[1].splitlines()[-1].startswith("rejected   verdict")
    assert unnamed[0] == 2
