"""Expressions of ``k`` and ``t``, read by Python's own parser and evaluated over floats, CasADi or intervals.

Of the syntax tree a short list of nodes, names and functions is let through; nothing of a text is ever executed. The
tree is walked once into a postfix program, without recursion, and one loop runs that program in any arithmetic.
Intervals have balls of python-flint for their ends, each of which holds the true end: what they bound is the
expression in real arithmetic, and no error of rounding is assumed.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Sequence
from functools import reduce
from itertools import accumulate
from typing import Any

import numpy as np
from flint import arb

from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.rationals import shorten

MAX_CHARACTERS, MAX_NESTING = 1000, 50
ATOMS = ("k", "t", "pi", "e")
FUNCTIONS = ("sin", "cos", "tan", "atan", "tanh", "exp", "log", "sqrt", "abs", "sign", "min", "max")

Program = tuple[float | str, ...]
Interval = tuple[arb, arb]

# ---------------------------------------------------------------------- from a text to a postfix program

_OPERATORS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**", ast.USub: "neg", ast.UAdd: ""}
_BINARY = frozenset(("+", "-", "*", "/", "**", "min", "max"))
_FOREIGN = re.compile(r"[^A-Za-z0-9_+\-*/(),. \t\r\n]")
_NUMBER_BEFORE_NAME = re.compile(r"(?<![\w.])[0-9.]+(?:[eE][+-]?[0-9]+)?(?![eE][+-]?[0-9])(?=[A-Za-z_])")
_NAMES = f"{', '.join(ATOMS)} and the functions {', '.join(FUNCTIONS)}"
_ALLOWED = f"write numbers, + - * / ** ( ) , {_NAMES}"


def parse(text: str) -> Program:
    """Read an expression into its numbers, atoms and operations, operands first.

    Parameters
    ----------
    text : str
        At most 1,000 characters, and 50 levels of parentheses, calls and powers.

    Returns
    -------
    tuple of float and str

    Raises
    ------
    ParameterError
        Names the column of what is not of the grammar.

    Examples
    --------
    >>> parse("2*max(t, 1, -k)")
    (2.0, 't', 1.0, 'k', 'neg', 'max', 'max', '*')
    """
    if len(text) > MAX_CHARACTERS:
        raise ParameterError(f"a disturbance of {len(text)} characters is too long; the limit is {MAX_CHARACTERS}")
    if foreign := _FOREIGN.search(text):
        hint = "write a power as **" if foreign[0] == "^" else _ALLOWED
        raise _refusal(text, foreign.start(), f'"{shorten(foreign[0])}" has no meaning; {hint}')
    if number := _NUMBER_BEFORE_NAME.search(text):
        end = number.end()
        raise _refusal(text, end, f'an operator is missing before "{shorten(text[end:])}"; write * for a product')
    depths = list(accumulate((c == "(") - (c == ")") for c in text))
    too_deep = f"nested deeper than {MAX_NESTING} levels; write it flatter"
    if depths and max(depths) > MAX_NESTING:
        raise _refusal(text, depths.index(MAX_NESTING + 1), too_deep)
    source = re.sub(r"[\t\r\n]", " ", text).lstrip()
    shift = len(text) - len(source)
    try:
        tree = ast.parse(source, mode="eval").body
    except SyntaxError as error:
        raise _syntax_refusal(text, error, shift) from None
    except (RecursionError, MemoryError):
        raise _refusal(text, 0, too_deep) from None
    program: list[float | str] = []
    stack: list[tuple[ast.expr, int]] = [(tree, 0)]
    while stack:  # the last operand first; the program is turned round in the end
        node, depth = stack.pop()
        items, operands = _items(node, text, shift)
        depth += isinstance(node, ast.Call) or "**" in items
        if depth > MAX_NESTING:
            raise _refusal(text, node.col_offset + shift, too_deep)
        program += items
        stack += [(operand, depth) for operand in operands]
    return tuple(program[::-1])


def _items(node: ast.expr, text: str, shift: int) -> tuple[list[Any], Sequence[ast.expr]]:
    """Return what a node adds to the program, and its operands; refuse every node that is not listed here."""
    start, end = node.col_offset + shift, (node.end_col_offset or 0) + shift
    what = f'"{shorten(text[start:end])}" has no meaning; {_ALLOWED}'
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            number = float(text[start:end])
            if math.isfinite(number):
                return [number], ()
            what = f"{shorten(text[start:end])} is beyond the range of floats; write less"
        case ast.Name(id=name):
            if name in ATOMS:
                return [name], ()
            what = f'unknown name "{shorten(name)}"; the names are {_NAMES}'
            if name in FUNCTIONS:
                what = f'"(" is missing after {name}; write {name}(...)'
        case ast.UnaryOp(op=sign, operand=operand) if type(sign) in _OPERATORS:
            return [name] if (name := _OPERATORS[type(sign)]) else [], (operand,)
        case ast.BinOp(op=sign, left=left, right=right) if type(sign) in _OPERATORS:
            return [_OPERATORS[type(sign)]], (left, right)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            several = name in ("min", "max")
            if name not in FUNCTIONS:
                what = f'"{shorten(name)}" is no function; the names are {_NAMES}'
            elif (several and len(arguments) > 1) or (not several and len(arguments) == 1):
                return [name] * max(len(arguments) - 1, 1), arguments
            else:
                what = f"{name} takes {'two or more arguments' if several else 'one argument'}"
        case ast.Tuple():
            what = "only min and max take a comma; write one value without"
    raise _refusal(text, start, what)


def _syntax_refusal(text: str, error: SyntaxError, shift: int) -> ParameterError:
    """Say where Python's parser gave up."""
    at = error.offset + shift - 1 if error.offset else len(text)
    what = f'"{shorten(text[at:])}" cannot stand here; write * for a product, sin(...) for a function'
    if at >= len(text):
        what = "the expression ends too early; write a number, k or t here"
    elif "never closed" in error.msg:
        what = 'this "(" is never closed; write ")"'
    return _refusal(text, at, what)


