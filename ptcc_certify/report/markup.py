"""Pieces of a page of HTML: the page itself, tables, lists, and the box of the verdict."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import resources

#: Rows from which on a table is folded.
FOLDED = 25


def table(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]], stack: bool = False) -> str:
    """Return a table of HTML cells, the first of each row its header; ``stack`` piles cells up on narrow screens."""
    cells = []
    for first, *others in rows:
        data = "".join(
            f'<td role="cell" data-label="{name}">{cell}</td>' for name, cell in zip(head[1:], others, strict=True)
        )
        cells.append(f'<tr role="row"><th scope="row" role="rowheader">{first}</th>{data}</tr>')
    columns = "".join(f'<th scope="col" role="columnheader">{name}</th>' for name in head)
    kind = "scroll stack" if stack else "scroll"
    return (
        f'<div class="{kind}"><table role="table"><caption>{caption}</caption>'
        f'<thead role="rowgroup"><tr role="row">{columns}</tr></thead>'
        f'<tbody role="rowgroup">{"".join(cells)}</tbody></table></div>'
    )


def folded(summary: str, content: str, rows: int) -> str:
    """Return a table that is folded if it is long; on paper it is open."""
    return content if rows <= FOLDED else f"<details><summary>{summary}</summary>{content}</details>"


def bullets(items: Iterable[str]) -> str:
    """Return a list."""
    return f"<ul>{''.join(f'<li>{item}</li>' for item in items)}</ul>"


def verdict_box(kind: str, mark: str, word: str, said: str) -> str:
    """Return the box of a verdict; ``kind``, its colour, is ``good``, ``doubt`` or ``bad``."""
    return (
        f'<div class="verdict {kind}"><strong><span aria-hidden="true">{mark}</span> {word}</strong><p>{said}</p></div>'
    )


def document(title: str, body: str) -> str:
    """Return a whole page; it loads nothing and runs no script."""
    style = (resources.files("ptcc_certify.report") / "page.css").read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n<meta name="referrer" content="no-referrer">\n'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n"
        f"<title>{title}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
    )
