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

from jshell.calibration.batch_kernel import projected, tangents
from jshell.calibration.batch_shape import Block, Shape, pulsations, shape
from jshell.calibration.batch_waves import basis, even_sums, products, uneven_sums, waves_of, whitened
from jshell.calibration.noise import STRONGEST
from jshell.signals.lane_search import Look, begin, descend
from jshell.signals.lanes import centred, cholesky, lanewise, listed, stage, total
from jshell.signals.wave_sums import INNER, data_sums, powers

SHARE = (np.sqrt(5) - 1) / 2  # of an interval, in a search by golden section
SECTIONS = 22  # of the range of φ: to 3e-5


class Given(eqx.Module):
    """Records side by side, and what their fits were given; the last axis of arrays is the block.

    Attributes:
        values: (channels, times, block), V and S for the strict loss, anything beyond the record.
        count: (block,) samples; so are `step`, `gas`, `wall` and `volume`, as in `Block`.
        weight: (channels, block) 1/σ².
        elapsed: (times, block) of uneven samples, else None.
        modal: As in `Block`.
    """

    values: Any
    count: Any
    step: Any
    gas: Any
    wall: Any
    volume: Any
    weight: Any
    elapsed: Any = None
    modal: bool = eqx.field(static=True, default=False)

    def block(self) -> Block:
        """As the search of white noise had it."""
        y, mean = centred(self.values, self.count)
        inside = (jnp.arange(y.shape[1])[:, None] < self.count).astype(float)
        power = total(w * jnp.sum(one**2, axis=0) for w, one in zip(self.weight, y, strict=True))
        return Block(
            y, mean, power, self.count, self.step, self.weight, self.gas, self.wall, self.volume, self.elapsed, inside,
            self.modal,
        )  # fmt: skip


class Remembering(NamedTuple):
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


