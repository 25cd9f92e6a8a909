"""The explorer as a page: a server for the browser of this machine alone.

It answers nobody who does not know the random token in its address, and nobody who reached it under another name than
this machine's or from the page of another site. It only computes; there is nothing that it would write.
"""

from __future__ import annotations

import errno
import gc
import json
import os
import secrets
import sys
import threading
from collections.abc import Callable, Iterator
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from itertools import chain
from pathlib import PurePosixPath
from queue import SimpleQueue
from socketserver import TCPServer
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import jinja2

from ptcc_certify.errors import ParameterError, explain
from ptcc_certify.lyapunov.search import METHODS
from ptcc_certify.report.explorer.facts import HEADS
from ptcc_certify.report.explorer.model import PANELS, Explorer, View
from ptcc_certify.report.explorer.settings import DISTURBANCES, KINDS, LARGEST_SEED, SLIDERS, Settings, refuse_unknown

#: This machine, by the names under which its own browser may ask for the page.
HOSTS = ("127.0.0.1", "localhost")
#: How many ports after the one that is asked for are tried.
TRIED = 50
_TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".json": "application/x-ndjson"}
#: The page may load from this server alone, figures besides from itself, and stands in no frame.
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS = {
    "Content-Security-Policy": _POLICY,
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}


#: What is shown of a view, part by part.
Parts = Iterator[dict[str, Any]]
_Queue = SimpleQueue[dict[str, Any] | Exception | None]


class Superseded(Exception):
    """A control was moved while settings were being certified: theirs is no longer wanted."""


class ExplorerServer(ThreadingHTTPServer):
    """Serves an explorer on this machine.

    Parameters
    ----------
    explorer : Explorer
    settings : Settings
        What the page begins with.
    port : int
        Where to listen; 0 leaves it to the system.

    Attributes
    ----------
    address : str
        Of the page, with the token.

    Raises
    ------
    PTCCError
        The settings name an unknown graph.
    OSError
        The port is taken, or not free to be used.
    """

    daemon_threads = True
    allow_reuse_address = os.name != "nt"  # there it would share a port that is taken

    def __init__(self, explorer: Explorer, settings: Settings, port: int):
        refuse_unknown("graph", settings.graph, explorer.graphs)
        self.explorer, self.settings = explorer, settings
        self._moves = 0
        self._token = secrets.token_urlsafe(16)
        self._work: SimpleQueue[tuple[_Queue, Callable[[], Parts]] | None] = SimpleQueue()
        super().__init__((HOSTS[0], port), _Handler)
        threading.Thread(target=self._draw, daemon=True).start()

    def server_bind(self) -> None:
        """Bind without asking the network for a name of this machine."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = self.server_address[:2]  # type: ignore[assignment]

    def server_close(self) -> None:
        """Close, and end the thread that draws."""
        super().server_close()
        self._work.put(None)

    @property
    def root(self) -> str:
        """The path of the page."""
        return f"/{self._token}/"

    @property
    def address(self) -> str:
        """The address of the page."""
        return f"http://{HOSTS[0]}:{self.server_port}{self.root}"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Tell in one line what went wrong, unless the browser only went away."""
        error = sys.exc_info()[1]
        if isinstance(error, Exception) and not isinstance(error, ConnectionError | TimeoutError):
            print(f"ptcc: {explain(error)}", file=sys.stderr)

    def warm_up(self) -> None:
        """Compute what the page begins with, before the browser asks.

        What libraries have loaded by then stays for good: while a control is moved, nobody looks for garbage in it.
        """

        def begun() -> Parts:
            yield from self._told(self.explorer.preview(self.settings))
            gc.freeze()

        self._parts(begun)  # where it fails, the page will ask again and tell

    def page(self) -> str:
        """Return the page."""
        template = resources.files(__package__).joinpath("page.html").read_text(encoding="utf-8")
        return (
            jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
            .from_string(template)
            .render(
                choices={
                    "graph": ("graph", tuple(self.explorer.graphs), ""),
                    "kind": ("protocol", KINDS, ""),
                    "method": ("Lyapunov functions", METHODS[::-1], ""),
                    "disturbance": ("disturbance of the run", DISTURBANCES, "sliding-mode"),
                },
                sliders=SLIDERS,
                largest_seed=LARGEST_SEED,
                begin=self.settings.to_dict(),
                panels=PANELS,
                heads=HEADS,
            )
        )

    def preview(self, settings: Settings) -> Parts:
        """Return what is shown at once, as it is made; a certificate that is being made gives way."""
        self._moves += 1
        return self._parts(lambda: self._told(self.explorer.preview(settings)))

    def view(self, settings: Settings) -> Parts:
        """Return what ``certify`` certifies.

        Raises
        ------
        Superseded
            A control was moved meanwhile.
        """
        moves = self._moves

        def give_way(step: str) -> None:
            if self._moves != moves:
                raise Superseded

        def certified() -> Parts:
            give_way("waiting")
            for part in self._told(self.explorer.view(settings, give_way)):
                yield part
                give_way("drawing")

        return self._parts(certified)

    def _parts(self, work: Callable[[], Parts]) -> Parts:
        """Have some work done when its turn comes, and return its parts as they come."""
        queue: _Queue = SimpleQueue()
        self._work.put((queue, work))
        return _read(queue)

    def _draw(self) -> None:
        """Do the work, in one thread: Matplotlib keeps files of fonts open for every thread that draws.

        The thread is a daemon, unlike those of an executor: Ctrl-C does not wait for a certificate.
        """
        for queue, work in iter(self._work.get, None):
            try:
                for part in work():
                    queue.put(part)
                queue.put(None)
            except Exception as error:
                queue.put(error)

    def _told(self, view: View) -> Parts:
        """Yield what is claimed, then one panel after another, and the verdict on all that is shown by then."""
        if view.refusal:
            yield {"refusal": view.refusal}
            return
        yield {"facts": view.facts, "python": view.python, "command": view.command, "names": view.panels}
        for name in view.panels:
            yield {"panels": {name: self.explorer.svg(view, name)}}
        yield {"verdict": view.verdict, "grade": view.grade, "checked": view.checked}


