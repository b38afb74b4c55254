"""Small oscillations of the buckled shell about its rest state.

Two coordinates, volume and area, obey M q'' + C q' + K q = 0. This module
holds the three matrices, the closed form of the two undamped frequencies, the
damped modes, and the exact motion.

Symbols    V volume [R0³]   S area [R0²]   P inner pressure [E d/R0]
           w2 squared frequency [E d/(ρ_f R0³)]   τ decay time [sqrt(ρ_f R0³/(E d))]
Valid for  small amplitude, buckled rest state of nearly uncompressed area,
           light damping (η << 1)
Source     Mokbel et al. 2021: eq:eqmovadimV, eq:eqmovadimS, eq:defw, eq:limstab.
           For ν ≠ 1/2 the wall's stiffness 1/4π carries K_A = 1/(2(1-ν)).
"""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from jshell.oscillator.coefficients import Coefficients, dipole_dissipation
from jshell.shell.elasticity import Scalar, moduli
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState


class Matrices(eqx.Module):
    """Mass, damping and stiffness of (ΔV, ΔS): M q'' + C q' + K q = 0."""

    mass: Float[Array, "2 2"]
    damping: Float[Array, "2 2"]
    stiffness: Float[Array, "2 2"]


def matrices(coefficients: Coefficients, state: RestState, conditions: Reduced) -> Matrices:
    """The matrices of the linear model at a rest state.

    Source:
        eq:eqmovadimV, eq:eqmovadimS; with the corrected dipole the damping of
        the area is 4 β2 V²/π³, printed 16 β2 V²/(5π³).
    """
    V, P = state
    c = coefficients
    K_A = moduli(conditions.thickness, conditions.poisson_ratio).area

    mass = jnp.stack([jnp.asarray(c.alpha1 / (4 * jnp.pi)), 2 * c.alpha2 * V**2 / (9 * jnp.pi**3)])
    dipole = 2 * dipole_dissipation(c.dipole) * 4 * V**2 / (3 * jnp.pi**2)
    damping = conditions.viscosity * jnp.stack([jnp.asarray(c.beta1 / jnp.pi), c.area_damping * dipole])

    gas, coupling = jnp.asarray(conditions.kappa * P / V), jnp.asarray(c.k_vs / V)
    wall = jnp.broadcast_to(jnp.asarray(K_A / (4 * jnp.pi)), gas.shape)
    stiffness = jnp.stack([jnp.stack([gas, coupling]), jnp.stack([coupling, wall])])
    return Matrices(jnp.diag(mass), jnp.diag(damping), stiffness)


def squared_frequencies(
    volume: Scalar,
    pressure: Scalar,
    alpha1: Scalar,
    alpha2: Scalar,
    k_vs: Scalar,
    *,
    kappa: Scalar = 1.4,
    area_modulus: Scalar = 1.0,
) -> Float[Array, "2"]:
    """Squared frequencies of the two undamped modes, slow mode first.

    Volume alone would oscillate at `a`, area alone at `b`; `c` couples them.
    The slow root is taken from the product of the roots, so no digits are
    lost when the two modes are far apart.

    Args:
        volume: Volume at rest [R0³].
        pressure: Inner pressure at rest [E d/R0].
        alpha1: Added-mass factor of the volume motion [-].
        alpha2: Added-mass factor of the area motion [-].
        k_vs: Volume-area coupling [-].
        kappa: Polytropic exponent of the gas [-].
        area_modulus: K_A = 1/(2(1-ν)) [E d].

    Returns:
        Slow and fast squared frequencies [E d/(ρ_f R0³)]. The slow one
        is negative where the buckled state is unstable (eq:limstab).

    Source:
        eq:defw; large-pressure limits eq:MinBuck and eq:omega-lim.
    """
    k2 = jnp.square(jnp.asarray(k_vs))
    return frequencies_of_square(volume, pressure, alpha1, alpha2, k2, kappa=kappa, area_modulus=area_modulus)


def frequencies_of_square(
    volume: Scalar,
    pressure: Scalar,
    alpha1: Scalar,
    alpha2: Scalar,
    k_vs_squared: Scalar,
    *,
    kappa: Scalar = 1.4,
    area_modulus: Scalar = 1.0,
) -> Float[Array, "2"]:
    """`squared_frequencies` as a function of k_VS², all that frequencies can tell of the coupling.

    Smooth at k_VS² = 0 and beyond, where a fit may want to pass.
    """
    V, P = jnp.asarray(volume), jnp.asarray(pressure)
    return jnp.stack(squares(V, P, alpha1, alpha2, k_vs_squared, kappa, area_modulus, jnp.sqrt))


