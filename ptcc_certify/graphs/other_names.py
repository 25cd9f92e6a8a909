"""What people look for in an object under another name, and where it is: said in the refusal of the name.

One table for each way of asking: ``object.name``, ``object[key]`` and ``Class.name``.
"""

from __future__ import annotations

from abc import ABCMeta
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any, Self, TypeVar

from ptcc_certify.errors import ParameterError, UnknownName, did_you_mean

_OF_PROTOCOLS = {name: f"protocol.{name}" for name in ("T", "rho1", "rho2", "kappa", "gain")}
_OF_BOTH = {
    **_OF_PROTOCOLS,
    "deadline": "protocol.T",
    "x0": "initial_state",
    "certified": "verdict",
    "accepted": "checked.accepted",
    "decay_rate": "rate",
    "to_csv": "to_pandas().to_csv(path)",
    "write": "save(path)",
}
#: By class and name: the same, as it is reached from the object.
ITS = {
    "Certificate": {
        **_OF_BOTH,
        "behaviour": "claim.behaviour",
        "bound": "norm_bound(q) of ||E(t)|| at q = 1 - t/T",
        "error_bound": "norm_bound(q) of ||E(t)|| at q = 1 - t/T",
        "peak_input": "effort.peak.agents",
        "input": "effort",
        "states": "trajectory.states",
        **dict.fromkeys(("nodes", "labels"), "graph.labels"),
        "edges": "graph.edges",
        "leaders": "structure.leaders",
        "followers": "structure.followers",
        "to_networkx": "graph.to_networkx()",
    },
    "FamilyCertificate": {
        **_OF_BOTH,
        "behaviour": "behaviours",
        "claim": "behaviours",
        "final_state": "final_states",
        **dict.fromkeys(("envelope", "bound", "error_bound"), "deviation_bound(q) at q = 1 - t/T"),
        **dict.fromkeys(("nodes", "labels"), "family.labels"),
    },
    "Structure": {
        "behaviour": "claim.behaviour",
        "theorem": "claim.theorem",
        "leader_groups": "closed_components",
        **dict.fromkeys(("nodes", "labels"), "graph.labels"),
        "edges": "graph.edges",
        "to_networkx": "graph.to_networkx()",
    },
    "SignedDigraph": {
        "nodes": "labels",
        **dict.fromkeys(("n", "number_of_nodes"), "n_nodes"),
        **dict.fromkeys(("m", "number_of_edges"), "n_edges"),
        **dict.fromkeys(("to_numpy", "to_matrix"), "adjacency().toarray()"),
        **dict.fromkeys(("successors", "predecessors", "neighbors"), "to_networkx()"),
    },
    "Trajectory": {**_OF_PROTOCOLS, "time": "t", "x": "states", "u": "input", "save": "to_csv()"},
    "FinalState": {
        "to_dict": "items(): dict(final_state) makes a dict",
        "to_numpy": "states: numpy.asarray(final_state) rounds them",
    },
    "NominalProtocol": {"deadline": "T"},
    "SlidingModeProtocol": {"deadline": "T"},
    "CheckReport": dict.fromkeys(("save", "write"), "to_dict()"),
}
#: By name: what is not a part of the object.
_ELSEWHERE = {
    **dict.fromkeys(("draw", "show", "plot"), "draw it with ptcc_certify.plot_graph"),
    **dict.fromkeys(("write", "save", "to_csv"), "write ptcc_certify.write_graph(graph, path)"),
    **dict.fromkeys(("to_html", "to_latex"), "write ptcc_certify.write_report(certificate, path)"),
    **dict.fromkeys(
        ("structure", "leaders", "followers", "balanced", "is_balanced"), "write ptcc_certify.analyse(graph)"
    ),
    "animate": "there are no animations; draw it with ptcc_certify.plot_trajectory",
    "camps": "gauge holds the camp of each node, 1 or -1, and to_pandas() a table",
    "add_edge": "it stays as it is; make another with from_edges([*graph.edges, (source, target, weight)])",
    "error": "norm_bound(q) bounds ||E(t)|| at q = 1 - t/T",
    "load": "write ptcc_certify.read_certificate(path)",
    "check": "write ptcc_certify.check(certificate)",
    "certify": "write ptcc_certify.certify(graph, protocol, x0)",
    "simulate": "write ptcc_certify.simulate(graph, protocol, x0)",
}
#: By class: how to ask for a part by ``[key]``.
_ITEMS = {
    "SignedDigraph": "its edges are graph.edges, and graph.to_networkx()[label] tells who listens to whom",
    "Certificate": "its parts are attributes, or to_dict() as JSON",
    "FamilyCertificate": "its parts are attributes, or to_dict() as JSON",
}
#: By class: what makes one.
_MADE_BY = {
    "SignedDigraph": "as_graph(data), read_graph(path) or SignedDigraph.from_edges(edges)",
    "Family": "as_family(data), read_family(paths) or Family.from_intervals(edges)",
    "Structure": "analyse(graph)",
    "Certificate": "certify(graph, protocol, x0) or read_certificate(path)",
    "FamilyCertificate": "certify(family, protocol, x0) or read_certificate(path)",
    "Trajectory": "simulate(graph, protocol, x0)",
    "Design": "design(graph, max_input=..., initial_bound=...)",
}


