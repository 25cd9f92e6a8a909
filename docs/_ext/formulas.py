"""Formulas as SVG in the page: nothing is loaded, and a reader without eyes hears the LaTeX."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util import logging
from ziamath.tex import tex2mml

from ptcc_certify.report.html_text import formula_svg


def formula(page: Any, node: nodes.Element, inline: bool) -> str:
    """Return the SVG of a formula; one that cannot be set is a warning that names its place."""
    latex = node.astext()
    try:
        unknown = re.search(r">(\\[A-Za-z]+)<", tex2mml(latex))  # it would be printed as it is
        if unknown is None:
            return formula_svg(latex, inline)
        fault = f"unknown command {unknown[1]}"
    except Exception as error:  # the libraries raise what they like
        fault = f"{type(error).__name__} {error}"
    logging.getLogger(__name__).warning("formula %r: %s", latex, fault, location=node)
    return str(page.encode(latex))


def visit_inline(page: Any, node: nodes.Element) -> None:
    """Set a formula in a line."""
    page.body.append(f'<span class="formula">{formula(page, node, inline=True)}</span>')
    raise nodes.SkipNode


def visit_display(page: Any, node: nodes.Element) -> None:
    """Set a formula on lines of its own, with its number if it has one."""
    page.body.append(page.starttag(node, "div", CLASS="formula display"))
    page.body.append(formula(page, node, inline=False))
    if node["number"]:
        page.body.append(f'<span class="number">({node["number"]})')
        page.add_permalink_ref(node, "Link to this equation")
        page.body.append("</span>")
    page.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the renderer ``svg``."""
    app.add_html_math_renderer("svg", (visit_inline, None), (visit_display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
