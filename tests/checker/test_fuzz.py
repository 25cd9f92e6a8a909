"""Mutants of certificates, judged by an oracle that shares nothing with the checker, and files made to exhaust it.

Every case is drawn from a seed and its number. To repeat one that failed:

    PTCC_FUZZ_SEED=0 PTCC_FUZZ_ONLY=123 python -m pytest -m "" tests/checker/test_fuzz.py -k mutant

``PTCC_FUZZ_COUNT`` sets how many are drawn. Mutations know nothing of the fields of a certificate: a new field is
changed like any other; its truth is judged once :mod:`oracle` has a method for it.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import random_mutants
from generators import all_classes, random_graph, smallest
from mutations import Json, at, changed, containers, leaves, resealed, same_claim
from oracle import false_claims
from random_mutants import Rng, fraction, mutant, pick, with_hash
from side_files import with_factors, with_side_files

import ptcc_certify
from ptcc_certify.bounds import final_state as final_states
from ptcc_certify.bounds.input.initial_set import box, ellipsoid
from ptcc_certify.certificate import procedure
from ptcc_certify.certificate.procedure import certify
from ptcc_certify.checker import check
from ptcc_certify.checker import graph as checked_graph
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.protocols import NominalProtocol, SlidingModeProtocol
from ptcc_certify.protocols.gain_limits import GainLimits

CLASSES = dict(all_classes())
SEED = int(os.environ.get("PTCC_FUZZ_SEED", "0"))
Case = tuple[str, Json, dict[str, bytes]]


def numbers(most: int) -> Iterator[int]:
    """The cases that are drawn."""
    only = os.environ.get("PTCC_FUZZ_ONLY")
    return iter([int(only)] if only else range(int(os.environ.get("PTCC_FUZZ_COUNT", most))))


# ---------------------------------------------------------------------- certificates to begin with


def made(name: str, seed: int, slides: bool = False, large: bool = False, **options: Any) -> Json:
    """A certificate of a small graph of a class."""
    rng = np.random.default_rng(seed)
    settings = {"weights": "decimals", **CLASSES[name]}
    settings["n"] = smallest(**CLASSES[name]) + int(rng.integers(0, 2)) * ("n" not in settings)
    graph = random_graph(rng, **settings).graph
    n = graph.n_nodes
    start: Any = [Fraction(int(v), 100) for v in rng.integers(-1000, 1001, n)]
    protocol: Any = NominalProtocol(T=1, rho1=1, rho2=options.pop("rho2", 1), kappa=2)
    if slides:
        kappa = Fraction(int(rng.integers(1, 6)), 2)
        protocol = SlidingModeProtocol(T_r="0.5", T_s=1, rho1=1, rho2=1, kappa=kappa, mu1=2, mu2=1, mu3=1, delta=1)
        options["sigma0"] = [Fraction(int(v), 100) * (seed % 2) for v in rng.integers(-200, 201, n)]
    if (initial_set := options.pop("initial_set", None)) is not None:
        axes = [[Fraction(i == j) / 2 + Fraction(j == 0) / 8 for i in range(n)] for j in range(n)]
        options["initial_set"] = ellipsoid([1] * n, axes) if initial_set == "ball" else box([-1] * n, [2] * n)
        start = None
    with pytest.MonkeyPatch.context() as patch:
        if large:
            patch.setattr(procedure, "EXACT_NODES", 0)
            patch.setattr(final_states, "EXACT_NODES", 0)
        certificate = certify(graph, protocol, start, simulation=False, **options)
        return {**json.loads(certificate.to_json()), "unverified": {}}


@cache
def cases() -> list[Case]:
    """True certificates of every kind."""
    found: list[Case] = []
    some = ("1.1", "1.2", "2.1 K>=2", "2.1 K=1", "2.2", "3.1 mixed", "3.1 all single", "3.2", "disconnected 1.1 2.1")
    for k, name in enumerate(some):
        found += [(f"{name}, {'sliding' if s else 'nominal'}", made(name, 4 + k + s, s), {}) for s in (False, True)]
    limits = [GainLimits(gain_cap=9), GainLimits(stop_before="0.01"), GainLimits(gain_cap=9, sample_period="0.000001")]
    for k, name in enumerate(("1.1", "2.1 K>=2", "2.2", "3.1 mixed")):
        more: Any = {
            "limits": limits,
            "delta": "0.1",
            "noise": "0.01",
            "rho2": 5,
            "initial_set": ("ball", "box", None)[k % 3],
        }
        found.append((f"{name}, limits", made(name, 6 + k, **more), {}))
    for k, name in enumerate(("1.1", "2.1 K>=2", "2.2", "3.1 mixed", "disconnected 1.1 2.1")):
        large = made(name, 5 + k, bool(k % 2), large=True)
        found += [(f"{name}, large", large, {}), (f"{name}, side files", *with_side_files(large))]
        if "disconnected" not in name:
            found.append((f"{name}, factors", *with_side_files(with_factors(large))))
    ring = SignedDigraph.from_edges([(1, 2, 1), (2, 3, 1), (3, 1, 1)])
    line = certify(ring, NominalProtocol(T=1, rho1=1, rho2="1/3", kappa=2), [1, 5, -2], simulation=False)
    found.append(("spectrum on the line", {**json.loads(line.to_json()), "unverified": {}}, {}))
    found.append(("undecided", made("1.1", 5, large=True, method="full"), {}))
    kinds = {data["verdict"] for _, data, _ in found}
    assert kinds == {"certified", "undecided"}
    return found


# ---------------------------------------------------------------------- mutations


def a_graft(rng: Rng, data: Json, files: dict[str, bytes]) -> Json:
    """A part of another certificate."""
    _, other, more = pick(rng, cases())
    path = pick(rng, [p for p in containers(data) if p])
    try:
        new = at(other, path)
    except (KeyError, IndexError, TypeError):
        return data
    files.update(more)
    return changed(data, path, new)


WAYS = [*random_mutants.WAYS, (a_graft, 0.04)]


def fuzzed(most: int) -> Counter[str]:
    """Judge mutants; return how many there were, and how many were accepted, all of which are true."""
    count: Counter[str] = Counter()
    for drawn in numbers(most):
        rng = np.random.default_rng([SEED, drawn])
        name, data, files = pick(rng, cases())
        files = dict(files)
        made, ways = mutant(rng, data, files, WAYS)
        if same_claim(made, data):
            count["unchanged"] += 1
            continue
        count["mutants"] += 1
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(checked_graph, "MANY_EDGES", int(rng.choice([0, 10_000])))
            report = check(made, stdlib=bool(rng.random() < 0.3), files=files)
        where = f"mutant {drawn} of seed {SEED}: {name} by {', '.join(ways)}"
        assert report.accepted or (report.rejected and report.reason), where
        assert "MemoryError" not in (report.reason or ""), where
        if report.accepted:
            count["accepted"] += 1
            assert (false := false_claims(made, files)) == [], f"{where}: {false[:3]}"
    return count


def test_no_mutant_is_accepted_that_is_false():
    count = fuzzed(80)
    assert os.environ.get("PTCC_FUZZ_ONLY") or (count["accepted"] > 0 and count["mutants"] > 40)


@pytest.mark.campaign
def test_no_mutant_of_twenty_thousand_is_accepted_that_is_false(capsys: pytest.CaptureFixture[str]):
    count = fuzzed(24_000)
    with capsys.disabled():
        print(f"\nseed {SEED}: {dict(count)}")
    assert os.environ.get("PTCC_FUZZ_ONLY") or count["mutants"] >= 20_000


def test_the_oracle_finds_nothing_false_in_what_is_proved():
    for name, data, files in cases():
        assert false_claims(data, files) == [], name


@cache
def with_limits() -> Json:
    limits = [GainLimits(gain_cap=9), GainLimits(stop_before="0.01")]
    data = made("2.1 K>=2", 7, limits=limits, noise="0.01", rho2=5)
    assert false_claims(data) == []
    return data


@pytest.mark.parametrize(
    ("path", "share"),
    [
        (("lyapunov", "functions", 0, "rate"), "1.01"),
        (("lyapunov", "functions", -1, "deviation", "norm"), "0.5"),
        (("lyapunov", "functions", -1, "overshoot"), "0.5"),
        (("rates", "upper_bound"), "0.5"),
        (("rates", "proved"), "1.01"),
        (("input", "threshold", "lower"), "3"),
        (("input", "peak", "norm"), "0.1"),
        (("input", "energy"), "0.001"),
        (("input", "path_length"), "0.1"),
        (("input", "residual", 0, "clock"), "1.01"),
        (("input", "residual", 0, "norm"), "1e-6"),
        (("input", "residual", 1, "largest"), "0.01"),
        (("input", "residual", 0, "noise", "norm"), "1e-3"),
        (("initial_state",), ""),
        (("graph", "edges"), ""),
    ],
)
def test_the_oracle_sees_what_is_false(path: tuple[Any, ...], share: str):
    data = with_limits()
    if path == ("initial_state",):
        data = changed(data, path, dict.fromkeys(data["initial_state"], "1"))
    elif path == ("graph", "edges"):
        data = changed(data, path, data["graph"]["edges"][1:])
    else:
        data = changed(data, path, str(Fraction(at(data, path)) * Fraction(share)))
    assert false_claims(data) != []


# ---------------------------------------------------------------------- files made to exhaust the checker

MEMORY, SECONDS = 10**9, 10
#: Text from which a file is put together without keeping the whole.
Parts = list[bytes]


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
    key = pick(rng, [None, "graph", "lyapunov", "final_state", "proof", "input", "protocol", "initial_state", "paper"])
    for path, value in list(leaves(data)):
        if fraction(value) is not None and (key is None or path[0] == key) and rng.random() < share:
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
        data = {**data, "graph": {**data["graph"], "nodes": nodes, "edges": []}}
        data = {**data, "structure": {**data["structure"], "closed_components": closed, "leaders": nodes}}
        return [dumped(resealed(with_hash(data)))]
    long = pick(rng, ["x", "\U0001f600", "\x01", "\x7f", "é"]) * int(10 ** rng.uniform(2, 6.5))
    nodes = [long, *data["graph"]["nodes"][1:]]
    return [dumped(changed(data, ("graph", "nodes"), nodes))]


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
    graph = {"nodes": nodes, "edges": edges, "read": data["graph"]["read"], "sha256": ""}
    lower = [["1" if rng.random() < 0.5 else "2"] * i + [str(4 * n)] for i in range(n)]
    for _ in range(few):
        i = int(rng.integers(n))
        lower[i][int(rng.integers(i + 1))] = long_text(rng, digits)
    with_graph = with_hash({"graph": graph})["graph"]
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
        "rho": None,
    }
    function |= {"rate": pick(rng, ["1/2", "-9", long_text(rng, digits)]), "overshoot": "1", "deviation": None}
    steps = [s for s in data["proof"] if s["kind"] in ("structure", "claim")]
    stated = {"proves": "P L + L'P - b P > 0 on the range of L", "lemma": "Lyapunov decrease"}
    steps.append(
        {"kind": "rate", "of": "lyapunov.functions[0]", **stated, "numbers": {"b": function["rate"]}, "witness": None}
    )
    data = {
        **data,
        "graph": with_graph,
        "structure": structure,
        "claim": {"theorem": row[0], "behaviour": row[1], "corollaries": corollaries},
        "protocol": {"kind": "nominal", "T": "1", "rho1": "1", "rho2": "1", "kappa": "2"},
        "paper": None,
        "lyapunov": {"functions": [function] * int(rng.choice([1, 1, 5]))},
        "initial_state": None,
        "sliding_variable": None,
        "influence": None,
        "final_state": None,
        "reaching_time": None,
        "proof": steps,
    }
    data.pop("components", None)
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
    edges = data["graph"]["edges"]
    if isinstance(edges, dict) and rng.random() < 0.3:
        data = changed(data, ("graph", "edges", "count"), int(10 ** rng.uniform(0, 15)))
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
    if data["reaching_time"] is None:
        return long_numbers(rng, data, files)
    digits = int(10 ** rng.uniform(0.7, 3.5))
    gains = pick(rng, [["1900", "40"], ["1/1000000", "1/3"], [long_text(rng, digits), long_text(rng, digits)]])
    data = changed(data, ("protocol",), {**data["protocol"], "mu2": gains[0], "mu3": gains[1]})
    z = {label: long_text(rng, digits) for label in data["graph"]["nodes"]}
    return [dumped(resealed(changed(data, ("reaching_time", "z"), z)))]


HOSTILE = [cut, flipped, noise, wide, deep, long_numbers, many, labels, star, lying, factors, instants]


@pytest.fixture(scope="module")
def worker() -> Iterator[Callable[[Path], Json]]:
    """Checks a file in a process of limited memory and time."""
    environment = {**os.environ, "PYTHONPATH": str(Path(ptcc_certify.__file__).parents[1])}
    script = Path(__file__).parents[1] / "hostile_worker.py"
    process = subprocess.Popen(
        [sys.executable, str(script), str(MEMORY), str(SECONDS)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    )
    assert process.stdin and process.stdout

    def judge(path: Path) -> Json:
        print(path, file=process.stdin, flush=True)
        return json.loads(process.stdout.readline())

    yield judge
    process.stdin.close()
    process.wait(20)


def attacked(judge: Callable[[Path], Json], folder: Path, most: int) -> Json:
    """Judge hostile files; return how they were answered, the largest memory and the longest time."""
    codes: Counter[int] = Counter()
    worst: Json = {"memory": (0, ""), "seconds": (0.0, "")}
    beyond: list[str] = []
    for drawn in numbers(most):
        rng = np.random.default_rng([SEED, 1, drawn])
        name, data, files = pick(rng, cases())
        files, way = dict(files), HOSTILE[drawn % len(HOSTILE)]
        path = folder / f"{drawn}.json"
        with path.open("wb") as file:
            file.writelines(way(rng, data, files))
        for file_name, content in files.items():
            (folder / file_name).write_bytes(content)
        found = judge(path)
        size = path.stat().st_size
        where = f"file {drawn} of seed {SEED}: {way.__name__} of {name}, {size} bytes: {found}"
        within = found["memory"] <= MEMORY and found["seconds"] <= SECONDS
        if not within or found["code"] not in (0, 1, 2, 4) or "MemoryError" in found["said"]:
            beyond.append(where)
        codes[found["code"]] += 1
        for key in worst:
            worst[key] = max(worst[key], (found[key], where))
        path.unlink()
        for file_name in files:
            (folder / file_name).unlink()
    assert beyond == []
    return {"codes": dict(codes), **worst}


@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited by the system on Linux only")
def test_hostile_files_stay_within_a_gigabyte_and_ten_seconds(worker: Callable[[Path], Json], tmp_path: Path):
    attacked(worker, tmp_path, 24)


@pytest.mark.campaign
@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited by the system on Linux only")
def test_two_thousand_hostile_files_stay_within_a_gigabyte_and_ten_seconds(
    worker: Callable[[Path], Json], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    found = attacked(worker, tmp_path, 2400)
    with capsys.disabled():
        print(f"\nseed {SEED}: {found}")