def squares(V: Any, P: Any, alpha1: Any, alpha2: Any, k2: Any, kappa: Any, K_A: Any, sqrt: Any = np.sqrt) -> tuple:
    """The formula itself, of numbers or arrays of NumPy or, with its `sqrt`, of JAX: slow and fast ω².

    Volume alone would oscillate at `a`, area alone at `b`; `c` couples them.
    """
    a = 4 * np.pi * kappa * P / (alpha1 * V)
    b = 9 * np.pi**2 * K_A / (8 * alpha2 * V**2)
    c = 18 * np.pi**4 * k2 / (alpha1 * alpha2 * V**4)

    fast = (a + b) / 2 + sqrt(((a - b) / 2) ** 2 + c)
    return (a * b - c) / fast, fast


def stability_margin(state: RestState, coefficients: Coefficients, conditions: Reduced) -> Float[Array, ""]:
    """How far the buckled state is from losing its slow mode: 1 at the limit, more is stable.

    The limit belongs to the two-variable model; the axisymmetric shell does not show it.

    Source:
        κ V_e P_e/(4π k_VS²), from eq:limstab; K_A in the numerator for ν ≠ 1/2.
    """
    V, P = state
    K_A = moduli(conditions.thickness, conditions.poisson_ratio).area
    return jnp.asarray(conditions.kappa * V * P * K_A / (4 * jnp.pi * jnp.square(coefficients.k_vs)))


def state_matrix(system: Matrices) -> Float[Array, "4 4"]:
    """The first-order matrix of (ΔV, ΔS, ΔV̇, ΔṠ)."""
    m = jnp.diag(system.mass)[:, None]
    top = jnp.concatenate([jnp.zeros((2, 2)), jnp.eye(2)], axis=1)
    bottom = jnp.concatenate([-system.stiffness / m, -system.damping / m], axis=1)
    return jnp.concatenate([top, bottom])


def damped_modes(system: Matrices) -> Complex[Array, "4"]:
    """The four roots s of det(s² M + s C + K) = 0, by size; pairs are s = -1/τ ± iΩ.

    Of a pair the root with the positive frequency comes first. With equal
    decay Ω² = ω² - 1/τ² holds exactly, ω from `squared_frequencies`.

    Source:
        eq:eqw, whose full quartic the paper avoids.
    """
    roots = jnp.linalg.eigvals(state_matrix(system))
    size = jnp.abs(roots)
    order = jnp.lexsort((-jnp.imag(roots), jnp.round(size / size.max(), 10)))
    return roots[order]


SQUARINGS = 24  # steps of more than 2²⁴ turns of the fastest motion have no exponential here


def exponential(matrix: Float[Array, "rows rows"]) -> Float[Array, "rows rows"]:
    """Matrix exponential by Taylor's series and squaring: two short loops, so that it compiles at once.

    Accurate to the rounding of the squarings, derivatives of every order and direction as well;
    NaN where the 1-norm exceeds 2²⁴.
    """
    size = jnp.max(jnp.sum(jnp.abs(jax.lax.stop_gradient(matrix)), axis=0))
    squarings = jnp.maximum(jnp.ceil(jnp.log2(jnp.maximum(size, 1e-300))), 0.0)
    small = matrix / jnp.where(squarings > SQUARINGS, jnp.nan, 2.0**squarings)
    one = jnp.eye(matrix.shape[0])

    def add(series: jax.Array, order: jax.Array) -> tuple[jax.Array, None]:
        return one + small @ series / order, None

    def square(power: jax.Array, number: jax.Array) -> tuple[jax.Array, None]:
        go = number < squarings
        root = jnp.where(go, power, one)  # what is not used must not overflow either
        return jnp.where(go, root @ root, power), None

    # terms beyond the 18th of a matrix of norm one are below 1e-17
    series, _ = jax.lax.scan(add, one, jnp.arange(18.0, 0.0, -1.0))
    return jax.lax.scan(square, series, jnp.arange(float(SQUARINGS)))[0]


def propagator(system: Matrices, elapsed: Float[Array, " times"]) -> Float[Array, "times 4 4"]:
    """Exact motion: (ΔV, ΔS, ΔV̇, ΔṠ) after each elapsed time is this matrix times the initial one."""
    A = state_matrix(system)
    return jax.vmap(lambda t: exponential(A * t))(elapsed)


def uniform_propagator(system: Matrices, step: Scalar, count: int) -> Float[Array, "times 4 4"]:
    """Exact motion after 0, 1, …, count-1 equal steps.

    One matrix exponential; its powers as those of one long stride times those of the step, √count of each.
    """
    few = math.isqrt(max(count - 1, 0)) + 1
    stride, steps = _powers(exponential(state_matrix(system) * step), few)
    strides = _powers(stride, -(-count // few))[1]
    return jnp.einsum("sij,tjk->stik", strides, steps).reshape(-1, 4, 4)[:count]


def _powers(factor: Float[Array, "rows rows"], count: int) -> tuple[jax.Array, jax.Array]:
    """The power `count` of a matrix, and all before it from the zeroth on."""
    return jax.lax.scan(lambda power, _: (power @ factor, power), jnp.eye(factor.shape[0]), None, length=count)
