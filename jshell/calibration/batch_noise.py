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

import math
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.calibration.batch_kernel import projected, tangents
from jshell.calibration.batch_residual import Given, amplitudes, left_of
from jshell.calibration.batch_shape import Block, angular_frequencies, first_motion, shape
from jshell.calibration.batch_waves import basis, even_sums, products, uneven_sums, waves_of, whitened
from jshell.calibration.noise import STRONGEST
from jshell.signals.lane_search import CONVERGED, Evaluation, begin, descend
from jshell.signals.lanes import VECTORS, barrier, cholesky, lanewise, total
from jshell.signals.wave_sums import data_sums

SHARE = (np.sqrt(5) - 1) / 2  # of an interval, in a search by golden section
SECTIONS = 22  # of the range of φ: to 3e-5


class Ar1Block(NamedTuple):
    """A block whose noise is autocorrelated.

    Attributes:
        block: Its data.
        whitened: (channels, times, block) data with the memory taken out.
        phi: (channels, block).
        memory: (channels, times, block) over the step that leads to each uneven sample, 0 at the first; else None.
        ends: (channels, 3, block) the first of `whitened`, their sum and their sum of squares.
        count, power: As in `Block`; the power is that of the whitened data.
    """

    block: Block
    whitened: jax.Array
    phi: jax.Array
    memory: jax.Array | None
    ends: jax.Array
    count: jax.Array
    power: jax.Array


def evaluate(unknowns: Float[Array, "unknowns block"], data: Ar1Block) -> Evaluation:
    """As `batch_kernel.evaluate`, of autocorrelated noise; the sums are the offsets (channels, block)."""
    one, channels = data.block, range(len(data.phi))
    always_true = data.count[0] >= 0
    modes = barrier(lambda u: shape(u, one), always_true, unknowns)
    if data.memory is None:
        waves, real, imag = waves_of(modes, one)
        d = data_sums(data.whitened, real, imag, always_true)
        parts = [
            barrier(lambda w, d, c=c: even_sums(w, data.phi[c], d[c], data.ends[c], data.count), always_true, waves, d)
            for c in channels
        ]
    else:
        b = basis(modes, one)
        parts = [uneven_sums(b, data.whitened[c], data.memory[c], one.inside) for c in channels]
    G, d = jnp.stack([p[0] for p in parts]), jnp.stack([p[1] for p in parts])
    power = total(one.weight[c] * parts[c][2] for c in channels)
    at = projected(modes, d, G, power, jnp.zeros((len(channels), data.count.size)), one)
    P, C = jnp.repeat(modes.shapes, 2, axis=1), at.linear.reshape(-1, 4, data.count.size)
    C = C if one.modal else [C[0], C[0]]
    offset = [parts[c][3][8] - total(P[c, i] * C[c][i] * parts[c][3][i] for i in range(4)) for c in channels]
    return at._replace(sums=jnp.stack(offset))


@partial(jax.jit, compiler_options=VECTORS)
@lanewise
def columns(unknowns: jax.Array, state: jax.Array, free: jax.Array, given: Given) -> jax.Array:
    """(channels, 9, times, block) columns of the Jacobian at the minimum of white noise, weighted.

    Args:
        unknowns: (4, block).
        state: As `linear` of `residual`.
        free: (4,) 1 for a constant whose column is wanted, else 0.
        given: The records.
    """
    data = given.block()
    modes = shape(unknowns, data)
    b, X = basis(modes, data), tangents(amplitudes(modes, state, data), modes, data.step)
    P, found = jnp.repeat(modes.shapes, 2, axis=1), []
    for c in range(len(data.weight)):
        rows = [free[u] * total(X[c, u, j] * b[j] for j in range(8)) for u in range(4)]
        rows += [P[c, i] * b[i] for i in range(4)] + [b[8]]
        found.append(jnp.sqrt(data.weight[c]) * jnp.stack(rows))
    return jnp.stack(found)


