"""A block of traces side by side, and the modes of their shells.

Symbols    u = (log α1, log α2, k_VS, log σ) unknowns, of the modal loss k_VS²   σ = 1/τ   Ω² = ω² - σ²
Valid for  equal decay, both modes underdamped
Source     Mokbel et al. 2021: eq:eqmovadimV, eq:eqmovadimS, eq:defw
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.signals.lanes import total

UNKNOWNS = 4


class Block(eqx.Module):
    """Traces side by side.

    Attributes:
        values: Channels less their means, 0 beyond the record; times are a multiple of INNER.
        mean: Their means.
        power: Weighted sum of squares of `values`.
        count: Samples of each record.
        step: Time between samples.
        weight: (channels, block) 1/σ² of each channel.
        gas: κ P_e/V_e, stiffness of the volume.
        wall: K_A/4π, stiffness of the area.
        volume: V_e.
        elapsed: Times of each sample where they are uneven or some are missing, else None.
        inside: 1 for a sample, 0 for none; with `elapsed`.
        modal: Whether channels have amplitudes of their own; else they are V and S of the oscillator.
    """

    values: Float[Array, "channels times block"]
    mean: Float[Array, "channels block"]
    power: Float[Array, " block"]
    count: Float[Array, " block"]
    step: Float[Array, " block"]
    weight: Float[Array, "channels block"]
    gas: Float[Array, " block"]
    wall: Float[Array, " block"]
    volume: Float[Array, " block"]
    elapsed: Any = None
    inside: Any = None
    modal: bool = eqx.field(static=True, default=False)


class Shape(NamedTuple):
    """Two modes: rates, shapes, and their derivatives by the unknowns.

    Attributes:
        damped: (2, block) Ω.
        rate: σ.
        shapes: (channels, modes, block) (V_m, S_m), of mass one; 1 where channels have amplitudes of their own.
        damped_slope: (unknowns, modes, block).
        shape_slope: (channels, unknowns, modes, block), less the part along the mode itself.
        sound: Whether both modes turn.
    """

    damped: jax.Array
    rate: jax.Array
    shapes: jax.Array
    damped_slope: jax.Array
    shape_slope: jax.Array
    sound: jax.Array


class Uncoupled(NamedTuple):
    """Volume and area alone.

    Attributes:
        volume, area: Squared frequency of each.
        unit: Their coupling at k_VS = 1, squared.
        masses: Of each.
    """

    volume: Any
    area: Any
    unit: Any
    masses: tuple[Any, Any]


def uncoupled(alpha1: Any, alpha2: Any, volume: Any, gas: Any, wall: Any) -> Uncoupled:
    """The motions of eq:defw by what stiffness and mass are made of, as `Block` has them; numbers or arrays.

    The same as `oscillator.linear.squares` has inside. For the volume 1 and κ V_e P_e as `gas` all are V_e² ω².
    """
    m1, m2 = alpha1 / (4 * np.pi), 2 * alpha2 * volume**2 / (9 * np.pi**3)
    return Uncoupled(gas / m1, wall / m2, 1 / (volume**2 * m1 * m2), (m1, m2))


def coupled(a: Any, b: Any, c2: Any) -> tuple[Any, Any, Any, Any]:
    """Slow and fast ω² of two motions with a squared coupling; half the difference of both alone, and of ω²."""
    half = (a - b) / 2
    gap = jnp.sqrt(half * half + c2)
    fast = (a + b) / 2 + gap
    return (a * b - c2) / fast, fast, half, gap


def _turning(slow: jax.Array, fast: jax.Array, gap: jax.Array, rate: jax.Array) -> tuple[jax.Array, ...]:
    """(2, block) ω² and Ω; and whether both modes turn, and apart, where Ω is not 1."""
    w2 = jnp.stack([slow, fast])
    damped_squared = w2 - rate**2
    sound = (damped_squared[0] > 1e-6 * fast) & (gap > 1e-9 * fast)
    return w2, jnp.sqrt(jnp.where(sound, damped_squared, 1.0)), sound


def shape(unknowns: Float[Array, "unknowns block"], data: Any) -> Shape:
    """Modes of given constants, with derivatives by perturbation of M and K; of the block its shells are read."""
    if data.modal:
        return _of_frequencies(unknowns, data)
    alpha1, alpha2, k, rate = jnp.exp(unknowns[0]), jnp.exp(unknowns[1]), unknowns[2], jnp.exp(unknowns[3])
    a, b, _, (m1, m2) = uncoupled(alpha1, alpha2, data.volume, data.gas, data.wall)
    c = k / (data.volume * jnp.sqrt(m1 * m2))
    slow, fast, half, gap = coupled(a, b, c * c)
    x, y = jnp.where(half >= 0, gap + half, c), jnp.where(half >= 0, c, gap - half)
    size = jnp.sqrt(x * x + y * y) + 1e-300
    x, y = x / size, y / size
    V, S = jnp.stack([-y, x]) / jnp.sqrt(m1), jnp.stack([x, y]) / jnp.sqrt(m2)

    w2, damped, sound = _turning(slow, fast, gap, rate)
    zero = jnp.zeros_like(w2)
    own = jnp.stack([-w2 * m1 * V * V, -w2 * m2 * S * S, 2 * V * S / data.volume, -2 * jnp.stack([rate**2] * 2)])
    cross = jnp.stack(
        [-w2 * m1 * V[0] * V[1], -w2 * m2 * S[0] * S[1], (V[0] * S[1] + V[1] * S[0] + zero) / data.volume, zero]
    )
    apart = jnp.stack([slow - fast, fast - slow])
    mixing = cross / jnp.where(sound, apart, 1.0)  # (unknowns, modes, block) of the other mode's shape
    shapes = jnp.stack([V, S])
    return Shape(damped, rate, shapes, own / (2 * damped), mixing[None] * shapes[:, None, ::-1], sound)


def _of_frequencies(unknowns: Float[Array, "unknowns block"], data: Any) -> Shape:
    """The two frequencies of given constants; of each mode every channel has amplitudes of its own."""
    alpha1, alpha2, k2, rate = jnp.exp(unknowns[0]), jnp.exp(unknowns[1]), unknowns[2], jnp.exp(unknowns[3])
    a, b, unit, _ = uncoupled(alpha1, alpha2, data.volume, data.gas, data.wall)
    c2 = k2 * unit
    slow, fast, half, gap = coupled(a, b, c2)
    _, damped, sound = _turning(slow, fast, gap, rate)

    # of w² = (a + b)/2 ∓ gap, with both motions alone and their coupling
    sign, safe = jnp.array([-1.0, 1.0])[:, None], jnp.where(sound, gap, 1.0)
    share = half / 2
    by_a, by_b, by_c = 0.5 + sign * share / safe, 0.5 - sign * share / safe, sign / (2 * safe)
    own = jnp.stack([-by_a * a - by_c * c2, -by_b * b - by_c * c2, by_c * unit, -2 * jnp.stack([rate**2] * 2)])
    ones = jnp.ones((len(data.weight), *damped.shape))
    return Shape(damped, rate, ones, own / (2 * damped), jnp.zeros((len(data.weight), *own.shape)), sound)


def angular_frequencies(modes: Shape) -> tuple[jax.Array, jax.Array]:
    """Undamped (2, block) ω-, ω+, and their derivatives (unknowns, 2, block)."""
    omega = jnp.sqrt(modes.damped**2 + modes.rate**2)
    by_rate = jnp.zeros_like(modes.damped_slope).at[3].set(modes.rate**2 * jnp.ones_like(omega))
    return omega, (modes.damped * modes.damped_slope + by_rate) / omega


def first_motion(modes: Shape, linear: jax.Array) -> list[jax.Array]:
    """ΔV, ΔS and their rates at the first sample, from the factors of the basis as `Evaluation` has them."""
    cosine, sine = linear[0::2], linear[1::2]
    rates = modes.damped * sine - modes.rate * cosine
    return [total(modes.shapes[c, m] * x[m] for m in range(2)) for x in (cosine, rates) for c in range(2)]
