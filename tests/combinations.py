"""What goes together: every pair of what may be asked, tried on two small teams, and the page that tells.

``python tests/combinations.py`` writes docs/guide/what-goes-together.md anew, from what the program says.
"""

from __future__ import annotations

import random
import re
from itertools import combinations
from pathlib import Path
from typing import Any

import ptcc_certify as ptcc
from ptcc_certify.errors import HypothesisError, ParameterError

PAGE = Path(__file__).parents[1] / "docs" / "guide" / "what-goes-together.md"
DAY = [("a", "b", 1), ("b", "c", -1), ("b", "d", 2)]
NIGHT = [("a", "b", 2), ("a", "c", -1), ("c", "d", -1)]
#: The two teams: what leaders hear besides, by the words of the page.
TEAMS = {"a leads alone": [], "a and b hear each other": [("b", "a", 1)]}
BOTH = object()
START = {"a": 1, "b": 4, "c": -2, "d": 3}
NOMINAL = ptcc.NominalProtocol(T=1, rho1=1, rho2=6, kappa=1)
SLIDING = ptcc.SlidingModeProtocol(T_r="0.1", T_s=1, rho1=1, rho2=6, kappa=1, mu1=2, mu2=1, mu3=1, delta=1)
#: What may be asked, in the words of the page, and by which arguments of ``certify``.
PARTS: dict[str, dict[str, Any]] = {
    "uncertain weights": {"uncertainty": "10%"},
    "graphs that switch": {"graph": BOTH},
    "a dwell time": {"graph": BOTH, "signal": ptcc.DwellTime("0.2")},
    "shares of the clock": {"graph": BOTH, "signal": ptcc.ClockShares(("0.5", "0.5"))},
    "a formation": {"agents": {"order": 1, "offsets": {"a": 0, "b": 1, "c": 2, "d": 3}}},
    "vehicles that tell velocities": {"agents": {"order": 2}},
    "vehicles that exchange virtual positions": {"agents": {"order": 2, "exchange": "virtual"}},
    "late messages": {"messages": {"delay": "0.01"}},
    "rounded values": {"messages": {"value_error": "0.01"}},
    "leaders that move": {"leaders": {"speed": "0.1"}},
    "agents that move by themselves": {"leaders": {"growth": "0.2"}},
    "inputs that are clipped": {"leaders": {"saturation": 200}},
    "the sliding mode": {"protocol": SLIDING},
    "disturbances without it": {"asks": {"delta": "0.1"}},
    "measurement noise under a gain cap": {"asks": {"noise": "0.01"}, "limits": {"gain_cap": 50}},
    "a gain cap": {"limits": {"gain_cap": 50}},
    "a stop before T": {"limits": {"stop_before": "0.01"}},
    "sampling under a gain cap": {"limits": {"gain_cap": 50, "sample_period": "0.001"}},
    "a set of initial states": {"asks": {"initial_set": 1}},
}
KINDS = {
    "agents": ptcc.Agents,
    "messages": ptcc.LateMessages,
    "leaders": ptcc.MovingLeaders,
    "limits": ptcc.GainLimits,
    "asks": ptcc.Asks,
}
PAIRS = list(combinations(PARTS, 2))
Pair = tuple[str, str]


def outcome(*names: str, team: str = "a leads alone") -> str:
    """Certify a team with some parts: ``yes``, ``open`` if one of them is left open, or why they are refused."""
    day, night = (ptcc.SignedDigraph.from_edges([*edges, *TEAMS[team]]) for edges in (DAY, NIGHT))
    asked: dict[str, Any] = {"asks": {"simulation": False}}
    for key, value in (item for name in names for item in PARTS[name].items()):
        if key in KINDS:
            asked[key] = {**asked.get(key, {}), **value}
        else:
            asked[key] = value
    if asked.get("limits", {}).keys() == {"gain_cap"} and asked.get("agents", {}).get("order", 1) > 1:
        asked["agents"] = {**asked["agents"], **asked.pop("limits")}  # a cap of agents of order n is their own
    try:
        words = {key: KINDS[key](**value) if key in KINDS else value for key, value in asked.items()}
        graph = {"day": day, "night": night} if words.pop("graph", None) is BOTH else day
        made = ptcc.certify(graph, words.pop("protocol", NOMINAL), START, **words)
    except (ParameterError, HypothesisError) as error:
        return str(error)
    return {0: "yes", 4: "open"}[int(made.assessment.exit_code)]


