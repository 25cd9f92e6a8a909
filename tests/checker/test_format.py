"""``FORMAT.md`` and the JSON schema describe what is written, and nothing else."""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterator
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from generators import KINDS, all_classes, random_graph, smallest
from jsonschema import Draft202012Validator  # type: ignore[import-untyped]
from mutations import EDGES, Json, at, changed, containers, leaves, without
from schema_validator import VALIDATOR
from selection import thinned
from side_files import with_factors, with_side_files

from ptcc_certify import checker
from ptcc_certify.bounds.final_state import enclosed_ends
from ptcc_certify.bounds.final_state import of_graph as final_states
from ptcc_certify.certificate import graph_certification
from ptcc_certify.certificate import section_io as vectors
from ptcc_certify.certificate.certification import certify
from ptcc_certify.certificate.json_schema import json_schema
from ptcc_certify.checker import MANY_COMPONENTS, OBLIGATIONS, check
from ptcc_certify.checker.contents import BRINGS
from ptcc_certify.checker.reading import RejectedError, exact
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.asks import Asks, InitialState

FOLDER = Path(checker.__file__).parent
FORMAT = (FOLDER / "FORMAT.md").read_text(encoding="utf-8")
SCHEMA = json_schema()
GRAPH, FAMILY = (SCHEMA["$defs"][f"{kind}Certificate"] for kind in ("Graph", "Family"))
CORPUS = Path(__file__).parents[1] / "corpus"
CLASSES = dict(all_classes())
NOMINAL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
SLIDING = SlidingModeProtocol(T_r="0.5", T_s=1, rho1=1, rho2=1, kappa="1.5", mu1=2, mu2=1, mu3=1, delta=1)
SAMPLE = (("1.1", False), ("2.1 K>=2", True), ("3.1 mixed", False), ("disconnected 1.2 2.1 isolated", True))
BAD_NUMBERS: tuple[Any, ...] = (
    "", " 1", "1 ", "1\n", "+", ".", "1.e", "1e401", "1e-401", "1e000400", "0x1p1401", "0x.8p1", "0x1", "1/0", "1/-2",
    "1/2/3", "1.5/2", "1_0", "١", "inf", "nan", "9" * 4001, 1, 0.5, True, [], ["1"], {"mid": "1"},
)  # fmt: skip
GOOD_NUMBERS = (
    "0", "-12", "+7", "007", "3/4", "-6/008", "0.1", "5.", ".5", "-.5e-3", "1E400", "1e-00400", "2e+9", "9" * 4000,
    "0x1.8p-1", "-0XaB.P+1400", "0x1p-01400", "0x0p0",
)  # fmt: skip


@cache
def made(name: str, slides: bool = False, method: str = "paper") -> Json:
    """The JSON of a certificate of a small graph of one class, with labels that are no numbers."""
    rng = np.random.default_rng(list(CLASSES).index(name))
    kwargs: dict[str, Any] = {"weights": "decimals", **CLASSES[name]}
    fixed = "n" in kwargs or (kwargs.get("isolated") and not kwargs["parts"])
    drawn = random_graph(rng, **{**kwargs, "n": smallest(**kwargs) + 2 * (not fixed)}).graph
    edges = [(f"a{s}", f"a{t}", w) for s, t, w in drawn.edges]
    graph = SignedDigraph.from_edges(edges, [f"a{v}" for v in drawn.labels])
    start = [Fraction(int(v), 100) for v in rng.integers(-1000, 1001, graph.n_nodes)]
    sigma0 = [Fraction(int(v), 100) for v in rng.integers(-200, 201, graph.n_nodes)] if slides else None
    protocol = SLIDING if slides else NOMINAL
    return json.loads(
        certify(
            graph, protocol, InitialState(start, sigma0=sigma0), asks=Asks(simulation=False, method=method)
        ).to_json()
    )


def valid(data: Any) -> bool:
    return VALIDATOR.is_valid(data)


def depth(value: Any) -> int:
    items = value.values() if isinstance(value, dict) else value if isinstance(value, list) else None
    return 0 if items is None else 1 + max(map(depth, items), default=0)


def objects(schema: Any) -> Iterator[Json]:
    """Every object schema below a schema, ``unverified`` left out."""
    if isinstance(schema, dict):
        if "properties" in schema and schema.get("type") == "object":
            yield schema
        for key, item in schema.items():
            if key != "unverified":
                yield from objects(item)
    elif isinstance(schema, list):
        for item in schema:
            yield from objects(item)


