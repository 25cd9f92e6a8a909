"""Count which proof obligations of certificates the verified checker checks: ``python formal/coverage.py FILE...``."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

PROGRAM = Path(__file__).parent / "ocaml" / "ptcc-verified"


def main(files: list[str]) -> int:
    """Print a table of kinds; files that the verified checker does not read are named, and counted as not checked."""
    all_kinds, verified = Counter[str](), Counter[str]()
    for file in files:
        document = json.loads(Path(file).read_text("utf-8"))
        kinds = [obligation["kind"] for obligation in document["proof"]]
        run = subprocess.run([PROGRAM, "--obligations", file], capture_output=True, text=True, check=False)
        if run.returncode not in (0, 4):
            print(f"{file}: {(run.stderr or run.stdout).strip()}")
        lines = [line.split() for line in run.stdout.splitlines() if run.returncode in (0, 4)]
        all_kinds.update(kinds)
        verified.update(line[1] for line in lines if line[0] == "verified")
    print(f"{'kind':22}{'all':>6}{'verified':>10}")
    for kind, count in all_kinds.most_common():
        print(f"{kind:22}{count:6}{verified[kind]:10}")
    total = all_kinds.total()
    print(f"{'all':22}{total:6}{verified.total():10}   {verified.total() / max(total, 1):.1%}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
