"""Sums of a record with two decaying waves, and of the waves with each other, for many records at once.

Both waves are z_m^t = exp((-σ + iΩ_m) Δ t), t counted in samples. A record
enters through Σ y z^t and Σ t y z^t alone. The waves' own products have closed
geometric sums, so that records of any length share a program: what is padded
is zero in the data, and the closed sums know the length.

Symbols    σ decay rate   Ω damped angular frequency   Δ sampling step   z_-, z_+ slow, fast
           b = (Re z-^t, Im z-^t, Re z+^t, Im z+^t, then t times these) basis   G = Σ b bᵀ, centred, Gram matrix
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jshell.signals.lanes import barrier, total

INNER = 16  # samples that one unrolled sum takes


def padded(length: int) -> int:
    """The length rounded up to whole groups of INNER samples."""
    return -(-length // INNER) * INNER


def powers(
    real: Float[Array, "modes block"], imag: Float[Array, "modes block"], groups: int
) -> tuple[jax.Array, jax.Array, list[tuple[jax.Array, jax.Array]]]:
    """z^t within a group, real and imaginary parts (INNER, modes, block); and z to the length of ever longer groups."""
    # powers by doubling: the powers so far, and the same times z to their number; four products instead of sixteen
    r, i = jnp.ones_like(real)[None], jnp.zeros_like(real)[None]
    a, b = real, imag
    while r.shape[0] < INNER:
        r, i = jnp.concatenate([r, r * a - i * b]), jnp.concatenate([i, r * b + i * a])
        a, b = a * a - b * b, 2 * a * b
    # z to the length of a group, of two, of four: what shifts the second of a pair when groups are joined
    lengths = [(a, b)]
    while 2 ** len(lengths) < groups:
        a, b = a * a - b * b, 2 * a * b
        lengths.append((a, b))
    return r, i, lengths


def data_sums(
    values: Float[Array, "channels times block"], real: jax.Array, imag: jax.Array, always_true: Bool[Array, ""]
) -> Float[Array, "channels 8 block"]:
    """Σ y b for every channel.

    Args:
        values: Data, 0 beyond each record; times are a multiple of INNER.
        real: (modes, block) Re z.
        imag: (modes, block) Im z.
        always_true: True.
    """
    groups = values.shape[1] // INNER
    # groups of INNER samples: each is summed unrolled in registers, so that a sample is read from memory once
    grouped = values.reshape(values.shape[0], groups, INNER, values.shape[2])
    r, i, lengths = barrier(lambda a, b: powers(a, b, groups), always_true, real, imag)
    lift = lambda x: x[None, :, None, :]  # noqa: E731

    def within(grouped, r, i):
        # plain sums and sums weighted by t are taken in the same pass over the data
        row = [grouped[:, None, :, j] for j in range(INNER)]  # (channels, 1, groups, block)
        A = total(row[j] * lift(r[j]) for j in range(INNER))
        B = total(row[j] * lift(i[j]) for j in range(INNER))
        tA = total(row[j] * lift(j * r[j]) for j in range(1, INNER))
        tB = total(row[j] * lift(j * i[j]) for j in range(1, INNER))
        return A, B, tA, tB

    def joined(parts, length, z):
        # groups are joined pairwise: the first of a pair as it is, the second shifted by a group's length
        if parts[0].shape[2] % 2:
            parts = [jnp.pad(x, ((0, 0), (0, 0), (0, 1), (0, 0))) for x in parts]
        (A0, A1), (B0, B1), (tA0, tA1), (tB0, tB1) = ((x[:, :, 0::2], x[:, :, 1::2]) for x in parts)
        # t of the second group counts from its own start: add the first one's length
        tA1, tB1 = tA1 + length * A1, tB1 + length * B1
        r, i = lift(z[0]), lift(z[1])
        return (
            A0 + r * A1 - i * B1,
            B0 + r * B1 + i * A1,
            tA0 + r * tA1 - i * tB1,
            tB0 + r * tB1 + i * tA1,
        )

    # log2(groups) joins, each half as many as the last; the rounding grows with their number, not with the samples'
    parts = barrier(within, always_true, grouped, r, i)
    for level, z in enumerate(lengths):
        if parts[0].shape[2] > 1:
            length = INNER * 2**level
            parts = barrier(lambda parts, z, length=length: joined(parts, length, z), always_true, parts, z)

    def side_by_side(A, B, tA, tB):
        # the order of the basis b: Re z-, Im z-, Re z+, Im z+, then t times these
        pairs = ((A, B), (tA, tB))
        return jnp.stack([part[:, m, 0] for pair in pairs for m in range(2) for part in pair], axis=1)

    return barrier(side_by_side, always_true, *parts)


def geometric(
    real: Float[Array, "rates block"], imag: Float[Array, "rates block"], count: Float[Array, "1 block"], always_true
) -> tuple[tuple[jax.Array, jax.Array], ...]:
    """Σ q^t, Σ t q^t and Σ t² q^t over t < count, q = exp(real + i imag); real and imaginary parts.

    Where |count log q| is small the higher sums lose digits as its square: no resolved mode is there.
    """

    def less_one(a, b):  # exp(a + ib) - 1
        # by expm1 and the half angle: no digits are lost where q is near 1, as in a slow wave sampled finely
        half = jnp.sin(b / 2)
        return jnp.expm1(a) * jnp.cos(b) - 2 * half * half, jnp.exp(a) * jnp.sin(b)

    def ends(real, imag, count):
        (dr, di), (Er, Ei) = less_one(real, imag), less_one(count * real, count * imag)
        # 1/(q - 1), kept finite where q is 1, which no decaying wave reaches
        size = 1 / jnp.maximum(dr * dr + di * di, 1e-300)
        return (dr * size, -di * size), (dr + 1, di), (Er, Ei)

    times = lambda a, b: (a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0])  # noqa: E731
    inverse, e, E = barrier(ends, always_true, real, imag, count)

    def first(inverse, e, E, count):
        # Σ q^t = (q^n - 1)/(q - 1), and Σ t q^t by summation by parts from it
        S0 = times(E, inverse)
        E, e0 = (E[0] + 1, E[1]), times(e, S0)
        S1 = times((count * E[0] - e0[0], count * E[1] - e0[1]), inverse)
        return E, S0, e0, S1, times(e, S1)

    def second(inverse, E, e0, e1, count):
        # Σ t² q^t by parts once more
        n2 = count * count
        return times((n2 * E[0] - e0[0] - 2 * e1[0], n2 * E[1] - e0[1] - 2 * e1[1]), inverse)

    E, S0, e0, S1, e1 = barrier(first, always_true, inverse, e, E, count)
    return S0, S1, barrier(second, always_true, inverse, E, e0, e1, count)


def gram(
    decay: jax.Array, turn: jax.Array, count: jax.Array, always_true: Bool[Array, ""]
) -> tuple[jax.Array, jax.Array]:
    """Products of the basis, centred and summed over a record, (8, 8, block); and its plain sums (8, block).

    Args:
        decay: σ Δ.
        turn: (modes, block) Ω Δ.
        count: Samples.
        always_true: True.
    """

    def logarithms(decay, turn):
        slow, fast, zero = turn[0], turn[1], jnp.zeros_like(decay)
        # a product of two waves is a wave: sums and differences of their frequencies; the last two are the waves alone
        imag = jnp.stack([2 * slow, 2 * fast, slow + fast, slow - fast, zero, slow, fast])
        return jnp.stack([-2 * decay] * 5 + [-decay] * 2), imag

    orders = geometric(*barrier(logarithms, always_true, decay, turn), count[None], always_true)  # pyright: ignore[reportCallIssue]

    def block(P, M):  # of z_a, z_b: P holds Σ z_a z_b, M holds Σ z_a conj(z_b)
        return [[(P[0] + M[0]) / 2, (P[1] - M[1]) / 2], [(P[1] + M[1]) / 2, (M[0] - P[0]) / 2]]

    def four(order):  # (4, 4) of one power of t
        at = lambda k: (order[0][k], order[1][k])  # noqa: E731
        ss, ff, sf = block(at(0), at(4)), block(at(1), at(4)), block(at(2), at(3))
        top = [[*ss[i], *sf[i]] for i in range(2)]
        low = [[sf[0][i], sf[1][i], *ff[i]] for i in range(2)]
        return top + low

    def whole(orders, count):
        # G0, G1, G2: products weighted by 1, t, t², which fill the blocks of b = (waves, t waves)
        G0, G1, G2 = (four(order) for order in orders)
        sums = [order[part][k] for order in orders[:2] for k in (5, 6) for part in (0, 1)]
        rows = [[*G0[i], *G1[i]] for i in range(4)] + [[*G1[i], *G2[i]] for i in range(4)]
        # the offset of a channel is projected out: each product less that of the means
        G = [jnp.stack([rows[i][j] - sums[i] * sums[j] / count for j in range(8)]) for i in range(8)]
        return jnp.stack(G), jnp.stack(sums)

    return barrier(whole, always_true, orders, count)


def uneven_sums(
    values: Float[Array, "channels times block"],
    samples: Float[Array, "times block"],
    inside: Float[Array, "times block"],
    decay: Float[Array, " block"],
    turn: Float[Array, "modes block"],
    count: Float[Array, " block"],
    always_true: Bool[Array, ""],
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """The same sums for records whose times are uneven, sample by sample.

    Args:
        values: Data, 0 where there is none.
        samples: Times, in the unit of `decay` and `turn`.
        inside: 1 for a sample, 0 for none.
        decay: σ per unit of time.
        turn: Ω per unit of time.
        count: Samples of each record.
        always_true: True.

    Returns:
        Σ y b (channels, 8, block), centred Σ b bᵀ (8, 8, block), Σ b (8, block).
    """

    def basis(samples, inside, decay, turn):
        # outside a record the wave itself is zero, so that no later sum needs to know
        size = inside * jnp.exp(-decay * samples)
        waves = [size * wave(turn[m] * samples) for m in range(2) for wave in (jnp.cos, jnp.sin)]
        return jnp.stack(waves + [samples * wave for wave in waves])

    b = barrier(basis, always_true, samples, inside, decay, turn)
    d = jnp.stack([barrier(lambda b, y: jnp.sum(b * y, axis=1), always_true, b, row) for row in values])
    sums = barrier(lambda b: jnp.sum(b, axis=1), always_true, b)
    rows = [barrier(lambda b, one: jnp.sum(b * one, axis=1), always_true, b, b[i]) for i in range(8)]
    return d, jnp.stack([row - sums[i] * sums / count for i, row in enumerate(rows)]), sums
