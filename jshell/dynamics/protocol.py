"""The outer pressure in time.

Symbols    P_ext(t) outer pressure [E d/R0]   t time [sqrt(ρ_f R0³/(E d))]
Source     Mokbel et al. 2021, numerical method: a slow ramp from P0, then hold
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.shell.elasticity import Scalar


class Ramp(eqx.Module):
    """A straight ramp from one pressure to another, then hold; a sudden step where the duration is zero.

    Args:
        start, stop: Outer pressure before and after [E d/R0].
        duration: Time the ramp takes [time unit].
    """

    start: Scalar
    stop: Scalar
    duration: Scalar = 25.0

    def __call__(self, t: Float[Array, "..."]) -> Float[Array, "..."]:
        safe = jnp.where(self.duration > 0, self.duration, 1.0)
        done = jnp.where(self.duration > 0, jnp.clip(t / safe, 0.0, 1.0), 1.0)
        return jnp.asarray(self.start + (self.stop - self.start) * done)


class Hold(eqx.Module):
    """A constant outer pressure [E d/R0]."""

    pressure: Scalar

    def __call__(self, t: Float[Array, "..."]) -> Float[Array, "..."]:
        return jnp.asarray(self.pressure + 0.0 * t)
