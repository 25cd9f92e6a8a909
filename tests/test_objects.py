"""Results as Python objects: copies, equality, tables, and a certificate where a file is taken."""

import builtins
import copy
import json
import pickle
import re
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import ptcc_certify as ptcc
from ptcc_certify.certificate.certification import certify_case
from ptcc_certify.errors import FormatError, ParameterError
from ptcc_certify.model.asks import Case, GainLimits
from ptcc_certify.model.disturbance import as_disturbance
from ptcc_certify.model.gain import Gain

pytestmark = pytest.mark.usefixtures("quick_search")

TEAM = ptcc.as_graph([("ann", "bob", 2), ("bob", "ann", -1), ("bob", "eve", 1)])
PROTOCOL = ptcc.NominalProtocol(T=1, rho1=1, rho2=1, kappa=1)
ROBUST = ptcc.SlidingModeProtocol(delta="0.5")


FAMILY = ptcc.as_family([("a", "b", 1, 2)])


@pytest.fixture(scope="module")
def cert():
    return ptcc.certify(TEAM, PROTOCOL, [5, 2, -4], asks=ptcc.Asks(method="perron"))


@pytest.fixture(scope="module")
def objects(cert):
    disturbance = as_disturbance("telegraph", 3, 0.5, 2.0)
    return {
        "graph": TEAM,
        "structure": cert.structure,
        "nominal": PROTOCOL,
        "sliding": ROBUST,
        "gain": Gain(1, 1, 1, 1),
        "limits": GainLimits(gain_cap=10),
        "expression": ptcc.ExpressionDisturbance("sin(k*t)"),
        "samples": disturbance,
        "certificate": cert,
        "final state": cert.final_state,
        "influence": cert.influence,
        "run": cert.trajectory,
        "sliding run": ptcc.simulate(TEAM, ROBUST, [5, 2, -4], sigma0=[1, 0, 1], disturbance=disturbance),
        "design": ptcc.design(TEAM, max_input=10, initial_bound=1),
        "ensemble": ptcc.Ensemble(count=2, nodes=5),
        "report of the check": cert.checked,
        "expectations": ptcc.Expectations("stability"),
        "set of initial states": ptcc.box([0, 0, 0], [1, 1, 1]),
        "family": FAMILY,
        "mode": FAMILY.modes[0],
        "certificate of a family": ptcc.certify(FAMILY, PROTOCOL, [1, 2]),
    }


def test_a_copy_of_a_result_equals_it_and_has_its_hash(objects):
    for name, one in objects.items():
        for other in (pickle.loads(pickle.dumps(one)), copy.copy(one), copy.deepcopy(one)):  # noqa: S301 - our own
            assert other == one and hash(other) == hash(one), name
        assert one != 5 and len(repr(one)) < 2000


def test_a_copy_of_a_graph_can_no_more_be_written_to_than_the_graph(cert):
    for one in (cert, pickle.loads(pickle.dumps(cert)), copy.copy(cert), copy.deepcopy(cert)):  # noqa: S301 - our own
        graph, structure, run = one.graph, one.structure, one.trajectory
        for array in (graph.sign, graph.weights, graph.source, structure.leaders, structure.strong_component, run.t):
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0
        for name in ("labels", "weights", "n_nodes"):
            with pytest.raises(AttributeError, match="make another graph"):
                setattr(graph, name, ())


def test_a_name_that_a_certificate_does_not_have_is_told_with_near_ones(cert):
    for name, near in (("final_states", "; did you mean final_state"), ("settling_time", ""), ("_private", "")):
        with pytest.raises(AttributeError, match=f"^a Certificate has no attribute {name}{re.escape(near)}"):
            getattr(cert, name)


def test_parts_of_a_certificate_have_a_hash(cert):
    parts = cert.effort, cert.paper_proof, cert.search, cert.observed, cert.comparison, cert.obligations, cert.request
    assert len({*parts, copy.deepcopy(cert.effort)}) == len(parts)


def test_what_is_done_to_the_json_leaves_the_certificate_as_it_is(cert):
    for one in (cert, ptcc.read_certificate(cert)):
        one.to_dict()["claim"]["behaviour"] = "chaos"
        assert one.to_dict()["claim"]["behaviour"] == cert.claim.behaviour


def test_another_initial_state_has_its_own_final_state_and_no_run(cert):
    other = cert.changed(initial_state=(Fraction(1), Fraction(1), Fraction(1)))
    assert other.final_state == ptcc.final_state(TEAM, [1, 1, 1]) and other.trajectory is None


