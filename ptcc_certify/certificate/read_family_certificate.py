"""Reads a certificate of a family back from a file that the independent check accepts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import ceil
from typing import Any

import numpy as np

from ptcc_certify.certificate.certificate_data import Source
from ptcc_certify.certificate.family_certificate import ComponentProof, FamilyCertificate
from ptcc_certify.certificate.format import read_protocol, read_reaching
from ptcc_certify.certificate.format_family import certificate_family
from ptcc_certify.certificate.format_vectors import Reader
from ptcc_certify.certificate.request import Expectations
from ptcc_certify.checker.reading import exact, triangle
from ptcc_certify.checker.side_files import SideFiles
from ptcc_certify.errors import ParameterError
from ptcc_certify.lyapunov.family_function import FamilyFunction, prove_ends
from ptcc_certify.lyapunov.follower_function import FollowerFunction, LeadingPart
from ptcc_certify.lyapunov.quotient import Quotient
from ptcc_certify.theorems.family_behaviour import FamilyComponent, decide


def read_family_certificate(source: Source) -> FamilyCertificate:
    """Return what an accepted file says: family, behaviours, Lyapunov functions and what follows of them.

    The decision is made anew; no upper bound on the rate is taken from the file, which does not prove it.
    """
    document = source.document
    family = certificate_family(document["graph"], source.path.parent)
    claims = [document["claim"]] if document["claim"] is not None else [c["claim"] for c in document["components"]]
    components = [
        component if component.behaviour == claim["behaviour"] else replace(component, behaviour=claim["behaviour"])
        for component, claim in zip(decide(family), claims, strict=True)
    ]
    files = SideFiles(source.path.parent, None)
    functions: list[list[FamilyFunction | FollowerFunction]] = [[] for _ in components]
    for k, section in enumerate(document["lyapunov"]["functions"]):
        number = section["component"]
        of = f"lyapunov.functions[{k}]"
        functions[number].append(_read_function(of, section, components[number], document["proof"], files))
    parts = tuple(ComponentProof(c, tuple(some)) for c, some in zip(components, functions, strict=True))
    state = Reader(family.labels, source.path.parent).state(document["initial_state"])
    sigma0 = Reader(family.labels, source.path.parent).state(document["sliding_variable"])
    protocol, expectations = (
        read_protocol(document["protocol"]),
        _read_expectations(document["unverified"].get("asked")),
    )
    told = {"disturbance": document["protocol"].get("disturbance"), "expectations": expectations, "source": source}
    reaching = read_reaching(document["reaching_time"], protocol)
    return FamilyCertificate(family, protocol, parts, state, sigma0, reaching, **told)


def _read_expectations(asked: Any) -> Expectations:
    """Return what was asked, as the file says; nothing if it says what nobody can ask."""
    try:
        return Expectations(asked["behaviour"])
    except (TypeError, LookupError, ParameterError):
        return Expectations()


def _read_function(
    of: str, section: Mapping[str, Any], component: FamilyComponent, proof: Any, files: SideFiles
) -> FamilyFunction | FollowerFunction:
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
    )


def _read_rows(
    of: str, section: Mapping[str, Any], component: FamilyComponent, proof: Any, files: SideFiles
) -> FollowerFunction:
    family, kernel = component.family, component.kernel
    assert kernel is not None, "the check has verified a common kernel"
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
