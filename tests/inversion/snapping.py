"""A stand-in for a simulation through the snap that needs no compilation.

An oscillator follows a state that drops where the outer pressure passes a threshold, which the weak spot lowers. All
numbers of the simulator matter, all smoothly; a coarse mesh makes the frequency a little too high.
"""

import time

import numpy as np
from scipy.signal import lfilter

import jshell as js
from jshell.errors import Outcome
from jshell.inversion import motion, snap

STEP = 1e-6


def snapping(numbers: np.ndarray, pressure: np.ndarray, times: np.ndarray, mesh: float) -> np.ndarray:
    """(times, channels) under a pressure (times,)."""
    d, gas, _, viscosity, kappa, nu, pad, spot, retardation = numbers
    threshold = gas + 4 / 3 * d * (1 - 0.8 * spot) * (1 + 0.1 * (nu - 0.5))
    dropped = 1 / (1 + np.exp(-(pressure - threshold) / 0.01))
    target = 1 - 0.05 * kappa * (pressure - gas) - 0.3 * (1 + d - 0.1 * (gas - pressure)) * dropped
    omega = (1 + 0.3 * (gas - 0.9) + d + pad) * (1 + 0.002 * mesh)
    damping = 0.02 + np.sqrt(viscosity) + retardation * omega**2 / 2
    w = omega * (times[1] - times[0]) / 2  # of the trapezium rule
    z = w * damping / omega
    filtered = lfilter(
        w**2 * np.array([1.0, 2.0, 1.0]), [1 + 2 * z + w**2, 2 * w**2 - 2, 1 - 2 * z + w**2], target - target[0]
    )
    q = filtered + target[0]
    out = np.zeros((times.size, len(motion.CHANNELS)))
    for name, scale, power in (("V", 4 * np.pi / 3, 1.0), ("S", 4 * np.pi, 0.5), ("H", 2.0, 1.2), ("W", 2.0, 0.2)):
        out[:, motion.PLACES[name]] = scale * np.maximum(q, 0.1) ** power
    out[:, motion.PLACES["P_ext"]] = pressure
    return out


def run(numbers, tangents, load, length, elements, inner, report=None, pause=0.0):
    times = motion.EVERY * np.arange(int(length / motion.EVERY) + 1 + motion.SPARE)
    mesh = (16 / elements) ** 8
    time.sleep(pause)
    pressure, changes = load.value(times), load.change(times)
    value = snapping(numbers, pressure, times, mesh)
    slopes = [
        np.zeros(value.shape) if not np.any(n) and not np.any(p) else
        (snapping(numbers + STEP * n, pressure + STEP * p, times, mesh)
         - snapping(numbers - STEP * n, pressure - STEP * p, times, mesh)) / (2 * STEP)
        for n, p in zip(tangents, changes, strict=True)
    ]  # fmt: skip
    if report is not None:
        report(1.0)
    return motion.RunSamples(value, np.array(slopes), Outcome.OK)


def simulate(conditions, *, duration, every, pressure, elements, attached, weak_spot, step, losses):
    times = every * np.arange(round(duration / every) + 1)
    numbers = np.array([*(float(getattr(conditions, name)) for name in (
        "thickness", "gas_pressure", "outer_pressure", "viscosity", "kappa", "poisson_ratio")), attached,
        weak_spot.depth, 0.0 if losses.wall is None else losses.wall.retardation])  # fmt: skip
    found = snapping(numbers, np.asarray(pressure(times)), times, (16 / elements) ** 8)
    return js.Trace(times, dict(zip(motion.CHANNELS, found.T, strict=True)))


def use(put, pause: float = 0.0) -> None:
    """Put the stand-in where the simulation is; `put` as `setattr`."""
    put(motion, "run", lambda *given: run(*given, pause=pause))
    put(snap, "simulate", simulate)
