"""Random command lines of every kind, run and checked: ``python benchmarks/random_commands.py [FIRST LAST [KIND ..]]``.

What fails is printed with kind and seed, which replay it, and counted in the exit code. The table tells of each kind
how many runs there were, their exit codes, how many files were written, which the check accepted, and the seconds.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this package, whichever is installed

from random_commands import KINDS, run_case


def main(first: int, last: int, kinds: list[str]) -> int:
    """Run the seeds from the first up to the last of each kind; return the number of failures."""
    failures, refusals = 0, Counter[str]()
    with tempfile.TemporaryDirectory() as name:
        os.chdir(name)
        for kind in kinds:
            begin, codes, written, slowest = time.perf_counter(), Counter[int](), 0, (0.0, 0)
            for seed in range(first, last):
                try:
                    outcome = run_case(kind, seed, Path(name))
                except Exception:
                    failures += 1
                    print(f"FAILED {kind} {seed}\n{traceback.format_exc(limit=-1)}", flush=True)
                    continue
                codes[outcome.code] += 1
                written += outcome.written
                slowest = max(slowest, (outcome.seconds, seed))
                if outcome.code == 2:
                    refusals[f"{kind} {seed}: {outcome.text.strip()[:160]}"] += 1
            told = ", ".join(f"{code}: {count}" for code, count in sorted(codes.items()))
            seconds = time.perf_counter() - begin
            print(
                f"{kind:14s} {last - first} runs, exit codes {told}; {written} files accepted; {seconds:.0f} s, ",
                end="",
            )
            print(f"slowest {slowest[0]:.1f} s, seed {slowest[1]}", flush=True)
    print(*(f"refused {text}" for text in refusals), sep="\n")
    return failures


if __name__ == "__main__":
    bounds = [int(x) for x in sys.argv[1:3]] or [0, 20]
    sys.exit(min(main(*bounds, sys.argv[3:] or [*KINDS, "set"]), 99))
