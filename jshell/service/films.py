"""Films as jobs: a first look at one, and its measurement. What a client sends is decoded in the job's own process.

An upload lies in a folder of its own while the job lasts, since FFmpeg and the TIFF reader want a path.
"""

import io as streams
import tempfile
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePath, PurePosixPath
from typing import Any

import numpy as np

from jshell import camera, io, plot, signals
from jshell.camera.forms import EXTRA, Film
from jshell.camera.frames import FILMS
from jshell.camera.outline import Outline, find_outline
from jshell.camera.pictures import is_picture
from jshell.errors import BadFile, JshellError, require_extra
from jshell.io.files import SPOILED, bytes_written
from jshell.io.zip_files import Content
from jshell.service.encoding import as_json

SIDE = 900  # pixels of the first look's longer side at most
POINTS = 400  # of an outline on the page at most
Files = Sequence[tuple[str, Content]]


def is_film(name: str, content: bytes) -> bool:
    """Whether an upload is a film: by its suffix, or a .zip that holds pictures and nothing else."""
    suffix = PurePath(name).suffix.lower()
    if suffix != ".zip":
        return suffix in FILMS
    try:
        with zipfile.ZipFile(streams.BytesIO(content)) as archive:
            held = [PurePosixPath(one) for one in archive.namelist() if not one.endswith("/")]
    except SPOILED:
        return False
    return any(map(is_picture, held)) and all(is_picture(one) or _is_beside(one) for one in held)


def _is_beside(name: PurePosixPath) -> bool:
    """What systems put beside pictures."""
    return name.name.startswith(".") or "__MACOSX" in name.parts or name.name.lower() == "thumbs.db"


def look(specification: Mapping[str, Any], files: Files) -> dict[str, bytes]:
    """The first frame of a film, and what the film says of itself.

    Returns:
        `look.json`: `frames`, `rows`, `columns`, `rate` (None where it does not know), `playback`, `bright`, and
        `outline`, columns and rows of what is taken for the shell, None where nothing is; `frame.png`.

    Raises:
        JshellError: As `jshell.camera.open_film`.
    """
    with _written(files) as (path, _), camera.open_film(path) as film:
        frame = film.read(0)
        bright, outline = _found(frame)
        points = None if outline is None else outline.points[:: -(-len(outline.points) // POINTS)]
        facts = {
            "frames": film.count,
            "rows": film.shape[0],
            "columns": film.shape[1],
            "rate": _rate(film),
            "playback": film.playback,
            "bright": bright,
            "outline": None if points is None else np.round(points, 2).tolist(),
        }
        return {"look.json": as_json(facts), "frame.png": _png(frame)}


def film(specification: Mapping[str, Any], files: Files) -> dict[str, bytes]:
    """Height and width in time of the shell that a film shows, and their frequencies.

    Args:
        specification: `rate`, `pixel`, `bright`, `axis` (None looks for it), `holder`, `section` as of
            `jshell.camera.View`; `start`, `stop` [s] of the analysis; `grid`, whether a second file shows one.
        files: The film, and the picture of a grid.

    Returns:
        `film.json`, what was found; `trace.json`, `trace.csv`; `overlay.png`, frames with their outlines;
        `outlines.nc`.

    Raises:
        JshellError: As `jshell.camera.measure`.
    """
    asked = dict(specification)
    with _written(files) as (path, grid):
        lens = camera.lens_from_grid(grid) if asked.get("grid") and grid is not None else None
        view = camera.View(
            asked.get("rate"), asked.get("pixel"), not asked.get("bright"), asked.get("axis", 90.0),
            tuple(asked["holder"]) if asked.get("holder") else None, lens, bool(asked.get("section")),
        )  # fmt: skip
        with camera.open_film(path) as opened:
            found = camera.measure(opened, view)
            with plot.style():
                strip = streams.BytesIO()
                plot.outlines(opened, found, lens).savefig(strip, format="png")
        outlines = bytes_written("outlines.nc", lambda path: camera.write_outlines(path, found))
    record = {
        "frames": len(found.outlines),
        "axis": found.axis,
        "warnings": found.warnings,
        "lens": None if lens is None else {"k1": lens.k1, "k2": lens.k2, "rms": lens.rms},
        "channels": {
            name: {"mean": float(np.mean(values)), "sigma": float(np.median(found.trace.sigma[name]))}
            for name, values in found.trace.channels.items()
        },
        "signature": _signature(found, asked.get("start"), asked.get("stop")),
    }
    traces = {name: bytes(io.encode_trace(name, found.trace).content) for name in ("trace.json", "trace.csv")}
    return {"film.json": as_json(record), "overlay.png": strip.getvalue(), "outlines.nc": outlines, **traces}


@contextmanager
def _written(files: Files) -> Iterator[tuple[Path, Path | None]]:
    """The film, and what came with it, on the disk; errors call them by their own names."""
    with tempfile.TemporaryDirectory(prefix="jshell-film-") as folder:
        paths = []
        for number, (name, content) in enumerate(files):
            own = Path(folder) / str(number)  # two files may have one name
            own.mkdir()
            paths.append(own / PurePath(name).name)
            paths[-1].write_bytes(content)
        try:
            yield paths[0], paths[1] if len(paths) > 1 else None
        except JshellError as error:
            if type(error).__init__ is not JshellError.__init__:
                raise
            place, *words = (error.place, error.found, error.expected, error.remedy)
            for path in paths:
                place, *words = (text.replace(str(path), path.name) for text in (place, *words))
            raise type(error)(place, found=words[0], expected=words[1], remedy=words[2]) from None


def _found(frame: np.ndarray) -> tuple[bool, Outline | None]:
    """Whether the shell is bright, and its outline: what lies within the picture is one, its border's grey is not."""
    both = [find_outline(frame, dark=dark) for dark in (True, False)]
    inner = [one is not None and not one.cut for one in both]
    bright = inner[1] and not inner[0]
    return bright, both[int(bright)]


def _rate(film: Film) -> float | None:
    if film.times is None or len(film.times) < 2:
        return None
    step = float(np.median(np.diff(film.times)))
    return 1 / step if step > 0 else None


def _png(frame: np.ndarray) -> bytes:
    """A frame for the page, its own darkest and brightest grey as black and white."""
    library = require_extra("PIL.Image", EXTRA, "pictures")
    low, high = float(np.nanmin(frame)), float(np.nanmax(frame))
    if not high > low:
        raise BadFile(
            "frame 1", found="one grey everywhere", expected="a picture of a shell", remedy="Cut the film to it."
        )
    few = -(-max(frame.shape) // SIDE)
    shown = library.fromarray(np.round(255 * (frame[::few, ::few] - low) / (high - low)).astype(np.uint8))
    file = streams.BytesIO()
    shown.save(file, format="PNG")
    return file.getvalue()


def _signature(found: camera.Filmed, start: float | None, stop: float | None) -> dict[str, Any]:
    """The frequencies identified; a film that cannot carry them keeps its numbers."""
    try:
        return signals.extract(found.trace, start=start, stop=stop).record()
    except JshellError as error:
        return {"outcome": error.code, "reason": str(error), "warnings": (), "notes": (), "stderr": {}}
