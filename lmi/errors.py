"""Exceptions of the package."""


class LMIError(Exception):
    """Root of all errors raised by ``lmi``.

    Examples
    --------
    >>> try:
    ...     lmi.diagonal_lyapunov([[-1.0]])
    ... except lmi.LMIError as error:
    ...     print(type(error).__name__)
    NoCertificate
    """


class MatrixError(LMIError, ValueError):
    """An argument is not a real, finite, square matrix, or a vector has the wrong length or sign.

    Examples
    --------
    >>> lmi.is_m_matrix([[1.0, 2.0]])
    Traceback (most recent call last):
    lmi.errors.MatrixError: A has shape (1, 2), not (n, n)
    """


class NoCertificate(LMIError, RuntimeError):
    """No diagonal Lyapunov matrix was found; the message says what the solver answered.

    Examples
    --------
    >>> lmi.diagonal_lyapunov([[-1.0]])
    Traceback (most recent call last):
    lmi.errors.NoCertificate: the best margin found is -2, which is not positive
    """


class OutOfTime(LMIError, RuntimeError):
    """A search or a proof was ended by :func:`lmi.time_limit`.

    Examples
    --------
    >>> with lmi.time_limit(0):
    ...     lmi.diagonal_lyapunov(np.eye(50))
    Traceback (most recent call last):
    lmi.errors.OutOfTime: the time limit is reached
    """


class NotAnHMatrix(LMIError, ValueError):
    """A matrix is not a nonsingular H-matrix with positive diagonal; the message says what fails.

    Examples
    --------
    >>> lmi.h_matrix_diagonal([[-1.0]])
    Traceback (most recent call last):
    lmi.errors.NotAnHMatrix: diagonal entry 0 is -1, not positive
    """


class NotAnMMatrix(LMIError, ValueError):
    """A matrix is not a nonsingular M-matrix, or a witness does not show it; the message names what fails.

    Examples
    --------
    >>> lmi.m_matrix_certificate([[1.0, 2.0], [0.0, 1.0]])
    Traceback (most recent call last):
    lmi.errors.NotAnMMatrix: entry (0, 1) is 2, positive off the diagonal
    """
