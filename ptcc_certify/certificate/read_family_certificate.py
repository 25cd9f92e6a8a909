"""Reads a certificate of a family back from a file that the independent check accepts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from ptcc_certify.certificate.certificate_data import Source
from ptcc_certify.certificate.family_certificate import ComponentProof, FamilyCertificate
from ptcc_certify.certificate.family_content import ProvedFunction
from ptcc_certify.certificate.format import read_protocol, read_reaching
from ptcc_certify.certificate.format_family import certificate_family
from ptcc_certify.certificate.format_family_rows import read_box, read_range
from ptcc_certify.certificate.format_restricted import read_claim
from ptcc_certify.certificate.format_upper_bound import read_upper_bound
from ptcc_certify.certificate.format_vectors import Reader
from ptcc_certify.certificate.request import Expectations
from ptcc_certify.checker.reading import exact, triangle
from ptcc_certify.checker.side_files import SideFiles
from ptcc_certify.errors import FormatError, ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.lyapunov.family_function import FamilyFunction, prove_ends
from ptcc_certify.lyapunov.family_rate_upper_bound import FamilyRateBound
from ptcc_certify.lyapunov.follower_function import FollowerFunction, LeadingPart
from ptcc_certify.lyapunov.quotient import Quotient
from ptcc_certify.lyapunov.squares_function import FormTable, SquaresFunction
from ptcc_certify.theorems.family_behaviour import FamilyComponent, decide


def read_family_certificate(source: Source) -> FamilyCertificate:
    """Return what an accepted file says: family, behaviours, Lyapunov functions and what follows of them.

    The decision is made anew, and so is the proof of each upper bound on the rate from the members that the file names.
    """
    document = source.document
    family = certificate_family(document["graph"], source.files)
    claims = [document["claim"]] if document["claim"] is not None else [c["claim"] for c in document["components"]]
    components = [
        component if component.behaviour == claim["behaviour"] else replace(component, behaviour=claim["behaviour"])
        for component, claim in zip(decide(family), claims, strict=True)
    ]
    files = SideFiles(Path(), source.files)
    functions: list[list[ProvedFunction]] = [[] for _ in components]
    for k, section in enumerate(document["lyapunov"]["functions"]):
        number = section["component"]
        of = f"lyapunov.functions[{k}]"
        functions[number].append(_read_function(of, section, components[number], document["proof"], files))
    bounds = _read_bounds(document["unverified"].get("upper_bounds"), components)
    parts = tuple(ComponentProof(c, tuple(V), b) for c, V, b in zip(components, functions, bounds, strict=True))
    data = Reader(family.labels, source.files)
    state, sigma0 = (data.state(document[key]) for key in ("initial_state", "sliding_variable"))
    restricted = enumerate(document.get("restricted", ()))
    promised = tuple(read_claim(f"restricted[{k}]", entry, document["proof"], components) for k, entry in restricted)
    protocol, disturbance = read_protocol(document["protocol"]), document["protocol"].get("disturbance")
    kept: dict[str, Any] = {"signal": promised[0].signal if promised else "any", "restricted": promised}
    kept["disturbance"] = disturbance
    kept["boxes"] = {
        entry["component"]: read_box(entry, components[entry["component"]].family.labels, files)
        for entry in document.get("boxes", ())
        if "vector" in entry
    }
    kept["ranges"] = {
        entry["component"]: read_range(entry) for entry in document.get("boxes", ()) if "vector" not in entry
    }
    kept |= {"expectations": _read_expectations(document["unverified"].get("asked")), "source": source}
    return FamilyCertificate(
        family, protocol, parts, state, sigma0, read_reaching(document["reaching_time"], protocol), **kept
    )


def _read_bounds(stated: Any, components: Sequence[FamilyComponent]) -> list[FamilyRateBound | None]:
    """Prove the upper bounds anew that a file states, one for each component."""
    entries = stated if isinstance(stated, list) and len(stated) == len(components) else [None] * len(components)
    return [
        None if entry is None or component.kernel is None else read_upper_bound(Quotient.of(component), entry)
        for entry, component in zip(entries, components, strict=True)
    ]


def _read_expectations(asked: Any) -> Expectations:
    """Return what was asked, as the file says; nothing if it says what nobody can ask."""
    try:
        return Expectations(asked["behaviour"])
    except (TypeError, LookupError, ParameterError):
        return Expectations()


def _read_function(
    of: str, section: Mapping[str, Any], component: FamilyComponent, proof: Any, files: SideFiles
) -> ProvedFunction:
    if section["class"] == "squares":
        return _read_squares(section, component.family, files)
    if section["class"] == "rows":
        return _read_rows(of, section, component, proof, files)
    return _read_form(of, section, component.family.labels, proof)


def _read_form(of: str, section: Mapping[str, Any], labels: Sequence[str], proof: Any) -> FamilyFunction:
    index = {label: v for v, label in enumerate(labels)}
    nodes = tuple(index[label] for label in section["nodes"])
    matrix = triangle(section["lower_triangle"], len(nodes))
    steps = [x for x in proof if x["kind"] == "family-rate" and x["of"].startswith(f"{of}.modes[")]
    witnesses = [step["witness"] for step in steps if step["witness"] is not None]
    ends = prove_ends(matrix)
    assert ends is not None, "the check has proved it definite"
    return FamilyFunction(
        section["class"],
        tuple(v for v in range(len(labels)) if v not in set(nodes)),
        nodes,
        matrix,
        tuple(exact(step["numbers"]["b"]) for step in steps),
        tuple(tuple(map(exact, witness["multipliers"])) for witness in witnesses),
        *ends,
        input_constants=tuple(map(exact, section["inputs"].values())),
        coordinate_constants=tuple(map(exact, section["coordinates"].values())),
        means=tuple(
            (tuple(exact(mean["weights"].get(label, "0")) for label in labels), exact(mean["constant"]))
            for mean in section["means"]
        ),
    )


def _read_rows(
    of: str, section: Mapping[str, Any], component: FamilyComponent, proof: Any, files: SideFiles
) -> FollowerFunction:
    family, kernel = component.family, component.kernel
    if kernel is None:
        raise FormatError("rest states of more than 120 agents are verified, not read back; see ptcc check --json")
    index = {label: v for v, label in enumerate(family.labels)}
    pivots = {c.nodes[0] for c in kernel.structure.closed_components if c.balanced}
    agents = [np.array([index[label] for label in part["nodes"]]) for part in section["parts"]]
    outside = sorted(pivots.union(*(some.tolist() for some in agents)))
    followers = np.setdiff1d(np.arange(family.n_nodes), outside)
    d, scale = files.numbers(section["vector"], "vector", followers.size).over(range(followers.size))
    ends, parts = dict.fromkeys(outside, 0), []
    for j, (some, part) in enumerate(zip(agents, section["parts"], strict=True)):
        own = family.restricted(some)
        function = _read_form(f"{of}.parts[{j}]", part["function"], own.labels, proof)
        parts.append(LeadingPart(some, Quotient(own), function, exact(part["times"]) * scale))
        bounds = zip(some.tolist(), map(exact, part["bounds"]), strict=True)
        ends |= {v: ceil(bound * scale) for v, bound in bounds if v not in pivots}
    vectors = np.array(d, dtype=object), np.array(list(ends.values()), dtype=object)
    return FollowerFunction(family, kernel, followers, *vectors, tuple(parts), exact(section["rate"]))


def _read_squares(section: Mapping[str, Any], family: Family, files: SideFiles) -> SquaresFunction:
    n = family.n_nodes
    own, scale = files.numbers(section["vector"], "vector", n).over(range(n))
    modes = [(table.edges, table.unit) for table in map(FormTable.of, family.modes)]
    return SquaresFunction(dict(enumerate(own)), scale, exact(section["rate"]), modes)
