"""Every advice that names an option can be followed: the command with it is not refused."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from bad_inputs import ptcc
from selection import thinned

pytestmark = pytest.mark.usefixtures("quick_search")

FILES = {
    "chain.csv": "ann,bob,1\nbob,eve,-1\n",
    "foes.csv": "ann,bob,-1\nbob,ann,-1\n",
    "day.csv": "ann,bob,1\nbob,ann,1\nbob,eve,1\n",
    "night.csv": "bob,ann,2\nann,bob,1\nann,eve,1\n",
    "outage.csv": "ann\nbob\neve\n",
    "interval.csv": "source,target,low,high\nann,bob,1,2\nbob,ann,1,1\nbob,eve,1,3\n",
    "loop.csv": "ann,bob,1\nbob,bob,1\nbob,ann,1\n",
    "twice.csv": "ann,bob,1\nbob,ann,1\nbob,ann,2\n",
    "wide.csv": "ann,bob,1e-9\nbob,ann,1e9\nbob,eve,1\n",
    "two.csv": "ann,bob,1\neve,joe,1\n",
    "slow.csv": "ann,bob,0.01\nbob,ann,0.01\n",
}
#: What an option is given where the advice names no value.
VALUES = {
    **{"--agents": "2", "--gain-cap": "50", "--time-limit": "30", "--period": "0.01", "--delay": "0.01"},
    **{"--x0": "random", "--v0": "random", "--method": "best", "--stop-before": "0.1", "--leader-speed": "1"},
    **{"--dwell": "0.1", "--clock-dwell": "1", "--clock-window": "2", "--window-on": "0.5", "--max-input": "50"},
    **{"--initial-bound": "1", "--deadline": "1", "--signal": "any", "--dimension": "2", "--rho2": "3", "--delta": "1"},
    **{
        "--uncertainty": "10%",
        "--edges": "listens",
        "--duplicates": "sum",
        "--columns": "source,target,low",
        "--T-r": "1",
        "--T-s": "1",
        "--memory": "2",
    },
    **{
        "--residual": "0.1",
        "--what": "states",
        "--offsets": "random",
        "--biases": "0,0,0",
        "--quantisation": "0.1",
        "--sigma0": "0",
        "--sign-gain": "2",
    },
}
FLAGS = ("--switching", "--undirected", "--drop-self-loops", "--shortest-deadline", "--own-delay", "--restart")
_VALUE = r"-?\d[\w./%+-]*|best|lmi|sliding-mode|nominal|double-integrator|states|motion|virtual"
_OPTION = re.compile(r"--[A-Za-z][\w-]*")


def options_of(command: tuple[str, ...]) -> list[tuple[str, ...]]:
    """Return a command as its words before options, and each option with its value."""
    parts: list[tuple[str, ...]] = []
    for word in command:
        if word.startswith("--") or not parts or len(parts[-1]) == 2 or not parts[-1][0].startswith("--"):
            parts.append((word,))
        else:
            parts[-1] = (*parts[-1], word)
    return parts


def without(command: tuple[str, ...], *names: str) -> tuple[str, ...]:
    return tuple(word for part in options_of(command) if part[0] not in names for word in part)


def advices(command: tuple[str, ...], text: str) -> Iterator[tuple[tuple[str, ...], ...]]:
    """Yield for every advice the commands that follow it: one of them must not be refused."""
    head = re.search(
        r"^ptcc: (?:\w+ \()?(--[^:;]*?)(?::|\)| is | are | says | belongs | ask | replaces | has )", text, re.MULTILINE
    )
    subjects = set(_OPTION.findall(head[1])) if head else set()
    text = re.sub(r"\s+", " ", text.replace("\\\n", " "))
    for whole in re.findall(r"ptcc ((?:certify|check|plot|simulate|design) [^;:()]*)", text):
        if re.search(r"[\w/]+\.(csv|json)", whole) and not re.search(r"GRAPH|\.\.|fig\d", whole):
            yield (tuple(shlex.split(whole)),)
    text = re.sub(r"ptcc (?:certify|check|plot|simulate|design|batch) [^;:()]*", "", text)
    if subjects and re.search(r"leave (it|them) out", text):
        yield (without(command, *subjects),)
    if "leave one out" in text:
        yield tuple(without(command, name) for name in sorted(subjects))
        return
    if "give both" in text:
        missing = [name for name in dict.fromkeys(_OPTION.findall(text)) if name not in command]
        yield (sum(((name, VALUES[name]) for name in missing), command),)
        return
    together = re.search(r"design needs|--\S+ with --\S+|give --\S+ and --\S+", text)
    changed: tuple[str, ...] = command
    for match in _OPTION.finditer(text):
        name, before, after = match[0], text[: match.start()], text[match.end() :]
        clause = re.split(r"[;:]|, (?:or|and) ", before)[-1]
        spoken = name in subjects and not re.search(r"ask for|give|take|add|or$", clause)
        if spoken or name in ("--help", "--help-all"):
            continue
        if re.search(r"leave out|cut off after|without", clause):
            left = set(_OPTION.findall(clause)) | {name}
            left |= set(_OPTION.findall(re.split(r"[;:.]", after)[0])) if "leave out" in clause else set()
            yield (without(command, *left),)
            continue
        value = re.match(rf",? (?:such as )?({_VALUE})", after)
        if name == "--shortest-deadline" and together:
            continue  # beside --deadline, one of the two
        given = () if name in FLAGS else (value[1].rstrip(".") if value else VALUES[name],)
        changed = (*without(changed if together else command, name), name, *given)
        if not together:
            others = subjects - {name}
            yield changed, without(changed, *others)
    if together:
        yield changed, without(changed, *(subjects - set(_OPTION.findall(text.split(";")[-1]))))


COMMANDS = [
    "certify chain.csv --offsets 1,2,3",
    "certify chain.csv --biases 0,0,0",
    "certify foes.csv --biases 1,2",
    "certify chain.csv --offsets 1,2,3 --delay 0.01",
    "certify chain.csv --offsets 1,2,3 --quantisation 0.1",
    "certify chain.csv --offsets 1,2,3 --leader-speed 1",
    "certify chain.csv --offsets 1,2,3 --sign-gain 1",
    "certify chain.csv --agents double-integrator --delay 0.01",
    "certify chain.csv --agents double-integrator --quantisation 0.1 --v0 0,1,0",
    "certify chain.csv --agents double-integrator --leader-speed 1",
    "certify chain.csv --agents double-integrator --leader-speed 1 --sign-gain 2",
    "certify chain.csv --agents double-integrator --delay 0.01 --own-delay --gain-cap 3",
    "certify chain.csv --agents double-integrator --rest 1 --uncertainty 5%",
    "certify chain.csv --agents double-integrator --protocol sliding-mode --uncertainty 5%",
    "certify chain.csv --offsets 1,2,3 --at 0.5",
    "certify chain.csv --offsets 1,2,3 --noise 0.1",
    "certify chain.csv --offsets 1,2,3 --stop-before 0.1",
    "certify chain.csv --offsets 1,2,3 --sample-period 0.1",
    "certify chain.csv --offsets 1,2,3 --initial-bound 1",
    "certify chain.csv --offsets 1,2,3 --delta 1",
    "certify chain.csv --offsets 1,2,3 --v0 1,2,3",
    "certify chain.csv --offsets 1,2,3 --decay 8",
    "certify chain.csv --offsets 1,2,3 --rest 2",
    "certify chain.csv --offsets 1,2,3 --cascade 2",
    "certify chain.csv --offsets 1,2,3 --drag 2",
    "certify chain.csv --offsets 1,2,3 --plant 1",
    "certify chain.csv --agents integrator --offsets 1,2,3 --delay 0.01",
    "certify chain.csv --agents 2 --delay 0.01",
    "certify chain.csv --agents 2 --period 0.01 --packet-loss 1",
    "certify chain.csv --agents 2 --leader-speed 1",
    "certify chain.csv --agents 2 --leader-speed 1 --sign-gain 2",
    "certify chain.csv --agents 2 --stop-before 0.1",
    "certify chain.csv --agents 2 --sample-period 0.1",
    "certify chain.csv --agents 2 --initial-bound 1",
    "certify chain.csv --agents 2 --delta 1",
    "certify chain.csv --agents 2 --noise 1",
    "certify chain.csv --agents 2 --at 0.5",
    "certify chain.csv --agents 2 --a0 1,2,3",
    "certify chain.csv --agents 2 --decay 1",
    "certify chain.csv --agents 2 --rest 0.1",
    "certify chain.csv --agents 2 --rest 2",
    "certify chain.csv --agents 2 --cascade 0.1",
    "certify chain.csv --agents 2 --cascade 2",
    "certify chain.csv --agents 2 --cascade 2 --rho2 0.1",
    "certify chain.csv --agents 2 --max-residual 1",
    "certify chain.csv --agents 2 --gain-cap 5",
    "certify chain.csv --agents 2 --offsets 1,2,3",
    "certify chain.csv --agents 3",
    "certify chain.csv --agents 3 --delay 0.01",
    "certify chain.csv --agents nonsense",
    "certify chain.csv --decay 3",
    "certify chain.csv --v0 1,2,3",
    "certify chain.csv --a0 1,2,3",
    "certify chain.csv --cascade 1",
    "certify chain.csv --drag 1",
    "certify chain.csv --plant 1,1",
    "certify chain.csv --rest 1",
    "certify chain.csv --dimension 2",
    "certify chain.csv --dimension 2 --agents 2 --delay 0.01",
    "certify chain.csv --dimension 2 --agents double-integrator --exchange virtual --delay 0.01",
    "certify chain.csv --own-delay",
    "certify chain.csv --own-delay --delay 0.01",
    "certify chain.csv --packet-loss 1",
    "certify chain.csv --quantisation 0",
    "certify chain.csv --quantisation -1",
    "certify chain.csv --delay 0",
    "certify chain.csv --delay 0.01",
    "certify chain.csv --delay 0.2 --max-residual 0.001",
    "certify chain.csv --delay nonsense",
    "certify chain.csv --delay 0.01 --noise 0.1",
    "certify chain.csv --delay 0.01 --gain-cap 20",
    "certify chain.csv --delay 0.01 --stop-before 0.1",
    "certify chain.csv --delay 0.01 --initial-bound 1",
    "certify chain.csv --delay 0.01 --leader-speed 1",
    "certify chain.csv --delay 0.01 --leader-speed 1 --rho2 0.2",
    "certify chain.csv --delay 0.01 --own-delay --gain-cap 20 --leader-speed 1",
    "certify foes.csv --delay 0.01",
    "certify foes.csv --delay 0.01 --gain-cap 20",
    "certify foes.csv --delay 0.01 --gain-cap 20 --max-residual 0.001",
    "certify foes.csv --leader-speed 1",
    "certify chain.csv --leader-speed 1",
    "certify chain.csv --leader-speed 1 --rho2 0.2",
    "certify chain.csv --leader-speed 1 --sign-gain 0.1",
    "certify chain.csv --leader-speed 1 --delta 1",
    "certify chain.csv --leader-speed 1 --initial-bound 1",
    "certify chain.csv --sign-gain 1",
    "certify chain.csv --max-residual 1",
    "certify chain.csv --rho2 0.1",
    "certify chain.csv --rho2 0.1 --max-input 1",
    "certify chain.csv --rho2 0.1 --min-rate 100",
    "certify chain.csv --noise 0.1",
    "certify chain.csv --delta 0.1",
    "certify chain.csv --noise 0.1 --gain-cap 20",
    "certify chain.csv --sample-period 0.4",
    "certify chain.csv --sample-period 0.4 --delta 1",
    "certify chain.csv --initial-bound 1",
    "certify chain.csv --initial-bound 1 --x0 1,2,3",
    "certify chain.csv --max-input 0",
    "certify chain.csv --T-r 1",
    "certify chain.csv --mu1 2",
    "certify chain.csv --sigma0 1,2,3",
    "certify chain.csv --disturbance sin(t)",
    "certify chain.csv --protocol sliding-mode --T 1",
    "certify chain.csv --protocol sliding-mode --gain-cap 5",
    "certify chain.csv --protocol sliding-mode --noise 5",
    "certify chain.csv --protocol sliding-mode --delay 0.01",
    "certify chain.csv --protocol sliding-mode --delay 0.01 --sigma0 1,2,3",
    "certify chain.csv --protocol sliding-mode --leader-speed 0.01",
    "certify chain.csv --protocol sliding-mode --rho2 0.2",
    "certify chain.csv --protocol sliding-mode --sigma0 1,2,3 --mu3 0.1",
    "certify chain.csv --protocol sliding-mode --agents 2",
    "certify chain.csv --protocol sliding-mode --agents 2 --sigma0 1,2,3",
    "certify chain.csv --protocol sliding-mode --initial-bound 1",
    "certify chain.csv --switching",
    "certify chain.csv --signal constant",
    "certify chain.csv --dwell 1",
    "certify chain.csv --share 1",
    "certify chain.csv --clock-window 1",
    "certify chain.csv --method paper",
    "certify wide.csv",
    "certify wide.csv --method paper",
    "certify slow.csv",
    "certify two.csv",
    "certify two.csv --agents 2",
    "certify two.csv --delay 0.01",
    "certify loop.csv",
    "certify loop.csv --drop-self-loops",
    "certify day.csv night.csv",
    "certify day.csv night.csv --switching",
    "certify day.csv night.csv --switching --rho2 0.1",
    "certify day.csv night.csv --switching --agents 2",
    "certify day.csv night.csv --switching --offsets 1,2,3",
    "certify day.csv night.csv --switching --delay 0.01",
    "certify day.csv night.csv --switching --gain-cap 5",
    "certify day.csv night.csv --switching --noise 1",
    "certify day.csv night.csv --switching --at 0.5",
    "certify day.csv night.csv --switching --method best",
    "certify day.csv night.csv --switching --initial-bound 1",
    "certify day.csv night.csv --switching --leader-speed 1",
    "certify day.csv night.csv --switching --max-residual 1",
    "certify day.csv night.csv --switching --no-simulation",
    "certify day.csv night.csv --switching --disturbance sin(t)",
    "certify day.csv night.csv --switching --delta 1",
    "certify day.csv night.csv --switching --dimension 2",
    "certify day.csv night.csv --switching --window 1",
    "certify day.csv night.csv --switching --clock-window 1",
    "certify day.csv night.csv --switching --window-on 1",
    "certify day.csv night.csv --switching --dwell 1 --clock-dwell 1",
    "certify day.csv night.csv --switching --dwell 1 --signal constant",
    "certify day.csv night.csv --switching --dwell 1 --share 0.5 --share 0.5",
    "certify day.csv night.csv --switching --dwell 0.1",
    "certify day.csv night.csv --switching --share 0.5",
    "certify day.csv night.csv --switching --share 0.5 --share 0.5",
    "certify day.csv night.csv --switching --signal constant",
    "certify day.csv outage.csv --switching",
    "certify day.csv outage.csv --switching --share 0.5 --share 0.5",
    "certify day.csv outage.csv --switching --dwell 0.1",
    "certify day.csv outage.csv --switching --protocol sliding-mode --share 0.5 --share 0.5",
    "certify day.csv night.csv --switching --protocol sliding-mode --dwell 0.1",
    "certify day.csv night.csv --switching --protocol sliding-mode --rho2 0.1",
    "certify day.csv night.csv --switching --protocol sliding-mode --sigma0 1,2,3 --mu3 0.1",
    "certify chain.csv --uncertainty 10%",
    "certify chain.csv --uncertainty 10% --delay 0.01",
    "certify chain.csv --uncertainty 10% --agents 2",
    "certify chain.csv --uncertainty 10% --rho2 0.1",
    "certify chain.csv --uncertainty 10% --max-input 1",
    "certify chain.csv --uncertainty 10% --cascade 1",
    "certify chain.csv --uncertainty 10% --cascade 1 --delay 0.01",
    "certify chain.csv --uncertainty 10% --drag 1",
    "certify chain.csv --uncertainty 10% --rest 1",
    "certify chain.csv --uncertainty 10% --decay 8",
    "certify chain.csv --uncertainty 10% --plant 1,1",
    "certify chain.csv --uncertainty 10% --v0 1,2,3",
    "certify chain.csv --uncertainty 10% --a0 1,2,3",
    "certify chain.csv --uncertainty 10% --agents 2 --a0 1,2,3",
    "certify chain.csv --uncertainty 10% --agents integrator --v0 1,2,3",
    "certify chain.csv --uncertainty 10% --dimension 2",
    "certify chain.csv --optional ann,bob",
    "certify chain.csv --optional ann",
    "certify interval.csv",
    "certify interval.csv --rho2 0.1",
    "certify interval.csv --agents 2",
    "classify day.csv night.csv",
    "classify loop.csv",
    "classify twice.csv",
    "classify day.csv outage.csv --switching",
    "simulate chain.csv --delay 0.01 --gain-cap 5 --stop-before 0.1",
    "simulate chain.csv --agents 2 --delay 0.01",
    "simulate chain.csv --agents 2 --leader-speed 1",
    "simulate chain.csv --agents 2 --noise 1",
    "simulate chain.csv --agents 2 --disturbance sin(t)",
    "simulate chain.csv --agents 2 --stop-before 0.1",
    "simulate chain.csv --agents 2 --signal random",
    "simulate chain.csv --agents 2 --boundary-layer 0.1",
    "simulate chain.csv --offsets 1,2,3 --delay 0.01",
    "simulate chain.csv --offsets 1,2,3 --leader-speed 0.01",
    "simulate chain.csv --offsets 1,2,3 --noise 1",
    "simulate chain.csv --offsets 1,2,3 --boundary-layer 0.1",
    "simulate chain.csv --method best",
    "simulate chain.csv --signal random",
    "simulate chain.csv --dimension 2 -o x.png",
    "simulate chain.csv --protocol sliding-mode --dimension 2",
    "simulate day.csv night.csv --switching --agents 2",
    "simulate day.csv night.csv --switching --cascade 1",
    "simulate day.csv night.csv --switching --v0 1,2,3",
    "simulate day.csv night.csv --switching --dwell 1 --signal constant",
    "simulate day.csv night.csv --switching --delay 0.01",
    "simulate day.csv night.csv --switching --gain-cap 1",
    "plot chain.csv --what decay",
    "plot chain.csv --what states",
    "plot chain.csv --what decay --gain-cap 4 --x0 1,2,3",
    "plot chain.csv --what states --agents 2",
    "plot chain.csv --what motion",
    "plot chain.csv --what formation",
    "plot chain.csv --what formation --agents 2",
    "plot chain.csv --what late",
    "plot chain.csv --what tracking",
    "plot chain.csv --what states --offsets 1,2,3",
    "plot day.csv night.csv --switching --what states --agents 2",
    "plot day.csv night.csv --switching --what states --cascade 1 --x0 1,2,3",
    "plot day.csv night.csv --switching --what decay",
    "plot day.csv night.csv --switching --what decay --disturbance sin(t)",
    "plot day.csv night.csv --switching --what graph --wide",
    "design chain.csv",
    "design chain.csv --max-input 10",
    "design chain.csv --max-input 10 --initial-bound 1",
    "design chain.csv --max-input 10 --initial-bound 1 --deadline 1 --shortest-deadline",
    "design chain.csv --max-input 10 --initial-bound 1 --shortest-deadline",
    "design chain.csv --max-input 10 --initial-bound 1 --x0 1,2,3 --deadline 1",
    "design chain.csv --max-input 10 --offsets 1,2,3 --shortest-deadline",
    "design chain.csv --max-input 10 --agents 2",
    "design chain.csv --max-input 10 --agents 2 --initial-bound 1 --deadline 1",
    "design chain.csv --max-input 10 --agents 2 --shortest-deadline --curve c.png",
    "design chain.csv --max-input 10 --agents 2 --shortest-deadline --input-norm 2",
    "design chain.csv --max-input 10 --agents 2 --shortest-deadline --gain-cap 10",
    "design chain.csv --max-input 10 --agents 1 --shortest-deadline",
    "design chain.csv --max-input 10 --residual 0.1 --initial-bound 1",
    "batch chain.csv --restart",
]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        Path(name).write_text(text)


@pytest.mark.few(0)
@pytest.mark.parametrize("line", thinned(COMMANDS, 8))
def test_what_is_advised_is_not_refused(line: str) -> None:
    command = tuple(line.split())
    first = ptcc(*command)
    for tries in advices(command, f"{first.out}\n{first.err}"):
        answers = [ptcc(*one) for one in dict.fromkeys(tries)]
        assert any(answer.code != 2 for answer in answers), (tries, first.out + first.err, answers[0].err)
