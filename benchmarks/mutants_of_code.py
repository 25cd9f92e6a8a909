"""What the tests notice: mutants of the code that proves and checks, and how many of them some test kills.

    python -m pytest --all --cov=ptcc_certify --cov=lmi --cov-context=test --cov-report=   # with pytest-cov: .coverage
    python benchmarks/mutants_of_code.py [--coverage .coverage] [--count 60] [--seed 0] [--first 0] [--part 0/1]

A mutant changes one place: a comparison, an operator, an integer by 1, ``and`` for ``or``, ``min`` for ``max``, or it
leaves a refusal out. In a copy of this folder the tests that ran its line when coverage was measured run until one
fails, those first that ran the fewest lines. What survives the default tests is tried again with ``--all``, which tells
what the tests that do not run by default are worth. A survivor need not be a defect: the change may not matter (a limit
on work, a search that is judged afterwards).
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
#: What is mutated.
ROOMS = ("ptcc_certify/checker", "lmi/exact", "ptcc_certify/lyapunov", "ptcc_certify/bounds")
COMPARISONS = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
OPERATORS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Add, ast.FloorDiv: ast.Mult, ast.Div: ast.Mult}
#: The tests of which not all cases run by default.
LEFT_OUT = "few and not campaign and not browser and not docs"
EXTREMES = {"min": "max", "max": "min"}


def changes(node: Any) -> Iterator[tuple[str, ast.AST]]:
    """Yield what else could stand in the place of a node, with the kind of the change."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARISONS:
        yield "comparison", ast.Compare(node.left, [COMPARISONS[type(node.ops[0])](), *node.ops[1:]], node.comparators)
    elif isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        yield "operator", ast.BinOp(node.left, OPERATORS[type(node.op)](), node.right)
    elif isinstance(node, ast.BoolOp):
        yield "and, or", ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)
    elif isinstance(node, ast.Constant) and type(node.value) is int:
        yield "integer", ast.Constant(node.value + 1)
        yield "integer", ast.Constant(node.value - 1)
    elif isinstance(node, ast.Name) and node.id in EXTREMES:
        yield "min, max", ast.Name(EXTREMES[node.id], node.ctx)
    elif isinstance(node, ast.Raise) or _needs(node):
        yield "refusal", ast.Pass()


def _needs(node: Any) -> bool:
    """Tell whether a statement refuses what does not hold, in the words of the checker."""
    call = node.value if isinstance(node, ast.Expr) else None
    return isinstance(call, ast.Call) and ast.unparse(call.func).startswith("need")


def mutant(path: Path, choose: random.Random) -> tuple[str, bytes, range] | None:
    """Return what one change of a module is, the text that it leaves, and its lines from its statement on.

    None where no place of it could be changed.
    """
    text = path.read_bytes()
    tree = ast.parse(text)
    places = [(node, *change) for node in ast.walk(tree) for change in changes(node)]
    if not places:
        return None
    node, kind, new = choose.choice(places)
    words = "pass" if kind == "refusal" else f"({ast.unparse(new)})"
    lines = text.splitlines(keepends=True)
    begin, end = (
        sum(map(len, lines[: row - 1])) + column
        for row, column in ((node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset))
    )
    around = (s for s in ast.walk(tree) if isinstance(s, ast.stmt) and s.lineno <= node.lineno <= (s.end_lineno or 0))
    statement = max(around, key=lambda s: s.lineno)
    told = f"{kind}: line {node.lineno}: {ast.unparse(node)[:60]} -> {words[:60]}"
    return told, text[:begin] + words.encode() + text[end:], range(statement.lineno, node.end_lineno + 1)


