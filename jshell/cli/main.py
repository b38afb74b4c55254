"""The terminal's way in."""

from typing import Annotated

import typer

from jshell import __version__
from jshell.cli.bifurcation import bifurcation
from jshell.cli.campaign import app as campaign
from jshell.cli.cycle import cycle
from jshell.cli.demo import demo
from jshell.cli.design import design
from jshell.cli.doctor import doctor
from jshell.cli.drive import drive
from jshell.cli.figures import figures
from jshell.cli.fits import fit, show
from jshell.cli.output import Verbs
from jshell.cli.sensitivity import sensitivity
from jshell.cli.serve import serve
from jshell.cli.softening import softening
from jshell.cli.statics import branch, frequencies, modes, rest
from jshell.cli.submit import submit
from jshell.cli.traces import analyse, simulate

app = typer.Typer(
    cls=Verbs,
    help="Buckling spherical shells in a liquid: simulate, listen, fit.",
    no_args_is_help=True,
    add_completion=False,
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


for verb in (
    demo, rest, branch, modes, simulate, analyse, fit, show, frequencies, drive, cycle, bifurcation, softening,
    sensitivity, design, doctor, figures, serve, submit,
):  # fmt: skip
    app.command()(verb)
app.add_typer(campaign, name="campaign")
