"""What is in an answer: its spectrum, harmonics and subharmonics.

Symbols    ω angular frequency [1/time]   order n: a tone at n ω; 1/2 is the subharmonic
Valid for  evenly spaced samples; harmonics: a steady answer
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.errors import BadValue
from jshell.renamed import renamed_arguments, renamed_attribute
from jshell.shell.parameters import Number
from jshell.undetermined import undetermined

ORDERS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
Samples = Float[Array, "times *batch"]


class Spectrum(NamedTuple):
    """Amplitudes over angular frequencies: a pure tone of amplitude 1 shows as 1 at its peak.

    Attributes:
        angular_frequency: (bins,) [1/time].
        amplitude: (bins, *batch).
    """

    angular_frequency: Float[Array, " bins"]
    amplitude: Float[Array, "bins *batch"]

    pulsation = renamed_attribute("pulsation", "angular_frequency")

    @property
    def highest(self) -> Float[Array, ""]:
        """Angular frequency up to which it holds, half the sampling's [1/time]: what is faster is folded below it."""
        return self.angular_frequency[-1]


def spectrum(times: Float[Array, " times"], values: Samples, *, skip: Number = 0.0, finer: int = 1) -> Spectrum:
    """Amplitude spectrum by a Hann window.

    Args:
        times: Evenly spaced.
        values: Samples on the first axis; their mean is removed.
        skip: Time at the start to leave out, while transients last. A concrete number.
        finer: Bins per resolved one; more draw a smoother line.
    """
    first = int(jnp.searchsorted(times, times[0] + skip))
    t, x = times[first:], values[first:]
    if t.size < 8:
        raise BadValue("skip", found=f"{t.size} samples left", expected="at least 8", remedy="Skip less.")
    window = jnp.sin(jnp.pi * (jnp.arange(t.size) + 0.5) / t.size) ** 2
    shaped = window.reshape(-1, *(1,) * (x.ndim - 1))
    x = x - jnp.sum(shaped * x, axis=0) / jnp.sum(window)
    angular_frequency = 2 * jnp.pi * jnp.fft.rfftfreq(finer * t.size, (t[-1] - t[0]) / (t.size - 1))
    return Spectrum(angular_frequency, 2 * jnp.abs(jnp.fft.rfft(shaped * x, finer * t.size, axis=0)) / jnp.sum(window))


@renamed_arguments(pulsation="angular_frequency")
def harmonics(
    times: Float[Array, " times"],
    values: Samples,
    angular_frequency: Number,
    orders: tuple[float, ...] = ORDERS,
) -> Float[Array, "orders *batch"]:
    """Amplitudes of a steady answer at multiples of the drive, by linear least squares.

    Args:
        times: Spanning at least two periods of the drive, so that the subharmonic fits in.
        values: Samples on the first axis.
        angular_frequency: Of the drive.
        orders: Which multiples.

    Returns:
        NaN at the multiples that are faster than half the sampling: they cannot be told from slower ones.
    """
    # an order that is folded is left out of the fit as well, where it would share another's samples
    resolved = angular_frequency * jnp.asarray(orders) * (times[-1] - times[0]) / (times.size - 1) <= jnp.pi
    weight = jnp.where(resolved, 1.0, 0.0)[None]
    angle = angular_frequency * times[:, None] * jnp.asarray(orders)[None]
    basis = jnp.concatenate([jnp.ones((times.size, 1)), weight * jnp.cos(angle), weight * jnp.sin(angle)], axis=1)
    flat = values.reshape(times.size, -1)
    found = jnp.linalg.lstsq(basis, flat)[0]
    k = len(orders)
    amplitude = undetermined(jnp.asarray(~resolved), jnp.hypot(found[1 : 1 + k], found[1 + k :]))
    return amplitude.reshape(k, *values.shape[1:])