@partial(jax.jit, compiler_options=VECTORS)
@lanewise
def memory_of(unknowns: jax.Array, state: jax.Array, free: jax.Array, r: jax.Array, given: Given) -> jax.Array:
    """(channels, block) φ of greatest restricted likelihood of evenly sampled records.

    Args:
        unknowns, state, free: As in `columns`.
        r: (channels, times, block) residual, from `residual`.
        given: The records.
    """
    data = given.block()
    always_true = data.count[0] >= 0
    modes = barrier(lambda u: shape(u, data), always_true, unknowns)
    waves, real, imag = waves_of(modes, data)
    d = data_sums(r, real, imag, data.count[0] >= 0)
    ends = data.count - 1
    size, angle = jnp.exp(-modes.rate * data.step * ends), modes.damped * data.step * ends
    last = jnp.stack([size * wave(angle[m]) for m in range(2) for wave in (jnp.cos, jnp.sin)])
    last = jnp.concatenate([last, ends * last])
    X = barrier(lambda modes: tangents(amplitudes(modes, state, data), modes, data.step), always_true, modes)
    P = jnp.repeat(modes.shapes, 2, axis=1)

    def of_columns(M, c):
        """Of (J, r) from those of (b, 1, r)."""

        def rows(M):
            moved = [free[u] * total(X[c, u, j] * M[j] for j in range(8)) for u in range(4)]
            return jnp.stack([*moved, *(P[c, i] * M[i] for i in range(4)), M[8], M[9]])

        return rows(jnp.swapaxes(rows(M), 0, 1))

    each, channels = [], len(data.weight)
    for c in range(channels):
        parts = barrier(lambda w, r, d, c=c: products(w, r[c], d[c], data.count, last), always_true, waves, r, d)
        each.append([barrier(lambda M, c=c: of_columns(M, c), always_true, M) for M in parts])
    # all channels side by side, as lanes of their own
    start, late, cross, early = (jnp.concatenate(pair, axis=-1) for pair in zip(*each, strict=True))
    count = jnp.concatenate([data.count] * channels)
    length = jnp.sqrt(jnp.maximum(jnp.einsum("iib->ib", start + late), 1e-300))
    unit = length[:, None] * length[None]
    start, late, cross, early = (_lower(part / unit) for part in (start, late, cross, early))
    used = 5.0 + jnp.sum(free)

    def cost(phi):
        M = start + (late - phi * cross + phi**2 * early) / (1 - phi**2)
        L = cholesky(_rows(M), count[0] >= 0)
        logs = -2 * jnp.log(math.prod(L[j][j] for j in range(9)))  # of a matrix of unit diagonal: none is large
        return (count - 1) * jnp.log(1 - phi**2) + logs - (count - used) * 2 * jnp.log(L[9][9])

    return _least(cost, jnp.zeros_like(count), jnp.full_like(count, STRONGEST)).reshape(channels, -1)


def _lower(M: jax.Array) -> jax.Array:
    """(55, block) lower triangle of a (10, 10, block) symmetric matrix, row by row."""
    return M[np.tril_indices(10)]


def _rows(lower: jax.Array) -> list[list[jax.Array]]:
    """The same as lists of a symmetric matrix."""
    at = lambda i, j: lower[max(i, j) * (max(i, j) + 1) // 2 + min(i, j)]  # noqa: E731
    return [[at(i, j) for j in range(10)] for i in range(10)]


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
    """Fits with autocorrelated noise: as the fields of `LaneResult`.

    The cost is that of the whitened residual; `power` that of the residual itself.
    """

    unknowns: Any
    cost: Any
    normal: Any
    state: Any
    omega: Any
    slope: Any
    power: Any


@partial(jax.jit, compiler_options=VECTORS)
@lanewise
def again(
    start: jax.Array, rested: jax.Array, phi: jax.Array, memory: jax.Array | None, box: tuple[jax.Array, jax.Array],
    given: Given,
) -> Again:  # fmt: skip
    """The fits again with the memory of the noise; where they began for those that do not come to rest within bounds.

    Args:
        start: (4, block) the minimum of white noise.
        rested: (block,) whether it is one, of a model that describes the record.
        phi: (channels, block).
        memory: (channels, times, block) over the step to each sample of uneven records, else None.
        box: Lowest and highest, (4, block) each; of what is fixed they are alike.
        given: The records.
    """
    low, high = box
    block = given.block()
    over = memory
    if over is None:
        later = jnp.arange(block.values.shape[1])[:, None] > 0
        over = jnp.where(later, phi[:, None], 0.0)
    always_true = block.count[0] >= 0
    y = barrier(
        lambda y, m: jnp.stack([whitened(one, p, block.inside) for one, p in zip(y, m, strict=True)]),
        always_true,
        block.values,
        over,
    )
    ends = barrier(lambda y: jnp.stack([y[:, 0], jnp.sum(y, axis=1), jnp.sum(y * y, axis=1)], axis=1), always_true, y)
    power = total(w * one[2] for w, one in zip(block.weight, ends, strict=True))
    data = Ar1Block(block, y, phi, memory, ends, block.count, power)
    first = begin(start, data, evaluate)
    moved = descend(first, data, low, high, evaluate)
    inside = jnp.all(((moved.unknowns > low) & (moved.unknowns < high)) | (low == high), axis=0)
    good = rested & (moved.status == CONVERGED) & inside & jnp.isfinite(moved.evaluation.cost)
    return _read(jax.tree.map(lambda new, old: jnp.where(good, new, old), moved, first), block)


def _read(search: Any, data: Block) -> Again:
    """A search as it stands."""
    modes, at = shape(search.unknowns, data), search.evaluation
    rest = [mean + offset for mean, offset in zip(data.mean, at.sums, strict=True)]

    def found(state):
        # the values of a block are less their means
        left = left_of(modes, state[: -len(rest)], at.sums, data, data.inside)
        power = jnp.sum(left * left, axis=(0, 1))
        return Again(search.unknowns, at.cost, at.normal, state, *angular_frequencies(modes), power)

    if data.modal:
        return found(jnp.concatenate([at.linear, jnp.stack(rest)]))
    return found(jnp.stack([*first_motion(modes, at.linear), *rest]))
