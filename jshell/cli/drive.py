"""`jshell drive`: what a shell answers to a pressure."""

import dataclasses
import importlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

import jshell
from jshell.cli import decay as decays
from jshell.cli.constants import Damped, with_damping
from jshell.cli.destinations import OutFile, Picture, drawable, traceable, write_finite
from jshell.cli.output import Json, finish, judged, log, print_json, speaking
from jshell.cli.problem import Case, with_conditions, with_options
from jshell.errors import BadValue, Outcome, choose
from jshell.sizes import count_of_samples

if TYPE_CHECKING:
    import jshell.pressure

FORCINGS = ("tone", "pulse", "burst", "step", "ramp")
HARMONICS = 3  # multiples of the drive that the answer is sampled for
USUAL_SPACING = 0.05  # of the samples [time unit]
SAMPLES_PER_LIMIT = 2  # finer than the limit that its fastest motion sets by this
DIMENSIONS = {"pulsation": "angular frequency", "pole_speed_max": "speed", "ended_at": "time"}  # of what is said
DRAGS = ("viscous", "equal_decay", "reynolds", "none")


@dataclasses.dataclass(frozen=True)
class ForcingOptions:
    """The added pressure."""

    forcing: Annotated[str, typer.Option(help="tone, pulse, burst, step or ramp.")] = "tone"
    amplitude: Annotated[
        float, typer.Option(help="Added pressure / (E d/R0); of a pulse or burst its peak negative pressure.")
    ] = 0.02
    angular_frequency: Annotated[
        float | None,
        typer.Option("--omega", help="Angular frequency of a tone, pulse or burst; by default the slow mode's."),
    ] = None
    cycles: Annotated[int, typer.Option(help="Cycles of a pulse or burst.")] = 5
    kpa: Annotated[float | None, typer.Option("--kpa", help="Amplitude in kPa (needs SI conditions).")] = None
    mhz: Annotated[float | None, typer.Option("--mhz", help="Frequency in MHz (needs SI conditions).")] = None
    rise: Annotated[float, typer.Option(help="Length of a ramp.")] = 10.0


@dataclasses.dataclass(frozen=True)
class SpanOptions:
    """When the motion is sampled."""

    duration: Annotated[float, typer.Option(help="Length of the run.")] = 100.0
    every: Annotated[
        float | None,
        typer.Option(help="Spacing of the samples; by default 0.05, or less where drive or shell are faster."),
    ] = None


@dataclasses.dataclass(frozen=True)
class DragOptions:
    """What takes energy away."""

    drag: Annotated[
        str | None, typer.Option(help="viscous, equal_decay, reynolds or none.", show_default="viscous")
    ] = None
    tau: decays.Tau = None
    layer: Annotated[float, typer.Option(help="Factor of a Stokes layer; 0 is none.")] = 0.0
    wall_viscosity: Annotated[float, typer.Option(help="Viscosity of the wall / (E d time).")] = 0.0
    sound_speed: Annotated[float | None, typer.Option(help="Speed of sound / sqrt(E d/rho R0).")] = None


@speaking
@with_conditions
@with_damping
@with_options(ForcingOptions, "tone")
@with_options(SpanOptions, "span")
@with_options(DragOptions, "losses")
def drive(
    problem: Case,
    damped: Damped,
    tone: ForcingOptions,
    span: SpanOptions,
    losses: DragOptions,
    out: OutFile = None,
    plot: Picture = None,
    as_json: Json = False,
) -> None:
    """Drive a buckled shell by a tone, pulse, burst, step or ramp, with the nonlinear short model."""
    traceable(out)
    drawable(plot)
    constants, law, found_decay = decays.decay(problem, damped, losses.tau, losses.drag, losses.layer > 0)
    omega = _angular_frequency(problem, constants, tone.angular_frequency, tone.mhz)
    size = tone.amplitude
    if tone.kpa is not None:
        size = _si(problem, "--kpa") and 1e3 * tone.kpa / problem.scales.pressure  # pyright: ignore
    pressure = _forcing(tone.forcing, size, omega, tone.cycles, tone.rise)
    short = jshell.oscillator
    memory = short.StokesLayer(jshell.memory.half_derivative(), losses.layer) if losses.layer > 0 else None
    drag = short.Drag(law, losses.tau, short.Reynolds(), memory, losses.wall_viscosity, losses.sound_speed)
    times = _times(problem, constants, omega, span.duration, span.every)
    log(f"driving {span.duration:g} time units at angular frequency {omega:g}")
    found = short.drive(problem.conditions, constants, pressure, times=times, drag=drag)
    if memory is not None:
        _tell_of_thick_layer(problem, found)
    _report(problem, found, found_decay, omega, out, plot, as_json)


def _tell_of_thick_layer(problem: Case, found: "jshell.oscillator.Response") -> None:
    """What the exact liquid says, where the layer is too thick for its law, which the run has warned of."""
    limits = importlib.import_module("jshell.oscillator.drive")
    driven = found.driven
    if limits.layer_thickness(driven.conditions, driven.coefficients, driven.state) <= limits.THICKEST_LAYER:
        return
    exact = jshell.dynamics.modes(problem.conditions, liquid="exact", count=2)
    for row in exact.table():
        omega = "overdamped" if row.omega is None else f"omega {row.omega:.4g}"
        log(f"the exact liquid says: {omega}, tau {'–' if row.tau is None else format(row.tau, '.4g')}")


