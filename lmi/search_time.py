"""How long a search may take: a limit of time or of work that loops ask about, and that ends them.

What is found near a limit of wall time depends on how busy the machine is. A limit of work does not: a step that takes
long tells by :func:`spend`, from sizes alone, what it will take, and is not begun where that is more than what is left.
Only where such an estimate is far too low, the processor time of the search ends it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple

from lmi.errors import OutOfTime

#: By what factor processor time may exceed a limit of work.
_PATIENCE = 5.0


class Clocks(NamedTuple):
    """Readings of three clocks, in seconds: time that went by, work that was counted, processor time of the search."""

    wall: float
    work: float
    processor: float


_NEVER = Clocks(math.inf, math.inf, math.inf)
_until: ContextVar[Clocks] = ContextVar("until", default=_NEVER)
#: Work that was counted, and processor time of child processes that ended.
_worked: ContextVar[float] = ContextVar("worked", default=0.0)
_children: ContextVar[float] = ContextVar("children", default=0.0)
#: Seconds that no limit counts.
_uncounted = 0.0


@contextmanager
def time_limit(seconds: float, *, work: bool = False) -> Iterator[None]:
    """Let the searches and proofs inside take so long at most, and no longer than the limits around them.

    Parameters
    ----------
    seconds : float
        Of wall time; infinity for no limit.
    work : bool
        Count work that takes so long on one core of a usual machine, instead of time: what is found then does not
        depend on how busy the machine is.

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
    now, forever = _clocks(), math.inf
    end = Clocks(forever, now.work + seconds, now.processor + _PATIENCE * seconds)
    if not work:
        end = Clocks(now.wall + seconds, forever, forever)
    with _ending(end):
        yield


@contextmanager
def part_of_time(share: float) -> Iterator[None]:
    """Give what is inside a share, between 0 and 1, of the time and work that are left.

    Examples
    --------
    >>> with time_limit(100), part_of_time(0.5):
    ...     seconds_left() <= 50
    True
    """
    pairs = zip(_until.get(), _clocks(), strict=True)
    with _ending(Clocks(*(now + share * max(until - now, 0.0) for until, now in pairs))):
        yield


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
        with part_of_time(share):
            yield
    except OutOfTime:
        cut_off.append(name)


@contextmanager
def uncounted() -> Iterator[None]:
    """Let the time inside count for no limit: that of loading a library, which is no part of a search.

    Examples
    --------
    >>> with time_limit(0.3):
    ...     with uncounted():
    ...         time.sleep(0.4)
    ...     checkpoint()
    """
    global _uncounted
    begin = time.monotonic()
    try:
        yield
    finally:
        _uncounted += time.monotonic() - begin


@contextmanager
def _ending(end: Clocks) -> Iterator[None]:
    token = _until.set(Clocks(*map(min, _until.get(), end)))
    try:
        yield
    finally:
        _until.reset(token)


def _now() -> float:
    return time.monotonic() - _uncounted


def _clocks() -> Clocks:
    return Clocks(_now(), _worked.get(), time.thread_time() + _children.get())


def seconds_left() -> float:
    """Return how many seconds are left, infinity without a limit of time.

    Examples
    --------
    >>> seconds_left()
    inf
    """
    return _until.get().wall - _now()


def processor_left() -> float:
    """Return how many seconds of processor time are left, infinity without a limit of work.

    Examples
    --------
    >>> with time_limit(1, work=True):
    ...     processor_left() > 1
    True
    """
    return _until.get().processor - _clocks().processor


def checkpoint() -> None:
    """Raise :class:`lmi.OutOfTime` if no time is left."""
    if any(until <= now for until, now in zip(_until.get(), _clocks(), strict=True)):
        raise OutOfTime("the time limit is reached")


def spend(seconds: float) -> None:
    """Count a step that takes about so long; raise :class:`lmi.OutOfTime` if that is more than the work that is left.

    Examples
    --------
    >>> with time_limit(1, work=True):
    ...     spend(0.7)
    ...     try:
    ...         spend(0.7)
    ...     except lmi.OutOfTime as error:
    ...         print(error)
    the time limit is reached
    """
    checkpoint()
    if seconds > _until.get().work - _worked.get():
        raise OutOfTime("the time limit is reached")
    _worked.set(_worked.get() + seconds)


def work_counted() -> float:
    """Return the work that was counted, which a child process hands over to its parent."""
    return _worked.get()


def take_over(work: float, processor: float = 0.0) -> None:
    """Take over what a child process has counted, and the processor time that it took until its end."""
    _worked.set(max(_worked.get(), work))
    _children.set(_children.get() + processor)


def begin_child(left: float) -> None:
    """Let the limits go on in a child process, whose processor time begins at 0, with so much of it left."""
    _until.set(_until.get()._replace(processor=left))
    _children.set(-time.thread_time())
