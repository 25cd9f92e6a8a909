"""Files made to exhaust a checker: each is drawn from a true certificate, and comes in parts."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from mutations import EDGES, Json, at, changed, containers, leaves, part_of, resealed
from random_mutants import Rng, fraction, pick, with_hash

from ptcc_certify.checker.obligations import OBLIGATIONS

READ = {"orientation": "information", "duplicates": "refused", "self_loops": "refused", "undirected": False}

GAIN = {"kind": "nominal", "T": "1", "rho1": "1", "rho2": "1", "kappa": "2"}

#: Text from which a file is put together without keeping the whole.
Parts = list[bytes]


def left_out(data: Json, *keys: str) -> Json:
    """Without some parts."""
    return {key: x for key, x in data.items() if key not in keys}


def with_graph(data: Json, nodes: list[str]) -> Json:
    """With other nodes, and without edges."""
    graph = data["problem"]["graph"]
    modes = [{**mode, "edges": []} for mode in graph["modes"]]
    return {**data, "problem": {**data["problem"], "graph": {**graph, "nodes": nodes, "modes": modes}}}


def dumped(data: Json) -> bytes:
    return json.dumps(data).encode()


def long_text(rng: Rng, digits: int) -> str:
    """A number of so many digits, whose denominator has no factor in common with others."""
    top, bottom = (int(rng.integers(10**17)) + 10 ** max(digits // 2 - 1, 0) for _ in range(2))
    kinds = (
        f"{top}/{bottom}",
        f"1/{bottom}",
        f"{rng.integers(10**9)}.{bottom}",
        f"{rng.integers(1, 10**9)}e{rng.choice([400, -400, 399, -7])}",
        f"0x1.{'f' * min(digits, 3900)}p{rng.choice([1400, -1400, 0])}",
    )
    return kinds[int(rng.choice(5, p=[0.35, 0.3, 0.15, 0.15, 0.05]))]


def cut(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    whole = dumped(data)
    return [whole[: int(rng.integers(len(whole)))]]


def flipped(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    whole = bytearray(dumped(data))
    for _ in range(int(rng.integers(1, 30))):
        whole[int(rng.integers(len(whole)))] ^= 1 << int(rng.integers(8))
    for name in list(files)[:2]:
        content = bytearray(files[name])
        content[int(rng.integers(len(content)))] ^= 1 << int(rng.integers(8))
        files[name] = bytes(content)
    return [bytes(whole)]


def noise(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    whole, k = dumped(data), int(rng.integers(2000))
    place = int(rng.integers(len(whole)))
    return [whole[:place], rng.bytes(k), whole[place + int(rng.integers(k + 1)) :]]


def filled(rng: Rng, data: Json, piece: bytes, size: int) -> Parts:
    """A certificate with so many bytes of the same piece in an array at a random place, or under ``unverified``."""
    mark = "0f1e2d3c4b5a"
    path = ("unverified",) if rng.random() < 0.6 else pick(rng, [p for p, _ in leaves(data)])
    value: Any = {"x": mark} if path == ("unverified",) else mark
    whole = dumped(changed(data, path, value))
    first, last = whole.split(f'"{mark}"'.encode(), 1)
    return [first, b"[", (piece + b",") * (size // (len(piece) + 1)), piece, b"]", last]


def wide(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    pieces = [b"[]", b"{}", b"1", b"257", b"1.5", b'""', b'"a"', b'{"a":1}', b"[[]]", b"null", b'{"a":{}}', b'"1e400"']
    pieces += [b'"' + b"x" * 4000 + b'"', '"\U0001f600"'.encode(), b'"\\u0001"', b'"\x7f\x7f\x7f\x7f\x7f\x7f\x7f\x7f"']
    return filled(rng, data, pick(rng, pieces), int(10 ** rng.uniform(4, 7.4)))


def deep(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    depth = int(10 ** rng.uniform(0.5, 6))
    opened, closed = pick(rng, [(b"[", b"]"), (b'{"a":', b"}")])
    inner = opened * depth + b"1" + closed * (depth if rng.random() < 0.7 else depth // 2)
    return filled(rng, data, inner, len(inner))


def long_numbers(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    """Long numbers in place of one of so many, in a part or everywhere."""
    share, digits = 10 ** rng.uniform(-2, 0), int(10 ** rng.uniform(1, 3.58))
    key = pick(rng, [None, "graph", "decays", "final_state", "proof", "input", "gain", "initial_state", "paper"])
    for path, value in list(leaves(data)):
        if fraction(value) is not None and (key is None or part_of(path) == key) and rng.random() < share:
            data = changed(data, path, long_text(rng, digits))
    with contextlib.suppress(KeyError, TypeError, ValueError):
        data = with_hash(data)
    return [dumped(resealed(data))]


def many(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    """The same entry many times: functions, obligations, limits, components, nodes, rows."""
    lists = [p for p in containers(data) if isinstance(at(data, p), list) and at(data, p)]
    path = pick(rng, lists)
    said, count = at(data, path), int(10 ** rng.uniform(1, 5))
    count = min(count, 20_000_000 // (len(json.dumps(said)) + 1))
    new = said * max(count, 2)
    if rng.random() < 0.5 and all(isinstance(x, str) for x in said):
        new = [f"{x}{k}" for k, x in enumerate(new)]
    return [dumped(resealed(changed(data, path, new)))]


def labels(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    """Long or odd labels, or very many of them."""
    if rng.random() < 0.5:
        n = int(10 ** rng.uniform(2, 5.3))
        nodes = [f"{k}" for k in range(n)]
        closed = [{"nodes": [x], "balanced": True, "gauge": [1]} for x in nodes] if rng.random() < 0.5 else []
        data = with_graph(data, nodes)
        structure = {**data["structure"][0], "closed_components": closed, "leaders": nodes}
        data = {**data, "structure": [structure, *data["structure"][1:]]}
        return [dumped(resealed(with_hash(data)))]
    long = pick(rng, ["x", "\U0001f600", "\x01", "\x7f", "é"]) * int(10 ** rng.uniform(2, 6.5))
    nodes = [long, *data["problem"]["graph"]["nodes"][1:]]
    return [dumped(changed(data, ("problem", "graph", "nodes"), nodes))]


def star(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    """A star or a dense graph with a matrix whose few long entries have no common denominator."""
    n = int(rng.integers(20, 420))
    dense = rng.random() < 0.3 and n < 150
    ends = [(i, j) for i in range(n) for j in range(n) if i != j and (dense or i == 0 or (j == 0 and i == 1))]
    digits = int(10 ** rng.uniform(0, 3.5))
    few = int(rng.choice([0, 8, 30, 1000]))
    weights = {k: long_text(rng, digits) for k in rng.integers(len(ends), size=int(rng.choice([0, 0, 5]))).tolist()}
    nodes = [str(k) for k in range(n)]
    edges = [[str(i), str(j), weights.get(k, "1")] for k, (i, j) in enumerate(ends)]
    graph = {"nodes": nodes, "modes": [{"edges": edges}], "read": READ, "sha256": ""}
    lower = [["1" if rng.random() < 0.5 else "2"] * i + [str(4 * n)] for i in range(n)]
    for _ in range(few):
        i = int(rng.integers(n))
        lower[i][int(rng.integers(i + 1))] = long_text(rng, digits)
    problem = with_hash({"problem": {"graph": graph, "gain": GAIN}})["problem"]
    structure = {
        "connectivity": "strong" if dense else "quasi-strong",
        "closed_components": [
            {"nodes": nodes if dense else nodes[:2], "balanced": True, "gauge": [1] * (n if dense else 2)}
        ],
        "leaders": nodes if dense else nodes[:2],
        "followers": [] if dense else nodes[2:],
        "balanced": True,
        "sign_symmetric": True,
    }
    row = ("1.1", "bipartite consensus", "strong") if dense else ("2.1", "interval bipartite consensus", "quasi-strong")
    mutual = {(s, t): w for s, t, w in edges}
    equal = all(mutual.get((t, s)) == w for (s, t), w in mutual.items())
    corollaries = [*(["1.1"] if equal else []), "2"] if dense else ["3", "4"]
    block = {"name": "P", "nodes": nodes, "times_rho": False}
    kind = pick(rng, ["full", "lmi"])
    shape = {"lower_triangle": lower} if kind == "full" else {"diagonal": [row[-1] for row in lower]}
    function = {
        "class": "full" if kind == "full" else "lmi",
        "coordinates": "E",
        "blocks": [{**block, **shape}],
        "rate": pick(rng, ["1/2", "-9", long_text(rng, digits)]),
        "overshoot": "1",
    }
    steps = [s for s in data["proof"] if s["kind"] in ("structure", "claim")]
    stated = {"proves": "P L + L'P - b P > 0 on the range of L", "lemma": "Lyapunov decrease"}
    steps.append({"kind": "rate", "of": "decays[0]", **stated, "numbers": {"b": function["rate"]}})
    data = {
        **data,
        "problem": problem,
        "structure": [structure],
        "claim": {"theorem": row[0], "behaviour": row[1], "corollaries": corollaries},
        "decays": [function] * int(rng.choice([1, 1, 5])),
        "proof": steps,
    }
    data = left_out(data, "paper", "influence", "final_state", "reaching_time", "components")
    if rng.random() < 0.6:
        data = with_influence(rng, data, digits)
    return [dumped(resealed(data))]


def lying(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    """Side files of another size, type, header or content than they are said to have."""
    paths = [p for p in containers(data) if isinstance(at(data, p), dict) and "file" in at(data, p)]
    for path in [pick(rng, paths) for _ in range(2)] if paths else []:
        said = at(data, path)
        count = int(10 ** rng.uniform(0, 12))
        size = int(10 ** rng.uniform(0, 6.5))
        kind = pick(rng, ["<i8", "<f8", "|O", ">i8", "<U9"])
        shape = pick(rng, [f"({count},)", f"({size},)", f"({count}, {count})", "()"])
        head = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
        content = b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head.encode()
        content += pick(rng, [rng.bytes(8 * size), bytes(8 * size), b"\x00\x00\x00\x00\x00\x00\xf0\x7f" * size, b""])
        sha256 = hashlib.sha256(content).hexdigest()
        files[f"{sha256[:16]}.npy"] = content
        new = {**said, "file": f"{sha256[:16]}.npy", "sha256": sha256}
        if "count" in said:
            new["count"] = pick(rng, [said["count"], count, size, 10**18 - 1])
        data = changed(data, path, new)
    edges = data["problem"]["graph"]["modes"][0]["edges"]
    if isinstance(edges, dict) and rng.random() < 0.3:
        data = changed(data, (*EDGES, "count"), int(10 ** rng.uniform(0, 15)))
    return [dumped(resealed(data))]


def factors(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    """Factors of leader groups with very many, very long or very far entries."""
    for path in [p for p in containers(data) if isinstance(at(data, p), dict) and "indptr" in at(data, p)]:
        said, size = at(data, path), int(10 ** rng.uniform(0, 6))
        new: Json = {
            "bits": pick(rng, [said["bits"], 65_536, -65_536, 10**17, 0]),
            "power": pick(rng, [said["power"], 65_536, -65_536, 10**17]),
            "exponents": pick(rng, [said["exponents"], [65_536] * size, [-65_536, 65_536]]),
            "data": pick(rng, [said["data"], [2**62] * size, [10**17] * size]),
            "indptr": pick(rng, [said["indptr"], [0, size], list(range(size))]),
            "indices": pick(rng, [said["indices"], list(range(size))]),
        }
        for key in rng.choice(list(new), int(rng.integers(1, 4)), replace=False).tolist():
            data = changed(data, (*path, key), new[key])
    return [dumped(resealed(data))]


def instants(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    """Sliding variables of many agents, all with reaching times of their own, and extreme gains."""
    if "reaching_time" not in data:
        return long_numbers(rng, data, files)
    digits = int(10 ** rng.uniform(0.7, 3.5))
    gains = pick(rng, [["1900", "40"], ["1/1000000", "1/3"], [long_text(rng, digits), long_text(rng, digits)]])
    data = changed(data, ("problem", "gain"), {**data["problem"]["gain"], "mu2": gains[0], "mu3": gains[1]})
    z = {label: long_text(rng, digits) for label in data["problem"]["graph"]["nodes"]}
    return [dumped(resealed(changed(data, ("reaching_time", "z"), z)))]


def with_influence(rng: Rng, data: Json, digits: int) -> Json:
    """With left null vectors and weights of followers, whatever these are, and an initial state: not undecided."""
    nodes, structure = data["problem"]["graph"]["nodes"], data["structure"][0]
    groups = [c for c in structure["closed_components"] if c["balanced"]]
    long = lambda: long_text(rng, digits) if rng.random() < 0.1 else "1"  # noqa: E731
    vectors = [{"nodes": c["nodes"], "left_null_vector": [long() for _ in c["nodes"]]} for c in groups]
    weights = {label: [long() for _ in groups] for label in structure["followers"]}
    begin = {label: long() for label in nodes}
    step = {"kind": "final-state", "of": "graph"}
    step |= {"proves": "L Q = 0 and Q(x - sigma) is kept, so the agents end at Q(X(0) - sigma(0))"}
    step |= {"lemma": "Lemmas 2, 8 and 9"}
    proof = [*data["proof"][:2], step, *data["proof"][2:]]
    influence = {"components": vectors, "containment_weights": weights, "degenerate": []}
    problem = {**data["problem"], "initial_state": begin}
    return {**data, "problem": problem, "influence": influence, "final_state": begin, "proof": proof}


@cache
def colliding() -> list[str]:
    """Texts of eight letters that take the hash of OCaml's tables from one state to the same one."""
    u, low = np.uint64, np.uint64(2**32 - 1)
    c1, c2, c3 = u(0xCC9E2D51), u(0x1B873593), u(0xE6546B64)

    def turned(x: Any, r: int) -> Any:
        return ((x << u(r)) | (x >> u(32 - r))) & low

    def mixed(h: Any, k: Any) -> Any:
        return (turned(h ^ (turned(k * c1 & low, 15) * c2 & low), 13) * u(5) + c3) & low

    letters = np.random.default_rng(0).integers(35, 92, (400_000, 4), dtype=np.uint64)
    state = mixed(u(0), (letters << np.array([0, 8, 16, 24], np.uint64)).sum(1, dtype=np.uint64))
    # the second word that brings every state back to 0: the steps of the mixing undone
    k = state ^ turned(u(pow(5, -1, 2**32)) * (u(2**32) - c3) & low, 19)
    k = turned(k * u(pow(int(c2), -1, 2**32)) & low, 17) * u(pow(int(c1), -1, 2**32)) & low
    second = np.stack([(k >> u(8 * i)) & u(255) for i in range(4)], 1)
    plain = ((second >= 35) & (second < 92)).all(1)
    assert set(mixed(state[plain], k[plain]).tolist()) == {0}
    words = np.concatenate([letters[plain], second[plain]], 1).astype(np.uint8)
    return sorted({bytes(word).decode() for word in words})


