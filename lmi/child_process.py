"""Work in a child process, which a time limit or Ctrl-C ends even where native code holds the interpreter."""

from __future__ import annotations

import contextlib
import ctypes
import math
import os
import pickle
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextvars import ContextVar
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

from lmi.errors import LMIError, OutOfTime
from lmi.search_time import begin_child, checkpoint, processor_left, seconds_left, take_over, work_counted

_ITEM, _ERROR, _END = range(3)
#: Whether another thread than the main one may copy its process: all others are idle, and hold nothing.
any_thread: ContextVar[bool] = ContextVar("any_thread", default=False)
#: PR_SET_PDEATHSIG of Linux.
_DEATH_SIGNAL = 1
#: Seconds between two looks at the processor time of a child.
_LOOK = 1.0

#: Whether this process is such a child.
forked = False


def apart(work: Callable[[], Iterable[Any]]) -> Iterator[Any]:
    """Yield what ``work()`` yields, computed in a child process.

    The child is a copy of this process, so that ``work`` may be any callable; what it yields is handed over by pickle.
    Where processes cannot be copied safely (elsewhere than on Linux, or in another thread than the main one) the work
    is done here, and the limit waits until native code returns.

    Parameters
    ----------
    work : callable
        Without arguments, returning an iterable.

    Yields
    ------
    object
        As soon as it is there: what came before a limit is kept.

    Raises
    ------
    OutOfTime
        The time limit is reached (:func:`lmi.time_limit`).
    LMIError
        The child died.
    Exception
        What ``work`` raised.

    Examples
    --------
    >>> list(apart(lambda: (n * n for n in range(3))))
    [0, 1, 4]
    """
    checkpoint()
    main = threading.current_thread() is threading.main_thread()
    if sys.platform != "linux" or not (main or any_thread.get()):
        yield from work()
        return
    here, there = Pipe(duplex=False)
    parent, left = os.getpid(), processor_left()
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # until either process is ready for it
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of threads, which a solver keeps: the child uses none
            child = os.fork()
    except OSError:  # no more processes
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        here.close()
        there.close()
        yield from work()
        return
    if child == 0:
        begin_child(left)
        _work(work, here, there, parent)
    try:
        there.close()
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        while True:
            kind, value, worked = _receive(here, child, left)
            take_over(worked)
            if kind == _END:
                return
            if kind == _ERROR:
                raise value
            yield value
    finally:
        here.close()
        with contextlib.suppress(ProcessLookupError, ChildProcessError):  # where children are not waited for
            os.kill(child, signal.SIGKILL)
            used = os.wait4(child, 0)[2]
            take_over(0.0, used.ru_utime + used.ru_stime)


def _work(work: Callable[[], Iterable[Any]], here: Connection, there: Connection, parent: int) -> None:
    """Do the work in the child, send what it yields, and leave without cleaning up what belongs to the parent."""
    global forked
    forked = True
    try:
        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)  # ends with the parent, however that ends
        if os.getppid() != parent:
            os._exit(0)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent is told, and ends the child
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        here.close()
        try:
            for value in work():
                there.send((_ITEM, value, work_counted()))
            there.send((_END, None, work_counted()))
        except BaseException as error:
            there.send((_ERROR, _portable(error), work_counted()))
    finally:
        os._exit(0)


def _portable(error: BaseException) -> BaseException:
    """Return an error that survives pickling."""
    try:
        return pickle.loads(pickle.dumps(error))  # noqa: S301  what was made here
    except Exception:
        return LMIError(f"{type(error).__name__}: {error}")


def _receive(here: Connection, child: int, left: float) -> Any:
    """Return what the child sent, as soon as it comes before the time limit."""
    checkpoint()
    while not here.poll(min(seconds_left(), 3600.0 if left == math.inf else _LOOK)):
        checkpoint()
        if left < math.inf and time.clock_gettime(~child << 3 | 2) > left:  # the clock of all threads of a process
            raise OutOfTime("the time limit is reached")
    try:
        return here.recv()
    except (EOFError, OSError):  # before or amid an item
        raise LMIError("its process ended without an answer") from None
