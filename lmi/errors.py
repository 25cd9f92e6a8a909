"""Exceptions of the package."""


class LMIError(Exception):
    """Root of all errors raised by ``lmi``."""


class MatrixError(LMIError, ValueError):
    """An argument is not a real, finite, square matrix, or a vector has the wrong length or sign."""


class NoCertificate(LMIError, RuntimeError):
    """No diagonal Lyapunov matrix was found; the message says what the solver answered."""


class NotAnHMatrix(LMIError, ValueError):
    """A matrix is not a nonsingular H-matrix with positive diagonal; the message says what fails."""


class NotAnMMatrix(LMIError, ValueError):
    """A matrix is not a nonsingular M-matrix, or a witness does not show it; the message names what fails."""
