"""`jshell film`: height and width of a shell from a film of it, and on to its frequencies in one command."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import jshell
from jshell.cli.amounts import amount
from jshell.cli.destinations import drawable, traceable
from jshell.cli.output import Json, finish, log, print_json, speaking
from jshell.cli.problem import with_options
from jshell.cli.traces import progress_bar, signature_table
from jshell.errors import BadValue
from jshell.quantities import POWERS, UNITS, laboratory_unit, quantity


@dataclass(frozen=True)
class ViewOptions:
    """What the camera saw."""

    rate: Annotated[float | None, typer.Option(help="Frames per second; without it, the film's own.")] = None
    pixel: Annotated[
        float | None,
        typer.Option(
            parser=amount("length"),
            metavar="<number>",
            help="Size of a pixel at the shell [m], or as 0.517mm; without it, pixels.",
        ),
    ] = None
    bright: Annotated[bool, typer.Option("--bright", help="The shell is brighter than what surrounds it.")] = False
    axis: Annotated[str, typer.Option(help="Direction of the axis in degrees, 90 is upright; or `find`.")] = "90"
    holder: Annotated[str | None, typer.Option(help="TOP:BOTTOM:LEFT:RIGHT pixels of the holder, left out.")] = None
    grid: Annotated[Path | None, typer.Option(help="Picture of a grid of dots through the same window.")] = None
    section: Annotated[
        bool, typer.Option("--section", help="The film shows a section along the axis: volume, area, poles as well.")
    ] = False
    widths: Annotated[
        bool, typer.Option("--widths", help="Measure the width at a quarter, half, three quarters of the height, too.")
    ] = False


@dataclass(frozen=True)
class FileOptions:
    """What is written."""

    out: Annotated[Path | None, typer.Option("--out", help="Trace to write.")] = None
    contours: Annotated[Path | None, typer.Option(help="Outlines of all frames to write, .nc.")] = None
    overlay: Annotated[Path | None, typer.Option(help="Strip of frames with their outlines to draw.")] = None


def _time(flag: str, words: str) -> Any:
    return typer.Option(flag, parser=amount("time"), metavar="<number>", help=words)


@dataclass(frozen=True)
class RingingOptions:
    """Whether frequencies are sought, and in which window."""

    analyse: Annotated[bool, typer.Option("--analyse", help="Go on to frequencies and decay time.")] = False
    start: Annotated[float | None, _time("--from", "Window's start [s], or as 20ms.")] = None
    stop: Annotated[float | None, _time("--to", "Window's end [s], or as 90ms.")] = None


@speaking
@with_options(ViewOptions, "view")
@with_options(FileOptions, "files")
@with_options(RingingOptions, "ringing")
def film(
    path: Annotated[
        Path, typer.Argument(help="TIFF stack, folder or .zip of pictures, video, .cihx with .mraw, or .cine.")
    ],
    view: ViewOptions,
    files: FileOptions,
    ringing: RingingOptions,
    as_json: Json = False,
) -> None:
    """Measure a film of a shell: height and width in time, with errors; with --analyse, its frequencies."""
    out, contours, overlay, pixel = files.out, files.contours, files.overlay, view.pixel
    traceable(out)
    drawable(overlay, "--overlay")
    camera = jshell.camera
    lens = None if view.grid is None else camera.lens_from_grid(view.grid)
    seen = camera.View(
        view.rate, pixel, not view.bright, _angle(view.axis), _box(view.holder), lens, view.section, view.widths
    )
    with progress_bar(shown=not as_json) as progress:
        found = camera.measure(path, seen, progress)
    for text in found.warnings:
        log(f"warning: {text}")
    if out is not None:
        jshell.io.write_trace(out, found.trace)
        log(f"wrote {out}")
    if contours is not None:
        camera.write_outlines(contours, found)
        log(f"wrote {contours}")
    if overlay is not None:
        jshell.plot.save(jshell.plot.outlines(path, found, lens), overlay)
        log(f"wrote {overlay}")
    record: dict[str, Any] = {"frames": len(found.outlines), "axis": found.axis, "warnings": list(found.warnings)}
    record |= {"lens": None if lens is None else {"k1": lens.k1, "k2": lens.k2, "rms": lens.rms}}
    for name, values in found.trace.channels.items():
        record[name] = {"mean": float(np.mean(values)), "sigma": float(np.median(found.trace.sigma[name]))}
    signature = jshell.signals.extract(found.trace, start=ringing.start, stop=ringing.stop) if ringing.analyse else None
    if as_json:
        print_json(record | ({} if signature is None else {"signature": signature.record()}))
    else:
        for name in found.trace.channels:
            typer.echo(f"{name}: mean {_described(record[name]['mean'], name, pixel, 6)}, ± "
                       f"{_described(record[name]['sigma'], name, pixel, 2)} a frame")  # fmt: skip
        if signature is not None:
            typer.echo(signature_table(signature))
    if signature is not None:
        for text in (signature.reason, *signature.notes, *signature.warnings):
            if text:
                log(text)
        finish(signature.outcome, sound=signature.sound)


def _described(number: float, name: str, pixel: float | None, digits: int) -> str:
    """A measured number in pixels, or in a unit of the laboratory's."""
    if pixel is None:  # the channels then have names of their own
        return f"{number:.{digits}g} px" + {"volume": "³", "area": "²"}.get(name, "")
    dimension = quantity(name).dimension
    unit = laboratory_unit(dimension, number)
    return f"{number / UNITS[unit][1]:.{digits}g} {unit.translate(POWERS)}"


def _angle(text: str) -> float | None:
    if text == "find":
        return None
    try:
        return float(text)
    except ValueError:
        raise BadValue("--axis", found=repr(text), expected="degrees, or find", remedy="90 is upright.") from None


def _box(text: str | None) -> tuple[int, int, int, int] | None:
    if text is None:
        return None
    parts = text.split(":")
    if len(parts) != 4 or not all(part.isdecimal() and len(part) < 10 for part in parts):
        raise BadValue("--holder", found=repr(text), expected="TOP:BOTTOM:LEFT:RIGHT", remedy="Count pixels from 0.")
    top, bottom, left, right = map(int, parts)
    return top, bottom, left, right
