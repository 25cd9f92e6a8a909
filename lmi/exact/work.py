"""Limits of work and memory, so that numbers of any length are answered in bounded time and space.

Whoever is about to multiply long integers, or to keep many, tells how many and how long; beyond the limits it is
refused before anything is formed. The count depends on the sizes alone: the same file is refused on every machine, or
on none. Limits grow in proportion to a memory that is allowed, in GB.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from fractions import Fraction

#: Bytes of a GB.
GB = 1_000_000_000
#: What may be spent for each byte, in products of two digits of 30 bits: some seconds for a GB.
EACH_BYTE = 10
#: What a product of short integers costs beside its digits.
EACH = 60
#: Digits from which on products cost less than the square, by Karatsuba's method.
LONG = 70


class WorkError(ArithmeticError):
    """Work or memory would exceed the limit; the message says what was about to be done."""


class Account:
    """What is allowed, and what is counted so far.

    Attributes
    ----------
    allowed : int
        Bytes that are allowed.
    work : int
        Work that is done, in the unit of :func:`cost`.
    largest : int
        Bytes for which all sizes so far would have been allowed.
    permanent : int
        Bytes of what stays to the end.
    """

    def __init__(self, memory: float):
        self.allowed = int(Fraction(memory) * GB)
        self.work, self.largest, self.permanent = 0, 0, 0

    @property
    def needed(self) -> Fraction:
        """GB for which all that was counted so far would have been allowed."""
        return Fraction(max(self.largest, -(-self.work // EACH_BYTE)), GB)


_account: ContextVar[Account | None] = ContextVar("account", default=None)


def cost(products: int, a: int = 0, b: int = 0) -> int:
    """Return what products of integers of ``a`` and ``b`` bits cost.

    Parameters
    ----------
    products : int
        How many.
    a, b : int
        Their bits.

    Returns
    -------
    int
        In products of two digits of 30 bits, about a nanosecond each.

    Examples
    --------
    >>> cost(1), cost(10, 300, 300)
    (61, 1810)
    """
    short, long = sorted((a // 30 + 1, b // 30 + 1))
    if short <= LONG:
        return products * (EACH + short * long)
    # long * LONG * (short / LONG)^0.585, linear between doublings of the shorter one, each of which costs half more
    k = (short // LONG).bit_length() - 1
    return products * (EACH + (long * 3**k * ((LONG << k) + short) >> (2 * k + 1)))


def spend(products: int, a: int = 0, b: int = 0, what: str = "exact arithmetic") -> None:
    """Count products of integers of ``a`` and ``b`` bits; nothing is counted outside of :func:`limited`.

    Parameters
    ----------
    products, a, b : int
        See :func:`cost`.
    what : str
        What they are for.

    Raises
    ------
    WorkError
        Together with all that was counted they exceed the limit.

    Examples
    --------
    >>> with limited(1e-7):
    ...     spend(10, 300, 300, "a product of long matrices")
    Traceback (most recent call last):
    ...
    lmi.exact.work.WorkError: a product of long matrices would take too long
    """
    if (account := _account.get()) is not None:
        account.work += cost(products, a, b)
        if account.work > EACH_BYTE * account.allowed:
            raise WorkError(f"{what} would take too long")


def fits(size: int, limit: int) -> bool:
    """Tell whether something is within a limit for each GB that is allowed; 1 GB outside of :func:`limited`.

    Examples
    --------
    >>> fits(2, 1)
    False
    >>> with limited(2):
    ...     fits(2, 1)
    True
    """
    account = _account.get()
    if account is None:
        return size <= limit
    share = -(-size * GB // limit)
    account.largest = max(account.largest, share)
    return share <= account.allowed


def keeps(size: int) -> bool:
    """Tell whether so many bytes more may stay to the end, and count them.

    Examples
    --------
    >>> with limited(1):
    ...     keeps(6 * 10**8), keeps(6 * 10**8)
    (True, False)
    """
    if (account := _account.get()) is None:
        return True
    account.permanent += size
    return fits(account.permanent, GB)


@contextmanager
def limited(memory: float = 1) -> Iterator[Account]:
    """Limit what is spent inside.

    Parameters
    ----------
    memory : float
        GB, for each of which some seconds of work are allowed too.

    Raises
    ------
    ValueError
        Not positive.
    """
    if not 0 < memory < GB:  # nor nan, nor infinite
        raise ValueError("the memory is not a positive number of GB")
    account = Account(memory)
    token, collects = _account.set(account), gc.isenabled()
    gc.disable()  # many small tuples and no cycles: looking for some would take a quarter of the time
    try:
        yield account
    finally:
        _account.reset(token)
        if collects:
            gc.enable()
