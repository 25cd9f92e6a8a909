"""How long a search may take: an instant that loops ask about, and that ends them."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from lmi.errors import OutOfTime

_until: ContextVar[float] = ContextVar("until", default=math.inf)
#: Seconds that no limit counts.
_uncounted = 0.0


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Let the searches and proofs inside take so long at most, and no longer than the limits around them.

    Parameters
    ----------
    seconds : float
        Of wall time; infinity for no limit.

    Returns
    -------
    context manager

    Raises
    ------
    OutOfTime
        Raised inside, at the next step of a search, once the time is over.

    Examples
    --------
    >>> try:
    ...     with time_limit(0):
    ...         lmi.diagonal_lyapunov(np.eye(50))
    ... except lmi.OutOfTime as error:
    ...     print(error)
    the time limit is reached
    """
    token = _until.set(min(_until.get(), _now() + seconds))
    try:
        yield
    finally:
        _until.reset(token)


@contextmanager
def share_of_time(share: float, name: str, cut_off: list[str]) -> Iterator[None]:
    """Give a part of the work a share of the time that is left, and note its name where that was not enough.

    Parameters
    ----------
    share : float
        Between 0 and 1.
    name : str
    cut_off : list of str
        To which the name is appended.

    Examples
    --------
    >>> from lmi.search_time import checkpoint
    >>> cut_off = []
    >>> with time_limit(0), share_of_time(0.5, "a search", cut_off):
    ...     checkpoint()
    >>> cut_off
    ['a search']
    """
    try:
        with time_limit(share * max(seconds_left(), 0.0)):
            yield
    except OutOfTime:
        cut_off.append(name)


@contextmanager
def uncounted() -> Iterator[None]:
    """Let the time inside count for no limit: that of loading a library, which is no part of a search.

    Examples
    --------
    >>> with time_limit(0.01):
    ...     with uncounted():
    ...         time.sleep(0.02)
    ...     checkpoint()
    """
    global _uncounted
    begin = time.monotonic()
    try:
        yield
    finally:
        _uncounted += time.monotonic() - begin


def _now() -> float:
    return time.monotonic() - _uncounted


def seconds_left() -> float:
    """Return how many seconds are left, infinity without a limit.

    Examples
    --------
    >>> seconds_left()
    inf
    """
    return _until.get() - _now()


def checkpoint() -> None:
    """Raise :class:`lmi.OutOfTime` if no time is left."""
    if seconds_left() <= 0:
        raise OutOfTime("the time limit is reached")
