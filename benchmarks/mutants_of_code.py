"""What the tests notice: mutants of the code that proves and checks, and how many of them some test kills.

    python benchmarks/mutants_of_code.py [--count 60] [--seed 0] [--files 6] [--minutes 10]

A mutant changes one place: a comparison, an operator, an integer by 1, ``and`` for ``or``, ``min`` for ``max``, or it
leaves a refusal out. In a copy of this folder the tests that are nearest to the module run until one fails: its own
doctests, the test files that name it, those of its room. What survives the default tests is tried again with ``--all``,
which tells what the cases that do not run by default are worth. A survivor need not be a defect: the change may not
matter (a limit on work, a search that is judged afterwards).
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
#: What is mutated, with the folder of its tests.
ROOMS = {
    "ptcc_certify/checker": "tests/checker",
    "lmi/exact": "tests/lmi",
    "ptcc_certify/lyapunov": "tests/lyapunov",
    "ptcc_certify/bounds": "tests/bounds",
}
COMPARISONS = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
OPERATORS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Add, ast.FloorDiv: ast.Mult, ast.Div: ast.Mult}
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


def mutant(path: Path, choose: random.Random) -> tuple[str, bytes]:
    """Return what one change of a module is, and the text that it leaves: all else is as it was."""
    text = path.read_bytes()
    node, kind, new = choose.choice([(node, *change) for node in ast.walk(ast.parse(text)) for change in changes(node)])
    words = "pass" if kind == "refusal" else f"({ast.unparse(new)})"
    lines = text.splitlines(keepends=True)
    begin, end = (
        sum(map(len, lines[: row - 1])) + column
        for row, column in ((node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset))
    )
    told = f"{kind}: line {node.lineno}: {ast.unparse(node)[:60]} -> {words[:60]}"
    return told, text[:begin] + words.encode() + text[end:]


def tests_of(module: Path, room: str, count: int) -> list[str]:
    """Return the module, for its doctests, and the test files nearest to it: they name it, or are of its room."""
    word = re.compile(rf"\b{module.stem}\b" if module.stem != "__init__" else rf"\b{module.parent.name}\b")
    texts = {path: path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py")}
    of_room = {path for path in texts if path.is_relative_to(ROOT / ROOMS[room])}
    rank = {path: (len(word.findall(text)) > 0) + (path in of_room) for path, text in texts.items()}
    near = sorted((path for path in texts if rank[path]), key=lambda path: (-rank[path], len(texts[path])))
    return [str(path.relative_to(ROOT)) for path in (module, *near[:count])]


def killed(folder: Path, tests: list[str], minutes: float, *options: str) -> str:
    """Run tests until one fails; return which, or that they took too long, or nothing."""
    words = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", *options, *tests]
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": ""}
    try:
        done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, timeout=60 * minutes)
    except subprocess.TimeoutExpired:
        return "time"
    failed = re.findall(r"^(?:FAILED|ERROR) (.*?)(?: - .*)?$", done.stdout, re.M)
    return "" if done.returncode in (0, 5) else (failed or ["collection"])[0]


def main() -> None:
    """Make mutants, run their tests, print the shares."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--files", type=int, default=6, help="test files of each mutant")
    parser.add_argument("--minutes", type=float, default=10, help="after which a run of tests counts as killed")
    given = parser.parse_args()
    choose, count = random.Random(given.seed), Counter[str]()
    with tempfile.TemporaryDirectory() as base:
        folder = Path(base, "copy")
        shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(".git", "*.vo*", "*.glob", ".*_cache", "notebooks"))
        for number in range(given.count):
            room = choose.choice(list(ROOMS))
            modules = sorted(path for path in (ROOT / room).rglob("*.py") if not path.stem.startswith("__"))
            module = choose.choices(modules, [path.stat().st_size for path in modules])[0]
            told, text = mutant(module, choose)
            begin, path = time.monotonic(), folder / module.relative_to(ROOT)
            path.write_bytes(text)
            tests = tests_of(module, room, given.files)
            by = killed(folder, tests, given.minutes)
            more = "" if by else killed(folder, tests, given.minutes, "--all")
            shutil.copy2(module, path)
            verdict = "killed" if by else "killed with --all" if more else "survived"
            count[verdict] += 1
            seconds, test = time.monotonic() - begin, f"  by {by or more}" if by or more else ""
            print(f"{number:3d} {seconds:5.0f} s {verdict:<17} {module.relative_to(ROOT)} {told}{test}", flush=True)
    print(", ".join(f"{verdict}: {number} of {given.count}" for verdict, number in count.most_common()))


if __name__ == "__main__":
    main()
