"""The door: a film and what is known of the camera, to height and width in time, with their errors.

Each frame is outlined, straightened where a lens is known, and its hull measured
along the axis and across it. Frames without a shell are gaps; what spoils a
frame is said in words.

Symbols    H height along the axis   W width across it
Source     Mokbel et al. 2021, section "Experiments"
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jshell.camera.distortion import Lens
from jshell.camera.frames import Film, open_film
from jshell.camera.hull import axis_of, extent
from jshell.camera.outline import SATURATED, Outline, find_outline
from jshell.errors import BadValue, UnusableData
from jshell.io.columns import SECONDS
from jshell.trace import Trace, Values

TILT = np.radians(20)  # how far from upright an axis is looked for
CLEAR = 0.2  # contrast of a mirror axis that is one
TOLD = np.radians(2)  # tilt that is worth a word
FEWEST = 2  # frames with a shell


@dataclass(frozen=True)
class View:
    """What is known of the camera.

    Attributes:
        rate: Frames per second.
        pixel: Size of a pixel at the shell [m]; None leaves lengths in pixels.
        dark: Whether the shell is darker than what surrounds it.
        axis: Direction of the axis from the picture's columns upward [degrees]; 90 is upright, None looks for it.
        holder: Rows and columns (first row, last row, first column, last column) of what holds the shell, left out.
        lens: The distortion that a picture of a grid showed.
    """

    rate: float | int
    pixel: float | None = None
    dark: bool = True
    axis: float | int | None = 90.0
    holder: tuple[int, int, int, int] | None = None
    lens: Lens | None = None


@dataclass(frozen=True)
class Filmed:
    """What a film shows.

    Attributes:
        trace: Height and width, with their errors: `H`, `W` in SI where the size of a pixel is known, else `height`
            and `width` in pixels.
        outlines: Of every frame, None where it shows no shell.
        axis: Direction of the axis that was used [degrees].
        warnings: What spoils the film, in words.
    """

    trace: Trace
    outlines: tuple[Outline | None, ...]
    axis: float
    warnings: tuple[str, ...]


def measure(film: Film | str | Path, view: View, progress: Callable[[float], None] | None = None) -> Filmed:
    """Height and width of the shell in every frame of a film.

    Args:
        film: A film, or where it lies.
        view: What is known of the camera.
        progress: Called with the part that is done, from 0 to 1.

    Raises:
        BadFile, BadName: As `open_film`.
        BadValue: A rate or a size that is no positive number.
        MissingExtra: The extra `camera` is not installed.
        UnusableData: Fewer than two frames with a shell.
    """
    for name, number in (("rate", view.rate), ("pixel", 1.0 if view.pixel is None else view.pixel)):
        if not 0 < number < np.inf:
            raise BadValue(f"view, {name}", found=str(number), expected="a number above 0", remedy="Check the camera.")
    if not isinstance(film, Film):
        with open_film(film) as found:
            return measure(found, view, progress)
    outlines, burnt = [], 0
    for number in range(film.count):
        frame = film.read(number)
        burnt += bool(np.mean(frame >= film.white) > SATURATED)
        outlines.append(_outlined(frame, view))
        if progress is not None:
            progress((number + 1) / film.count)
    seen = [k for k, one in enumerate(outlines) if one is not None]
    if len(seen) < FEWEST:
        raise UnusableData(
            film.name,
            found=f"a shell in {len(seen)} of {film.count} frames",
            expected=f"at least {FEWEST}",
            remedy="Say whether it is dark or bright; mask the holder.",
        )
    angle, words = _axis([outlines[k] for k in seen], view)
    sizes = np.array([_sizes(outlines[k], angle) for k in seen])
    words += _warnings(film, outlines, burnt)
    return Filmed(_trace(np.array(seen), sizes, view), tuple(outlines), float(np.degrees(angle)), tuple(words))


def _outlined(frame: Float[np.ndarray, "rows columns"], view: View) -> Outline | None:
    if view.holder is not None:
        top, bottom, left, right = view.holder
        frame = frame.copy()
        frame[top : bottom + 1, left : right + 1] = np.nan
    found = find_outline(frame, dark=view.dark)
    if found is None or view.lens is None:
        return found
    return Outline(view.lens.straight(found.points), found.sigma, found.correlation, found.blur, found.cut)


def _axis(outlines: list[Outline], view: View) -> tuple[float, list[str]]:
    """The direction of the axis, and what is to be said of it."""
    found = [axis_of(one.points, TILT) for one in outlines]
    clear = [angle for angle, contrast in found if contrast > CLEAR]
    mirror = float(np.median(clear)) if 2 * len(clear) > len(found) else None
    if view.axis is None:
        words = [] if mirror is not None else ["no axis is seen, the outline is too round: taken as upright"]
        return (np.pi / 2 if mirror is None else mirror), words
    given = float(np.radians(view.axis))
    if mirror is not None and abs(mirror - given) > TOLD:
        return given, [f"the outline mirrors itself about {np.degrees(mirror):.1f}°, not about the axis given"]
    return given, []


def _sizes(outline: Outline, angle: float) -> tuple[float, float, float, float]:
    along, across = extent(outline, angle), extent(outline, angle + np.pi / 2)
    return along.value, along.sigma, across.value, across.sigma


def _warnings(film: Film, outlines: list[Outline | None], burnt: int) -> list[str]:
    gone = [k + 1 for k, one in enumerate(outlines) if one is None]
    cut = [k + 1 for k, one in enumerate(outlines) if one is not None and one.cut]
    words = []
    if gone:
        words.append(f"{len(gone)} frames show no shell and are gaps, the first is {gone[0]}")
    if cut:
        words.append(f"the shell leaves the picture in {len(cut)} frames, the first is {cut[0]}")
    if burnt:
        words.append(f"{burnt} of {film.count} frames are saturated: an edge beside white lies too far out")
    return words


def _trace(seen: np.ndarray, sizes: Float[np.ndarray, "frames 4"], view: View) -> Trace:
    factor = 1.0 if view.pixel is None else view.pixel
    names = ("height", "width") if view.pixel is None else ("H", "W")
    own = (("channel_units", "; ".join(f"{name}: px" for name in names)),) if view.pixel is None else ()
    channels: dict[str, Values] = {name: factor * sizes[:, 2 * k] for k, name in enumerate(names)}
    sigma: dict[str, Values] = {name: factor * sizes[:, 2 * k + 1] for k, name in enumerate(names)}
    return Trace(seen / float(view.rate), channels, None, sigma, settings=own, scales=SECONDS)
