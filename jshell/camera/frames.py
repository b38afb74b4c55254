"""The frames of a film, one at a time: a TIFF stack, or a folder of pictures in the order of their names.

What a file claims to hold is compared with what one can hold before a pixel is read.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from jshell.errors import BadFile, BadName, require_extra
from jshell.io.files import SPOILED, check_file, spoiled

EXTRA = "camera"
STACKS = (".tif", ".tiff")
PICTURES = (".png", ".tif", ".tiff", ".bmp", ".pgm")
MOST_PIXELS = 2**26  # of one frame
MOST_FRAMES = 10**6


@dataclass(frozen=True)
class Film:
    """A film that is open for reading.

    Attributes:
        name: Of the file or folder.
        count: Frames.
        shape: Rows and columns of each.
        white: The largest grey value that its numbers can hold: 255, 4095, 65535, …
        read: The frame of a number, from zero.
        close: Close its file.
    """

    name: str
    count: int
    shape: tuple[int, int]
    white: float
    read: Callable[[int], Float[np.ndarray, "rows columns"]]
    close: Callable[[], None] = lambda: None

    def __enter__(self) -> "Film":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[Float[np.ndarray, "rows columns"]]:
        return (self.read(number) for number in range(self.count))


def open_film(path: str | Path) -> Film:
    """A film, of which nothing but its form has been read.

    Args:
        path: A TIFF stack, or a folder of PNG or TIFF pictures.

    Raises:
        BadFile: No film, frames of different sizes, or too large.
        BadName: A suffix of no film.
        MissingExtra: The extra `camera` is not installed.
    """
    path = Path(path)
    if path.is_dir():
        return _folder(path)
    check_file(path)
    if path.suffix.lower() not in STACKS:
        raise BadName(
            str(path),
            found=f"the suffix {path.suffix}",
            expected="a folder of pictures, or one of " + ", ".join(STACKS),
            remedy="Export the film as a TIFF stack or as numbered PNG pictures; ImageJ and ffmpeg do.",
        )
    return _stack(path)


def grey(place: str, frame: Any, shape: tuple[int, int] | None = None) -> Float[np.ndarray, "rows columns"]:
    """A frame as grey values; of colours, their mean.

    Raises:
        BadFile: No picture, or one of another size than the first.
    """
    values = np.asarray(frame)
    if values.ndim == 3 and values.shape[2] in (2, 3, 4):
        values = values[..., : 3 if values.shape[2] > 2 else 1].mean(axis=2)
    if values.ndim != 2 or values.dtype.kind not in "uif" or (shape is not None and values.shape != shape):
        raise BadFile(
            place,
            found=f"an array of {values.dtype} of shape {values.shape}",
            expected="a grey picture" + ("" if shape is None else f" of {shape[0]} × {shape[1]}"),
            remedy="Export the film again.",
        )
    return values.astype(np.float64)


def white_of(dtype: np.dtype, most: float) -> float:
    """The largest value of a camera's numbers: of integers, the power of two that holds those of the first frame."""
    if dtype.kind == "f":
        return 1.0 if most <= 1 else float(most)
    if dtype.itemsize == 1:
        return 255.0
    bits = next((bits for bits in (10, 12, 14) if most < 2**bits), 8 * dtype.itemsize)
    return float(2**bits - 1)


def _check(place: str, count: int, shape: tuple[int, ...]) -> None:
    pixels = float(np.prod([float(size) for size in shape[:2]]))
    if count < 1 or count > MOST_FRAMES or pixels > MOST_PIXELS or pixels < 64:
        raise BadFile(
            place,
            found=f"{count} frames of {pixels:.4g} pixels",
            expected=f"1 to {MOST_FRAMES} frames of 64 to {MOST_PIXELS} pixels",
            remedy="Cut the film, or check how it was written.",
        )


def _stack(path: Path) -> Film:
    library = require_extra("tifffile", EXTRA, "TIFF films")
    file = None
    try:
        file = library.TiffFile(path)
        pages = file.pages
        count, shape = len(pages), tuple(pages[0].shape)
        _check(str(path), count, shape)
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
            _check(place, count, tuple(page.shape))
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
    return Film(str(path), count, size, white_of(pages[0].dtype, most), read, file.close)


def _folder(path: Path) -> Film:
    library = require_extra("PIL.Image", EXTRA, "pictures")
    names = sorted((one for one in path.iterdir() if one.suffix.lower() in PICTURES), key=_numbered)
    if not names:
        raise BadFile(
            str(path),
            found="no pictures",
            expected="pictures " + ", ".join(PICTURES),
            remedy="Name the folder that holds the frames.",
        )

    def raw(number: int) -> np.ndarray:
        place = str(names[number])
        try:
            with library.open(names[number]) as picture:
                _check(place, len(names), picture.size)
                return np.asarray(picture)
        except BadFile:
            raise
        except (*SPOILED, library.DecompressionBombError, library.DecompressionBombWarning) as error:
            raise spoiled(place, "picture", error) from None

    first = raw(0)
    shape = (int(first.shape[0]), int(first.shape[1]))
    read = lambda number: grey(str(names[number]), raw(number), shape)  # noqa: E731
    return Film(str(path), len(names), shape, white_of(first.dtype, float(first.max())), read)


def _numbered(path: Path) -> tuple[list[int], str]:
    """Pictures in the order of the numbers in their names: 2 before 10."""
    return [int(part) for part in re.findall(r"\d{1,18}", path.stem)], path.name


def one_picture(path: Path) -> Float[np.ndarray, "rows columns"]:
    """A single picture as grey values.

    Raises:
        BadFile: No picture, or too large.
        MissingExtra: The extra `camera` is not installed.
    """
    check_file(path)
    library = require_extra("PIL.Image", EXTRA, "pictures")
    try:
        with library.open(path) as picture:
            _check(str(path), 1, picture.size)
            return grey(str(path), np.asarray(picture))
    except BadFile:
        raise
    except (*SPOILED, library.DecompressionBombError, library.DecompressionBombWarning) as error:
        raise spoiled(str(path), "picture", error) from None
