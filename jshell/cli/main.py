"""The terminal's way in."""

from typing import Annotated

import typer

from jshell import __version__
from jshell.cli.demo import demo
from jshell.cli.fits import fit
from jshell.cli.statics import frequencies, modes, rest
from jshell.cli.traces import analyse, simulate

app = typer.Typer(
    help="Buckling spherical shells in a liquid: simulate, listen, fit.", no_args_is_help=True, add_completion=False
)


def _version(asked: bool | None) -> None:
    if asked:
        typer.echo(f"jshell {__version__}")
        raise typer.Exit


@app.callback()
def common(
    version: Annotated[
        bool | None, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = None,
) -> None:
    """Buckling spherical shells in a liquid: simulate, listen, fit."""


for verb in (demo, rest, modes, simulate, analyse, fit, frequencies):
    app.command()(verb)
