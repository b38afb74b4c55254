"""`jshell film`: height and width of a shell from a film of it, and on to its frequencies in one command."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import jshell
from jshell.cli.destinations import drawable, traceable
from jshell.cli.output import Json, finish, log, say, speaking
from jshell.cli.problem import with_options
from jshell.cli.traces import signature_table, told
from jshell.errors import BadValue


@dataclass(frozen=True)
class ViewOptions:
    """What the camera saw."""

    rate: Annotated[float | None, typer.Option(help="Frames per second; without it, the film's own.")] = None
    pixel: Annotated[float | None, typer.Option(help="Size of a pixel at the shell [m]; without it, pixels.")] = None
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


@dataclass(frozen=True)
class RingingOptions:
    """Whether frequencies are sought, and in which window."""

    analyse: Annotated[bool, typer.Option("--analyse", help="Go on to frequencies and decay time.")] = False
    start: Annotated[float | None, typer.Option("--from", help="Window's start [s].")] = None
    stop: Annotated[float | None, typer.Option("--to", help="Window's end [s].")] = None


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
    with told(shown=not as_json) as progress:
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
        say(record | ({} if signature is None else {"signature": signature.record()}))
    else:
        for name in found.trace.channels:
            unit = ("px" if pixel is None else "m") + {"V": "³", "volume": "³", "S": "²", "area": "²"}.get(name, "")
            typer.echo(f"{name}: mean {record[name]['mean']:.6g} {unit}, ± {record[name]['sigma']:.2g} {unit} a frame")
        if signature is not None:
            typer.echo(signature_table(signature))
    if signature is not None:
        for text in (signature.reason, *signature.notes, *signature.warnings):
            if text:
                log(text)
        finish(signature.outcome, sound=signature.sound)


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
    if len(parts) != 4 or not all(part.isdigit() for part in parts):
        raise BadValue("--holder", found=repr(text), expected="TOP:BOTTOM:LEFT:RIGHT", remedy="Count pixels from 0.")
    top, bottom, left, right = map(int, parts)
    return top, bottom, left, right
