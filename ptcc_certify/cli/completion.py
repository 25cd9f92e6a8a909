"""``ptcc completion``: names that a shell completes with TAB. Nothing that computes is imported for it."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import click
from click import shell_completion as shells
from click.shell_completion import CompletionItem

CERTIFICATES = (".json",)
#: Endings of graphs, and of scenarios, which stand for one.
GRAPHS = (
    *(".csv", ".tsv", ".txt", ".edges", ".edgelist", ".graphml", ".gml", ".net", ".pajek", ".mtx", ".npz", ".npy"),
    *(".mat", ".gz", ".toml"),
)
#: Names of packaged graphs, and of those of the paper's examples; their module would load NumPy.
PACKAGED = tuple(sorted(path.stem for path in (Path(__file__).parents[1] / "examples").glob("*.csv")))
PAPER = tuple(name for name in PACKAGED if name.startswith("fig"))
THEOREMS = tuple(f"{chapter}.{row}" for chapter in range(1, 7) for row in (1, 2))
#: Most names that a shell is told.
MOST = 1000


class _Bash(shells.BashComplete):
    """Bash, told that what it completes are names of files: it quotes blanks, and adds no blank after a folder."""

    source_template = shells.BashComplete.source_template.replace(
        "COMPREPLY+=($value)", 'COMPREPLY+=("${value%%/}"); [[ $value == *[./]* ]] && compopt -o filenames'
    )


class _WholeWord(shells.ShellComplete):
    """A shell that puts what completes in place of the whole word: of ``--option=value`` too."""

    def get_completions(self, args: list[str], incomplete: str) -> list[CompletionItem]:
        items = super().get_completions(args, incomplete)
        option, sign, _ = incomplete.partition("=")
        for item in items if sign and option.startswith("--") else ():
            item.value = f"{option}={item.value}"
        return items


class _Zsh(_WholeWord, shells.ZshComplete):
    """Zsh, told to add no blank after a folder."""

    source_template = shells.ZshComplete.source_template.replace(
        "compadd -U -V unsorted -a completions",
        "compadd -U -V unsorted -- ${completions:#*/}; compadd -U -S '' -V unsorted -- ${(M)completions:#*/}",
    )


class _Fish(_WholeWord, shells.FishComplete):
    """Fish, told that a name may hold commas."""

    source_template = shells.FishComplete.source_template.replace('string split "," ', 'string split --max 1 "," ')


for _shell, _name in ((_Bash, "bash"), (_Zsh, "zsh"), (_Fish, "fish")):
    shells.add_completion_class(_shell, _name)


@click.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> int:
    r"""Print the script by which TAB completes commands, options, values and files.

    \b
    bash: add to ~/.bashrc    eval "$(ptcc completion bash)"
    zsh:  add to ~/.zshrc     eval "$(ptcc completion zsh)"
    fish: run once, in ~/.config/fish/completions
                              ptcc completion fish > ptcc.fish

    Then open a new shell.
    """
    kind = shells.get_completion_class(shell)
    assert kind is not None
    click.echo(kind(click.get_current_context().find_root().command, {}, "ptcc", "_PTCC_COMPLETE").source())
    return 0


def complete(
    endings: Sequence[str], names: Sequence[str] = ()
) -> Callable[[click.Context, click.Parameter, str], list[CompletionItem]]:
    """Return what completes an argument: with names, with folders, and with files of some endings."""

    def items(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
        found = [name for name in names if name.startswith(incomplete)]
        found += _files(incomplete, tuple(endings)) if endings else []
        return [CompletionItem(text) for text in found[:MOST]]

    return items


def complete_behaviours(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Complete the behaviours of ``--expect``."""
    from ptcc_certify.graphs.structure import BEHAVIOURS

    names = [name.replace(" ", "-") for name in BEHAVIOURS]
    return [CompletionItem(name) for name in names if name.startswith(incomplete)]


def _files(incomplete: str, endings: tuple[str, ...]) -> list[str]:
    """Return the folders, and the files of some endings, whose paths begin as a text does."""
    folder, start = os.path.split(incomplete)
    before = incomplete[: len(incomplete) - len(start)]
    found = []
    try:
        with os.scandir(Path(folder).expanduser()) as entries:
            for entry in entries:
                if not entry.name.startswith(start) or (entry.name[0] == "." and not start):
                    continue
                if entry.is_dir():
                    found.append(f"{before}{entry.name}{os.sep}")
                elif entry.name.lower().endswith(endings):
                    found.append(f"{before}{entry.name}")
    except (OSError, RuntimeError, ValueError):  # no such folder
        return []
    return sorted(found)
