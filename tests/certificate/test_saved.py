"""A certificate read back from its file is the certificate that was written, bound for bound."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import flint
import numpy as np
import pytest
from asked import certify_words
from generators import all_classes, random_graph, sparse_digraph
from selection import thinned

import ptcc_certify as ptcc
from ptcc_certify.bounds.envelope import FRACTIONS
from ptcc_certify.bounds.input.effort import effort_section
from ptcc_certify.certificate import section_io as vectors
from ptcc_certify.certificate.certificate import Certificate, RejectedCertificate, read_certificate
from ptcc_certify.certificate.graph_sections import structure_document
from ptcc_certify.certificate.section_io import Writer, write
from ptcc_certify.checker import digest
from ptcc_certify.checker.input import InputSection
from ptcc_certify.errors import FormatError, ParameterError
from ptcc_certify.examples import EXAMPLES, load_graph
from ptcc_certify.model.asks import Expectations

pytestmark = pytest.mark.usefixtures("quick_search")

NOMINAL = ptcc.NominalProtocol(T="0.6", rho1="0.2", rho2="0.5", kappa=1)
SLIDING = ptcc.SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
#: One class of every theorem row, and the corners of the input.
CLASSES = {
    "1.1 one node",
    "1.1",
    "1.2 opposite mutual",
    "2.1 K=1 chain",
    "2.1 K>=2 reducible followers",
    "2.2",
    "3.1 all single",
    "3.1 mixed several",
    "3.2 chain",
    "disconnected isolated only",
    "disconnected 1.2 2.1 isolated",
    "disconnected mixed",
}
REMAINING = [1.0, *(1 - f for f in FRACTIONS), 1e-6, 1e-9]


def certified(name: str, **options: Any) -> ptcc.Certificate:
    kwargs = dict(all_classes())[name]
    graph = random_graph(np.random.default_rng(len(name)), **kwargs).graph
    protocol = options.pop("protocol", NOMINAL)
    start = [Fraction(k * k - 7, 3) for k in range(graph.n_nodes)]
    if isinstance(protocol, ptcc.SlidingModeProtocol):
        options["sigma0"] = [Fraction(k - 2, 2) for k in range(graph.n_nodes)]
    return certify_words(graph, protocol, start, simulation=False, **options)


def written(certificate: ptcc.Certificate, folder: Path) -> Certificate:
    certificate.save(folder / "c.json")
    return read_certificate(folder / "c.json")


def agree(saved: Certificate, made: ptcc.Certificate) -> None:
    """Everything that a file states is what the certificate has."""
    assert saved.graph == made.graph and saved.graph.labels == made.graph.labels
    assert structure_document(saved.structure) == structure_document(made.structure)
    assert (saved.protocol, saved.initial_state, saved.sigma0) == (made.protocol, made.initial_state, made.sigma0)
    assert (saved.reaching, saved.verdict, saved.claims) == (made.reaching, made.verdict, made.claims)
    assert (saved.rate, saved.overshoot, saved.paper_rate) == (made.rate, made.overshoot, made.paper_rate)
    assert saved.upper_bound == made.upper_bound and saved.optimality_ratio == made.optimality_ratio
    assert type(saved.envelope) is type(made.envelope)
    assert len(saved.envelope.functions) == len(made.envelope.functions)
    for own, other in zip(saved.envelope.functions, made.envelope.functions, strict=True):
        assert (own.kind, own.coordinates, own.weights) == (other.kind, other.coordinates, other.weights)
        assert (own.rate, own.overshoot, own.lowest) == (other.rate, other.overshoot, other.lowest)
        assert own.deviation == other.deviation and own.name == other.name
        assert own.nodes == other.nodes and own.gauge == other.gauge and np.array_equal(own.array, other.array)
    n, out = made.graph.n_nodes, Writer(made.graph.labels)
    sections = (write(InputSection | None, effort_section(x.effort, n), out) for x in (saved, made))
    assert next(sections) == next(sections)
    if made.effort is not None and saved.effort is not None:
        own, other = saved.effort, made.effort
        assert [o for o in own.obligations if o.kind != "input-peak"] == [
            o for o in other.obligations if o.kind != "input-peak"
        ]


@pytest.mark.few(0)
@pytest.mark.parametrize("name", thinned(sorted(CLASSES)))
def test_a_certificate_comes_back_as_it_was(name: str, tmp_path: Path):
    made = certified(name)
    saved = written(made, tmp_path)
    agree(saved, made)
    assert saved.report.accepted and saved.document == json.loads((tmp_path / "c.json").read_text("utf-8"))
    assert np.array_equal(saved.norm_bound(REMAINING), made.norm_bound(REMAINING))
    assert np.array_equal(saved.deviation_bound(REMAINING), made.deviation_bound(REMAINING))
    assert [saved.envelope.residual(q) for q in REMAINING] == [made.envelope.residual(q) for q in REMAINING]
    if made.final_state is not None and made.final_state.exact:
        assert saved.final_state.intervals == tuple((x, 0) for x in made.final_state.states)
        assert saved.degenerate == made.final_state.degenerate


@pytest.mark.few(0)
@pytest.mark.parametrize("name", thinned(["3.2 chain", "1.1", "2.1 K>=2 reducible followers"], 3))
def test_a_sliding_mode_certificate_comes_back_as_it_was(name: str, tmp_path: Path):
    made = certified(name, protocol=SLIDING)
    saved = written(made, tmp_path)
    agree(saved, made)
    assert not saved.direct
    assert np.array_equal(saved.norm_bound([0.5, 0.1, 1e-6]), made.norm_bound([0.5, 0.1, 1e-6]))
    assert np.array_equal(saved.deviation_bound([0.5, 1e-6]), made.deviation_bound([0.5, 1e-6]))


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "options",
    thinned(
        [
            {"limits": [ptcc.GainLimits(gain_cap=50), ptcc.GainLimits(stop_before="0.01")], "noise": "1/100"},
            {"method": "full", "at": "1/2"},
            {"initial_set": ptcc.ellipsoid([0] * 6, [[1, 0, 0, 0, 0, 0], [0, 2, 0, 0, 0, 0]])},
            {"initial_set": 2},
            {"limits": [ptcc.GainLimits(sample_period="1/1000", gain_cap=20)]},
            {"method": "paper"},
            {"delta": "1/2"},
        ],
        2,
    ),
    ids=["noise", "full", "ellipsoid", "box", "sampled", "paper", "disturbed"],
)
def test_sets_of_starts_limits_and_noise_come_back(options: dict[str, Any], tmp_path: Path):
    protocol = ptcc.NominalProtocol(T=1, rho1=1, rho2=2, kappa=1)
    asked = {"simulation": False, "method": "paper", **options}
    made = certify_words(load_graph("fig3a"), protocol, [-4, 3, -1, 2, -2, 5], **asked)
    agree(written(made, tmp_path), made)


@pytest.mark.few(0)
@pytest.mark.parametrize("name", thinned(["2.1 K>=2 reducible followers", "1.1", "3.1 mixed several"], 3))
def test_the_bound_is_never_below_what_the_exact_numbers_say(name: str, tmp_path: Path):
    """``sqrt(V(0) / lmin) e^(-rate s / 2)`` of every member, enclosed in balls from the texts of the file."""
    saved = written(certified(name), tmp_path)
    p, L = saved.protocol, saved.graph.exact_laplacian()
    n, start = len(L), saved.initial_state or ()
    E = [-sum(L[i][j] * start[j] for j in range(n)) for i in range(n)]
    for k, said in enumerate(saved.document["decays"]):
        alone = replace(saved.envelope, functions=saved.envelope.functions[k : k + 1])
        rate, where = Fraction(said["rate"]), []
        V, lowest = Fraction(0), None
        for block in said["blocks"]:
            where = [saved.graph.index[label] for label in block["nodes"]]
            if "lower_triangle" in block:
                lower = [[Fraction(x) for x in row] for row in block["lower_triangle"]]
                V += sum(
                    x * E[where[i]] * E[where[j]] * (1 if i == j else 2)
                    for i, row in enumerate(lower)
                    for j, x in enumerate(row)
                )
                steps = {(s["kind"], s["of"]): s for s in saved.document["proof"]}
                lowest = Fraction(steps["overshoot", f"decays[{k}]"]["numbers"]["lowest"])
                continue
            rho = Fraction(said["rho"]) if block["times_rho"] else 1
            weights = [Fraction(x) * rho for x in block["diagonal"]]
            lowest = min([*weights, *([] if lowest is None else [lowest])])
            if said["coordinates"] == "eps":
                g = [int(saved.structure.gauge[v]) for v in where]
                mean = sum(w * s * start[v] for w, s, v in zip(weights, g, where, strict=True)) / sum(weights)
                V += sum(w * (start[v] - s * mean) ** 2 for w, s, v in zip(weights, g, where, strict=True))
            else:
                V += sum(w * E[v] ** 2 for w, v in zip(weights, where, strict=True))
        assert lowest is not None and lowest > 0
        for q in REMAINING:
            ball = flint.arb(q)
            s = float_ball(p.rho1 * p.T) * (1 - ball) - float_ball(p.rho2 * p.kappa) * ball.log()
            true = (float_ball(V / lowest)).sqrt() * (-float_ball(rate) * s / 2).exp()
            bound = float(alone.bound(alone.gain.clock_at_remaining(q), start))
            assert flint.arb(bound) >= true
            assert bound <= float(true) * (1 + 1e-6)


def float_ball(x: Fraction) -> flint.arb:
    return flint.arb(x.numerator) / flint.arb(x.denominator)


LITTLE = ptcc.Asks(expectations=Expectations(max_residual=Fraction(1, 1000)))


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"limits": [ptcc.GainLimits(sample_period="0.2")]}, "certified with a period of"),
        (
            {"messages": ptcc.LateMessages("0.1", gain_cap=20), "asks": LITTLE},
            "limit is a delay of",
        ),
        (
            {"messages": ptcc.LateMessages("0.1", gain_cap=20), "asks": LITTLE},
            "where nothing is older than",
        ),
    ],
    ids=["period", "delay", "age"],
)
def test_what_would_be_certified_instead_comes_back(options: dict[str, Any], says: str, tmp_path: Path):
    camps = ptcc.SignedDigraph.from_edges([("a", "b", 1), ("b", "a", 2), ("b", "c", -1), ("c", "b", -1)])
    protocol = ptcc.NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)
    made = ptcc.certify(camps, protocol, [1, 3, -2], **options)
    assert says in made.assessment.text and written(made, tmp_path).assessment.text == made.assessment.text


def test_side_files_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(vectors, "LONG", 50)
    graph = sparse_digraph(np.random.default_rng(4), 200, 3.0)
    made = ptcc.certify(graph, NOMINAL, [Fraction(k, 8) for k in range(200)], asks=ptcc.Asks(simulation=False))
    saved = written(made, tmp_path)
    assert list(tmp_path.glob("*-source.npy")) and list(tmp_path.glob("*-diagonal.npy"))
    agree(saved, made)
    assert made.final_state is not None and made.final_state.radius is not None and saved.final_state is not None
    for (middle, radius), value in zip(saved.final_state.intervals, np.asarray(made.final_state).tolist(), strict=True):
        assert abs(middle - Fraction(value)) <= radius + Fraction(1, 10**12)
    assert np.array_equal(saved.norm_bound(REMAINING), made.norm_bound(REMAINING))


@pytest.mark.few(0)
def test_side_files_go_with_a_certificate_that_was_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(vectors, "LONG", 3)
    weights = [("file", "sha256", -1), ("sha256", "file", -1), ("file", "c", 1), ("c", "d", 1)]
    made = ptcc.certify(
        ptcc.as_graph(weights), NOMINAL, [3, 1, 2, 4], asks=ptcc.Asks(method="perron", simulation=False)
    )
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir(), second.mkdir()
    saved = written(made, first)
    files = {path.name: path.read_bytes() for path in first.glob("*.npy")}
    for path in first.iterdir():
        (second / path.name).write_bytes(b"half a copy")
        path.unlink()
    for one in (saved, read_certificate(made), read_certificate(saved)):
        assert ptcc.check(one).accepted and one.sha256 == saved.sha256
        one.save(second / "c.json")
        assert {path.name: path.read_bytes() for path in second.glob("*.npy")} == files != {}
        assert ptcc.check(second / "c.json").accepted


@pytest.mark.parametrize("number", thinned([2, 6, 4], 2))
def test_a_run_repeated_from_the_file_keeps_the_bounds(number: int, tmp_path: Path):
    example = EXAMPLES[number]
    made = ptcc.certify(
        load_graph(example.graphs[0]),
        example.protocol(),
        ptcc.InitialState(example.x0.split(","), sigma0=example.sigma0 and example.sigma0.split(",")),
        asks=ptcc.Asks(disturbance=example.disturbance),
    )
    saved = written(made, tmp_path).with_simulation()
    assert saved.disturbance == example.disturbance
    assert saved.comparison is not None and not saved.comparison.violated
    assert made.trajectory is not None and saved.trajectory is not None
    assert np.array_equal(saved.trajectory.states, made.trajectory.states)


@pytest.mark.few(1)
@pytest.mark.parametrize("said", [None, "worst-case", "telegraph", "none", "no such", "9*sin(t)", "__import__('os')"])
def test_a_disturbance_that_is_no_expression_within_delta_gives_way_to_the_worst_case(said: str | None, tmp_path: Path):
    pair = ptcc.SignedDigraph.from_edges([("a", "b", -1), ("b", "a", -1)])
    ptcc.certify(pair, SLIDING, ptcc.InitialState([3, 5], sigma0=[1, 0]), asks=ptcc.Asks(simulation=False)).save(
        tmp_path / "c.json"
    )
    data = json.loads((tmp_path / "c.json").read_text())
    gain = data["problem"]["gain"]
    assert "disturbance" not in gain
    null = {**data, "problem": {**data["problem"], "gain": {**gain, "disturbance": None}}}
    assert ptcc.check({**null, "digest": digest(null)}).reason == "disturbance is null, and not left out"
    gain |= {} if said is None else {"disturbance": said}
    data["digest"] = digest(data)
    (tmp_path / "c.json").write_text(json.dumps(data))
    saved = read_certificate(tmp_path / "c.json").with_simulation()
    assert saved.trajectory is not None and saved.comparison is not None and not saved.comparison.violated
    assert saved.trajectory.sliding.source == (
        "none" if said == "none" else "worst-case disturbance: delta sign(sigma_k)"
    )


def test_a_byte_order_mark_does_not_matter(tmp_path: Path):
    saved = written(certified("1.1"), tmp_path)
    (tmp_path / "marked.json").write_bytes(b"\xef\xbb\xbf" + saved.path.read_bytes())
    assert read_certificate(tmp_path / "marked.json").document == saved.document


def test_a_false_certificate_is_not_read(tmp_path: Path):
    made = certified("1.2 opposite mutual")
    made.save(tmp_path / "c.json")
    data = json.loads((tmp_path / "c.json").read_text())
    data["rates"]["proved"] = str(2 * Fraction(data["rates"]["proved"]))
    data["digest"] = digest(data)
    (tmp_path / "c.json").write_text(json.dumps(data))
    with pytest.raises(RejectedCertificate, match=r"c\.json: the independent check rejects rates") as caught:
        read_certificate(tmp_path / "c.json")
    assert not caught.value.report.accepted and caught.value.path.name == "c.json"


@pytest.mark.parametrize("content", ["", "{}", "[1]", '{"schema": "other/1"}'])
def test_what_is_no_certificate_is_refused_in_one_line(content: str, tmp_path: Path):
    (tmp_path / "c.json").write_text(content)
    for path in (tmp_path / "c.json", tmp_path / "none.json", tmp_path):
        with pytest.raises(FormatError) as caught:
            read_certificate(path)
        assert "\n" not in str(caught.value)


def test_an_undecided_certificate_says_so(tmp_path: Path):
    made = replace_final_state(certified("1.1"), tmp_path)
    assert made.verdict == "undecided" and made.final_state is None and made.rate is not None


def replace_final_state(made: ptcc.Certificate, folder: Path) -> Certificate:
    """Take the outcome out of a certificate: what is left proves the decay, and decides nothing."""
    made.save(folder / "c.json")
    data = json.loads((folder / "c.json").read_text())
    del data["influence"], data["final_state"]
    data["verdict"] = "undecided"
    data["proof"] = [s for s in data["proof"] if s["kind"] not in ("final-state", "deviation")]
    for function in data["decays"]:
        del function["deviation"]
    data["digest"] = digest(data)
    (folder / "c.json").write_text(json.dumps(data))
    return read_certificate(folder / "c.json")


def test_without_a_start_there_is_no_bound_from_it(tmp_path: Path):
    made = ptcc.certify(load_graph("fig1a"), NOMINAL)
    saved = written(made, tmp_path)
    agree(saved, made)
    for ask in (lambda: saved.norm_bound([0.5]), lambda: saved.deviation_bound([0.5]), saved.simulate):
        with pytest.raises(ParameterError, match="no initial state"):
            ask()
    assert math.isfinite(saved.envelope.residual(0.5))


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "part", [{"protocol": ptcc.NominalProtocol(T=100)}, {"initial_state": (Fraction(1),) * 6}, {"final_state": None}]
)
def test_a_certificate_that_was_read_is_what_its_file_says(tmp_path: Path, part: dict[str, Any]):
    asks = ptcc.Asks(simulation=False, method="paper")
    ptcc.certify("fig3a", NOMINAL, [-4, 3, -1, 2, -2, 5], asks=asks).save(tmp_path / "c.json")
    saved = read_certificate(tmp_path / "c.json")
    with pytest.raises(ParameterError, match="certify the graph again"):
        saved.changed(**part)
    assert saved.changed(trajectory=None).verdict == "certified"


@pytest.mark.parametrize("value", [math.nan, {1}, 10**5000], ids=["nan", "set", "long"])
def test_a_mapping_that_is_no_json_is_refused(value: Any):
    document = json.loads(ptcc.certify("fig1a", NOMINAL, asks=ptcc.Asks(simulation=False, method="paper")).to_json())
    document["unverified"]["value"] = value
    with pytest.raises(FormatError, match="JSON"):
        read_certificate(document)


def test_a_run_whose_agents_stand_in_another_order_is_refused():
    edges = [("a", "b", 1), ("b", "c", -2), ("c", "a", 1), ("c", "d", 3)]
    certificate = ptcc.certify(edges, NOMINAL, [1, 2, 3, 4], asks=ptcc.Asks(simulation=False, method="paper"))
    run = ptcc.simulate(edges[::-1], NOMINAL, dict(zip("abcd", [1, 2, 3, 4], strict=True)))
    assert run.graph == certificate.graph and run.graph.labels != certificate.graph.labels
    with pytest.raises(ParameterError, match="another order"):
        certificate.envelope.compare(run)
