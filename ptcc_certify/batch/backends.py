"""Where rows are computed: in this process, in several of this machine, or on a Dask cluster.

Every way takes tasks one after the other, a few ahead of the workers, and gives rows as they come.
"""

from __future__ import annotations

import logging
import math
import os
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from contextlib import contextmanager
from typing import Any

from ptcc_certify.batch.rows import Row, certified_row, failed_row, package_version
from ptcc_certify.batch.settings import INSTALL, Settings
from ptcc_certify.batch.sources import Task
from ptcc_certify.errors import ParameterError, one_line
from ptcc_certify.graphs.rationals import shorten

#: One thread of linear algebra for each process; NumPy reads these when it is loaded.
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
#: Seconds after which an idle worker process ends.
IDLE = 20
#: Graphs under way for each worker: while one is computed the next is there.
AHEAD = 2
#: Seconds to find a scheduler, and to wait for a worker of it when there is none.
PATIENCE = 20


def compute_rows(
    tasks: Iterator[Task], settings: Settings, workers: int, scheduler: str | None
) -> Generator[tuple[Task, Row]]:
    """Compute the rows of tasks, on a Dask cluster if there is a scheduler; close the generator to give up."""
    if scheduler is not None:
        return _on_dask(tasks, settings, scheduler)
    if workers > 1:
        return _on_processes(tasks, settings, workers)
    return ((task, certified_row(task.name, task.payload, settings)) for task in tasks)


def default_workers() -> int:
    """Return the number of cores that this process may use; 1 where joblib is not installed.

    Returns
    -------
    int

    Examples
    --------
    >>> default_workers() >= 1
    True
    """
    try:
        from joblib import cpu_count
    except ImportError:
        return 1
    return int(cpu_count())


def _on_processes(tasks: Iterator[Task], settings: Settings, workers: int) -> Generator[tuple[Task, Row]]:
    """Compute rows in processes of this machine.

    A process that dies breaks the pool and all that is under way. Those graphs are tried again one at a time in a pool
    of one process, where nothing else can have died. Chance may kill one there too: only a graph whose process dies
    twice is to blame.
    """
    try:
        from multiprocessing import resource_tracker

        from joblib.externals.loky import ProcessPoolExecutor
        from joblib.externals.loky.backend import resource_tracker as loky_tracker
    except ImportError:
        raise ParameterError(f"several workers need joblib; {INSTALL}, or say --workers 1") from None

    def start(size: int) -> Any:
        with _uninterrupted():
            if os.name == "posix":  # the trackers unblock the signal when they start: they do so before the processes
                resource_tracker.ensure_running()
                loky_tracker.ensure_running()
            return ProcessPoolExecutor(size, timeout=IDLE, initializer=_attend, initargs=(os.getpid(),), env=ONE_THREAD)

    def stop() -> None:
        if pool is not None:
            pool.shutdown(kill_workers=True)

    pool: Any = None
    size = 0
    under_way: dict[Future[Row], Task] = {}
    suspects: deque[Task] = deque()
    deaths: Counter[int] = Counter()
    try:
        while True:
            if not under_way and size != (wanted := 1 if suspects else workers):
                stop()
                pool, size = start(wanted), wanted
            broken, room = False, AHEAD * workers if size == workers else 1
            while len(under_way) < room and not broken:
                own = tasks if size == workers else iter(())
                task = suspects.popleft() if suspects else next(own, None)
                if task is None:
                    break
                try:
                    with _uninterrupted():  # processes start with the first graph
                        future = pool.submit(certified_row, task.name, task.payload, settings)
                    under_way[future] = task
                except BrokenExecutor:  # by a graph that is under way, or by one whose row was just taken
                    suspects.append(task)
                    broken = True
            if not under_way and not broken:
                return
            for future in wait(under_way, return_when=FIRST_COMPLETED).done:
                task = under_way.pop(future)
                try:
                    row = future.result()
                except BrokenExecutor:
                    broken = True
                    deaths[task.number] += size == 1
                    if deaths[task.number] < 2:
                        suspects.append(task)
                        continue
                    row = failed_row(task.name, "the process that worked on it died, perhaps for lack of memory")
                yield task, row
            if broken:
                suspects.extend(under_way.values())
                under_way.clear()
                size = 0  # asks for a new pool
    finally:
        stop()


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Keep Ctrl-C back while processes start, and raise KeyboardInterrupt afterwards.

    A process that starts inherits the signals that are blocked, and cannot be interrupted before it knows what to do.
    """
    if threading.current_thread() is not threading.main_thread():  # which alone is interrupted
        yield
        return
    interrupted = []
    # Another thread may get the signal, which is blocked in this one only: what Python does about it is done here.
    before = signal.signal(signal.SIGINT, lambda *_: interrupted.append(True))
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if os.name == "posix" else None
    try:
        yield
    finally:
        if mask is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, signal.SIG_DFL if before is None else before)
        if interrupted:
            raise KeyboardInterrupt


def _attend(parent: int) -> None:
    """Leave Ctrl-C, which a terminal sends to every process, to the parent, and end with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def follow() -> None:
        while os.getppid() == parent:
            time.sleep(1)
        os._exit(1)

    if os.name == "posix":  # elsewhere a process keeps the number of its parent, and ends when it is idle
        threading.Thread(target=follow, daemon=True).start()


