"""After a build: every link inside the site leads somewhere, and no page loads anything from elsewhere."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from sphinx.application import Sphinx
from sphinx.util import logging


class Page(HTMLParser):
    """The anchors of a page, where it links to, and what it loads."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        """Note what a tag says."""
        values = {name: value or "" for name, value in attributes}
        self.anchors |= {values[name] for name in ("id", "name") if name in values}
        if tag in ("a", "area") and "href" in values:
            self.links.append(values["href"])
        elif tag == "link" and values.get("rel") not in ("canonical", "author"):
            self.loads.append(values.get("href", ""))
        elif "src" in values:
            self.loads.append(values["src"])


def faults(site: Path) -> Iterator[tuple[Path, str]]:
    """Yield the faults of a built site, each with its page."""
    pages = {path.resolve(): Page(path) for path in sorted(site.rglob("*.html"))}
    for path, page in pages.items():
        for address in page.links + page.loads:
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                if address in page.loads and parts.scheme != "data":
                    yield path, f"loads {address}"
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.exists():
                yield path, f"no such file: {address}"
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors:
                yield path, f"no such anchor: {address}"
    for sheet in sorted(site.rglob("*.css")):
        for address in re.findall(
            r"""(?:url\(|@import\s)\s*["']?((?:https?:)?//[^"')\s]+)""", sheet.read_text("utf-8")
        ):
            yield sheet, f"loads {address}"


def warn_of_faults(app: Sphinx, failure: Exception | None) -> None:
    """Warn of every fault of the site that was built."""
    if failure is None and app.builder.name == "html":
        for path, fault in faults(Path(app.outdir)):
            logging.getLogger(__name__).warning("%s: %s", path.relative_to(app.outdir), fault)


def setup(app: Sphinx) -> dict[str, bool]:
    """Look at the site when it is built."""
    app.connect("build-finished", warn_of_faults, priority=900)  # after those that write files
    return {"parallel_read_safe": True, "parallel_write_safe": True}
