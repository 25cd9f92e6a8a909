"""What notebooks show of an object: classes say that they can be shown, and who draws them registers here.

A function that draws a class is decorated with ``@shows(TheClass)``; it takes the object and returns HTML.
"""

from functools import singledispatch
from importlib import import_module
from typing import Any

#: The module that registers, loaded when a notebook first asks.
_DRAWN_BY = "ptcc_certify.report.notebook"


class Shown:
    """A class that notebooks show as HTML.

    Examples
    --------
    >>> class Thing(Shown): ...
    >>> @shows(Thing)
    ... def thing_html(thing):
    ...     return "<p>thing</p>"
    >>> Thing()._repr_html_()
    '<p>thing</p>'
    """

    def _repr_html_(self) -> str | None:
        import_module(_DRAWN_BY)
        return _html_of(self)


@singledispatch
def _html_of(shown: Any) -> str | None:
    """Return nothing of a class that nobody draws; a notebook then takes the plain text."""
    return None


#: Register the decorated function for a class.
shows = _html_of.register
