"""What notebooks show of an object: classes say that they can be shown, and who draws them registers here."""

from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeVar

#: The module that registers, loaded when a notebook first asks.
_DRAWN_BY = "ptcc_certify.report.notebook"
_KINDS: dict[type, Callable[[Any], str]] = {}

Show = TypeVar("Show", bound=Callable[[Any], str])


class Shown:
    """A class that notebooks show as HTML.

    Examples
    --------
    >>> from ptcc_certify import SignedDigraph
    >>> SignedDigraph.from_edges([("a", "b", 1)])._repr_html_().startswith("<div")
    True
    """

    def _repr_html_(self) -> str | None:
        import_module(_DRAWN_BY)
        return next((_KINDS[kind](self) for kind in type(self).__mro__ if kind in _KINDS), None)


def shows(kind: type) -> Callable[[Show], Show]:
    """Register the decorated function for a class.

    Examples
    --------
    >>> class Thing(Shown): ...
    >>> @shows(Thing)
    ... def thing_html(thing):
    ...     return "<p>thing</p>"
    >>> Thing()._repr_html_()
    '<p>thing</p>'
    """

    def register(function: Show) -> Show:
        _KINDS[kind] = function
        return function

    return register
