"""The explorer's page: whom its server answers, how it begins and ends, and how it behaves in a browser."""

from __future__ import annotations

import http.client
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from bad_inputs import ptcc

import ptcc_certify
from ptcc_certify.errors import ParameterError
from ptcc_certify.examples import GRAPHS
from ptcc_certify.report.explorer import Explorer, Settings
from ptcc_certify.report.explorer.server import ExplorerServer, Superseded, open_server

pytestmark = pytest.mark.usefixtures("quick_search")

FEW = Settings("fig1a", method="paper")


@pytest.fixture(scope="module")
def server() -> Iterator[ExplorerServer]:
    served = ExplorerServer(Explorer(), FEW, 0)
    threading.Thread(target=served.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
    yield served
    served.shutdown()
    served.server_close()


def get(server: ExplorerServer, path: str, **headers: str) -> tuple[int, str, http.client.HTTPMessage]:
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=60)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    return answer.status, answer.read().decode(), answer.headers


# ---------------------------------------------------------------------- the server


def test_the_page_names_every_control_and_loads_nothing_from_elsewhere(server: ExplorerServer):
    status, page, headers = get(server, server.root)
    assert status == 200
    for name in FEW.to_dict():
        assert f'name="{name}"' in page
        assert f'<label for="{name}">' in page
    assert "//" not in page.replace("<!--", "")
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    for part in ("page.js", "page.css"):
        status, text, _ = get(server, server.root + part)
        assert status == 200 and "http" not in text


def whole(parts: list[dict[str, Any]]) -> dict[str, Any]:
    """Return what the parts of an answer tell together."""
    return {**{key: value for part in parts for key, value in part.items()}, "panels": panels_of(parts)}


def panels_of(parts: list[dict[str, Any]]) -> dict[str, str]:
    return {name: svg for part in parts for name, svg in part.get("panels", {}).items()}


def test_a_view_is_text_figures_and_code(server: ExplorerServer):
    query = "graph=fig1a&kind=sliding-mode&method=paper&seed=3&reaching=false&T_r=0.6"
    for name, checked in (("preview", False), ("view", True)):
        status, text, _ = get(server, f"{server.root}{name}?{query}")
        parts = [json.loads(line) for line in text.splitlines()]
        view = whole(parts)
        assert "facts" in parts[0] and "verdict" in parts[-1]  # on all that is shown by then
        assert status == 200 and view["checked"] is checked
        assert view["verdict"].startswith("certified" if checked else "not checked")
        assert list(view["panels"]) == ["states", "decay", "graph", "input"]
        assert all("<svg" in panel for panel in view["panels"].values())
        assert "at T = 1.1, any |d_k| <= 1" in view["facts"]["claim"]
        assert "--T-r 0.6" in view["command"] and "T_r='0.6'" in view["python"]


@pytest.mark.parametrize(
    ("query", "says"),
    [
        ("T=0", "T = 0 is outside its domain"),
        ("T=__import__('os')", "is not a finite number"),
        ("rho3=1", 'setting "rho3" is unknown'),
        ("self=1", 'setting "self" is unknown'),
        ("seed=-1", 'seed "-1" is not a whole number'),
        ("graph=/etc/passwd", 'graph "/etc/passwd" is unknown; one of fig1a'),
        ("reaching=1", 'reaching "1" is unknown'),
        ("T=" + 400 * "9" + "&T=" + 5000 * "9", "a number of 5000 characters is too long"),
    ],
)
def test_settings_that_make_no_sense_are_refused_in_one_line(server: ExplorerServer, query: str, says: str):
    status, text, _ = get(server, f"{server.root}preview?{query}")
    refusal = json.loads(text)["refusal"]
    assert status == 200 and says in refusal and "\n" not in refusal


