"""`jshell simulate` and `jshell analyse`: make a trace, analyse a trace."""

import dataclasses
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress

import jshell
from jshell.cli.destinations import drawable, traceable, writable, write_finite
from jshell.cli.driving import (
    Burst,
    BurstStart,
    PressureFile,
    ToneOption,
    forcing,
    losses,
    outer_pressure,
)
from jshell.cli.output import Json, finish, judged, log, print_json, speaking, table
from jshell.cli.problem import Case, with_conditions, with_options
from jshell.cli.reading import takes_reading, takes_reading_of_pressure
from jshell.cli.statics import Attached, Elements, Spot, weak_spot
from jshell.errors import BadUnits, BadValue, Outcome, choose

DIMENSIONS = {"t_dip": "time"}  # of what is said of a run
LONGEST_STEP = 1 / 60  # `dynamics.LONGEST_STEP`, which help need not wait for
LONG = 400  # samples that make a run worth a progress bar


@dataclasses.dataclass(frozen=True)
class TimeOptions:
    """How long a run is, and its steps."""

    ramp: Annotated[float, typer.Option(help="Time the outer pressure takes from P0 to Pext; 0 is a step.")] = 25.0
    duration: Annotated[float, typer.Option(help="Length of the run.")] = 70.0
    every: Annotated[float, typer.Option(help="Spacing of the samples.")] = 0.05
    step: Annotated[float, typer.Option(help="Longest time step.", show_default="1/60")] = LONGEST_STEP


@dataclasses.dataclass(frozen=True)
class MeshOptions:
    """What the shell of a run is made of."""

    elements: Elements = 32
    follow: Annotated[
        bool, typer.Option("--follow", help="Let the nodes follow the rim: thin shells then need few elements.")
    ] = False
    tolerance: Annotated[
        float | None,
        typer.Option(help="Pick elements and step so that V is within this of a finer run, over V0."),
    ] = None
    attached: Attached = 0.0
    spot: Spot = None
    shell_density: Annotated[
        float, typer.Option("--shell-density", help="Density of the wall over the liquid's; the source has none.")
    ] = 0.0


@dataclasses.dataclass(frozen=True)
class PressureOptions:
    """What the outer pressure does instead of ramp and hold, or beside them."""

    pressure_file: PressureFile = None
    tone: ToneOption = None
    burst: Burst = None
    burst_start: BurstStart = 0.0


@dataclasses.dataclass(frozen=True)
class OutputOptions:
    """What a run leaves behind."""

    out: Annotated[Path, typer.Option("--out", help="Trace to write: .csv, .tsv, .json, .nc, .mat, .npz.")]
    symmetry: Annotated[
        bool,
        typer.Option("--symmetry", help="Say whether the dimple is round, and how fast it leaves that if not."),
    ] = False
    checkpoint: Annotated[
        Path | None, typer.Option("--checkpoint", help="Keep the run in this file; the same command continues it.")
    ] = None
    film: Annotated[Path | None, typer.Option("--film", help="Strip of moments to draw: .png, .pdf, .svg.")] = None
    gif: Annotated[Path | None, typer.Option("--gif", help="Film to draw: .gif.")] = None
    units: Annotated[str, typer.Option(help="reduced, or si (needs SI conditions).")] = "reduced"
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress on stderr.")] = False
    as_json: Json = False


