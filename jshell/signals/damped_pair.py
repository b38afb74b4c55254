"""Sums of damped sinusoids that share one decay time, fitted by variable projection.

    x_c(t) = offset_c + e^(-t/τ) Σ_m [C_mc cos(Ω_m t) + S_mc sin(Ω_m t)]

Offsets and amplitudes enter linearly: for given Ω and τ they follow from linear
least squares, so that the search runs over log Ω_1, …, log Ω_M, log τ only.
Logarithms of the damped Ω rather than of ω = sqrt(Ω² + 1/τ²), because every
value of theirs is a motion.

Symbols    Ω damped angular frequency   ω undamped   τ decay time   c channel   m mode
Source     variable projection: Golub & Pereyra 1973, with Kaufman's Jacobian (1975)
           equal decay of the modes: Mokbel et al. 2021, the fit of ΔV(t)
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jshell.signals.waves import SignalFit, SignalModel, search
from jshell.signals.waves_from_data import sound


@dataclass(frozen=True)
class DampedModes:
    """The best fit of damped sinusoids to a record, as plain numbers.

    Attributes:
        Omega: (modes,) damped angular frequencies, ascending.
        omega: (modes,) undamped, sqrt(Ω² + 1/τ²).
        tau: Decay time.
        errors: Standard errors of each ω and of τ, from the residual as white noise.
        offset: (channels,) rest values.
        residual: rms of what is left over rms of the signal about its offset, each channel by its own rms.
        converged: Whether a start came to rest at modes that are apart, turn, and lie in the record's reach.
    """

    Omega: np.ndarray
    omega: np.ndarray
    tau: float
    errors: np.ndarray
    offset: np.ndarray
    residual: float
    converged: bool


def fit(
    times: Float[np.ndarray, "times"],
    values: Float[np.ndarray, "channels times"],
    starts: Float[np.ndarray, "starts parameters"],
) -> DampedModes:
    """The best of several starts.

    Channels count by their own rms, so that a large one does not drown a small one.

    Args:
        times: Increasing times.
        values: Channels that share Ω and τ.
        starts: Ω of each mode, then the decay rate 1/τ.
    """
    elapsed, even, mean, scale = comparable(times, values)
    solutions = [search(SignalModel(starts.shape[1] - 1), elapsed, even, np.log(start)) for start in starts]
    best = min(solutions, key=lambda one: (not sound(one, elapsed), one.power))
    return damped_modes(best, elapsed, even, mean, scale)


def comparable(
    times: np.ndarray, values: np.ndarray, *, centred: bool = True
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Times from 0, channels centred and of unit scatter; what was taken off, and their scatters."""
    mean, scale = values.mean(axis=1) * centred, values.std(axis=1)
    return times - times[0], (values - mean[:, None]) / scale[:, None], mean, scale


def damped_modes(
    solution: SignalFit, elapsed: np.ndarray, values: np.ndarray, mean: np.ndarray, scale: np.ndarray
) -> DampedModes:
    """An ending as plain numbers, channels in their own units again."""
    Omega, sigma, M = solution.Omega, solution.sigma, solution.model.modes
    omega = np.sqrt(Omega**2 + sigma**2)
    # by log Ω of each mode, and by log σ, which all share
    slope = np.zeros((M + 1, solution.unknowns.size))
    slope[range(M), range(M)] = Omega**2 / omega
    slope[:M, M] = sigma**2 / omega
    slope[M, M] = 1 / sigma[0]
    errors = np.sqrt(np.maximum(np.einsum("ap,pq,aq->a", slope, solution.covariance, slope), 0))
    signal = values - solution.background(elapsed)
    offset = solution.background(elapsed[-1:])[:, 0] if solution.model.background else np.zeros(scale.size)
    return DampedModes(
        Omega=Omega,
        omega=omega,
        tau=float(1 / sigma[0]),
        errors=errors,
        offset=mean + scale * offset,
        residual=float(np.sqrt(solution.power / max(float(np.sum(signal**2)), 1e-300))),
        converged=sound(solution, elapsed),
    )