def test_a_certificate_tells_what_its_graph_is_called_and_where_its_initial_state_comes_from():
    fast = ptcc.Asks(method="perron", simulation=False)
    cert = ptcc.certify("fig1b", PROTOCOL, "random", asks=fast)
    for one in (cert, ptcc.read_certificate(cert)):
        assert one.request.origins == {"graph": "fig1b", "x(0)": "random, seed 0"}
        assert (
            one.summary().splitlines()[1].startswith("graph      fig1b: 6 nodes")
            and "; x(0) random, seed 0" in one.summary()
        )
    named = certify_case(Case(TEAM, PROTOCOL, [5, 2, -4], asks=fast), origins={"graph": "team"})
    assert "team: 3 nodes" in named.summary() and "x(0) given" in named.summary()
    assert named == ptcc.certify(TEAM, PROTOCOL, [5, 2, -4], asks=fast)


@pytest.mark.parametrize("more", [{}, {"uncertainty": "10%"}], ids=["graph", "family"])
def test_origins_are_one_short_line_whoever_wrote_the_file(more: dict[str, Any]):
    document = ptcc.certify(TEAM, PROTOCOL, [5, 2, -4], asks=ptcc.Asks(simulation=False), **more).to_dict()
    odd = {"graph": "\x1b[31m\nverdict", "read": "y" * 10**6, "x(0)": ["a"], "sigma(0)": " ", "more": "z"}
    read = ptcc.read_certificate({**document, "unverified": {**document["unverified"], "origins": odd}})
    assert read.request.origins == {"graph": "?[31m verdict", "read": "y" * 200}
    assert "x(0) given" in read.summary() and "\x1b" not in read.summary()


def test_results_that_differ_are_not_equal(cert):
    assert cert != ptcc.certify(
        TEAM, PROTOCOL.replace(T=2), [5, 2, -4], asks=ptcc.Asks(method="perron", simulation=False)
    )
    run = ptcc.simulate(TEAM, PROTOCOL, [5, 2, -4], times=[0, 1])
    assert run != ptcc.simulate(TEAM, PROTOCOL, [5, 2, -3], times=[0, 1])
    assert run == ptcc.simulate(TEAM, PROTOCOL, [5, 2, -4], times=[0, 1])
    assert ptcc.analyse(TEAM) != ptcc.analyse([("ann", "bob", 2)])


def test_a_certificate_equals_what_is_read_back(cert, tmp_path):
    cert.save(tmp_path / "c.json")
    forms = (tmp_path / "c.json", str(tmp_path / "c.json"), cert.to_dict(), cert)
    assert {ptcc.read_certificate(form) for form in forms} == {cert}
    assert all(ptcc.check(form).accepted for form in forms)
    assert ptcc.check(ptcc.read_certificate(cert)).accepted


def test_a_certificate_of_a_family_equals_what_is_read_back(tmp_path):
    made = ptcc.certify(FAMILY, PROTOCOL, [1, 2])
    made.save(tmp_path / "c.json")
    read = ptcc.read_certificate(tmp_path / "c.json")
    assert made == read and hash(made) == hash(read) and made != ptcc.certify(FAMILY, PROTOCOL, [1, 3])
    assert read.path == tmp_path / "c.json" and read.report.accepted and len(read.sha256) == 64
    assert ptcc.read_certificate(json.loads(made.to_json())) == made
    assert made.to_pandas().equals(read.to_pandas())
    assert np.isnan(ptcc.certify([("a", "b", 0, 1)], PROTOCOL, [1, 2]).to_pandas().loc["b", "least"])


def test_a_report_is_written_of_a_certificate_as_of_its_file(cert, tmp_path):
    assert ptcc.write_report(cert, tmp_path / "page.html", simulation=False) == "certified"
    assert "stability" in (tmp_path / "page.html").read_text(encoding="utf-8")
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


def test_what_is_no_certificate_is_refused_with_the_mend():
    with pytest.raises(FormatError, match="give its path, its JSON object or a Certificate"):
        ptcc.check(5)


def test_the_memory_of_a_check_may_be_a_number_of_numpy(cert):
    assert ptcc.check(cert, memory=np.int64(1)).accepted
    for none in (0, float("nan"), float("inf"), "1"):
        with pytest.raises(ParameterError, match="in GB"):
            ptcc.check(cert, memory=none)


def test_an_agent_is_found_by_its_label(cert):
    final = cert.final_state
    assert dict(final) == dict(zip(TEAM.labels, final.states, strict=True))
    assert list(np.asarray(final)) == [float(x) for x in final.values()] and len(final) == 3
    assert (cert.trajectory["bob"] == cert.trajectory.states[1]).all()
    assert list(TEAM) == ["ann", "bob", "eve"]
    pair = ptcc.as_graph([(1, 2, -1)])
    numbered = pair, ptcc.final_state(pair, [3, 5]), ptcc.simulate(pair, PROTOCOL, [3, 5], times=[0])
    for one in numbered:
        assert 1 in one and "2" in one and 3 not in one and len(one) == len(list(one)) == 2
    for one in (final, cert.trajectory):
        with pytest.raises(ParameterError, match="no agent is called 'joe'; there are ann, bob, eve"):
            one["joe"]


