"""Two poles of each of many records at once: the matrix pencil, batch axis last.

A record is brought to cells, averages of a few samples. All windows of WIDTH
cells, centred so that an offset drops out exactly, have a covariance whose
four leading eigenvectors span the two decaying waves (subspace iteration finds
them); one step in time carries that space into itself, and the step's
eigenvalues are the poles (roots of its characteristic polynomial).

Symbols    z pole per cell [-]   s = log(z)/cell = -1/τ + iΩ
Valid for  two modes, fewer than half a turn per cell
Source     Hua & Sarkar 1990, IEEE Trans. ASSP 38, 814
"""

import math

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jshell.signals.lanes import backward, barrier, cholesky, forward, listed, total

CELLS = 100  # a record has about so many
TOGETHER = 4  # windows that are summed in one pass
WIDTH = 24  # cells of a window: it must hold half a turn of the slow mode
ORDER = 4
SWEEPS = 6  # of the subspace iteration
ROOT_STEPS = 20


def poles(
    values: Float[Array, "channels times block"],
    count: Float[Array, " block"],
    scale: Float[Array, "channels block"],
    cell: int,
    always_true: Bool[Array, ""],
) -> tuple[Float[Array, "2 block"], Float[Array, "2 block"]]:
    """Growth and turn per sample of the two modes, slow first.

    Args:
        values: Records less their means, 0 beyond each record.
        count: Samples of each record.
        scale: Factor that makes the channels comparable.
        cell: Samples per cell.
        always_true: True.

    Returns:
        Real and imaginary part of log z per sample. A mode that does not turn has turn 0.
    """
    y, whole = barrier(lambda v, n, s: _cells(v, n, s, cell), always_true, values, count, scale)
    R = barrier(_covariance, always_true, y, whole)
    Q = _leading(R, always_true)
    step = _carried(Q, always_true)
    return barrier(lambda c: _turns(c, cell), always_true, barrier(_polynomial, always_true, step))


def _cells(values, count, scale, cell: int):
    """(channels, cells, block) means of whole cells, 0 beyond; number of whole cells."""
    channels, times, block = values.shape
    padded = jnp.pad(values, ((0, 0), (0, -times % cell), (0, 0))) * scale[:, None]
    y = jnp.sum(padded.reshape(channels, -1, cell, block), axis=2) / cell
    whole = jnp.floor(count / cell)
    return jnp.where(jnp.arange(y.shape[1])[None, :, None] < whole, y, 0.0), whole


