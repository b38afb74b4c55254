"""How much slower a shell rings once it has buckled.

Symbols    P̂ext outer pressure [E d/R0]   ω±  angular frequencies of the buckled shell, ω_sph of the sphere
Valid for  as the plateau law and the linear model say
Source     Mokbel et al. 2021: fig:soft, section "Softening of buckled shells"; Marmottant et al. 2005
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.oscillator.coefficients import Coefficients
from jshell.oscillator.simulate import frequencies
from jshell.shell.elasticity import SPHERE_VOLUME
from jshell.shell.parameters import Number, Reduced
from jshell.shell.rest import RestState
from jshell.shell.sphere import buckling_load, marmottant_frequency, sphere_frequency, sphere_frequency_at_load


class Drop(eqx.Module):
    """The sphere's angular frequency just before buckling over others just after: the source's measure of softening.

    Attributes:
        load: Outer pressure at which the shell buckles [E d/R0]; NaN where it never does.
        slow: ω_sph/ω-; NaN where the slow mode is unstable.
        fast: ω_sph/ω+.
        marmottant: ω_sph/ω of a bubble of radius R0 at the outer pressure.
    """

    load: Float[Array, "*batch"]
    slow: Float[Array, "*batch"]
    fast: Float[Array, "*batch"]
    marmottant: Float[Array, "*batch"]


class Crossing(eqx.Module):
    """Angular frequencies over the outer pressure, relative to the stress-free sphere's.

    Attributes:
        pressures: (loads,) [E d/R0].
        load: Where the shell buckles.
        unit: Angular frequency of the stress-free sphere [sqrt(E d/(ρ_f R0³))].
        sphere: (loads,) of the sphere; NaN beyond buckling.
        slow, fast: (loads,) of the buckled shell; NaN below.
        marmottant: (loads,) Marmottant's buckled law; NaN below.
    """

    pressures: Float[Array, " loads"]
    load: Float[Array, ""]
    unit: Float[Array, ""]
    sphere: Float[Array, " loads"]
    slow: Float[Array, " loads"]
    fast: Float[Array, " loads"]
    marmottant: Float[Array, " loads"]


@eqx.filter_jit
def softening(thickness: Any, gas_pressure: Any, coefficients: Coefficients) -> Drop:
    """How far the angular frequencies fall at the buckling threshold.

    Args:
        thickness: d̂, any shape.
        gas_pressure: P̂0, of the same shape, or both of shapes that broadcast, such as (rows, 1) and (1, columns).
        coefficients: Constants of the short model.

    Source:
        fig:soft.

    Example:
        >>> from jshell.oscillator import SOURCE, softening
        >>> found = softening(0.02, 0.4, SOURCE)
        >>> print(f"{float(found.slow):.2f} {float(found.fast):.2f} {float(found.marmottant):.2f}")
        4.53 2.51 1.76
    """

    def one(d: jax.Array, P0: jax.Array) -> tuple[jax.Array, ...]:
        load = buckling_load(Reduced(d, P0, P0))
        at = Reduced(d, P0, load)
        found = frequencies(at, coefficients)
        top = found.omega_sphere
        return load, top / found.omega_minus, top / found.omega_plus, top / found.omega_marmottant

    d, P0 = jnp.asarray(thickness, dtype=float), jnp.asarray(gas_pressure, dtype=float)
    shape = jnp.broadcast_shapes(d.shape, P0.shape)
    flat = (jnp.broadcast_to(part, shape).ravel() for part in (d, P0))
    return Drop(*(part.reshape(shape) for part in jax.vmap(one)(*flat)))


@eqx.filter_jit
def crossing(thickness: Number, gas_pressure: Number, coefficients: Coefficients, pressures: Any) -> Crossing:
    """Angular frequencies of one shell as the outer pressure crosses buckling.

    Args:
        thickness: d̂.
        gas_pressure: P̂0.
        coefficients: Constants of the short model.
        pressures: (loads,) outer pressures [E d/R0].
    """
    d, P0 = jnp.asarray(thickness, dtype=float), jnp.asarray(gas_pressure, dtype=float)
    P = jnp.asarray(pressures, dtype=float)
    free = Reduced(d, P0, P0)
    unit = sphere_frequency(RestState(jnp.asarray(SPHERE_VOLUME), P0), free)
    load = buckling_load(free)

    def one(P: jax.Array) -> tuple[jax.Array, ...]:
        at = Reduced(d, P0, P)
        found = frequencies(at, coefficients)
        return sphere_frequency_at_load(at), found.omega_minus, found.omega_plus, marmottant_frequency(at)

    sphere, slow, fast, bubble = (part / unit for part in jax.vmap(one)(P))
    before = load > P
    hide = lambda part, where: jnp.where(where, part, jnp.nan)  # noqa: E731
    return Crossing(P, load, unit, hide(sphere, before), *(hide(part, ~before) for part in (slow, fast, bubble)))
