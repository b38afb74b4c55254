"""What the noise of the recordings is, read off what the simulator leaves of them.

Symbols    φ memory of AR(1) noise from sample to sample   σ standard error of a sample
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jshell.calibration.noise import MISFIT, Noise, ar1_memory, examine, steps_between
from jshell.inversion.model import Model, Weighing
from jshell.inversion.projection import Projection
from jshell.inversion.recording import Recording
from jshell.inversion.response import ECHO

SMALLEST = 1e-7  # of a channel's scatter: numbers of a file are not finer
LONGEST = 0.5  # of a slow period: what remembers longer is no noise
STEADY = 0.02  # relative change of σ, and change of φ, below which the noise is taken as known
EXPLAINED = 1.2  # of what free sinusoids leave: up to there the simulator describes a recording as well as they do


def first_weighing(one: Recording, modes: tuple[int, ...], free_rest: bool) -> Weighing:
    """White noise of the size that a recording shows itself."""
    scatter = one.values.std(axis=1)
    sigma = one.sigma if one.sigma is not None else np.maximum(one.noise, SMALLEST * scatter)
    # a hydrophone's zero is nobody's data
    return Weighing(modes, sigma, np.zeros(one.values.shape), free_rest=free_rest or ECHO in one.channels)


def examined(model: Model, projections: Sequence[Projection], weighings: Sequence[Weighing]) -> list[list[Noise]]:
    """The tests of calibration, of every channel of every recording."""
    found = []
    for one, projection, weighing in zip(model.recordings, projections, weighings, strict=True):
        left = (one.values - projection.curve) / weighing.sigma[:, None]
        plain = np.concatenate([projection.held, projection.basis], axis=1).reshape(*one.values.shape, -1)
        rows = []
        for c, name in enumerate(one.channels):
            J = plain[c] if not weighing.memory.any() else _slopes(projection, weighing, c, one)
            rows.append(examine(f"{name} [{one.number}]", left[c], J, one.times, np.ones(one.times.size)))
        found.append(rows)
    return found


def _slopes(projection: Projection, weighing: Weighing, c: int, one: Recording) -> np.ndarray:
    """The Jacobian of one channel with the memory of the noise put back."""
    whitened = np.concatenate([projection.held, projection.basis], axis=1).reshape(*one.values.shape, -1)[c]
    out, phi = whitened.copy(), weighing.memory[c]
    for k in range(1, len(out)):
        out[k] = phi[k] * out[k - 1] + np.sqrt(1 - phi[k] ** 2) * whitened[k]
    return out


def reweighed(
    model: Model, projections: Sequence[Projection], weighings: Sequence[Weighing], noises: Sequence[Sequence[Noise]]
) -> tuple[list[Weighing], bool]:
    """Weighings by what is left, and whether they are still those from before."""
    found, steady = [], True
    for one, projection, old, noise in zip(model.recordings, projections, weighings, noises, strict=True):
        steps = steps_between(one.times)
        longest = LONGEST * 2 * np.pi / float(np.min(one.Omega)) / float(np.median(np.diff(one.times)))
        most = float(np.exp(-1 / max(longest, 0.1)))
        memory = np.stack([ar1_memory(min(n.memory, most), steps) * (np.arange(steps.size) > 0) for n in noise])
        sigma = old.sigma
        if one.sigma is None:
            left = one.values - projection.curve
            varied = projection.basis.shape[1] + projection.held.shape[1]
            rms = np.sqrt(np.sum(left**2, axis=1) / max(1.0, one.times.size - varied / len(one.channels)))
            sigma = np.maximum(rms, SMALLEST * one.values.std(axis=1))
        steady &= bool(np.all(np.abs(sigma / old.sigma - 1) < STEADY) and np.all(np.abs(memory - old.memory) < STEADY))
        found.append(replace(old, sigma=sigma, memory=memory))
    return found, steady


def free_residual(one: Recording) -> np.ndarray:
    """(channels,) rms of what damped sinusoids of the recording's own frequencies leave."""
    elapsed = one.times - one.times[0]
    wave = np.exp(np.multiply.outer(elapsed, 1j * one.Omega - 1 / one.tau))
    basis = np.column_stack([np.ones(elapsed.size), np.real(wave), np.imag(wave)])
    remainder = one.values.T - basis @ np.linalg.lstsq(basis, one.values.T, rcond=None)[0]
    return np.sqrt(np.mean(remainder**2, axis=0))


def excess(model: Model, projections: Sequence[Projection]) -> list[np.ndarray]:
    """Of every channel, rms of what the simulator leaves over that of free sinusoids or of the noise, the larger."""
    found = []
    for one, projection in zip(model.recordings, projections, strict=True):
        rms = np.sqrt(np.mean((one.values - projection.curve) ** 2, axis=1))
        floor = np.maximum(np.maximum(one.noise, free_residual(one)), SMALLEST * one.values.std(axis=1))
        if one.sigma is not None:
            floor = np.maximum(floor, one.sigma)
        found.append(rms / floor)
    return found


def described(model: Model, projections: Sequence[Projection]) -> bool:
    """Whether the simulator describes all recordings as well as free sinusoids do."""
    return all(np.all(part < EXPLAINED) for part in excess(model, projections))


def misfits(model: Model, projections: Sequence[Projection], noises: Sequence[Sequence[Noise]]) -> list[str]:
    """Where the simulator leaves clearly more than noise, in words."""
    texts = []
    for one, projection, more, noise in zip(
        model.recordings, projections, excess(model, projections), noises, strict=True
    ):
        rms = np.sqrt(np.mean((one.values - projection.curve) ** 2, axis=1))
        for c, name in enumerate(one.channels):
            share = 100 * rms[c] / one.values[c].std()
            if more[c] > MISFIT:
                texts.append(
                    f"misfit: the simulator leaves {share:.2g}% of the scatter of {name} [{one.number}], {more[c]:.2g} "
                    "times what free sinusoids or noise leave: something that is taken as known is not, or the "
                    "motion is too large for small vibrations"
                )
            elif noise[c].coherent:
                texts.append(
                    f"misfit: what is left of {name} [{one.number}], {share:.2g}% of its scatter, moves as noise "
                    f"hardly does (chance {min(noise[c].peak, noise[c].envelope):.0e}): a later start may help"
                )
    return texts
