"""What a search fails by: told, not raised, so that other searches go on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from lmi.errors import LMIError, OutOfTime
from ptcc_certify.errors import HypothesisError


@contextmanager
def failures_told(notes: list[str], kind: str) -> Iterator[None]:
    """Leave the block where a search of a class fails, and tell the notes why; that time is out is raised.

    Examples
    --------
    >>> notes = []
    >>> with failures_told(notes, "full"):
    ...     raise LMIError("nothing was found")
    >>> notes
    ['class full: nothing was found']
    """
    try:
        yield
    except OutOfTime:
        raise
    except (LMIError, HypothesisError, np.linalg.LinAlgError) as error:
        notes.append(f"class {kind}: {error}")
