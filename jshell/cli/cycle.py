"""`jshell cycle`: a pressure that goes up and down, and a shell that buckles and unbuckles with it."""

import dataclasses
import importlib
from typing import Annotated

import numpy as np
import typer

import jshell
from jshell.cli import decay as decays
from jshell.cli.constants import Damped, with_damping
from jshell.cli.destinations import OutFile, Picture, drawable, traceable, write_finite
from jshell.cli.output import Json, finish, judged, log, print_json, speaking, table
from jshell.cli.problem import Case, with_conditions, with_options
from jshell.errors import BadValue


@dataclasses.dataclass(frozen=True)
class CycleOptions:
    """A pressure that goes up and down."""

    low: Annotated[float, typer.Option(help="Least outer pressure / (E d/R0).")]
    high: Annotated[float, typer.Option(help="Largest outer pressure / (E d/R0).")]
    period: Annotated[float, typer.Option(help="Length of one cycle.")] = 400.0
    cycles: Annotated[int, typer.Option(help="How many cycles.")] = 2
    samples: Annotated[int, typer.Option(help="Samples in a cycle.")] = 1000


@speaking
@with_conditions
@with_damping
@with_options(CycleOptions, "load")
def cycle(
    problem: Case,
    damped: Damped,
    load: CycleOptions,
    tau: decays.Tau = None,
    out: OutFile = None,
    plot: Picture = None,
    as_json: Json = False,
) -> None:
    """Follow a shell through buckling and unbuckling under a pressure that swings between two values."""
    traceable(out)
    drawable(plot)
    low, high, period, cycles, samples = dataclasses.astuple(load)
    if not (0 < low < high and cycles > 0 and samples > 1):
        raise BadValue(
            "--low, --high, --cycles, --samples",
            found=f"{low:g}, {high:g}, {cycles}, {samples}",
            expected="0 < low < high, at least one cycle and two samples",
            remedy="Check them.",
        )
    constants, law, decay = decays.decay(problem, damped, tau)
    rest = float(problem.conditions.outer_pressure)
    drag = jshell.oscillator.Drag(law, tau)
    times = np.linspace(0.0, cycles * period, cycles * samples + 1)
    log(f"following {cycles} cycles of {period:g} time units")
    pressure = jshell.oscillator.RaisedCosine(low - rest, high - rest, period)
    found = jshell.oscillator.simulate_regimes(problem.conditions, constants, pressure, times=times, drag=drag)
    t = found.trace
    outcome = judged(found.outcome, *t.channels.values())
    if out is not None:
        settings = (*t.settings, *decays.written(decay))
        written = dataclasses.replace(t, outcome=int(outcome), settings=settings, scales=problem.scales)
        write_finite(out, written)
    if plot is not None:
        axes = importlib.import_module("jshell.plot.response").hysteresis(found)
        importlib.import_module("jshell.plot").save(axes.figure, plot)
    steps = {"accepted": found.accepted, "rejected": found.rejected}
    if as_json:
        files = {"out": None if out is None else str(out), "plot": None if plot is None else str(plot)}
        kinds = {"time": "time", "outer_pressure": "pressure"}
        switches = [switch._asdict() | problem.si(switch._asdict(), kinds) for switch in found.switches]
        print_json({"outcome": outcome, "thresholds": found.thresholds._asdict(), "switches": switches,
                    "decay": decay.record(), "steps": steps, **files, "conditions": problem.record()})  # fmt: skip
    else:
        at = found.thresholds
        rows = [("slow load", "buckles", at.buckling_pressure, at.buckling_volume / np.pi * 0.75)]
        rows.append(("slow load", "unbuckles", at.unbuckling_pressure, at.unbuckling_volume / np.pi * 0.75))
        for s in found.switches:
            word = "buckles" if s.buckles else "unbuckles"
            rows.append((f"{s.time:.5g}", word, s.outer_pressure, s.volume / np.pi * 0.75))
        header = ("time", "the shell", "at P̂ext", "V/V0")
        if problem.scales is not None:
            times = [None, None, *(s.time for s in found.switches)]
            measured = [
                (problem.in_units(t, "time"), problem.in_units(row[2], "pressure"))
                for t, row in zip(times, rows, strict=True)
            ]
            rows = [(*row, *more) for row, more in zip(rows, measured, strict=True)]
            header = (*header, "t", "Pext")
        typer.echo(table(rows, header))
        typer.echo(decays.line(decay))
    finish(outcome)
