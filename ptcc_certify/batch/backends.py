"""Where rows are computed: in this process, or by the workers of a Dask cluster, of this machine or of many.

A cluster takes tasks one after the other, a few ahead of its workers, and gives rows as they come.
"""

from __future__ import annotations

import logging
import math
import os
import pickle
import signal
import threading
import time
from collections.abc import Generator, Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from importlib.util import find_spec
from multiprocessing import resource_tracker
from typing import Any

from lmi.child_process import any_thread
from ptcc_certify.batch.rows import Row, certified_row, failed_row, package_version
from ptcc_certify.batch.sources import INSTALL, Settings, Task
from ptcc_certify.errors import ParameterError, one_line
from ptcc_certify.graphs.rationals import shorten

#: Graphs under way for each thread of a worker: while one is computed the next is there.
AHEAD = 2
#: Seconds to find a scheduler, and to wait for a worker when there is none.
PATIENCE = 30
#: How often a graph may be tried alone after the process that it was sent to had died: chance may have killed that one.
TRIALS = 2
#: One thread of linear algebra for each process; NumPy reads these when it is loaded.
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
#: A process that dies is told at once; one whose native code is long at work is not given up.
_OWN_CLUSTER = {
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.worker-ttl": None,
    "distributed.deploy.lost-worker-timeout": "1 hour",
    "distributed.admin.large-graph-warning-threshold": "1 TiB",
    "distributed.nanny.pre-spawn-environ": ONE_THREAD,
}


def compute_rows(
    tasks: Iterator[Task], settings: Settings, workers: int, scheduler: str | None
) -> Generator[tuple[Task, Row]]:
    """Compute the rows of tasks, here if one worker is enough; close the generator to give up."""
    if scheduler is None and workers == 1:
        return ((task, certified_row(task.name, task.payload, settings)) for task in tasks)
    return _on_cluster(tasks, settings, workers, scheduler)


def default_workers() -> int:
    """Return the number of cores that this process may use; 1 where Dask is not installed.

    Returns
    -------
    int

    Examples
    --------
    >>> default_workers() >= 1
    True
    """
    if find_spec("distributed") is None:
        return 1
    from dask.system import cpu_count

    return int(cpu_count())


def _on_cluster(
    tasks: Iterator[Task], settings: Settings, workers: int, scheduler: str | None
) -> Generator[tuple[Task, Row]]:
    """Compute rows on a cluster.

    With a process that dies all graphs that were sent to it are lost. They are tried again when all others are done,
    one at a time, where nothing else can have died.
    """
    try:
        with _hold_back_interrupts():  # Python forgets that one was handled which came while an import ran a text
            import distributed  # noqa: F401
    except ImportError:
        raise ParameterError(f"several workers, or a scheduler, need Dask; {INSTALL}, or say --workers 1") from None
    if scheduler is None:
        workplace, loss = _own_workers(workers), "the worker processes have died; say --workers 1"
    else:
        where = shorten(scheduler, 100)
        workplace, loss = _workers_of(scheduler, where), f"{where}: this scheduler has lost all its workers; start some"
        loss += f": dask worker {where}, and then the same command"
    with workplace as client:
        suspects = []
        for task, row in _compute(client, loss, tasks, settings):
            if row is None:
                suspects.append(task)
            else:
                yield task, row
        for task in suspects:
            trials = (row for _ in range(TRIALS) for _, row in _compute(client, loss, iter([task]), settings))
            failure = failed_row(task.name, "the process that worked on it died, perhaps for lack of memory")
            yield task, next((row for row in trials if row is not None), failure)


@contextmanager
def _own_workers(workers: int) -> Iterator[Any]:
    """Start worker processes of this machine; they end with the block, at once."""
    import dask
    from distributed import Client, LocalCluster

    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # silence_logs ends before what an interrupt breaks
    with dask.config.set(_OWN_CLUSTER), ExitStack() as stack:
        with _hold_back_interrupts():
            try:
                cluster = LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    memory_limit=0,
                    dashboard_address=":0",  # a port that is free, also beside another batch
                    scheduler_kwargs={"dashboard": False},
                    silence_logs=logging.CRITICAL,
                )
            except RuntimeError as error:
                guard = "a script calls this under if __name__ == '__main__'"
                raise ParameterError(f"the worker processes do not start ({one_line(str(error))}); {guard}") from None
            stack.callback(_end, cluster)
        yield stack.enter_context(Client(cluster, set_as_default=False))


