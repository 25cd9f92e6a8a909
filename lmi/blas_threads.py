"""One thread of BLAS for small matrices: more take longer, many times on a busy machine, and round differently."""

from __future__ import annotations

import contextlib
import functools
import threading
from collections.abc import Iterator
from typing import Any

_lock, _inside = threading.Lock(), [0]
_limits: list[Any] = []


@functools.cache
def _loaded() -> Any:
    """Return what limits the libraries that are loaded, which takes milliseconds to find."""
    import scipy.linalg  # noqa: F401  which brings a BLAS of its own
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@contextlib.contextmanager
def one_thread(wanted: bool = True) -> Iterator[None]:
    """Let BLAS use one thread inside; what it used before comes back when the last thread of Python leaves.

    Parameters
    ----------
    wanted : bool
        False changes nothing, for large matrices.

    Examples
    --------
    >>> with one_thread():
    ...     (np.eye(3) @ np.eye(3)).trace()
    np.float64(3.0)
    """
    if not wanted:
        yield
        return
    with _lock:
        _inside[0] += 1
        if _inside[0] == 1:
            _limits.append(_loaded().limit(limits=1, user_api="blas"))
    try:
        yield
    finally:
        with _lock:
            _inside[0] -= 1
            if not _inside[0]:
                _limits.pop().restore_original_limits()