@speaking
@with_conditions
@takes_reading_of_pressure
@with_options(TimeOptions, "time")
@with_options(MeshOptions, "mesh")
@with_options(PressureOptions, "driven")
@with_options(OutputOptions, "output")
@with_options(losses, "lost")
def simulate(
    problem: Case,
    time: TimeOptions,
    mesh: MeshOptions,
    driven: PressureOptions,
    output: OutputOptions,
    lost: Any,
    reading: Any = None,
) -> None:
    """Buckle a shell in time and write the trace.

    Times, frequencies and pressures of the options are without units: time unit √(ρ R0³/(E d)), pressure E d/R0.
    """
    problem.needs_viscosity()
    out, film, gif, quiet, as_json = output.out, output.film, output.gif, output.quiet, output.as_json
    traceable(out)
    drawable(film, "--film")
    writable(gif, "--gif", (".gif",))
    choose("--units", output.units, ("reduced", "si"))
    if output.units == "si" and problem.scales is None:
        raise BadUnits(
            "--units si", found="conditions without units", expected="SI conditions", remedy="Give --r0 and its kin."
        )
    writable(output.checkpoint, "--checkpoint")
    pressure = outer_pressure(driven.pressure_file, problem, reading)
    added = forcing(driven.tone, driven.burst, driven.burst_start)
    if not quiet:
        size = f"on {mesh.elements} elements" if mesh.tolerance is None else f"to within {mesh.tolerance:g}"
        log(f"simulating {time.duration:g} time units {size}")
    pictured = film is not None or gif is not None
    if mesh.tolerance is not None and pictured:
        raise BadValue(
            "--tolerance", found="a picture as well", expected="one of the two", remedy="Draw it at fixed --elements."
        )
    finer: dict[str, Any] = {} if mesh.tolerance is None else {"tolerance": mesh.tolerance}
    with progress_bar(shown=not (quiet or as_json) and time.duration / time.every >= LONG) as progress:
        made = (jshell.dynamics.record if pictured else jshell.dynamics.simulate)(
            problem.conditions,
            **dataclasses.asdict(time),
            elements=mesh.elements,
            follow=mesh.follow,
            attached=mesh.attached,
            weak_spot=weak_spot(mesh.spot, jshell.contour.WeakSpot()),
            shell_density=mesh.shell_density,
            pressure=pressure,
            forcing=added,
            losses=lost,
            symmetry=output.symmetry,
            checkpoint=output.checkpoint,
            progress=progress,
            **finer,
        )
    trace = made.trace if isinstance(made, jshell.dynamics.Motion) else made
    outcome = judged(Outcome(int(trace.outcome)), *trace.channels.values())
    trace = dataclasses.replace(trace, scales=problem.scales, outcome=int(outcome))
    write_finite(out, trace, units=output.units)
    if isinstance(made, jshell.dynamics.Motion):
        draw(made, film, gif, problem.scales)
    ok = outcome == Outcome.OK
    if ok and not buckled(trace):
        log("warning: no dimple at the end of the run: raise the outer pressure (R snaps at 1.62), or run longer")
    numbers = {
        "t_dip": jshell.signals.dip(trace),
        "V_over_V0": settled(trace, "V") / jshell.shell.SPHERE_VOLUME if ok else None,
        "S_over_S0": settled(trace, "S") / jshell.shell.SPHERE_AREA if ok else None,
    }
    settings = dict(trace.settings)
    said = {key: settings[key] for key in ("symmetry",) if key in settings}
    if as_json:
        pictures = {"film": film, "gif": gif}
        drawn = {key: str(path) for key, path in pictures.items() if path is not None}
        in_si = problem.si(numbers, DIMENSIONS)
        print_json(
            {"out": str(out), "outcome": outcome, **numbers, **in_si, **said, **drawn, "conditions": problem.record()}
        )
    else:
        words = {"t_dip": "dip at t", "V_over_V0": "settles at V/V0", "S_over_S0": "settles at S/S0"}
        rows = [(words[key], value, DIMENSIONS.get(key)) for key, value in numbers.items()]
        rows += [(key, text, None) for key, text in said.items()]
        if mesh.tolerance is not None and ok:
            rows += [("elements", int(settings["elements"]), None), ("step", float(settings["step"]), None)]
            rows += [("error estimate", float(settings["error_estimate"]), None)]
        typer.echo(problem.table(rows, (str(out), "value")))
    finish(outcome)


def draw(motion: "jshell.dynamics.Motion", film: Path | None, gif: Path | None, scales: "jshell.Scales | None") -> None:
    """Write the pictures that were asked for."""
    if film is not None:
        jshell.plot.save(jshell.plot.filmstrip(motion, scales=scales), film)
    if gif is not None:
        jshell.plot.animate(motion, gif)


@contextmanager
def progress_bar(*, shown: bool) -> Iterator[Callable[[float], None] | None]:
    """A progress bar on stderr, where that is a terminal and one is wanted; what the run calls, or None."""
    console = Console(stderr=True)
    if not (shown and console.is_terminal):
        yield None
        return
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task("running", total=1.0)
        yield lambda done: bar.update(task, completed=done)


