"""The tank's window and the lens bend straight lines: seen on a picture of a grid, and taken off the outline.

Symbols    r distance from the middle of the picture over half its diagonal   k₁, k₂ radial distortion
           a point at r is seen at r (1 + k₁ r² + k₂ r⁴)
Source     Brown 1971, Close-range camera calibration; Mokbel et al. 2021, section "Experiments"
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.optimize
from jaxtyping import Float

from jshell.camera.forms import EXTRA
from jshell.camera.frames import open_film
from jshell.camera.pictures import one_picture
from jshell.errors import BadValue, require_extra

FEWEST = 12  # dots of a grid
SMOOTHING = 1.5  # px


@dataclass(frozen=True)
class Lens:
    """What a lens does to a picture.

    Attributes:
        middle: Columns and rows of its middle [px].
        radius: Half the diagonal [px].
        k1, k2: Radial distortion.
        spacing: Distance of the grid's dots after correction [px].
        rms: What is left of the grid's bend after correction [px].
    """

    middle: tuple[float, float]
    radius: float
    k1: float
    k2: float
    spacing: float
    rms: float

    def straight(self, points: Float[np.ndarray, "points 2"]) -> Float[np.ndarray, "points 2"]:
        """Where points would be seen without distortion."""
        away = (points - np.array(self.middle)) / self.radius
        seen = np.hypot(*away.T)
        true = seen.copy()
        for _ in range(20):  # Newton would need fewer; this cannot leave the picture
            true = seen / (1 + self.k1 * true**2 + self.k2 * true**4)
        ratio = np.divide(true, seen, out=np.ones_like(seen), where=seen > 0)
        return np.array(self.middle) + self.radius * away * ratio[:, None]

    def seen(self, points: Float[np.ndarray, "points 2"]) -> Float[np.ndarray, "points 2"]:
        """Where the picture shows points that are given without distortion."""
        return bent(points, np.array(self.middle), self.radius, self.k1, self.k2)


def bent(
    points: Float[np.ndarray, "points 2"],
    middle: Float[np.ndarray, "2"],
    radius: float,
    k1: float,
    k2: float = 0.0,
) -> Float[np.ndarray, "points 2"]:
    """Where points are seen through a lens of a middle and half a diagonal [px]."""
    true = (points - middle) / radius
    r2 = np.sum(true**2, axis=1)
    return middle + radius * true * (1 + k1 * r2 + k2 * r2**2)[:, None]


def lens_from_grid(picture: str | Path, *, dark: bool = True) -> Lens:
    """The distortion that a picture of a grid of dots shows.

    Args:
        picture: A picture, or a film of which the first frame is taken; the dots cover the field of view.
        dark: Whether the dots are darker than what surrounds them.

    Raises:
        BadFile: No picture.
        BadValue: Fewer than 12 dots, or dots in no grid.
        MissingExtra: The extra `camera` is not installed.
    """
    path = Path(picture)
    frame = _picture(path)
    filters = require_extra("skimage.filters", EXTRA, "outlines")
    measure = require_extra("skimage.measure", EXTRA, "outlines")
    values = filters.gaussian(-frame if dark else frame, SMOOTHING, preserve_range=True)
    # squared, so that pixels at a dot's border, which come and go as it lies, weigh nothing
    weight = np.clip(values - filters.threshold_otsu(values), 0, None) ** 2
    regions = measure.regionprops(measure.label(weight > 0), intensity_image=weight)
    rows, columns = frame.shape
    inner = [one for one in regions if one.area >= 4 and one.bbox[0] > 0 and one.bbox[1] > 0]
    inner = [one for one in inner if one.bbox[2] < rows and one.bbox[3] < columns]
    dots = np.array([one.centroid_weighted[::-1] for one in inner])
    if len(dots) < FEWEST:
        raise BadValue(str(path), found=f"{len(dots)} dots", expected=f"at least {FEWEST}", remedy="Take more of it.")
    middle, radius = ((columns - 1) / 2, (rows - 1) / 2), float(np.hypot(columns, rows) / 2)
    lattice = _lattice(str(path), dots, np.array(middle))
    return _fitted(dots, lattice, middle, radius)


def _picture(path: Path) -> Float[np.ndarray, "rows columns"]:
    if path.suffix.lower() in (".tif", ".tiff"):
        with open_film(path) as film:
            return film.read(0)
    return one_picture(path)


Points = Float[np.ndarray, "dots 2"]


def _lattice(place: str, dots: Points, middle: Float[np.ndarray, "2"]) -> Points:
    """Whole numbers of the dots, counted from the one nearest to the middle through its neighbours."""
    start = int(np.argmin(np.hypot(*(dots - middle).T)))
    away = dots - dots[start]
    near = np.argsort(np.hypot(*away.T))[1:5]
    first = away[near[np.argmax(np.abs(away[near, 0]))]]
    first = first if first[0] > 0 else -first
    found = {start: (0, 0)}
    steps = {start: np.array([first, [-first[1], first[0]]])}
    line = [start]
    while line:
        at = line.pop(0)
        for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
            guess = dots[at] + sign * steps[at][axis]
            k = int(np.argmin(np.hypot(*(dots - guess).T)))
            length = float(np.hypot(*steps[at][axis]))
            if k not in found and np.hypot(*(dots[k] - guess)) < length / 4:
                found[k] = (found[at][0] + sign * (axis == 0), found[at][1] + sign * (axis == 1))
                own = steps[at].copy()
                own[axis] = sign * (dots[k] - dots[at])
                steps[k] = own
                line.append(k)
    if len(found) < max(FEWEST, len(dots) // 2):
        raise BadValue(
            place,
            found=f"{len(found)} of {len(dots)} dots in a grid",
            expected="a square grid",
            remedy="Check the picture.",
        )
    where = np.full(dots.shape, np.nan)
    for k, numbers in found.items():
        where[k] = numbers
    return where


def _fitted(dots, lattice, middle, radius) -> Lens:
    """Grid and distortion by least squares."""
    used = np.isfinite(lattice[:, 0])
    seen, numbers = dots[used], lattice[used]

    def expected(x):
        turned = np.array([[x[2], -x[3]], [x[3], x[2]]])
        return bent(x[:2] + numbers @ turned.T, np.array(middle), radius, x[4], x[5])

    start = int(np.argmin(np.abs(numbers).sum(axis=1)))
    slope = np.linalg.lstsq(np.c_[np.ones(len(numbers)), numbers], seen, rcond=None)[0]
    x0 = [*seen[start], slope[1, 0], slope[1, 1], 0.0, 0.0]
    found = scipy.optimize.least_squares(lambda x: (expected(x) - seen).ravel(), x0, x_scale=[1, 1, 1, 1, 0.01, 0.01])
    x = found.x
    rms = float(np.sqrt(np.mean(found.fun**2)))
    return Lens(middle, radius, float(x[4]), float(x[5]), float(np.hypot(x[2], x[3])), rms)
