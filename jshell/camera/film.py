"""The door: a film and what is known of the camera, to height and width in time, with their errors.

Each frame is outlined, straightened where a lens is known, and its hull measured
along the axis and across it. Frames without a shell are gaps; what spoils a
frame is said in words.

Symbols    H height along the axis   W width across it
Source     Mokbel et al. 2021, section "Experiments"
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jshell.camera.distortion import Lens
from jshell.camera.forms import Film
from jshell.camera.frames import open_film
from jshell.camera.hull import axis_of, extent
from jshell.camera.outline import SATURATED, Outline, find_outline
from jshell.camera.revolution import Revolved, revolved
from jshell.camera.widths import SHARES, widths
from jshell.errors import BadValue, UnusableData
from jshell.io.columns import SECONDS
from jshell.trace import Trace, Values

TILT = np.radians(20)  # how far from upright an axis is looked for
CLEAR = 0.2  # contrast of a mirror axis that is one
EVEN = 0.05  # of a step: times that lie nearer to whole steps are whole steps
OFF = 1e-3  # relative difference of a rate given from the film's own that is worth a word
TOLD = np.radians(2)  # tilt that is worth a word
FEWEST = 2  # frames with a shell


@dataclass(frozen=True)
class View:
    """What is known of the camera.

    Attributes:
        rate: Frames per second; None takes the film's own.
        pixel: Size of a pixel at the shell [m]; None leaves lengths in pixels.
        dark: Whether the shell is darker than what surrounds it.
        axis: Direction of the axis from the picture's columns upward [degrees]; 90 is upright, None looks for it.
        holder: Rows and columns (first row, last row, first column, last column) of what holds the shell, left out.
        lens: The distortion that a picture of a grid showed.
        section: Whether the film shows a section along the axis, dimple and all, as a light sheet does: volume, area
            and poles of the outline turned about the axis are measured as well.
        widths: Measure the width at a quarter, half and three quarters of the height, too, from the end that the axis
            leads away from; a shell's is the end that does not buckle.
    """

    rate: float | int | None = None
    pixel: float | None = None
    dark: bool = True
    axis: float | int | None = 90.0
    holder: tuple[int, int, int, int] | None = None
    lens: Lens | None = None
    section: bool = False
    widths: bool = False


@dataclass(frozen=True)
class Filmed:
    """What a film shows.

    Attributes:
        trace: Height and width, with their errors: `H`, `W` in SI where the size of a pixel is known, else `height`
            and `width` in pixels. With widths also `W_25`, `W_50`, `W_75` (`width_25`, …). Of a section also `V`, `S`
            (`volume`, `area`) and the poles `upper` and `lower`.
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
    for name, number in (("rate", view.rate), ("pixel", view.pixel)):
        if number is not None and not 0 < number < np.inf:
            raise BadValue(f"view, {name}", found=str(number), expected="a number above 0", remedy="Check the camera.")
    if not isinstance(film, Film):
        with open_film(film) as found:
            return measure(found, view, progress)
    times, words = _times(film, view)
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
    angle, axis_words = _axis([outlines[k] for k in seen], view)
    sizes = np.array([_sizes(outlines[k], angle, view.widths) for k in seen])
    bodies = [revolved(outlines[k], angle) for k in seen] if view.section else []
    if any(body is None for body in bodies):
        kept = [i for i, body in enumerate(bodies) if body is not None]
        axis_words.append(f"{len(bodies) - len(kept)} outlines are not closed and are gaps")
        seen, sizes, bodies = [seen[i] for i in kept], sizes[kept], [bodies[i] for i in kept]
    words += axis_words + _warnings(film, outlines, burnt) + _smeared(film, times[seen], sizes, outlines)
    trace = _trace(times[seen], sizes, [body for body in bodies if body is not None], view)
    return Filmed(trace, tuple(outlines), float(np.degrees(angle)), tuple(words))


