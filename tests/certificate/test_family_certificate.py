"""What certificates of families hold and say, and what they refuse."""

from __future__ import annotations

import numpy as np
import pytest
from asked import certify_family, family_certificate
from cpu_time import at_most

from lmi.common_lyapunov import evaluate
from lmi.exact.work import WorkError, limited
from ptcc_certify import NominalProtocol
from ptcc_certify.certificate import family_certification
from ptcc_certify.certificate.family_proof import ComponentProof
from ptcc_certify.checker import common_forms
from ptcc_certify.checker.matrix_products import WITH_MULTIPLIERS, need_rows_with_multipliers
from ptcc_certify.checker.reading import RejectedError
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.family import Family
from ptcc_certify.lyapunov import common_form_search
from ptcc_certify.lyapunov.common_form_search import prove_certificate
from ptcc_certify.lyapunov.common_forms import Quotient
from ptcc_certify.report.screen import certificate_lines, summary_lines
from ptcc_certify.theorems.family_behaviour import decide

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)


def test_more_modes_than_a_certificate_holds_are_refused_before_any_work():
    one = Family.from_intervals([("a", "b", 1, 2), ("b", "a", 1, 1)]).modes[0]
    many = Family((one,) * 1001)
    with at_most(0.5), pytest.raises(ParameterError, match="1,001 modes, and a certificate holds 1,000 at most; put"):
        certify_family(many, PROTOCOL)
    assert decide(many)[0].behaviour == "bipartite consensus"


def test_what_is_decided_on_edges_alone_is_told_and_not_certified():
    """300 agents hear two leaders; at night everybody listens twice as much."""
    rows = [("left", "n1", 1), ("right", "n1", 2)]
    for k in range(2, 301):
        rows += [(f"n{k - 1}", f"n{k}", k), ("left", f"n{k}", 1), (f"n{k}", f"n{k - 1}", 3)]
    day, night = (Family.from_intervals([(s, t, w * x, w * x) for s, t, w in rows]) for x in (1, 2))
    family = Family.switching([day, night])
    certificate = certify_family(family, PROTOCOL, [1] * 302, expectations="bipartite containment", time_limit=10)
    assert certificate.behaviours == ("bipartite containment",) and certificate.verdict == "undecided"
    assert (
        certificate.assessment.exit_code == 4 and "decided on edges, and not certified" in certificate.assessment.text
    )
    assert certificate.final_state == (None,) * 302
    text = "\n".join(
        [*summary_lines(certificate, "net"), *certificate_lines(certificate, "net"), str(certificate.to_dict())]
    )
    assert "containment at T = 1 for every signal" in text


def test_what_is_no_instant_and_no_certificates_name_is_refused(tmp_path):
    made = certify_family(Family.from_intervals([("a", "b", 1, 2)]), PROTOCOL, [1, 2])
    for wrong in ([2], [-1], ["x"], [float("nan")]):
        for bound in (made.deviation_bound, made.input_bound):
            with pytest.raises(ParameterError, match="remaining"):
                bound(wrong)
    assert made.deviation_bound(0.5).shape == made.input_bound(0.5).shape == (2, 1)
    with pytest.raises(ParameterError, match=r"a certificate is saved as \.json"):
        made.save(tmp_path / "c.html")
    assert not list(tmp_path.iterdir())


def test_where_ends_depend_on_the_signal_the_obligation_says_so():
    made = certify_family(Family.from_intervals([("a", "b", 0, 1)]), PROTOCOL, [1, 2])
    (step,) = (step for step in made.checked.obligations if step.kind == "family-final-state")
    assert step.detail == "none claimed: ends depend on the signal"


def test_a_component_tells_how_many_nodes_it_has_and_what_these_do():
    cert = certify_family(Family.from_intervals([("a", "b", 1, 2)]), NominalProtocol(T=1, rho1=1, rho2=1, kappa=3))
    assert repr(cert.parts[0].component) == "FamilyComponent(2 nodes, bipartite consensus for every signal)"


