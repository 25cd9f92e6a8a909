"""Runs that a signal stops: CasADi turns what a signal handler raises into a failure of CVODES, or loses it."""

from __future__ import annotations

import contextlib
import io
import math
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from lmi.search_time import checkpoint, processor_left, seconds_left


@contextmanager
def interruptible() -> Iterator[None]:
    """Let what a signal handler raises (KeyboardInterrupt, and OutOfTime at the time limit) pass.

    CasADi looks for signals while it computes; where there are no timers, or in another thread than the main one, the
    limit waits until it ends.
    """
    checkpoint()
    previous = signal.getsignal(signal.SIGINT)
    if not callable(previous) or threading.current_thread() is not threading.main_thread():
        yield
        checkpoint()
        return
    errors: list[BaseException] = []

    def record(act: Callable[[int, Any], Any]) -> Callable[[int, Any], None]:
        def handler(number: int, frame: Any) -> None:
            try:
                act(number, frame)
            except BaseException as error:
                signal.signal(signal.SIGINT, previous)  # it may come before the try below, or in its finally
                errors.append(error)
                raise

        return handler

    signal.signal(signal.SIGINT, record(previous))
    messages = io.StringIO()  # CasADi tells in words of its own that it was interrupted
    try:
        with contextlib.redirect_stderr(messages), _alarm(record(lambda *_: checkpoint())):
            yield
    except Exception:
        if errors:
            raise errors[0] from None
        raise
    else:
        if errors:
            raise errors[0]
    finally:
        signal.signal(signal.SIGINT, previous)
        if not errors and messages.getvalue():
            sys.stderr.write(messages.getvalue())


@contextmanager
def _alarm(handler: Callable[[int, Any], None]) -> Iterator[None]:
    """Call the handler when the limit of time or processor time is reached, where nobody else has set this timer."""
    if not hasattr(signal, "setitimer"):
        yield
        return
    limit, timer, number = seconds_left(), signal.ITIMER_REAL, signal.SIGALRM
    if not math.isfinite(limit):
        limit, timer, number = processor_left(), signal.ITIMER_PROF, signal.SIGPROF
    if not math.isfinite(limit) or signal.getitimer(timer)[0]:
        yield
        return
    previous = signal.signal(number, handler)
    signal.setitimer(timer, max(limit, 1e-3) + 1e-3)
    try:
        yield
    finally:
        signal.setitimer(timer, 0.0)
        signal.signal(number, previous)
