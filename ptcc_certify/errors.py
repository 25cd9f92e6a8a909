"""Every exception this package raises on purpose.

Each class inherits :class:`PTCCError` and the built-in exception that fits, so that callers may catch either.
A message is one line: what is wrong, where, and how to mend it.
"""


class PTCCError(Exception):
    """Root of all errors raised by ``ptcc_certify``."""


class NumberError(PTCCError, ValueError):
    """A text is not a number of the exact grammar (see :mod:`ptcc_certify.rationals`)."""


class GraphError(PTCCError, ValueError):
    """The data do not describe a signed digraph."""


class FormatError(GraphError):
    """A file cannot be read as a graph, a start or a certificate; the message names file and line."""


class ParameterError(PTCCError, ValueError):
    """A protocol parameter, a start or an option is outside its domain."""


class HypothesisError(PTCCError, ValueError):
    """A theorem or lemma is asked about a graph or matrix that does not meet its hypotheses."""


class SimulationError(PTCCError, RuntimeError):
    """The integrator failed; the message names the cause."""
