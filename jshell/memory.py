"""The half-order derivative as a sum of exponentials.

A wall that slides through viscous liquid feels the half-order time derivative
of its slip: a force that remembers. Over a band of frequencies that memory is
a few relaxing velocities, each dragged along by the wall through a dashpot:

    D^{1/2} w  ≈  r w + m w' + Σ_k a_k (w - y_k),      y_k' = x_k (w - y_k)

The rates are spread evenly in their logarithm; r, m and a_k follow from
non-negative least squares on √s over the band, oscillating and decaying rates
alike. None is negative, so the sum can only take energy away.

Symbols    w slip velocity   y_k relaxing velocities   x_k rates [1/time]   s complex rate [1/time]
Valid for  motions within the stated band; the error there is `HalfDerivative.error`
Source     Basset's history force; diffusive representation of fractional derivatives (Yuan and Agrawal 2002)
"""

from functools import lru_cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from jshell.errors import BadValue

SLOWEST, FASTEST = 0.05, 40.0  # the modes of shells on the usual meshes lie between [1/time]
TERMS = 10
REACH = 4.0  # rates extend this factor beyond the band, where √s still feels them
SAMPLES = 400
DAMPING = 0.3  # decay over frequency of the decaying rates that are fitted besides the oscillating ones


class HalfDerivative(eqx.Module):
    """Constants of the sum. Build with `half_derivative`.

    Attributes:
        rates: (terms,) relaxation rates x_k [1/time].
        weights: (terms,) dashpots a_k [1/√time].
        resistance: r [1/√time].
        mass: m [√time].
    """

    rates: Float[Array, "terms"]
    weights: Float[Array, "terms"]
    resistance: Float[Array, ""]
    mass: Float[Array, ""]

    def __call__(self, s: Complex[Array, "..."]) -> Complex[Array, "..."]:
        """What stands for √s at a complex rate s [1/√time]."""
        s = jnp.asarray(s)
        total = self.resistance + self.mass * s
        for rate, weight in zip(self.rates, self.weights, strict=True):
            total = total + weight * s / (s + rate)
        return total

    def error(self, slowest: float = SLOWEST, fastest: float = FASTEST, samples: int = 1000) -> Float[Array, ""]:
        """Largest relative error of √(iω) over a band of angular frequencies [-]."""
        s = 1j * jnp.geomspace(slowest, fastest, samples)
        return jnp.max(jnp.abs(self(s) / jnp.sqrt(s) - 1))


@lru_cache(maxsize=16)
def half_derivative(slowest: float = SLOWEST, fastest: float = FASTEST, terms: int = TERMS) -> HalfDerivative:
    """The half-order derivative over a band.

    Args:
        slowest, fastest: Angular frequencies between which it holds [1/time].
        terms: Number of exponentials; over the default band 8 leave 3e-3, 10 leave 4e-4.

    Returns:
        The constants of the sum, none negative.

    Raises:
        BadValue: A band that is empty, or fewer than two terms.

    Example:
        >>> from jshell.memory import half_derivative
        >>> bool(half_derivative().error() < 1e-3)
        True
    """
    if not 0 < slowest < fastest < np.inf:
        raise BadValue(
            "slowest, fastest",
            found=f"{slowest!r}, {fastest!r}",
            expected="two frequencies above 0 in rising order",
            remedy=f"{SLOWEST:g} and {FASTEST:g} per time unit hold for the modes of most shells.",
        )
    if terms < 2:
        raise BadValue("terms", found=repr(terms), expected="at least 2", remedy=f"{TERMS} is usual.")
    rates = np.geomspace(slowest / REACH, fastest * REACH, terms)
    omega = np.geomspace(slowest, fastest, SAMPLES)
    s = np.concatenate([1j * omega, (1j - DAMPING) * omega])[:, None]
    columns = np.concatenate([np.ones_like(s), s, s / (s + rates)], axis=1) / np.sqrt(s)
    from scipy.optimize import nnls  # here: it is slow to load, and few need it

    found, _ = nnls(np.concatenate([columns.real, columns.imag]), np.repeat([1.0, 0.0], len(s)))
    with jax.ensure_compile_time_eval():
        resistance, mass, weights = (jnp.asarray(part) for part in (found[0], found[1], found[2:]))
        return HalfDerivative(jnp.asarray(rates), weights, resistance, mass)
