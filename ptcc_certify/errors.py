"""Every exception this package raises on purpose, the changes it advises, and every exit code.

Each class inherits :class:`PTCCError` and the built-in exception that fits, so that callers may catch either.
A message is one line: what is wrong, where, and how to mend it.
"""

import csv
import inspect
import re
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from enum import IntEnum
from fractions import Fraction
from functools import wraps
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

Called = TypeVar("Called", bound=Callable[..., Any])


class ExitCode(IntEnum):
    """What ``ptcc`` and its checker exit with; the worst of several is told by :mod:`ptcc_certify.certificate.verdict`.

    Examples
    --------
    >>> int(ExitCode.UNDECIDED)
    4
    """

    OK = 0
    """Proved, and everything asked holds."""
    VIOLATED = 1
    """A simulated run exceeds a proved bound, or a certificate is rejected."""
    BAD_INPUT = 2
    """Bad input or usage."""
    REFUTED = 3
    """An expectation is refuted."""
    UNDECIDED = 4
    """Undecided, or an expectation is left open."""
    INTERNAL_ERROR = 70
    """An error of this program."""
    INTERRUPTED = 130
    """Ctrl-C, or SIGTERM."""


@dataclass(frozen=True)
class Change:
    """Another value of a field, or the field alone.

    Attributes
    ----------
    field : str
        As Python names it.
    value : Fraction, str or None

    Examples
    --------
    >>> str(Change("rho2", Fraction(1, 2))), str(Change("time_limit"))
    ('rho2=0.5', 'time_limit')
    """

    field: str
    value: Fraction | str | None = None

    @property
    def number(self) -> str:
        """The value in words; empty if there is none."""
        if not isinstance(self.value, Fraction):
            return self.value or ""
        decimal = f"{float(self.value):.6g}"
        return decimal if Fraction(decimal) == self.value else str(self.value)

    def __str__(self) -> str:
        return f"{self.field}={self.number}" if self.value is not None else self.field


#: A sentence: a text, or texts and the changes that stand among them.
Sentence = str | tuple[str | Change, ...]
#: How a medium names a change.
Spelling = Callable[[Change], str]


#: What a label stands between in a sentence, as Unicode isolates a text whose direction of writing is not known.
LABEL, LABEL_END = "\N{FIRST STRONG ISOLATE}", "\N{POP DIRECTIONAL ISOLATE}"


def labelled(label: str) -> str:
    """Return a label as it stands in a sentence: apart from words and formulas, whatever it looks like.

    Examples
    --------
    >>> spell(f"the largest of agent {labelled('delta')}")
    'the largest of agent delta'
    """
    return f"{LABEL}{quoted(label)}{LABEL_END}"


def quoted(label: str) -> str:
    """Return a label as it stands in a list: in quotation marks where it would read as two, or lose a blank.

    Examples
    --------
    >>> print(quoted("Smith, J"), quoted("ann lee"), sep=", ")
    "Smith, J", ann lee
    """
    return f'"{label}"' if "," in label or label != label.strip(" ") else label


def items_of(text: str) -> list[str]:
    """Return what commas separate: labels, or ``label=value``, where quotes may stand around the label or all of it.

    Raises
    ------
    csv.Error
        A quote is not closed.

    Examples
    --------
    >>> items_of('bob=1, "Smith, J"=2'), items_of('"Smith, J=2","ann lee"')
    (['bob=1', 'Smith, J=2'], ['Smith, J=2', 'ann lee'])
    """
    text = re.sub(r'(^|,)\s*"((?:[^"]|"")*)"\s*=([^,"]*)', r'\1"\2=\3"', text)
    return next(csv.reader([text], skipinitialspace=True, strict=True), [])


def unlabelled(text: str) -> str:
    """Return a text without the marks of labels."""
    return text.replace(LABEL, "").replace(LABEL_END, "")


