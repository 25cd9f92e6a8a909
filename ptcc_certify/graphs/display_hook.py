"""What notebooks show of an object, and its figures: classes say what they can show, the room ``report`` draws it.

A function that draws a class is decorated with ``@shows(TheClass)``; it takes the object and returns HTML. Rooms below
``report`` name it by texts only, so that they do not depend on it.
"""

from functools import singledispatch
from importlib import import_module
from typing import Any

from ptcc_certify.errors import ParameterError

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


#: What ``plot(what=...)`` of an object draws, and the public function that draws it.
_FIGURES = {
    "decay": "plot_decay",
    "input": "plot_input",
    "graph": "plot_graph",
    "spectrum": "plot_spectrum",
    "states": "plot_trajectory",
    "motion": "plot_motion",
    "formation": "plot_formation",
    "late": "plot_late",
    "tracking": "plot_tracking",
}


def plot(subject: Any, what: str, **keywords: Any) -> Any:
    """Draw a figure of an object.

    Raises
    ------
    ParameterError
        No figure is called so.

    Examples
    --------
    >>> plot(None, "picture")
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: what = 'picture' is unknown; one of decay, input, graph, spectrum, states, \
motion, formation, late, tracking
    """
    if what not in _FIGURES:
        raise ParameterError(f"what = {what!r} is unknown; one of {', '.join(_FIGURES)}")
    return getattr(import_module("ptcc_certify"), _FIGURES[what])(subject, **keywords)


#: The same of a family of graphs.
_FAMILY_FIGURES = {
    "decay": "plot_family_decay",
    "input": "plot_input",
    "graph": "plot_graph",
    "states": "plot_family",
}


def plot_of_family(subject: Any, what: str, **keywords: Any) -> Any:
    """Draw a figure of a family or of its certificate.

    Raises
    ------
    ParameterError
        No figure is called so, or families have none.

    Examples
    --------
    >>> plot_of_family(None, "spectrum")
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: eigenvalues of single graphs do not tell what switching among them does; ...
    """
    if what == "spectrum":
        why = "eigenvalues of single graphs do not tell what switching among them does"
        raise ParameterError(f"{why}; draw those of one graph, or the decay of the family")
    if what not in _FAMILY_FIGURES:
        raise ParameterError(f"what = {what!r} is unknown; one of {', '.join(_FAMILY_FIGURES)}")
    return getattr(import_module("ptcc_certify"), _FAMILY_FIGURES[what])(subject, **keywords)


def plot_of_counterexample(component: Any, **keywords: Any) -> Any:
    """Draw what refutes a behaviour of a component of a family.

    Examples
    --------
    >>> plot_of_counterexample(ptcc.decide([("a", "b", 1, 1), ("b", "a", -1, 0)])[0]).get_ylabel()
    'state $x_k$'
    """
    return import_module("ptcc_certify.report.plots.counterexample").plot_counterexample(component, **keywords)


def summary(subject: Any) -> str:
    """Return the short screen of a certificate."""
    return "\n".join(import_module("ptcc_certify.report.screen").summary_lines(subject))


def facts(subject: Any) -> list[Any]:
    """Return what is told of a certificate."""
    return import_module("ptcc_certify.report.facts.of_certificate").facts_of(subject)  # type: ignore[no-any-return]


def summary_of_design(subject: Any) -> str:
    """Return the long screen of a design."""
    return "\n".join(import_module("ptcc_certify.report.screen").long_screen(subject.facts()))
