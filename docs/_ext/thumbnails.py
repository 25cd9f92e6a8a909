"""The figures of other pages as small pictures that lead to their sections: nothing is drawn twice, nothing is kept."""

from __future__ import annotations

from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective


class Room(nodes.Element):
    """Where the small pictures of a page will stand."""


class Thumbnails(SphinxDirective):
    """A picture of every section of a page: its first figure, or the one of a number."""

    required_arguments = 1
    option_spec: ClassVar[Any] = {"figure": directives.positive_int}

    def run(self) -> list[nodes.Node]:
        """Leave room for them: figures are known when every page has been read."""
        page = self.env.relfn2path(self.arguments[0])[0].removesuffix(".md")
        self.env.note_dependency(self.env.doc2path(page))
        room = Room(page=page, figure=self.options.get("figure", 1))
        self.set_source_info(room)
        return [room]


def pictures(document: nodes.document, number: int) -> list[tuple[str, str, nodes.image]]:
    """Return anchor, title and one figure of every section of a page that has so many."""
    found = []
    for section in document.findall(nodes.section):
        if isinstance(section.parent, nodes.section):
            images = list(section.findall(nodes.image))
            if len(images) >= number:
                title = section.next_node(nodes.title)
                found.append((section["ids"][0], title.astext() if title else "", images[number - 1].deepcopy()))
    return found


def show(app: Sphinx, document: nodes.document, page: str) -> None:
    """Put the pictures where they belong."""
    for room in list(document.findall(Room)):
        grid = nodes.container(classes=["thumbnails"])
        address = app.builder.get_relative_uri(page, room["page"])
        for anchor, title, image in pictures(app.env.get_doctree(room["page"]), room["figure"]):
            image["alt"] = ""  # the title says it
            for size in ("width", "height", "scale"):
                image.attributes.pop(size, None)
            link = nodes.reference("", "", refuri=f"{address}#{anchor}", internal=True)
            link += [image, nodes.inline(text=title)]
            grid += nodes.paragraph("", "", link)
        if not grid.children and getattr(app.config, "nb_execution_mode", "") != "off":
            logging.getLogger(__name__).warning("no figures in the sections of %s", room["page"], location=room)
        room.replace_self(grid)


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the directive ``thumbnails``."""
    app.add_node(Room)
    app.add_directive("thumbnails", Thumbnails)
    app.connect("doctree-resolved", show)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