def obligation_table(section: str) -> list[str]:
    text = FORMAT.partition(f"\n## {section}.")[2].partition("\n## ")[0]
    return re.findall(r"^\| `([a-z-]+)` \| `[a-z]", text, re.MULTILINE)


def example() -> Json:
    text = FORMAT.partition("## 20. Example")[2]
    return json.loads(re.findall(r"```json\n(.*?)```", text, re.DOTALL)[0])


# ---------------------------------------------------------------------- the schema


def test_the_schema_is_a_strict_schema():
    Draft202012Validator.check_schema(SCHEMA)
    assert SCHEMA["$id"] == checker.SCHEMA
    for found in objects(SCHEMA):
        assert found["additionalProperties"] is False
    sections = {name: found for name, found in SCHEMA["$defs"].items() if "required" in found}
    left_out = {name: set(found["properties"]) - set(found["required"]) for name, found in sections.items()}
    assert {name: keys for name, keys in left_out.items() if keys} == {
        "GraphCertificate": {
            *("claim", "components", "paper", "overshoot", "influence", "final_state", "reaching_time", "input"),
            *("agents", "messages", "formation", "phases", "instants"),
        },
        "FamilyCertificate": {
            *("claim", "components", "drives", "final_state", "reaching_time", "boxes", "restricted", "messages"),
            "formation",
        },
        "GraphProblem": {"initial_state", "sliding_variable"},
        "SignalProblem": {"initial_state", "sliding_variable"},
        "ModeSection": {"undirected"},
        "ReadSection": {"zeros", "laplacian", "columns", "variable"},
        "SlidingSection": {"disturbance"},
        "ComponentSection": {"final_state"},
        "PaperSection": {"rho", "rho_interval", "rate", "overshoot"},
        "RhoInterval": {"printed", "exact"},
        "BlockSection": {"diagonal", "lower_triangle"},
        "FactorSection": {"weights", "parents"},
        "FunctionSection": {"rho", "deviation"},
        "RatesSection": {"paper", "diagonal", "proved", "upper_bound"},
        "InfluenceSection": {"containment_weights", "degenerate"},
        "FormationSection": {"initial_state", "final_state"},
        "InputSection": {"bounded", "initial_set", "peak", "energy", "path_length", "sliding", "disturbed"},
        "Threshold": {"lower", "upper"},
        "SlidingPart": {"agents"},
        "LimitedSection": {"gain_cap", "stop_before", "sample_period", "agents", "largest", "noise"},
        "DisturbedSection": {"drift"},
        "FamilyInput": {"bounded", "peaks", "sliding"},
        "RateSection": {"forms", "bounded"},
        "LastModeSection": {"final_state"},
        "WindowsSection": {"final_state"},
        "SharesSection": {"behaviour", "final_state"},
        "FinalValue": {"above", "below"},
        "Counterexample": {"edge"},
        "AgentsSection": {"gain_cap", "initial_state", "final_state", "residual", "input"},
        "UsedSection": {"inputs"},
        "CascadeSection": {"initial_state", "final_state", "input"},
        "TrackedSection": {"inputs", "initial", "drive"},
        "MessagesSection": {
            *("packets", "gain_cap", "leaders", "steps", "residual", "missed", "staged", "settling", "form", "lmi"),
            *("forms", "input", "vehicles"),
        },
        "LateForm": {"floor"},
        "LateFormWitness": {"psi"},
        "LateLMI": {"floor"},
        "LateLMIWitness": {"errors"},
        "LateFamilyForm": {"sizes", "floor", "push", "growth"},
        "Moving": {"sign_gain", "growth", "saturation"},
        "RowsBound": {"cap", "clock", "drift", "after", "start", "turn", "level"},
        "VehiclesSection": {"velocity", "input", "a3", "a0", "orders", "disturbance"},
    }


def test_no_key_may_be_null():
    for found in objects(SCHEMA):
        for key, one in found["properties"].items():
            assert {"type": "null"} not in one.get("anyOf", [one]), key


@pytest.mark.few(12)
@pytest.mark.parametrize("path", sorted(CORPUS.glob("*.json")), ids=lambda path: path.stem)
def test_every_stored_certificate_is_valid(path: Path):
    VALIDATOR.validate(json.loads(path.read_text("utf-8")))


