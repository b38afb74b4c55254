"""The noise of a batch's fits: what is left of every record, its memory, and the fit again where it has one.

Where a residual fails the tests of white noise, φ of each channel is estimated by restricted likelihood. The
products of Jacobian and residual with themselves and with their neighbours in time hold the likelihood of every φ,
so that a record is read once. With φ known, waves and data are whitened and the same search goes on from
the minimum of white noise, with a Gram matrix for each channel. Tests and likelihood are those of `noise`.

Symbols    φ memory from sample to sample   b basis of `batch_kernel`, then the constant   r weighted residual
           J = ∂r/∂p by four constants, four amplitudes and the offset   M(φ) whitened products of (J, r)
Valid for  as `batch_kernel`; over a gap of m steps φ is φ^m
Source     as `noise`
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.calibration.batch_kernel import Block, Shape, projected, shape, tangents
from jshell.calibration.noise import STRONGEST
from jshell.signals.lane_search import Look, begin, descend
from jshell.signals.lanes import centred, cholesky, lanewise, listed, total

SHARE = (np.sqrt(5) - 1) / 2  # of an interval, in a search by golden section
SECTIONS = 22  # of the range of φ: to 3e-5


class Given(eqx.Module):
    """Records side by side, and what their fits were given; the last axis of arrays is the block.

    Attributes:
        values: (channels, times, block) V and S, anything beyond the record.
        count: (block,) samples; so are `step`, `gas`, `wall` and `volume`, as in `Block`.
        weight: (channels, block) 1/σ².
        elapsed: (times, block) of uneven samples, else None.
    """

    values: Any
    count: Any
    step: Any
    gas: Any
    wall: Any
    volume: Any
    weight: Any
    elapsed: Any = None

    def block(self) -> Block:
        """As the search of white noise had it."""
        y, mean = centred(self.values, self.count)
        inside = (jnp.arange(y.shape[1])[:, None] < self.count).astype(float)
        power = total(self.weight[c] * jnp.sum(y[c] ** 2, axis=0) for c in range(2))
        return Block(
            y, mean, power, self.count, self.step, self.weight, self.gas, self.wall, self.volume, self.elapsed, inside
        )


class Remembering(NamedTuple):
    """A block whose noise is autocorrelated.

    Attributes:
        block: Its data.
        memory: (channels, times, block) over the step that leads to each sample; 0 at the first.
        count, power: As in `Block`; the power is that of the whitened data.
    """

    block: Block
    memory: jax.Array
    count: jax.Array
    power: jax.Array


def basis(modes: Shape, data: Block) -> Float[Array, "9 times block"]:
    """The eight functions and the constant at every sample, 0 where there is none."""
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
    waves = waves * data.inside
    return jnp.concatenate([waves, samples * waves, data.inside[None]])


def whitened(rows: jax.Array, memory: jax.Array, inside: jax.Array) -> jax.Array:
    """Rows (…, times, block) with the memory taken out, as `noise.whiten`."""
    before = jnp.concatenate([jnp.zeros_like(rows[..., :1, :]), rows[..., :-1, :]], axis=-2)
    return inside * (rows - memory * before) / jnp.sqrt(1 - memory**2)


def sums_of(
    b: jax.Array, y: jax.Array, memory: jax.Array, inside: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """Of one channel, whitened: Gram matrix and data sums at right angles to the constant, power, offset's share.

    Returns:
        (8, 8, block), (8, block), (block,), and (9, block): what the constant has of the eight and of the data.
    """
    b, y = whitened(b, memory, inside), whitened(y, memory, inside)
    G = jnp.stack([jnp.sum(b * one, axis=1) for one in b])
    d = jnp.sum(b * y, axis=1)
    share = jnp.concatenate([G[8, :8], d[8:]]) / G[8, 8]
    return (
        G[:8, :8] - G[:8, 8, None] * share[None, :8],
        d[:8] - G[:8, 8] * share[8],
        jnp.sum(y * y, axis=0) - d[8] * share[8],
        share,
    )


def look(unknowns: Float[Array, "unknowns block"], data: Remembering) -> Look:
    """As `batch_kernel.look`, of autocorrelated noise; the sums are the offsets (channels, block)."""
    one = data.block
    modes = shape(unknowns, one)
    b = basis(modes, one)
    parts = [sums_of(b, one.values[c], data.memory[c], one.inside) for c in range(2)]
    G, d = jnp.stack([p[0] for p in parts]), jnp.stack([p[1] for p in parts])
    power = total(one.weight[c] * parts[c][2] for c in range(2))
    at = projected(modes, d, G, power, jnp.zeros((2, data.count.size)), one)
    P = jnp.repeat(modes.shapes, 2, axis=1)
    offset = [parts[c][3][8] - total(P[c, i] * at.linear[i] * parts[c][3][i] for i in range(4)) for c in range(2)]
    return at._replace(sums=jnp.stack(offset))


def _white(unknowns: jax.Array, data: Block) -> tuple[Shape, jax.Array, Look]:
    """Modes, basis and look of white noise."""
    none = jnp.zeros((2, *data.values.shape[1:]))
    modes = shape(unknowns, data)
    return modes, basis(modes, data), look(unknowns, Remembering(data, none, data.count, data.power))


@eqx.filter_jit
@lanewise
def residual(unknowns: jax.Array, linear: jax.Array, rest: jax.Array, given: Given) -> jax.Array:
    """(channels, times, block) model less data, weighted, 0 beyond the record.

    Args:
        unknowns: (4, block).
        linear: (4, block) ΔV, ΔS and their rates at the first sample.
        rest: (2, block) V and S at rest.
        given: The records.
    """
    data = given.block()
    modes = shape(unknowns, data)
    b = basis(modes, data)
    curves = []
    # of the state at the first sample the factors of each mode: the shapes are of mass one, so that their inverse is
    # their transpose times the masses; two by two, it is written out
    V, S = modes.shapes
    determinant = V[0] * S[1] - V[1] * S[0]
    apart = lambda v, s: ((v * S[1] - s * V[1]) / determinant, (s * V[0] - v * S[0]) / determinant)  # noqa: E731
    cosine, rate = apart(linear[0], linear[1]), apart(linear[2], linear[3])
    sine = [(rate[m] + modes.rate * cosine[m]) / modes.damped[m] for m in range(2)]
    for c in range(2):
        curve = total(modes.shapes[c, m] * (cosine[m] * b[2 * m] + sine[m] * b[2 * m + 1]) for m in range(2))
        level = (data.mean[c] - rest[c]) * data.inside
        curves.append(jnp.sqrt(data.weight[c]) * (curve - level - data.values[c]))
    return jnp.stack(curves)


@eqx.filter_jit
@lanewise
def columns(unknowns: jax.Array, free: jax.Array, given: Given) -> jax.Array:
    """(channels, 10, times, block) columns of the Jacobian, weighted, then the residual, at the minimum of white noise.

    Args:
        unknowns: (4, block).
        free: (4,) 1 for a constant whose column is wanted, else 0.
        given: The records.
    """
    data = given.block()
    modes, b, at = _white(unknowns, data)
    X, P = tangents(list(at.linear), modes, data.step), jnp.repeat(modes.shapes, 2, axis=1)
    found = []
    for c in range(2):
        root = jnp.sqrt(data.weight[c])
        curve = total(P[c, i] * at.linear[i] * b[i] for i in range(4)) + at.sums[c] * b[8]
        rows = [free[u] * total(X[c, u, j] * b[j] for j in range(8)) for u in range(4)]
        rows += [P[c, i] * b[i] for i in range(4)] + [b[8], curve - data.values[c]]
        found.append(root * jnp.stack(rows))
    return jnp.stack(found)


@eqx.filter_jit
@lanewise
def memory_of(rows: jax.Array, free: jax.Array, count: jax.Array) -> jax.Array:
    """(channels, block) φ of greatest restricted likelihood of evenly sampled records, from `columns`."""
    x = jnp.concatenate([rows[0], rows[1]], axis=-1)  # both channels side by side, as lanes of their own
    count = jnp.concatenate([count, count])
    before, after, first = x[:, :-1], x[:, 1:], x[:, 0]
    # beyond a record's end its columns are 0, but its last sample is somebody's neighbour there: it is taken out
    before = before * (jnp.arange(1, x.shape[1])[:, None] < count)
    product = lambda a, b: jnp.stack([jnp.sum(a * one, axis=1) for one in b])  # noqa: E731
    late, early, cross = product(after, after), product(before, before), product(after, before)
    start = first[:, None] * first[None]
    size = jnp.sqrt(jnp.maximum(jnp.einsum("iib->ib", start + late), 1e-300))
    unit = size[:, None] * size[None]
    start, late, cross, early = (part / unit for part in (start, late, cross + jnp.swapaxes(cross, 0, 1), early))
    used = 5.0 + jnp.sum(free)

    def cost(phi):
        M = start + (late - phi * cross + phi**2 * early) / (1 - phi**2)
        L = cholesky(listed(M), count[0] >= 0)
        logs = total(-2 * jnp.log(L[j][j]) for j in range(9))
        return (count - 1) * jnp.log(1 - phi**2) + logs - (count - used) * 2 * jnp.log(L[9][9])

    return _least(cost, jnp.zeros_like(count), jnp.full_like(count, STRONGEST)).reshape(2, -1)


def _least(cost: Any, low: jax.Array, high: jax.Array) -> jax.Array:
    """Where a function of every lane is least, by golden section."""

    def step(_, state):
        low, high, left, right, at_left, at_right = state
        down = at_left < at_right  # the least lies below `right`
        low, high = jnp.where(down, low, left), jnp.where(down, right, high)
        new = jnp.where(down, high - SHARE * (high - low), low + SHARE * (high - low))
        seen = cost(new)
        left, right = jnp.where(down, new, right), jnp.where(down, left, new)
        return low, high, left, right, jnp.where(down, seen, at_right), jnp.where(down, at_left, seen)

    left, right = high - SHARE * (high - low), low + SHARE * (high - low)
    low, high, *_ = jax.lax.fori_loop(0, SECTIONS, step, (low, high, left, right, cost(left), cost(right)))
    return (low + high) / 2


class Again(NamedTuple):
    """Fits with autocorrelated noise: as the fields of `LaneResult`; the cost is that of the whitened residual."""

    unknowns: Any
    cost: Any
    normal: Any
    status: Any
    steps: Any
    state: Any
    omega: Any


@eqx.filter_jit
@lanewise
def again(start: jax.Array, memory: jax.Array, low: jax.Array, high: jax.Array, given: Given) -> tuple[Again, Again]:
    """The fits again with the memory of the noise, and what they were where they began.

    Args:
        start: (4, block) the minimum of white noise.
        memory: (channels, times, block).
        low, high: (4, block) bounds.
        given: The records.
    """
    block = given.block()
    power = [
        block.weight[c] * jnp.sum(whitened(block.values[c], memory[c], block.inside) ** 2, axis=0) for c in range(2)
    ]
    data = Remembering(block, memory, block.count, power[0] + power[1])
    first = begin(start, data, look)
    return _read(descend(first, data, low, high, look), block), _read(first, block)


def _read(search: Any, data: Block) -> Again:
    """A search as it stands."""
    modes, at = shape(search.unknowns, data), search.look
    cosine, sine = at.linear[0::2], at.linear[1::2]
    rates = modes.damped * sine - modes.rate * cosine
    motion = [total(modes.shapes[c, m] * x[m] for m in range(2)) for x in (cosine, rates) for c in range(2)]
    state = jnp.stack([*motion, *(data.mean[c] + at.sums[c] for c in range(2))])
    omega = jnp.sqrt(modes.damped**2 + modes.rate**2)
    return Again(search.unknowns, at.cost, at.normal, search.status, search.steps, state, omega)