def _end(cluster: Any) -> None:
    for nanny in list(cluster.workers.values()):  # what they are at work on is given up
        if nanny.pid is not None:
            with suppress(OSError):
                os.kill(nanny.pid, getattr(signal, "SIGKILL", signal.SIGTERM))
    cluster.close()


@contextmanager
def _hold_back_interrupts() -> Iterator[None]:
    """Keep Ctrl-C back, and from the threads that begin meanwhile for ever, which hand this on to their processes.

    A terminal sends it to every process, and those that begin do not know yet what to do about it.
    """
    if os.name != "posix" or threading.current_thread() is not threading.main_thread():
        yield
        return
    interrupts = []
    before = signal.getsignal(signal.SIGINT)
    if callable(before):  # another thread may get the signal, about which Python does something here
        signal.signal(signal.SIGINT, lambda *_: interrupts.append(True))
    resource_tracker.ensure_running()  # would let the signal through when it starts
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, before)
        if interrupts:
            raise KeyboardInterrupt


@contextmanager
def _workers_of(scheduler: str, where: str) -> Iterator[Any]:
    """Connect to a cluster; refuse one without workers, or with workers of another version."""
    from distributed import Client
    from distributed.comm import resolve_address

    try:
        resolve_address(scheduler)  # refuses what a client would refuse half made, and then wait for at the exit
        client = Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except Exception as error:
        reason = shorten(one_line(str(error)), 100) or type(error).__name__
        raise ParameterError(f"{where}: no Dask scheduler answers ({reason}); check the address") from None
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what matters is told in one line below
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
            versions = client.run(package_version)
        except TimeoutError:
            raise ParameterError(f"{where}: this scheduler has no workers; start some: dask worker {where}") from None
        except Exception as error:
            reason = shorten(one_line(str(error)), 100)
            raise ParameterError(f"{where}: the workers have no ptcc-certify like this one ({reason})") from None
        for worker, version in versions.items():
            if version != (mine := package_version()):
                raise ParameterError(f"{worker}: has ptcc-certify {version}, not {mine}; install the same version")
        yield client


def _compute(client: Any, loss: str, tasks: Iterator[Task], settings: Settings) -> Iterator[tuple[Task, Row | None]]:
    """Compute rows, a few ahead of the workers; None where the process that a graph was sent to has died."""
    from distributed import wait

    under_way: dict[Any, Task] = {}
    query_time, threads = -math.inf, 0
    alive = time.monotonic()
    while True:
        try:
            if (now := time.monotonic()) > query_time + 1:  # workers come and go
                query_time, threads = now, sum(client.nthreads().values())
                alive = now if threads else alive
            while len(under_way) < AHEAD * max(threads, 1) and (task := next(tasks, None)) is not None:
                data = pickle.dumps(task.payload)  # a scheduler need not know what is in it
                under_way[client.submit(_row_of, task.name, data, settings, pure=False)] = task
            if not under_way:
                return
            with client.as_current():
                ready = wait(list(under_way), timeout=1, return_when="FIRST_COMPLETED").done
            rows = [(under_way[future], _row_from(future, under_way[future].name)) for future in ready]
        except TimeoutError:
            if now > alive + PATIENCE:
                raise ParameterError(loss) from None
            continue
        except (CancelledError, OSError):
            raise ParameterError("the scheduler was lost; start it again, and the same command") from None
        for future in ready:
            del under_way[future]
        yield from rows


def _row_of(name: str, data: bytes, settings: Settings) -> Row:
    """Compute a row in a worker, whose threads but this one take no part in it."""
    any_thread.set(True)
    return certified_row(name, pickle.loads(data), settings)  # noqa: S301 - from the process that began the batch


def _row_from(future: Any, name: str) -> Row | None:
    from distributed import KilledWorker

    try:
        return dict(future.result())
    except KilledWorker:
        return None
    except CancelledError:
        raise
    except Exception as error:
        return failed_row(name, f"the worker failed ({type(error).__name__}: {shorten(one_line(str(error)), 200)})")