def _times(film: Film, view: View) -> tuple[Float[np.ndarray, "frames"], list[str]]:
    """When each frame was taken [s], and what is to be said of it."""
    own, words = film.times, []
    if own is None or len(own) < FEWEST:
        if view.rate is None:
            raise BadValue(
                "view, rate",
                found=f"nothing, and {film.name} does not hold it",
                expected="frames per second",
                remedy="Give the camera's.",
            )
        return np.arange(film.count) / float(view.rate), words
    steps = np.diff(own)
    if not np.all(steps > 0):
        raise BadValue(
            film.name,
            found="times that do not ascend",
            expected="ascending times",
            remedy="Convert the film with ffmpeg, or to pictures, and give its rate.",
        )
    # stamps are often rounded: frames are counted by the steps, and a step is the whole film's mean
    taken = np.rint(steps / np.median(steps))
    missing, step = int(np.sum(taken - 1)), float(own[-1] / np.sum(taken))
    # a film made slower for watching keeps its gaps, in the time of the camera
    numbers = own / step
    even = np.all(np.abs(numbers - np.rint(numbers)) < EVEN)
    numbers = np.rint(numbers) if even else numbers
    times = numbers * step if view.rate is None else numbers / float(view.rate)
    if missing:
        words.append(f"{missing} frames are missing from the film, by its own times")
    if view.rate is None:
        shown = f"{1 / step:.6g} frames per second, as the film says"
        slow = "; a high-speed camera's film is often written to be watched slower: give the camera's rate"
        words.append(shown + (slow if film.playback else ""))
    elif not film.playback and abs(step * float(view.rate) - 1) > OFF:
        words.append(f"{float(view.rate):.6g} frames per second as given; the film itself says {1 / step:.6g}")
    return times, words


def _smeared(film: Film, times: np.ndarray, sizes: np.ndarray, outlines: list[Outline | None]) -> list[str]:
    """Whether an edge moves by more than its blur while a frame is exposed."""
    if film.exposure is None or len(times) < 3:
        return []
    # the faster of the two, seen from the middle: either end moves at half the speed of the size
    speed = np.abs(np.gradient(sizes[:, [0, 2]], times, axis=0)).max() / 2
    blur = float(np.median([one.blur for one in outlines if one is not None]))
    moved = speed * film.exposure
    if moved <= max(blur, 0.5):
        return []
    return [f"the edge moves by {moved:.2g} px while a frame is exposed: its fastest frames are smeared"]


def _outlined(frame: Float[np.ndarray, "rows columns"], view: View) -> Outline | None:
    if view.holder is not None:
        top, bottom, left, right = view.holder
        frame = frame.copy()
        frame[top : bottom + 1, left : right + 1] = np.nan
    found = find_outline(frame, dark=view.dark)
    if found is None or view.lens is None:
        return found
    return replace(found, points=view.lens.straight(found.points))


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


def _sizes(outline: Outline, angle: float, more: bool) -> list[float]:
    found = [extent(outline, angle), extent(outline, angle + np.pi / 2), *(widths(outline, angle) if more else ())]
    return [number for one in found for number in (one.value, one.sigma)]


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


# Names in SI and in pixels, and the power of a length that each is.
SIZES = (("H", "height", 1), ("W", "width", 1))
ACROSS = tuple((f"W_{round(100 * share)}", f"width_{round(100 * share)}", 1) for share in SHARES)
BODY = (("V", "volume", 3), ("S", "area", 2), ("upper", "upper", 1), ("lower", "lower", 1))


def _trace(times: np.ndarray, sizes: Float[np.ndarray, "frames numbers"], bodies: list[Revolved], view: View) -> Trace:
    columns = [(sizes[:, k], sizes[:, k + 1]) for k in range(0, sizes.shape[1], 2)]
    columns += [tuple(np.array([[one[k].value, one[k].sigma] for one in bodies]).T) for k in range(4) if bodies]
    names = SIZES + (ACROSS if view.widths else ()) + (BODY if bodies else ())
    channels: dict[str, Values] = {}
    sigma: dict[str, Values] = {}
    units = []
    for (name, pixels, power), (value, error) in zip(names, columns, strict=True):
        name, factor = (pixels, 1.0) if view.pixel is None else (name, float(view.pixel) ** power)
        channels[name], sigma[name] = factor * value, factor * error
        # units of their own are only said of what a file's head does not know
        if view.pixel is None:
            units.append(f"{name}: px" + ("" if power == 1 else f"{power}"))
        elif name in ("upper", "lower"):
            units.append(f"{name}: m")
    own = (("channel_units", "; ".join(units)),) if units else ()
    return Trace(times, channels, None, sigma, settings=own, scales=SECONDS)