class Coverage:
    """Which tests ran a line, those first that ran the fewest lines of all, from a file of coverage with contexts."""

    def __init__(self, path: Path, known: set[str]):
        from coverage import CoverageData

        data = CoverageData(str(path))
        data.read()
        size = Counter[str]()
        self.tests: dict[str, dict[int, set[str]]] = {}
        for name in data.measured_files():
            of_line = data.contexts_by_lineno(name).items()
            lines = {line: known.intersection(context.rpartition("|")[0] for context in of) for line, of in of_line}
            for tests in lines.values():
                size.update(tests)
            self.tests[name] = lines
        self.rank = {test: k for k, test in enumerate(sorted(size, key=lambda test: (size[test], test)))}

    def near(self, module: Path, rows: range, count: int) -> list[str]:
        """Return of the tests of some lines, or of the module where none is told, the first ones and some others."""
        lines = next((lines for name, lines in self.tests.items() if Path(name).as_posix().endswith(f"/{module}")), {})
        found = set[str]().union(*(lines.get(row, ()) for row in rows)) or set[str]().union(*lines.values())
        order = sorted(found, key=self.rank.__getitem__)
        first, rest = order[: count // 2], order[count // 2 :]
        more = min(len(rest), count - len(first))
        return [*first, *(rest[k * len(rest) // more] for k in range(more))]


def pytest(folder: Path, minutes: float, *options: str) -> subprocess.CompletedProcess[str]:
    """Run pytest in a copy of the project."""
    words = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", *options]
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": ""}
    return subprocess.run(
        words, cwd=folder, env=environment, capture_output=True, text=True, timeout=60 * minutes, check=False
    )


def tests_of(folder: Path, *options: str) -> set[str]:
    """Return the tests that some options select."""
    done = pytest(folder, 10, "--collect-only", *options)
    if done.returncode:
        raise SystemExit(f"the tests cannot be collected:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return {line for line in done.stdout.splitlines() if "::" in line}


def killed(folder: Path, tests: list[str], minutes: float, *options: str) -> str:
    """Run tests until one fails; return which, "time" where they took too long, or nothing."""
    if not tests:
        return ""
    try:
        done = pytest(folder, minutes, "-x", *options, *tests)
    except subprocess.TimeoutExpired:
        return "time"
    failed = re.findall(r"^(?:FAILED|ERROR) (.*?)(?: - .*)?$", done.stdout, re.M)
    return "" if done.returncode in (0, 5) else (failed or ["collection"])[0]


def verdict_of(tests: list[str], by: str, more: str) -> str:
    """Tell what became of a mutant, from what failed by default and with ``--all``."""
    if not tests:
        return "no test is known"
    if "time" in (by, more):
        return "time"
    if by:
        return "killed"
    return "killed with --all" if more else "survived"


def main() -> None:
    """Make mutants, run their tests, print the shares."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--coverage", type=Path, default=ROOT / ".coverage")
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="the mutant to go on with")
    parser.add_argument("--part", default="0/1", help="K/N: every N-th of them, from the K-th on")
    parser.add_argument("--tests", type=int, default=80, help="of each mutant, at most")
    parser.add_argument("--minutes", type=float, default=2, help="after which a run of tests ends")
    given = parser.parse_args()
    choose, count = random.Random(given.seed), Counter[str]()
    part, parts = map(int, given.part.split("/"))
    with tempfile.TemporaryDirectory() as base:
        folder = Path(base, "copy")
        shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(".git", "*.vo*", "*.glob", ".*_cache", "notebooks"))
        default, left_out = tests_of(folder), tests_of(folder, "--all", "-m", LEFT_OUT)
        measured = Coverage(given.coverage, default | left_out)
        for number in range(given.count):
            room = choose.choice(ROOMS)
            modules = sorted(path for path in (ROOT / room).rglob("*.py") if not path.stem.startswith("__"))
            module = choose.choices(modules, [path.stat().st_size for path in modules])[0]
            if (changed := mutant(module, choose)) is None:
                continue  # nothing in it could be another
            told, text, rows = changed
            if number < given.first or number % parts != part:
                continue
            begin, path = time.monotonic(), folder / module.relative_to(ROOT)
            path.write_bytes(text)
            tests = measured.near(module.relative_to(ROOT), rows, given.tests)
            by = killed(folder, [test for test in tests if test in default], given.minutes)
            rest = [test for test in tests if test in left_out and test not in default]
            more = "" if by else killed(folder, rest, given.minutes, "--all")
            shutil.copy2(module, path)
            verdict = verdict_of(tests, by, more)
            count[verdict] += 1
            seconds, test = time.monotonic() - begin, f"  by {by or more}" if by or more else ""
            print(f"{number:3d} {seconds:5.0f} s {verdict:<17} {module.relative_to(ROOT)} {told}{test}", flush=True)
    print(", ".join(f"{verdict}: {number} of {count.total()}" for verdict, number in count.most_common()))


if __name__ == "__main__":
    main()