def spell(sentence: Sentence, name: Spelling = str, marked: bool = False) -> str:
    """Return a sentence as a text, its changes named as a medium names them; labels stay ``marked`` if it sets them.

    Examples
    --------
    >>> spell(("no rate is proved; raise ", Change("time_limit"))), spell("proved")
    ('no rate is proved; raise time_limit', 'proved')
    """
    parts = (sentence,) if isinstance(sentence, str) else sentence
    text = "".join(part if isinstance(part, str) else name(part) for part in parts)
    return text if marked else unlabelled(text)


def joined(separator: str, sentences: Iterable[Sentence]) -> Sentence:
    """Return sentences as one; those that are empty are left out.

    Examples
    --------
    >>> joined("; ", ["certified", "", ("raise ", Change("rho2"))])
    ('certified', '; ', 'raise ', Change(field='rho2', value=None))
    """
    parts: list[str | Change] = []
    for sentence in sentences:
        if sentence:
            parts += [separator] if parts else []
            parts += [sentence] if isinstance(sentence, str) else sentence
    return tuple(parts)


#: How a reason begins whose subject is the field.
_PREDICATES = ("=", "is ", "has ", "acts ", "gives ", "belongs ")


class PTCCError(Exception):
    """Root of all errors raised by ``ptcc_certify``.

    Parameters
    ----------
    *told : str, or tuple of str and Change
        The field, if it is of one, and the reason: ``"= -1 is outside its domain; .."``, ``"belongs to .."``, or a
        sentence.

    Attributes
    ----------
    field : str
        The parameter, as Python names it, or the place that it is about; empty if it is of none.
    reason : str, or tuple of str and Change
        What is wrong, and how to mend it.

    Examples
    --------
    >>> try:
    ...     ptcc.NominalProtocol(T=0, rho1=1, rho2=1, kappa=1)
    ... except ptcc.PTCCError as error:
    ...     print(type(error).__name__)
    ParameterError
    """

    def __init__(self, *told: Sentence):
        self.field = str(told[0]) if len(told) > 1 else ""
        self.reason: Sentence = told[-1] if told else ""
        super().__init__(self.told())

    def told(self, name: Spelling = str) -> str:
        """Return the message, with fields as a medium names them.

        Parameters
        ----------
        name : callable
            Given a :class:`Change`, its name; by default the one in Python.
        """
        reason = spell(self.reason, name)
        if not self.field:
            return reason
        return f"{name(Change(self.field))}{' ' if reason.startswith(_PREDICATES) else ': '}{reason}"


class NumberError(PTCCError, ValueError):
    """A text is not a number of the exact grammar (see :mod:`ptcc_certify.graphs.rationals`).

    Examples
    --------
    >>> from ptcc_certify.graphs.rationals import parse_exact
    >>> parse_exact("1/0")
    Traceback (most recent call last):
    ptcc_certify.errors.NumberError: "1/0" divides by zero
    """


class GraphError(PTCCError, ValueError):
    """The data do not describe a signed digraph.

    Examples
    --------
    >>> SignedDigraph.from_edges([("a", "b", 0)])
    Traceback (most recent call last):
    ptcc_certify.errors.GraphError: weight 0 of edge a -> b: neither ally nor opponent; remove it or give a weight...
    """


class FormatError(GraphError):
    """A file cannot be read as a graph, an initial state or a certificate; the message names file and line.

    Examples
    --------
    >>> read_graph(StringIO("a,a,1"))
    Traceback (most recent call last):
    ptcc_certify.errors.FormatError: input, line 1: self-loop at node a; remove it, or drop all with --drop-self-loops
    """


class ParameterError(PTCCError, ValueError):
    r"""A protocol parameter, an initial state or an option is outside its domain.

    Examples
    --------
    >>> NominalProtocol(T=-1, rho1=1, rho2=1, kappa=1)
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: T = -1 is outside its domain; T must be > 0
    >>> error = ParameterError("rest", ("is for an unlimited gain; leave ", Change("gain_cap"), " out"))
    >>> print(error, error.told(lambda change: f"--{change.field}"), sep="\n")
    rest is for an unlimited gain; leave gain_cap out
    --rest is for an unlimited gain; leave --gain_cap out
    """


