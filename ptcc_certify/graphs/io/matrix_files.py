"""Adjacency matrices: Matrix Market, NumPy's ``.npy`` and ``.npz``, MATLAB's ``.mat``.

SciPy's readers (``mmread``, ``load_npz``, ``loadmat``) crash the process on damaged files, and ``mmread`` reads
``1/3`` and ``1,5`` as 1; its sparse arrays trust an ``indptr`` that ends below 0. So only NumPy reads here.
"""

from __future__ import annotations

import re
import struct
import warnings
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from io import BytesIO

import numpy as np

from ptcc_certify.errors import FormatError
from ptcc_certify.graphs.io import files
from ptcc_certify.graphs.io.raw_edges import Rows, rows_of
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import Reading
from ptcc_certify.graphs.size_limits import MAX_NODES

Array = np.ndarray

_BANNER = "%%matrixmarket matrix (coordinate|array) (real|double|integer) (general|symmetric)"
_MAT_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_MAT_COMPRESSED, _MAT_MATRIX = 15, 14  # types of elements
_MAT_SPARSE, _MAT_LAST_NUMERIC, _MAT_NOT_REAL = 5, 15, 0x800 | 0x200  # classes of variables; flags: complex, logical


def _refuse_no_adjacency(shape: Sequence[int], dtype: np.dtype, name: str) -> None:
    if len(shape) != 2 or shape[0] != shape[1]:
        raise FormatError(f"{name}: the matrix has the shape {tuple(shape)}; an adjacency matrix is square")
    if dtype.kind not in "iuf" or dtype.itemsize > 8:
        raise FormatError(f"{name}: the matrix holds {dtype}, not real numbers; store it as float64 or int64")
    if not 0 <= shape[0] <= MAX_NODES:
        raise FormatError(f"{name}: {shape[0]} nodes are more than {MAX_NODES}")


def _dense(matrix: Array, labels: Array | None, name: str) -> Rows:
    """Turn a dense matrix into rows; a zero is no entry."""
    _refuse_no_adjacency(matrix.shape, matrix.dtype, name)
    target, source = np.nonzero(matrix)
    return _entries(target, source, matrix[target, source], matrix.shape[0], labels, name)


def _entries(row: Array, column: Array, entries: Array, n: int, labels: Array | None, name: str) -> Rows:
    """Turn the entries of an n x n matrix into rows ``k, l, entry``."""
    row, column = (index.astype(np.int64, casting="same_kind") for index in (row, column))
    if not row.shape == column.shape == entries.shape == (entries.size,):
        raise ValueError("its indices and entries differ in number")
    if entries.size and (min(row.min(), column.min()) < 0 or max(row.max(), column.max()) >= n):
        raise ValueError(f"an entry lies outside the {n} x {n} matrix")
    if labels is None:
        labels = np.arange(1, n + 1)
    elif labels.dtype.kind not in "USiu" or labels.shape != (n,):
        raise FormatError(f"{name}: labels must be {n} texts or integers")
    names = [label.decode("utf-8") if isinstance(label, bytes) else str(label) for label in labels.tolist()]
    rows = rows_of(names, row, column, entries, matrix=True)
    rows.where = lambda e: f"row {row[e] + 1}, column {column[e] + 1}"
    return rows


def _uncompressed(start: Array, index: Array, entries: Array, n: int) -> tuple[Array, Array, Array]:
    """Return column (row) and row (column) of the entries of a compressed matrix, and these.

    Column k has the entries ``start[k] .. start[k + 1] - 1``.
    """
    start = start.astype(np.int64, casting="same_kind")
    if start.shape != (n + 1,) or start[0] != 0 or (np.diff(start) < 0).any() or start[-1] > entries.size:
        raise ValueError("its index of columns or rows is inconsistent")
    return np.repeat(np.arange(n), np.diff(start)), index[: start[-1]], entries[: start[-1]]