@pytest.mark.parametrize(
    ("path", "headers"),
    [
        ("/", {}),
        ("/wrong-token-of-22-letter/", {}),
        ("/wrong-token-of-22-letter/view?T=1", {}),
        ("{root}", {"Host": "evil.example:{port}"}),
        ("{root}", {"Host": "evil.example"}),
        ("{root}preview", {"Origin": "https://evil.example"}),
        ("{root}preview", {"Origin": "http://127.0.0.1:1"}),
        ("{root}preview", {"Origin": "null"}),
    ],
)
def test_who_does_not_come_from_the_printed_address_gets_no_answer(
    server: ExplorerServer, path: str, headers: dict[str, str]
):
    """No token, another site that was pointed at this machine (DNS rebinding), the page of another site."""
    own = {name: value.format(port=server.server_port) for name, value in headers.items()}
    status, text, answer = get(server, path.format(root=server.root), **own)
    assert status == 403
    assert "fig1a" not in text and server.root not in text
    assert "Access-Control-Allow-Origin" not in answer


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_a_browser_leaves_out_port_80_of_the_address(server: ExplorerServer, name: str):
    assert get(server, server.root, Host=name, Origin=f"http://{name}")[0] == 200


def test_only_this_machine_reaches_the_server_and_only_by_reading(server: ExplorerServer):
    assert server.server_address[0] == "127.0.0.1"
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=60)
    connection.request("POST", server.root, body="T=1")
    assert connection.getresponse().status == 501
    for name in ("../settings.py", "page.html", "%2e%2e/settings.py"):
        assert get(server, server.root + name)[0] == 404


def test_a_certificate_in_the_making_gives_way_to_a_control_that_is_moved():
    with ExplorerServer(Explorer(), FEW, 0) as server:
        explorer_view = server.explorer.view

        def moved_meanwhile(settings: Settings, progress: Callable[[str], None]) -> Any:
            server._moves += 1  # as a preview does that waits
            return explorer_view(settings, progress)

        server.explorer.view = moved_meanwhile  # type: ignore[method-assign, assignment]
        with pytest.raises(Superseded):
            list(server.view(FEW))
        server.explorer.view = explorer_view  # type: ignore[method-assign]
        assert whole(list(server.view(FEW)))["checked"]
        told = server._told

        def moved_while_it_is_drawn(view: Any) -> Any:
            for part in told(view):
                server._moves += "panels" in part
                yield part

        server._told = moved_while_it_is_drawn  # type: ignore[method-assign]
        with pytest.raises(Superseded):
            list(server.view(FEW))
        server._told = told  # type: ignore[method-assign]
        with ThreadPoolExecutor(1) as other:
            done = threading.Event()
            server._parts(lambda: iter([{}][: not done.wait()]))  # something else is at work
            waiting = other.submit(lambda: list(server.view(FEW)))
            while server._work.empty():
                time.sleep(0.01)
            server._moves += 1
            done.set()
            assert isinstance(waiting.exception(), Superseded)


@pytest.mark.few(0)
@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="open files are told elsewhere there")
def test_requests_open_fonts_once(server: ExplorerServer):
    """Every one of these has a thread of its own."""
    fonts = []
    for _ in range(3):
        assert get(server, server.root + "preview?graph=fig1a")[0] == 200
        fonts.append(sum(file.resolve().suffix == ".ttf" for file in Path("/proc/self/fd").iterdir()))
    assert fonts[2] == fonts[1] == fonts[0] > 0


