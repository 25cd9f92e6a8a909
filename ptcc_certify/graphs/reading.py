"""How graphs are read: every option in one place, for files, data in memory, commands, scenarios and certificates."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar

from ptcc_certify.errors import FormatError, ParameterError, gated
from ptcc_certify.graphs.declared_option import Option, option
from ptcc_certify.graphs.rationals import shorten

_CHOICES = {"orientation": (None, "information", "listens"), "duplicates": ("refuse", "sum", "last")}
_SWITCHES = ("drop_self_loops", "drop_zeros", "undirected")
#: Keys of ``graph.read`` beside ``notes``: the first four always, the others where they were asked for.
RECORDED = ("orientation", "duplicates", "self_loops", "undirected", "zeros", "laplacian", "columns", "variable")


@gated
@dataclass(frozen=True)
class Reading:
    """How a graph is read.

    Attributes
    ----------
    orientation : {"information", "listens"}, optional
        Does a row ``a,b,w``, or entry (a, b) of a matrix, say that information flows a -> b, or that a listens to b?
        By default edges flow, and rows of a matrix listen.
    duplicates : {"refuse", "sum", "last"}
        What becomes of two rows for the same ordered pair.
    drop_self_loops, drop_zeros : bool
        Drop edges of a node to itself, and edges of weight 0, instead of refusing them.
    undirected : bool
        Let each edge go both ways.
    laplacian : bool, optional
        The matrix is a signed Laplacian ``D - W``: a weight is minus the entry, the diagonal says nothing more. False
        if it is none, though its diagonal holds the sums of its rows.
    columns : str or sequence of str, optional
        Source, target and weight among the columns of a table, by title or by number from 1: ``"from,to,score"``. Of a
        file of nodes and edges the last names the attribute.
    variable : str, optional
        Which matrix or relation of a file that holds several.
    """

    section: ClassVar = "graph"
    orientation: str | None = option(
        "--edges",
        "Row a,b (or entry a,b of a matrix): flows a -> b, or a listens.",
        key="edges",
        example='"information"',
        choices=("information", "listens"),
        shown="information; matrix: listens",
    )
    duplicates: str = option(
        "--duplicates",
        "What becomes of two rows for one ordered pair.",
        default="refuse",
        example='"refuse"',
        choices=("refuse", "sum", "last"),
    )
    drop_self_loops: bool = option(
        "--drop-self-loops/--no-drop-self-loops", "Ignore edges of a node to itself.", default=False, example="false"
    )
    drop_zeros: bool = option(
        "--drop-zeros/--no-drop-zeros", "Ignore edges of weight 0.", default=False, example="false"
    )
    undirected: bool = option(
        "--undirected/--no-undirected", "Every row counts in both directions.", default=False, example="false"
    )
    laplacian: bool | None = option(
        "--laplacian/--no-laplacian",
        "The matrix is a signed Laplacian D - W, or none though its diagonal holds the sums.",
        example="false",
    )
    columns: str | Sequence[str] | None = option(
        "--columns A,B,W",
        "Source, target and weight of a table: titles, or numbers from 1.",
        example='"source,target,weight"',
        kind="text",
    )
    variable: str | None = option(
        "--variable NAME", "Which matrix, network or relation of a file with several.", example='"W"', kind="text"
    )

    def __post_init__(self) -> None:
        """Refuse what no option is."""
        for name, choices in _CHOICES.items():
            if (value := getattr(self, name)) not in choices:
                names = ", ".join(filter(None, choices))
                raise ParameterError(f'{name} "{shorten(str(value))}" is unknown; use one of {names}')
        for name in _SWITCHES:
            if isinstance(value := getattr(self, name), str) or value not in (True, False):
                raise ParameterError(name, f"= {shorten(repr(value))} is neither True nor False")
            object.__setattr__(self, name, bool(value))
        if self.laplacian not in (True, False, None) or isinstance(self.laplacian, str):
            raise ParameterError("laplacian", f"= {shorten(repr(self.laplacian))} is none of True, False, None")
        if self.columns is not None:
            object.__setattr__(self, "columns", joined(self.titles))

    @property
    def titles(self) -> tuple[str, ...]:
        """The columns of source, target and weight; none if they are not told."""
        if self.columns is None:
            return ()
        parts = next(csv.reader([self.columns]), []) if isinstance(self.columns, str) else self.columns
        titles = tuple(str(part).strip() for part in parts)
        if len(titles) != 3 or not all(titles) or len(set(titles)) < 3:
            text = shorten(self.columns if isinstance(self.columns, str) else repr(self.columns))
            raise ParameterError("columns", f"= {text}: give those of source, target and weight, such as from,to,score")
        return titles

    def refuse(self, option: str, name: str, what: str) -> None:
        """Refuse an option that says nothing about a file of this kind."""
        if getattr(self, option) is not None:
            raise FormatError(f"{name}: --{option} is not for {what}; leave it out")

    def record(self, matrix: bool, loops: int, zeros: int) -> dict[str, Any]:
        """Return ``graph.read`` but for its notes; a part that was not asked for is absent."""
        way = "matrix" if matrix and self.orientation != "information" else self.orientation or "information"
        read: dict[str, Any] = {
            "orientation": way,
            "duplicates": "refused" if self.duplicates == "refuse" else self.duplicates,
            "self_loops": f"dropped {loops}" if self.drop_self_loops else "refused",
            "undirected": self.undirected,
        }
        read |= {"zeros": f"dropped {zeros}"} if self.drop_zeros else {}
        more = {"laplacian": self.laplacian, "columns": self.columns, "variable": self.variable}
        return read | {key: value for key, value in more.items() if value is not None}


#: What makes a family of a graph: weights in intervals, edges that may fail.
UNCERTAINTY = Option(
    flag="--uncertainty SHARE",
    help="Family: every weight is known up to this share of it, such as 10%.",
    key="graph.uncertainty",
    example='"10%"',
    kind="text",
)
OPTIONAL = Option(
    flag="--optional SOURCE,TARGET",
    help="Family: this edge may fail, on which TARGET hears SOURCE; repeat it for more.",
    key="graph.optional",
    example='["a,b"]',
    kind="text",
    many=True,
)
STUBBORN = Option(
    flag="--stubborn A=THETA,..",
    help="Stubborn agents, and the weights of their prejudices: numbers or LOW..HIGH; one for all; or FILE.csv",
    key="graph.stubborn",
    example='"0.5"',
    kind="state",
)
PREJUDICE = Option(
    flag="--prejudice A=P,..",
    help="Prejudices of stubborn agents, where they are not their initial states.",
    key="initial_state.prejudice",
    example='"a=1"',
    kind="state",
)
#: The options, in the order of their declaration.
OPTIONS = tuple(field.name for field in fields(Reading))


def joined(titles: Sequence[str]) -> str:
    """Write titles as one text, quoted where one holds a comma.

    Examples
    --------
    >>> joined(["from", "to", "a, b"])
    'from,to,"a, b"'
    """
    return ",".join(f'"{title}"' if "," in title else title for title in titles)


def options_of_record(read: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that ``graph.read`` of a graph, or of its certificate, records; not the orientation.

    Examples
    --------
    >>> options_of_record(as_graph("fig1a").read)["duplicates"]
    'refuse'
    """
    return {
        "duplicates": {"refused": "refuse"}.get(read["duplicates"], read["duplicates"]),
        "drop_self_loops": read["self_loops"] != "refused",
        "drop_zeros": "zeros" in read,
        "undirected": read["undirected"],
        **{key: read.get(key) for key in ("laplacian", "columns", "variable")},
    }


def option_flags(options: Mapping[str, Any]) -> list[str]:
    """Return options as flags of the command line, but for the orientation; what is as by default is left out.

    Examples
    --------
    >>> option_flags({"duplicates": "sum", "drop_zeros": True, "laplacian": False, "columns": "a,b,w"})
    ['--duplicates sum', '--drop-zeros', '--no-laplacian', '--columns a,b,w']
    """
    words = []
    for name in OPTIONS[1:]:
        value, flag = options.get(name), name.replace("_", "-")
        if value is True:
            words.append(f"--{flag}")
        elif name == "laplacian" and value is False:
            words.append("--no-laplacian")
        elif value and value != "refuse":
            words.append(f"--{flag} {value}")
    return words