def _the_matrix(shapes: Mapping[str, tuple[int, ...]], variables: Iterable[str], name: str, wanted: str | None) -> str:
    """Return the name of the only square matrix, or of the one that is wanted.

    A single number counts only where there is nothing else.
    """
    if wanted is not None:
        if wanted not in shapes:
            names = ", ".join(shorten(k) for k in list(shapes)[:20]) or "nothing"
            raise FormatError(f"{name}: no numeric matrix is called {shorten(wanted)}; there are {names}")
        return wanted
    square = [k for k, shape in shapes.items() if len(shape) == 2 and shape[0] == shape[1]]
    square = [k for k in square if shapes[k][0] > 1] or square
    if len(square) != 1:
        names = ", ".join(shorten(k) for k in (square or list(variables))[:20]) or "nothing"
        what = "several square matrices" if square else "no square numeric matrix"
        mend = "choose one with --variable NAME" if square else "save one"
        raise FormatError(f"{name}: {what} among its variables ({names}); {mend}")
    return square[0]


def read_mtx(data: bytes, name: str, how: Reading) -> Rows:
    """Read a Matrix Market file; a decimal is the decimal, not the float that it passes through."""
    lines = files.lines_of(data, name)
    banner = re.fullmatch(_BANNER, " ".join(lines[0].lower().split()))
    if banner is None:
        mend = "write %%MatrixMarket matrix coordinate real general"
        raise FormatError(f'{name}, line 1: "{shorten(lines[0], 80)}" is not read here; {mend}')
    layout, kind, symmetry = banner.groups()
    number, half = np.dtype(np.int64 if kind == "integer" else np.float64), symmetry == "symmetric"
    with files.one_line_errors(name, "a Matrix Market file"):
        warnings.simplefilter("error", DeprecationWarning)  # NumPy 1 only warns where it reads the integer 5.5 as 5
        size, *body = (line for line in lines if line.strip() and line.lstrip()[0] != "%")
        n, columns, *announced = map(int, size.split())
        _refuse_no_adjacency((n, columns), number, name)
        if layout == "coordinate":
            table = np.loadtxt(body, [("row", "i8"), ("column", "i8"), ("entry", number)], None, ndmin=1)
            target, source = table["row"] - 1, table["column"] - 1
            entries = table["entry"]
        else:
            entries = np.loadtxt(body, number, None, ndmin=1).ravel()
            announced.append(n * (n + 1) // 2 if half else n * n)
        if announced != [entries.size]:
            raise FormatError(f"{name}: {entries.size} entries, not {announced} as announced; the file is not whole")
        texts = [text for line in body for text in line.split()] if (zeros := np.flatnonzero(entries == 0)).size else []
        for text in (texts[len(texts) // entries.size * (k + 1) - 1] for k in zeros.tolist()):
            if text.lower().partition("e")[0].strip("+-0."):
                raise FormatError(f"{name}: entry {shorten(text)} is outside the range of float64; rescale the weights")
        if layout == "array":
            source, target = np.triu_indices(n) if half else np.divmod(np.arange(n * n), n)
            source, target, entries = (array[entries != 0] for array in (source, target, entries))
        rows = _entries(target, source, entries, n, None, name)
    rows.weights = [str(entry) for entry in np.asarray(rows.weights).tolist()]
    rows.undirected = "a symmetric Matrix Market file" if half else ""
    return rows


def read_npy(data: bytes, name: str, how: Reading) -> Rows:
    """Read a matrix that ``numpy.save`` wrote."""
    if not data.startswith(b"\x93NUMPY"):
        raise FormatError(f"{name}: not a NumPy array file; write it with numpy.save")
    with files.one_line_errors(name, "a NumPy array"):
        return _dense(np.load(BytesIO(data), allow_pickle=False), None, name)


def read_npz(data: bytes, name: str, how: Reading) -> Rows:
    """Read the only square matrix, or ``variable``, of an archive of ``numpy.savez`` or ``scipy.sparse.save_npz``."""
    with files.one_line_errors(name, "an .npz archive"):
        with zipfile.ZipFile(BytesIO(data)) as functions:
            files.refuse_large(sum(function.file_size for function in functions.infolist()), name)
        with np.load(BytesIO(data), allow_pickle=False) as archive:
            arrays = dict(archive)
        labels = arrays.pop("labels", None)
        if "format" not in arrays:
            numeric = {key: array.shape for key, array in arrays.items() if array.dtype.kind in "iufc"}
            rows = _dense(arrays[_the_matrix(numeric, arrays, name, how.variable)], labels, name)
            one = len(rows.labels), "U"
            texts = [key for key, array in arrays.items() if (*array.shape, array.dtype.kind) == one]
            if texts:
                rows.notes = (*rows.notes, f"array {shorten(texts[0])} is not read; names are an array labels")
            return rows
        how.refuse("variable", name, "an archive of one sparse matrix")
        layout = arrays["format"].astype(str).item()
        entries = arrays["data"]
        shape = arrays["shape"].tolist()
        _refuse_no_adjacency(shape, entries.dtype, name)
        if layout == "coo":
            row, column = arrays["row"], arrays["col"]
        elif layout in ("csr", "csc"):
            row, column, entries = _uncompressed(arrays["indptr"], arrays["indices"], entries, shape[0])
            row, column = (row, column) if layout == "csr" else (column, row)
        else:
            raise FormatError(f"{name}: a sparse matrix of layout {shorten(layout)}; convert it with tocsr")
        return _entries(row, column, entries, shape[0], labels, name)


def read_mat(data: bytes, name: str, how: Reading) -> Rows:
    """Read the only square matrix, or ``variable``, of a MATLAB 5 file.

    The file holds tagged elements, compressed or not; a variable is an element that holds elements: flags with the
    class, dimensions, name, and for a real matrix one array, or three if it is sparse.
    """
    with files.one_line_errors(name, "a MATLAB file"):
        order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
        if order is None or data.startswith(b"MATLAB 7.3"):
            raise FormatError(f"{name}: not a MATLAB 5 file (7.3 is HDF5); save the matrix with -v7")
        variables = {}
        for content in _mat_variables(data, order, name):
            parts = (np.frombuffer(part, order + _MAT_TYPES[kind]) for kind, part in _mat_elements(content, order))
            flags = int(next(parts)[0])
            if flags & 0xFF <= _MAT_LAST_NUMERIC:  # later classes have no dimensions
                shape, label = tuple(next(parts).tolist()), next(parts).tobytes().decode("latin-1")
                variables[label] = flags, shape, parts
        real = {k: v for k, v in variables.items() if v[0] & 0xFF >= _MAT_SPARSE and not v[0] & _MAT_NOT_REAL}
        wanted = _the_matrix({k: v[1] for k, v in real.items()}, variables, name, how.variable)
        flags, shape, parts = variables[wanted]
        if flags & 0xFF != _MAT_SPARSE:
            return _dense(next(parts).reshape(shape, order="F"), None, name)
        row, start, entries = parts
        _refuse_no_adjacency(shape, entries.dtype, name)
        column, row, entries = _uncompressed(start, row, entries, shape[1])
        return _entries(row, column, entries, shape[0], None, name)


def _mat_variables(data: bytes, order: str, name: str) -> Iterator[memoryview]:
    unpacked = 0
    for kind, content in _mat_elements(memoryview(data)[128:], order):
        if kind == _MAT_COMPRESSED:
            plain = zlib.decompressobj().decompress(content, files.MAX_BYTES + 1 - unpacked)
            unpacked += len(plain)
            files.refuse_large(unpacked, name)
            kind, content = next(_mat_elements(memoryview(plain), order))
        if kind == _MAT_MATRIX:
            yield content


def _mat_elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield type and content of each element."""
    end = 0
    while end < len(data):
        kind, size = struct.unpack_from(order + "II", data, end)
        if kind >> 16:  # a small element: size and type share one word, the data have the other
            kind, size, start, end = kind & 0xFFFF, kind >> 16, end + 4, end + 8
        else:
            start, end = end + 8, end + 8 + size + (0 if kind == _MAT_COMPRESSED else -size % 8)
        if start + size > min(end, len(data)):
            raise ValueError("it ends within an element")
        yield kind, data[start : start + size]
