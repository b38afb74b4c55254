"""The fast fit of one block of traces: everything for 64 of them at once, batch axis last.

Both modes decay alike, so that a trace is

    V(t) = V∞ + Σ_m V_m Re(c_m z_m^t)    S(t) = S∞ + Σ_m S_m Re(c_m z_m^t)    m = slow, fast

with z_m = exp((-σ + iΩ_m) Δ), t counted in steps Δ. The mode shapes (V_m, S_m)
and Ω_m follow from α1, α2, k_VS; c_m and the rest values are linear and are
eliminated. Model and Jacobian lie in the span of z_m^t and t z_m^t, whose
products have closed geometric sums: a step reads the data once, for Σ y z^t
and Σ t y z^t, and is small algebra otherwise. Records of any length share a
program: what is padded is zero in the data, and the closed sums know the length.

Symbols    σ = 1/τ   Ω² = ω² - σ²   u = (log α1, log α2, k_VS, log σ) unknowns
           b = (Re z-^t, Im z-^t, Re z+^t, Im z+^t, then t times these) basis   G its Gram matrix, centred
Valid for  even sampling, equal decay, both modes underdamped
Source     Golub & Pereyra 1973, Kaufman 1975 (projection); Nielsen 1999 (damping of the step);
           Mokbel et al. 2021: eq:eqmovadimV, eq:eqmovadimS
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.calibration import batch_modal
from jshell.calibration.batch_shape import UNKNOWNS, Block, Shape, angular_frequencies, first_motion, shape, uncoupled
from jshell.calibration.data import SMALLEST_NOISE
from jshell.shell.elasticity import SPHERE_VOLUME
from jshell.signals.lane_search import Evaluation, LMState, begin, descend
from jshell.signals.lanes import backward, barrier, centred, cholesky, forward, lanewise, listed, spreads, total
from jshell.signals.pencil_batch import poles
from jshell.signals.wave_sums import data_sums, gram, uneven_sums


def evaluate(unknowns: Float[Array, "unknowns block"], data: Block) -> Evaluation:
    """Cost, gradient and normal matrix with the best linear parameters.

    Args:
        unknowns: Where.
        data: The traces.
    """
    always_true = data.count[0] >= 0

    def rates(unknowns):
        modes = shape(unknowns, data)
        return modes, modes.rate * data.step, modes.damped * data.step

    def roots(decay, turn):
        size = jnp.exp(-decay)
        return size * jnp.cos(turn), size * jnp.sin(turn)

    modes, decay, turn = barrier(rates, always_true, unknowns)
    # closed geometric sums of the waves: an even record is read once, for its own sums with them
    if data.elapsed is None:
        real, imag = barrier(roots, always_true, decay, turn)
        d = data_sums(data.values, real, imag, always_true)
        G, sums = gram(decay, turn, data.count, always_true)
    else:
        d, G, sums = uneven_sums(
            data.values, data.elapsed / data.step, data.inside, decay, turn, data.count, always_true
        )

    return projected(modes, d, G, data.power, sums, data)


def projected(modes: Shape, d: jax.Array, G: jax.Array, power: jax.Array, sums: jax.Array, data: Block) -> Evaluation:
    """Cost, gradient and normal matrix from the sums over a record.

    Args:
        modes: At the unknowns.
        d: (channels, 8, block) of the data with the basis.
        G: (8, 8, block) of the basis with itself; or (channels, 8, 8, block) where it is weighed otherwise in each.
        power: Weighted sum of squares of the data.
        sums: Of the basis; passed on.
        data: The traces.
    """
    if data.modal:
        return batch_modal.projected(modes, d, G, power, sums, data)
    always_true, w = data.count[0] >= 0, data.weight
    each = G if G.ndim == 4 else G[None]

    def linear(G, d, shapes):
        P = jnp.repeat(shapes, 2, axis=1)  # (channels, 4, block): shape of the mode behind each basis function
        squares = [w[c] * P[c][:, None] * P[c][None, :] for c in range(2)]
        # V and S share four amplitudes: their normal equations add up; t times a wave comes in with derivatives only
        W = total(squares) * G[:4, :4] if G.ndim == 3 else total(squares[c] * G[c, :4, :4] for c in range(2))
        return P, W, total(w[c] * P[c] * d[c, :4] for c in range(2))

    P, N, right = barrier(linear, always_true, G, d, modes.shapes)
    L = cholesky(listed(N), always_true)
    # variable projection: what the best amplitudes C explain, half·half, is taken off the power of the data
    half = forward(L, [right[i] for i in range(4)], always_true)
    C = backward(L, half, always_true)
    cost = power - total(x * x for x in half)

    # Kaufman: of the derivatives at fixed C, what the amplitudes could follow is projected out
    X = barrier(lambda C, modes: tangents([C, C], modes, data.step), always_true, C, modes)
    GX = barrier(lambda G, X: total(X[:, :, j, None] * G[:, None, j] for j in range(8)), always_true, each, X)
    mixed = barrier(
        lambda GX, P: total(w[c] * GX[c, :, :4] * P[c] for c in range(2)), always_true, GX, P
    )  # (unknowns, 4, block)
    U = forward(L, [mixed[:, j] for j in range(4)], always_true)

    def products(X, GX, mixed, U, C):
        straight = total(w[c] * X[c, :, None, j] * GX[c, None, :, j] for c in range(2) for j in range(8))
        gradient = total(w[c] * X[c, :, j] * d[c, j] for c in range(2) for j in range(8))
        gradient = gradient - total(mixed[:, j] * C[j] for j in range(4))
        return gradient, straight - total(U[j][:, None] * U[j][None, :] for j in range(4)), jnp.stack(C)

    gradient, normal, best = barrier(products, always_true, X, GX, mixed, U, C)
    # modes that do not turn, or meet, are no such motion: a step to there is refused
    cost = jnp.where(modes.sound & jnp.isfinite(cost), cost, jnp.inf)
    return Evaluation(cost, gradient, normal, best, sums)


def tangents(
    amplitudes: list[list[jax.Array]], modes: Shape, step: jax.Array
) -> Float[Array, "channels unknowns 8 block"]:
    """Derivatives of the model by the unknowns, in the basis, at fixed amplitudes, four of each channel."""
    zero = jnp.zeros_like(step)
    decay_slope = [zero, zero, zero, modes.rate * step]
    tangents = []
    for c, C in enumerate(amplitudes):
        for u in range(UNKNOWNS):
            early, late = [], []
            for m in range(2):
                r, i, own = C[2 * m], C[2 * m + 1], modes.shapes[c, m]
                turn_slope, shape_slope = modes.damped_slope[u, m] * step, modes.shape_slope[c, u, m]
                # another shape scales a wave; another decay or turn gives t times it
                early += [shape_slope * r, shape_slope * i]
                late += [own * (i * turn_slope - r * decay_slope[u]), own * (-r * turn_slope - i * decay_slope[u])]
            tangents += early + late
    return jnp.stack(tangents).reshape(len(amplitudes), UNKNOWNS, 8, -1)


Numbers = Any  # arrays of NumPy outside, of JAX inside


class BlockInput(eqx.Module):
    """Traces as they come, side by side.

    Attributes:
        values: (channels, times, block), V and S for the strict loss, anything beyond the record.
        count: (block,) samples of each record; so are all but `sigma`, (channels, block).
        step: Time between samples.
        sigma: Standard errors of each channel, NaN where its own noise is to be taken.
        volume: V_e, NaN where the record says where it rests.
        pressure: P_e.
        gas_pressure: P0.
        kappa: Polytropic exponent.
        area_modulus: K_A.
        elapsed: Times of uneven samples, else None; `values` then is the record brought to even times, for the start.
        uneven: The record itself at those times; with `elapsed`.
        noise: (channels, block) its own; with `elapsed`.
        modal: Whether channels have amplitudes of their own.
        volume_at: The channel that is V; only where the record says where it rests.
    """

    values: Numbers
    count: Numbers
    step: Numbers
    sigma: Numbers
    volume: Numbers
    pressure: Numbers
    gas_pressure: Numbers
    kappa: Numbers
    area_modulus: Numbers
    elapsed: Numbers | None = None
    uneven: Numbers | None = None
    noise: Numbers | None = None
    modal: bool = eqx.field(static=True, default=False)
    volume_at: int = eqx.field(static=True, default=0)


class PreparedBlock(NamedTuple):
    """A block ready to fit, and a start from its data.

    Attributes:
        data, start: The block, and its (unknowns, block).
        pressure: P_e.
        identified: Whether two modes were found.
    """

    data: Block
    start: jax.Array
    pressure: jax.Array
    identified: jax.Array


def prepare(inputs: BlockInput, low: jax.Array, high: jax.Array, cell: int) -> PreparedBlock:
    """Means, weights, rest states and starts.

    Args:
        inputs: The traces.
        low, high: Bounds of the unknowns; what is fixed has both alike.
        cell: Samples per cell of the matrix pencil.
    """
    channels = range(inputs.values.shape[0])
    always_true = inputs.count[0] >= 0
    y, mean = barrier(centred, always_true, inputs.values, inputs.count)
    square, noise = barrier(spreads, always_true, y, inputs.count)
    # each channel in units of its scatter, so that the pencil weighs all alike; one that stands still divides by no 0
    scale = jax.lax.rsqrt(jnp.maximum(square, 1e-300))
    growth, turn = poles(y, inputs.count, scale, cell, always_true)

    def common(growth, turn, step, count):
        # one rate for both, that neither grows nor dies within a turn
        decay = jnp.clip(-(growth[0] + growth[1]) / 2, 0.05 / count, 0.5 * jnp.maximum(turn[0], 1e-6))
        size = jnp.exp(-decay)
        return decay, turn, size * jnp.cos(turn), size * jnp.sin(turn)

    decay, turn, real, imag = barrier(common, always_true, growth, turn, inputs.step, inputs.count)
    G, sums = gram(decay, turn, inputs.count, always_true)
    d = data_sums(y, real, imag, always_true)
    L = cholesky(listed(G[:4, :4]), always_true)
    waves = [
        jnp.stack(backward(L, forward(L, [d[c, i] for i in range(4)], always_true), always_true)) for c in channels
    ]
    # at rest a channel is at its mean less that of the waves
    offset = mean - jnp.stack([total(waves[c][i] * sums[i] for i in range(4)) for c in channels]) / inputs.count

    volume = jnp.where(jnp.isnan(inputs.volume), offset[inputs.volume_at], inputs.volume)
    own = inputs.gas_pressure * (SPHERE_VOLUME / jnp.maximum(volume, 1e-3)) ** inputs.kappa
    pressure = jnp.where(jnp.isnan(inputs.volume), own, inputs.pressure)
    # of uneven records the start came from even times; what is fitted is the record itself
    inside = None
    if inputs.elapsed is not None:
        assert inputs.noise is not None
        y, mean = barrier(centred, always_true, inputs.uneven, inputs.count)
        square, noise = barrier(spreads, always_true, y, inputs.count)[0], inputs.noise**2
        inside = (jnp.arange(y.shape[1])[:, None] < inputs.count).astype(float)
    # a record without noise would weigh without end: below a thousandth of the scatter all are weighed alike
    floor = SMALLEST_NOISE**2 * square
    weight = 1 / jnp.where(jnp.isnan(inputs.sigma), jnp.maximum(noise, floor), inputs.sigma**2)
    power = total(weight[c] * square[c] * inputs.count for c in channels)
    gas, wall = inputs.kappa * pressure / volume, inputs.area_modulus / (4 * jnp.pi)
    data = Block(
        y, mean, power, inputs.count, inputs.step, weight, gas, wall, volume, inputs.elapsed, inside, inputs.modal
    )
    if inputs.modal:
        start = barrier(lambda turn, decay: batch_modal.start(turn, decay, data, low, high), always_true, turn, decay)
    else:
        start = barrier(lambda w, s, r: _constants(w, s, r, data, always_true), always_true, waves, decay, turn)
    identified = (turn[0] > 0) & (turn[1] < 0.9 * jnp.pi) & jnp.all(jnp.isfinite(start), axis=0)
    # an unknown whose start is lost begins at α1 = 1, α2 = 1, k_VS = 0 or τ = 1: the search may still find the way
    return PreparedBlock(data, jnp.where(jnp.isfinite(start), start, 0.0), pressure, identified)


def _constants(waves: list[jax.Array], decay: jax.Array, turn: jax.Array, data: Block, always_true) -> jax.Array:
    """The unknowns from the modes by linear least squares, as `starts.strict_start` does."""
    V, S = waves
    rate = decay / data.step
    w2 = (turn**2 + decay**2) / data.step**2
    largest = lambda x: jnp.maximum(jnp.sqrt(jnp.maximum(x[0] ** 2 + x[1] ** 2, x[2] ** 2 + x[3] ** 2)), 1e-300)  # noqa: E731
    first, second = 1 / (data.gas * largest(V)), 1 / (data.wall * largest(S))
    m1, m2 = uncoupled(1.0, 1.0, data.volume, data.gas, data.wall).masses
    # of each wave both equations of motion, linear in the constants, each in units of its stiffness and largest wave
    lines = []  # coefficients of alpha1, alpha2, k, and the right side
    zero = jnp.zeros_like(rate)
    for i in range(4):
        w = w2[i // 2]
        lines.append((first * w * m1 * V[i], zero, -first * S[i] / data.volume, first * data.gas * V[i]))
        lines.append((zero, second * m2 * w * S[i], -second * V[i] / data.volume, second * data.wall * S[i]))
    N = [[total(line[i] * line[j] for line in lines) for j in range(3)] for i in range(3)]
    right = [total(line[i] * line[3] for line in lines) for i in range(3)]
    L = cholesky(N, always_true)
    alpha1, alpha2, k = backward(L, forward(L, right, always_true), always_true)
    # noise may give a mass below 0, which has no logarithm
    logs = [jnp.log(jnp.clip(x, 0.05, 50.0)) for x in (alpha1, alpha2)]
    return jnp.stack([*logs, k, jnp.log(rate)])


class LaneResult(NamedTuple):
    """How the fits of a block ended.

    Attributes:
        unknowns, start: (unknowns, block), at the end and at the beginning.
        cost, normal: As in `Evaluation`, at the end.
        status, steps: As in `LMState`.
        weight: (channels, block).
        state: (6, block) ΔV, ΔS and their rates at the first sample, V and S at rest; of the modal loss (5 channels,
            block) cosine and sine of the slow and of the fast mode of each channel, then all channels at rest.
        omega, rest: (2, block) undamped angular frequencies; V_e and P_e of the model.
        slope: (unknowns, 2, block) derivatives of `omega`.
        identified: Whether the start is two modes of the record's.
    """

    unknowns: Any
    cost: Any
    normal: Any
    status: Any
    steps: Any
    weight: Any
    state: Any
    omega: Any
    slope: Any
    rest: Any
    start: Any
    identified: Any


def nothing_found(rows: int, channels: int, *, modal: bool) -> LaneResult:
    """Before any record was fitted: zeros of NumPy, `rows` last."""
    u, linear = UNKNOWNS, 5 * channels if modal else 6
    shapes = (u,), (), (u, u), (), (), (channels,), (linear,), (2,), (u, 2), (2,), (u,), ()
    kinds = {"status": int, "steps": int, "identified": bool}
    return LaneResult(
        *(np.zeros((*s, rows), kinds.get(name, float)) for s, name in zip(shapes, LaneResult._fields, strict=True))
    )


def solve(
    inputs: BlockInput, start: Float[Array, "unknowns block"], low: jax.Array, high: jax.Array, cell: int
) -> LaneResult:
    """Fit a block.

    Args:
        inputs: The traces.
        start: Where to begin; NaN takes the start from the data.
        low: Lower bounds of the unknowns, (unknowns, block).
        high: Upper bounds.
        cell: Samples per cell of the matrix pencil.
    """
    prepared = prepare(inputs, low, high, cell)
    first = jnp.clip(jnp.where(jnp.isnan(start), prepared.start, start), low, high)
    search = descend(begin(first, prepared.data, evaluate), prepared.data, low, high, evaluate)
    always_true = inputs.count[0] >= 0

    def read(search, data):
        modes, at = shape(search.unknowns, data), search.evaluation
        if data.modal:
            swing = [total(at.linear[4 * c + i] * at.sums[i] for i in range(4)) for c in range(len(data.mean))]
            rest = [data.mean[c] - part / data.count for c, part in enumerate(swing)]
            return jnp.concatenate([at.linear, jnp.stack(rest)]), *angular_frequencies(modes)
        swing = [
            total(
                modes.shapes[c, m] * (at.linear[2 * m] * at.sums[2 * m] + at.linear[2 * m + 1] * at.sums[2 * m + 1])
                for m in range(2)
            )
            for c in range(2)
        ]
        rest = [data.mean[c] - swing[c] / data.count for c in range(2)]
        return jnp.stack([*first_motion(modes, at.linear), *rest]), *angular_frequencies(modes)

    state, omega, slope = barrier(read, always_true, search, prepared.data)
    return found_of(search, prepared, first, state, omega, slope)


def found_of(
    search: LMState, prepared: PreparedBlock, first: jax.Array, state: jax.Array, omega: jax.Array, slope: jax.Array
) -> LaneResult:
    """A search that has ended, with what was read off it."""
    at, rest = search.evaluation, jnp.stack([prepared.data.volume, prepared.pressure])
    return LaneResult(
        search.unknowns, at.cost, at.normal, search.status, search.steps, prepared.data.weight, state, omega, slope,
        rest, first, prepared.identified,
    )  # fmt: skip


@lanewise
def solve_blocks(
    inputs: BlockInput, start: jax.Array, low: jax.Array, high: jax.Array, cell: int, used: jax.Array
) -> LaneResult:
    """Fit block after block, a leading axis on `inputs` and `start`, the first `used` of them: memory is taken once."""
    one = lambda given: solve(given[0], given[1], low, high, cell)  # noqa: E731
    nothing = jax.tree.map(
        lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(one, jax.tree.map(lambda x: x[0], (inputs, start)))
    )

    def body(given):
        number, block = given
        # the last call is seldom full: blocks beyond `used` are passed over
        return jax.lax.cond(number < used, one, lambda _: nothing, block)

    return jax.lax.map(body, (jnp.arange(start.shape[0]), (inputs, start)))
