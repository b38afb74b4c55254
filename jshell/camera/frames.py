"""A film is opened by its suffix: TIFF stacks here."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from jshell.camera.forms import EXTRA, Film, check_form, grey, white_of
from jshell.camera.high_speed import HEADERS, phantom, photron
from jshell.camera.pictures import folder, packed
from jshell.camera.videos import VIDEOS, video
from jshell.errors import BadFile, BadName, require_extra
from jshell.io.files import SPOILED, check_file, spoiled

STACKS = (".tif", ".tiff")
FILMS = (*STACKS, *VIDEOS, ".cine")  # of one file


def open_film(path: str | Path) -> Film:
    """A film, of which nothing but its form has been read.

    Args:
        path: A TIFF stack, a folder or a .zip of PNG or TIFF pictures, a video (`.avi`, `.mp4`, …), or the film of a
            high-speed camera: Photron's `.cihx` or `.cih` with `.mraw`, Phantom's `.cine`.

    Raises:
        BadFile: No film, frames of different sizes, or too large.
        BadName: A suffix of no film.
        MissingExtra: The extra `camera` is not installed.
    """
    path = Path(path)
    if path.is_dir():
        return folder(path)
    check_file(path)
    readers = dict.fromkeys(STACKS, _stack) | dict.fromkeys(VIDEOS, video) | dict.fromkeys(HEADERS, photron)
    reader = (readers | {".cine": phantom, ".zip": packed}).get(path.suffix.lower())
    if reader is None:
        raise BadName(
            str(path),
            found=f"the suffix {path.suffix}",
            expected="a folder of pictures, or one of " + ", ".join((*readers, ".cine", ".zip")),
            remedy="Export the film as a TIFF stack or as numbered PNG pictures; ImageJ and ffmpeg do.",
        )
    return reader(path)


def _stack(path: Path) -> Film:
    library = require_extra("tifffile", EXTRA, "TIFF films")
    file = None
    try:
        file = library.TiffFile(path)
        pages = file.pages
        count, shape = len(pages), tuple(pages[0].shape)
        check_form(str(path), count, shape)
    except BadFile:
        file.close() if file is not None else None
        raise
    except (*SPOILED, library.TiffFileError) as error:
        file.close() if file is not None else None
        raise spoiled(str(path), "TIFF film", error) from None

    def read(number: int) -> Float[np.ndarray, "rows columns"]:
        place = f"{path}, frame {number + 1}"
        try:
            page = pages[number]
            check_form(place, count, tuple(page.shape))
            frame = page.asarray()
        except BadFile:
            raise
        except SPOILED as error:
            raise spoiled(place, "TIFF picture", error) from None
        return grey(place, frame, (int(shape[0]), int(shape[1])))

    try:
        most = float(read(0).max())
    except BadFile:
        file.close()
        raise
    size = (int(shape[0]), int(shape[1]))
    times = _imagej_times(file.imagej_metadata, count)
    return Film(str(path), count, size, white_of(pages[0].dtype, most), read, file.close, times)


def _imagej_times(metadata: object, count: int) -> Float[np.ndarray, "frames"] | None:
    """When the frames of an ImageJ stack were taken, by the interval that its head tells; None where it does not."""
    step = metadata.get("finterval") if isinstance(metadata, dict) else None
    seconds = isinstance(metadata, dict) and str(metadata.get("tunit", "s")).strip() in (
        "s",
        "sec",
        "second",
        "seconds",
    )
    if not seconds or not isinstance(step, int | float) or not 0 < step < np.inf:
        return None
    return float(step) * np.arange(count)