def test_bounds_beyond_all_floats_are_infinite():
    size = 10**300
    family = Family.from_intervals([("a", "b", size, 2 * size), ("b", "a", -size, -size)])
    made = certify_family(family, NominalProtocol(T=1, rho1=1, rho2=1, kappa=3), x0=[10**299, -(10**299)])
    assert made.verdict == "certified" and made.parts[0].rate > size
    instants = np.array([0.0, 1e-3, 1.0])  # of 1 - t/T
    bound = made.input_bound(instants)
    assert np.isinf(bound[:, [0, -1]]).all()
    assert 0 < bound[:, 1].max() < 1e-19  # of 5e-324, above what is left
    assert made.deviation_bound(instants)[:, -1].max() < 1e301


def test_a_proof_of_441_rows_is_taken():
    """21 agents that all hear one another, with 420 uncertain edges."""
    names = [f"v{i}" for i in range(21)]
    ends = {True: ("-1.01", "-0.99"), False: ("0.99", "1.01")}
    family = Family.from_intervals([(s, t, *ends[s == "v1"]) for s in names for t in names if s != t])
    (component,) = decide(family)
    quotient = Quotient.of(component)
    found = evaluate(np.eye(21), [quotient.modes[0].array], [np.full(420, 0.02)])
    function = prove_certificate(quotient, "diagonal", found, [0])
    assert function is not None and function.rate > 1.8 and quotient.modes[0].proof_rows == 441
    made = family_certificate(family, PROTOCOL, (ComponentProof(component, (function,)),))
    assert made.verdict == "certified" and made.rate == function.rate


def test_more_rows_than_are_taken_are_refused_and_many_are_work():
    with pytest.raises(RejectedError, match="a matrix of 801 rows; 800 are taken"):
        need_rows_with_multipliers(WITH_MULTIPLIERS + 1)
    with limited(0.1), pytest.raises(WorkError, match="a proof of definiteness would take too long"):
        need_rows_with_multipliers(WITH_MULTIPLIERS)


def _three_uncertain_edges() -> Family:
    return Family.from_intervals([("a", "b", 1, 2), ("b", "c", 1, 3), ("c", "a", -2, -1)])


def test_no_function_is_searched_whose_proof_has_more_rows_than_the_check_takes(monkeypatch):
    """3 agents and 3 uncertain edges."""
    monkeypatch.setattr(common_form_search, "WITH_MULTIPLIERS", 5)
    monkeypatch.setattr(family_certification, "squares_function", lambda *_: None)
    made = certify_family(_three_uncertain_edges(), PROTOCOL, [1, 2, 3])
    assert made.verdict == "certified" and made.rate is None
    text = " ".join("\n".join(summary_lines(made, "net")).split())
    assert (
        "in closed form; no larger one was proved (6 agents and uncertain edges in one mode are above the rows" in text
    )
    monkeypatch.setattr(common_form_search, "WITH_MULTIPLIERS", 6)
    assert certify_family(_three_uncertain_edges(), PROTOCOL).rate


@pytest.mark.few(0)
def test_functions_that_the_check_refuses_are_left_out(monkeypatch):
    def refuse(rows: int) -> None:
        raise RejectedError("too many rows")

    monkeypatch.setattr(common_forms, "need_rows_with_multipliers", refuse)
    monkeypatch.setattr(family_certification, "LARGEST_ROWS", 5)
    made = certify_family(_three_uncertain_edges(), PROTOCOL, [1, 2, 3])
    assert made.verdict == "certified" and made.rate is None and made.parts[0].functions == ()
    assert made.notes[-1] == "the independent check does not take all functions that were found: too many rows"


def test_what_the_check_refuses_is_not_called_proved(monkeypatch):
    made = certify_family(_three_uncertain_edges(), PROTOCOL, [1, 2, 3])
    text = " ".join("\n".join(summary_lines(made, "net")).split())
    assert "both proved" in text and made.verdict == "certified"

    def refuse(rows: int) -> None:
        raise RejectedError("too many rows")

    monkeypatch.setattr(common_forms, "need_rows_with_multipliers", refuse)
    made = certify_family(_three_uncertain_edges(), PROTOCOL, [1, 2, 3])
    text = " ".join("\n".join(summary_lines(made, "net")).split())
    assert "proved" not in text and "undecided: the independent check rejects family-rate" in text
