"""Entries by label, and tables for pandas, which is optional: imported here, and named where it is missing."""

from __future__ import annotations

import operator
from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING, Any

from ptcc_certify.errors import ParameterError, UnknownAgentError
from ptcc_certify.graphs.rationals import shorten

if TYPE_CHECKING:
    import pandas as pd


def position(label: Hashable, labels: Sequence[str]) -> int:
    """Return where an agent stands among the labels.

    Raises
    ------
    UnknownAgentError
        No agent is called so.

    Examples
    --------
    >>> position(2, ["1", "2"])
    1
    """
    if str(label) not in labels:
        raise UnknownAgentError(f"no agent is called {shorten(repr(label))}; there are {first_five(labels)}")
    return labels.index(str(label))


def place_of(agent: Any, labels: Sequence[str]) -> int:
    """Return where an agent stands that is named by its place from 0, or by its label if that is a text.

    Raises
    ------
    UnknownAgentError
        No agent stands there, or is called so.

    Examples
    --------
    >>> place_of("b", ["a", "b"]), place_of(1, ["a", "b"])
    (1, 1)
    >>> place_of(2, ["a", "b"])
    Traceback (most recent call last):
    ptcc_certify.errors.UnknownAgentError: no agent has place 2; places are 0 to 1, labels are texts: a, b
    """
    if not hasattr(agent, "__index__"):
        return position(agent, labels)
    place = operator.index(agent)
    if not 0 <= place < len(labels):
        where = f"places are 0 to {len(labels) - 1}, labels are texts: {first_five(labels)}"
        raise UnknownAgentError(f"no agent has place {place}; {where}")
    return place


def first_five(labels: Sequence[str]) -> str:
    """Return the first five labels, for a message."""
    return ", ".join(map(shorten, labels[:5])) + (", ..." if len(labels) > 5 else "")


def import_pandas() -> Any:
    """Return the package pandas.

    Raises
    ------
    ParameterError
        It is not installed.
    """
    try:
        import pandas
    except ImportError:
        raise ParameterError('this needs pandas; install it with: pip install "pandas>=2.2"') from None
    return pandas


def series(entries: Any, labels: Any, name: str) -> pd.Series:
    """Return one entry for each label.

    Examples
    --------
    >>> series([1.0, 2.0], ["a", "b"], "x").to_dict()
    {'a': 1.0, 'b': 2.0}
    """
    pandas = import_pandas()
    return pandas.Series(entries, index=pandas.Index(labels, name="node"), name=name)