def test_an_address_that_is_none_is_refused(server: ExplorerServer):
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=60) as connection:
        connection.sendall(b"GET http://[::1 HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert connection.recv(100).startswith(b"HTTP/1.1 400")


def test_a_port_that_is_taken_leaves_the_next_one():
    with ExplorerServer(Explorer(), FEW, 0) as first, open_server(Explorer(), FEW, first.server_port) as second:
        assert first.server_port < second.server_port <= first.server_port + 50
        assert first.root != second.root


def test_no_port_at_all_is_one_line(monkeypatch: pytest.MonkeyPatch):
    def taken(*args: object) -> None:
        raise OSError(98, "taken")

    monkeypatch.setattr(ExplorerServer, "server_bind", taken)
    monkeypatch.setattr("errno.EADDRINUSE", 98)
    with pytest.raises(ParameterError, match="port = 65530: this port and those after it are taken"):
        open_server(Explorer(), FEW, 65_530)


# ---------------------------------------------------------------------- the command


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--port", "0"], "'--port'"),
        (["--port", "70000"], "'--port'"),
        (["--port", "http"], "'--port'"),
        (["no_such_graph.csv"], "no_such_graph.csv"),
        (["-"], "save it and name the file"),
        (["asked.toml"], "is a scenario, not a graph; ptcc certify"),
        (["fig1b", "--undirected"], "is a packaged graph, shown as it is"),
    ],
)
def test_bad_arguments_are_one_line(arguments: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    Path("asked.toml").write_text('[graph]\nfile = "fig1b"\n')
    monkeypatch.setattr(ExplorerServer, "serve_forever", lambda served: None)
    done = ptcc("explore", "--no-browser", *arguments)
    assert done.code == 2 and done.out == ""
    assert says in done.err and len(done.err.splitlines()) == 1


@contextmanager
def started(*arguments: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run ``ptcc explore`` as a process of its own; yield it with the address that it prints."""
    words = [sys.executable, "-m", "ptcc_certify.cli", "explore", "--no-browser", *arguments]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    assert process.stdout is not None
    try:
        yield process, process.stdout.readline().strip()
    finally:
        process.kill()
        process.communicate()


@pytest.mark.few(0)
@pytest.mark.skipif(os.name == "nt", reason="signals are sent otherwise there")
def test_ctrl_c_ends_the_explorer_at_once_and_leaves_no_process():
    """``ptcc explore fig3a`` of the README; the port that is asked for is taken."""
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        port = busy.getsockname()[1]
        with started("fig3a", "--port", str(port)) as (process, address):
            assert address.startswith("http://127.0.0.1:") and f":{port}/" not in address
            process.send_signal(signal.SIGINT)
            _, told = process.communicate(timeout=20)
            assert process.returncode == 0
            assert f"port {port} is taken; this is port " in told
            assert "Traceback" not in told and told.endswith("the explorer has ended\n")
            with pytest.raises(ProcessLookupError):  # of the whole group
                os.killpg(process.pid, 0)


BUSY = """
import sys, casadi
from ptcc_certify.cli import main
from ptcc_certify.report.explorer import Explorer

def preview(explorer, settings):
    x = casadi.SX.sym("x")
    run = casadi.integrator("run", "cvodes", {"x": x, "ode": -x}, 0, [0.1, 1])
    print("busy", flush=True)
    while True:
        run(x0=1)

Explorer.preview = preview
sys.argv = ["ptcc", "explore", "--no-browser", "fig3a"]
main()
"""


@pytest.mark.few(0)
@pytest.mark.skipif(os.name == "nt", reason="signals are sent otherwise there")
@pytest.mark.parametrize("again", range(4))
def test_ctrl_c_ends_the_explorer_well_while_native_code_draws(again: int):
    """Without care two of three of these processes are aborted."""
    process = subprocess.Popen([sys.executable, "-c", BUSY], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None and any(line == "busy\n" for line in process.stdout)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 0 and told.endswith("the explorer has ended\n"), told


# ---------------------------------------------------------------------- in a browser


@pytest.fixture(scope="module")
def forty(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ring of 40 agents with chords."""
    path = tmp_path_factory.mktemp("graphs") / "forty.csv"
    ring = [(f"n{k}", f"n{(k + 1) % 40}", 1) for k in range(40)]
    chords = [(f"n{k}", f"n{(7 * k + 3) % 40}", -1 if k % 3 else 2) for k in range(40) if (7 * k + 3 - k) % 40 > 1]
    ptcc_certify.write_graph(ptcc_certify.SignedDigraph.from_edges(ring + chords), path)
    return path


class Page:
    """The page in a browser, with what it asked of the network."""

    def __init__(self, browser: Any, address: str, width: int, height: int):
        self.page = browser.new_page(viewport={"width": width, "height": height})
        self.requests: list[str] = []
        self.errors: list[str] = []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda said: self.errors.append(said.text) if said.type == "error" else None)
        self.page.goto(address)
        self.settle()

    def settle(self) -> None:
        self.page.wait_for_selector("#verdict:not(.open)", timeout=60_000)

    def move(self, name: str, value: str) -> None:
        """Move a slider as a hand does, without scrolling to it: its value, and the event of it."""
        self._input(f'[data-of="{name}"]', value)

    def write(self, name: str, value: str) -> None:
        """Write a number into its field, without scrolling to it."""
        self._input(f"#{name}", value)

    def _input(self, selector: str, value: str) -> None:
        event = "(s, v) => { s.value = v; s.dispatchEvent(new Event('input', {bubbles: true})); }"
        self.page.eval_on_selector(selector, event, value)

    def shown(self) -> tuple[str, str]:
        return (
            self.page.get_attribute("#panel-states img", "src"),
            self.page.inner_text('dd[data-head="claim"]') + self.page.inner_text('dd[data-head="error"]'),
        )

    def boxes(self) -> dict[str, Any]:
        """Place and size of everything on the page."""
        return self.page.evaluate(
            """() => Object.fromEntries([...document.querySelectorAll("main *")].map((e, k) => {
                 const b = e.getBoundingClientRect();
                 return [k + " " + e.tagName + " " + e.id, [b.x, b.y, b.width, b.height].join(" ")];
               }).filter(([name]) => !/ (OPTION|STRONG|SPAN) /.test(name)))"""
        )


@pytest.fixture(scope="module")
def address(server: ExplorerServer) -> str:
    return server.address


@pytest.mark.browser
@pytest.mark.parametrize("width", [1280, 390])
def test_nothing_on_the_page_moves_while_values_change(browser: Any, address: str, width: int):
    page = Page(browser, address, width, 844)
    for kind in ("nominal", "sliding-mode"):
        page.page.select_option("#kind", kind)
        page.settle()
        before = page.boxes()
        assert len(before) > 80
        for name, value in (("rho2", "2.5"), ("seed", "9"), ("delta", "3")):
            page.move(name, value)
            if kind == "nominal" or name != "delta":
                page.settle()
            assert page.boxes() == before, name
        page.write("delta" if kind == "sliding-mode" else "T", "")
        page.page.wait_for_selector(".refused")
        assert page.boxes() == before
        page.page.reload()
        page.settle()
    assert page.page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.errors == []


@pytest.mark.browser
def test_a_moved_slider_changes_image_and_text(browser: Any, forty: Path, capsys: pytest.CaptureFixture[str]):
    """On every packaged graph and on one of 40 nodes; how long it takes is for ``benchmarks/explorer.py``."""
    with started(str(forty)) as (_, address):
        page = Page(browser, address, 1280, 900)
        for kind in ("nominal", "sliding-mode"):
            page.page.select_option("#kind", kind)
            for graph in (forty.name, *GRAPHS):
                page.page.select_option("#graph", graph)
                page.settle()
                seconds = []
                for value in ("0.8", "1.2", "1.6"):
                    image, text = page.shown()
                    error = page.page.text_content('dd[data-head="error"]')
                    began = time.perf_counter()
                    page.move("rho2", value)
                    page.page.wait_for_function(
                        """([image, text]) => document.querySelector("#panel-states img").src !== image &&
                           document.querySelector('dd[data-head="error"]').textContent !== text""",
                        arg=[image, error],
                        polling=10,
                    )
                    seconds.append(time.perf_counter() - began)
                    page.settle()
                    assert page.shown() != (image, text)
                with capsys.disabled():
                    print(f"\n{graph:<10} {kind:<12} image and text after", *(f"{x:.2f}" for x in seconds))


@pytest.mark.browser
def test_of_two_sliders_moved_fast_the_last_state_wins_without_a_backlog(browser: Any, address: str):
    page = Page(browser, address, 1280, 900)
    page.requests.clear()
    for k in range(40):
        page.move("T", str(0.5 + k / 20))
        page.move("rho2", str(0.5 + k / 20))
    page.settle()
    assert "T = 2.45 " in page.page.inner_text('dd[data-head="claim"]')
    assert "rho2='2.45'" in page.page.inner_text("#python")
    asked = [url for url in page.requests if "/preview?" in url]
    assert 1 <= len(asked) < 40
    assert "T=2.45" in asked[-1] and "rho2=2.45" in asked[-1]


@pytest.mark.browser
def test_an_answer_that_another_page_cut_off_is_asked_for_again(browser: Any, address: str):
    page, asked = Page(browser, address, 1280, 900), []

    def cut(route: Any) -> None:
        """Answer as the server does where a control was moved on another page after the first part."""
        asked.append(route.request.url)
        answer = route.fetch()
        route.fulfill(
            response=answer, body=answer.text().splitlines(keepends=True)[0] if len(asked) == 1 else answer.text()
        )

    page.page.route("**/view?*", cut)
    page.move("rho2", "1.7")
    page.settle()
    assert len(asked) == 2
    assert page.page.inner_text("#verdict").startswith("Verdict")


@pytest.mark.browser
def test_what_is_computed_after_a_refusal_is_not_called_refused(
    browser: Any, server: ExplorerServer, monkeypatch: pytest.MonkeyPatch
):
    """The server begins to compute only when the page was looked at."""
    page, looked_at, preview = Page(browser, server.address, 1280, 900), threading.Event(), server.explorer.preview
    page.write("rho2", "-1")
    page.page.wait_for_selector("#verdict.bad")
    monkeypatch.setattr(server.explorer, "preview", lambda settings: looked_at.wait() and preview(settings))
    try:
        page.write("rho2", "1.3")
        assert page.page.inner_text("#verdict").split() == ["Verdict", "computing"]
        assert page.page.eval_on_selector_all("figure", "all => all.every(one => one.classList.contains('old'))")
    finally:
        looked_at.set()
    page.settle()
    assert not page.page.query_selector_all("figure.old")


@pytest.mark.browser
def test_nothing_is_asked_of_the_network_and_no_script_of_another_is_run(browser: Any, server: ExplorerServer):
    page = Page(browser, server.address, 1280, 900)
    page.page.select_option("#kind", "sliding-mode")
    page.settle()
    assert len(page.requests) > 4
    assert all(url.removeprefix("blob:").startswith(server.address) or url.startswith("blob:") for url in page.requests)
    assert all("127.0.0.1" in url for url in page.requests)
    assert page.errors == []
    page.page.evaluate(
        """() => new Promise(failed => {
             document.body.insertAdjacentHTML("beforeend", '<img src="x" onerror="window.hurt = 1">');
             document.body.lastElementChild.addEventListener("error", () => failed());
           })"""
    )
    assert page.page.evaluate("window.hurt") is None  # the policy of the page forbids it


@pytest.mark.browser
def test_the_page_works_by_keyboard_and_every_control_has_a_name(browser: Any, address: str):
    page = Page(browser, address, 1280, 900)
    before = page.shown()
    page.page.focus('[data-of="rho2"]')
    page.page.keyboard.press("ArrowRight")
    assert page.page.input_value("#rho2") == "1.05"
    page.settle()
    assert page.shown() != before
    for control in page.page.query_selector_all("#controls input, #controls select, button"):
        name = control.evaluate("e => e.ariaLabel || (e.labels && e.labels[0] ? e.labels[0] : e).textContent.trim()")
        assert name


@pytest.mark.browser
def test_the_address_keeps_the_settings(browser: Any, address: str):
    page = Page(browser, address, 1280, 900)
    page.page.fill("#T", "0.35")
    page.settle()
    page.page.reload()
    page.settle()
    assert page.page.input_value("#T") == "0.35" == page.page.input_value('[data-of="T"]')
    assert "T = 0.35 " in page.page.inner_text('dd[data-head="claim"]')


@pytest.mark.browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_words_stand_out_from_their_ground(browser: Any, address: str, scheme: str):
    """WCAG AA: 4.5 to 1."""
    page = Page(browser, address, 1280, 900)
    page.page.emulate_media(color_scheme=scheme)
    colours = page.page.evaluate(
        """() => ["#verdict", "#verdict span", ".slider span", ".note", "figcaption", "dt", "dd", "pre", "button",
                  "select", "label"].map(q => {
             let e = document.querySelector(q); const front = getComputedStyle(e).color;
             while (e && /rgba\\(0, 0, 0, 0\\)/.test(getComputedStyle(e).backgroundColor)) e = e.parentElement;
             return [q, front, e ? getComputedStyle(e).backgroundColor : "rgb(255, 255, 255)"];
           })"""
    )
    for name, front, back in colours:
        low, high = sorted(luminance(colour) for colour in (front, back))
        assert (high + 0.05) / (low + 0.05) >= 4.5, (name, front, back)


def luminance(colour: str) -> float:
    parts = [int(x) / 255 for x in colour[colour.index("(") + 1 : -1].split(",")[:3]]
    linear = [x / 12.92 if x <= 0.03928 else ((x + 0.055) / 1.055) ** 2.4 for x in parts]
    return sum(weight * x for weight, x in zip((0.2126, 0.7152, 0.0722), linear, strict=True))
