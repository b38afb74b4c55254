"""A film rendered from the simulator, whose height and width are known: bias, scatter, honesty of σ, speed, memory.

The ring-down of `data/films/make_film.py` in frames of 256², 200 of them, measured with a picture of a grid and
without one, with and without a rod that hides the lower pole; then analysed, and compared with what the same analysis
says of the sizes that were drawn. Every film is measured with five noises (seeds 0 to 4), and each counts: the scatter
of 200 errors is itself known to 5 % only. Last, 1000 frames of 512² against the clock.

    python benchmarks/film.py [frames]
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import tifffile

sys.path.insert(0, str(Path(__file__).parents[1] / "data" / "films"))
import make_film as made

import jshell as js
from jshell.camera import Scene, View, lens_from_grid, measure, render, render_grid

SIDE, SIZE, ROD = 256, 92.0, 5.0  # pixels of a side, of R0, of the rod's half-width
LONG, LARGE = 1000, 512
SEEDS = range(5)


def accuracy(folder: Path, drawn: list[np.ndarray]) -> None:
    """The table of bias, scatter and honesty, and the frequencies."""
    lowest = float(drawn[0][:, 1].max())
    held, free = made.scene(SIDE, lowest, ROD), Scene(SIDE, SIDE, k1=-0.03)
    tifffile.imwrite(folder / "grid.tif", render_grid(held))
    lens, box = lens_from_grid(folder / "grid.tif"), made.mask(lowest, SIDE, ROD)
    truth = {"height": [np.ptp(one[:, 1]) for one in drawn], "width": [np.ptp(one[:, 0]) for one in drawn]}
    print("| film | channel | grid | frames | bias [px] | RMS of the rest [px] | σ told [px] | normalised residuals |")
    print("|---|---|---|---|---|---|---|---|")
    for name, scene, holder in (("held", held, box), ("free", free, None)):
        clean, paths = np.stack([render(one, scene) for one in drawn]), []
        for seed in SEEDS:
            noise = 65535 * scene.noise * np.random.default_rng(seed).normal(size=clean.shape)
            paths.append(folder / f"{name}_{seed}.tif")
            film = np.clip(np.round(clean + noise), 0, 65535).astype(np.uint16)
            tifffile.imwrite(paths[-1], film, photometric="minisblack")
        for word, one in (("yes", lens), ("no", None)):
            found = [measure(path, View(rate=made.RATE, lens=one, holder=holder)).trace for path in paths]
            for channel, exact in truth.items():
                off = np.stack([film[channel] - np.array(exact) for film in found])
                sigma = np.stack([film.sigma[channel] for film in found])
                told = f"{off.mean():.4f} | {off.std():.4f} | {np.median(sigma):.4f} | {np.std(off / sigma):.2f}"
                each = ", ".join(f"{np.std(row):.2f}" for row in off / sigma)
                print(f"| {name} | {channel} | {word} | {off.size} | {told} ({each}) |")
            if name == "held" and one is not None:
                kept = found[0]
    frequencies(kept, js.Trace(kept.times, {name: np.array(values) for name, values in truth.items()}))


def frequencies(seen: js.Trace, drawn: js.Trace) -> None:
    """The film's two frequencies and decay beside those of the sizes that were drawn."""
    film, own = (js.signals.extract(one, start=0.0) for one in (seen, drawn))
    print("\n| | film | its error | of the simulation | apart, in errors |\n|---|---|---|---|---|")
    for name in ("omega_minus", "omega_plus", "tau"):
        value, error, exact = (float(x) for x in (getattr(film, name), film.stderr[name], getattr(own, name)))
        print(f"| {name} | {value:.6g} | {100 * error / value:.2f} % | {exact:.6g} | {(value - exact) / error:.2f} |")
    print(f"\n{film.verdict} ({film.reason}); of the simulation {own.verdict}\n")


def speed(folder: Path, drawn: list[np.ndarray]) -> None:
    """A long film of large frames: time and memory, in a process of its own."""
    noise = np.random.default_rng(1)
    few = [render(one, Scene(LARGE, LARGE), noise) for one in drawn]
    path = folder / "long.tif"
    with tifffile.TiffWriter(path) as file:
        for k in range(LONG):
            file.write(few[k % len(few)], photometric="minisblack", contiguous=False)
    said = subprocess.run(
        [sys.executable, __file__, "--measure", str(path)], capture_output=True, text=True, check=True
    )
    print(f"{LONG} frames of {LARGE}²: {said.stdout.strip()}")


def timed(path: Path) -> None:
    """Measure a film in a process of its own."""
    began, used = time.perf_counter(), time.process_time()
    measure(path, View(rate=made.RATE))
    wall, cpu = time.perf_counter() - began, time.process_time() - used
    # not getrusage's peak, which begins at that of the program that started this one
    status = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    peak = next(int(line.split()[1]) for line in status if line.startswith("VmHWM")) / 1024
    print(f"{wall:.1f} s, {cpu:.1f} s of processor time, {peak:.0f} MB at its peak, all of the program")


def main() -> None:
    motion = made.ring_down(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
    with tempfile.TemporaryDirectory() as place:
        accuracy(Path(place), made.outlines(motion, SIDE, SIZE))
        speed(Path(place), made.outlines(motion, LARGE, 2 * SIZE)[:40])


if __name__ == "__main__":
    timed(Path(sys.argv[2])) if sys.argv[1:2] == ["--measure"] else main()
