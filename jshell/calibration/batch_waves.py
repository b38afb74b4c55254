"""The waves of a batch's fits at every sample, and sums of them: whitened, and with their neighbours in time.

Of an even record the sums are closed: a step back turns the waves and lets them grow. Of an uneven one they are
made sample by sample.

Symbols    φ memory from sample to sample   b basis of `batch_kernel`, then the constant   r weighted residual
Valid for  as `batch_kernel`; over a gap of m steps φ is φ^m
Source     geometric sums of z^t, t^k z^t; whitening as `noise`
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.calibration.batch_shape import Block, Shape
from jshell.signals.wave_sums import gram


class Waves(NamedTuple):
    """The basis of an even record: what leads from a sample to the one before, and closed sums.

    Attributes:
        grown, cosine, sine: (modes, block) of one step back: growth, and cosine and sine of the turn.
        first: (8, 1) the basis at the first sample.
        gram: (8, 8, block) of all samples but the first.
        sums: (8, block) of the same.
    """

    grown: jax.Array
    cosine: jax.Array
    sine: jax.Array
    first: jax.Array
    gram: jax.Array
    sums: jax.Array

    def earlier(self, x: jax.Array, sign: int = 1) -> jax.Array:
        """From what is linear in b_k, (8, …), the same of b_(k-1); of b_(k+1) where `sign` is -1."""
        size = self.grown if sign > 0 else 1 / self.grown
        turned = []
        for part in (x[:4], x[4:]):
            for m in range(2):
                a, b, c, s = part[2 * m], part[2 * m + 1], size * self.cosine[m], sign * size * self.sine[m]
                turned += [c * a + s * b, c * b - s * a]
        waves, late = jnp.stack(turned[:4]), jnp.stack(turned[4:])
        return jnp.concatenate([waves, late - sign * waves])


def waves_of(modes: Shape, data: Block) -> tuple[Waves, jax.Array, jax.Array]:
    """The basis of an even record; and Re z, Im z (modes, block)."""
    always_true = data.count[0] >= 0
    decay, turn = modes.rate * data.step, modes.damped * data.step
    G, sums = gram(decay, turn, data.count, always_true)
    first = jnp.array([1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])[:, None]
    G = G + sums[:, None] * sums[None] / data.count - first[:, None] * first[None]
    size = jnp.exp(-decay)
    cosine, sine = jnp.cos(turn), jnp.sin(turn)
    return Waves(1 / size, cosine, sine, first, G, sums - first), size * cosine, size * sine


def basis(modes: Shape, data: Any, inside: Any = None) -> Float[Array, "9 times block"]:
    """The eight functions and the constant at every sample, 0 where there is none; `inside` as in `Block`."""
    inside = data.inside if inside is None else inside
    size = data.values.shape[1]
    decay, turn = modes.rate * data.step, modes.damped * data.step
    if data.elapsed is None:
        # powers by doubling: z^t for twice as many t costs one product each
        a, b = jnp.exp(-decay) * jnp.cos(turn), jnp.exp(-decay) * jnp.sin(turn)
        r, i = jnp.ones_like(a)[None], jnp.zeros_like(a)[None]
        while r.shape[0] < size:
            r, i = jnp.concatenate([r, r * a - i * b]), jnp.concatenate([i, r * b + i * a])
            a, b = a * a - b * b, 2 * a * b
        waves = jnp.stack([r[:size, 0], i[:size, 0], r[:size, 1], i[:size, 1]])
        samples = jnp.arange(size, dtype=float)[:, None]
    else:
        samples = data.elapsed / data.step
        fade = jnp.exp(-decay * samples)
        waves = jnp.stack([fade * wave(turn[m] * samples) for m in range(2) for wave in (jnp.cos, jnp.sin)])
    waves = waves * inside
    return jnp.concatenate([waves, samples * waves, inside[None]])


def whitened(rows: jax.Array, memory: jax.Array, inside: jax.Array) -> jax.Array:
    """Rows (…, times, block) with the memory taken out, as `noise.whiten`."""
    before = jnp.concatenate([jnp.zeros_like(rows[..., :1, :]), rows[..., :-1, :]], axis=-2)
    return inside * (rows - memory * before) / jnp.sqrt(1 - memory**2)


def centred_sums(G: jax.Array, d: jax.Array, power: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """Of nine functions, the constant last: sums at right angles to it, and its share.

    Args:
        G: (9, 9, block) Gram matrix.
        d: (9, block) with the data.
        power: (block,) of the data.

    Returns:
        (8, 8, block), (8, block), (block,), and (9, block): what the constant has of the eight and of the data.
    """
    share = jnp.concatenate([G[8, :8], d[8:]]) / G[8, 8]
    return (
        G[:8, :8] - G[:8, 8, None] * share[None, :8],
        d[:8] - G[:8, 8] * share[8],
        power - d[8] * share[8],
        share,
    )


def even_sums(waves: Waves, phi: jax.Array, d: jax.Array, ends: jax.Array, count: jax.Array):
    """`centred_sums` of one channel of an even record, whitened, from closed sums.

    Args:
        waves: The basis.
        phi: (block,) memory.
        d: (8, block) of the whitened data with the basis, every sample.
        ends: (3, block) the first of the whitened data, their sum and their sum of squares.
        count: Samples.
    """
    root = jnp.sqrt(1 - phi**2)
    fresh = lambda x: (x - phi * waves.earlier(x)) / root  # noqa: E731
    level, first, (start, whole, power) = (1 - phi) / root, waves.first, ends
    G = fresh(jnp.swapaxes(fresh(waves.gram), 0, 1)) + first[:, None] * first[None]
    side = level * fresh(waves.sums) + first
    d = fresh(d - start * first) + start * first
    corner = level**2 * (count - 1) + 1
    of_constant = level * (whole - start) + start
    G = jnp.concatenate([jnp.concatenate([G, side[None]]), jnp.concatenate([side, corner[None]])[:, None]], axis=1)
    return centred_sums(G, jnp.concatenate([d, of_constant[None]]), power)


def uneven_sums(b: jax.Array, y: jax.Array, memory: jax.Array, inside: jax.Array):
    """The same of an uneven record, sample by sample; `b` (9, times, block) as it is, `y` whitened."""
    b = whitened(b, memory, inside)
    G = jnp.stack([jnp.sum(b * one, axis=1) for one in b])
    return centred_sums(G, jnp.sum(b * y, axis=1), jnp.sum(y * y, axis=0))


def products(waves: Waves, r: jax.Array, d: jax.Array, count: jax.Array, last: jax.Array) -> list[jax.Array]:
    """Of basis, constant and residual, each (10, 10, block): the first sample's product; the products of every later
    sample with itself, of it with the one before (both ways added), and of the one before with itself.

    Args:
        waves: The basis.
        r: (times, block) residual, 0 beyond the record.
        d: (8, block) of the residual with the basis.
        count: Samples.
        last: (8, block) the basis at the last sample.
    """
    whole, first, start = jnp.sum(r, axis=0), waves.first * jnp.ones_like(count), r[0]
    end = jnp.sum(jnp.where(jnp.arange(r.shape[0])[:, None] == count - 1, r, 0.0), axis=0)
    power, neighbours = jnp.sum(r * r, axis=0), jnp.sum(r[1:] * r[:-1], axis=0)
    back, on = waves.earlier, lambda x: waves.earlier(x, -1)
    G, sums = waves.gram, waves.sums
    with_late, with_early = d - start * first, d - end * last
    turned = back(G)  # Σ b_(k-1) b_k

    def matrix(block, constant, residual, corner, between, square):
        top = jnp.concatenate([block, constant[:, None], residual[:, None]], axis=1)
        middle = jnp.concatenate([constant, corner[None], between[None]])
        bottom = jnp.concatenate([residual, between[None], square[None]])
        return jnp.concatenate([top, middle[None], bottom[None]])

    n, one = count - 1, jnp.ones_like(count)
    return [
        matrix(first[:, None] * first[None], first, start * first, one, start, start**2),
        matrix(G, sums, with_late, n, whole - start, power - start**2),
        matrix(
            turned + jnp.swapaxes(turned, 0, 1), sums + back(sums), on(with_early) + back(with_late), 2 * n,
            2 * whole - start - end, 2 * neighbours,
        ),
        matrix(back(jnp.swapaxes(turned, 0, 1)), back(sums), with_early, n, whole - end, power - end**2),
    ]  # fmt: skip
