"""Matrix pencil: the frequencies in a record, without a first guess.

A sum of M exponentials z_m^k fills the rows of a Hankel matrix with a space of
dimension M that is carried into itself by one step in time. The singular
vectors give that space, truncation keeps noise out of it, and the step's
eigenvalues are the poles. Several channels share poles: their Hankel matrices
stand on top of each other.

Symbols    z pole per step [-]   s = log(z)/dt = -1/τ + iΩ   M order, two per real mode
Valid for  even sampling, fewer than half a turn per step
Source     Hua & Sarkar 1990, IEEE Trans. ASSP 38, 814
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Complex, Float

GRID = 256  # samples the record is brought to, enough for two modes, and cheap
ORDERS = (4, 6, 8, 10, 12, 16)
SIDEWAYS = 1.5  # a pole that decays faster than this times its turning is no oscillation


def rates(times: Float[np.ndarray, "times"], values: Float[np.ndarray, "channels times"]) -> list[np.ndarray]:
    """Oscillating rates s = -1/τ + iΩ, Ω > 0, of a record, for several truncation orders.

    The record is brought to an even grid by averages over its cells: an average of an exponential is
    the same exponential, and noise above the grid's reach is averaged away.

    Args:
        times: Increasing times, evenly spaced or not.
        values: Channels that share their rates, of comparable size.

    Returns:
        One array per order, the strongest rate first; an order that finds nothing is left out.
    """
    span = times[-1] - times[0]
    edges = np.linspace(times[0], times[-1], GRID + 1)
    means = []
    for channel in values - values.mean(axis=1, keepdims=True):
        pieces = np.diff(times) * (channel[1:] + channel[:-1]) / 2
        means.append(np.diff(np.interp(edges, times, np.append(0.0, np.cumsum(pieces)))) * GRID / span)
    even = np.stack(means, axis=1)
    step = span / GRID
    found = []
    elapsed = step * np.arange(GRID)
    for row in poles(even, float(step), ORDERS):
        growth, turn = np.real(row), np.imag(row)
        oscillating = (turn > 1.0 / span) & (turn < 0.9 * np.pi / step)
        s = row[oscillating & (-growth < SIDEWAYS * turn) & (growth < 2 / span)]
        if s.size:
            waves = np.exp(np.outer(elapsed, s))
            columns = np.concatenate([np.real(waves), np.imag(waves), np.ones((GRID, 1))], axis=1)
            cosine, sine = np.split(np.linalg.lstsq(columns, even, rcond=None)[0][:-1], 2)
            strength = np.sum(cosine**2 + sine**2, axis=1) * np.sum(np.abs(waves) ** 2, axis=0)
            found.append(s[np.argsort(-strength)])
    return found


def poles(
    values: Float[np.ndarray, "times channels"],
    step: float | int,
    orders: Sequence[int],
    *,
    rows: int | None = None,
) -> list[Complex[np.ndarray, " order"]]:
    """Complex poles s of a record, for several truncation orders at once.

    Args:
        values: Evenly sampled record; several channels are taken to share their poles.
        step: Sampling step.
        orders: Numbers of poles to keep. A real mode needs two, an offset one.
        rows: Pencil parameter, the Hankel matrix's width less one; a third of the record by default.

    Returns:
        s = -1/τ + iΩ per pole [1/time], one array per order; none where the record holds no numbers.

    Example:
        >>> t = 0.1 * np.arange(100)
        >>> x = np.exp(-t / 5) * np.cos(2 * t)
        >>> (s,) = poles(x[:, None], 0.1, [2])
        >>> print(np.abs(s.imag).round(6))
        [2. 2.]
    """
    width = values.shape[0] // 3 if rows is None else rows
    hankel = np.lib.stride_tricks.sliding_window_view(values, width + 1, axis=0)[:-1]  # (starts, channels, width + 1)
    stacked = np.swapaxes(hankel, 0, 1).reshape(-1, width + 1)
    if not np.all(np.isfinite(stacked)):
        return [np.zeros(0, dtype=complex) for _ in orders]
    # the triangular factor has the same right singular vectors, and the left ones of the tall matrix are not wanted
    subspace = np.linalg.svd(np.linalg.qr(stacked, mode="r"), full_matrices=False)[2].T
    found = []
    for order in orders:
        last = subspace[-1, :order]
        overlap = subspace[:-1, :order].T @ subspace[1:, :order]
        # the columns are orthonormal, so that leaving out their last row takes one dyad from their Gram matrix
        step_on = overlap + np.outer(last, last @ overlap) / max(1 - last @ last, 1e-12)
        z = np.linalg.eigvals(step_on)
        found.append(np.log(z[np.abs(z) > 1e-9].astype(complex)) / step)
    return found
