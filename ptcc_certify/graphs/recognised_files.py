"""What a file is, told from its first bytes, so that the wrong kind of thing is refused with what to do with it."""

from __future__ import annotations

import os
import re
import shlex
from difflib import get_close_matches
from itertools import islice
from pathlib import Path

from ptcc_certify.errors import FormatError, did_you_mean
from ptcc_certify.graphs.rationals import shorten

#: Bytes that are looked at.
FIRST = 4096
_SIGNATURES = {
    b"%PDF": "a PDF",
    b"\x89PNG": "an image",
    b"\xff\xd8\xff": "an image",
    b"GIF8": "an image",
    b"<svg": "an image",
    b"<!doctype html": "a page",
    b"<html": "a page",
    b"PK\x03\x04": "a zip archive",
    b"PK\x05\x06": "a zip archive",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook",
    b"RDX2": "R data",
    b"RDX3": "R data",
    b"RDA": "R data",
    b"X\n\0\0\0": "R data",
    b"\x89HDF": "HDF5",
    b"PAR1": "Parquet",
    b"ARROW1": "Feather (Arrow)",
    b"FEA1": "Feather (Arrow)",
    **{b"\x80" + bytes([version]): "a pickle" for version in range(2, 6)},
    b"SQLite format 3": "an SQLite database",
    b"<stata_dta>": "Stata data",
    b"$FL2": "SPSS data",
    b"BZh": "packed by bzip2",
    b"\xfd7zXZ": "packed by xz",
    b"\x28\xb5\x2f\xfd": "packed by zstd",
    b"7z\xbc\xaf": "packed by 7-Zip",
    b"Rar!": "packed by RAR",
    b"version https://git-lfs": "a pointer of Git LFS",
}
#: What in a zip archive says what it is.
_ARCHIVES = {
    b"xl/": "an Excel workbook",
    b"word/": "a Word document",
    b"mimetypeapplication/vnd.oasis": "an OpenDocument file",
}
#: What is to be done with what is no graph.
_MENDS = {
    **dict.fromkeys(
        ("an Excel workbook", "an old Excel workbook", "an OpenDocument file"), "save the sheet as CSV UTF-8"
    ),
    "a zip archive": "unpack it, or save a spreadsheet as CSV",
    "R data": "write it with write.csv(edges, FILE, row.names = FALSE)",
    "Graphviz DOT": "save it as GraphML or GML",
    "HDF5": "save the matrix as .npy or .mtx, in MATLAB with save(FILE, 'W', '-v7')",
    "Parquet": "in Python as_graph(pandas.read_parquet(FILE)), or save it as CSV",
    "Feather (Arrow)": "in Python as_graph(pandas.read_feather(FILE)), or save it as CSV",
    "a pickle": "a pickle may run code, so it is not read; save the graph as GraphML, or the matrix as .npy",
    "a page": "fetch the file itself, not the page that offers it",
    "a pointer of Git LFS": "fetch the file itself: git lfs pull",
    **dict.fromkeys(("an SQLite database", "Stata data", "SPSS data"), "save the table as CSV"),
    **{f"packed by {how}": "unpack it, or pack it with gzip" for how in ("bzip2", "xz", "zstd", "7-Zip", "RAR")},
}
#: What graphs are kept in that begins like an archive.
_PACKED = ("npz",)
#: What is read once, and not here.
PIPE = "a pipe"
#: What a TOML file is.
TOML = ("a scenario", "TOML")


def kind_of(path: str) -> str:
    """Return what a path is.

    Returns
    -------
    str
        "missing", "a folder", "a pipe" (standard input, too), "empty", "a certificate", "a notebook", "JSON", "a PDF",
        "an Excel workbook" and others by their first bytes, "a scenario", "TOML" of another kind, and "" for all else,
        as graphs are; JSON may be one, too.

    Examples
    --------
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, "c.json")
    ...     _ = file.write_text('{"schema": "ptcc-certificate/3"}')
    ...     kind_of(str(file)), kind_of(folder), kind_of(f"{folder}/d.json")
    ('a certificate', 'a folder', 'missing')
    """
    if path == "-":
        return PIPE
    if os.path.isdir(path):  # noqa: PTH112 - Path.is_dir may raise
        return "a folder"
    if not os.path.exists(path):  # noqa: PTH110
        return "missing"
    if not os.path.isfile(path):  # noqa: PTH113
        return PIPE
    try:
        with Path(path).open("rb") as file:
            first = file.read(FIRST)
    except OSError:
        return ""  # whoever reads it tells why it cannot be
    return kind_of_content(first, Path(path).suffix[1:].lower()) if first else "empty"


def kind_of_content(first: bytes, ending: str) -> str:
    """Return what a content is, told from its first bytes and the ending of its name, without a dot.

    Examples
    --------
    >>> kind_of_content(b'{"schema": "ptcc-certificate/3"}', ""), kind_of_content(b"a,b,1", "csv")
    ('a certificate', '')
    """
    if ending in ("toml", "") and re.search(rb"^\s*\[graph\]\s*(#.*)?$", first, re.MULTILINE):
        return TOML[0]
    if ending == "toml":
        return TOML[1]
    start = first.removeprefix(b"\xef\xbb\xbf").lstrip()
    for signature, kind in _SIGNATURES.items():
        if start[: len(signature)].lower() == signature.lower() and not (kind == "a zip archive" and ending in _PACKED):
            inside = (what for mark, what in _ARCHIVES.items() if mark in first)
            return next(inside, kind) if kind == "a zip archive" else kind
    if b"<svg" in start.lower() and start.startswith(b"<?xml"):
        return "an image"
    if re.match(rb"(strict\s+)?(di)?graph\b[^\[\n]*\{", start):
        return "Graphviz DOT"
    if start.startswith((b"{", b"[")):
        return _kind_of_json(start, ending)
    return ""


