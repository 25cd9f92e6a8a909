"""The packaged graphs, by name."""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path

from ptcc_certify.errors import ParameterError, did_you_mean

#: Names of the graphs of the paper's examples, and of all packaged ones.
PAPER = ("fig1a", "fig1b", "fig3a", "fig3b", "fig5a", "fig5b")
GRAPHS = (*PAPER, "highland_tribes")


def graph_path(name: str) -> Path:
    """Return the path of a packaged graph.

    Raises
    ------
    ParameterError
        No such graph; the message lists them.

    Examples
    --------
    >>> graph_path("fig1a").name
    'fig1a.csv'
    """
    if name not in GRAPHS:
        raise ParameterError(f'no packaged graph "{name}"; there are {", ".join(GRAPHS)}{did_you_mean(name, GRAPHS)}')
    return Path(str(resources.files("ptcc_certify") / "examples" / f"{name}.csv"))


def file_or_packaged(name: str) -> str | Path:
    """Return the path of a packaged graph where no file has its name, otherwise ``name``.

    Examples
    --------
    >>> file_or_packaged("fig1a").name, file_or_packaged("graph.csv")
    ('fig1a.csv', 'graph.csv')
    """
    return graph_path(name) if name in GRAPHS and not os.path.isfile(name) else name  # noqa: PTH113