def _refusal(text: str, at: int, what: str) -> ParameterError:
    return ParameterError(f'disturbance "{shorten(text)}", column {at + 1}: {what}')


# ---------------------------------------------------------------------- one walk for every arithmetic


def evaluate(program: Program, algebra: dict[str, Callable[..., Any]], atoms: dict[str, Any], number: Callable) -> Any:
    """Run a program in the arithmetic of ``algebra``, for values of ``k``, ``t``, ``pi`` and ``e``."""
    stack: list[Any] = []
    for item in program:
        if not isinstance(item, str):
            stack.append(number(item))
        elif item in atoms:
            stack.append(atoms[item])
        elif item in _BINARY:
            right = stack.pop()
            stack[-1] = algebra[item](stack[-1], right)
        else:
            stack[-1] = algebra[item](stack[-1])
    return stack[0]


def _algebra(module: Any, names: dict[str, str]) -> dict[str, Callable[..., Any]]:
    """Return the operations of NumPy or CasADi, with the names of the functions that are called otherwise there."""
    return _ARITHMETIC | {name: getattr(module, names.get(name, name)) for name in FUNCTIONS}


_ARITHMETIC: dict[str, Callable[..., Any]] = {
    **{"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "**": operator.pow},
    "neg": operator.neg,
}
_FLOATS = _algebra(np, {"atan": "arctan", "min": "minimum", "max": "maximum"})


def floats(program: Program, k: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return the values at agents and instants, which broadcast; infinite or nan where the expression is."""
    atoms = {"k": k, "t": t, "pi": np.float64(math.pi), "e": np.float64(math.e)}
    with np.errstate(all="ignore"):
        values = evaluate(program, _FLOATS, atoms, np.float64)
    return np.broadcast_to(values, np.broadcast_shapes(k.shape, t.shape))


def symbolic(program: Program, atoms: dict[str, Any]) -> Any:
    """Return the CasADi expression of symbols or numbers ``k``, ``t``, ``pi`` and ``e``, of the type of ``t``."""
    import casadi as ca

    algebra = _algebra(ca, {"abs": "fabs", "min": "fmin", "max": "fmax"})
    return evaluate(program, algebra, atoms, type(atoms["t"]))


# ---------------------------------------------------------------------- intervals


class _Undefined(ArithmeticError):
    """An operation may be undefined, or beyond the range of floats, somewhere on a box."""


#: Below the largest float: what a float run could not compute is not called bounded.
_LARGEST = 1e308


def enclosure(program: Program, k: int, lo: float, hi: float) -> Interval | None:
    """Enclose the values of agent ``k`` (from 1) on ``t`` in [lo, hi].

    Returns
    -------
    pair of arb, or None
        Balls that hold a lower and an upper bound; None where the expression may be undefined or beyond floats.

    Examples
    --------
    >>> low, high = enclosure(parse("k*sin(t)"), 2, 0.0, 3.0)
    >>> float(low), float(high)
    (0.0, 2.0)
    >>> enclosure(parse("1/(t - 1)"), 1, 0.0, 3.0)
    """
    pi, e, agent = arb.pi(), arb.const_e(), arb(k)
    atoms = {"k": (agent, agent), "t": (arb(lo), arb(hi)), "pi": (pi, pi), "e": (e, e)}
    try:
        return evaluate(program, _INTERVALS, atoms, _point)
    except _Undefined:
        return None


def _point(number: float) -> Interval:
    ball = arb(number)
    return ball, ball


def _hull(values: Sequence[arb]) -> Interval:
    """Return the least and the largest of values."""
    return (values[0], values[0]) if len(values) == 1 else (reduce(arb.min, values), reduce(arb.max, values))


def _corners(operation: Callable[[arb, arb], arb]) -> Callable[[Interval, Interval], Interval]:
    """Return the enclosure of an operation that is monotone in each of its operands."""

    def enclose(x: Interval, y: Interval) -> Interval:
        xs, ys = (end[:1] if end[0] is end[1] else end for end in (x, y))
        return _hull([operation(a, b) for a in xs for b in ys])

    return enclose


def _increasing(function: Callable[[arb], arb]) -> Callable[[Interval], Interval]:
    return lambda x: (function(x[0]), function(x[1]))


def _check_domain(operation: Callable[..., Interval], defined: Callable[..., bool] = lambda *_: True) -> Callable:
    """Refuse operands outside the domain, and what may be beyond the range of floats, or is not a number."""

    def enclose(*operands: Interval) -> Interval:
        if defined(*operands):
            ends = operation(*operands)
            if ends[0] > -_LARGEST and ends[1] < _LARGEST:
                return ends
        raise _Undefined

    return enclose


def _has_no_zero(x: Interval) -> bool:
    return bool(x[0] > 0 or x[1] < 0)


def _absolute(x: Interval) -> Interval:
    low, high = _hull([abs(end) for end in x])
    return (low if _has_no_zero(x) else arb(0)), high


def _power(x: Interval, y: Interval) -> Interval:
    """Enclose ``x**y``: an even whole power of ``|x|``, otherwise monotone in both ``x`` and ``y``."""
    if y[0] == y[1] and y[0].is_integer():
        if y[0] < 0 and not _has_no_zero(x):
            raise _Undefined
        return _hull([base ** y[0] for base in (_absolute(x) if (y[0] / 2).is_integer() else x)])
    if not (x[0] > 0 or (x[0] >= 0 and y[0] > 0)):
        raise _Undefined
    return _corners(operator.pow)(x, y)


def _reaches(x: Interval, offset: float, period: arb) -> bool:
    """Tell whether an interval may hold a point ``(offset + n) period``."""
    return not (x[0] / period - offset).ceil() > (x[1] / period - offset).floor()


def _wave(function: Callable[[arb], arb], peak: float) -> Callable[[Interval], Interval]:
    """Return the enclosure of sin or cos, 1 at ``peak`` turns and -1 half a turn later."""

    def enclose(x: Interval) -> Interval:
        (low, high), turn = _hull([function(end) for end in x]), 2 * arb.pi()
        return arb(-1) if _reaches(x, peak + 0.5, turn) else low, arb(1) if _reaches(x, peak, turn) else high

    return enclose


_INTERVALS: dict[str, Callable[..., Interval]] = {
    "neg": lambda x: (-x[1], -x[0]),
    "+": _check_domain(lambda x, y: (x[0] + y[0], x[1] + y[1])),
    "-": _check_domain(lambda x, y: (x[0] - y[1], x[1] - y[0])),
    "*": _check_domain(_corners(operator.mul)),
    "/": _check_domain(_corners(operator.truediv), lambda x, y: _has_no_zero(y)),
    "**": _check_domain(_power),
    "sin": _wave(arb.sin, 0.25),
    "cos": _wave(arb.cos, 0.0),
    "tan": _check_domain(_increasing(arb.tan), lambda x: not _reaches(x, 0.5, arb.pi())),
    "exp": _check_domain(_increasing(arb.exp)),
    "log": _check_domain(_increasing(arb.log), lambda x: x[0] > 0),
    "sqrt": _check_domain(_increasing(arb.sqrt), lambda x: x[0] >= 0),
    "atan": _increasing(arb.atan),
    "tanh": _increasing(arb.tanh),
    "sign": _increasing(arb.sgn),
    "abs": _absolute,
    "min": lambda x, y: (x[0].min(y[0]), x[1].min(y[1])),
    "max": lambda x, y: (x[0].max(y[0]), x[1].max(y[1])),
}
