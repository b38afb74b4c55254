"""`jshell invert`: what shell recordings are of, by the simulator."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import jshell
from jshell.cli.amounts import read_amount
from jshell.cli.destinations import Picture, drawable
from jshell.cli.output import Json, finish, log, print_json, speaking
from jshell.cli.problem import with_options
from jshell.cli.reading import takes_reading
from jshell.errors import BadValue

FREE = (-np.inf, np.inf)
LENGTHS, PRESSURES = ("radius", "thickness"), ("youngs_modulus", "gas_pressure", "outer_pressure")
DIMENSIONS = dict.fromkeys(LENGTHS, "length") | dict.fromkeys(PRESSURES, "pressure")  # of what may come with a unit


@dataclass(frozen=True)
class UnknownOptions:
    """What is asked of the shells, and what is known of them."""

    unknown: Annotated[
        list[str] | None,
        typer.Option(help="youngs_modulus,gas_pressure,…: what is asked; may be repeated."),
    ] = None
    known: Annotated[
        list[str] | None,
        typer.Option(help="NAME=VALUE, as thickness=5mm; without a unit in SI; over the header's; may be repeated."),
    ] = None
    prior: Annotated[list[str] | None, typer.Option(help="NAME=MEAN:ERROR of an unknown; may be repeated.")] = None
    bounds: Annotated[list[str] | None, typer.Option(help="NAME=LOW:HIGH of an unknown; may be repeated.")] = None
    local: Annotated[list[str] | None, typer.Option(help="Unknowns that every file has for itself.")] = None
    nuisance: Annotated[
        bool | None, typer.Option(help="Seek pad and weak spot too, from priors; by default with SI units.")
    ] = None


@dataclass(frozen=True)
class RecordOptions:
    """What of the files is read."""

    meta: Annotated[Path | None, typer.Option(help="Conditions (JSON) for files without them.")] = None
    channels: Annotated[
        str | None, typer.Option(help="H,W,V,S,x_front,x_back,W_25,W_50,W_75, or p_scattered (an echo): those to use.")
    ] = None
    start: Annotated[float | None, typer.Option(help="Where the ring-down begins [s, or time unit].")] = None
    stop: Annotated[float | None, typer.Option(help="Where it ends [s, or time unit].")] = None
    free_rest: Annotated[bool, typer.Option(help="The values where channels rest are no data.")] = False


@dataclass(frozen=True)
class SimulatorOptions:
    """How the simulator is compared with the records."""

    exact: Annotated[bool, typer.Option(help="Correct the answer to the exact liquid.")] = True
    elements: Annotated[int | None, typer.Option(help="Elements of the meridian; 20 for modes, 24 for traces.")] = None
    level: Annotated[str, typer.Option(help="modal: ring-downs; trace: records through the snap, simulated whole.")] = (
        "modal"
    )
    ramp: Annotated[
        float | None,
        typer.Option(help="trace: time of the pressure's rise [s, or time unit], 0 at once; by default the file's."),
    ] = None
    origin: Annotated[float, typer.Option(help="trace: when the pressure begins to rise [s, or time unit].")] = 0.0
    starts: Annotated[int, typer.Option(help="trace: from how many starts.")] = 1
    engine: Annotated[str, typer.Option(help="trace: inline, processes, processes:N, tcp://host:port.")] = "inline"
    checkpoint: Annotated[
        Path | None, typer.Option(help="trace: folder that keeps every simulation; the same command goes on there.")
    ] = None


@dataclass(frozen=True)
class AnswerOptions:
    """What else is said of the answer."""

    profile: Annotated[bool, typer.Option(help="Asymmetric 95% intervals by profile likelihood.")] = False
    next: Annotated[
        bool, typer.Option(help="What one more recording would tell: channels, pressures, rate, length.")
    ] = False


@speaking
@takes_reading
@with_options(UnknownOptions, "asked")
@with_options(RecordOptions, "records")
@with_options(SimulatorOptions, "simulator")
@with_options(AnswerOptions, "answer")
def invert(
    files: Annotated[list[Path], typer.Argument(help="Ring-downs of one shell (text, .xlsx, .json, .nc, .mat, …).")],
    asked: UnknownOptions,
    records: RecordOptions,
    simulator: SimulatorOptions,
    answer: AnswerOptions,
    reading: Any = None,
    plot: Picture = None,
    as_json: Json = False,
) -> None:
    """Invert ring-downs, or records through the snap: modulus, gas, pad, … of the shell, by the simulator."""
    drawable(plot)
    unknowns = _asked(asked.unknown or [], asked.prior or [], asked.bounds or [])
    said = dict(_pair(text, "--known") for text in _split(asked.known or []))
    mesh: dict[str, Any] = {} if simulator.elements is None else {"elements": simulator.elements}
    how: Any = simulator.level
    if how == "trace":
        how = jshell.inversion.Snap(
            ramp=simulator.ramp, origin=simulator.origin, starts=simulator.starts, engine=simulator.engine,
            checkpoint=simulator.checkpoint, progress=_report_progress, **mesh,
        )  # fmt: skip
    traces = [jshell.io.read_trace(file, meta=records.meta, **reading) for file in files]
    channels = None if records.channels is None else tuple(_split([records.channels]))
    found = jshell.invert(
        traces, said, unknowns, local=tuple(_split(asked.local or [])), start=records.start, stop=records.stop,
        free_rest=records.free_rest, nuisance=asked.nuisance, exact=simulator.exact, level=how, channels=channels,
        **mesh,
    )  # fmt: skip
    more = {"profile": found.profile()} if answer.profile else {}
    more |= {"next": found.next_recording()} if answer.next else {}
    if plot is not None:
        axes = jshell.plot.inversion(found)
        jshell.plot.save(np.ravel(np.asarray(axes))[0].figure, plot)
        log(f"wrote {plot}")
    if as_json:
        print_json(found.record() | {name: one.record() for name, one in more.items()})
    else:
        typer.echo("\n".join([found.report(), *(one.report() for one in more.values())]))
    sound = not any(text.startswith("misfit") for text in found.warnings)
    finish(found.outcome, sound=sound, advice=found.advice)


def _report_progress(number: int, share: float) -> None:
    """A line for every simulation that is done."""
    if share >= 1:
        log(f"simulation {number}")


def _split(texts: Sequence[str]) -> list[str]:
    """Names or pairs, from options that may be repeated or hold several between commas."""
    return [part.strip() for text in texts for part in text.split(",") if part.strip()]


def _pair(text: str, place: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    name = name.strip()
    try:
        return name, read_amount(value, DIMENSIONS[name]) if name in DIMENSIONS else float(value)
    except ValueError:
        raise BadValue(
            place,
            found=repr(text),
            expected="NAME=NUMBER, with a unit or in SI",
            remedy=f"Write {place} thickness=5e-3, or thickness=5mm.",
        ) from None


def _asked(unknown: Sequence[str], prior: Sequence[str], bounds: Sequence[str]) -> dict[str, Any]:
    """The unknowns with what is known of them."""
    from jshell.calibration.option_texts import read_texts  # with JAX, which help does not wait for

    priors = read_texts("priors", _split(prior), "--prior")
    spans = read_texts("bounds", _split(bounds), "--bounds")
    finite = lambda x: None if np.isinf(x) else float(x)  # noqa: E731
    names = dict.fromkeys([*_split(unknown), *priors, *spans])
    return {
        name: jshell.inversion.Unknown(
            finite(spans.get(name, FREE)[0]), finite(spans.get(name, FREE)[1]), priors.get(name)
        )
        for name in names
    }
