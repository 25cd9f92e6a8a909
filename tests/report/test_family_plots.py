"""Facts about figures of families: runs lie within what is shaded, below the bound, and above it if it is wrong."""

import numpy as np
import pytest

from ptcc_certify.certificate.family_certificate import certify_family
from ptcc_certify.errors import ParameterError
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.family import Family
from ptcc_certify.protocols import NominalProtocol
from ptcc_certify.report.plots.family import plot_family, plot_family_decay, sample_runs
from ptcc_certify.simulation.family_run import simulate_family
from ptcc_certify.simulation.signals import RandomSignal, WorstCaseSignal

PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=3)
DAY = Family.from_graph(SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1), ("c", "a", -2)]), uncertainty="20%")
NIGHT = SignedDigraph.from_edges([("c", "a", -2), ("a", "b", 1)])


@pytest.fixture(scope="module")
def drawn():
    certificate = certify_family(Family.switching({"day": DAY, "night": NIGHT}), PROTOCOL, [1, 4, -3])
    return certificate, sample_runs(certificate, [RandomSignal(1), RandomSignal(2), WorstCaseSignal()])


def test_every_run_lies_within_what_is_shaded(drawn):
    certificate, runs = drawn
    ax = plot_family(certificate, runs=runs)
    tubes = [shade.get_paths()[0] for shade in ax.collections]
    assert tubes
    for run in runs:
        for x in run.states:
            points = np.column_stack([run.t, x])[1:-12]
            assert any(tube.contains_points(points, radius=1e-3).all() for tube in tubes)


def test_the_decay_of_every_run_lies_below_the_bound(drawn):
    certificate, runs = drawn
    ax = plot_family_decay(certificate, runs=runs, axis="clock")
    lines = {line.get_label(): line for line in ax.lines}
    bound = lines["proved for every signal"].get_ydata()
    gaps = [line.get_ydata() for line in ax.lines if len(line.get_ydata()) == len(bound)]
    assert len(gaps) == 4
    assert all(not (gap > bound * 1.000001).any() for gap in gaps)


def test_what_cannot_be_drawn_is_refused(drawn):
    certificate, _ = drawn
    other = simulate_family(DAY, PROTOCOL, [1, 4, -3], times=[0, 1])
    for call, told in (
        (lambda: plot_family(other), "certificate of a family"),
        (lambda: plot_family(certificate, runs=[other]), "of the certificate"),
        (lambda: plot_family_decay(certificate, axis="up"), "is unknown"),
        (lambda: plot_family(certify_family(DAY, PROTOCOL)), "no initial state"),
    ):
        with pytest.raises(ParameterError, match=told):
            call()