class UnknownAgentError(ParameterError, KeyError):
    """No agent has this label.

    Examples
    --------
    >>> final_state([("a", "b", -1)], [3, 5])["c"]
    Traceback (most recent call last):
    ptcc_certify.errors.UnknownAgentError: no agent is called 'c'; there are a, b
    """

    __str__ = Exception.__str__  # a KeyError would quote the message


class HypothesisError(PTCCError, ValueError):
    """A theorem or lemma is asked about a graph or matrix that does not meet its hypotheses.

    Examples
    --------
    >>> ptcc.theorems.lemmas.unbalanced_lyapunov(SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 1)]))
    Traceback (most recent call last):
    ptcc_certify.errors.HypothesisError: Lemma 3.2 asks for a structurally unbalanced graph; this one is balanced
    """


class SimulationError(PTCCError, RuntimeError):
    """The integrator failed; the message names the cause.

    Examples
    --------
    >>> foes = SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    >>> held = GainLimits(sample_period="0.001", gain_cap=2_000_000)  # far too long for such a gain
    >>> simulate(foes, NominalProtocol(T=1, rho1=1_000_000, rho2=1, kappa=1), [3, 1], actuator=held)
    Traceback (most recent call last):
    ptcc_certify.errors.SimulationError: the sampled run grows beyond the range of floats; take a shorter sample_period
    """


