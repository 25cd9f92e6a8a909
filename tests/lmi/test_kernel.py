"""The kernel stands alone: the standard library, no floats but in the array twins, small enough to be read."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import lmi.exact
from lmi.exact import work

KERNEL = Path(lmi.exact.__file__).parent
#: The array twins, and what converts floats to rationals and shows numbers, without computing in floats.
FAST, SHOWS = "fast.py", {"decimal_rounding.py"}
PLAIN = sorted(path for path in KERNEL.glob("*.py") if path.name != FAST)
#: What of `math` is exact on integers.
EXACT = {"comb", "factorial", "gcd", "isqrt", "lcm"}


def imports(tree: ast.AST) -> set[str]:
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {
                f"{node.module}.{alias.name}" if node.module == "lmi.exact" else str(node.module)
                for alias in node.names
            }
    return found


@pytest.mark.parametrize("path", PLAIN, ids=lambda path: path.name)
def test_the_standard_library_is_enough(path: Path):
    own = {f"lmi.exact.{other.stem}" for other in KERNEL.glob("*.py")}
    for module in imports(ast.parse(path.read_text(encoding="utf-8"))):
        assert module in own or module.split(".")[0] in sys.stdlib_module_names, module
        assert module != "lmi.exact.fast" or path.name == "__init__.py"


@pytest.mark.parametrize("path", PLAIN, ids=lambda path: path.name)
def test_no_float_is_computed_with(path: Path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        where = f"{path.name}:{getattr(node, 'lineno', 0)}"
        if isinstance(node, ast.Constant):
            assert not isinstance(node.value, float | complex), where
        if path.name in SHOWS:
            continue
        if isinstance(node, ast.Call):
            assert ast.unparse(node.func) not in ("float", "complex", "pow", "round_float"), where
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "math":
            assert node.attr in EXACT, where
        if isinstance(node, ast.ImportFrom) and node.module == "math":
            assert {alias.name for alias in node.names} <= EXACT, where


def test_the_kernel_runs_where_nothing_else_is_installed(tmp_path: Path):
    """Copied into an empty folder, without its twins, and run in an isolated interpreter without site-packages."""
    new = tmp_path / "lmi"
    (new / "exact").mkdir(parents=True)
    shutil.copy(KERNEL.parent / "__init__.py", new)
    for path in PLAIN:
        shutil.copy(path, new / "exact")
    code = f"""
import sys
sys.path.insert(0, {str(tmp_path)!r})
from fractions import Fraction
from lmi.exact import arithmetic
from lmi.exact.definite import SparseFactor
from lmi.exact import numbers, polynomials, spectrum_beyond_line as spectrum, work
from lmi.exact import elementary_enclosures as enclosure
from lmi.exact import decimal_rounding as rounding
judge = arithmetic()
assert judge.name == "standard library" and not judge.numpy
assert judge.definite([[2, 1], [1, 1]]) and not judge.definite([[1, 1], [1, 1]])
assert judge.residual_definite(1, ([0], [0], [5]), SparseFactor([0], [0, 1], [0], [2], [0], 0))
assert numbers.parse("1/3") == Fraction(1, 3) and rounding.down(Fraction(1, 3), 2) == "0.33"
assert spectrum.nonzero_spectrum_beyond([{{0: 1, 1: -1}}, {{1: 1, 0: -1}}], 1, Fraction(1)) == "beyond"
assert not {{"numpy", "scipy", "flint", "ptcc_certify", "lmi.exact.fast"}} & set(sys.modules)
"""
    done = subprocess.run([sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("k", range(6))
def test_each_doubling_of_both_lengths_trebles_what_a_product_costs(k: int):
    """By Karatsuba's method; in between the cost is linear in the shorter length."""
    short, long = work.LONG << k, work.LONG << (k + 1)
    assert work.cost(1, 30 * (short - 1), 30 * (short - 1)) - work.EACH == work.LONG**2 * 3**k
    between = work.cost(1, 30 * (short + short // 2 - 1), 30 * (long - 1)) - work.EACH
    assert between == work.LONG**2 * 5 * 3**k // 2
    assert work.cost(7, 30 * (long - 1), 30 * (short - 1)) == 7 * work.cost(1, 30 * (short - 1), 30 * (long - 1))
