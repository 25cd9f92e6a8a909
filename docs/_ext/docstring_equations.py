"""Equations of docstrings stand as they are written: lines that are indented below a paragraph are set literally."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import Any

from sphinx.application import Sphinx


def literal(lines: list[str]) -> list[str]:
    """Return the lines of a docstring with ``::`` before what is indented below a paragraph.

    Examples
    --------
    >>> literal(["With a sum", "", "    a + b"])
    ['With a sum', '', '::', '', '    a + b']
    """
    result = lines[:1]
    paragraph = lines[0] if lines else ""
    for before, line in pairwise(lines):
        indented = line.startswith(" ") and not before.strip()
        if indented and re.match(r"[^\s.-]", paragraph) and not paragraph.endswith("::"):
            result += ["::", ""]
        result.append(line)
        paragraph = line if line.strip() else paragraph
    return result


def set_equations(app: Sphinx, kind: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Change the docstring of one name."""
    lines[:] = literal(lines)


def setup(app: Sphinx) -> dict[str, bool]:
    """Change docstrings before numpydoc does."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", set_equations, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
