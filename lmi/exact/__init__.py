"""The kernel: exact numbers, and proofs of definiteness that everything else asks for.

Everything here is decided with the standard library alone; :mod:`lmi.exact.fast` gives the same answers with arrays.
"""

from __future__ import annotations

from lmi.exact.definite import Arithmetic


def arithmetic(stdlib: bool = False) -> Arithmetic:
    """Return what decides: with NumPy and python-flint where they are installed, else (or on request) without.

    Examples
    --------
    >>> arithmetic(stdlib=True).name
    'standard library'
    """
    if not stdlib:
        try:
            from lmi.exact.fast import FastArithmetic
        except ImportError:
            pass
        else:
            return FastArithmetic()
    return Arithmetic()
