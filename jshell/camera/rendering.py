"""A film of a shell whose outline is known: what a camera would show of it, to try a measurement before believing it.

The outline's silhouette is drawn by each point's distance to it, seen through
the lens, blurred, gathered by the pixels, and given noise.

Symbols    b width of the blur, as of a Gaussian [px]   k₁ radial distortion, as in `distortion`
Source     a pixel gathers light over its square, as a Gaussian of variance 1/12 does to second order
"""

from dataclasses import dataclass

import numpy as np
import scipy.ndimage
import scipy.spatial
import scipy.special
from jaxtyping import Float, UInt16

from jshell.camera.distortion import bent
from jshell.camera.forms import EXTRA
from jshell.errors import require_extra

FINE = 4  # points to a pixel's side, in which an outline is drawn
EDGE = 0.7  # width of the drawn edge, in points: wide enough to be sampled, narrow beside any blur
REACH = 4  # points from the outline where the edge is drawn
SPACING = 0.2  # px between the outline's own points
GRID = 20  # px between a grid's dots


@dataclass(frozen=True)
class Scene:
    """What a camera sees a shell through.

    Attributes:
        rows, columns: Of a frame.
        background, shell: Grey values, from 0 to 1.
        blur: Width of the blur as of a Gaussian, at least 0.35 [px].
        noise: Standard deviation of a pixel's noise, of full scale.
        k1: Radial distortion of the window and the lens; -0.03 is a barrel of 3 % at the corners.
        holder: First row, first and last column of a rod from below that holds the shell, as dark as it.
    """

    rows: int = 256
    columns: int = 256
    background: float = 0.85
    shell: float = 0.15
    blur: float = 1.0
    noise: float = 0.005
    k1: float = 0.0
    holder: tuple[float, float, float] | None = None


def silhouette(
    x: Float[np.ndarray, "angles"], r: Float[np.ndarray, "angles"], size: float, middle: tuple[float, float]
) -> Float[np.ndarray, "points 2"]:
    """The outline of a shell seen from the side, which hides its dimple: the hull of its meridian and its mirror image.

    Args:
        x, r: The meridian, from pole to pole, as `jshell.dynamics.meridians` gives it [R0].
        size: Pixels to a radius R0 [px].
        middle: Column of the axis, and row of x = 0; x points upward [px].
    """
    both = np.array(middle) + size * np.c_[np.r_[r, -r[::-1]], -np.r_[x, x[::-1]]]
    return both[scipy.spatial.ConvexHull(both).vertices]


def render(
    outline: Float[np.ndarray, "points 2"], scene: Scene, noise: np.random.Generator | None = None
) -> UInt16[np.ndarray, "rows columns"]:
    """A frame of 16 bits that shows the silhouette of an outline.

    Args:
        outline: Columns and rows of a closed line without distortion, its first point not repeated [px].
        scene: What it is seen through.
        noise: Where its noise comes from; None draws none.

    Raises:
        MissingExtra: The extra `camera` is not installed.
    """
    inside = _covered(outline, scene)
    if scene.holder is not None:
        top, left, right = scene.holder
        bottom = scene.rows + 10.0
        down, wide = np.linspace(top, bottom, 400), np.linspace(left, right, 100)
        rod = [np.c_[wide, np.full(100, top)], np.c_[np.full(400, right), down]]
        rod += [np.c_[wide[::-1], np.full(100, bottom)], np.c_[np.full(400, left), down[::-1]]]
        inside = np.maximum(inside, _covered(np.concatenate(rod), scene))
    spread = np.sqrt(max(scene.blur**2 - 1 / 12 - (EDGE / FINE) ** 2, 0.0))
    inside = scipy.ndimage.gaussian_filter(inside, FINE * spread)
    inside = inside.reshape(scene.rows, FINE, scene.columns, FINE).mean(axis=(1, 3))
    grey = scene.background + (scene.shell - scene.background) * inside
    if noise is not None:
        grey = grey + scene.noise * noise.normal(size=grey.shape)
    return np.clip(np.round(65535 * grey), 0, 65535).astype(np.uint16)


def render_grid(scene: Scene) -> UInt16[np.ndarray, "rows columns"]:
    """A picture of a grid of round dots, 20 pixels apart, seen through the same window and lens."""
    middle, radius = _frame(scene)
    rows, columns = np.mgrid[: scene.rows, : scene.columns].astype(float)
    seen = (np.stack([columns, rows], axis=-1) - middle) / radius
    true = seen
    for _ in range(30):  # of the lens's formula
        true = seen / (1 + scene.k1 * np.sum(true**2, axis=-1, keepdims=True))
    waves = np.cos(2 * np.pi * radius * true / GRID).sum(axis=-1)
    dots = 1 / (1 + np.exp(-8 * (waves - 1.3)))
    return (65535 * (scene.background + (scene.shell - scene.background) * dots)).astype(np.uint16)


def _frame(scene: Scene) -> tuple[Float[np.ndarray, "2"], float]:
    """Middle of the picture and half its diagonal [px]."""
    return np.array([(scene.columns - 1) / 2, (scene.rows - 1) / 2]), float(np.hypot(scene.rows, scene.columns) / 2)


def _covered(outline: Float[np.ndarray, "points 2"], scene: Scene) -> Float[np.ndarray, "rows columns"]:
    """How much of each fine point lies within an outline, from 0 to 1."""
    library = require_extra("PIL.Image", EXTRA, "films that are drawn")
    draw = require_extra("PIL.ImageDraw", EXTRA, "films that are drawn")
    closed = np.r_[outline, outline[:1]]
    along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(closed, axis=0).T))]
    even = np.arange(0.0, along[-1], SPACING)
    points = np.stack([np.interp(even, along, part) for part in closed.T], axis=1)
    # straight lines bend in a lens: they have been cut into pieces first
    points = FINE * (bent(points, *_frame(scene), scene.k1) + 0.5) - 0.5
    filled = library.new("L", (FINE * scene.columns, FINE * scene.rows))
    draw.Draw(filled).polygon([tuple(point) for point in points], fill=1)
    within = np.asarray(filled) > 0
    inside = within.astype(float)
    outer = np.asarray(scipy.ndimage.binary_dilation(within, iterations=REACH), bool)
    inner = np.asarray(scipy.ndimage.binary_erosion(within, iterations=REACH, border_value=1), bool)
    near = np.logical_and(outer, np.logical_not(inner))
    places = np.argwhere(near)[:, ::-1].astype(float)
    tangent = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    normal = np.c_[tangent[:, 1], -tangent[:, 0]] / np.hypot(*tangent.T)[:, None]
    x, y = points.T
    if np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) < 0:
        normal = -normal
    closest = scipy.spatial.KDTree(points).query(places)[1]
    away = np.sum((places - points[closest]) * normal[closest], axis=1)
    inside[near] = 0.5 * scipy.special.erfc(away / (np.sqrt(2) * EDGE))
    return inside
