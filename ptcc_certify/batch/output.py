"""The table as a file, CSV or Parquet, and beside it the rows as they come, so that an interrupted batch goes on.

What a table cannot, or should not, replace is refused before the work. A row is kept with the mark of its graph, not
with its place: a list that has changed finds the rows of its graphs.
"""

from __future__ import annotations

import csv
import io
import json
import math
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from ptcc_certify.batch.rows import COLUMNS, Row, package_version, printable
from ptcc_certify.batch.sources import INSTALL, Settings, Source
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.labels import import_pandas
from ptcc_certify.graphs.rationals import shorten

if TYPE_CHECKING:
    import pandas as pd

#: Endings of a table's name.
TABLES = (".csv", ".parquet")
#: What the first line of a journal begins with.
SCHEMA = "ptcc-batch/2"
#: Which values of a type can stand in a column of it.
_FITTING: dict[type, Callable[[Any], bool]] = {
    str: str.isprintable,
    float: math.isfinite,
    int: lambda x: abs(x) < 2**63,
    bool: lambda x: True,
}


class Table(list[Row]):
    """The rows of many graphs, one dictionary for each."""

    def to_pandas(self) -> pd.DataFrame:
        """Return the rows as a DataFrame whose types depend on no row: texts, ``Int64``, ``Float64``, ``boolean``.

        An empty entry is ``pandas.NA``.

        Raises
        ------
        ParameterError
            pandas is not installed.

        Examples
        --------
        >>> Table().to_pandas().dtypes["nodes"]
        Int64Dtype()
        """
        kinds = {str: "string", int: "Int64", float: "Float64", bool: "boolean"}
        table = import_pandas().DataFrame(list(self), columns=list(COLUMNS), dtype=object)
        return table.astype({name: kinds[kind] for name, kind in COLUMNS.items()})


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


def refuse_table(path: Path, selection: Sequence[Source], replace: bool) -> None:
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
    if any(isinstance(s.origin, str) and os.path.realpath(s.origin) == os.path.realpath(path) for s in selection):
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


# ---------------------------------------------------------------------- rows as they come


def journal_path(path: Path) -> Path:
    """Return where the journal of a table is: beside it."""
    return path.with_name(f"{path.name}.journal")


class Journal:
    """Rows as they come, one JSON object per line, the first of which holds the settings; locked while it is open.

    A batch that is killed leaves whole lines and perhaps part of one, which is dropped. One that was refused before its
    first row leaves nothing.

    ``new`` tells whether there was none before.
    """

    def __init__(self, path: Path, selection: Sequence[Source], settings: Settings, restart: bool):
        self.path, self._selection = path, selection
        self.name = shorten(os.fspath(path), 200)
        header = {"schema": SCHEMA, "version": package_version(), **settings.to_dict()}
        self._file = _open_alone(path, self.name)
        self._rows: dict[str, Row] = {}
        try:
            self._read(header, restart)
        except BaseException:
            self._file.close()
            raise

    def _read(self, header: dict[str, Any], restart: bool) -> None:
        data = self._file.read()
        self.new = not data
        mark = b'{"schema": "ptcc-batch/'  # how the first line begins, of which a part may be missing
        if data[: len(mark)] != mark[: len(data)]:
            raise ParameterError(f"{self.name}: is no journal of ptcc batch; name another -o")
        whole = 0 if restart else data.rfind(b"\n") + 1
        self._file.seek(whole)
        self._file.truncate()
        if not whole:
            self._write(header)
            return
        first, *lines = data[:whole].split(b"\n")[:-1]
        before = _entry(first)
        mend = "go on with that, name another -o, or drop the journal with --restart"
        for key, value in header.items():
            if before.get(key) != value:
                old, new = (shorten(json.dumps(x), 60) for x in (before.get(key), value))
                raise ParameterError(f"{self.name}: was begun with {key} {old}, not {new}; {mend}")
        for number, line in enumerate(lines, start=2):
            entry = _entry(line)
            if not _intact(entry):
                raise ParameterError(f"{self.name}, line {number}: is no row; begin again with --restart")
            self._rows[entry["of"]] = entry["row"]

    def current(self) -> dict[int, Row]:
        """Return the rows of the graphs of the list, by their numbers in it; files must be what they were."""
        files = {mark.rpartition(" ")[0] for mark in self._rows}
        rows = {}
        for number, source in enumerate(self._selection):
            if source.mark or source.named in files:
                row = self._rows.get(source.mark or source.task(number).mark)
                if row is not None:  # under another name, perhaps
                    rows[number] = row | {"graph": printable(source.name)}
        return rows

    def append(self, mark: str, row: Row) -> None:
        """Keep a row of the graph of this mark."""
        self._rows[mark] = row
        self._write({"of": mark, "row": row})

    def _write(self, entry: dict[str, Any]) -> None:
        self._file.write(json.dumps(entry, allow_nan=False).encode() + b"\n")
        self._file.flush()

    def remove(self) -> None:
        """Delete the journal, whose rows are in the table."""
        if os.name == "nt":  # where an open file cannot be deleted
            self._file.close()
        self.path.unlink(missing_ok=True)

    def close(self) -> None:
        """Release the journal, and delete it if it keeps no row."""
        if not self._rows:
            self.remove()
        self._file.close()


def _entry(line: bytes) -> dict[str, Any]:
    """Return the object of a line; an empty one of a line that is none."""
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError):
        return {}
    return entry if isinstance(entry, dict) else {}


def _intact(entry: dict[str, Any]) -> bool:
    """Tell whether an entry is one that a batch wrote: somebody may have edited it."""
    row = entry.get("row")
    return (
        set(entry) == {"of", "row"}
        and type(entry["of"]) is str
        and type(row) is dict
        and list(row) == list(COLUMNS)
        and row["graph"] is not None
        and all(value is None or _fits(value, COLUMNS[name]) for name, value in row.items())
    )


def _fits(value: Any, kind: type) -> bool:
    """Tell whether an entry can stand in a column; a truth value is no integer."""
    return type(value) is kind and _FITTING[kind](value)


def _open_alone(path: Path, name: str) -> IO[bytes]:
    """Open a file to be read and continued, and lock it; the lock ends with the process, however that ends."""
    for _ in range(10):
        try:
            if path.exists() and not path.is_file():
                raise ParameterError(f"{name}: is no regular file; remove what is there, or name another -o")
            file = path.open("a+b")
        except OSError as error:
            raise ParameterError(f"{name}: cannot be written ({error.strerror})") from None
        try:
            _lock(file)
        except BlockingIOError:
            file.close()
            raise ParameterError(f"{name}: another process is at work on it; wait for it, or name another -o") from None
        if path.exists() and os.path.samestat(os.fstat(file.fileno()), path.stat()):
            file.seek(0)
            return file
        file.close()  # the other process finished in between
    raise ParameterError(f"{name}: cannot be opened; remove what is there, or name another -o")


def _lock(file: IO[bytes]) -> None:
    if sys.platform == "win32":
        import msvcrt

        file.seek(2**40)  # a byte beyond all content: a locked one could not be read
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            raise BlockingIOError from None
        return
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:  # some network file systems know no locks
        if isinstance(error, BlockingIOError):
            raise
