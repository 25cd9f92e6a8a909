"""A certificate with its vectors in side files: what a large one looks like, made of any."""

from __future__ import annotations

import copy
import hashlib
import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from mutations import Json, resealed

from ptcc_certify.checker.reading import exact


class Side:
    """The files of one certificate."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}

    def column(self, values: Sequence[int] | Sequence[float]) -> Json:
        """Keep a vector of int64 or float64; return ``{"file", "sha256"}``."""
        kind = "<f8" if any(isinstance(x, float) for x in values) else "<i8"
        head = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': ({len(values)},), }}".ljust(117) + "\n"
        content = b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head.encode()
        content += np.array(values, dtype=kind).tobytes()
        sha256 = hashlib.sha256(content).hexdigest()
        self.files[f"{sha256[:16]}.npy"] = content
        return {"file": f"{sha256[:16]}.npy", "sha256": sha256}

    def integers(self, values: Sequence[int]) -> Json:
        return {**self.column(values), "count": len(values)}

    def numbers(self, values: Sequence[Fraction]) -> Json | None:
        """Keep exact numbers as floats, or as integers over a scale; None if neither holds them."""
        if all(abs(x.numerator) < 2**1000 and float(x) == x for x in values):
            return {**self.column(list(map(float, values))), "count": len(values)}
        scale = math.lcm(*(x.denominator for x in values))
        tops = [int(x * scale) for x in values]
        if max(map(abs, tops)) >= 2**63:
            return None
        return {**self.column(tops), "count": len(values), "scale": str(scale)}

    def balls(self, intervals: Sequence[Any]) -> Json:
        """Keep intervals: middles as floats, radii that make up for it."""
        pairs = [(exact(x["mid"]), exact(x["radius"])) if isinstance(x, dict) else (exact(x), 0) for x in intervals]
        mids = [float(x) for x, _ in pairs]
        wide = [abs(Fraction(m) - x) + r for m, (x, r) in zip(mids, pairs, strict=True)]
        radii = [math.nextafter(float(r), math.inf) if r else 0.0 for r in wide]
        return {"mid": self.integers(mids), "radius": self.integers(radii)}  # type: ignore[arg-type]


def with_side_files(data: Json) -> tuple[Json, dict[str, bytes]]:
    """The same certificate with every vector in a side file that may stand in one, and the files by name."""
    data, side = copy.deepcopy(data), Side()
    index = {label: v for v, label in enumerate(data["problem"]["graph"]["nodes"])}

    def move(where: Any, key: str) -> None:
        said = where[key]
        texts = list(said.values()) if isinstance(said, dict) else said
        if texts and (moved := side.numbers([exact(x) for x in texts])) is not None:
            where[key] = moved

    def label(where: Any, key: str) -> None:
        where[key] = side.integers([index[x] for x in where[key]])

    edges = data["problem"]["graph"]["modes"][0]["edges"]
    if isinstance(edges, list) and edges:
        columns = zip(*((index[s], index[t], exact(w)) for s, t, w in edges), strict=True)
        source, target, weight = columns
        scale = math.lcm(*(w.denominator for w in weight))
        if max(abs(w * scale) for w in weight) < 2**63:
            named = {"source": source, "target": target, "weight": [int(w * scale) for w in weight]}
            columns_of = {key: side.column(list(values)) for key, values in named.items()}
            data["problem"]["graph"]["modes"][0]["edges"] = {"count": len(edges), "scale": str(scale), **columns_of}
    label(data["structure"][0], "leaders")
    label(data["structure"][0], "followers")
    for key in ("initial_state", "sliding_variable"):
        if key in data["problem"]:
            move(data["problem"], key)
    if isinstance(data.get("components"), dict):
        number = {index[x]: k for k, nodes in enumerate(data["components"]["nodes"]) for x in nodes}
        data["components"]["nodes"] = side.integers([number[v] for v in range(len(index))])
    if "final_state" in data:
        data["final_state"] = side.balls(list(data["final_state"].values()))
        for component in data.get("components", []):
            if isinstance(component, dict):
                del component["final_state"]
    for step in data["proof"]:
        if step["kind"] == "dominance":
            move(step["witness"], "vector")
        if step["kind"] == "final-state" and "witness" in step:
            move(step["witness"], "u")
    dominated = {step["of"] for step in data["proof"] if step["kind"] == "dominance"}
    for k, function in enumerate(data["decays"]):
        if function["class"] != "paper":
            label(function["blocks"][0], "nodes")
        if f"decays[{k}]" in dominated:
            move(function["blocks"][0], "diagonal")
    return resealed(data), side.files


def with_factors(data: Json) -> Json:
    """The same certificate with leader groups proved by factors, at rates that leave these some room."""
    data = copy.deepcopy(data)
    slower, room = Fraction(9, 10), Fraction(99, 100)
    told: set[tuple[int, Fraction]] = set()
    labels = data["problem"]["graph"]["nodes"]
    heard: dict[str, dict[str, Fraction]] = {label: {} for label in labels}
    for s, t, w in data["problem"]["graph"]["modes"][0]["edges"]:
        heard[t][s] = exact(w)
    groups = [c for c in data["structure"][0]["closed_components"] if len(c["nodes"]) > 1]
    for key in ("diagonal", "proved"):
        data["rates"][key] = str(exact(data["rates"][key]) * slower)
    lower = exact(data["input"]["threshold"]["lower"]) * slower
    data["input"]["threshold"]["lower"] = str(lower)
    if data["input"].get("bounded") and lower < 1:
        del data["input"]["bounded"]
        data["proof"] = [step for step in data["proof"] if step["kind"] != "input-threshold"]
    for step in data["proof"]:
        if step["kind"] == "dominance":
            function = data["decays"][int(step["of"][len("decays[") : -1])]
            function["rate"] = step["numbers"]["b"] = str(exact(function["rate"]) * slower)
            block = function["blocks"][0]
            weight = dict(zip(block["nodes"], map(exact, block["diagonal"]), strict=True))
            for k, (text, c) in enumerate(zip(step["witness"]["groups"], groups, strict=True)):
                nodes, rate = c["nodes"], exact(text) * room
                A = np.array([[-heard[i].get(j, Fraction(0)) for j in nodes] for i in nodes], dtype=object)
                A[np.diag_indices(len(nodes))] = [sum(map(abs, heard[i].values()), Fraction(0)) for i in nodes]
                W = np.diag([weight[i] for i in nodes])
                S = W @ A + A.T @ W - rate * W
                if c["balanced"]:
                    S = (A.T @ S @ A)[1:, 1:]
                first = (k, rate) not in told  # a proof is told once
                told.add((k, rate))
                step["witness"]["groups"][k] = {"rate": str(rate), "factor": factor(S)} if first else str(rate)
    return resealed(data)


def factor(S: np.ndarray, bits: int = 40) -> Json:
    """A rounded factor of a matrix of rationals, from the last row to the first."""
    n = len(S)
    S = S[::-1, ::-1]
    sizes = [math.frexp(float(S[i, i]))[1] for i in range(n)]
    power = -2 * (max(sizes) // 2)
    exponents = [-(size + power) // 2 for size in sizes]
    unit = [[float(S[i, j] * Fraction(2) ** (exponents[i] + exponents[j] + power)) for j in range(n)] for i in range(n)]
    R = np.rint(np.ldexp(np.linalg.cholesky(np.array(unit) - 1e-9 * np.eye(n)), bits)).astype(np.int64)
    columns = [np.flatnonzero(R[:, k]) for k in range(n)]
    return {
        "order": list(range(n))[::-1],
        "indptr": [0, *np.cumsum([len(column) for column in columns]).tolist()],
        "indices": [int(i) for column in columns for i in column],
        "data": [int(R[i, k]) for k, column in enumerate(columns) for i in column],
        "exponents": exponents[::-1],
        "bits": bits,
        "power": power,
    }
