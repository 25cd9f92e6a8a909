"""What notebooks show: tables with every label escaped, figures with a text in their place."""

from __future__ import annotations

import base64
import pickle
import re
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest
from selection import thinned

import ptcc_certify as ptcc
from ptcc_certify.certificate.certification import certify
from ptcc_certify.examples import load_graph
from ptcc_certify.gain_design.search import design
from ptcc_certify.graphs.digraph import SignedDigraph
from ptcc_certify.graphs.size_limits import SHOWN_NODES
from ptcc_certify.graphs.structure import analyse
from ptcc_certify.model import NominalProtocol, SlidingModeProtocol
from ptcc_certify.model.asks import Asks, InitialState
from ptcc_certify.simulation.run import simulate

pytestmark = pytest.mark.usefixtures("quick_search")

PROTOCOL = NominalProtocol(T=2, rho1=1, rho2=1, kappa=2)
SLIDING = SlidingModeProtocol(T_r=1, T_s=1, rho1=1, rho2=1, kappa=2, mu1=2, mu2=1, mu3=1, delta=1)


class Page(HTMLParser):
    """Tags, attributes, text and images of a page; fails where a tag is left open."""

    def __init__(self, source: str):
        super().__init__()
        self.tags: list[str] = []
        self.open: list[str] = []
        self.images: list[dict[str, str | None]] = []
        self.text = ""
        self.feed(source)
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        assert not [name for name, _ in attrs if name.startswith("on")]
        if tag == "img":
            self.images.append(dict(attrs))
        else:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data + "\n"


def shown(value: Any) -> Page:
    page = Page(value._repr_html_())
    assert set(page.tags) <= {"div", "table", "tr", "th", "td", "img"}
    for image in page.images:
        assert image["alt"] and len(image["alt"]) > 15
        head, _, content = (image["src"] or "").partition(",")
        assert head == "data:image/svg+xml;base64"
        drawing = base64.b64decode(content)
        assert b"<svg" in drawing and drawing.rstrip().endswith(b"</svg>")
        assert not re.findall(rb'href="(?!#)', drawing)
    return page


def test_each_is_shown_with_what_it_says_and_a_figure() -> None:
    graph, x0 = load_graph("fig3a"), [-4, 3, -1, 2, -2, 5]
    cert = certify(graph, PROTOCOL, x0)
    for value, said in (
        (graph, "6 nodes, 10 edges (4 negative)"),
        (analyse(graph), "interval bipartite consensus"),
        (cert, "interval bipartite consensus at T = 2"),
        (cert.trajectory, "6 agents"),
        (design(graph, max_input=10, initial_bound=1, deadline=5), "|u_k| <= 10 from all |x_k(0)| <= 1"),
        (simulate(graph, SLIDING, x0, sigma0=[1, 2, 3, 4, 5, 6]), "6 agents"),
        (certify(graph, SLIDING, InitialState(x0, sigma0=[1, 2, 3, 4, 5, 6])), "sliding"),
    ):
        page = shown(value)
        assert said in page.text, (type(value), page.text)
        assert len(page.images) == 1
    assert "certified" in shown(cert).text
    read = ptcc.read_certificate(cert.to_dict())
    assert shown(read).images[0]["alt"] == shown(cert).images[0]["alt"] and read.trajectory is None
    assert shown(ptcc.read_certificate(certify(graph, PROTOCOL).to_dict())).images  # of every initial state


def test_families_are_told_in_words_and_drawn() -> None:
    family = ptcc.as_family("fig3a", uncertainty="10%")
    for value in (family, certify(family, PROTOCOL)):
        page = shown(value)
        assert "drawing of the family" in page.images[0]["alt"] and "depends on the signal" in page.text


def test_a_component_of_a_family_is_shown_with_its_own_claim() -> None:
    family = ptcc.as_family([("a", "b", 1, 2), ("b", "a", -1, 0), ("c", "d", 1, 2)])
    first, second = ptcc.decide(family)
    assert "depends on the signal" in shown(first).text and "c, d" not in shown(first).text
    assert "consensus for every signal" in shown(second).text and shown(second).images
    assert repr(second) == "FamilyComponent(2 nodes, bipartite consensus for every signal)"


def test_what_cannot_be_drawn_is_told_in_words() -> None:
    many = SignedDigraph.from_edges([(k, k % (SHOWN_NODES + 1) + 1, 1) for k in range(1, SHOWN_NODES + 2)])
    pair = load_graph("fig1b")
    still = SignedDigraph.from_edges([], nodes=["alone"])
    columns = simulate(pair, PROTOCOL, np.eye(6)[:, :2])
    for value in (many, analyse(many), certify(many, PROTOCOL, asks=Asks(simulation=False)), columns):
        page = shown(value)
        assert not page.images and page.text.strip()
    assert "1 node, 0 edges" in shown(certify(still, PROTOCOL, [3])).text


@pytest.mark.few(0)
@pytest.mark.parametrize(
    "label", thinned(['"><img src=x onerror=alert(1)>', "<script>alert(1)</script>", "$x$", "&lt;b&gt;"], 2)
)
def test_labels_are_shown_as_they_are(label: str) -> None:
    graph = SignedDigraph.from_edges([(label, "b", 1), ("b", label, -1)])
    for value in (graph, analyse(graph), certify(graph, PROTOCOL, [1, 2])):
        page = shown(value)
        assert label in page.text or isinstance(value, ptcc.Certificate)  # whose card names few agents, and cuts them
        assert len(page.images) == 1


@pytest.mark.few(0)
def test_a_notebook_shows_a_figure_or_its_axes_without_pyplot():
    formatters = pytest.importorskip("IPython.core.formatters")
    pyplot = pytest.importorskip("matplotlib.pyplot")
    before = pyplot.get_fignums()
    axes = ptcc.plot_graph("fig1a")
    for drawn in (axes, axes.figure, pickle.loads(pickle.dumps(axes))):  # noqa: S301 - our own
        shown, how = formatters.DisplayFormatter().format(drawn)
        assert shown["image/png"].startswith(b"\x89PNG") and how["image/png"]["width"] == 336
    assert not hasattr(ptcc.plot_graph("fig1a", ax=pyplot.figure().add_subplot()), "_repr_png_")
    pyplot.close()
    assert pyplot.get_fignums() == before
