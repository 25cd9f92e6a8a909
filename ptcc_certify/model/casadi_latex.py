r"""LaTeX of a CasADi ``SX`` scalar, printed by walking its nodes.

Nothing is typed beside an expression: what is shown is what is evaluated. A symbol ``rho1`` is printed as
``\rho_{1}``, ``x3`` as ``x_{3}``, ``w_kl`` as ``w_{kl}``; ``if_else`` becomes ``cases``.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from ptcc_certify.errors import ParameterError

if TYPE_CHECKING:
    import casadi as ca

# How tightly a printed piece binds: a piece weaker than its surroundings is put in parentheses.
_ANY = _RELATION = 0
_SUM, _PRODUCT, _POWER, _ATOM = range(1, 5)

_GREEK = re.compile(
    "alpha|beta|gamma|delta|epsilon|zeta|eta|theta|kappa|lambda|mu|nu|xi|pi|rho|sigma|varsigma|tau|phi|chi|psi|omega|"
    "Gamma|Delta|Theta|Lambda|Xi|Pi|Sigma|Phi|Psi|Omega"
)
_SYMBOL = re.compile(r"([A-Za-z]+)_?([A-Za-z0-9]*)")
_FUNCTIONS = {
    **{name.upper(): rf"\{name}" for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh")},
    **{f"A{name}".upper(): rf"\arc{name}" for name in ("sin", "cos", "tan")},
    "LOG": r"\ln",
    "SIGN": r"\operatorname{sign}",
}
_RELATIONS = {"LT": "<", "LE": r"\le", "EQ": "=", "NE": r"\ne", "AND": r"\land", "OR": r"\lor"}
# Of each operation: the text, how tightly its operands must bind there, and how tightly it binds itself.
_FORMS: dict[str, tuple[str, tuple[int, ...], int]] = {
    "SUB": ("{} - {}", (_SUM, _PRODUCT), _SUM),
    "NEG": ("-{}", (_PRODUCT,), _SUM),
    "DIV": (r"\frac{{{}}}{{{}}}", (_ANY, _ANY), _POWER),
    "INV": (r"\frac{{1}}{{{}}}", (_ANY,), _POWER),
    "SQ": ("{}^{{2}}", (_ATOM,), _POWER),
    "POW": ("{}^{{{}}}", (_ATOM, _ANY), _POWER),
    "CONSTPOW": ("{}^{{{}}}", (_ATOM, _ANY), _POWER),
    "EXP": (r"\mathrm{{e}}^{{{}}}", (_ANY,), _POWER),
    "SQRT": (r"\sqrt{{{}}}", (_ANY,), _POWER),
    "FABS": (r"\left|{}\right|", (_ANY,), _POWER),
    "FMIN": (r"\min\left({}, {}\right)", (_ANY, _ANY), _POWER),
    "FMAX": (r"\max\left({}, {}\right)", (_ANY, _ANY), _POWER),
    "NOT": (r"\lnot {}", (_ATOM,), _RELATION),
    **{name: (f"{{}} {sign} {{}}", (_SUM, _SUM), _RELATION) for name, sign in _RELATIONS.items()},
}
_OPPOSITE = {"LT": r"\ge", "LE": ">", "EQ": r"\ne", "NE": "="}


def to_latex(expression: ca.SX) -> str:
    r"""Return the LaTeX of a scalar expression, without dollar signs.

    Parameters
    ----------
    expression : casadi.SX
        One entry. Sums, products, quotients, powers, roots, ``exp``, ``log``, trigonometric and hyperbolic
        functions, ``fabs``, ``sign``, ``fmin``, ``fmax``, comparisons and ``if_else``.

    Raises
    ------
    ParameterError
        The expression is not a scalar, or holds an operation that this printer does not know.

    Examples
    --------
    >>> import casadi as ca
    >>> t, T, rho1 = ca.SX.sym("t"), ca.SX.sym("T"), ca.SX.sym("rho1")
    >>> print(to_latex(rho1 + 2 / (T - t)))
    \rho_{1} + \frac{2}{T - t}
    >>> print(to_latex(ca.if_else(t < T, -(t - 1) ** 2, 0.5)))
    \begin{cases} -\left(t - 1\right)^{2}, & t < T \\ 0.5, & t \ge T \end{cases}
    """
    if expression.numel() != 1:
        raise ParameterError(f"LaTeX of a scalar is wanted, not of {expression.shape[0]} x {expression.shape[1]}")
    return _walk(expression)[0]


def symbol_latex(name: str) -> str:
    r"""Return the LaTeX of a symbol's name: letters, then an index with or without ``_`` before it.

    A name that holds a brace is LaTeX already.

    Examples
    --------
    >>> symbol_latex("rho1"), symbol_latex("T_r"), symbol_latex("tau"), symbol_latex("dist2")
    ('\\rho_{1}', 'T_{r}', '\\tau', '\\mathrm{dist}_{2}')
    """
    if "{" in name:
        return name
    match = _SYMBOL.fullmatch(name)
    if not match:
        return rf"\mathrm{{{name}}}".replace("_", r"\_")
    letters, index = match[1], match[2]
    head = f"\\{letters}" if _GREEK.fullmatch(letters) else letters if len(letters) == 1 else rf"\mathrm{{{letters}}}"
    return f"{head}_{{{index}}}" if index else head


def _walk(node: ca.SX) -> tuple[str, int]:
    """Return the text of ``node`` and how tightly it binds."""
    if node.is_constant():
        return _number(float(node))
    if node.is_symbolic():
        return symbol_latex(node.name()), _ATOM
    name = _operation(node)
    operands = [node.dep(i) for i in range(node.n_dep())]
    if name in ("ADD", "IF_ELSE_ZERO") and (branches := _branches(node)):
        return _cases(*branches)
    if name == "ADD":
        right = _wrap(operands[1], _SUM)
        # a + -6 b and a + (-b + c) read a - 6 b and a - b + c
        right = f" - {right[1:]}" if right.startswith("-") else f" + {right}"
        return _wrap(operands[0], _SUM) + right, _SUM
    if name == "MUL":
        return _product(*operands)
    if name == "TWICE":
        return _times("2", _wrap(operands[0], _PRODUCT)), _PRODUCT
    if name in _FUNCTIONS:
        return rf"{_FUNCTIONS[name]}\left({to_latex(operands[0])}\right)", _POWER
    if name in _FORMS:
        text, needed, level = _FORMS[name]
        return text.format(*map(_wrap, operands, needed)), level
    raise ParameterError(f"no LaTeX is known for the CasADi operation {name}")


def _operation(node: ca.SX) -> str:
    import casadi as ca

    if not _OPERATIONS:
        _OPERATIONS.update({getattr(ca, name): name[3:] for name in dir(ca) if name.startswith("OP_")})
    return _OPERATIONS[node.op()]


_OPERATIONS: dict[int, str] = {}


def _wrap(node: ca.SX, needed: int) -> str:
    text, level = _walk(node)
    return text if level >= needed else rf"\left({text}\right)"


def _product(left: ca.SX, right: ca.SX) -> tuple[str, int]:
    if left.is_constant() and float(left) < 0:
        return f"-{_product(-left, right)[0]}", _SUM
    return _times(_wrap(left, _PRODUCT), _wrap(right, _PRODUCT)), _PRODUCT


def _times(left: str, right: str) -> str:
    return rf"{left} \cdot {right}" if right[0].isdigit() else f"{left} {right}"


def _number(value: float) -> tuple[str, int]:
    if math.isnan(value):
        raise ParameterError("the expression holds nan, which is not a number")
    if value < 0:
        return f"-{_number(-value)[0]}", _SUM
    if math.isinf(value):
        return r"\infty", _ATOM
    if value == int(value) and value < 1e16:
        return str(int(value)), _ATOM
    mantissa, _, exponent = repr(value).partition("e")
    return (rf"{mantissa} \cdot 10^{{{int(exponent)}}}", _PRODUCT) if exponent else (mantissa, _ATOM)


def _branches(node: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX] | None:
    """Return (condition, value if true, value otherwise) of the nodes that ``casadi.if_else`` leaves behind."""
    import casadi as ca

    if _operation(node) == "IF_ELSE_ZERO":
        condition, value = node.dep(0), node.dep(1)
        if _operation(condition) == "NOT":
            return condition.dep(0), ca.SX(0), value
        return condition, value, ca.SX(0)
    first, second = node.dep(0), node.dep(1)
    if _operation(first) == "IF_ELSE_ZERO" == _operation(second) and _operation(second.dep(0)) == "NOT":
        condition = first.dep(0)
        if condition.element_hash() == second.dep(0).dep(0).element_hash():
            return condition, first.dep(1), second.dep(1)
    return None


def _cases(condition: ca.SX, value: ca.SX, otherwise: ca.SX) -> tuple[str, int]:
    name = _operation(condition)
    opposite = (
        f"{_wrap(condition.dep(0), _SUM)} {_OPPOSITE[name]} {_wrap(condition.dep(1), _SUM)}"
        if name in _OPPOSITE
        else r"\text{otherwise}"
    )
    rows = rf"{to_latex(value)}, & {to_latex(condition)} \\ {to_latex(otherwise)}, & {opposite}"
    return rf"\begin{{cases}} {rows} \end{{cases}}", _RELATION