def collisions(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    """Keys or labels that collide in a table of hashes, or have a long beginning in common."""
    some, count = colliding(), int(10 ** rng.uniform(2, 4.7))
    texts = [a + b for a in some for b in some][:count]
    if rng.random() < 0.4:
        texts = ["x" * 3900 + f"{k}" for k in range(5000)]
    if rng.random() < 0.6:
        return [dumped({**data, "unverified": dict.fromkeys(texts, 0)})]
    data = with_graph(data, texts)
    with contextlib.suppress(KeyError, TypeError, ValueError):
        data = with_hash(data)
    return [dumped(resealed(data))]


def blanks(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    """Hundreds of megabytes of blanks, of one text, of escapes, of wide characters."""
    piece = pick(rng, [b" ", b"\n", b"x", b"\\u0041", b"\\\\", "\U0001f600".encode(), "\u00e9".encode()])
    count = int(10 ** rng.uniform(6, 8.3)) // len(piece)
    wide = pick(rng, [b"", "\U0001f600".encode()])
    whole = dumped({**data, "unverified": {"x": "0f1e2d3c4b5a"}})
    mark = b'"0f1e2d3c4b5a"' if piece in (b" ", b"\n") else b"0f1e2d3c4b5a"
    first, last = whole.split(mark, 1)
    return [first, *([piece * 100_000] * (count // 100_000)), b'""' if mark[:1] == b'"' else wide, last]


def sparse(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    """Very many nodes that all listen to the first, with few rows of a matrix, or with many long ones."""
    few = rng.random() < 0.5
    n, digits = int(10 ** rng.uniform(2, 4.5 if few else 2.4)), int(10 ** rng.uniform(0, 3.5))
    nodes, rows = [str(k) for k in range(n)], int(10 ** rng.uniform(0, 2)) if few else n - 1
    own = nodes[1:]
    entry = lambda i, j: str(4 * n) if i == j and few else long_text(rng, digits) if not few else "0"  # noqa: E731
    lower = [[entry(i, j) for j in range(i + 1)] for i in range(min(rows, n - 1))]
    block = {"name": "P", "nodes": own, "times_rho": False}
    shape = {"lower_triangle": lower} if rng.random() < 0.7 else {"diagonal": [row[-1] for row in lower]}
    function = {"class": "full" if "lower_triangle" in shape else "lmi", "coordinates": "E"}
    function |= {"blocks": [{**block, **shape}], "rate": "1", "overshoot": "1"}
    steps = [("structure", "graph.modes[0]", {}), ("claim", "graph", {}), ("final-state", "graph", {})]
    steps += [("rate", "decays[0]", {"b": "1"})]
    steps += [("overshoot", "decays[0]", {"lowest": "1", "highest": "1"})] * ("lower_triangle" in shape)
    proof = [{"kind": kind, "of": of} | ({"numbers": values} if values else {}) for kind, of, values in steps]
    edges = [["0", x, "1"] for x in own]
    graph = {"nodes": nodes, "modes": [{"edges": edges}], "read": READ, "sha256": ""}
    data = {
        **data,
        "problem": {"graph": graph, "gain": GAIN},
        "structure": [
            {
                **{"connectivity": "quasi-strong", "balanced": True, "sign_symmetric": True},
                **{"closed_components": [{"nodes": ["0"], "balanced": True, "gauge": [1]}], "leaders": ["0"]},
                "followers": own,
            }
        ],
        "claim": {"theorem": "2.1", "behaviour": "interval bipartite consensus", "corollaries": ["3", "4"]},
        "decays": [function] * int(rng.choice([1, 3])),
        "rates": {"proved": "1"},
        "overshoot": {"value": "1", "of": "||E||^2"},
        "influence": {
            "components": [{"nodes": ["0"], "left_null_vector": ["1"]}],
            **{"containment_weights": {x: ["1"] for x in own}},
        },
        "proof": [{**step, **dict(zip(("proves", "lemma"), OBLIGATIONS[step["kind"]], strict=True))} for step in proof],
    }
    data = left_out(data, "paper", "final_state", "reaching_time", "components")
    return [dumped(resealed(with_hash(data)))]


def nearly(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    """Numbers that are longer, and nearly the same: what rests on them is formed, and nearly holds."""
    digits, share = int(10 ** rng.uniform(1, 3.2)), 10 ** rng.uniform(-2, 0)
    key = pick(rng, ["decays", "decays", "influence", "final_state", "initial_state", "graph", "proof", "paper"])
    common = 10**digits + int(rng.integers(10**9))
    same = rng.random() < 0.5
    for path, text in [p for p in leaves(data) if part_of(p[0]) == key and "sha256" not in p[0]]:
        value = fraction(text)
        if value and rng.random() < share:
            q = common + (0 if same else int(rng.integers(10**9)))
            data = changed(data, path, f"{value.numerator * (q + 1)}/{value.denominator * q}")
    with contextlib.suppress(KeyError, TypeError, ValueError):
        data = with_hash(data)
    return [dumped(resealed(data))]


def modes(rng: Rng, data: Json, files: dict[str, bytes]) -> Parts:
    """A family of very many modes, or of modes with many edges; of other certificates many of everything."""
    if "signal" not in data["problem"]:
        return many(rng, data, files)
    count = int(10 ** rng.uniform(1, 3.6))
    kinds, structure = data["problem"]["graph"]["modes"], data["structure"]
    new = [{**kinds[k % len(kinds)], "name": f"m{k}"} for k in range(count)]
    data = changed(data, ("problem", "graph", "modes"), new)
    data = changed(data, ("structure",), [structure[k % len(kinds)] for k in range(count)])
    step = next(s for s in data["proof"] if s["kind"] == "structure")
    steps = [{**step, "of": f"graph.modes[{k}]"} for k in range(count)]
    rates = [s for s in data["proof"] if s["kind"] == "family-rate"]
    steps += [s for s in data["proof"] if s["kind"] not in ("structure", "family-rate")]
    for k in range(count if rates else 0):
        steps.append({**rates[0], "of": f"decays[0].modes[{k}]"})
    return [dumped(resealed(with_hash({**data, "proof": steps})))]


HOSTILE: list[Callable[[Rng, Json, dict[str, bytes]], Parts]] = [
    *(cut, flipped, noise, wide, deep, long_numbers, many, labels, star, lying, factors, instants),
    *(collisions, blanks, sparse, modes, nearly),
]