def look(unknowns: Float[Array, "unknowns block"], data: Remembering) -> Look:
    """As `batch_kernel.look`, of autocorrelated noise; the sums are the offsets (channels, block)."""
    one, channels = data.block, range(len(data.phi))
    go = data.count[0] >= 0
    modes = stage(lambda u: shape(u, one), go, unknowns)
    if data.memory is None:
        waves, real, imag = waves_of(modes, one)
        d = data_sums(data.whitened, real, imag, go)
        parts = [
            stage(lambda w, d, c=c: even_sums(w, data.phi[c], d[c], data.ends[c], data.count), go, waves, d)
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


def amplitudes(modes: Shape, state: jax.Array, data: Block) -> list[list[jax.Array]]:
    """Cosine and sine of the slow mode, then of the fast one, for each channel.

    Args:
        modes: The modes.
        state: ΔV, ΔS and their rates at the first sample, which both channels share; of the modal loss the amplitudes.
        data: The block.
    """
    if data.modal:
        return [list(state[4 * c : 4 * c + 4]) for c in range(len(data.weight))]
    V, S = modes.shapes
    determinant = V[0] * S[1] - V[1] * S[0]
    apart = lambda v, s: ((v * S[1] - s * V[1]) / determinant, (s * V[0] - v * S[0]) / determinant)  # noqa: E731
    cosine, rate = apart(state[0], state[1]), apart(state[2], state[3])
    sine = [(rate[m] + modes.rate * cosine[m]) / modes.damped[m] for m in range(2)]
    return [[cosine[0], sine[0], cosine[1], sine[1]]] * 2


class Left(NamedTuple):
    """What is left of a block, and the sums that the tests of `noise` ask for; (channels, block) each.

    Attributes:
        residual: (channels, times, block) model less data, weighted, 0 beyond the record.
        power: Its sum of squares.
        mean: Its mean.
        neighbours: Sum of products of neighbours, the mean taken out.
        above, changes: Samples above the mean, and changes of sign.
        halves: (2, channels, block) sums of the root of its size, in the first half and in all.
    """

    residual: Any
    power: Any
    mean: Any
    neighbours: Any
    above: Any
    changes: Any
    halves: Any


@eqx.filter_jit
@lanewise
def residual(unknowns: jax.Array, linear: jax.Array, rest: jax.Array, given: Given) -> Left:
    """What is left of every record.

    Args:
        unknowns: (4, block).
        linear: (4, block) ΔV, ΔS and their rates at the first sample; of the modal loss amplitudes of each channel.
        rest: (channels, block) at rest.
        given: The records.
    """
    size, count = given.values.shape[1], given.count
    inside = (jnp.arange(size)[:, None] < count).astype(float)
    values = jnp.where(inside > 0, given.values, 0.0)
    plain = Block(
        values, rest, count, count, given.step, given.weight, given.gas, given.wall, given.volume, given.elapsed,
        inside, given.modal,
    )  # fmt: skip
    go = count[0] >= 0
    modes = stage(lambda u: shape(u, plain), go, unknowns)

    def left(modes):
        C, P = amplitudes(modes, linear, plain), jnp.repeat(modes.shapes, 2, axis=1)
        parts = [[P[c, i] * one[i] for i in range(4)] for c, one in enumerate(C)]
        if given.elapsed is None:
            curve = jnp.stack([_motion(part, modes, given.step, go, size) for part in parts])
        else:
            b = basis(modes, plain)
            curve = jnp.stack([total(part[i] * b[i] for i in range(4)) for part in parts])
        return jnp.sqrt(given.weight)[:, None] * inside * (curve + rest[:, None] - values)

    r = stage(left, go, modes)
    mean = stage(lambda r: jnp.sum(r, axis=1) / count, go, r)
    e = stage(lambda r, mean: jnp.where(jnp.arange(size)[:, None] < count, r - mean[:, None], 0.0), go, r, mean)
    root = stage(lambda r: jnp.sqrt(jnp.abs(r)), go, r)

    def sums(r, e, root):
        after = jnp.arange(1, size)[:, None] < count
        change = ((e[:, 1:] > 0) != (e[:, :-1] > 0)) & after
        early = jnp.arange(size)[:, None] < jnp.floor(count / 2)
        halves = jnp.stack([jnp.sum(jnp.where(early, root, 0.0), axis=1), jnp.sum(root, axis=1)])
        neighbours = jnp.sum(e[:, 1:] * e[:, :-1], axis=1)
        number = lambda mark: jnp.sum(jnp.where(mark, 1.0, 0.0), axis=1)  # noqa: E731
        return jnp.sum(r * r, axis=1), neighbours, number(e > 0), number(change), halves

    power, neighbours, above, changes, halves = stage(sums, go, r, e, root)
    return Left(r, power, mean, neighbours, above, changes, halves)


def _motion(C: list[jax.Array], modes: Shape, step: jax.Array, go: jax.Array, size: int) -> jax.Array:
    """(times, block) of one channel at even samples: every sixteenth by doubling, those between from it in one pass."""
    decay, turn = modes.rate * step, modes.damped * step
    fade = jnp.exp(-decay)
    groups = size // INNER
    real, imag, lengths = stage(lambda x, y: powers(x, y, groups), go, fade * jnp.cos(turn), fade * jnp.sin(turn))

    def starts(C, lengths):
        # c1 Re z^t + c2 Im z^t = Re((c1 - i c2) z^t)
        a, b = jnp.stack([C[0], C[2]])[None], -jnp.stack([C[1], C[3]])[None]
        for x, y in lengths:
            a, b = jnp.concatenate([a, a * x - b * y]), jnp.concatenate([b, a * y + b * x])
        return a[:groups, None], b[:groups, None]

    a, b = stage(starts, go, C, lengths)
    return total(a[:, :, m] * real[None, :, m] - b[:, :, m] * imag[None, :, m] for m in range(2)).reshape(size, -1)


@eqx.filter_jit
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


@eqx.filter_jit
@lanewise
def memory_of(unknowns: jax.Array, state: jax.Array, free: jax.Array, r: jax.Array, given: Given) -> jax.Array:
    """(channels, block) φ of greatest restricted likelihood of evenly sampled records.

    Args:
        unknowns, state, free: As in `columns`.
        r: (channels, times, block) residual, from `residual`.
        given: The records.
    """
    data = given.block()
    go = data.count[0] >= 0
    modes = stage(lambda u: shape(u, data), go, unknowns)
    waves, real, imag = waves_of(modes, data)
    d = data_sums(r, real, imag, data.count[0] >= 0)
    ends = data.count - 1
    size, angle = jnp.exp(-modes.rate * data.step * ends), modes.damped * data.step * ends
    last = jnp.stack([size * wave(angle[m]) for m in range(2) for wave in (jnp.cos, jnp.sin)])
    last = jnp.concatenate([last, ends * last])
    X = stage(lambda modes: tangents(amplitudes(modes, state, data), modes, data.step), go, modes)
    P = jnp.repeat(modes.shapes, 2, axis=1)

    def of_columns(M, c):
        """Of (J, r) from those of (b, 1, r)."""

        def rows(M):
            moved = [free[u] * total(X[c, u, j] * M[j] for j in range(8)) for u in range(4)]
            return jnp.stack([*moved, *(P[c, i] * M[i] for i in range(4)), M[8], M[9]])

        return rows(jnp.swapaxes(rows(M), 0, 1))

    each, channels = [], len(data.weight)
    for c in range(channels):
        parts = stage(lambda w, r, d, c=c: products(w, r[c], d[c], data.count, last), go, waves, r, d)
        each.append([stage(lambda M, c=c: of_columns(M, c), go, M) for M in parts])
    # all channels side by side, as lanes of their own
    start, late, cross, early = (jnp.concatenate(pair, axis=-1) for pair in zip(*each, strict=True))
    count = jnp.concatenate([data.count] * channels)
    length = jnp.sqrt(jnp.maximum(jnp.einsum("iib->ib", start + late), 1e-300))
    unit = length[:, None] * length[None]
    start, late, cross, early = (part / unit for part in (start, late, cross, early))
    used = 5.0 + jnp.sum(free)

    def cost(phi):
        M = start + (late - phi * cross + phi**2 * early) / (1 - phi**2)
        L = cholesky(listed(M), count[0] >= 0)
        logs = total(-2 * jnp.log(L[j][j]) for j in range(9))
        return (count - 1) * jnp.log(1 - phi**2) + logs - (count - used) * 2 * jnp.log(L[9][9])

    return _least(cost, jnp.zeros_like(count), jnp.full_like(count, STRONGEST)).reshape(channels, -1)


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
    slope: Any


@eqx.filter_jit
@lanewise
def again(
    start: jax.Array, phi: jax.Array, memory: jax.Array | None, low: jax.Array, high: jax.Array, given: Given
) -> tuple[Again, Again]:
    """The fits again with the memory of the noise, and what they were where they began.

    Args:
        start: (4, block) the minimum of white noise.
        phi: (channels, block).
        memory: (channels, times, block) over the step to each sample of uneven records, else None.
        low, high: (4, block) bounds.
        given: The records.
    """
    block = given.block()
    over = memory
    if over is None:
        later = jnp.arange(block.values.shape[1])[:, None] > 0
        over = jnp.where(later, phi[:, None], 0.0)
    go = block.count[0] >= 0
    y = stage(
        lambda y, m: jnp.stack([whitened(one, p, block.inside) for one, p in zip(y, m, strict=True)]),
        go,
        block.values,
        over,
    )
    ends = stage(lambda y: jnp.stack([y[:, 0], jnp.sum(y, axis=1), jnp.sum(y * y, axis=1)], axis=1), go, y)
    power = total(w * one[2] for w, one in zip(block.weight, ends, strict=True))
    data = Remembering(block, y, phi, memory, ends, block.count, power)
    first = begin(start, data, look)
    return _read(descend(first, data, low, high, look), block), _read(first, block)


def _read(search: Any, data: Block) -> Again:
    """A search as it stands."""
    modes, at = shape(search.unknowns, data), search.look
    rest = [mean + offset for mean, offset in zip(data.mean, at.sums, strict=True)]
    if data.modal:
        state = jnp.concatenate([at.linear, jnp.stack(rest)])
        return Again(search.unknowns, at.cost, at.normal, search.status, search.steps, state, *pulsations(modes))
    cosine, sine = at.linear[0::2], at.linear[1::2]
    rates = modes.damped * sine - modes.rate * cosine
    motion = [total(modes.shapes[c, m] * x[m] for m in range(2)) for x in (cosine, rates) for c in range(2)]
    state = jnp.stack([*motion, *rest])
    return Again(search.unknowns, at.cost, at.normal, search.status, search.steps, state, *pulsations(modes))
