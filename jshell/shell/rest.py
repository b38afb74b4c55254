"""Where a shell rests: the compressed sphere, and the buckled state of the plateau law.

Both are the short model's rest states, closed forms and one scalar root; the
rest *shape* is computed by `jshell.membrane`.

Symbols    V volume [R0³]   P inner pressure [E d/R0]   R radius [R0]
Valid for  eq:equiplateau is within 2 % for 0.05 <= d̂ <= 0.1 and V/V0 0.5-0.7; pogorelov within 0.5 % for
           0.01 <= d̂ <= 0.12 at V/V0 = 0.7
Source     Mokbel et al. 2021: eq:equiplateau, eq:equivol, eq:NRJsph
"""

import warnings
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jshell.errors import RangeWarning, choose
from jshell.scalar_root import root_of
from jshell.shell.elasticity import SPHERE_VOLUME, Scalar, moduli
from jshell.shell.parameters import Reduced

Law = Literal["coupier2019", "pogorelov"]
PLATEAU_RANGES = {"coupier2019": (0.05, 0.1, "2 %"), "pogorelov": (0.01, 0.12, "0.5 %")}
PLATEAU_RANGE = PLATEAU_RANGES["coupier2019"][:2]


class RestState(NamedTuple):
    """Volume [R0³] and inner pressure [E d/R0] at rest."""

    volume: Float[Array, ""]
    pressure: Float[Array, ""]


def plateau_pressure(thickness: Scalar, poisson_ratio: Scalar = 0.5, law: Law | str = "coupier2019") -> Scalar:
    """Pressure difference ΔP_pl that holds a buckled shell, by a law [E d/R0].

    `jshell.membrane.plateau_pressure` computes it instead.

    Args:
        thickness: d̂ [-].
        poisson_ratio: ν [-].
        law: `coupier2019`, for any Poisson ratio, or `pogorelov`, his power of d̂ with a correction for thick walls.

    Raises:
        BadName: Another law.

    Source:
        eq:equiplateau. The printed prefactor (3/4)^-0.75 is (1 - ν²)^(-3/4) at ν = 1/2. The constants of
        `pogorelov`, 0.703 and 1.15, fit computed plateaus at V/V0 = 0.7 to 0.5 %.
    """
    choose("law", law, PLATEAU_RANGES)
    d = thickness
    poisson = (1 - poisson_ratio**2) ** (-0.75)
    if law == "coupier2019":
        return poisson * (2.34e-6 + 0.9 * d**2.57) / d
    return poisson * 0.703 * d**1.5 * (1 + 1.15 * d)


def warn_outside_plateau_range(thickness: Scalar, law: Law | str = "coupier2019") -> None:
    """Warn where a plateau law has not been checked (concrete values only)."""
    if isinstance(thickness, Tracer) or law not in PLATEAU_RANGES:
        return
    low, high, accuracy = PLATEAU_RANGES[law]
    d = np.asarray(thickness)
    if np.any((d < low) | (d > high)):
        warnings.warn(
            f"the plateau law {law} is within {accuracy} for {low} <= d_hat <= {high} only; "
            f"at d_hat = {float(d.ravel()[0]):g} the volume may be off by a percent and the pressure by 10 % or more",
            RangeWarning,
            stacklevel=3,
        )


def gas_pressure(volume: Scalar, conditions: Reduced) -> Float[Array, ""]:
    """Adiabatic gas: P = P̂0 (V0/V)^κ [E d/R0] (eq:equivol)."""
    return jnp.asarray(conditions.gas_pressure * (SPHERE_VOLUME / volume) ** conditions.kappa)


def buckled_state(conditions: Reduced) -> RestState:
    """Rest state of the buckled shell by the plateau law `coupier2019`.

    Returns:
        Volume and inner pressure; NaN where P̂ext does not exceed the plateau (no buckled state).

    Source:
        eq:equiplateau, eq:equivol.
    """
    warn_outside_plateau_range(conditions.thickness)
    P = conditions.outer_pressure - plateau_pressure(conditions.thickness, conditions.poisson_ratio)
    safe = jnp.where(P > 0, P, 1.0)
    V = SPHERE_VOLUME * (conditions.gas_pressure / safe) ** (1 / conditions.kappa)
    return RestState(jnp.where(P > 0, V, jnp.nan), jnp.where(P > 0, P, jnp.nan))


def sphere_state(conditions: Reduced) -> RestState:
    """Rest state of the unbuckled, uniformly compressed sphere.

    Returns:
        Volume and inner pressure; differentiable in every condition. NaN where the outer pressure crushes
        the sphere and no rest radius is found.

    Source:
        eq:NRJsph with eq:Ug; R solves P_ext - P + U'(R)/(4πR²) = 0, U the sphere's energy.
    """
    return _sphere_state(conditions.as_arrays())


@jax.jit
def _sphere_state(conditions: Reduced) -> RestState:
    K = moduli(conditions.thickness, conditions.poisson_ratio)

    def imbalance(radius, conditions):
        P = conditions.gas_pressure * radius ** (-3 * conditions.kappa)
        area_slope = 4 * (1 - radius) * (K.area * radius * (2 * radius - 1) + K.bending) / radius**2
        return P + area_slope - conditions.outer_pressure

    R = root_of(imbalance, jnp.asarray(1.0), conditions)
    R = jnp.where(R > 0, R, jnp.nan)
    V = SPHERE_VOLUME * R**3
    return RestState(V, gas_pressure(V, conditions))