@pytest.mark.parametrize(
    ("name", "slides"),
    [
        pytest.param(name, slides, marks=() if name in KINDS[3 * slides :: 6] else pytest.mark.campaign)
        for name in CLASSES
        for slides in (False, True)
    ],
)
def test_certificates_of_every_class_are_valid(name: str, slides: bool):
    data = made(name, slides)
    VALIDATOR.validate(data)
    assert depth({**data, "unverified": {}}) <= 8


@pytest.mark.parametrize(("name", "slides"), thinned(SAMPLE, 2))
def test_certificates_with_every_lyapunov_function_are_valid(name: str, slides: bool):
    data = made(name, slides, "best")
    VALIDATOR.validate(data)
    assert depth({**data, "unverified": {}}) <= 8


def test_many_components_and_nothing_proved_are_valid(monkeypatch: pytest.MonkeyPatch):
    pairs = [(f"a{i}", f"b{i}", -1) for i in range(MANY_COMPONENTS + 5)]
    data = json.loads(certify(SignedDigraph.from_edges(pairs), NOMINAL, asks=Asks(simulation=False)).to_json())
    VALIDATOR.validate(data)
    assert isinstance(data["components"], dict) and "containment_weights" not in data["influence"]
    for key in data["components"]:
        assert not valid(changed(data, ("components", key), {}))
    for module in (vectors, enclosed_ends):
        monkeypatch.setattr(module, "writable", lambda x: 10**60 % x.denominator == 0)
    data = made.__wrapped__("3.1 no single")
    VALIDATOR.validate(data)
    assert "witness" in data["proof"][2]


def test_edges_in_side_files_are_valid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(vectors, "LONG", 1)
    certify(SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)]), NOMINAL, asks=Asks(simulation=False)).save(
        tmp_path / "c.json"
    )
    data = checker.read(tmp_path / "c.json")
    VALIDATOR.validate(data)
    assert isinstance(at(data, EDGES), dict)
    assert not valid(changed(data, (*EDGES, "source", "file"), "../x.npy"))
    assert not valid(changed(data, (*EDGES, "count"), "2"))


