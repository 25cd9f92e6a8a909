"""Labels and entries by label, and tables for pandas, which is optional: imported here, and named where missing."""

from __future__ import annotations

import operator
import re
from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ptcc_certify.errors import FormatError, GraphError, ParameterError, UnknownAgentError, did_you_mean, quoted
from ptcc_certify.graphs.rationals import shorten

if TYPE_CHECKING:
    import pandas as pd

_INTEGER_LABEL = re.compile(r"-?[0-9]{1,18}", re.ASCII)
#: Labels of a column of whole numbers in which some are missing.
_NUMBER_OR_GAP = r"-?[0-9]+(\.0+)?|n/?a|nan|null|none"


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
        near = did_you_mean(str(label), labels)
        raise UnknownAgentError(f"no agent is called {shorten(repr(label))}; there are {first_five(labels)}{near}")
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


def ordered_labels(labels: list[str]) -> tuple[list[str], np.ndarray]:
    """Order labels by value if all are integers, else as they came; also return the rank of each old position.

    Examples
    --------
    >>> ordered_labels(["10", "2"])
    (['2', '10'], array([1, 0]))
    """
    order: Sequence[int] = range(len(labels))
    if all(_INTEGER_LABEL.fullmatch(label) for label in labels):
        order = sorted(order, key=lambda i: (int(labels[i]), labels[i]))
    return [labels[i] for i in order], np.argsort(order)


def refuse_unnamed(node: Any, where: str) -> None:
    """Refuse what stands where a node has no name: None, NaN, and NA or NaT of pandas.

    Examples
    --------
    >>> refuse_unnamed(None, "row 2")
    Traceback (most recent call last):
    ptcc_certify.errors.GraphError: row 2 names no node (None); leave it out or name the node
    """
    if node is None or (str(node) in ("nan", "<NA>", "NaT") and not isinstance(node, str)):
        raise GraphError(f"{where} names no node ({node}); leave it out or name the node")


def refuse_written_twice(labels: Sequence[str], place: str) -> tuple[str, ...]:
    """Refuse nodes such as 2 and 2.0, which a column of numbers becomes where a field of it is empty.

    Beside names, or fractions as versions 2.1 and 2.2 are, they may be two: a note tells that.

    Examples
    --------
    >>> refuse_written_twice(["2", "2.0", "2.1"], "a.csv")
    ('2 and 2.0 are two nodes',)
    >>> refuse_written_twice(["1", "2", "2.0"], "a.csv")
    Traceback (most recent call last):
    ptcc_certify.errors.FormatError: a.csv: nodes 2 and 2.0 are one number written in two ways; write it in one
    """
    there = set(labels)
    again = [label for label in labels if re.fullmatch(r"-?[0-9]+\.0+", label) and label.partition(".")[0] in there]
    if not again:
        return ()
    both = f"{shorten(again[0].partition('.')[0])} and {shorten(again[0])}"
    if not all(re.fullmatch(_NUMBER_OR_GAP, label, re.IGNORECASE) for label in there):
        return (f"{both} are two nodes",)
    what = f"nodes {both} are one number written in two ways; write it in one"
    raise FormatError(f"{place}: {what}") if place else GraphError(what)


def labels_beside(values: Any) -> list[str] | None:
    """Return the labels of a pandas Series, or of the rows of a DataFrame, as nodes are written; None of other data.

    Examples
    --------
    >>> labels_beside([3, 5]) is None
    True
    """
    index = getattr(values, "index", None)  # a method of lists and texts
    if index is None or callable(index) or not hasattr(values, "to_numpy"):
        return None
    return [str(label) for label in index]


def first_five(labels: Sequence[str]) -> str:
    """Return the first five labels, for a message.

    Examples
    --------
    >>> print(first_five(["Smith, J", "a"]))
    "Smith, J", a
    """
    return ", ".join(quoted(shorten(label)) for label in labels[:5]) + (", ..." if len(labels) > 5 else "")


def in_all(count: int) -> str:
    """Tell how many there are of which a refusal names one.

    Examples
    --------
    >>> in_all(1), in_all(2)
    ('', ' (2 in all)')
    """
    return f" ({count} in all)" if count > 1 else ""


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
