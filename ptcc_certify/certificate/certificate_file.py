"""A certificate and its file: how it is written, and what is known of the file that it was read from."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ptcc_certify.certificate.certificate_data import Source
from ptcc_certify.checker import CheckReport
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.io import write_atomically
from ptcc_certify.graphs.io.files import refuse_no_path
from ptcc_certify.graphs.rationals import shorten


class FromFile:
    """What certificates of graphs and of families say of the file that they were read from."""

    source: Source | None

    @property
    def path(self) -> Path:
        """The file that it was read from."""
        return self._file.path

    @property
    def sha256(self) -> str:
        """Of the file that it was read from."""
        return self._file.sha256

    @property
    def report(self) -> CheckReport:
        """What the independent check says of a certificate that was read."""
        return self._file.report

    @property
    def _file(self) -> Source:
        if self.source is None:
            of = "report, path and sha256 are of a certificate that was read from a file"
            raise ParameterError(
                f"{of}; for a page or LaTeX: write_report(certificate, path); else save it, and read it"
            )
        return self.source


def write_certificate(path: str | Path, document: Mapping[str, Any], files: Mapping[str, bytes]) -> None:
    """Write a certificate, its side files first; each file appears whole or not at all.

    Raises
    ------
    ParameterError
        The path ends neither in ``.json`` nor in nothing.
    FormatError
        A file cannot be written.
    """
    refuse_no_path(path)
    path = Path(path)
    if path.suffix.lower() not in ("", ".json"):
        other = ", a page or LaTeX by write_report, a figure by save_figure"
        raise ParameterError(f"{shorten(str(path), 200)}: a certificate is saved as .json{other}")
    for name, content in files.items():
        write_atomically(path.parent / name, content)
    write_atomically(path, bytes_of(document))


def text_of(document: Mapping[str, Any]) -> str:
    """Return JSON as it stands in a file, without NaN or infinity."""
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def bytes_of(document: Mapping[str, Any]) -> bytes:
    """Return the file: what UTF-8 cannot hold, a lone surrogate in a label, becomes its JSON escape."""
    return text_of(document).encode("utf-8", "backslashreplace")
