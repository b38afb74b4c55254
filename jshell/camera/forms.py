"""What a film is: frames of one size, read one at a time, and when they were taken.

What a file claims to hold is compared with what one can hold before a pixel is read.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from jshell.errors import BadFile

EXTRA = "camera"  # what brings the libraries
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
        times: When each frame was taken, from the first [s]; None where the film does not know.
        exposure: How long a frame was exposed [s]; None where the film does not know.
        playback: Whether `times` are those of playing it, which a high-speed camera's need not be.
    """

    name: str
    count: int
    shape: tuple[int, int]
    white: float
    read: Callable[[int], Float[np.ndarray, "rows columns"]]
    close: Callable[[], None] = lambda: None
    times: Float[np.ndarray, "frames"] | None = None
    exposure: float | None = None
    playback: bool = False

    def __enter__(self) -> "Film":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[Float[np.ndarray, "rows columns"]]:
        return (self.read(number) for number in range(self.count))


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


def check_form(place: str, count: int, shape: tuple[int, ...]) -> None:
    """Refuse what no film is, before memory is asked for.

    Raises:
        BadFile: No frames or too many, too few pixels or too many.
    """
    pixels = float(np.prod([float(size) for size in shape[:2]]))
    if count < 1 or count > MOST_FRAMES or pixels > MOST_PIXELS or pixels < 64:
        raise BadFile(
            place,
            found=f"{count} frames of {pixels:.4g} pixels",
            expected=f"1 to {MOST_FRAMES} frames of 64 to {MOST_PIXELS} pixels",
            remedy="Cut the film, or check how it was written.",
        )
