"""Every exception this package raises on purpose, what is said of one that stops the work, and every exit code.

Each class inherits :class:`PTCCError` and the built-in exception that fits, so that callers may catch either.
A message is one line: what is wrong, where, and how to mend it.
"""

import traceback
from collections.abc import Iterable
from difflib import get_close_matches
from enum import IntEnum
from itertools import islice
from pathlib import Path


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


class PTCCError(Exception):
    """Root of all errors raised by ``ptcc_certify``.

    Examples
    --------
    >>> try:
    ...     ptcc.NominalProtocol(T=0, rho1=1, rho2=1, kappa=1)
    ... except ptcc.PTCCError as error:
    ...     print(type(error).__name__)
    ParameterError
    """


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
    ptcc_certify.errors.GraphError: weight 0 of edge a -> b: an unknown sign is not an edge; remove it or give a weight
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
    """A protocol parameter, an initial state or an option is outside its domain.

    Examples
    --------
    >>> NominalProtocol(T=-1, rho1=1, rho2=1, kappa=1)
    Traceback (most recent call last):
    ptcc_certify.errors.ParameterError: T = -1 is outside its domain; T must be > 0
    """


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