def _on_dask(tasks: Iterator[Task], settings: Settings, scheduler: str) -> Generator[tuple[Task, Row]]:
    """Compute rows on the workers of a Dask cluster, a few ahead for each of their threads."""
    try:
        from distributed import Client, as_completed
        from distributed.comm import resolve_address
    except ImportError:
        raise ParameterError(f"a scheduler needs Dask; {INSTALL}") from None
    where = shorten(scheduler, 100)
    try:
        resolve_address(scheduler)  # refuses what a client would refuse half made, and then wait for at the exit
        client = Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except Exception as error:
        reason = shorten(one_line(str(error)), 100) or type(error).__name__
        raise ParameterError(f"{where}: no Dask scheduler answers ({reason}); check the address") from None
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what matters is told in one line below
    with client:
        _refuse_workers(client, where)
        under_way: dict[Any, Task] = {}
        done = as_completed(loop=client.loop)
        room, asked = 0, -math.inf
        while True:
            if time.monotonic() > asked + 1:  # workers come and go
                room, asked = AHEAD * max(_threads(client, where), 1), time.monotonic()
            while len(under_way) < room and (task := next(tasks, None)) is not None:
                future = client.submit(certified_row, task.name, task.payload, settings, pure=False)
                under_way[future] = task
                done.add(future)
            if not under_way:
                return
            _wait_for_row(client, done, where)
            future = next(done)
            task = under_way.pop(future)
            try:
                row = future.result()
            except CancelledError:
                raise _lost(where) from None
            except Exception as error:
                row = failed_row(
                    task.name, f"the worker failed ({type(error).__name__}: {shorten(one_line(str(error)), 200)})"
                )
            del future  # frees the row on the worker
            yield task, row


def _threads(client: Any, where: str) -> int:
    """Return how many threads the workers of a cluster have."""
    try:
        return sum(client.nthreads().values())
    except OSError:
        raise _lost(where) from None


def _lost(where: str) -> ParameterError:
    return ParameterError(f"{where}: the scheduler was lost; start it again, and the same command")


def _wait_for_row(client: Any, done: Any, where: str) -> None:
    """Wait until a row is there; refuse to wait for workers that are gone and do not come back."""
    alive = asked = time.monotonic()
    while not done.has_ready():
        time.sleep(0.01)
        if (now := time.monotonic()) < asked + 1:
            continue
        asked = now
        if _threads(client, where):
            alive = now
        elif now > alive + PATIENCE:
            raise ParameterError(
                f"{where}: this scheduler has lost all its workers; start some: dask worker {where}, and then the same "
                "command"
            )


def _refuse_workers(client: Any, where: str) -> None:
    """Refuse a cluster without workers, or with workers of another version."""
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
