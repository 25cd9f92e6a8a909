"""Whether files are the graph, or the family, of a certificate: read as the reader of the certificate says.

How its sender read them, which the certificate tells, is asked only to name the options that would agree.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from ptcc_certify.checker import CheckReport
from ptcc_certify.cli import options as shared
from ptcc_certify.cli.click_options import flag_of
from ptcc_certify.cli.families import family_keywords, files_of, graph_or_family
from ptcc_certify.errors import FormatError, PTCCError
from ptcc_certify.graphs.recognised_files import shell_word

#: Options that tell how files of graphs and families are read.
READING = (*shared.READING, "stubborn", "uncertainty", "optional")


@dataclass(frozen=True)
class Compared:
    """How files compare with a certificate.

    Attributes
    ----------
    reason : str or None
        In what they differ; None if they are its graph.
    facts : mapping of str to str
        How they were read, and which modes are which.
    """

    reason: str | None
    facts: dict[str, str]


def compare(
    certificate: str, document: dict[str, Any], report: CheckReport, graphs: tuple[str, ...], options: shared.Options
) -> tuple[CheckReport, dict[str, str]]:
    """Compare files with the graph or family of an accepted certificate; return the report, and how they were read."""
    pair = _Pair(document, report.sha256, Path(certificate).parent, graphs, files_of(graphs))
    name, way = ", ".join(graphs), _way()
    try:
        found = pair.compare(options)
    except PTCCError as error:
        if (flags := _flags_that_agree(pair, options)) is None:
            raise FormatError(f"could not read your {pair.kind} {way}: {error}") from None
        reason = f"could not read your {pair.kind} {name} {way}; accepted if {flags} is what you mean"
        found = Compared(reason, {"graph_read": f"{name}, refused {way}: {error}"})
    else:
        late = isinstance((pair.document.get("messages") or {}).get("latency"), list)
        delays = "; delays are the certificate's own, not compared" if late else ""
        stubborn = "" if options["stubborn"] is None else f" --stubborn {shell_word(options['stubborn'])}"
        read = {"graph_read": f"{name}, read {way}: {found.facts['graph_read']}{stubborn}{delays}"}
        if found.reason is None:
            return report, found.facts | read
        flags = _flags_that_agree(pair, options)
        reason = f"another {pair.kind} than {name}, read {way}; accepted if {flags} is what you mean"
        found = Compared(reason if flags else found.reason, found.facts | read)
    return replace(report, accepted=False, obligations=(), rejected="graph", reason=found.reason), found.facts


@dataclass(frozen=True)
class _Pair:
    """A certificate, and files that may hold its graph or family."""

    document: Mapping[str, Any]
    sha256: str
    folder: Path
    graphs: tuple[str, ...]
    files: Sequence[Any]

    @property
    def kind(self) -> str:
        return "family" if "signal" in self.document["problem"] else "graph"

    def compare(self, options: shared.Options) -> Compared:
        """Compare the files, read as these options say, with the certificate."""
        for file in self.files:
            if hasattr(file, "seek"):
                file.seek(0)
        return self._family(options) if self.kind == "family" else self._graph(options)

    def _graph(self, options: shared.Options) -> Compared:
        from ptcc_certify.certificate.graph_sections import certificate_graph
        from ptcc_certify.certificate.section_io import read_side_files
        from ptcc_certify.graphs.difference import difference
        from ptcc_certify.graphs.family import Family
        from ptcc_certify.graphs.io.family_files import family_flags
        from ptcc_certify.graphs.io.graph_files import reading_flags

        graph = graph_or_family(self.files, options)
        if isinstance(graph, Family):
            reason = f"one graph in the certificate, a family in the files: {graph!r}"
            return Compared(reason, {"graph_read": family_flags(graph.read, self.graphs[0])})
        how = {"graph_read": reading_flags(graph.read)}
        if graph.sha256 == self.sha256:
            return Compared(None, how)
        checked = certificate_graph(self.document, read_side_files(self.document, self.folder))
        return Compared(f"another graph than {self.graphs[0]}: {difference(checked, graph)}", how)

    def _family(self, options: shared.Options) -> Compared:
        """Compare families; the order of the files does not count."""
        from ptcc_certify.certificate.graph_sections import certificate_family
        from ptcc_certify.certificate.section_io import read_side_files
        from ptcc_certify.graphs.difference import family_difference, mode_order
        from ptcc_certify.graphs.io.family_files import family_flags, read_family

        meant = certificate_family(self.document["problem"]["graph"], read_side_files(self.document, self.folder))
        family: Any = shared.with_stubborn(read_family(self.files, **family_keywords(options)), options)
        facts = {"graph_read": family_flags(family.read, self.graphs[0])}
        order = mode_order(meant, family)
        if order is None:
            reason = f"another family than {', '.join(self.graphs)}: {family_difference(meant, family)}"
            return Compared(reason, facts)
        named, own = ([mode.name for mode in modes] for modes in ([family.modes[k] for k in order], meant.modes))
        if len(order) > 1 and named != own:
            facts["modes"] = f"modes {', '.join(named)} are called {', '.join(own)} in the certificate"
        elif order != tuple(range(len(order))):
            facts["modes"] = f"the same modes in another order than in the certificate, {', '.join(own)}"
        return Compared(None, facts)

    def options_of_sender(self) -> dict[str, Any]:
        """Return how the certificate says that its graph was read, who is stubborn included, as options."""
        from ptcc_certify.certificate.graph_sections import certificate_family, certificate_graph
        from ptcc_certify.certificate.section_io import read_side_files
        from ptcc_certify.graphs.stubborn import stubborn_text, stubbornness

        sides = read_side_files(self.document, self.folder)
        if self.kind == "family":
            stubborn = stubbornness(certificate_family(self.document["problem"]["graph"], sides))
        else:
            stubborn = stubbornness(certificate_graph(self.document, sides))
        return self._reading_of_sender() | {"stubborn": stubborn_text(stubborn) or None}

    def _reading_of_sender(self) -> dict[str, Any]:
        """Return how the certificate says that its graph was read; nothing where it tells anything else."""
        from ptcc_certify.graphs.io.family_files import keywords_of
        from ptcc_certify.graphs.io.graph_files import keywords_as
        from ptcc_certify.graphs.io.interval_rows import is_family_file
        from ptcc_certify.graphs.reading import options_of_record

        if self.kind == "family":
            keywords = keywords_of(self.document["unverified"].get("read"))
        else:
            file, read = self.files[0], self.document["problem"]["graph"]["read"]
            try:
                if is_family_file(file):  # in which all weights are known
                    keywords = {"orientation": read["orientation"], **options_of_record(read)}
                else:
                    keywords = keywords_as(file, read)
            except PTCCError:  # a file of another kind than the sender's
                return {}
        named = {"edges" if name == "orientation" else name: value for name, value in keywords.items()}
        return {name: value for name, value in named.items() if name in READING}


def _typed() -> set[str]:
    """Return the options about reading that stand on the command line."""
    source = click.get_current_context().get_parameter_source
    return {name for name in READING if source(name) is ParameterSource.COMMANDLINE}


def _way() -> str:
    """Tell who says how the files are read."""
    if _typed():
        return "as the options say"
    return "as the scenario says" if click.get_current_context().default_map else "by default"


def _flags_that_agree(pair: _Pair, options: shared.Options) -> str | None:
    """Return the options with which the files are the graph of the certificate; None if its sender names none.

    What the sender says is tried beside the options of the command line, then alone.
    """
    sender, typed = pair.options_of_sender(), {name: options[name] for name in _typed()}
    for told in ({**options, **sender, **typed}, {**options, **sender}):
        try:
            if pair.compare(told).reason is None:
                asked = f"--edges {told['edges']}" if options["edges"] is None and told["edges"] else None
                return _flags(options, told, pair.files[0]) or asked  # by a header that tells no direction
        except PTCCError:
            continue
    return None


def _flags(options: shared.Options, told: shared.Options, file: Any) -> str:
    """Return what makes other options of these."""
    from ptcc_certify.graphs.io.family_files import percent
    from ptcc_certify.graphs.io.files import name_and_ending
    from ptcc_certify.graphs.io.graph_files import MATRICES

    direction = "listens" if name_and_ending(file)[1] in MATRICES else "information"
    words = []
    for name in READING:
        flag = flag_of(name)
        old, new = options[name], told[name]
        if name == "edges":
            old, new = old or direction, new or direction
        elif name == "uncertainty":
            old, new = (percent(str(share or 0)) for share in (old, new))
        elif name == "optional":
            old, new = ([tuple(pair) for pair in pairs or ()] for pairs in (old, new))
        if old == new:
            continue
        if isinstance(new, bool):
            words.append(flag if new else flag.replace("--", "--no-", 1))
        elif name == "optional" and new:
            words += [f"{flag} {shell_word(','.join(pair))}" for pair in new]
        else:
            words.append(f"{flag} {shell_word(str(new))}" if new else f"no {flag}")
    return " ".join(words)