def _kind_of_json(start: bytes, ending: str) -> str:
    if b'"ptcc-certificate/' in start:
        return "a certificate"
    if ending == "ipynb" or b'"cell_type"' in start:
        return "a notebook"
    return "JSON" if ending == "json" or re.match(rb'\{\s*["}]', start) else ""


def refuse_as_graph(path: str) -> None:
    """Refuse a path that leads to no graph.

    Raises
    ------
    FormatError
        Tells what the file is and what to do with it.
    """
    from ptcc_certify.graphs.io.packaged import GRAPHS

    name, kind = shorten(path, 200) or '""', kind_of(path)
    if kind == "missing":
        raise FormatError(f"{name}: no such file; check the path{near_files(path, GRAPHS)}")
    if kind == "empty":
        raise FormatError(f"{name}: is empty: no edge and no node in this file; give rows source,target,weight")
    _refuse_kind_as_graph(kind, name, path)


def refuse_content_as_graph(content: bytes, name: str, ending: str, path: object) -> None:
    """Refuse what was read of ``path`` and is no graph; ``name`` is that of messages.

    Examples
    --------
    >>> refuse_content_as_graph(b'{"schema": "ptcc-certificate/3"}', "standard input", "", "-")
    Traceback (most recent call last):
    ptcc_certify.errors.FormatError: standard input: is a certificate, not a graph; ptcc check - checks it, ...
    """
    _refuse_kind_as_graph(kind_of_content(content[:FIRST], ending), name, path)


def _refuse_kind_as_graph(kind: str, name: str, path: object) -> None:
    text = os.fspath(path) if isinstance(path, str | os.PathLike) else "FILE"
    word = shell_word(text)
    mend = "write rows source,target,weight"
    mends = {
        "a folder": f"name a file in it, or all: ptcc batch {shell_word(str(Path(text, '*.csv')))}",
        "a certificate": f"ptcc check {word} checks it, ptcc report {word} -o page.html shows it; in Python "
        "read_certificate(path)",
        "a scenario": f"ptcc certify {word} runs it"
        if text.endswith(".toml")
        else "save it as .toml: ptcc certify FILE.toml runs it",
    }
    if kind not in ("", PIPE, "JSON"):
        raise FormatError(f"{name}: is {kind}, not a graph; {(_MENDS | mends).get(kind, mend)}")


def refuse_as_certificate(path: str, before_graph: bool = False, content: bytes | None = None) -> None:
    """Refuse what is no certificate; ``before_graph``, where a graph may follow it.

    Parameters
    ----------
    path : str
        ``"-"`` is standard input.
    before_graph : bool
        A graph may follow the certificate.
    content : bytes, optional
        What was read of a pipe; without it, pipes are not refused.

    Raises
    ------
    FormatError
        Tells what the file is and which command makes a certificate.
    """
    from ptcc_certify.graphs.io.packaged import GRAPHS

    name, kind = "standard input" if path == "-" else shorten(path, 200), kind_of(path)
    if kind == PIPE and content is not None:
        kind = kind_of_content(content[:FIRST], "") if content else "empty"
    if kind in (PIPE, "a certificate", "JSON"):
        return
    if kind == "missing" and path.lstrip().startswith("{"):
        raise FormatError(f"{shorten(path)}: is JSON text, not a path; give json.loads(text), a path or a Certificate")
    output = "certificate.json" if path == "-" else shell_word(f"{Path(path).stem}.json")
    made = f"ptcc certify {shell_word(path)} -o {output} makes one"
    if before_graph:
        made += "; the certificate comes first: ptcc check CERTIFICATE GRAPH"
    if path in GRAPHS and kind in ("missing", "a folder"):
        raise FormatError(f"{name}: is a packaged graph, not a certificate; {made}")
    if kind == "missing":
        raise FormatError(f"{name}: not a readable certificate (no such file); check the path{near_files(path)}")
    if kind == "a folder":
        raise FormatError(f"{name}: is a folder, not a certificate; name a file in it")
    if kind == "a scenario":
        raise FormatError(f"{name}: is a scenario, not a certificate; {made}")
    if kind:
        raise FormatError(f"{name}: is {kind}, not a certificate; name the file that ptcc certify -o wrote")
    if path.lower().endswith(".json.gz"):
        raise FormatError(f"{name}: is packed; unpack it first (gunzip)")
    if Path(path).suffix.lower() != ".json":
        raise FormatError(f"{name}: not a readable certificate; if it is a graph, {made}")


def near_files(path: str, names: tuple[str, ...] = ()) -> str:
    """Return near names of files in the folder of a path that does not exist, and ``names``; endings do not count."""
    try:
        with os.scandir(Path(path).parent) as entries:
            files = [entry.name for entry in islice(entries, 5000)]
    except (OSError, ValueError):
        files = []
    stem = Path(path).name.partition(".")[0].lower()
    if len(stem) > 2 and (same := sorted(n for n in (*names, *files) if n.lower().startswith(stem))[:3]):
        return f"; did you mean {' or '.join(same)}?"
    near = [n for n in (*names, *files) if get_close_matches(stem, [n.partition(".")[0].lower()], cutoff=0.7)]
    return did_you_mean(Path(path).name, near)


def shell_word(text: str) -> str:
    """Return a text as one word of a shell."""
    return shlex.quote(text) if text.isprintable() else "FILE"
