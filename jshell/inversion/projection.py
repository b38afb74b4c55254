"""A recording under given modes: the amplitudes that describe it best, and what is left.

    channel(t) = rest + Σ_k Re(a_k φ_k e^{s_k t})

The amplitudes a_k are linear and are eliminated; every mode has one, shared by all channels, so that how much each
channel moves beside the others tells about the shell.

Symbols    s_k rates   φ_k change of the channels along mode k   B basis of the amplitudes   r what is left
Source     Golub & Pereyra 1973 for the derivative of the projection
"""

from typing import NamedTuple

import numpy as np

from jshell.calibration.noise import whiten

Rows = np.ndarray


class Modal(NamedTuple):
    """Modes of a shell in the record's units: rates (modes,), shapes (modes, channels), rest (channels,).

    Of derivatives the same, with a leading axis.
    """

    rates: np.ndarray
    shapes: np.ndarray
    rest: np.ndarray


class Projection(NamedTuple):
    """What modes leave of a recording.

    Attributes:
        residual: (channels · times,) weighted.
        jacobian: (channels · times, unknowns) of it, the amplitudes following.
        held: (channels · times, unknowns) the same with the amplitudes held.
        basis: (channels · times, amplitudes).
        amplitudes: (modes,) complex, at the first time.
        curve: (channels, times) in the record's units.
    """

    residual: np.ndarray
    jacobian: np.ndarray
    held: np.ndarray
    basis: np.ndarray
    amplitudes: np.ndarray
    curve: np.ndarray


def project(
    elapsed: np.ndarray,
    values: np.ndarray,
    weight: np.ndarray,
    memory: np.ndarray,
    modal: Modal,
    change: Modal,
    free_rest: bool = False,
) -> Projection:
    """Fit the amplitudes of a recording.

    Args:
        elapsed: (times,) from the window's start.
        values: (channels, times).
        weight: (channels,) one over the standard error.
        memory: (channels, times) φ of the noise over the step to each sample; zeros are white noise.
        modal: The modes.
        change: Their derivatives.
        free_rest: The rest values are amplitudes too.
    """
    channels, times = values.shape
    wave = np.exp(np.multiply.outer(modal.rates, elapsed))
    columns = _pairs(modal.shapes[:, :, None] * wave[:, None])
    if free_rest:
        still = np.broadcast_to(np.eye(channels)[:, :, None], (channels, channels, times))
        columns = np.concatenate([columns, still])
    level = np.zeros(channels) if free_rest else modal.rest
    fresh = lambda rows: _fresh(rows * weight[:, None], memory)  # noqa: E731

    y = fresh((values - level[:, None])[None])[0]
    B = fresh(columns).T
    size = np.linalg.norm(B, axis=0)
    size = np.where(size > 0, size, 1.0)
    u, s, vt = np.linalg.svd(B / size, full_matrices=False)
    kept = s > 1e-12 * s[0]
    u, inverse = u[:, kept], (vt[kept].T / s[kept])
    a = inverse @ (u.T @ y) / size
    r = y - B @ a
    held, follows = np.zeros((r.size, len(change.rates))), np.zeros((r.size, len(change.rates)))
    for i, (ds, dshape, drest) in enumerate(zip(*change, strict=True)):
        moved = dshape[:, :, None] + modal.shapes[:, :, None] * ds[:, None, None] * elapsed
        slope = _pairs(moved * wave[:, None])
        whole = np.tensordot(a[: len(slope)], slope, 1)
        if not free_rest:
            whole = whole + drest[:, None]
        held[:, i] = -fresh(whole[None])[0]
        turned = np.zeros(a.size)
        turned[: len(slope)] = fresh(slope) @ r
        follows[:, i] = held[:, i] - u @ (u.T @ held[:, i]) - u @ (inverse.T @ (turned / size))
    pairs = a[: 2 * len(modal.rates)].reshape(-1, 2)
    curve = np.tensordot(a, columns, 1) + level[:, None]
    return Projection(r, follows, held, B, pairs[:, 0] + 1j * pairs[:, 1], curve)


def _pairs(waves: np.ndarray) -> np.ndarray:
    """(2 modes, channels, times): what the real and the imaginary part of an amplitude make of complex waves."""
    return np.stack([np.real(waves), -np.imag(waves)], axis=1).reshape(-1, *waves.shape[1:])


def _fresh(rows: np.ndarray, memory: np.ndarray) -> np.ndarray:
    """(…, channels, times) with the memory of the noise taken out, as (…, channels · times)."""
    if memory.any():
        parts = [whiten(rows[:, c].T, memory[c]).T for c in range(rows.shape[1])]
        rows = np.stack(parts, axis=1)
    return rows.reshape(rows.shape[0], -1)
