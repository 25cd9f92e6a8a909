"""Searches end: at the time limit with what was proved by then, and at Ctrl-C at once."""

from __future__ import annotations

import itertools
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from asked import certify_family
from bad_inputs import ptcc
from threadpoolctl import threadpool_info, threadpool_limits

import lmi
from lmi import search_time
from lmi.blas_threads import one_thread
from lmi.child_process import apart
from lmi.errors import OutOfTime
from lmi.search_time import checkpoint, part_of_time, seconds_left, share_of_time, spend, time_limit
from ptcc_certify import Agents, NominalProtocol, SignedDigraph, certify, check, simulate
from ptcc_certify.certificate import graph_certification
from ptcc_certify.certificate.graph_certification import STEPS
from ptcc_certify.errors import ParameterError
from ptcc_certify.examples import load_graph
from ptcc_certify.graphs.family import Family
from ptcc_certify.lyapunov import search as search_functions
from ptcc_certify.lyapunov.error_system import ErrorSystem
from ptcc_certify.lyapunov.search import Candidate
from ptcc_certify.model.asks import Asks

linux = pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux only")
PROTOCOL = NominalProtocol(T=1, rho1=1, rho2=1, kappa=2)


def ring(n: int) -> SignedDigraph:
    return SignedDigraph.from_edges([(i, (i + 1) % n, 1 if i else -1) for i in range(n)])


def test_limits_inside_each_other_end_at_the_first():
    with time_limit(1000), time_limit(2000):
        assert seconds_left() <= 1000
        with time_limit(0), pytest.raises(lmi.OutOfTime):
            checkpoint()
        checkpoint()
    assert seconds_left() == math.inf


def test_a_share_of_no_limit_is_no_limit():
    cut_off: list[str] = []
    with share_of_time(0.5, "a search", cut_off):
        assert seconds_left() == math.inf
    assert not cut_off


def test_each_thread_has_its_own_limit():
    seen = []
    with time_limit(0):
        thread = threading.Thread(target=lambda: seen.append(seconds_left()))
        thread.start()
        thread.join()
    assert seen == [math.inf]


def test_every_search_ends_at_a_limit():
    A = ring(40).laplacian().toarray() + np.eye(40)
    for search in (
        lambda: lmi.diagonal_lyapunov(A),
        lambda: lmi.diagonal_lyapunov(A, objective="rate"),
        lambda: lmi.diagonal_lyapunov(A, solver="clarabel"),
        lambda: lmi.rate_frontier(A),
        lambda: lmi.full_frontier(A),
        lambda: lmi.h_matrix_certificate(A),
        lambda: lmi.prove_generalized_margin((A + A.T).astype(int).tolist(), np.eye(40, dtype=int).tolist(), 0.5),
    ):
        with time_limit(0), pytest.raises(lmi.OutOfTime):
            search()


@pytest.mark.parametrize("name", ["fig1a", "fig1b", "fig3a", "fig5a", "fig5b"])
def test_without_time_nothing_is_claimed_and_everything_is_named(name: str):
    cert = certify(load_graph(name), PROTOCOL, [1] * load_graph(name).n_nodes, asks=Asks(time_limit=1e-9))
    assert cert.verdict == "undecided" and cert.rate is None and cert.trajectory is None
    assert {STEPS[0], STEPS[1]} <= set(cert.cut_off) and cert.upper_bound is not None  # which needs no search
    assert "raise time_limit" in cert.assessment.text and cert.assessment.exit_code == 4
    document = cert.to_dict()
    assert document["unverified"]["cut_off"] == list(cert.cut_off)
    report = check(document)
    assert report.accepted and report.verdict == "undecided"


