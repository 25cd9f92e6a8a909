"""Tables for pandas, which is optional: imported here, and named where it is missing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ptcc_certify.errors import ParameterError

if TYPE_CHECKING:
    import pandas as pd


def import_pandas() -> Any:
    """Return the package pandas.

    Raises
    ------
    ParameterError
        It is not installed.
    """
    try:
        import pandas
    except ImportError:
        raise ParameterError('this needs pandas; install it with: pip install "pandas>=2.2"') from None
    return pandas


def series(entries: Any, labels: Any, name: str) -> pd.Series:
    """Return one entry for each label.

    Examples
    --------
    >>> series([1.0, 2.0], ["a", "b"], "x").to_dict()
    {'a': 1.0, 'b': 2.0}
    """
    pandas = import_pandas()
    return pandas.Series(entries, index=pandas.Index(labels, name="node"), name=name)
