"""A film rendered from the simulator, whose height and width are known: bias, scatter, honesty of σ, speed, memory.

A kicked shell on its holder rings down; each frame is its silhouette, seen through a lens with 3 % of barrel
distortion, blurred by one pixel, with 0.5 % of noise. Measured with a picture of a grid and without one, then
analysed and compared with what the simulation's own height says. Then a long film of large frames, against the clock.

    python benchmarks/film.py [frames]
"""

import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import scipy.spatial
import skimage.draw
import tifffile
from scipy.ndimage import gaussian_filter

import jshell as js

SIDE, SCALE, FINE = 256, 92.0, 8  # pixels of a side, of R0, and points to a pixel's side
NOISE, BLUR, BARREL = 0.005, 1.0, -0.03
RATE = 10.0  # frames per unit of time
LONG, LARGE = 1000, 512


def ring_down(frames: int) -> js.dynamics.Motion:
    """A small ring-down of the reference shell on a pad."""
    conditions = js.presets.R.conditions
    modes = js.dynamics.modes(conditions, elements=16, attached=0.33)
    kick = js.dynamics.kick(modes, 0.02, (1, 2))
    return js.dynamics.record(
        conditions, start=modes.rest, velocity=kick, pressure=lambda t: 0.0 * t + conditions.outer_pressure,
        attached=0.33, elements=16, duration=frames / RATE, every=1 / RATE,
    )  # fmt: skip


def bent(points: np.ndarray, side: int) -> np.ndarray:
    """Where a lens with barrel distortion shows points."""
    middle, radius = (side - 1) / 2, side / np.sqrt(2)
    away = (points - middle) / radius
    return middle + radius * away * (1 + BARREL * np.sum(away**2, axis=1, keepdims=True))


def frame(outline: np.ndarray, side: int, rng: np.random.Generator, barrel: bool) -> np.ndarray:
    """A dark silhouette in 16 bits."""
    hull = outline[scipy.spatial.ConvexHull(outline).vertices]
    # straight edges bend in a lens: they are cut into pieces first
    closed = np.r_[hull, hull[:1]]
    along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(closed, axis=0).T))]
    even = np.linspace(0.0, along[-1], 3000)
    points = np.stack([np.interp(even, along, part) for part in closed.T], axis=1)
    points = (bent(points, side) if barrel else points) * FINE + (FINE - 1) / 2
    inside = skimage.draw.polygon2mask((FINE * side, FINE * side), points[:, ::-1]).astype(np.float32)
    inside = gaussian_filter(inside, FINE * np.sqrt(BLUR**2 - 1 / 12)).reshape(side, FINE, side, FINE).mean(axis=(1, 3))
    grey = 0.85 - 0.7 * inside + NOISE * rng.normal(size=inside.shape)
    return np.clip(np.round(65535 * grey), 0, 65535).astype(np.uint16)


def outlines(motion: js.dynamics.Motion, side: int, scale: float) -> list[np.ndarray]:
    """Columns and rows of the middle surface, frame by frame."""
    shape, found = motion.setup.shape, []
    x0 = None
    for q in np.asarray(motion.coordinates):
        curve = shape.at_points(q)
        x, r = np.asarray(curve.x), np.asarray(curve.r)
        x0 = (x.max() + x.min()) / 2 if x0 is None else x0
        both = np.c_[np.r_[r, -r[::-1]], np.r_[x, x[::-1]] - x0]
        found.append((side - 1) / 2 + scale * both * np.array([1.0, -1.0]))
    return found


def grid(path: Path) -> Path:
    """A picture of dots through the same lens."""
    rows, columns = np.mgrid[:SIDE, :SIDE].astype(float)
    middle, radius = (SIDE - 1) / 2, SIDE / np.sqrt(2)
    away = (np.stack([columns, rows], axis=-1).reshape(-1, 2) - middle) / radius
    true = away.copy()
    for _ in range(30):
        true = away / (1 + BARREL * np.sum(true**2, axis=1, keepdims=True))
    x, y = (middle + radius * true).T
    dots = np.cos(2 * np.pi * (x - 127.5) / 20) + np.cos(2 * np.pi * (y - 127.5) / 20)
    tifffile.imwrite(
        path, (65535 * (0.8 - 0.6 / (1 + np.exp(-8 * (dots - 1.3))))).reshape(SIDE, SIDE).astype(np.uint16)
    )
    return path


def accuracy(folder: Path, frames: int) -> None:
    motion, rng = ring_down(frames), np.random.default_rng(0)
    drawn = outlines(motion, SIDE, SCALE)
    path = folder / "film.tif"
    tifffile.imwrite(path, np.stack([frame(one, SIDE, rng, True) for one in drawn]), photometric="minisblack")
    # what is drawn is a polygon through Gauss points: its own extent is the truth
    truth = {"height": [np.ptp(one[:, 1]) for one in drawn], "width": [np.ptp(one[:, 0]) for one in drawn]}
    lens = js.camera.lens_from_grid(grid(folder / "grid.tif"))
    print("| channel | grid | frames | bias [px] | RMS of the rest [px] | normalised residuals |")
    print("|---|---|---|---|---|---|")
    for words, one in (("with", lens), ("without", None)):
        found = js.camera.measure(path, js.camera.View(rate=RATE, lens=one))
        for name in ("height", "width"):
            off = found.trace[name] - np.array(truth[name])[: len(found.trace.times)]
            honest = np.std(off / found.trace.sigma[name])
            print(f"| {name} | {words} | {len(off)} | {off.mean():.3f} | {off.std():.4f} | {honest:.2f} |")
        if one is not None:
            seen = js.signals.extract(found.trace, start=0.0)
            own = js.signals.extract(
                js.Trace(found.trace.times, {k: np.array(v)[: len(found.trace.times)] for k, v in truth.items()}),
                start=0.0,
            )
            print(f"\n{seen}\n\nThe simulation's own:\n\n{own}\n")


def speed(folder: Path) -> None:
    rng = np.random.default_rng(1)
    motion = ring_down(40)
    few = [frame(one, LARGE, rng, False) for one in outlines(motion, LARGE, 2 * SCALE)]
    path = folder / "long.tif"
    with tifffile.TiffWriter(path) as file:
        for k in range(LONG):
            file.write(few[k % len(few)], photometric="minisblack", contiguous=False)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began, used = time.perf_counter(), time.process_time()
    js.camera.measure(path, js.camera.View(rate=1000))
    wall, cpu = time.perf_counter() - began, time.process_time() - used
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(
        f"{LONG} frames of {LARGE}²: {wall:.1f} s, {cpu:.1f} s of processor time, {(peak - before) / 1024:.0f} MB more"
    )


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        accuracy(Path(place), int(sys.argv[1]) if len(sys.argv) > 1 else 200)
        speed(Path(place))
