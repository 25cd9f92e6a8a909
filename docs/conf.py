"""The site: ``python -m sphinx -W -b html docs site`` with the packages of the extra ``docs``; no network is needed."""

import os
import sys
from importlib.metadata import version as installed_version
from pathlib import Path
from shutil import copy
from typing import Any

DOCS = Path(__file__).parent
sys.path[:0] = [str(DOCS.parent), str(DOCS / "_ext")]

from docutils import nodes  # noqa: E402
from reference_pages import write_reference  # noqa: E402

project = "ptcc-certify"
author = "ptcc-certify contributors"
version = release = installed_version("ptcc-certify")
language = "en"

extensions = [
    "docstring_equations",
    "formulas",
    "local_links",
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
    "sphinx_design",
    "thumbnails",
]
exclude_patterns = ["_build", "_ext", "_extra", "paper"]

# -- written anew in every build ---------------------------------------------------------------------------------------
for notebook in DOCS.glob("tutorial/*.ipynb"):
    notebook.unlink()
for notebook in DOCS.parent.glob("notebooks/*.ipynb"):
    copy(notebook, DOCS / "tutorial")
write_reference(DOCS / "reference" / "generated")

# -- pages: every code cell is run, and an error in one ends the build -------------------------------------------------
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"  # figures of cells are part of the page
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = nb_execution_show_tb = True
nb_execution_timeout = 300
nb_merge_streams = True
nb_ipywidgets_js: dict[str, dict[str, str]] = {}  # the scripts of widgets would come from a network
nb_mime_priority_overrides = [("html", "application/vnd.jupyter.widget-view+json", None)]

# -- reference ---------------------------------------------------------------------------------------------------------
autodoc_typehints = "none"  # the docstrings tell types, shapes and units
numpydoc_show_class_members = False  # :members: lists them

# -- looks -------------------------------------------------------------------------------------------------------------
html_theme = "furo"
html_title = "ptcc-certify"
html_static_path = ["_static"]
html_css_files = ["site.css"]
_checker = DOCS.parent / "formal" / "browser" / "check.html"  # the proved checker, where it was built
html_extra_path = [str(_checker if _checker.exists() else DOCS / "_extra" / "check.html")]
html_math_renderer = "svg"
html_show_sphinx = html_show_copyright = False
html_copy_source = False
pygments_style, pygments_dark_style = "friendly", "monokai"
copybutton_exclude = ".linenos, .gp, .go"


def name_controls(app: Any, page: nodes.document) -> None:
    """Say what a page cannot show: controls are moved where a notebook runs."""
    for block in list(page.findall(nodes.literal_block)):
        if block.astext().startswith("VBox(children="):
            block.replace_self(nodes.paragraph(text="Here the controls appear when you run the notebook yourself."))


def name_figures(app: Any, page: nodes.document) -> None:
    """Let a figure without words of its own bear the title of its section, for readers without eyes."""
    for image in page.findall(nodes.image):
        place: Any = image
        while place is not None and not isinstance(place, nodes.section):
            place = place.parent
        if place is not None and image.get("alt") is None:
            image["alt"] = place.next_node(nodes.title).astext()


def setup(app: Any) -> None:
    """Change pages as they are read."""
    app.connect("doctree-read", name_controls)
    app.connect("doctree-read", name_figures)