def buckled(trace: "jshell.Trace") -> bool:
    """Whether the buckling pole ends below the top of the shell."""
    from jshell.membrane.equilibrium import DIMPLE_DEPTH  # help need not wait for it

    top, front, back = (float(np.asarray(trace[name])[-1]) for name in ("H", "x_front", "x_back"))
    return top - (front - back) > DIMPLE_DEPTH


def settled(trace: "jshell.Trace", channel: str) -> float:
    """Mean over the last fifth of a trace."""
    values = np.asarray(trace[channel])
    return float(np.mean(values[-max(1, values.size // 5) :]))


@speaking
@takes_reading
def analyse(
    file: Annotated[Path, typer.Argument(help="Trace: text of any instrument, .xlsx, .json, .nc, .mat, .npz, .tdms.")],
    reading: Any = None,
    channel: Annotated[str | None, typer.Option(help="Channel to analyse; V, else all of H, W, S.")] = None,
    start: Annotated[
        float | None, typer.Option("--from", help="Window's start, dimensionless time; seconds without conditions.")
    ] = None,
    stop: Annotated[float | None, typer.Option("--to", help="Window's end, in the same.")] = None,
    drift: Annotated[
        str, typer.Option(help="What the modes ring about: none, constant, line, exponential, or auto.")
    ] = "constant",
    meta: Annotated[Path | None, typer.Option(help="Conditions (JSON) for a file without them.")] = None,
    as_json: Json = False,
) -> None:
    """Analyse a trace: two frequencies, a decay time, amplitude ratios, a verdict."""
    trace = jshell.io.read_trace(file, meta=meta, **reading)
    if trace.conditions is None and trace.scales is None:
        log("note: times have no unit; `--units t=s` (or ms, …) gives the frequencies in Hz")
    found = jshell.signals.extract(trace, channel, start=start, stop=stop, drift=drift)
    if as_json:
        print_json({"file": str(file), **found.record()})
    else:
        typer.echo(signature_table(found))
        for text in (found.reason, *found.notes):
            if text:
                log(text)
    for text in found.warnings:
        log(f"{found.verdict}: {text}" if found.verdict in ("more than two", "misfit") else f"warning: {text}")
    finish(found.outcome, sound=found.sound)


def _with_unit(value: float | None, error: float | None, size: float | None, unit: str) -> str | None:
    """A number and its error, both times a size, to the digits that the error leaves."""
    if value is None or size is None:
        return None
    if error is None or not (math.isfinite(error) and error > 0):
        return f"{size * value:.5g} {unit}"
    places = max(0, 1 - math.floor(math.log10(size * error)))
    return f"{size * value:.{places}f} ± {size * error:.{places}f} {unit}"


def signature_table(found: "jshell.signals.Signature") -> str:
    """A signature as text."""
    error, hertz = found.stderr, found.frequency_unit
    ms = None if hertz is None else 1e3 / (2 * math.pi * hertz)
    seconds = hertz is not None and math.isclose(2 * math.pi * hertz, 1.0)  # the record's own time, not a shell's
    rows: list[tuple] = [
        (
            f"{words}{f' [{own}]' if seconds else ''}",
            value,
            error.get(key),
            _with_unit(value, error.get(key), size, unit),
        )
        for words, own, key, value, size, unit in (
            ("slow frequency ω−", "rad/s", "omega_minus", found.omega_minus, hertz, "Hz"),
            ("fast frequency ω+", "rad/s", "omega_plus", found.omega_plus, hertz, "Hz"),
            ("decay time τ", "s", "tau", found.tau, ms, "ms"),
        )
    ]
    rows += [(f"A+/A− on {name}", ratio, None, None) for name, ratio in found.amplitude_ratio.items()]
    rows += [("residual / signal", found.residual, None, None), ("modes needed", found.verdict, None, None)]
    rows += [
        ("window", f"{found.window[0]:.5g} to {found.window[1]:.5g}", None, None),
        ("drift", found.drift, None, None),
    ]
    header = ("from " + ", ".join(found.channels), "value", "±", "SI")
    if found.frequency_unit is None:
        return table([row[:3] for row in rows], header[:3])
    return table(rows, header)
