"""The outer pressure in time.

Anything that returns a pressure for a time will do; here are the usual ones,
and the source's trick of an offset on both pressures, which keeps the shape.

Symbols    P_ext(t) outer pressure [E d/R0]   t time [sqrt(ρ_f R0³/(E d))]
Source     Mokbel et al. 2021, numerical method: a slow ramp from P0, then hold; offset δP of both pressures
"""

from collections.abc import Callable
from typing import TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jshell.errors import BadShape, BadValue
from jshell.shell.elasticity import SPHERE_VOLUME, Scalar
from jshell.shell.parameters import Number, Reduced
from jshell.shell.rest import gas_pressure

Pressure: TypeAlias = Callable[[jax.Array], jax.Array]


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


class Sampled(eqx.Module):
    """A recorded outer pressure: straight lines between samples, the first and last value held outside.

    Args:
        times: (samples,) increasing [time unit].
        values: (samples,) outer pressure there [E d/R0].

    Raises:
        BadShape, BadValue: Lengths that differ, times that do not increase, numbers that are not finite.
    """

    times: Float[Array, "times"]
    values: Float[Array, "values"]

    def __check_init__(self) -> None:
        if self.times.shape != self.values.shape or self.times.ndim != 1:
            raise BadShape(
                "pressure",
                found=f"times {self.times.shape}, values {self.values.shape}",
                expected="two lists of one length",
                remedy="Give one pressure per time.",
            )
        if isinstance(self.times, Tracer) or isinstance(self.values, Tracer):
            return
        if not (
            np.all(np.isfinite(self.times)) and np.all(np.isfinite(self.values)) and np.all(np.diff(self.times) > 0)
        ):
            raise BadValue(
                "pressure",
                found="times that do not increase, or numbers that are not finite",
                expected="increasing times and finite pressures",
                remedy="Sort the record and drop its gaps.",
            )

    def __call__(self, t: Float[Array, "..."]) -> Float[Array, "..."]:
        return jnp.interp(t, self.times, self.values)


class Forced(eqx.Module):
    """A steady protocol and a forcing that adds to it, such as a tone or a burst of `jshell.oscillator`."""

    steady: Pressure
    forcing: Pressure

    def __call__(self, t: Float[Array, "..."]) -> Float[Array, "..."]:
        return jnp.asarray(self.steady(t) + self.forcing(t))


def offset(conditions: Reduced, volume: Number, amount: Number) -> Reduced:
    """The problem with an offset on both pressures at a given volume: the same rest shape, a stiffer gas.

    Args:
        conditions: The problem.
        volume: Volume of the rest shape that is kept [R0³].
        amount: δP added to the inner pressure at that volume and to the outer pressure [E d/R0].

    Source:
        The source's family at fixed shape, fig. of ω against the pressure.

    Example:
        >>> import jshell as js
        >>> R = js.presets.R.conditions
        >>> shape = js.membrane.rest(R)
        >>> stiffer = js.dynamics.offset(R, shape.volume, 1.0)
        >>> print(js.membrane.rest(stiffer).volume_ratio.round(4), shape.volume_ratio.round(4))
        0.6992 0.6992
    """
    c = conditions
    pressure = gas_pressure(volume, c) + amount
    filled = pressure * (volume / SPHERE_VOLUME) ** c.kappa
    return c.replace(gas_pressure=filled, outer_pressure=c.outer_pressure + amount)
