"""The twelve runs of the paper's Section 4 on the packaged graphs: seconds, rates, overshoot constants, worst ratio.

    OPENBLAS_NUM_THREADS=1 python benchmarks/examples.py [--json FILE] [--before FILE]

``--before`` compares with the JSON of an earlier run, such as one of another version on the same machine. The median of
five calls of ``certify``, with simulation and check.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from fractions import Fraction
from pathlib import Path

from ptcc_certify.certificate.certification import certify
from ptcc_certify.examples import Example, load_graph, select
from ptcc_certify.model.asks import Asks, InitialState


def one(example: Example, name: str) -> dict[str, float | str]:
    protocol, graph = example.protocol(), load_graph(name)
    start = [Fraction(x) for x in example.x0.split(",")]
    sigma0 = None if example.sigma0 is None else [Fraction(x) for x in example.sigma0.split(",")]
    initial, asks = InitialState(start, sigma0=sigma0), Asks(disturbance=example.disturbance)
    seconds = []
    for _ in range(5):
        begin = time.process_time()
        cert = certify(graph, protocol, initial, asks=asks)
        verdict = cert.verdict
        seconds.append(time.process_time() - begin)
    assert cert.rate is not None and cert.overshoot is not None and cert.paper_rate is not None
    return {
        "seconds": statistics.median(seconds),
        "rate": float(cert.rate),
        "paper": float(cert.paper_rate),
        "overshoot": float(cert.overshoot),
        "ratio": cert.comparison.worst_ratio if cert.comparison else float("nan"),
        "verdict": verdict,
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--before", type=Path)
    options = parser.parse_args()
    before = json.loads(options.before.read_text()) if options.before else {}
    head = ("run", "seconds", "before", "rate", "before", "paper", "before", "overshoot", "worst ratio")
    print("{:<9}{:>8}{:>8}{:>12}{:>12}{:>12}{:>12}{:>12}{:>13}  verdict".format(*head))
    found = {}
    for example, name, _ in select("all"):
        run = f"{example.number} {name}"
        row = found[run] = one(example, name)
        earlier = before.get(run, {})
        pairs = [f"{earlier[key]:.6g}" if earlier else "-" for key in ("rate", "paper")]
        past = f"{earlier['seconds']:.3f}" if earlier else "-"
        print(
            f"{run:<9}{row['seconds']:>8.3f}{past:>8}{row['rate']:>12.6g}{pairs[0]:>12}{row['paper']:>12.6g}"
            f"{pairs[1]:>12}{row['overshoot']:>12.5g}{row['ratio']:>13.6f}  {row['verdict']}",
            flush=True,
        )
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