def leaping(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let an hour of wall time go by whenever somebody looks at the clock: a machine as busy as can be."""
    now = itertools.count(step=3600.0)
    monkeypatch.setattr(search_time, "_now", lambda: next(now))


def tree(n: int) -> SignedDigraph:
    return SignedDigraph.from_edges([(k // 2, k, 1 if k % 3 else -2) for k in range(1, n)])


@pytest.mark.few(0)
@pytest.mark.parametrize("graph", [load_graph("fig1a"), tree(130)], ids=["small", "large"])
def test_without_a_limit_asked_for_no_wall_time_changes_what_is_found_of_a_graph(
    graph: SignedDigraph, monkeypatch: pytest.MonkeyPatch
):
    at_leisure = certify(graph, PROTOCOL, [1] * graph.n_nodes)
    leaping(monkeypatch)
    busy = certify(graph, PROTOCOL, [1] * graph.n_nodes)
    assert busy == at_leisure and not busy.cut_off and busy.verdict == "certified"


def test_final_states_that_run_out_of_time_are_not_called_ill_conditioned(monkeypatch: pytest.MonkeyPatch):
    def endless(*_: object) -> None:
        raise OutOfTime("the time limit is reached")

    monkeypatch.setattr(graph_certification, "enclose", endless)
    cert = certify(tree(130), PROTOCOL, [1] * 130, asks=Asks(time_limit=50))
    assert cert.verdict == "undecided" and "final state" in cert.cut_off
    assert cert.assessment.text.endswith("it took its share of 50 s; raise time_limit"), cert.assessment.text


def test_a_limit_that_is_asked_for_counts_wall_time(monkeypatch: pytest.MonkeyPatch):
    leaping(monkeypatch)
    assert certify(
        load_graph("fig1a"), PROTOCOL, [1] * 6, asks=Asks(time_limit=3600)
    ).cut_off  # a limit that is asked for


@pytest.mark.few(0)
def test_without_a_limit_asked_for_no_wall_time_changes_what_is_found_of_a_family(monkeypatch: pytest.MonkeyPatch):
    family = Family.from_intervals([(k, (k + 1) % 7, 1, 2) for k in range(7)])
    at_leisure = certify_family(family, PROTOCOL)
    leaping(monkeypatch)
    busy = certify_family(family, PROTOCOL)
    assert busy == at_leisure and not any("cut off" in note for note in busy.notes)


def test_a_step_is_not_begun_if_it_takes_more_than_the_work_that_is_left():
    with time_limit(10, work=True), part_of_time(0.5):
        spend(3)
        with pytest.raises(lmi.OutOfTime):
            spend(3)
        spend(1)
    spend(1e9)  # without a limit


@linux
def test_work_apart_counts_as_work_here():
    def counts() -> Iterator[int]:
        spend(3)
        yield 1
        spend(3)
        yield 2

    found = []
    with time_limit(5, work=True):
        with pytest.raises(lmi.OutOfTime):
            for value in apart(counts):
                found.append(value)
        with pytest.raises(lmi.OutOfTime):
            spend(3)
        spend(1)
    assert found == [1]


@linux
def test_a_process_that_works_without_counting_is_ended_by_its_processor_time(monkeypatch: pytest.MonkeyPatch):
    def never_ends() -> Iterator[int]:
        yield 1
        while True:
            pass

    monkeypatch.setattr(search_time, "_PATIENCE", 0.1)
    found = []
    with time_limit(3, work=True), pytest.raises(lmi.OutOfTime):
        for value in apart(never_ends):
            found.append(value)
    assert found == [1]


def test_small_matrices_are_multiplied_by_one_thread_until_the_last_leaves():
    def threads() -> list[int]:
        return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]

    def enter() -> None:
        with one_thread():
            pass

    enter()  # which loads all there is to load
    with threadpool_limits(2, user_api="blas"):
        before, other = threads(), threading.Thread(target=enter)
        with one_thread():
            other.start()
            other.join()
            assert set(threads()) == {1}
        assert threads() == before
        with one_thread(False):
            assert threads() == before


def test_what_is_proved_before_the_limit_stands(monkeypatch: pytest.MonkeyPatch):
    """On a clock that goes on in a search without end alone, however busy the machine is."""
    search, now = search_functions._lmi_candidates, [0.0]

    def without_end(system: ErrorSystem, thorough: bool) -> Iterator[Candidate]:
        yield next(search(system, thorough))
        while True:
            now[0] += 0.01
            checkpoint()

    monkeypatch.setattr(search_functions, "_lmi_candidates", without_end)
    monkeypatch.setattr(search_time, "_now", lambda: now[0])
    cert = certify(load_graph("fig1a"), PROTOCOL, [1] * 6, asks=Asks(time_limit=8))
    assert cert.cut_off == ("class lmi",)
    assert cert.verdict == "certified" and {"perron", "full", "lmi"} == set(cert.search.searched)
    assert check(cert.to_dict()).accepted


HOLDS = """
import ctypes, os, sys
from ptcc_certify import Asks, NominalProtocol, SignedDigraph, certify
from ptcc_certify.lyapunov import search as sharpen

def holds(system, thorough):
    yield from ()
    os.write(1, b"holds\\n")
    ctypes.PyDLL(None).sleep(600)  # the interpreter is held: no other thread, no handler of a signal runs

sharpen._lmi_candidates = holds
ring = SignedDigraph.from_edges([(i, (i + 1) % 50, 1 if i else -1) for i in range(50)])
cert = certify(ring, NominalProtocol(T=1, rho1=1, rho2=1, kappa=2), [1] * 50, asks=Asks(time_limit=float(sys.argv[1])))
print(cert.verdict, cert.cut_off)
"""


@pytest.mark.few(0)
@linux
def test_a_solver_that_holds_the_interpreter_is_ended_at_the_limit():
    run = subprocess.run([sys.executable, "-c", HOLDS, "12"], capture_output=True, text=True, timeout=300, check=True)
    *_, told = run.stdout.splitlines()
    assert told.startswith("certified ") and "'class lmi'" in told  # a busy machine cuts off more


@pytest.mark.few(0)
@linux
def test_a_solver_that_holds_the_interpreter_is_ended_by_an_interrupt():
    run = subprocess.Popen(
        [sys.executable, "-c", HOLDS, "600"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert run.stdout is not None and run.stdout.readline() == "holds\n"
    run.send_signal(signal.SIGINT)
    _, err = run.communicate(timeout=60)
    assert run.returncode != 0 and "KeyboardInterrupt" in err


def test_work_apart_hands_over_values_errors_and_its_end():
    assert list(apart(lambda: [{"a": np.arange(3)}, 2]))[1] == 2

    def fails() -> Iterator[int]:
        yield 1
        raise lmi.NoCertificate("none")

    found = []
    with pytest.raises(lmi.NoCertificate, match="none"):
        for value in apart(fails):
            found.append(value)
    assert found == [1]


@linux
def test_the_death_of_a_process_is_told():
    def dies() -> Iterator[int]:
        yield 1
        os._exit(3)

    with pytest.raises(lmi.LMIError, match="without an answer"):
        list(apart(dies))


@linux
def test_work_apart_takes_many_open_files_and_large_values():
    import resource

    if resource.getrlimit(resource.RLIMIT_NOFILE)[0] < 1200:
        pytest.skip("a process may not open more than 1,023 files here")
    files = [os.dup(1) for _ in range(1100)]  # descriptors above 1023, which select() does not know
    try:
        assert [len(x) for x in apart(lambda: iter([bytes(10_000_000)]))] == [10_000_000]
    finally:
        for file in files:
            os.close(file)


@linux
def test_an_interrupt_while_a_process_is_made_is_not_lost():
    fork, made = os.fork, []

    def interrupted() -> int:
        signal.raise_signal(signal.SIGINT)  # comes once both processes are ready
        made.append(fork())
        return made[-1]

    with pytest.MonkeyPatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(os, "fork", interrupted)
        list(apart(lambda: iter(range(3))))
    with pytest.raises(ChildProcessError):
        os.waitpid(made[0], os.WNOHANG)


@linux
def test_work_apart_is_done_where_children_are_not_waited_for():
    before = signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    try:
        assert list(apart(lambda: range(3))) == [0, 1, 2]
    finally:
        signal.signal(signal.SIGCHLD, before)


@linux
def test_work_apart_is_done_here_where_no_process_can_be_made(monkeypatch: pytest.MonkeyPatch):
    def refused() -> int:
        raise BlockingIOError("no more processes")

    monkeypatch.setattr(os, "fork", refused)
    before = len(list(Path("/proc/self/fd").iterdir()))
    assert list(apart(lambda: range(3))) == [0, 1, 2]
    assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_an_error_that_cannot_be_handed_over_is_told_in_words():
    class OddError(Exception):
        def __init__(self, one: int, other: int):
            super().__init__(f"{one} and {other}")

    def fails() -> Iterator[int]:
        yield from ()
        raise OddError(1, 2)

    with pytest.raises((lmi.LMIError, OddError), match="1 and 2"):
        list(apart(fails))


@pytest.mark.few(0)
@linux
def test_a_search_apart_ends_though_the_solver_ran_before():
    """Clarabel waits for ever in a child that is forked after it ran, from about 20 rows on."""
    A = np.diag(np.arange(1.0, 26)) - 0.01
    assert lmi.diagonal_lyapunov(A, solver="clarabel").rate > 0
    with time_limit(30):
        (found,) = apart(lambda: iter([lmi.diagonal_lyapunov(A).rate]))
    assert found > 0


@pytest.mark.few(0)
@linux
def test_what_came_before_the_limit_is_kept():
    found = []

    def slow() -> Iterator[int]:
        yield 1
        time.sleep(600)

    with time_limit(2), pytest.raises(lmi.OutOfTime):
        for value in apart(slow):
            found.append(value)
    assert found == [1]


@pytest.mark.few(0)
def test_without_a_limit_nothing_is_cut_off():
    cert = certify(load_graph("fig3a"), PROTOCOL, [1] * 6, asks=Asks(time_limit=math.inf))
    assert cert.cut_off == () and cert.verdict == "certified"
    assert cert.to_dict()["unverified"]["time_limit"] is None


def test_the_default_grows_with_the_graph():
    assert certify(ring(3), PROTOCOL, asks=Asks(simulation=False)).time_limit == 60


@pytest.mark.parametrize("seconds", [0, -1, math.nan])
def test_a_limit_that_is_not_positive_is_refused(seconds: float):
    with pytest.raises(ParameterError, match="time_limit"):
        certify(ring(3), PROTOCOL, asks=Asks(time_limit=seconds))
    run = ptcc("certify", "fig1a", "--time-limit", str(seconds))
    assert run.code == 2 and run.err.count("\n") == 1 and "--time-limit" in run.err


def test_the_integrator_ends_at_the_limit_and_leaves_signals_as_they_were():
    handlers = [signal.getsignal(number) for number in (signal.SIGINT, getattr(signal, "SIGALRM", signal.SIGINT))]
    rng = np.random.default_rng(0)
    pairs = rng.integers(0, 3000, (12000, 2))
    graph = SignedDigraph.from_edges([(int(a), int(b), 1) for a, b in {tuple(p) for p in pairs.tolist()} if a != b])
    with time_limit(0.05), pytest.raises(lmi.OutOfTime):
        simulate(graph, PROTOCOL, rng.normal(size=graph.n_nodes), samples=5000)
    assert [signal.getsignal(n) for n in (signal.SIGINT, getattr(signal, "SIGALRM", signal.SIGINT))] == handlers
    if hasattr(signal, "setitimer"):
        assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    assert simulate(ring(3), PROTOCOL, [1, 2, 3]).deadline_resolved


def test_the_screen_names_what_was_cut_off():
    run = ptcc("certify", "fig1a", "--time-limit", "1e-9", "-v")
    assert run.code == 4
    assert "cut off" in run.out and "the paper's certificate" in run.out


def test_the_time_limit_ends_an_exact_final_state_and_an_enclosed_one_is_proved(monkeypatch: pytest.MonkeyPatch):
    def too_long(structure: object) -> None:
        raise OutOfTime("exact")

    monkeypatch.setattr("ptcc_certify.certificate.graph_certification.influence", too_long)
    graph = SignedDigraph.from_edges([("lead", "a", 3), ("other", "a", 1), ("a", "b", -1)])
    cert = certify(graph, PROTOCOL, [2, -2, 1, 5], asks=Asks(time_limit=60, method="perron", simulation=False))
    assert cert.cut_off == ("exact final state",) and cert.final_state is not None and cert.verdict == "certified"
    assert cert.final_state.radius is not None
    x0 = dict(zip(graph.labels, [2, -2, 1, 5], strict=True))
    a = Fraction(3 * x0["lead"] + x0["other"], 4)
    for label, true in {"lead": x0["lead"], "other": x0["other"], "a": a, "b": -a}.items():
        v = graph.index[label]
        assert abs(Fraction(cert.final_state.states[v]) - true) <= cert.final_state.radius[v] < 1e-9


def test_the_run_of_agents_of_order_n_ends_at_its_share_of_the_time_limit():
    team = SignedDigraph.from_edges([("a", "b", 1), ("b", "c", -1), ("c", "a", -1)])
    made = certify(
        team,
        NominalProtocol(T=1, rho1=1, rho2=8, kappa=1),
        [3, 1, 2],
        agents=Agents(order=2),
        asks=Asks(time_limit=1e-6),
    )
    assert "simulation" in made.cut_off and made.observed.agents_run is None
