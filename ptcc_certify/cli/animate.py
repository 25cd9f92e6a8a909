"""``ptcc animate``: a film of a certificate."""

from __future__ import annotations

from pathlib import PurePath

import click

from ptcc_certify.cli import options as shared
from ptcc_certify.cli.terminal import print_lines, progress, refuse_output
from ptcc_certify.errors import ExitCode, ParameterError

#: What films are written to.
_FILMS = (".gif", ".html", ".mp4")


@click.command()
@shared.certificate_argument
@click.option(
    "-o", "--output", type=click.Path(dir_okay=False), help="FILE.gif, .html or .mp4.  [default: NAME.gif, here]"
)
@click.option("--seconds", type=float, default=5, help="How long the way to the deadline takes, at most 60.")
@shared.time_unit_option
@shared.memory_option
def animate(certificate: str, output: str | None, seconds: float, time_unit: str, memory: float) -> int:
    """Make a film of CERTIFICATE: agents on their way to the deadline, in the tubes where they are proved to be.

    The certificate is of one graph of at most 40 agents, with an initial state, and is checked first. An .html is one
    page with buttons; .mp4 needs the program ffmpeg.
    """
    from ptcc_certify.certificate.certificate import RejectedCertificate

    if output is None:
        output = f"{PurePath(certificate).stem.lstrip('-') or 'certificate'}.gif"
    if PurePath(output).suffix.lower() not in _FILMS:
        raise ParameterError(f"{output}: films are written to {', '.join(_FILMS)}; choose one of these")
    refuse_output(output)
    try:
        with progress(("independent check", "film")) as begin:
            begin("independent check")
            from ptcc_certify.certificate.certificate import read_certificate
            from ptcc_certify.report.plots.animation import animate as make

            read = read_certificate(certificate, memory=memory)
            begin("film")
            make(read, output, seconds=seconds, time_unit=time_unit)
    except RejectedCertificate as error:
        print_lines(f"rejected: {error}", err=True)
        return ExitCode.VIOLATED
    print_lines(f"written    {output}")
    return ExitCode.OK
