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

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Int

GRID = 256  # samples the record is brought to, so that one program serves every record
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
        One array per order, the strongest rate first; an order that hears nothing is left out.
    """
    span = times[-1] - times[0]
    edges = np.linspace(times[0], times[-1], GRID + 1)
    means = []
    for channel in values - values.mean(axis=1, keepdims=True):
        pieces = np.diff(times) * (channel[1:] + channel[:-1]) / 2
        means.append(np.diff(np.interp(edges, times, np.append(0.0, np.cumsum(pieces)))) * GRID / span)
    even = np.stack(means, axis=1)
    step = span / GRID
    found = np.asarray(_poles_of_grid(jnp.asarray(even), jnp.asarray(step)))

    heard = []
    elapsed = step * np.arange(GRID)
    for row in found:
        growth, turn = np.real(row), np.imag(row)
        turning = np.isfinite(row) & (turn > 1.0 / span) & (turn < 0.9 * np.pi / step)
        s = row[turning & (-growth < SIDEWAYS * turn) & (growth < 2 / span)]
        if s.size:
            waves = np.exp(np.outer(elapsed, s))
            columns = np.concatenate([np.real(waves), np.imag(waves), np.ones((GRID, 1))], axis=1)
            cosine, sine = np.split(np.linalg.lstsq(columns, even, rcond=None)[0][:-1], 2)
            strength = np.sum(cosine**2 + sine**2, axis=1) * np.sum(np.abs(waves) ** 2, axis=0)
            heard.append(s[np.argsort(-strength)])
    return heard


@jax.jit
def _poles_of_grid(even: Float[Array, "times channels"], step: Float[Array, ""]) -> Complex[Array, "orders most"]:
    return poles(even, step, jnp.asarray(ORDERS), most=max(ORDERS))


def poles(
    values: Float[Array, "times channels"],
    step: Float[Array, ""],
    orders: Int[Array, "orders"],
    *,
    most: int,
    rows: int | None = None,
) -> Complex[Array, "orders most"]:
    """Complex poles s of a record, for several truncation orders at once.

    Args:
        values: Evenly sampled record; several channels are taken to share their poles.
        step: Sampling step.
        orders: Number of poles to keep, each at most `most`. A real mode needs two, an offset one.
        most: Length of the answer's second axis.
        rows: Pencil parameter, the Hankel matrix's width less one; a third of the record by default.

    Returns:
        s = -1/τ + iΩ per pole [1/time]; beyond an order's own poles, -inf.

    Example:
        >>> t = 0.1 * jnp.arange(100)
        >>> x = jnp.exp(-t / 5) * jnp.cos(2 * t)
        >>> s = poles(x[:, None], jnp.asarray(0.1), jnp.asarray([2]), most=2)
        >>> print(jnp.abs(s.imag).round(6))
        [[2. 2.]]
    """
    width = values.shape[0] // 3 if rows is None else rows
    starts = jnp.arange(values.shape[0] - width)
    hankel = values[starts[:, None] + jnp.arange(width + 1)[None, :]]  # (starts, width + 1, channels)
    stacked = jnp.moveaxis(hankel, -1, 0).reshape(-1, width + 1)

    _, _, vh = jnp.linalg.svd(stacked, full_matrices=False)
    space = vh[:most].T

    def keep(order: Int[Array, ""]) -> Complex[Array, "most"]:
        kept = jnp.arange(most) < order
        V = jnp.where(kept[None, :], space, 0.0)
        before, after = V[:-1], V[1:]
        gram = before.T @ before + jnp.diag(jnp.where(kept, 0.0, 1.0))
        z = jnp.linalg.eigvals(jnp.linalg.solve(gram, before.T @ after))
        # the dropped directions have z = 0 exactly or to rounding: s far to the left
        return jnp.where(jnp.abs(z) > 1e-9, jnp.log(jnp.where(z == 0, 1.0, z)) / step, -jnp.inf)

    return jax.vmap(keep)(orders)
