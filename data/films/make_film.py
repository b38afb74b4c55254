"""Make attached_R.tif and grid.png: a film of a shell on a rod, ringing, and dots through the same lens.

Configuration R of the source, held by a pad of 0.33 rad, is struck so that its slow and its fast mode ring. What a
camera sees of the simulator's shape: a dark silhouette, 1000 frames a second, a blur of one pixel, noise of 0.5 %, 3 %
of barrel distortion; the rod comes from below. `attached_R_drawn.csv` keeps the height and width that were drawn.

    python data/films/make_film.py
"""

from pathlib import Path

import numpy as np
import tifffile
from PIL import Image

import jshell as js
from jshell.camera import Scene, render, render_grid, silhouette

HERE = Path(__file__).parent
RATE = 1000.0  # frames per second
RADIUS = 0.0225  # R0 [m]
TIME = RADIUS**1.5 * np.sqrt(1260 / (0.5e6 * 0.22 * RADIUS))  # unit of time, in glycerol and 0.5 MPa [s]
PAD, ELEMENTS = 0.33, 16  # half-angle of the pad [rad]
STROKE = 0.03  # of the volume, shared by two modes
ANGLES = np.linspace(0, np.pi, 1500)  # finer than any pixel

SIDE, SIZE, FRAMES = 120, 43.5, 120  # pixels of a side, of R0
ROD = 1.5  # half-width of the rod [px]


def ring_down(frames: int, strength: float = STROKE) -> js.dynamics.Motion:
    """The shell, struck in its slow and its fast mode, at the times of the frames."""
    conditions = js.presets.R.conditions
    every = 1 / RATE / TIME
    modes = js.dynamics.modes(conditions, elements=ELEMENTS, attached=PAD)
    return js.dynamics.record(
        conditions, start=modes.rest, velocity=js.dynamics.kick(modes, strength, (1, 2)),
        pressure=lambda t: 0.0 * t + conditions.outer_pressure,
        attached=PAD, elements=ELEMENTS, duration=(frames - 1) * every, every=every,
    )  # fmt: skip


def outlines(motion: js.dynamics.Motion, side: int, size: float) -> list[np.ndarray]:
    """What a camera of so many pixels, so many of them to R0, sees, frame by frame: columns and rows [px]."""
    shapes = js.dynamics.meridians(motion, ANGLES)[0]
    x, r = np.asarray(shapes.x), np.asarray(shapes.r)
    middle = (side - 1) / 2, (side - 1) / 2 + size * (x[0].max() + x[0].min()) / 2
    return [silhouette(*one, size, middle) for one in zip(x, r, strict=True)]


def scene(side: int, lowest: float, rod: float, k1: float = -0.03) -> Scene:
    """What it is seen through; the rod ends in the shell, above its lowest row."""
    middle = (side - 1) / 2
    return Scene(side, side, k1=k1, holder=(lowest - 3 * rod, middle - rod, middle + rod))


def mask(lowest: float, side: int, rod: float) -> tuple[int, int, int, int]:
    """First and last row, first and last column of what hides the rod."""
    middle = (side - 1) / 2
    return int(lowest - 2 * rod), side - 1, int(np.floor(middle - rod - 2)), int(np.ceil(middle + rod + 2))


def main() -> None:
    motion, noise = ring_down(FRAMES), np.random.default_rng(0)
    drawn = outlines(motion, SIDE, SIZE)
    lowest = float(drawn[0][:, 1].max())
    seen = scene(SIDE, lowest, ROD)
    frames = np.stack([(render(one, seen, noise) // 257).astype(np.uint8) for one in drawn])
    # as ImageJ writes it, with the time between frames
    told = {"axes": "TYX", "finterval": 1 / RATE, "tunit": "s"}
    tifffile.imwrite(
        HERE / "attached_R.tif", frames, imagej=True, metadata=told, photometric="minisblack", compression="zlib"
    )
    Image.fromarray((render_grid(seen) // 257).astype(np.uint8)).save(HERE / "grid.png")
    pixel = RADIUS / SIZE
    sizes = {"H": [np.ptp(one[:, 1]) for one in drawn], "W": [np.ptp(one[:, 0]) for one in drawn]}
    with (HERE / "attached_R_drawn.csv").open("w", encoding="utf-8") as file:
        file.write(f"# made by make_film.py: what is drawn in attached_R.tif, pixels of {1e3 * pixel:.6g} mm\n")
        file.write("t [ms],H [mm],W [mm]\n")
        for k, (height, width) in enumerate(zip(*sizes.values(), strict=True)):
            file.write(f"{1e3 * k / RATE:.4f},{1e3 * pixel * height:.5f},{1e3 * pixel * width:.5f}\n")
    top, bottom, left, right = mask(lowest, SIDE, ROD)
    print(f"--pixel {pixel:.6g} --grid grid.png --holder {top}:{bottom}:{left}:{right}")


if __name__ == "__main__":
    main()
