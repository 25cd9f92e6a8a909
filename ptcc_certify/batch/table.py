"""The table as a file, CSV or Parquet; a file that it cannot, or should not, become is refused before the work."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ptcc_certify.batch.rows import COLUMNS, Row
from ptcc_certify.batch.settings import INSTALL
from ptcc_certify.batch.sources import Source
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.rationals import shorten

#: Endings of a table's name.
TABLES = (".csv", ".parquet")


def table_bytes(rows: Sequence[Row], suffix: str) -> bytes:
    """Return a table as CSV or Parquet; an empty entry is an empty field, or null.

    Texts are written as they are: a spreadsheet takes one that begins with ``=`` for a formula, unless it is told to
    import texts.

    Parameters
    ----------
    rows : sequence of dict
        From :func:`ptcc_certify.certify_many`.
    suffix : {".csv", ".parquet"}

    Returns
    -------
    bytes

    Raises
    ------
    ParameterError
        Parquet is asked for, and pyarrow is not installed.

    Examples
    --------
    >>> table_bytes([], ".csv")[:18]
    b'graph,sha256,nodes'
    """
    if suffix == ".parquet":
        pa, parquet = _pyarrow()
        kinds = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
        schema = pa.schema([(name, kinds[kind]) for name, kind in COLUMNS.items()])
        sink = pa.BufferOutputStream()
        parquet.write_table(pa.Table.from_pylist(list(rows), schema=schema), sink)
        return sink.getvalue().to_pybytes()
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([_field(row[name]) for name in COLUMNS] for row in rows)
    return text.getvalue().encode("utf-8")


def _field(value: Any) -> str:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise ParameterError(f"Parquet needs pyarrow; {INSTALL}, or name a .csv file") from None
    return pyarrow, parquet


def refuse_table(path: Path, chosen: Sequence[Source], replace: bool) -> None:
    """Refuse before the work what could not, or should not, be written after it."""
    name = shorten(os.fspath(path), 200)
    if path.suffix.lower() not in TABLES:
        raise ParameterError(f"{name}: tables are written to {' and '.join(TABLES)}; let the name end in one of these")
    if path.suffix.lower() == ".parquet":
        _pyarrow()
    if not path.parent.is_dir():
        raise ParameterError(f"{name}: the folder does not exist; make it first")
    if path.is_dir():
        raise ParameterError(f"{name}: is a folder; name a file")
    if path.exists() and not path.is_file():
        raise ParameterError(f"{name}: is no regular file; name another file")
    if any(isinstance(s.origin, str) and os.path.realpath(s.origin) == os.path.realpath(path) for s in chosen):
        raise ParameterError(f"{name}: is one of the graphs; name another file")
    if path.exists() and not _is_table(path):
        raise ParameterError(f"{name}: is there already, and no table of ptcc batch; name another file")
    if path.exists() and not replace:
        raise ParameterError(f"{name}: is there already; name another file, or replace it with --restart")


def _is_table(path: Path) -> bool:
    if path.suffix.lower() == ".parquet":
        try:
            return list(_pyarrow()[1].read_schema(path).names) == list(COLUMNS)
        except (OSError, ValueError):
            return False
    header = table_bytes([], ".csv")
    with path.open("rb") as file:
        return file.read(len(header)) == header
