"""The outline of a shell in one frame, to a fraction of a pixel, and how sharp its edge is.

The frame is smoothed by a Gaussian, cut at the grey value half way between the
shell and what surrounds it, and the largest closed line is the outline.

Symbols    s width of the smoothing [px]   σ_n noise of a pixel   g gradient at the edge [1/px]
Source     Mokbel et al. 2021, section "Experiments": contours of the film's frames
"""

from dataclasses import dataclass

import numpy as np
import scipy.ndimage
import scipy.special
from jaxtyping import Bool, Float

from jshell.camera.forms import EXTRA
from jshell.errors import require_extra

SMOOTHING = 1.0  # px
STRAIGHT = 0.98  # of the way from the edge's middle to its ends, as far as its form is undone
SMALLEST = 12.0  # px across: smaller outlines are specks
SATURATED = 0.01  # of the pixels at white or black beside the edge: worth a word
EDGE = 3.0  # slopes above so many times the median are the edge's: noise alone goes there once in 500
SPOILED = 2  # px from a mask
ENOUGH = 128  # pixels of a side, from which grey values are taken
CONTRAST = 6.0  # noise levels that the edge must rise above


@dataclass(frozen=True)
class Outline:
    """An outline.

    Attributes:
        points: (points, 2) columns and rows [px], along the edge, closed.
        sigma: Standard error of a point across the edge [px].
        correlation: How far errors along the edge go together [px].
        blur: Width of blur and smoothing at the edge, as of a Gaussian [px].
        cut: Whether it leaves the picture.
        own: Which points are the shell's own, not a masked holder's; None, all.
    """

    points: Float[np.ndarray, "points 2"]
    sigma: float
    correlation: float
    blur: float
    cut: bool
    own: Bool[np.ndarray, "points"] | None = None


def find_outline(frame: Float[np.ndarray, "rows columns"], *, dark: bool = True) -> Outline | None:
    """The outline of the shell in a frame; None where there is no shell.

    Args:
        frame: Grey values; NaN where the holder is masked.
        dark: Whether the shell is darker than what surrounds it.
    """
    measure = require_extra("skimage.measure", EXTRA, "outlines")
    filters = require_extra("skimage.filters", EXTRA, "outlines")
    masked = ~np.isfinite(frame)
    values = _filled(frame, masked)
    values = -values if dark else values
    smooth = filters.gaussian(values, SMOOTHING, preserve_range=True)
    # grey values of the whole are known well enough from some of its pixels
    few = max(1, int(np.sqrt(frame.size)) // ENOUGH)
    some = smooth[::few, ::few]
    noise = _noise(frame, smooth, few) / (2 * np.sqrt(np.pi) * SMOOTHING)  # white noise behind a Gaussian
    low, high = np.percentile(some, [1, 99])
    if high - low <= CONTRAST * noise or high <= low:
        return None
    split = float(filters.threshold_otsu(some))
    inside, outside = float(np.median(some[some > split])), float(np.median(some[some <= split]))
    if inside - outside <= CONTRAST * noise:
        return None
    smooth = np.where(masked, outside, smooth) if masked.any() else smooth
    # the edge of a blurred body is an error function; undone, it is as straight as what interpolates between pixels
    level = np.clip(2 * (smooth - (inside + outside) / 2) / (inside - outside), -STRAIGHT, STRAIGHT)
    edge = np.abs(level) < STRAIGHT
    level[edge] = scipy.special.erfinv(level[edge])
    lines = measure.find_contours(level, 0.0)
    lines = [line for line in lines if np.ptp(line, axis=0).max() >= SMALLEST]
    if not lines:
        return None
    points = max(lines, key=lambda line: abs(_area(line)))[:, ::-1]
    closed = bool(np.allclose(points[0], points[-1]))
    rows, columns = frame.shape
    beside = (points <= 1).any() or (points[:, 0] >= columns - 2).any() or (points[:, 1] >= rows - 2).any()
    at = np.clip(np.round(points).astype(int), 1, [columns - 2, rows - 2])
    x, y = at.T
    gradient = float(np.median(np.hypot(smooth[y, x + 1] - smooth[y, x - 1], smooth[y + 1, x] - smooth[y - 1, x]))) / 2
    if gradient <= 0:
        return None
    # a Gaussian edge is √(2π) of its widths wide; differences of neighbours but one widen it by 1/3
    width = ((inside - outside) / gradient) ** 2 / (2 * np.pi) - 1 / 3
    correlation = 2 * np.sqrt(np.pi) * SMOOTHING  # of noise behind a Gaussian: exp(-d²/4s²), integrated
    # what stands for a holder spoils what is smoothed with it
    own = None
    if masked.any():
        spoiled = np.asarray(scipy.ndimage.binary_dilation(masked, iterations=SPOILED), bool)
        own = np.logical_not(spoiled[y, x])
    blur = float(np.sqrt(max(width, 0.0)))
    return Outline(points, noise / gradient, correlation, blur, bool(beside) or not closed, own)


def _filled(frame: Float[np.ndarray, "rows columns"], masked: Bool[np.ndarray, "rows columns"]) -> np.ndarray:
    """A frame whose masked pixels have the value of the nearest that is not."""
    if not masked.any() or masked.all():
        return np.where(masked, 0.0, frame)
    nearest = np.asarray(scipy.ndimage.distance_transform_edt(masked, return_distances=False, return_indices=True))
    return frame[nearest[0], nearest[1]]


def _noise(frame: Float[np.ndarray, "rows columns"], smooth: Float[np.ndarray, "rows columns"], few: int) -> float:
    """Standard deviation of a pixel's noise off the edge, from second differences, which slopes do not reach."""
    across, upper, lower = (smooth[k : frame.shape[0] - 2 + k : few] for k in (1, 0, 2))
    slope = np.hypot(across[:, 2:] - across[:, :-2], (lower - upper)[:, 1:-1])
    row = frame[1:-1:few]
    twice = np.abs(row[:, 2:] - 2 * row[:, 1:-1] + row[:, :-2])
    quiet = (slope <= EDGE * np.median(slope)) & np.isfinite(twice)
    return float(np.median(twice[quiet]) / (0.6745 * np.sqrt(6)))


def _area(points: Float[np.ndarray, "points 2"]) -> float:
    x, y = points.T
    return float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) / 2)
