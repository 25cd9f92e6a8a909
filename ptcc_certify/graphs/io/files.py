"""Files as bytes and as text: opened and unpacked within limits, decoded strictly, written whole or not at all."""

from __future__ import annotations

import gzip
import os
import re
import secrets
import shutil
import sys
import tomllib
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import IO, Any

from ptcc_certify.errors import FormatError, PTCCError
from ptcc_certify.graphs.io.packaged import GRAPHS
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.size_limits import MAX_BYTES, MAX_LINE

#: A key or a header of 32 parts, for which tomllib takes the square of their number.
_DEEP = re.compile(r"""(?<![\w\\-])(?:(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){32}""")
Source = str | os.PathLike[str] | IO[str] | IO[bytes]


def name_and_ending(path: Source) -> tuple[str, str]:
    """Return the name for messages and the lower-case ending without dot, .gz left aside."""
    text = os.fspath(path) if isinstance(path, str | os.PathLike) else getattr(path, "name", None)
    if not isinstance(text, str) or text == "-":
        return "standard input" if text == "-" else "input", ""
    return shorten(text, 200), Path(re.sub(r"\.gz(ip)?$", "", text.lower())).suffix[1:]


def refuse_no_path(path: object) -> None:
    """Refuse what names no file.

    Examples
    --------
    >>> refuse_no_path(5)
    Traceback (most recent call last):
    ptcc_certify.errors.FormatError: 5 names no file; give a path
    """
    if not isinstance(path, str | os.PathLike) or not Path(path).name:
        raise FormatError(f"{shorten(repr(path))} names no file; give a path")


def read_bytes(path: Source, name: str) -> bytes:
    """Read a path, standard input (``-``) or a file object, and undo gzip; text becomes UTF-8."""
    if not isinstance(path, str | os.PathLike) and not callable(getattr(path, "read", None)):
        raise FormatError(f"a {type(path).__name__} is no file; ptcc_certify.as_graph takes other data")
    file = getattr(sys.stdin, "buffer", sys.stdin) if isinstance(path, str) and path == "-" else path
    try:
        if isinstance(file, str | os.PathLike):
            with Path(file).open("rb") as opened:
                data: bytes | str = opened.read(MAX_BYTES + 1)
        else:
            data = file.read(MAX_BYTES + 1)
        content = data.encode("utf-8") if isinstance(data, str) else bytes(data)
    except FileNotFoundError:
        mend = "ptcc_certify.as_graph takes the packaged graph" if name in GRAPHS else "check the path"
        raise FormatError(f"{name}: no such file; {mend}") from None
    except (AttributeError, OSError, TypeError, ValueError) as error:
        raise FormatError(f"{name}: cannot be read ({_reason(error)}); name a file") from None
    refuse_large(len(content), name)
    if content.startswith(b"\x1f\x8b"):
        with one_line_errors(name, "a gzip file"), gzip.GzipFile(fileobj=BytesIO(content)) as packed:
            content = packed.read(MAX_BYTES + 1)
        refuse_large(len(content), name)
    elif content and isinstance(file, str | os.PathLike) and name.lower().endswith(".gz"):
        raise FormatError(f"{name}: not a gzip file; rename it without .gz, or fetch it again")
    return content


def refuse_large(size: int, name: str) -> None:
    """Refuse a file that is, or unpacks to, more than ``MAX_BYTES``."""
    if size > MAX_BYTES:
        raise FormatError(f"{name}: more than {MAX_BYTES} bytes, unpacked; split the file")


def decoded(data: bytes, name: str) -> str:
    """Decode UTF-8; refuse anything else, and NUL, by line."""
    if (at := data.find(b"\0")) < 0:
        try:
            return data.decode("utf-8").removeprefix("\ufeff")
        except UnicodeDecodeError as error:
            at = error.start
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise FormatError(f"{name}, line 1: UTF-16 text; save the file as UTF-8 (a spreadsheet: CSV UTF-8)")
    line = data.count(b"\n", 0, at) + 1
    raise FormatError(f"{name}, line {line}: byte 0x{data[at]:02x} is not UTF-8 text; save the file as UTF-8")


def lines_of(data: bytes, name: str) -> list[str]:
    r"""Decode UTF-8 and split at ``\n`` (at ``\r`` in files without ``\n``); a ``\r`` before ``\n`` stays."""
    text = decoded(data, name).replace("\n\ufeff", "\n")  # of files that were put one behind the other
    lines = text.split("\n") if "\n" in text else text.split("\r")
    if len(longest := max(lines, key=len)) > MAX_LINE:
        place, mend = f"{name}, line {lines.index(longest) + 1}", "break it, or name the format of the file"
        raise FormatError(f"{place}: longer than {MAX_LINE} characters; {mend}")
    return lines


def _reason(error: BaseException) -> str:
    """Return what an exception says, on one line."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror.lower()
    return shorten(" ".join(str(error).split()), 160) or type(error).__name__


def parse_toml(data: bytes, name: str, number: Callable[[str], Any]) -> dict[str, Any]:
    """Read TOML whose decimals become ``number(text)``, exactly, as in every other input.

    Raises
    ------
    FormatError
        It is none, nests too deep, or has a name of more than 32 parts.

    Examples
    --------
    >>> parse_toml(b"T = 1_000.5", "a.toml", str)
    {'T': '1000.5'}
    """
    try:
        text = data.decode("utf-8").removeprefix("\ufeff")
        if _DEEP.search(text):
            raise ValueError("a name of more than 32 parts")
        return tomllib.loads(text, parse_float=lambda digits: number(digits.replace("_", "")))
    except (ValueError, RecursionError) as error:  # of the text, of TOML, or of a number
        reason = shorten(" ".join(str(error).split()), 160)
        raise FormatError(f"{name}: no TOML that can be read ({reason})") from None


@contextmanager
def one_line_errors(name: str, what: str) -> Iterator[None]:
    """Turn whatever a library raises into one line, and silence its warnings."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except PTCCError:
        raise
    except Exception as error:
        raise FormatError(f"{name}: not {what} that can be read ({_reason(error)}); write it again") from None


def write_atomically(path: str | os.PathLike[str], data: bytes | str) -> None:
    """Write a file that appears whole or not at all.

    The data go to a new file in the same folder, which then takes the place of ``path`` in one step. Links are
    followed, the permissions of an existing file are kept, and what is no regular file (a pipe, ``/dev/stdout``) is
    written to as it is.

    Parameters
    ----------
    path : str or Path
    data : bytes or str
        Text is written as UTF-8.

    Raises
    ------
    FormatError
        The folder is missing or closed, or ``path`` is a directory. Nothing is left behind.

    Examples
    --------
    >>> with TemporaryDirectory() as folder:
    ...     write_atomically(Path(folder, "a.txt"), "whole")
    ...     [file.name for file in Path(folder).iterdir()]
    ['a.txt']
    """
    name = shorten(os.fspath(path), 200)
    try:
        content = data.encode("utf-8") if isinstance(data, str) else data
        if os.path.exists(path) and not os.path.isfile(path):  # noqa: PTH110, PTH113 - of a pipe the real path is none
            Path(path).write_bytes(content)
            return
        target = Path(os.path.realpath(path))
        temporary = target.with_name(f".{target.name[:100]}.{secrets.token_hex(6)}.tmp")
        try:
            with temporary.open("xb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            if target.exists():
                shutil.copymode(target, temporary)
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
    except FileNotFoundError:
        raise FormatError(f"{name}: the folder does not exist; make it first") from None
    except (OSError, ValueError) as error:
        raise FormatError(f"{name}: cannot be written ({_reason(error)})") from None
