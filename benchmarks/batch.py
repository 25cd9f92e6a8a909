"""What `ptcc batch` makes of a thousand graphs: two workers against one, a kill half-way, a Dask cluster.

    python benchmarks/batch.py [--count 1000] [--method perron]

An ensemble of all classes, 5 to 8 nodes, in four parts. Every part is certified by one worker and by two in turn, so
that a machine that is busy with other work is so for both; wall times include the start of the processes. Processor
times tell what two workers could reach if nothing else ran: twice the work of one over theirs. Then all parts together:
by two workers, killed when half of the rows are there, and started again; and by a Dask cluster of two processes. Rows
must be the same each time, but for the seconds. Ends with an error if they are not.
"""

from __future__ import annotations

import argparse
import csv
import os
import signal
import statistics
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

PARTS = 4
Rows = list[dict[str, str]]


def command(specs: list[Path], table: Path, *options: str) -> list[str]:
    start = [sys.executable, "-m", "ptcc_certify.cli", "batch"]
    return [*start, *(path.name for path in specs), "-o", table.name, *options]


def cpu() -> float:
    """Processor time of all processes that have ended."""
    times = os.times()
    return times.children_user + times.children_system


def run(specs: list[Path], table: Path, *options: str) -> tuple[Rows, float]:
    """Rows of a table without the seconds, and how long it took."""
    began = time.perf_counter()
    subprocess.run(command(specs, table, *options), cwd=table.parent, check=True, stdout=subprocess.DEVNULL)
    return read(table), time.perf_counter() - began


def read(table: Path) -> Rows:
    with table.open(newline="", encoding="utf-8") as file:
        return [{name: text for name, text in row.items() if name != "seconds"} for row in csv.DictReader(file)]


def lines_in(journal: Path) -> int:
    return journal.read_bytes().count(b"\n") if journal.exists() else 0


def killed(specs: list[Path], table: Path, rows: int, *options: str) -> int:
    """Begin a batch, kill it when its journal has so many rows, and return how many are kept."""
    journal = table.with_name(f"{table.name}.journal")
    process = subprocess.Popen(command(specs, table, *options), cwd=table.parent, stdout=subprocess.DEVNULL)
    while process.poll() is None and lines_in(journal) <= rows:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL if os.name == "posix" else signal.SIGTERM)
    process.wait()
    return lines_in(journal) - 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--method", default="perron")
    options = parser.parse_args()
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    broken: list[str] = []

    def agree(what: str, rows: Rows, others: Rows) -> None:
        same = rows == others
        print(f"{what}: {'the same rows' if same else 'OTHER ROWS'}", flush=True)
        if not same:
            broken.append(what)

    with TemporaryDirectory() as folder:
        specs = [Path(folder, f"part{k}.toml") for k in range(PARTS)]
        for k, spec in enumerate(specs):
            spec.write_text(f"count = {options.count // PARTS}\nseed = {k}\nnodes = {{ from = 5, to = 8 }}\n")
        method = ("--method", options.method)
        whole: Rows = []
        ratios, times, used = [], {"1": 0.0, "2": 0.0}, {"1": 0.0, "2": 0.0}
        for k, spec in enumerate(specs):
            order = ("1", "2") if k % 2 == 0 else ("2", "1")
            found = {}
            for w in order:
                before = cpu()
                found[w] = run([spec], Path(folder, f"{k}-{w}.csv"), "--workers", w, *method)
                used[w] += cpu() - before
            agree(f"part {k}, two workers and one", found["2"][0], found["1"][0])
            whole += found["1"][0]
            ratios.append(found["1"][1] / found["2"][1])
            for w in order:
                times[w] += found[w][1]
            said = f"one worker {found['1'][1]:.1f} s, two {found['2'][1]:.1f} s, ratio {ratios[-1]:.2f}"
            print(f"part {k}: {said}, load {os.getloadavg()[0]:.1f}", flush=True)
        errors = sum(bool(row["error"]) for row in whole)
        certified = sum(row["verdict"] == "certified" for row in whole)
        print(f"{len(whole)} graphs, {certified} certified, {errors} with an error")
        print(f"one worker {times['1']:.1f} s, two {times['2']:.1f} s: {times['1'] / times['2']:.2f} times as fast")
        print(f"processor time {used['1']:.1f} s and {used['2']:.1f} s: {2 * used['1'] / used['2']:.2f} on idle cores")
        print(f"ratios of the parts: {min(ratios):.2f} .. {max(ratios):.2f}, median {statistics.median(ratios):.2f}")

        table = Path(folder, "killed.csv")
        kept = killed(specs, table, len(whole) // 2, "--workers", "2", *method)
        rows, seconds = run(specs, table, "--workers", "2", *method)
        print(f"killed with {kept} of {len(whole)} rows in the journal; the rest took {seconds:.1f} s")
        names = [row["graph"] for row in rows]
        print(f"rows {len(rows)}, lost {len(whole) - len(set(names))}, twice {len(names) - len(set(names))}")
        agree("killed and started again", rows, whole)

        from distributed import LocalCluster

        with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
            address = cluster.scheduler_address
            rows, seconds = run(specs, Path(folder, "dask.csv"), "--scheduler", address, *method)
        print(f"Dask, two processes: {seconds:.1f} s")
        agree("Dask", rows, whole)
    if broken:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
