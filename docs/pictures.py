"""The pictures that are kept in `docs/images`: those of the README, which is read where nothing is executed.

python docs/pictures.py        a minute. `make demo` draws `demo.png`, benchmarks/symmetry.py `symmetry_map.png`
"""

from pathlib import Path

import numpy as np

import jshell as js
from jshell import plot

IMAGES = Path(__file__).parent / "images"


def snap() -> None:
    """A shell that snaps, with the liquid's motion, in one row."""
    motion = js.dynamics.record(js.Reduced(0.22, 0.9, 1.62, 0.004), elements=24, duration=50.0, throw=True)
    moments = plot.moments(motion)
    chosen = [moments[k] for k in (0, 2, 3, 4)]
    plot.save(plot.filmstrip(motion, chosen, contours=False), IMAGES / "snap.png")


def fit() -> None:
    """A record with noise, the fit over it, and what the fit leaves."""
    shell = js.Reduced(0.08, 0.9, 1.2, 0.004)
    truth = js.Coefficients.with_decay_time(3.0, 0.85, 0.2, tau=12.0, viscosity=0.004)
    clean = js.oscillator.simulate(shell, truth, initial=(-0.1, 0.05, 0.0, 0.0), times=np.linspace(0, 40, 401))
    record = js.oscillator.add_noise(clean, 0.05, seed=0)
    plot.save(plot.trace_fit(js.fit(record)).flat[0].figure, IMAGES / "fit.png")


def mode() -> None:
    """A shell in three dimensions, moving along a vibration of order 2, seen from all sides."""
    found = js.dynamics.azimuthal_modes(js.presets.R.conditions, 2, elements=16, liquid="ideal")
    plot.rotating(found.rest, 2, found.shapes[0, 0], IMAGES / "mode.gif")


if __name__ == "__main__":
    for draw in (snap, fit, mode):
        draw()