def _covariance(y: Float[Array, "channels cells block"], whole: Float[Array, " block"]):
    """(WIDTH, WIDTH, block) of all centred windows, summed over channels."""
    channels, cells, block = y.shape
    windows = jnp.maximum(whole - WIDTH + 1, 1.0)  # of each record
    padded = jnp.pad(y, ((0, 0), (0, WIDTH + TOGETHER), (0, 0)))
    begins = padded * (jnp.arange(padded.shape[1])[:, None] < windows[None])  # the first cells of windows

    def gather(group, products):
        # a few windows at a time: sums are read from memory and written once for all of them
        i = group * TOGETHER
        cell = jax.lax.dynamic_slice_in_dim(begins, i, TOGETHER, 1)
        window = jax.lax.dynamic_slice_in_dim(padded, i, WIDTH + TOGETHER - 1, 1)
        return products + total(cell[c, q] * window[c, q : q + WIDTH] for c in range(channels) for q in range(TOGETHER))

    first = jax.lax.fori_loop(0, -(-cells // TOGETHER), gather, jnp.zeros((WIDTH, block)))

    # every further row, and mean, from the one before: a window enters at the end, one leaves at the start
    last = windows.astype(int)[None, None] + jnp.arange(WIDTH)[None, :, None]
    enters = jnp.take_along_axis(padded, jnp.broadcast_to(last, (channels, WIDTH, block)), axis=1)
    sums = [jnp.sum(begins, axis=1)]
    for j in range(1, WIDTH):
        sums.append(sums[-1] + enters[:, j - 1] - padded[:, j - 1])
    means = jnp.stack(sums, axis=1) / windows
    rows = [first]
    for j in range(1, WIDTH):
        change = total(
            enters[c, j - 1] * enters[c, j - 1 : WIDTH - 1] - padded[c, j - 1] * padded[c, j - 1 : WIDTH - 1]
            for c in range(channels)
        )
        rows.append(jnp.concatenate([jnp.zeros((j, block)), rows[-1][j - 1 : -1] + change]))
    upper = jnp.stack(rows)
    on = jnp.eye(WIDTH)[:, :, None]
    full = upper + jnp.swapaxes(upper * (1 - on), 0, 1)
    return full - windows * total(means[c, :, None] * means[c, None, :] for c in range(channels))


def _leading(R: Float[Array, "width width block"], always_true) -> Float[Array, "width order block"]:
    """An orthonormal basis of the four leading eigenvectors."""

    def orthonormal(Z):
        N = barrier(lambda Z: total(Z[k, :, None] * Z[k, None, :] for k in range(WIDTH)), always_true, Z)
        L = cholesky(listed(N), always_true)
        return jnp.stack(forward(L, [Z[:, i] for i in range(ORDER)], always_true), axis=1)

    def sweep(_, Q):
        return orthonormal(barrier(lambda R, Q: total(R[:, k, None] * Q[k] for k in range(WIDTH)), always_true, R, Q))

    first = jnp.stack([R[:, k] for k in (1, 7, 14, 21)], axis=1)
    return jax.lax.fori_loop(0, SWEEPS, sweep, orthonormal(first))


def _carried(Q: Float[Array, "width order block"], always_true) -> Float[Array, "order order block"]:
    """The matrix that carries the space one cell on, by least squares."""

    def products(Q):
        before, after = Q[:-1], Q[1:]
        of = lambda a, b: total(a[k, :, None] * b[k, None, :] for k in range(WIDTH - 1))  # noqa: E731
        return of(before, before), of(before, after)

    N, right = barrier(products, always_true, Q)
    L = cholesky(listed(N), always_true)
    return jnp.stack(backward(L, forward(L, [right[i] for i in range(ORDER)], always_true), always_true))


def _polynomial(F: Float[Array, "order order block"]) -> Float[Array, "order block"]:
    """Coefficients of its characteristic polynomial, constant first, less the leading 1 (Faddeev-LeVerrier)."""
    on = jnp.eye(ORDER)[:, :, None]
    M, found = jnp.zeros_like(F), [jnp.ones_like(F[0, 0])]
    for k in range(1, ORDER + 1):
        M = total(F[:, j, None] * M[j][None] for j in range(ORDER)) + on * found[-1]
        product = total(F[i, j] * M[j, i] for i in range(ORDER) for j in range(ORDER))
        found.append(-product / k)
    return jnp.stack(found[:0:-1])


def _turns(c: Float[Array, "order block"], cell: int):
    """The two roots in the upper half plane, as growth and turn per sample; Durand-Kerner for all four."""
    seeds = [0.9 * complex(math.cos(a), math.sin(a)) for a in (0.4, -0.5, 1.1, -1.3)]
    roots = tuple(jnp.full(c.shape[1], seed) for seed in seeds)

    def better(_, roots):
        found = list(roots)
        for i in range(ORDER):
            z = found[i]
            value = (((z + c[3]) * z + c[2]) * z + c[1]) * z + c[0]
            apart = [z - found[j] for j in range(ORDER) if j != i]
            product = apart[0] * apart[1] * apart[2]
            size = jnp.maximum(jnp.real(product) ** 2 + jnp.imag(product) ** 2, 1e-30)
            found[i] = z - value * jnp.conj(product) / size
        return tuple(found)

    z = jnp.stack(jax.lax.fori_loop(0, ROOT_STEPS, better, roots))
    turn = jnp.arctan2(jnp.imag(z), jnp.real(z))
    growth = jnp.log(jnp.maximum(jnp.abs(z), 1e-6))
    upward = jnp.where(jnp.imag(z) > 1e-9, turn, jnp.inf)
    first = jnp.argmin(upward, axis=0)
    others = jnp.where(jnp.arange(ORDER)[:, None] == first[None], jnp.inf, upward)
    second = jnp.argmin(others, axis=0)
    pick = lambda x, k: jnp.take_along_axis(x, k[None], axis=0)[0]  # noqa: E731
    turns = jnp.stack([pick(upward, first), pick(others, second)])
    return jnp.stack([pick(growth, first), pick(growth, second)]) / cell, jnp.where(turns < jnp.inf, turns, 0.0) / cell
