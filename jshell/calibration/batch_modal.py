"""The modal loss in a block: any channel is two damped waves, and only ω-, ω+ and τ speak of the shell.

Every channel has amplitudes of its own, so that what the waves explain of each is added up; the constants act
through both frequencies alone. Where α1, α2 and k_VS are all free, one record leaves them free: the coupling is then
held at 0, which reaches any two frequencies, and the constants are undetermined.

Symbols    u = (log α1, log α2, k_VS², log σ) unknowns   A, B, C V_e² ω² of volume and area alone and their
           coupling, all for α1 = α2 = k_VS = 1
Valid for  equal decay, both modes underdamped
Source     Mokbel et al. 2021: eq:defw; starts as `frequency_model.start_from_data`
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.calibration.batch_shape import Block, Shape, coupled, uncoupled
from jshell.signals.lane_search import Evaluation
from jshell.signals.lanes import barrier, total
from jshell.signals.two_waves import explained

SHARES = np.linspace(0.05, 0.95, 37)  # of the volume's motion in the sum of the squared frequencies
USUAL = 0.6  # of them, where one record does not tell


def projected(modes: Shape, d: jax.Array, G: jax.Array, power: jax.Array, sums: jax.Array, data: Block) -> Evaluation:
    """Cost, gradient and normal matrix from the sums over a record; arguments of `batch_kernel.projected`."""
    always_true, w = data.count[0] >= 0, data.weight
    turn, decay = modes.damped * data.step, modes.rate * data.step
    parts = [explained(turn, decay, d[c], G[c] if G.ndim == 4 else G, always_true) for c in range(len(w))]

    def by_constants(parts, modes):
        logs = modes.damped_slope / modes.damped
        slope = [*(logs[:, m] for m in range(2)), [0.0, 0.0, 0.0, 1.0]]  # of log Ω-, log Ω+, log σ by each unknown
        along = lambda g: jnp.stack([total(slope[j][u] * g[j] for j in range(3)) for u in range(4)])  # noqa: E731
        gradient = along(total(w[c] * one.gradient for c, one in enumerate(parts)))
        normal = total(w[c] * one.normal for c, one in enumerate(parts))
        normal = along([along(normal[j]) for j in range(3)])
        cost = power - total(w[c] * one.power for c, one in enumerate(parts))
        return cost, gradient, normal, jnp.concatenate([one.amplitudes for one in parts])

    cost, gradient, normal, best = barrier(by_constants, always_true, parts, modes)
    return Evaluation(jnp.where(modes.sound & jnp.isfinite(cost), cost, jnp.inf), gradient, normal, best, sums)


def start(
    turn: Float[Array, "2 block"], decay: jax.Array, data: Block, low: jax.Array, high: jax.Array
) -> Float[Array, "4 block"]:
    """The unknowns from the modes of every record.

    Args:
        turn, decay: Ω and σ of the modes, per sample.
        data: The records.
        low, high: Bounds; what is fixed has both alike.
    """
    V, held = data.volume, low == high
    A, B, C, _ = uncoupled(1.0, 1.0, 1.0, data.gas * V**2, data.wall)
    y = (V / data.step) ** 2 * (turn**2 + decay**2)
    whole, product = y[0] + y[1], y[0] * y[1]
    least = 0.02 * whole / A
    alpha1, alpha2 = jnp.exp(low[0]), jnp.exp(low[1])

    def at(share):
        x1 = jnp.where(held[1], (whole - B / alpha2) / A, share * whole / A)
        x1 = jnp.maximum(jnp.where(held[0], 1 / alpha1, x1), least)
        x2 = jnp.where(held[1], 1 / alpha2, jnp.maximum((whole - A * x1) / B, 0.02 * whole / B))
        k2 = jnp.maximum((A * B - product / (x1 * x2)) / C, 1e-3)
        k2 = jnp.where(held[2], low[2], k2)
        slow, fast, _, _ = coupled(A * x1, B * x2, C * k2 * x1 * x2)
        gap = jnp.sqrt(jnp.maximum(jnp.stack([slow, fast]), 0.0)) - jnp.sqrt(y)
        cost = jnp.sum(gap**2, axis=0) / whole + 1e-9 * (share - USUAL) ** 2
        return cost, jnp.stack([-jnp.log(x1), -jnp.log(x2), k2])

    cost, found = jax.vmap(at)(jnp.asarray(SHARES))
    best = jnp.argmin(jnp.where(jnp.isfinite(cost), cost, jnp.inf), axis=0)
    constants = jnp.take_along_axis(found, best[None, None], axis=0)[0]
    return jnp.concatenate([constants, jnp.log(decay / data.step)[None]])