def test_graphs_go_to_networkx_and_pandas_and_back():
    pytest.importorskip("pandas")
    assert ptcc.as_graph(TEAM.to_networkx()) == ptcc.as_graph(TEAM.to_pandas()) == TEAM
    assert (ptcc.as_graph(TEAM.adjacency(), "listens").adjacency() != TEAM.adjacency()).nnz == 0


def test_a_certificate_is_a_table_of_agents_whose_types_do_not_depend_on_what_was_asked(cert):
    frame, bare = cert.to_pandas(), ptcc.certify(TEAM, PROTOCOL).to_pandas()
    assert (frame.dtypes == bare.dtypes).all() and list(frame.index) == list(cert.graph.labels)
    assert list(frame.columns) == ["role", "group", "camp", "component", "x(0)", "x(T)", "deviation"]
    assert frame["x(T)"].to_dict() == {k: float(x) for k, x in dict(cert.final_state).items()}
    assert (frame["deviation"] == cert.deviation_bound([0.01])[:, 0]).all()
    assert bare[["x(0)", "x(T)", "deviation"]].isna().all(axis=None) and (bare["role"] == frame["role"]).all()
    alone = ptcc.certify(ptcc.SignedDigraph.from_edges([], nodes="ab"), PROTOCOL, [1, 2]).to_pandas()
    assert alone["x(T)"].tolist() == [1, 2] and (alone.dtypes == bare.dtypes).all()
    robust = ptcc.SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)
    slid = ptcc.certify(
        TEAM, robust, ptcc.InitialState([5, 2, -4], sigma0=[1, 0, -3]), asks=ptcc.Asks(simulation=False)
    )
    assert (slid.to_pandas()["deviation"] == slid.deviation_bound([0.005])[:, 0]).all()


def test_results_go_to_pandas(cert):
    pytest.importorskip("pandas")
    run = cert.trajectory
    frame = run.to_pandas()
    assert list(frame.columns) == list(TEAM.labels) and (frame.index == run.t).all()
    assert (frame["eve"].to_numpy() == run["eve"]).all()
    several = ptcc.simulate(TEAM, PROTOCOL, [[5, 1], [2, 0], [-4, 2]], times=[0, 1])
    assert (several.to_pandas()["bob", 2].to_numpy() == several["bob"][1]).all()
    assert cert.final_state.to_pandas().to_dict() == {k: float(x) for k, x in dict(cert.final_state).items()}


def test_a_table_of_many_graphs_has_the_same_types_whatever_its_rows():
    pytest.importorskip("pandas")
    table = ptcc.certify_many({"team": TEAM, "fig": "fig1a"}, PROTOCOL, method="perron")
    frame = table.to_pandas()
    assert frame["graph"].tolist() == ["team", "fig"]
    assert (frame.dtypes == type(table)().to_pandas().dtypes).all()


def test_without_pandas_a_line_names_it(cert, monkeypatch):
    real = builtins.__import__

    def without(name, *args, **more):
        if name == "pandas":
            raise ImportError(name)
        return real(name, *args, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    for ask in (TEAM.to_pandas, cert.trajectory.to_pandas, cert.final_state.to_pandas):
        with pytest.raises(ParameterError, match="pip install"):
            ask()


def test_parameters_of_a_protocol_are_replaced_by_name():
    assert PROTOCOL.replace(T=3, kappa="1/2") == ptcc.NominalProtocol(T=3, rho1=1, rho2=1, kappa="1/2")
    with pytest.raises(ParameterError, match="NominalProtocol has no parameter gamma; it has T, rho1, rho2, kappa"):
        PROTOCOL.replace(gamma=3)


def test_a_protocol_has_the_defaults_of_the_command_line():
    from ptcc_certify.cli import cli
    from ptcc_certify.cli.options import protocol_of

    context = cli.commands["certify"].make_context("certify", ["fig1a"], help_option_names=["-h", "--help"])
    for kind, protocol in (("nominal", ptcc.NominalProtocol()), ("sliding-mode", ptcc.SlidingModeProtocol())):
        assert protocol_of(context.params | {"kind": kind}) == protocol


def test_vector_valued_states_are_refused_with_the_mend():
    with pytest.raises(ParameterError, match="each coordinate has a certificate of its own"):
        ptcc.certify(TEAM, PROTOCOL, [[5, 1], [2, 0], [-4, 2]])
