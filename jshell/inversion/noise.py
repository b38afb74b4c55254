"""What the noise of the recordings is, read off what the simulator leaves of them.

Symbols    φ memory of AR(1) noise from sample to sample   σ standard error of a sample
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from jshell.calibration.noise import MISFIT, Noise, examine, remembered, steps_between
from jshell.inversion.model import Model, Weighing
from jshell.inversion.projection import Left
from jshell.inversion.recording import Recording

SMALLEST = 1e-7  # of a channel's scatter: numbers of a file are not finer
LONGEST = 0.5  # of a slow period: what remembers longer is no noise
STEADY = 0.02  # relative change of σ, and change of φ, below which the noise is taken as known
EXPLAINED = 1.2  # of what free sinusoids leave: up to there the simulator describes a recording as well as they do


def first_weighing(one: Recording, modes: tuple[int, ...], free_rest: bool) -> Weighing:
    """White noise of the size that a recording shows itself."""
    scatter = one.values.std(axis=1)
    sigma = one.sigma if one.sigma is not None else np.maximum(one.noise, SMALLEST * scatter)
    return Weighing(modes, sigma, np.zeros(one.values.shape), free_rest=free_rest)


def examined(model: Model, lefts: Sequence[Left], weighings: Sequence[Weighing]) -> list[list[Noise]]:
    """The tests of calibration, of every channel of every recording."""
    found = []
    for one, left, weighing in zip(model.recordings, lefts, weighings, strict=True):
        raw = (one.values - left.curve) / weighing.sigma[:, None]
        plain = np.concatenate([left.held, left.basis], axis=1).reshape(*one.values.shape, -1)
        rows = []
        for c, name in enumerate(one.channels):
            J = plain[c] if not weighing.memory.any() else _slopes(left, weighing, c, one)
            rows.append(examine(f"{name} [{one.number}]", raw[c], J, one.times, np.ones(one.times.size)))
        found.append(rows)
    return found


def _slopes(left: Left, weighing: Weighing, c: int, one: Recording) -> np.ndarray:
    """The Jacobian of one channel with the memory of the noise put back."""
    whitened = np.concatenate([left.held, left.basis], axis=1).reshape(*one.values.shape, -1)[c]
    out, phi = whitened.copy(), weighing.memory[c]
    for k in range(1, len(out)):
        out[k] = phi[k] * out[k - 1] + np.sqrt(1 - phi[k] ** 2) * whitened[k]
    return out


def reweighed(
    model: Model, lefts: Sequence[Left], weighings: Sequence[Weighing], noises: Sequence[Sequence[Noise]]
) -> tuple[list[Weighing], bool]:
    """Weighings by what is left, and whether they are still those from before."""
    found, steady = [], True
    for one, left, old, noise in zip(model.recordings, lefts, weighings, noises, strict=True):
        steps = steps_between(one.times)
        longest = LONGEST * 2 * np.pi / float(np.min(one.Omega)) / float(np.median(np.diff(one.times)))
        most = float(np.exp(-1 / max(longest, 0.1)))
        memory = np.stack([remembered(min(n.memory, most), steps) * (np.arange(steps.size) > 0) for n in noise])
        sigma = old.sigma
        if one.sigma is None:
            raw = one.values - left.curve
            varied = left.basis.shape[1] + left.held.shape[1]
            rms = np.sqrt(np.sum(raw**2, axis=1) / max(1.0, one.times.size - varied / len(one.channels)))
            sigma = np.maximum(rms, SMALLEST * one.values.std(axis=1))
        steady &= bool(np.all(np.abs(sigma / old.sigma - 1) < STEADY) and np.all(np.abs(memory - old.memory) < STEADY))
        found.append(replace(old, sigma=sigma, memory=memory))
    return found, steady


def free_residual(one: Recording) -> np.ndarray:
    """(channels,) rms of what damped sinusoids of the recording's own frequencies leave."""
    elapsed = one.times - one.times[0]
    wave = np.exp(np.multiply.outer(elapsed, 1j * one.Omega - 1 / one.tau))
    basis = np.column_stack([np.ones(elapsed.size), np.real(wave), np.imag(wave)])
    left = one.values.T - basis @ np.linalg.lstsq(basis, one.values.T, rcond=None)[0]
    return np.sqrt(np.mean(left**2, axis=0))


def excess(model: Model, lefts: Sequence[Left]) -> list[np.ndarray]:
    """Of every channel, rms of what the simulator leaves over that of free sinusoids or of the noise, the larger."""
    found = []
    for one, left in zip(model.recordings, lefts, strict=True):
        rms = np.sqrt(np.mean((one.values - left.curve) ** 2, axis=1))
        floor = np.maximum(np.maximum(one.noise, free_residual(one)), SMALLEST * one.values.std(axis=1))
        if one.sigma is not None:
            floor = np.maximum(floor, one.sigma)
        found.append(rms / floor)
    return found


def described(model: Model, lefts: Sequence[Left]) -> bool:
    """Whether the simulator describes all recordings as well as free sinusoids do."""
    return all(np.all(part < EXPLAINED) for part in excess(model, lefts))


def misfits(model: Model, lefts: Sequence[Left], noises: Sequence[Sequence[Noise]]) -> list[str]:
    """Where the simulator leaves clearly more than noise, in words."""
    texts = []
    for one, left, more, noise in zip(model.recordings, lefts, excess(model, lefts), noises, strict=True):
        rms = np.sqrt(np.mean((one.values - left.curve) ** 2, axis=1))
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