def test_side_vectors_and_factors_are_valid(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(graph_certification, "EXACT_NODES", 0)
    monkeypatch.setattr(final_states, "EXACT_NODES", 0)
    data, _ = with_side_files(with_factors(made.__wrapped__("3.1 mixed", True, "best")))
    VALIDATOR.validate(data)
    assert depth({**data, "unverified": {}}) <= 8
    step = next(k for k, step in enumerate(data["proof"]) if step["kind"] == "dominance")
    for path in (
        ("structure", 0, "leaders"),
        ("problem", "initial_state"),
        ("final_state", "mid"),
        ("proof", step, "witness", "vector"),
        ("decays", 0, "blocks", 0, "diagonal"),
    ):
        said = at(data, path)
        assert not valid(changed(data, path, {**said, "count": str(said["count"])})), path
        assert not valid(changed(data, path, {**said, "scale": 1})), path
        assert not valid(changed(data, path, {**said, "more": None})), path
    path = ("proof", step, "witness", "groups", 0)
    entry = at(data, path)
    for new in (
        {"rate": entry["rate"]},
        {**entry, "more": 1},
        {**entry, "factor": {**entry["factor"], "bits": "1"}},
        {**entry, "factor": {**entry["factor"], "data": [0.5]}},
    ):
        assert not valid(changed(data, path, new))


@pytest.mark.few(0)
@pytest.mark.parametrize("samples", [SAMPLE[:2], pytest.param(SAMPLE, marks=pytest.mark.campaign)], ids=len)
def test_another_key_or_one_less_is_not_valid(samples: tuple[tuple[str, bool], ...]):
    """Every kind of object of the samples, once."""
    seen: set[Any] = set()
    assert sum(of_one_sample(made(name, slides), seen) for name, slides in samples) > 100


def of_one_sample(data: Json, seen: set[Any]) -> int:
    """Change every object of a kind that was not seen; return how many keys were left out."""
    labels, count = set(data["problem"]["graph"]["nodes"]), 0
    for path in containers({k: v for k, v in data.items() if k != "unverified"}):
        value = at(data, path)
        if isinstance(value, dict):
            one_of_a_kind = *(step for step in path if isinstance(step, str)), *value, value.get("kind")
            if one_of_a_kind in seen:
                continue
            seen.add(one_of_a_kind)
            assert not valid(changed(data, path, {**value, "more": {}})), path
            kinds = kinds_of(value)
            # Which agents, whether there is a rho or an end of its interval, and when a part that may be absent is
            # there, is for the checker.
            for key in value:
                assert not kinds or not valid(changed(data, (*path, key), None)), (path, key)
                if (
                    all(key in kind["required"] for kind in kinds)
                    and key not in labels
                    and not (path[-1:] == ("numbers",) and key in ("rho", "printed", "exact"))
                ):
                    assert not valid(without(data, (*path, key))), (path, key)
                    count += 1
    return count


def kinds_of(value: Json) -> list[Json]:
    """The object schemas that an object fits."""
    near = [one for one in objects(SCHEMA) if set(one["required"]) <= set(value) <= set(one["properties"])]
    return [one for one in near if VALIDATOR.evolve(schema=one).is_valid(value)]


@pytest.mark.parametrize(("name", "slides"), thinned(SAMPLE[1:] + SAMPLE[:1]))
def test_a_number_outside_the_grammar_is_not_valid(name: str, slides: bool):
    data = made(name, slides)
    count, seen = 0, Counter[Any]()
    for path, value in leaves({k: v for k, v in data.items() if k not in ("unverified", "digest", "producer")}):
        try:
            exact(value)
        except RejectedError:
            continue
        kind = tuple(step for step in path if isinstance(step, str))
        seen[kind] += 1
        if seen[kind] > 3:
            continue
        bad = BAD_NUMBERS[count % len(BAD_NUMBERS)]
        assert not valid(changed(data, path, bad)), (path, bad)
        count += 1
    assert count > 30


def test_the_grammar_of_the_schema_is_that_of_the_checker():
    number = VALIDATOR.evolve(schema=SCHEMA["$defs"]["number"])
    for text in GOOD_NUMBERS:
        assert number.is_valid(text), text
        exact(text)
    for text in BAD_NUMBERS:
        assert not number.is_valid(text), text
        with pytest.raises(RejectedError):
            exact(text)
    rng = np.random.default_rng(1)
    alphabet = list("0011289+-./eExXpPaF\n ")
    for length in rng.integers(1, 8, 4000):
        text = "".join(rng.choice(alphabet, length))
        try:
            exact(text)
        except RejectedError:
            assert not number.is_valid(text), text
        else:
            assert number.is_valid(text), text


def test_words_and_sections_that_do_not_fit_are_not_valid():
    data, sliding = made("1.1"), made("2.1 K>=2", True)
    begin = data["problem"]["initial_state"]
    for path, new in (
        (("schema",), "ptcc-certificate/2"),
        (("verdict",), "proved"),
        (("input",), "1"),
        (("claim", "theorem"), "7.1"),
        (("claim", "behaviour"), "consensus"),
        (("structure", 0, "connectivity"), "connected"),
        (("problem", "gain", "kind"), "sliding-mode"),
        (("decays", 0, "class"), "best"),
        (("proof", 0, "kind"), "claim"),
        (("proof", 0, "proves"), "everything is well"),
        (("proof", 0, "witness"), {}),
        (("structure", 0, "closed_components", 0, "gauge", 0), 2),
        (("claim",), None),
        (("problem", "sliding_variable"), None),
        (("reaching_time",), None),
        (("digest",), data["digest"].upper()),
    ):
        assert not valid(changed(data, path, new)), path
    for whole, reason in (
        (changed(data, ("structure", 0, "connectivity"), "disconnected"), "the graph is strong"),
        ({**data, "structure": data["structure"] * 2}, "structure has not one entry"),
        (without(data, ("claim",)), "the claim is Theorem 1.1"),
        (changed(data, ("claim", "behaviour"), "stability"), "the claim is bipartite consensus by Theorem 1.1"),
        ({**data, "components": []}, "components of a connected graph"),
        ({**data, "boxes": []}, "boxes has no place for one graph"),
        ({**data, "drives": []}, "drives has no place for one graph"),
        (changed(data, ("problem", "sliding_variable"), begin), "sigma(0) belongs to the sliding-mode protocol"),
        (without(sliding, ("problem", "sliding_variable")), "sigma(0) belongs to the sliding-mode protocol"),
        (without(sliding, ("reaching_time",)), "reaching times are told iff"),
        (changed(data, ("claim",), None), "claim is null, and not left out"),
        (changed(sliding, ("problem", "sliding_variable"), None), "sliding_variable is null, and not left out"),
        (changed(sliding, ("reaching_time",), None), "reaching_time is null, and not left out"),
    ):
        assert reason in (check(whole).reason or "")  # what goes with what is for the checker


# ---------------------------------------------------------------------- the text


def test_every_key_is_described():
    rows = set(re.findall(r"^\| `(\w+)` \|", FORMAT.partition("## 4.")[2].partition("## 5.")[0], re.MULTILINE))
    of_family, of_graph = {"drives", "boxes", "restricted"}, {"paper", "rates", "overshoot", "influence"}
    assert rows - of_family == set(GRAPH["properties"])
    assert rows - of_graph - {"agents", "phases", "instants"} == set(FAMILY["properties"])
    asked = set(re.findall(r"^\| `(\w+)` \|", FORMAT.partition("## 5.")[2].partition("## 6.")[0], re.MULTILINE))
    assert asked == set(SCHEMA["$defs"]["SignalProblem"]["properties"])
    assert asked - {"signal"} == set(SCHEMA["$defs"]["GraphProblem"]["properties"])
    for found in objects(SCHEMA):
        for key in found["properties"]:
            assert re.search(rf"[`\"]{re.escape(key)}[`\"]|`rates\.{key}`|`influence\.{key}`", FORMAT), key


def test_every_word_is_described():
    words: set[str] = set()

    def collect(schema: Any) -> None:
        if isinstance(schema, dict):
            words.update(x for x in schema.get("enum", []) if isinstance(x, str))
            if isinstance(schema.get("const"), str):
                words.add(schema["const"])
            for item in schema.values():
                collect(item)
        elif isinstance(schema, list):
            for item in schema:
                collect(item)

    collect({key: item for key, item in SCHEMA.items() if key != "$schema"})
    assert {word for word in words if word not in FORMAT} == set()


def test_obligations_are_described_with_their_texts():
    blocks = re.findall(r"```json\n(.*?)```", FORMAT, re.DOTALL)
    assert json.loads(blocks[0]) == {kind: list(texts) for kind, texts in OBLIGATIONS.items()}
    table, families = obligation_table("14") + obligation_table("22"), obligation_table("19")
    agents = obligation_table("21")
    assert table == ["structure", "claim", "final-state", *[kind for kind in table if kind not in table[:3]]]
    assert set(table) | set(families) | set(agents) == set(OBLIGATIONS)
    assert all(len(set(kinds)) == len(kinds) for kinds in (table, families, agents))
    assert set(agents) & {*table, *families} == {"input-constants"}
    assert set(table) & set(families) == {"structure", "sliding-bound", "reaching-time", "input-sliding"}
    for kind in OBLIGATIONS:
        assert f"- **{kind}**: " in FORMAT, kind


def test_the_lists_of_keys_are_those_that_are_declared():
    known = [(set(found["required"]), set(found["properties"])) for found in objects(SCHEMA)]
    text = re.sub(r"```json\n.*?```", "", FORMAT, flags=re.DOTALL)
    lists = [re.sub(r': (?:"[^"]*"|\w+)', "", entry) for entry in re.findall(r'`\{("[^`]*)\}`', text)]
    # the hash of undirected modes, and two of what nobody checks
    outside = [{"undirected"}, {"value", "kind", "members", "durations"}, {"mode", "name", "weights"}]
    told = [keys for entry in lists if (keys := set(re.findall(r'"(\w+)"', entry))) not in outside]
    assert len(told) > 50
    assert [keys for keys in told if not any(least <= keys <= most for least, most in known)] == []


def test_the_tables_of_obligations_tell_the_numbers_that_are_declared():
    rows = re.findall(r"^\| `([a-z-]+)` \| `[a-z][^|]*\|([^|]*)\|", FORMAT, re.MULTILINE)
    assert {kind for kind, _ in rows} == set(OBLIGATIONS)
    for kind, numbers in rows:
        told = set(re.findall(r"`(\w+)`", numbers))
        assert told == {x for one in BRINGS.get(kind, ()) for x in one.numbers.split()}, (kind, numbers)


@pytest.mark.parametrize(("name", "slides"), thinned(SAMPLE, 2))
def test_obligations_stand_in_the_order_of_the_table(name: str, slides: bool):
    table = obligation_table("14")
    groups: list[tuple[str, list[int]]] = []
    for step in made(name, slides, "best")["proof"]:
        of = step["of"] if step["of"].startswith("decays") else "rest"
        if not groups or groups[-1][0] != of:
            groups.append((of, []))
        groups[-1][1].append(table.index(step["kind"]))
    assert all(places == sorted(places) for _, places in groups)
    rest = [place for of, places in groups if of == "rest" for place in places]
    assert rest == sorted(rest)


def test_lines_are_short_and_the_number_of_the_schema_is_that_of_the_checker():
    assert max(map(len, FORMAT.splitlines())) <= 120
    assert FORMAT.startswith(f"# The certificate format `{checker.SCHEMA}`\n")


# ---------------------------------------------------------------------- the example


def test_the_example_is_the_file_that_is_made_and_is_accepted(tmp_path: Path):
    told = example()
    assert told["unverified"] == {}
    Draft202012Validator(SCHEMA).validate(told)
    (tmp_path / "c.json").write_text(json.dumps(told), encoding="utf-8")
    for stdlib in (True, False):
        report = check(tmp_path / "c.json", stdlib=stdlib)
        assert report.accepted and report.verdict == "certified", (report.rejected, report.reason)
    graph = SignedDigraph.from_edges([(1, 2, -1), (2, 1, -1)])
    protocol = NominalProtocol(T="0.6", rho1="0.1", rho2="0.3", kappa=1)
    now = json.loads(certify(graph, protocol, [3, 5], asks=Asks(simulation=False, method="paper")).to_json())
    # Where the search's floats end, and so the last digits of rates and witnesses, is for the platform.
    exactly = ("schema", "problem", "structure", "claim", "influence", "final_state", "verdict")
    assert {key: now[key] for key in exactly} == {key: told[key] for key in exactly}
    assert list(now) == list(told)
    assert [step["kind"] for step in now["proof"]] == [step["kind"] for step in told["proof"]]


def test_the_example_by_hand():
    """The lines below the example."""
    told = example()
    numbers = {step["kind"]: step.get("numbers", {}) for step in told["proof"]}
    assert Fraction(numbers["deviation-decrease"]["b"]) < 4
    deviation = told["decays"][0]["deviation"]
    assert all(Fraction(c) >= 1 for c in deviation["agents"].values()) and Fraction(deviation["norm"]) > 2
    assert numbers["rate-mean"] == {"upper_bound": "4"} and told["rates"]["upper_bound"] == "4"
    lines = ['["1"]', '["2"]', '["1", "2", "-1"]', '["2", "1", "-1"]']
    canonical = "".join(f"{line}\n" for line in lines)
    assert hashlib.sha256(canonical.encode()).hexdigest() == told["problem"]["graph"]["sha256"]


def spelled(text: str, ascii_only: bool) -> str:
    """A text as sections 5 and 16 say that it is written."""
    short = {'"': '\\"', "\\": "\\\\", "\b": "\\b", "\t": "\\t", "\n": "\\n", "\f": "\\f", "\r": "\\r"}

    def one(char: str) -> str:
        if char in short:
            return short[char]
        if ord(char) >= 0x20 and (ord(char) <= 0x7E or not ascii_only):
            return char
        units = char.encode("utf-16-be", "surrogatepass")
        return "".join(f"\\u{units[i]:02x}{units[i + 1]:02x}" for i in range(0, len(units), 2))

    return '"' + "".join(map(one, text)) + '"'


def written(value: Any) -> str:
    """A document in the form of section 16."""
    if isinstance(value, dict):
        return "{" + ",".join(f"{spelled(k, True)}:{written(value[k])}" for k in sorted(value)) + "}"
    if isinstance(value, list):
        return "[" + ",".join(map(written, value)) + "]"
    if isinstance(value, str):
        return spelled(value, True)
    return "null" if value is None else str(value).lower()


def test_both_hashes_are_those_that_the_text_describes():
    names = ["\x00\x1f\x7f\x80", 'quote" back\\ slash/', "tab\t line\n\r\b\f", "é\u2028", "\U0001f600", "\uffff", "z"]
    edges = [(names[i - 1], name, Fraction(i - 3 or 9, 2)) for i, name in enumerate(names)]
    data = json.loads(
        certify(SignedDigraph.from_edges(edges), NOMINAL, asks=Asks(simulation=False, method="paper")).to_json()
    )
    assert check(data).accepted
    said = {key: value for key, value in data.items() if key not in ("digest", "unverified")}
    assert hashlib.sha256(written(said).encode("ascii")).hexdigest() == data["digest"]
    rows = [[label] for label in sorted(data["problem"]["graph"]["nodes"])]
    rows += sorted([s, t, str(Fraction(w))] for s, t, w in at(data, EDGES))
    text = "".join("[" + ", ".join(spelled(x, False) for x in row) + "]\n" for row in rows)
    assert hashlib.sha256(text.encode("utf-8")).hexdigest() == data["problem"]["graph"]["sha256"]
