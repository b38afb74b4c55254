"""The outline of a shell in one frame, to a fraction of a pixel, and how sharp its edge is.

The frame is smoothed by a Gaussian, cut at the grey value half way between the
shell and what surrounds it, and the largest closed line is the outline.

Symbols    s width of the smoothing [px]   σ_n noise of a pixel   g gradient at the edge [1/px]
Source     Mokbel et al. 2021, section "Experiments": contours of the film's frames
"""

from dataclasses import dataclass

import numpy as np
import scipy.special
from jaxtyping import Float

from jshell.camera.frames import EXTRA
from jshell.errors import require_extra

SMOOTHING = 1.0  # px
STRAIGHT = 0.98  # of the way from the edge's middle to its ends, as far as its form is undone
SMALLEST = 12.0  # px across: smaller outlines are specks
SATURATED = 0.01  # of the pixels at white or black beside the edge: worth a word
EDGE = 3.0  # slopes above so many times the median are the edge's: noise alone goes there once in 500
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
    """

    points: Float[np.ndarray, "points 2"]
    sigma: float
    correlation: float
    blur: float
    cut: bool


def find_outline(frame: Float[np.ndarray, "rows columns"], *, dark: bool = True) -> Outline | None:
    """The outline of the shell in a frame; None where there is no shell.

    Args:
        frame: Grey values; NaN where the holder is masked.
        dark: Whether the shell is darker than what surrounds it.
    """
    measure = require_extra("skimage.measure", EXTRA, "outlines")
    filters = require_extra("skimage.filters", EXTRA, "outlines")
    masked = ~np.isfinite(frame)
    values = np.where(masked, np.nanmedian(frame), frame)
    values = -values if dark else values
    smooth = filters.gaussian(values, SMOOTHING, preserve_range=True)
    slope = np.hypot(*np.gradient(smooth))
    noise = _noise(values, slope) / (2 * np.sqrt(np.pi) * SMOOTHING)  # white noise behind a Gaussian of this width
    low, high = np.percentile(smooth, [1, 99])
    if high - low <= CONTRAST * noise or high <= low:
        return None
    split = float(filters.threshold_otsu(smooth))
    inside, outside = float(np.median(smooth[smooth > split])), float(np.median(smooth[smooth <= split]))
    if inside - outside <= CONTRAST * noise:
        return None
    smooth = np.where(masked, outside, smooth)
    # the edge of a blurred body is an error function; undone, it is as straight as what interpolates between pixels
    level = 2 * (smooth - (inside + outside) / 2) / (inside - outside)
    lines = measure.find_contours(scipy.special.erfinv(np.clip(level, -STRAIGHT, STRAIGHT)), 0.0)
    lines = [line for line in lines if np.ptp(line, axis=0).max() >= SMALLEST]
    if not lines:
        return None
    points = max(lines, key=lambda line: abs(_area(line)))[:, ::-1]
    closed = bool(np.allclose(points[0], points[-1]))
    rows, columns = frame.shape
    edge = (points <= 1).any() or (points[:, 0] >= columns - 2).any() or (points[:, 1] >= rows - 2).any()
    at = np.clip(np.round(points).astype(int), 0, [columns - 1, rows - 1])
    gradient = float(np.median(slope[at[:, 1], at[:, 0]]))
    if gradient <= 0:
        return None
    # a Gaussian edge is √(2π) of its widths wide; differences of neighbours but one widen it by 1/3
    width = ((inside - outside) / gradient) ** 2 / (2 * np.pi) - 1 / 3
    correlation = 2 * np.sqrt(np.pi) * SMOOTHING  # of noise behind a Gaussian: exp(-d²/4s²), integrated
    return Outline(points, noise / gradient, correlation, float(np.sqrt(max(width, 0.0))), bool(edge) or not closed)


def _noise(values: Float[np.ndarray, "rows columns"], slope: Float[np.ndarray, "rows columns"]) -> float:
    """Standard deviation of a pixel's noise off the edge, from second differences, which slopes do not reach."""
    twice = np.abs(values[:, 2:] - 2 * values[:, 1:-1] + values[:, :-2])
    quiet = slope[:, 1:-1] <= EDGE * np.median(slope)
    return float(np.median(twice[quiet]) / (0.6745 * np.sqrt(6)))


def _area(points: Float[np.ndarray, "points 2"]) -> float:
    x, y = points.T
    return float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) / 2)
