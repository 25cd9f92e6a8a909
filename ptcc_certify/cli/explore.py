"""``ptcc explore``: the explorer as a page in the browser."""

from __future__ import annotations

import os
import sys
import threading
import webbrowser
from pathlib import Path
from typing import Any

import click

from ptcc_certify.cli import options as shared
from ptcc_certify.cli.scenario import is_scenario
from ptcc_certify.errors import ExitCode, ParameterError
from ptcc_certify.graphs.recognised_files import refuse_as_graph


@click.command(cls=shared.OneGraph)
@click.argument("graph", default="fig3a")
@shared.plain_reading_options
@click.option("--port", type=click.IntRange(1, 65535), default=8730, help="Where to listen; the next one, if taken.")
@click.option("--no-browser", is_flag=True, help="Print the address only.")
def explore(graph: str, port: int, no_browser: bool, **options: Any) -> int:
    """Open a page in the browser on which graph, run, input and proved bound follow the parameters.

    GRAPH has up to 120 nodes and stands beside the packaged ones. The page is served to this machine only, under an
    address with a random token, and loads nothing from elsewhere. Ctrl-C ends it, with exit code 0
    once the address is printed.
    """
    from ptcc_certify.report.explorer.model import Explorer, reading_of
    from ptcc_certify.report.explorer.server import open_server
    from ptcc_certify.report.explorer.settings import Settings

    if graph == "-":
        raise ParameterError("-: the code that the explorer shows reads the graph again; save it and name the file")
    if is_scenario(graph):
        refuse_as_graph(graph)
    name, explorer = graph, Explorer()
    source = reading_of(graph, **shared.reading_of(options))
    if shared.graph_file(graph) == graph:  # no packaged one
        name = Path(graph).name
        explorer = Explorer(shared.read(graph, options), name, source)
    elif len(source) > 1:
        raise ParameterError(f"{graph}: is a packaged graph, shown as it is; leave out how it is read")
    server = open_server(explorer, Settings(name), port)
    try:
        if server.server_port != port:
            click.echo(f"port {port} is taken; this is port {server.server_port}", err=True)
        click.echo(server.address)
        click.echo("Ctrl-C ends the explorer", err=True)
        if not no_browser and _has_browser():
            threading.Thread(target=webbrowser.open, args=(server.address,), daemon=True).start()
        server.warm_up()
        server.serve_forever()
    except KeyboardInterrupt:
        click.echo("the explorer has ended", err=True)
        # The thread that draws may be in CasADi, which aborts where Python ends by itself around it.
        os._exit(ExitCode.OK)
    finally:
        server.server_close()
    return ExitCode.OK


def _has_browser() -> bool:
    """Tell whether there is a screen for a browser, so that none opens in the terminal."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
