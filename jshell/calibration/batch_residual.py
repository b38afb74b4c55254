"""What is left of the records of a batch at the fits' constants, and the sums that tests of noise ask for.

Symbols    b basis of `batch_kernel`, then the constant   r weighted residual
Valid for  as `batch_kernel`
"""

from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jshell.calibration.batch_shape import Block, Shape, shape
from jshell.calibration.batch_waves import basis
from jshell.signals.lanes import VECTORS, barrier, centred, lanewise, total
from jshell.signals.wave_sums import INNER, powers


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Given:  # no module of equinox: there is one for every block, and making that takes as long as what it holds
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
    modal: bool = field(metadata={"static": True}, default=False)

    def block(self) -> Block:
        """As the search of white noise had it."""
        y, mean = centred(self.values, self.count)
        inside = (jnp.arange(y.shape[1])[:, None] < self.count).astype(float)
        power = total(w * jnp.sum(one**2, axis=0) for w, one in zip(self.weight, y, strict=True))
        return Block(
            y, mean, power, self.count, self.step, self.weight, self.gas, self.wall, self.volume, self.elapsed, inside,
            self.modal,
        )  # fmt: skip


def amplitudes(modes: Shape, state: jax.Array, data: Any) -> list[list[jax.Array]]:
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


class ResidualSums(NamedTuple):
    """What is left of a block, and the sums that the tests of `noise` ask for; (channels, block) each.

    Attributes:
        residual: (channels, times, block) model less data, weighted, 0 beyond the record.
        power: Its sum of squares.
        mean: Its mean.
        neighbours: Sum of products of neighbours, the mean taken out.
        above, changes: Samples above the mean, and changes of sign.
        halves: (2, channels, block) sums of the root of its size, in the first half and in all.
        size: Sum of its size.
    """

    residual: Any
    power: Any
    mean: Any
    neighbours: Any
    above: Any
    changes: Any
    halves: Any
    size: Any


@partial(jax.jit, compiler_options=VECTORS)
@lanewise
def residual(unknowns: jax.Array, linear: jax.Array, rest: jax.Array, given: Given) -> ResidualSums:
    """What is left of every record.

    Args:
        unknowns: (4, block).
        linear: (4, block) ΔV, ΔS and their rates at the first sample; of the modal loss amplitudes of each channel.
        rest: (channels, block) at rest.
        given: The records.
    """
    size, count = given.values.shape[1], given.count
    always_true = count[0] >= 0
    inside = (jnp.arange(size)[:, None] < count).astype(float)
    modes = barrier(lambda u: shape(u, given), always_true, unknowns)
    r = barrier(lambda modes, given: left_of(modes, linear, rest, given, inside), always_true, modes, given)
    whole = barrier(lambda r: jnp.sum(r, axis=1), always_true, r)
    mean = whole / count

    def sums(r, mean, inside):
        up = jnp.where(r > mean[:, None], inside, 0.0)
        return jnp.sum(r * r, axis=1), jnp.sum(jnp.abs(r), axis=1), jnp.sum(up, axis=1)

    power, absolute, above = barrier(sums, always_true, r, mean, inside)
    neighbours, changes = barrier(lambda r, mean: _between(r, mean, count), always_true, r, mean)
    halves = barrier(lambda r: _halves(r, count), always_true, r)
    # of residuals less their mean: what the mean adds is taken off
    ends = r[:, 0] + jnp.sum(jnp.where(jnp.arange(size)[:, None] == count - 1, r, 0.0), axis=1)
    neighbours = neighbours - mean * (2 * whole - ends) + (count - 1) * mean**2
    return ResidualSums(r, power, mean, neighbours, above, changes, halves, absolute)


def left_of(modes: Shape, linear: jax.Array, rest: jax.Array, given: Any, inside: jax.Array) -> jax.Array:
    """(channels, times, block) model less data, weighted, 0 beyond each record."""
    always_true, size = given.count[0] >= 0, given.values.shape[1]
    C, P = amplitudes(modes, linear, given), jnp.repeat(modes.shapes, 2, axis=1)
    parts = [[P[c, i] * one[i] for i in range(4)] for c, one in enumerate(C)]
    if given.elapsed is None:
        curve = jnp.stack([_motion(part, modes, given.step, always_true, size) for part in parts])
    else:
        b = basis(modes, given, inside)
        curve = jnp.stack([total(part[i] * b[i] for i in range(4)) for part in parts])
    return jnp.sqrt(given.weight)[:, None] * jnp.where(inside > 0, curve + rest[:, None] - given.values, 0.0)


def _between(r: jax.Array, mean: jax.Array, count: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Sums over pairs of neighbours: of their product, and of changes of side of the mean."""
    after = jnp.arange(1, r.shape[1])[:, None] < count
    change = ((r[:, 1:] > mean[:, None]) != (r[:, :-1] > mean[:, None])) & after
    return jnp.sum(r[:, 1:] * r[:, :-1], axis=1), jnp.sum(jnp.where(change, 1.0, 0.0), axis=1)


def _halves(r: jax.Array, count: jax.Array) -> jax.Array:
    """(2, channels, block) sums of the root of the size, in the first half and in all."""
    root = jnp.sqrt(jnp.abs(r))
    early = jnp.arange(r.shape[1])[:, None] < jnp.floor(count / 2)
    return jnp.stack([jnp.sum(jnp.where(early, root, 0.0), axis=1), jnp.sum(root, axis=1)])


def _motion(C: list[jax.Array], modes: Shape, step: jax.Array, always_true: jax.Array, size: int) -> jax.Array:
    """(times, block) of one channel at even samples: every sixteenth by doubling, those between from it in one pass."""
    decay, turn = modes.rate * step, modes.damped * step
    fade = jnp.exp(-decay)
    groups = size // INNER
    real, imag, lengths = barrier(
        lambda x, y: powers(x, y, groups), always_true, fade * jnp.cos(turn), fade * jnp.sin(turn)
    )

    def starts(C, lengths):
        # c1 Re z^t + c2 Im z^t = Re((c1 - i c2) z^t)
        a, b = jnp.stack([C[0], C[2]])[None], -jnp.stack([C[1], C[3]])[None]
        for x, y in lengths:
            a, b = jnp.concatenate([a, a * x - b * y]), jnp.concatenate([b, a * y + b * x])
        return a[:groups, None], b[:groups, None]

    a, b = barrier(starts, always_true, C, lengths)
    return total(a[:, :, m] * real[None, :, m] - b[:, :, m] * imag[None, :, m] for m in range(2)).reshape(size, -1)
