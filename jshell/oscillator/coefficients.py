"""The constants of the short model: masses, coupling, damping.

Two added-mass factors, one coupling, two damping factors. The flow of the area
motion is a dipole; its dissipation is printed with the off-diagonal strain
counted twice too little, so the constant is a choice: `corrected` or `printed`.

Symbols    α1, α2 added-mass factors   k_VS coupling   β1, β2 damping factors   [-]
           τ decay time [sqrt(ρ_f R0³/(E d))]   η viscosity [sqrt(E d ρ_f R0)]
Source     Mokbel et al. 2021: eq:T, eq:US, eq:D, eq:taureal. Misprints: the dipole
           term of eq:D is 3η/(2π), printed 6η/(5π); eq:taureal is τ = ½ (α1/β1)/η,
           printed 2 (α1/β1)/η.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp

from jshell.errors import choose
from jshell.shell.parameters import Number, check

# Dissipation of the dipole flow outside the unit sphere, per η g² Ṡ².
DIPOLE_DISSIPATION = {"corrected": 3 / (2 * math.pi), "printed": 6 / (5 * math.pi)}


class Coefficients(eqx.Module):
    """The constants of the short model.

    Args:
        alpha1: Added-mass factor of the volume motion [-].
        alpha2: Added-mass factor of the area motion [-].
        k_vs: Volume-area coupling [-], of either sign.
        beta1: Damping factor of the volume motion [-]; 0 is no damping.
        beta2: Damping factor of the area motion [-]; None ties it to beta1 so
            that both modes decay alike.
        dipole: `corrected` (3η/2π) or `printed` (6η/5π) dissipation of the area motion.

    Raises:
        BadValue: A mass that is not positive, a damping below 0 (concrete numbers only).
        BadName: No such `dipole`.

    Example:
        >>> from jshell.oscillator import Coefficients
        >>> float(Coefficients(3.6, 1.1, 0.23, beta1=9.0).area_damping)
        0.611...
    """

    alpha1: Number
    alpha2: Number
    k_vs: Number
    beta1: Number = 0.0
    beta2: Number | None = None
    dipole: str = eqx.field(static=True, default="corrected")

    def __check_init__(self) -> None:
        dipole_dissipation(self.dipole)
        check("alpha1", self.alpha1, "a finite number above 0", lambda x: x > 0)
        check("alpha2", self.alpha2, "a finite number above 0", lambda x: x > 0)
        check("k_vs", self.k_vs, "a finite number", lambda x: x == x)
        check("beta1", self.beta1, "a finite number of at least 0", lambda x: x >= 0)
        check("beta2", self.beta2, "a finite number of at least 0, or None", lambda x: x >= 0, optional=True)

    def as_arrays(self) -> "Coefficients":
        """The same numbers as JAX arrays, so that a compiled program serves every value."""
        return jax.tree.map(lambda number: jnp.asarray(number, dtype=float), self)

    @staticmethod
    def equal_decay(
        alpha1: Number, alpha2: Number, k_vs: Number, beta1: Number, *, dipole: str = "corrected"
    ) -> "Coefficients":
        """Constants whose two modes decay alike: beta2 follows from beta1."""
        return Coefficients(alpha1, alpha2, k_vs, beta1, tied_beta2(alpha1, alpha2, beta1, dipole), dipole)

    @staticmethod
    def with_decay_time(
        alpha1: Number, alpha2: Number, k_vs: Number, tau: Number, viscosity: Number, *, dipole: str = "corrected"
    ) -> "Coefficients":
        """Constants whose two modes both decay as exp(-t/τ) in a liquid of given viscosity."""
        return Coefficients.equal_decay(alpha1, alpha2, k_vs, alpha1 / (2 * tau * viscosity), dipole=dipole)

    @property
    def area_damping(self) -> Number:
        """beta2, or the value that makes both modes decay alike."""
        if self.beta2 is not None:
            return self.beta2
        return tied_beta2(self.alpha1, self.alpha2, self.beta1, self.dipole)


def dipole_dissipation(dipole: str) -> float:
    """Dissipation of the area motion per η g² Ṡ²: 3/(2π) corrected, 6/(5π) printed (eq:D)."""
    choose("dipole", dipole, DIPOLE_DISSIPATION, remedy="Use printed only to reproduce the source's beta2.")
    return DIPOLE_DISSIPATION[dipole]


def tied_beta2(alpha1: Number, alpha2: Number, beta1: Number, dipole: str = "corrected") -> Number:
    """The beta2 of equal decay.

    Source:
        C = (2/τ) M: 2 α2 β1 = 9 α1 β2 corrected, 5 α2 β1 = 18 α1 β2 printed.
    """
    return alpha2 * beta1 / (3 * math.pi * alpha1 * dipole_dissipation(dipole))


def decay_time(coefficients: Coefficients, viscosity: Number) -> jax.Array:
    """Decay time τ = α1/(2 β1 η) of the volume motion, of both modes when tied; infinite without damping.

    Source:
        eq:taureal, whose printed prefactor 2 is 1/2.
    """
    rate = 2 * jnp.asarray(coefficients.beta1) * viscosity / coefficients.alpha1
    return jnp.where(rate > 0, 1 / jnp.where(rate > 0, rate, 1.0), jnp.inf)


# The source's joint fit; its α1/β1 = 0.17, read with the printed eq:taureal, is 0.68 with the right one.
SOURCE = Coefficients(3.6, 1.1, 0.23, beta1=3.6 / 0.68)
