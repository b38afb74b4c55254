"""`jshell bifurcation`: what a tone of rising amplitude does to a shell once its transients are gone."""

import importlib
from dataclasses import astuple, dataclass
from typing import Annotated, Any

import numpy as np
import typer

import jshell
from jshell.cli import decay as decays
from jshell.cli.constants import Damped, with_damping
from jshell.cli.destinations import Picture, drawable
from jshell.cli.output import Json, finish, log, print_json, speaking
from jshell.cli.problem import Case, with_conditions, with_options
from jshell.errors import BadValue, Outcome


@dataclass(frozen=True)
class SweepOptions:
    """Amplitudes of a tone, and how long each is looked at."""

    highest: Annotated[float, typer.Option(help="Largest amplitude / (E d/R0).")]
    lowest: Annotated[float, typer.Option(help="Least amplitude / (E d/R0).")] = 0.001
    lanes: Annotated[int, typer.Option(help="How many amplitudes.")] = 400
    periods: Annotated[int, typer.Option(help="Periods of the tone that each amplitude is run for.")] = 200
    keep: Annotated[int, typer.Option(help="Last periods, in which repetition is looked for.")] = 50


@speaking
@with_conditions
@with_damping
@with_options(SweepOptions, "sweep")
def bifurcation(
    problem: Case,
    damped: Damped,
    sweep: SweepOptions,
    angular_frequency: Annotated[
        float | None, typer.Option("--omega", help="Angular frequency of the tone; by default the slow mode's.")
    ] = None,
    tau: decays.Tau = None,
    plot: Picture = None,
    as_json: Json = False,
) -> None:
    """Bifurcation diagram: the volume once a period over the amplitude of a tone."""
    drawable(plot)
    highest, lowest, lanes, periods, keep = astuple(sweep)
    if not (0 < lowest < highest and lanes > 1):
        raise BadValue(
            "--lowest, --highest, --lanes",
            found=f"{lowest:g}, {highest:g}, {lanes}",
            expected="0 < lowest < highest, and 2 amplitudes or more",
            remedy="Check them.",
        )
    constants, law, decay = decays.decay(problem, damped, tau)
    if angular_frequency is None:
        linear = jshell.oscillator.frequencies(problem.conditions, constants)
        finish(Outcome(int(linear.outcome)))
        angular_frequency = float(linear.omega_minus)
    drag = jshell.oscillator.Drag(law, tau)
    amplitudes = np.linspace(lowest, highest, lanes)
    log(f"{lanes} amplitudes, {periods} periods each, angular frequency {angular_frequency:g}")
    found = jshell.oscillator.bifurcation(
        problem.conditions, constants, amplitudes, angular_frequency, periods=periods, keep=keep, drag=drag
    )
    if plot is not None:
        axes = importlib.import_module("jshell.plot.response").bifurcation_diagram(found)
        importlib.import_module("jshell.plot").save(axes.figure, plot)
    ended = np.asarray(found.outcome) != 0
    counts = {int(p): int(np.sum(np.asarray(found.period)[~ended] == p)) for p in np.unique(found.period)}
    first = float(amplitudes[ended][0]) if ended.any() else None
    if as_json:
        rows = {
            "amplitude": amplitudes,
            "outcome": [Outcome(int(o)) for o in found.outcome],
            "period": found.period,
            "volume_over_V0": np.asarray(found.volume).T / jshell.shell.SPHERE_VOLUME,
        }
        kinds = {"pulsation": "angular frequency", "first_ended": "pressure"}
        units = problem.si({"pulsation": angular_frequency, "first_ended": first}, kinds)
        print_json({"pulsation": angular_frequency, "lanes": rows, "first_ended": first, **units,
                    "decay": decay.record(), "plot": None if plot is None else str(plot),
                    "conditions": problem.record()})  # fmt: skip
    else:
        words = {0: "does not repeat within 8 periods", 1: "repeats every period"}
        shown: list[tuple[str, Any, str | None]]
        shown = [(words.get(p, f"repeats every {p} periods"), n, None) for p, n in counts.items() if n]
        shown += [
            ("leaves the buckled state", int(ended.sum()), None),
            ("first amplitude that does", first, "pressure"),
        ]
        shown.append(("angular frequency of the tone", angular_frequency, "angular frequency"))
        typer.echo(problem.table(shown, ("the answer", "amplitudes")))
        typer.echo(decays.line(decay))
