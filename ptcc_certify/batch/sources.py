"""What paths, patterns and ensembles stand for: sources, one for each graph, and what a worker is sent of them."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Hashable, Iterator, Mapping, Sequence, Set, ValuesView
from dataclasses import asdict, dataclass
from glob import glob, has_magic
from pathlib import Path
from typing import Any, NamedTuple

from ptcc_certify.errors import FormatError, ParameterError, PTCCError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.ensembles import Ensemble
from ptcc_certify.graphs.io import as_graph, read_graph
from ptcc_certify.graphs.io.files import read_bytes
from ptcc_certify.graphs.io.packaged import GRAPHS, file_or_packaged, graph_path
from ptcc_certify.graphs.rationals import shorten
from ptcc_certify.graphs.reading import OPTIONS, Reading

#: Where a graph comes from: a path, an ensemble and a number in it, or the graph itself; or why there is none.
Origin = str | tuple[Ensemble, int] | SignedDigraph | PTCCError


class Task(NamedTuple):
    """What a worker needs to make a row, besides the settings, and what the batch keeps with it."""

    number: int
    name: str
    payload: Any
    mark: str


@dataclass(frozen=True, slots=True)
class Source:
    """Where a graph comes from: a path, an ensemble and a number in it, or the graph itself; or why there is none.

    Sources of one ``key`` are one graph; their names may differ, and those of different graphs may be equal. ``mark``
    tells what graph it is, whatever else is in the list; that of a file, ``""`` here, depends on its content.
    """

    name: str
    origin: Origin
    key: Hashable
    mark: str = ""

    def task(self, number: int) -> Task:
        """Return the task of this graph, the ``number``-th of a batch; of one that cannot be read with the reason."""
        if not isinstance(self.origin, str):
            return Task(number, self.name, self.origin, self.mark)
        name, path = shorten(self.name, 200), Path(self.origin)
        try:
            # Whoever opens a pipe may wait for ever; a path that is missing is told by read_bytes.
            if os.path.exists(path) and not os.path.isfile(path):  # noqa: PTH110, PTH113 - those of Path may raise
                raise FormatError(f"{name}: is no regular file; save the graph as one")
            data = read_bytes(path, name)  # a Path: the file "-" is not standard input
        except PTCCError as error:
            return Task(number, self.name, error, f"{self.named} unreadable")
        return Task(number, self.name, data, f"{self.named} {hashlib.sha256(data).hexdigest()}")

    @property
    def named(self) -> str:
        """How the mark of a file begins: what is wrong with a file is told with its name."""
        return f"file {self.name}"


def chosen_sources(sources: Any, reading: Reading, own: Sequence[Path] = ()) -> list[Source]:
    """Return what ``sources`` stand for, each once; patterns leave out the files that the batch writes itself.

    What is wrong with a graph of a list is an error of its row; a graph or a path alone is refused.
    """
    several = Sequence | Set | Mapping | ValuesView | Iterator  # graphs, matrices and tables are none of these
    alone = isinstance(sources, str) or not isinstance(sources, several)
    sources = [sources] if alone else sources if isinstance(sources, Mapping) else list(sources)
    selection: dict[Hashable, Source] = {}
    graphs = ensembles = 0
    named = sources if isinstance(sources, Mapping) else {}
    for name, graph in named.items():
        graph = _given(graph, reading, alone)
        key = ("named", str(name))
        selection[key] = Source(str(name), graph, key, _mark_of_graph(graph))
    for source in () if named else sources:
        if isinstance(source, Ensemble):
            ensembles += 1
            name = "ensemble" if ensembles == 1 else f"ensemble{ensembles}"
            own_sources = _graphs_of(name, source, ("ensemble", ensembles))
        elif isinstance(source, str | os.PathLike):
            own_sources = _expand(os.fspath(source), own, len(sources) == 1)
        else:
            graph = _given(source, reading, alone)
            own_sources = [Source(f"graph#{graphs}", graph, ("graph", graphs), _mark_of_graph(graph))]
            graphs += 1
        for one in own_sources:
            selection.setdefault(one.key, one)
    if not selection:
        raise ParameterError("there are no graphs; name files or patterns")
    if reading != Reading() and all(isinstance(one.origin, tuple) for one in selection.values()):
        raise ParameterError(f"{', '.join(asdict(reading))} tell how files are read; ensembles have keys of their own")
    return list(selection.values())


def _given(graph: Any, reading: Reading, alone: bool) -> SignedDigraph | PTCCError:
    """Return a graph that has a name, or is in memory, or of one of several why it is none.

    Of a graph in memory only its orientation can be told.
    """
    file = isinstance(graph, str | os.PathLike)
    for name in () if file else OPTIONS[1:]:
        if getattr(reading, name) != getattr(Reading, name):
            raise ParameterError(f"{name} tells how files are read; beside graphs in memory leave it out")
    try:
        if file:
            return read_graph(file_or_packaged(os.fspath(graph)), **asdict(reading))
        return as_graph(graph, reading.orientation)
    except ParameterError:  # a setting of the batch
        raise
    except PTCCError as error:
        if alone:
            raise
        return error


def _expand(text: str, own: Sequence[Path], alone: bool) -> list[Source]:
    """Return what a text stands for."""
    name, path = shorten(text, 200), Path(text)
    try:
        exists, folder = path.exists(), path.is_dir()
    except (OSError, ValueError):  # a name that no file can have
        exists = folder = False
    if exists and not folder:
        if not path.is_file():
            raise FormatError(f"{name}: is no regular file; save the graph as one")
        return _file(text)
    if text in GRAPHS:
        file = str(graph_path(text))
        return [Source(text, file, ("file", os.path.realpath(file)))]
    if folder:
        raise ParameterError(f"{name}: is a folder; write a pattern such as {Path(name, '*.csv')}")
    if not has_magic(text):
        if alone or text.lower().endswith(".toml"):  # of how many graphs is not known
            raise FormatError(f"{name}: no such file; check the path")
        return _file(text)
    mine = {os.path.realpath(one) for one in own}
    matches = sorted(glob(text, recursive=True))  # noqa: PTH207 - Path.glob takes no absolute patterns
    # Links to nowhere stay: each is a row that tells so.
    files = [one for one in matches if not os.path.isdir(one) and os.path.realpath(one) not in mine]  # noqa: PTH112
    if not files:
        raise FormatError(f"{name}: no file matches this pattern; check it, and quote it for the shell")
    return [source for one in files for source in _file(one)]


def _file(text: str) -> list[Source]:
    """Return what a file, or a link to nowhere, stands for; of ``link/..`` the system knows best what it means."""
    name, key = re.sub(r"^(?:\./+)+", "", text), ("file", os.path.realpath(text))
    if name.lower().endswith(".toml") and os.path.isfile(text):  # noqa: PTH113 - Path.is_file may raise
        return _graphs_of(name, Ensemble.read(text), key)
    return [Source(name, text, key)]


def _graphs_of(name: str, ensemble: Ensemble, key: Hashable) -> list[Source]:
    mark = hashlib.sha256(json.dumps(ensemble.to_dict(), sort_keys=True).encode()).hexdigest()
    return [Source(f"{name}#{i}", (ensemble, i), (key, i), f"ensemble {mark} {i}") for i in range(len(ensemble))]


def _mark_of_graph(graph: SignedDigraph | PTCCError) -> str:
    """Tell a graph from others, and from itself with its nodes in another order, which initial states obey."""
    if isinstance(graph, PTCCError):
        return f"no graph: {graph}"
    order = hashlib.sha256(json.dumps(graph.labels).encode()).hexdigest()
    return f"graph {graph.sha256} {order}"