def _read(queue: _Queue) -> Parts:
    """Yield the parts of some work, and raise what it raised."""
    while (part := queue.get()) is not None:
        if isinstance(part, Exception):
            raise part
        yield part


class _Handler(BaseHTTPRequestHandler):
    """Answers the requests of one connection."""

    server: ExplorerServer
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "ptcc", ""
    timeout = 60  # seconds that an idle connection is kept
    disable_nagle_algorithm = True  # no part waits for the next

    def do_GET(self) -> None:
        """Answer with the page, a part of it, or what it asks to be computed."""
        try:
            parts = urlsplit(self.path)
        except ValueError:
            return self._send(HTTPStatus.BAD_REQUEST, "this is no address", ".txt")
        if (why := self._foreign(parts.path)) is not None:
            return self._send(HTTPStatus.FORBIDDEN, why, ".txt")
        name = parts.path.removeprefix(self.server.root)
        if name == "":
            return self._send(HTTPStatus.OK, self.server.page(), ".html")
        if name in ("page.js", "page.css"):
            text = resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
            return self._send(HTTPStatus.OK, text, PurePosixPath(name).suffix)
        answers = {"preview": self.server.preview, "view": self.server.view}
        if name not in answers:
            return self._send(HTTPStatus.NOT_FOUND, "there is no such page", ".txt")
        return self._compute(answers[name], parts.query)

    def _compute(self, answer: Callable[[Settings], Parts], query: str) -> None:
        """Answer with one line of JSON for every part, as soon as it is there."""
        try:
            parts = answer(Settings.from_texts(dict(parse_qsl(query, keep_blank_values=True))))
            first = next(parts)
        except Superseded:
            self._send(HTTPStatus.CONFLICT, "a control was moved meanwhile", ".txt")
            return
        except Exception as error:  # of whatever kind: the page tells it in one line
            parts, first = iter(()), {"refusal": explain(error)}
        self._begin(HTTPStatus.OK, ".json", {"Transfer-Encoding": "chunked"})
        for part in chain([first], _explained(parts)):
            line = json.dumps(part).encode() + b"\n"
            self.wfile.write(b"%x\r\n%s\r\n" % (len(line), line))
        self.wfile.write(b"0\r\n\r\n")

    def _foreign(self, path: str) -> str | None:
        """Tell why a request is not answered: it does not come from a browser to which the address was given."""
        host = self.headers.get("Host", "")
        if host.split(":")[0] not in HOSTS:
            return "this server answers under the names 127.0.0.1 and localhost only"
        if self.headers.get("Origin") not in (None, f"http://{host}"):
            return "this server does not answer pages of other sites"
        given = path.encode("latin-1", "replace")
        if not secrets.compare_digest(given[: len(self.server.root)], self.server.root.encode()):
            return "open the address that ptcc explore printed, with the token in it"
        return None

    def _send(self, status: HTTPStatus, text: str, suffix: str) -> None:
        body = text.encode()
        self._begin(status, suffix, {"Content-Length": str(len(body))})
        self.wfile.write(body)

    def _begin(self, status: HTTPStatus, suffix: str, length: dict[str, str]) -> None:
        self.send_response(status)
        self.send_header("Content-Type", f"{_TYPES.get(suffix, 'text/plain')}; charset=utf-8")
        for name, value in (length | _HEADERS).items():
            self.send_header(name, value)
        self.end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Keep still about requests."""


def _explained(parts: Parts) -> Parts:
    """Yield parts as long as they are wanted, and where one fails why in one line."""
    try:
        yield from parts
    except Superseded:
        return
    except Exception as error:
        yield {"refusal": explain(error)}


def open_server(explorer: Explorer, settings: Settings, port: int) -> ExplorerServer:
    """Return a server that listens at a port, or where that is taken at the next one that is not.

    Raises
    ------
    ParameterError
        No port is free, or this one is not free to be used.
    """
    for candidate in range(port, min(port + TRIED, 65_535) + 1):
        try:
            return ExplorerServer(explorer, settings, candidate)
        except OSError as error:
            if error.errno == errno.EACCES and os.name != "nt":
                refusal = f"= {candidate}: the system does not give it to you; take one above 1023"
                raise ParameterError("port", refusal) from None
            if error.errno not in (errno.EADDRINUSE, errno.EACCES):
                raise
    raise ParameterError("port", f"= {port}: this port and those after it are taken; give another")