_T = TypeVar("_T")


class CallableTuple(tuple[_T, ...]):
    """A tuple that may be called, too, as in networkx: ``graph.edges()`` is ``graph.edges``.

    Examples
    --------
    >>> graph = SignedDigraph.from_edges([("a", "b", -1)])
    >>> graph.labels(), graph.edges() == graph.edges == (("a", "b", -1),)
    (('a', 'b'), True)
    """

    __slots__ = ()

    def __call__(self) -> Self:
        """Return the tuple itself."""
        return self


class Hinted:
    """An object that says where something is that it does not have.

    Examples
    --------
    >>> as_graph("fig1a").lables
    Traceback (most recent call last):
    ptcc_certify.errors.UnknownName: SignedDigraph has no attribute 'lables'; did you mean labels?
    >>> analyse("fig1a").behaviour
    Traceback (most recent call last):
    ptcc_certify.errors.UnknownName: Structure has no attribute 'behaviour'; see its claim.behaviour
    """

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Refuse a name, with that which may have been meant."""
            hint = ""
            if not name.startswith("_"):
                if its := _of_class(ITS, type(self), {}).get(name):
                    hint = f"; see its {its}"
                else:
                    hint = f"; {_ELSEWHERE[name]}" if name in _ELSEWHERE else did_you_mean(name, dir(self))
            raise UnknownName(f"{type(self).__name__} has no attribute {name!r}{hint}")

        def __getitem__(self, key: Any) -> Any:
            """Refuse a part that is asked for by its key."""
            raise ParameterError(
                f"a {type(self).__name__} has no [{key!r}]; {_of_class(_ITEMS, type(self), 'its parts are attributes')}"
            )


class HintedClass(ABCMeta):
    """A class that names what makes its objects, where it is asked for a constructor that it does not have.

    Examples
    --------
    >>> NominalProtocol.from_file
    Traceback (most recent call last):
    ptcc_certify.errors.UnknownName: the class NominalProtocol has no attribute 'from_file'; make one with ...
    >>> ptcc.SignedDigraph.from_pandas
    Traceback (most recent call last):
    ptcc_certify.errors.UnknownName: the class SignedDigraph has no attribute 'from_pandas'; make one with ...
    """

    if not TYPE_CHECKING:

        def __getattr__(cls, name: str) -> Any:
            """Refuse a name, with what makes an object."""
            made = "" if name.startswith("_") else _of_class(_MADE_BY, cls, "") or _call_of(cls)
            hint = f"; make one with {made}" if made else ""
            raise UnknownName(f"the class {cls.__name__} has no attribute {name!r}{hint}")


def _call_of(cls: type) -> str:
    """Write the call of a dataclass with the names of its parameters; "" of other classes."""
    names = [field.name for field in fields(cls) if field.init and field.name[0] != "_"] if is_dataclass(cls) else []
    return f"{cls.__name__}({', '.join(names)})" if names else ""


def _of_class(table: dict[str, Any], of: type, otherwise: Any) -> Any:
    """Return what a table tells of a class, or of the nearest that it extends."""
    return next((table[one.__name__] for one in of.__mro__ if one.__name__ in table), otherwise)
