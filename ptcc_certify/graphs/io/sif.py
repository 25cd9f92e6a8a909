"""Simple interaction format: ``a activates b c``, one relation and its targets in a row."""

from __future__ import annotations

from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.io.files import lines_of
from ptcc_certify.graphs.io.raw_edges import Draft, Rows
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import Reading


def read_sif(data: bytes, name: str, how: Reading) -> Rows:
    """Read SIF; tabs separate the fields where there are any, otherwise blanks; a row with one field is a node."""
    lines = lines_of(data, name)
    separator = "\t" if any("\t" in line for line in lines) else None
    draft = Draft()
    for number, line in enumerate(lines, 1):
        fields = [field.strip() for field in line.split(separator)]
        if not any(fields) or fields[0].startswith("#"):
            continue
        if not all(fields) or len(fields) == 2:
            mend = "write a relation b: one source, one relation, then its targets"
            raise FormatError(f'{name}, line {number}: "{shorten(line.strip())}" is no row of SIF; {mend}')
        source = draft.nodes[fields[0]]
        for target in fields[2:]:
            draft.add(source, draft.nodes[target], fields[1], number)
    rows = draft.rows()
    rows.beside.title, rows.columns = "relation", False
    return rows
