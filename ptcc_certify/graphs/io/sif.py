"""Simple interaction format: ``a activates b c``, one relation and its targets in a row."""

from __future__ import annotations

from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.io.files import lines_of
from ptcc_certify.graphs.io.graph_from_rows import Numbers, Rows
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import Reading


def read_sif(data: bytes, name: str, how: Reading) -> Rows:
    """Read SIF; tabs separate the fields where there are any, otherwise blanks; a row with one field is a node."""
    how.refuse("columns", name, "SIF files")
    how.refuse("variable", name, "SIF files")
    lines = lines_of(data, name)
    separator = "\t" if any("\t" in line for line in lines) else None
    nodes, relations = Numbers(), Numbers()
    first, second, codes, numbers = [], [], [], []
    for number, line in enumerate(lines, 1):
        fields = [field.strip() for field in line.split(separator)]
        if not any(fields) or fields[0].startswith("#"):
            continue
        if not all(fields) or len(fields) == 2:
            mend = "write a relation b: one source, one relation, then its targets"
            raise FormatError(f'{name}, line {number}: "{shorten(line.strip())}" is no row of SIF; {mend}')
        source = nodes[fields[0]]
        for target in fields[2:]:
            first.append(source)
            second.append(nodes[target])
            codes.append(relations[fields[1]])
            numbers.append(number)
    rows = Rows(list(nodes.texts), first, second, list(relations.texts), codes, lambda row: f"line {numbers[row]}")
    rows.weight_title, rows.columns = "relation", False
    return rows
