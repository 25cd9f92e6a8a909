"""Limits on the time that some work takes, by which no busy machine fails a test."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def at_most(seconds: float) -> Iterator[None]:
    """Let the work inside take so many seconds of this process: those of others do not count.

    A limit is several times what the work takes; what it shows is that nothing grows out of hand.
    """
    begin = time.process_time()
    yield
    spent = time.process_time() - begin
    assert spent < seconds, f"{spent:.2f} s of {seconds} s"
