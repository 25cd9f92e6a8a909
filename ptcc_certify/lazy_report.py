"""What is shown of an object: the room ``report`` renders it and is loaded when somebody looks.

Rooms below ``report`` name it by texts only, so that they do not depend on it.
"""

from importlib import import_module
from typing import Any


class Shown:
    """A class that notebooks show as HTML, if :func:`ptcc_certify.report.notebook.html_of` renders it.

    Examples
    --------
    >>> SignedDigraph.from_edges([("a", "b", 1)])._repr_html_()[:4]
    '<div'
    """

    def _repr_html_(self) -> str | None:
        return rendered("notebook.html_of", self)  # type: ignore[no-any-return]


def rendered(by: str, subject: Any, *more: Any, **keywords: Any) -> Any:
    """Return what a function of the room ``report`` makes of an object.

    Parameters
    ----------
    by : str
        Its module and its name.
    subject, *more, **keywords : Any

    Examples
    --------
    >>> from ptcc_certify.lazy_report import rendered
    >>> rendered("plots.style.time_label", "time", "s")
    'time (s)'
    """
    module, _, name = by.rpartition(".")
    return getattr(import_module(f"ptcc_certify.report.{module}"), name)(subject, *more, **keywords)
