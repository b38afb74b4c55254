"""The terminal's way in: every verb's name and first sentence; its module, and JAX, only when it is called."""

import importlib
from typing import Annotated, Any

import typer
from rich.markup import escape
from typer.core import TyperCommand

from jshell import __version__
from jshell.cli.output import Verbs, log

# A verb, the module and the name in it, and the first sentence of its own docstring.
VERBS = {
    "demo": ("demo", "Rest, vibrate, buckle, analyse, fit: the whole of jshell on the source's configuration R."),
    "rest": ("statics", "Rest shape: volume, area and inner pressure of a shell at a load, or at a volume."),
    "branch": (
        "statics",
        "Deflation branch: every dimpled shape from the sphere to contact, its folds, eigenvalue and Maxwell point.",
    ),
    "modes": (
        "statics",
        "Small vibrations about the rest shape: frequencies, decay times, what of a recording sees them.",
    ),
    "simulate": ("traces", "Buckle a shell in time and write the trace."),
    "analyse": ("traces", "Analyse a trace: two frequencies, a decay time, amplitude ratios, a verdict."),
    "read": (
        "reading",
        "Show what a file holds: columns, units, steps, gaps, what was taken for what, what was passed over.",
    ),
    "film": (
        "film",
        "Measure a film of a shell: height and width in time, with errors; with --analyse, its frequencies.",
    ),
    "fit": ("fits", "Fit the short model's constants."),
    "invert": (
        "inversion",
        "Invert ring-downs, or records through the snap: modulus, gas, pad, … of the shell, by the simulator.",
    ),
    "show": ("fits", "Show a saved fit: its report and its picture, without fitting again."),
    "frequencies": (
        "statics",
        "The short model's two frequencies (eq:defw, plateau law), beside the sphere's and Marmottant's.",
    ),
    "drive": (
        "drive",
        "Drive a buckled shell by a tone, pulse, burst, step or ramp, with the nonlinear short model.",
    ),
    "cycle": (
        "cycle",
        "Follow a shell through buckling and unbuckling under a pressure that swings between two values.",
    ),
    "bifurcation": ("bifurcation", "Bifurcation diagram: the volume once a period over the amplitude of a tone."),
    "export": (
        "export",
        "Export the law of a buckled shell for bubble codes: pressure, effective mass and damping by volume.",
    ),
    "softening": (
        "softening",
        "Fall of the angular frequencies through buckling, with the simulator's own modes beside them where stored.",
    ),
    "sensitivity": (
        "sensitivity",
        "Percent that a number changes with 1 % of each input; --range: Sobol indices; --next: which shell to measure.",
    ),
    "design": ("design", "Thickness and gas pressure of the shells that have two wanted frequencies."),
    "doctor": (
        "doctor",
        "Look at the installation: versions, devices, float64, the compiler, the cache, extras, shipped data.",
    ),
    "figures": (
        "figures",
        "Draw the source's figures from our own simulations, its published numbers marked; without a name, list them.",
    ),
    "serve": ("serve", "Serve fits over HTTP: a page for people, an API for programs."),
    "backup": (
        "backup",
        "Copy a service's jobs while it runs, all as of one moment, and look at the copy. (PostgreSQL: pg_dump.)",
    ),
    "restore": (
        "backup",
        "Look at a copy, every page and every upload, and put it where a service can start from it.",
    ),
    "submit": (
        "submit",
        "Fit traces on a service; the report is that of `jshell fit`. A token is read from JSHELL_TOKEN.",
    ),
    "campaign": ("campaign", "Many simulations: designed, run, catalogued."),
}


def load(name: str) -> Any:
    """The command of a verb; loads its module.

    Args:
        name: One of `VERBS`.
    """
    module = importlib.import_module(f"jshell.cli.{VERBS[name][0]}")
    verb = getattr(module, name, None)
    if verb is None:  # a group of verbs
        found = typer.main.get_command(module.app)
    else:
        alone = typer.Typer(add_completion=False)
        alone.command()(verb)
        found = typer.main.get_command(alone)
    found.name = name
    _make_readable(found)
    return found


def _make_readable(command: Any) -> None:
    """Keep units in help, since Rich takes `[m]` for the name of a style; a flag takes no value, so say no type."""
    command.help = escape(command.help or "")
    for param in command.get_params(typer.Context(command)):  # with --help itself
        if getattr(param, "help", None):
            param.help = escape(param.help)
        if getattr(param, "is_flag", False):
            param.metavar = ""
    for each in getattr(command, "commands", {}).values():
        _make_readable(each)


class LazyVerbs(Verbs):
    """The verbs: listed from the table, loaded when one is called."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        for name, (_, words) in VERBS.items():
            self.add_command(TyperCommand(name, help=words))

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """The command that the first word names, and the other words."""
        name, found, rest = super().resolve_command(ctx, args)
        return name, found if name is None else load(name), [_current(word) for word in rest]


FORMER = {"--pulsation": "--omega"}  # options that had another name, for one release


def _current(word: str) -> str:
    flag, equals, value = word.partition("=")
    if flag not in FORMER:
        return word
    log(f"warning: {flag} is now {FORMER[flag]}")
    return FORMER[flag] + equals + value


app = typer.Typer(
    cls=LazyVerbs,
    help="Buckling spherical shells in a liquid: simulate, analyse, fit.",
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
    """Buckling spherical shells in a liquid: simulate, analyse, fit."""
