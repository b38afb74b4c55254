"""Where a verb writes: its options, and their refusal before any work is done."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

import jshell
from jshell.cli.output import log
from jshell.errors import BadFile, BadName

if TYPE_CHECKING:
    from jshell.trace import Trace

PICTURES = (".png", ".pdf", ".svg")  # `plot.style.FORMATS`, which help need not wait for

OutFile = Annotated[Path | None, typer.Option("--out", help="Trace to write: CSV, JSON, .npz, NetCDF or .mat.")]
Picture = Annotated[Path | None, typer.Option("--plot", help="Picture to write: png, pdf or svg.")]


def writable(path: Path | None, option: str, endings: Sequence[str] = ()) -> None:
    """Refuse a path where nothing can be written; None, an option not given, is fine.

    Args:
        path: Where a file shall stand.
        option: The option that named it.
        endings: Suffixes that it may have; none named allows all.

    Raises:
        BadFile: Its folder does not exist, or it is a folder itself.
        BadName: Another suffix.
    """
    if path is None:
        return
    if not path.parent.is_dir() or path.is_dir():
        found = "a folder" if path.is_dir() else f"no folder {path.parent}"
        raise BadFile(option, found=found, expected="a file in a folder that exists", remedy="Check the path.")
    if endings and path.suffix.lower() not in endings:
        ways = " or ".join(endings)
        raise BadName(option, found=path.name, expected=f"a name that ends in {ways}", remedy="Rename it.")


def drawable(plot: Path | None, option: str = "--plot") -> None:
    """Refuse a picture that could not be written."""
    writable(plot, option, PICTURES)


def traceable(out: Path | None) -> None:
    """Refuse a trace's file that could not be written."""
    writable(out, "--out")
    if out is not None:
        jshell.io.check_suffix(out, "--out")


def write_finite(out: Path, trace: "Trace", units: str = "reduced") -> None:
    """Write the samples before the first that is no number; its outcome says that a run ended there.

    Nothing is written, and that is said, where fewer than two samples are numbers.
    """
    sound = np.all([np.isfinite(np.asarray(values, dtype=float)) for values in trace.channels.values()], axis=0)
    kept = sound.size if sound.all() else int(np.argmin(sound))
    if kept < 2:
        log(f"nothing written to {out}: the run holds no numbers")
        return
    if kept < sound.size:
        log(f"{out}: the {kept} samples before the first that is no number")
        trace = trace.between(None, float(np.asarray(trace.times)[kept - 1]))
    jshell.io.write_trace(out, trace, units=units)