def _times(
    problem: Case, constants: "jshell.oscillator.Coefficients", omega: float, duration: float, every: float | None
) -> np.ndarray:
    """When the run is sampled: fine enough for three times the drive and for the shell's fast mode."""
    fast = float(jshell.oscillator.frequencies(problem.conditions, constants).omega_plus)
    fastest = max(HARMONICS * omega, fast if np.isfinite(fast) else 0.0)
    if every is None:
        every = min(USUAL_SPACING, np.pi / (SAMPLES_PER_LIMIT * fastest)) if fastest > 0 else USUAL_SPACING
    elif every * omega > np.pi:
        raise BadValue(
            "--every",
            found=f"{every:g}, less than two samples a period of the drive at angular frequency {omega:g}",
            expected=f"at most {np.pi / omega:.3g}; {np.pi / fastest:.3g} shows its harmonics",
            remedy="Sample more often, or leave --every out.",
        )
    count = count_of_samples("--duration, --every", duration, every)
    return every * np.arange(count + 1)


def _report(
    problem: Case,
    found: "jshell.oscillator.Response",
    decay: "jshell.oscillator.Decay",
    omega: float,
    out: Path | None,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Write what was asked for, and print the numbers."""
    whole = found.trace()
    outcome = judged(Outcome(int(found.outcome)), *whole.channels.values())
    settings = (*whole.settings, *decays.written(decay))
    trace = dataclasses.replace(whole, outcome=int(outcome), settings=settings, scales=problem.scales)
    if out is not None:
        write_finite(out, trace)
    drawing = importlib.import_module("jshell.plot.response")
    if plot is not None:
        importlib.import_module("jshell.plot").save(drawing.answer(found), plot)
    ok = outcome == Outcome.OK
    sphere = jshell.shell.SPHERE_VOLUME
    V = np.asarray(found.motion.V) / sphere
    ended = float(found.ended)
    numbers = {
        "V_rest_over_V0": float(found.driven.state.volume) / sphere,
        "V_min_over_V0": float(V.min()) if ok else None,
        "V_max_over_V0": float(V.max()) if ok else None,
        "pole_speed_max": float(np.max(np.abs(np.asarray(found.front_speed)))) if ok else None,
        "scattered_max": float(np.max(np.abs(np.asarray(found.scattered)))) if ok else None,
        "energy_imbalance": float(np.max(np.abs(np.asarray(found.imbalance)))) if ok else None,
        "ended_at": ended if np.isfinite(ended) else None,
    }
    levels = drawing.harmonic_levels(found, omega) if ok else {}
    steps = {"accepted": int(found.accepted), "rejected": int(found.rejected)}
    if as_json:
        files = {"out": None if out is None else str(out), "plot": None if plot is None else str(plot)}
        print_json({"outcome": outcome, **numbers, "decay": decay.record(), "pulsation": omega, "harmonics": levels,
                    "steps": steps, **problem.si(numbers | {"pulsation": omega}, DIMENSIONS), **files,
                    "conditions": problem.record()})  # fmt: skip
    else:
        rows: list[tuple[str, Any, str | None]] = [("driven at ω", omega, "angular frequency")]
        rows += [(name.replace("_", " "), value, DIMENSIONS.get(name)) for name, value in numbers.items()]
        rows += [(f"scattered at {order} ω", value, None) for order, value in levels.items()]
        rows += [(f"steps {word}", count, None) for word, count in steps.items()]
        typer.echo(problem.table(rows, ("driven shell", "value")))
        typer.echo(decays.line(decay))
    finish(outcome)


def _si(problem: Case, option: str) -> bool:
    if problem.scales is None:
        raise BadValue(option, found="conditions without units", expected="SI conditions", remedy="Give --r0 and kin.")
    return True


def _angular_frequency(
    problem: Case, constants: "jshell.oscillator.Coefficients", given: float | None, mhz: float | None
) -> float:
    """The drive's angular frequency: as given, from a frequency, or that of the slow mode."""
    if mhz is not None:
        _si(problem, "--mhz")
        return 2e6 * np.pi * mhz * problem.scales.time  # pyright: ignore[reportOptionalMemberAccess]
    if given is not None:
        return given
    found = jshell.oscillator.frequencies(problem.conditions, constants)
    finish(Outcome(int(found.outcome)))
    return float(found.omega_minus)


def _forcing(kind: str, size: float, omega: float, cycles: int, rise: float) -> "jshell.pressure.Pressure":
    choose("--forcing", kind, FORCINGS)
    if kind == "tone":
        return jshell.oscillator.Tone(size, omega)
    if kind in ("pulse", "burst"):
        return jshell.oscillator.Pulse(size, omega, cycles, 0.0, "hann" if kind == "pulse" else "flat")
    return jshell.oscillator.Step(size) if kind == "step" else jshell.oscillator.Ramp(stop=size, duration=rise)