def one_line(text: str) -> str:
    r"""Return a text as one line that a terminal can show.

    Examples
    --------
    >>> one_line("a.csv,\n  line 2: \x1b[31m")
    'a.csv, line 2: ?[31m'
    """
    return "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return what a refusal of a name may add: the names that it may have been meant for; nothing if none is near.

    Parameters
    ----------
    name : str
    names : iterable of str
        The first 5,000 count.

    Returns
    -------
    str

    Examples
    --------
    >>> did_you_mean("rh1", ["rho1", "kappa"]), did_you_mean("Fig1A", ["fig1a"]), did_you_mean("x", ["kappa"])
    ('; did you mean rho1?', '; did you mean fig1a?', '')
    """
    lower: dict[str, str] = {}
    for other in islice(names, 5000):
        lower.setdefault(other.lower(), other)
    if (same := lower.get(name.lower())) is not None:
        return f"; did you mean {same}?"
    near = [lower[match] for match in get_close_matches(name.lower()[:200], lower, n=3, cutoff=0.6)]
    return f"; did you mean {' or '.join(near)}?" if near else ""


#: Where a keyword belongs that a function does not have.
_PLACES = dict.fromkeys(("T", "rho1", "rho2", "kappa"), "NominalProtocol")
_PLACES |= dict.fromkeys(("T_r", "T_s", "mu1", "mu2", "mu3"), "SlidingModeProtocol")
_OF_GRAPHS = ("orientation", "duplicates", "drop_self_loops", "drop_zeros", "undirected", "laplacian", "columns")
_PLACES |= dict.fromkeys(_OF_GRAPHS, "as_graph")
_PLACES |= dict.fromkeys(("gain_cap", "stop_before", "sample_period"), "GainLimits")
_PLACES |= dict.fromkeys(("behaviour", "min_rate", "max_input"), "Expectations")
_PLACES |= dict.fromkeys(("method", "at", "initial_set", "simulation", "time_limit", "expectations"), "Asks")
_PLACES |= dict.fromkeys(("delta", "noise", "disturbance"), "Asks")
_PLACES |= {"sigma0": "InitialState", "v0": "InitialState", "derivatives": "InitialState"}
_PLACES |= dict.fromkeys(("delay", "own_delay", "period", "losses", "value_error"), "LateMessages")
#: How many parameters are listed.
_FEW = 12


def gated(called: Called) -> Called:
    """Decorate a function, or a class: a call that does not fit its parameters is a :class:`ParameterError`.

    Signature and documentation stay those of what is decorated.

    Examples
    --------
    >>> @gated
    ... def area(width, height=1): ...
    >>> area(2, heigth=3)
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: area has no parameter heigth; did you mean height?
    """
    if isinstance(called, type):
        called.__init__ = gated(called.__init__)  # type: ignore[misc]
        return called
    signature = inspect.signature(called)

    @wraps(called)
    def gate(*args: Any, **keywords: Any) -> Any:
        try:
            signature.bind(*args, **keywords)
        except TypeError:
            raise ParameterError(_misfit(called, signature, args, keywords)) from None
        return called(*args, **keywords)

    return gate  # type: ignore[return-value]


def _misfit(called: Any, signature: inspect.Signature, args: tuple[Any, ...], keywords: Mapping[str, Any]) -> str:
    """Return what does not fit, and the mend."""
    name = called.__qualname__.split(".")[-2] if called.__name__ == "__init__" else called.__name__
    parameters = {key: one for key, one in signature.parameters.items() if key not in ("self", "cls")}
    places = [key for key, one in parameters.items() if one.kind is one.POSITIONAL_OR_KEYWORD]
    given = places[: len(args) - (len(parameters) < len(signature.parameters))]
    if unknown := next((key for key in keywords if key not in parameters), None):
        return unknown_parameter(name, unknown, parameters)
    required = [key for key, one in parameters.items() if one.default is one.empty and one.kind is not one.VAR_KEYWORD]
    if missing := [key for key in required if key not in given and key not in keywords]:
        call = [f"{key}=..." if parameters[key].kind is inspect.Parameter.KEYWORD_ONLY else key for key in required]
        return f"{name} asks for {', '.join(missing)}; write {name}({', '.join(call)})"
    once = ", each once" if keywords.keys() & set(given) else ""
    return f"{name} takes {', '.join(places) or 'nothing'} without a name{once}; write any other as name=value"


def unknown_parameter(name: str, unknown: str, parameters: Iterable[str]) -> str:
    """Return the refusal of a keyword that a function does not have, with where it belongs or what it may mean.

    Examples
    --------
    >>> unknown_parameter("certify", "rho1", ["graph", "protocol", "x0"])
    'certify has no parameter rho1; give it to NominalProtocol(rho1=...)'
    """
    parameters = list(parameters)
    listed = f"it has {', '.join(parameters)}" if len(parameters) <= _FEW else f"help({name}) lists what it has"
    hint = did_you_mean(unknown, parameters) or f"; {listed}"
    called = "orientation" if unknown == "edges" else unknown  # as the command line calls it
    if called != unknown and called in parameters:
        hint = f"; it is called {called}"
    elif (
        (place := _PLACES.get(called))
        and name not in _PLACES.values()
        and (place != "as_graph" or "graph" in parameters)
    ):
        hint = f"; give it to {place}({called}=...)"
    return f"{name} has no parameter {unknown}{hint}"


def explain(error: Exception) -> str:
    r"""Tell in one line why there is no result: the input, the size of its numbers or of itself, or this program.

    Parameters
    ----------
    error : Exception
        As it was caught; of one that is not raised on purpose, the place where it was raised is told.

    Returns
    -------
    str

    Examples
    --------
    >>> explain(ParameterError("T = 0 is outside its domain;\nT must be > 0"))
    'T = 0 is outside its domain; T must be > 0'
    >>> try:
    ...     float(10**400)
    ... except OverflowError as error:
    ...     print(explain(error))
    a number is beyond the range of float64; choose other units of time, weight or state
    """
    if isinstance(error, PTCCError):
        return one_line(str(error))
    if isinstance(error, OverflowError):
        return "a number is beyond the range of float64; choose other units of time, weight or state"
    if isinstance(error, MemoryError):
        return "not enough memory for a graph or a table of this size"
    at = traceback.extract_tb(error.__traceback__)[-1]
    where = f"{Path(at.filename).name}, line {at.lineno}"
    return f"a defect of this program ({type(error).__name__} in {where}), please report it"
