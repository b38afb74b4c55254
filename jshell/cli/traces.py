"""`jshell simulate` and `jshell analyse`: make a trace, listen to a trace."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from jshell import dynamics, io, signals
from jshell.cli.output import Json, finish, log, say, speaking, table, writable
from jshell.cli.problem import Problem, with_conditions
from jshell.cli.statics import Attached, Elements, Spot, weak_spot
from jshell.contour import WeakSpot
from jshell.dynamics import LONGEST_STEP
from jshell.errors import BadName, BadUnits, Outcome
from jshell.membrane.rest import DIMPLE_DEPTH
from jshell.shell import SPHERE_AREA, SPHERE_VOLUME
from jshell.trace import Trace


@speaking
@with_conditions
def simulate(
    problem: Problem,
    out: Annotated[Path, typer.Option("--out", help="Trace to write (CSV).")],
    ramp: Annotated[float, typer.Option(help="Time the outer pressure takes from P0 to Pext; 0 is a step.")] = 25.0,
    duration: Annotated[float, typer.Option(help="Length of the run.")] = 70.0,
    every: Annotated[float, typer.Option(help="Spacing of the samples.")] = 0.05,
    step: Annotated[float, typer.Option(help="Longest time step.")] = LONGEST_STEP,
    elements: Elements = 32,
    attached: Attached = 0.0,
    spot: Spot = None,
    stokes_frequency: Annotated[
        float | None,
        typer.Option(
            help="Reference frequency of the Stokes layer; by default from the modes of the final rest state."
        ),
    ] = None,
    units: Annotated[str, typer.Option(help="reduced, or si (needs SI conditions).")] = "reduced",
    as_json: Json = False,
) -> None:
    """Buckle a shell in time and write the trace."""
    problem.needs_viscosity()
    writable(out, "--out")
    if units not in ("reduced", "si"):
        raise BadName("--units", found=repr(units), expected="reduced or si", remedy="Choose one.")
    if units == "si" and problem.scales is None:
        raise BadUnits(
            "--units si", found="conditions without units", expected="SI conditions", remedy="Give --r0 and its kin."
        )
    log(f"simulating {duration:g} time units on {elements} elements")
    trace = dynamics.simulate(
        problem.conditions,
        ramp=ramp,
        duration=duration,
        every=every,
        step=step,
        elements=elements,
        attached=attached,
        weak_spot=weak_spot(spot, WeakSpot()),
        stokes_frequency=stokes_frequency,
    )
    trace = Trace(
        trace.times,
        trace.channels,
        trace.conditions,
        outcome=trace.outcome,
        settings=trace.settings,
        scales=problem.scales,
    )
    io.write_trace(out, trace, units="si" if units == "si" else "reduced")
    outcome = Outcome(int(trace.outcome))
    ok = outcome == Outcome.OK
    if ok and not buckled(trace):
        log("warning: no dimple at the end of the run: raise the outer pressure (R snaps at 1.62), or run longer")
    numbers = {
        "t_dip": signals.dip(trace),
        "V_over_V0": settled(trace, "V") / SPHERE_VOLUME if ok else None,
        "S_over_S0": settled(trace, "S") / SPHERE_AREA if ok else None,
    }
    if as_json:
        say({"out": str(out), "outcome": outcome, **numbers, "conditions": problem.record()})
    else:
        words = {"t_dip": "dip at t", "V_over_V0": "settles at V/V0", "S_over_S0": "settles at S/S0"}
        typer.echo(table([(words[key], value) for key, value in numbers.items()], (str(out), "value")))
    finish(outcome)


def buckled(trace: Trace) -> bool:
    """Whether the buckling pole ends below the top of the shell."""
    top, front, back = (float(np.asarray(trace[name])[-1]) for name in ("H", "x_front", "x_back"))
    return top - (front - back) > DIMPLE_DEPTH


def settled(trace: Trace, channel: str) -> float:
    """Mean over the last fifth of a trace."""
    values = np.asarray(trace[channel])
    return float(np.mean(values[-max(1, values.size // 5) :]))


@speaking
def analyse(
    file: Annotated[Path, typer.Argument(help="Trace (CSV).")],
    channel: Annotated[str | None, typer.Option(help="Channel to listen to; V, else all of H, W, S.")] = None,
    start: Annotated[float | None, typer.Option("--from", help="Window's start, dimensionless time.")] = None,
    stop: Annotated[float | None, typer.Option("--to", help="Window's end, dimensionless time.")] = None,
    meta: Annotated[Path | None, typer.Option(help="Conditions (JSON) for a file without them.")] = None,
    as_json: Json = False,
) -> None:
    """Listen to a trace: two frequencies, a decay time, amplitude ratios, a verdict."""
    trace = io.read_trace(file, meta=meta)
    found = signals.extract(trace, channel, start=start, stop=stop)
    if as_json:
        say({"file": str(file), **found.record()})
    else:
        typer.echo(heard_table(found))
        if found.reason:
            log(found.reason)
    if found.verdict == "more than two":
        log(f"two modes leave {100 * (found.residual or 0):.0f} % of the signal: the two-mode picture does not hold")
    finish(found.outcome, sound=found.verdict != "more than two")


def heard_table(found: signals.Signature) -> str:
    """A signature as text."""
    error = found.stderr
    rows: list[tuple] = [
        ("slow frequency ω−", found.omega_minus, error.get("omega_minus"), found.f_minus_Hz),
        ("fast frequency ω+", found.omega_plus, error.get("omega_plus"), found.f_plus_Hz),
        ("decay time τ", found.tau, error.get("tau"), None),
    ]
    rows += [(f"A+/A− on {name}", ratio, None, None) for name, ratio in found.amplitude_ratio.items()]
    rows += [("residual / signal", found.residual, None, None), ("modes needed", found.verdict, None, None)]
    header = ("heard on " + ", ".join(found.channels), "value", "± (white noise)", "Hz")
    if found.frequency_unit is None:
        return table([row[:3] for row in rows], header[:3])
    return table(rows, header)
