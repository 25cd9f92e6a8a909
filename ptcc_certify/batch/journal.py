"""Rows as they come, kept beside the table that they will be, so that an interrupted batch goes on where it was.

A row is kept with the mark of its graph, not with its place: a list that has changed finds the rows of its graphs.
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Any

from ptcc_certify.batch.rows import COLUMNS, Row, package_version, printable
from ptcc_certify.batch.settings import Settings
from ptcc_certify.batch.sources import Source
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.rationals import shorten

#: What the first line of a journal begins with.
SCHEMA = "ptcc-batch/2"
#: Which values of a type can stand in a column of it.
_FITTING: dict[type, Callable[[Any], bool]] = {
    str: str.isprintable,
    float: math.isfinite,
    int: lambda x: abs(x) < 2**63,
    bool: lambda x: True,
}


def journal_path(path: Path) -> Path:
    """Return where the journal of a table is: beside it."""
    return path.with_name(f"{path.name}.journal")


class Journal:
    """Rows as they come, one JSON object per line, the first of which holds the settings; locked while it is open.

    A batch that is killed leaves whole lines and perhaps part of one, which is dropped. One that was refused before its
    first row leaves nothing.

    ``new`` tells whether there was none before.
    """

    def __init__(self, path: Path, chosen: Sequence[Source], settings: Settings, restart: bool):
        self.path, self.name, self._chosen = path, shorten(os.fspath(path), 200), chosen
        header = {"schema": SCHEMA, "version": package_version(), **settings.to_dict()}
        self._file = _opened_alone(path, self.name)
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
        for key, wanted in header.items():
            if before.get(key) != wanted:
                old, new = (shorten(json.dumps(x), 60) for x in (before.get(key), wanted))
                raise ParameterError(f"{self.name}: was begun with {key} {old}, not {new}; {mend}")
        for number, line in enumerate(lines, start=2):
            entry = _entry(line)
            if not _intact(entry):
                raise ParameterError(f"{self.name}, line {number}: is no row; begin again with --restart")
            self._rows[entry["of"]] = entry["row"]

    def current(self) -> dict[int, Row]:
        """Return the rows of the graphs of the list, by their numbers in it; files must be what they were."""
        files = {mark.rpartition(" ")[0] for mark in self._rows}
        found = {}
        for number, source in enumerate(self._chosen):
            if source.mark or source.named in files:
                row = self._rows.get(source.mark or source.task(number).mark)
                if row is not None:  # under another name, perhaps
                    found[number] = row | {"graph": printable(source.name)}
        return found

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


def _opened_alone(path: Path, name: str) -> IO[bytes]:
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