def drawn_together() -> list[tuple[str, ...]]:
    """Return 40 triples and 20 quadruples, drawn at random of those of which every pair is certified."""
    known = told("a leads alone")
    drawn: list[tuple[str, ...]] = []
    for size, count in ((3, 40), (4, 20)):
        pool = [some for some in combinations(PARTS, size) if all(known[p] == "yes" for p in combinations(some, 2))]
        drawn += random.Random(size).sample(pool, count)
    return drawn


def letter(number: int) -> str:
    """Return a, b, ..., z, aa, ab, ..."""
    return (letter(number // 26 - 1) if number >= 26 else "") + chr(ord("a") + number % 26)


def page(outcomes: dict[str, dict[Pair, str]]) -> str:
    """Return the page that tells the outcome of every pair for every team, and each reason once."""
    said = (x for pairs in outcomes.values() for x in pairs.values() if x not in ("yes", "open"))
    names, reasons = list(PARTS), list(dict.fromkeys(said))
    signs = {"yes": "+", "open": "~", **{reason: letter(k) for k, reason in enumerate(reasons)}}
    lines = [INTRODUCTION]
    for team, pairs in outcomes.items():
        lines += [f"## Where {team}", ""]
        lines += ["| | | " + " | ".join(map(str, range(1, len(names)))) + " |", "|---" * (len(names) + 1) + "|"]
        for k, name in enumerate(names):
            cells = [signs[pairs[other, name]] for other in names[:k]]
            lines.append(f"| {k + 1} | {name} | " + " | ".join(cells + [""] * (len(names) - 1 - k)) + " |")
        lines.append("")
    lines += ["## What is refused, in the program's own words", "", "| | |", "|---|---|"]
    lines += [f"| {signs[reason]} | {reason.replace('|', '&#124;')} |" for reason in reasons]
    return "\n".join(lines) + "\n"


INTRODUCTION = """# What goes together

Every pair of what may be asked, tried on a team of four, then on the same team where the leader hears a follower, so
that nobody leads alone: `+` is certified; of `~` the program takes the question, and left a part of it open on this
team; a letter names why it is refused. Of three and four that go together in pairs on the first team, 60 drawn at
random were certified together. The reasons are in the words of Python; commands name their own options.

```sh
printf 'a,b,1\\nb,c,-1\\nb,d,2\\n' > team.csv
ptcc certify team.csv --rho2 6 --uncertainty 10% --leader-speed 0.1 --gain-cap 50
```
"""


def told(team: str) -> dict[Pair, str]:
    """Read from the page what it tells of every pair for a team."""
    text = PAGE.read_text("utf-8")
    table = text.partition(f"## Where {team}\n")[2].partition("\n## ")[0]
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in re.findall(r"^\| [0-9]+ \|.*$", table, re.M)
    ]
    reasons = {"+": "yes", "~": "open"} | dict(re.findall(r"^\| ([a-z]+) \| (.*) \|$", text, re.M))
    names = [row[1] for row in rows]
    return {
        (names[i], names[k]): reasons[row[2 + i]].replace("&#124;", "|") for k, row in enumerate(rows) for i in range(k)
    }


if __name__ == "__main__":
    PAGE.write_text(page({team: {pair: outcome(*pair, team=team) for pair in PAIRS} for team in TEAMS}), "utf-8")
