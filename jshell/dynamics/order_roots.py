"""Roots of one order around the axis: K v + s² M v + s^{3/2} √η̂ G v + s η̂ D v = 0, growing ones too.

As in `roots`, followed from the undamped ones while viscosity is switched on;
an undamped squared frequency may be negative here.

Symbols    s rate [1/time]   K, M, G, D stiffness, added mass, slip matrix, second order   σ = √s
Valid for  as `roots`
Source     as `roots`
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import jax.scipy.linalg as jsl
from jaxtyping import Array, Float

from jshell.dynamics.roots import ShellMatrices, switched_on
from jshell.membrane.azimuthal import Order, orthonormal
from jshell.membrane.stability import NULL_STIFFNESS

SHIFT = 4.0  # squared rate added while roots are sought: no growth of a rest shape is as fast [1/time²]


class OrderPencil(NamedTuple):
    """Matrices of one order on (a, b + c, b - c): stiffness with null motions and what may not move made stiff, added
    mass without null motions, slip and second order of the layer, the integral of the squared displacement."""

    K: Float[Array, "motions motions"]
    M: Float[Array, "motions motions"]
    G: Float[Array, "motions motions"]
    D: Float[Array, "motions motions"]


def deflated(order: Order, M, G, D) -> OrderPencil:
    """The pencil of an order in which motions that cost nothing take no part."""
    held = order.gram @ order.nulls
    moved = M @ orthonormal(order.nulls, M)
    # of a vibration M v is orthogonal to them; which of them it holds besides does not matter
    return OrderPencil(order.K + NULL_STIFFNESS * held @ held.T, M - moved @ moved.T, G, D)


def order_roots(pencil: OrderPencil, viscosity, count: int):
    """Rates, their vectors and relative residuals, slowest first; differentiable in the pencil."""
    frozen, given = jax.lax.stop_gradient((pencil, jnp.asarray(viscosity, dtype=float)))
    # a shape that is not round has a negative K, but no K + SHIFT M
    L = jnp.linalg.cholesky(frozen.K + SHIFT * frozen.M)
    half = jsl.solve_triangular(L, frozen.M, lower=True)
    compact = jsl.solve_triangular(L, half.T, lower=True)
    values, vectors = jnp.linalg.eigh((compact + compact.T) / 2)
    best = slice(-1, -1 - count, -1)
    squared = 1 / values[best] - SHIFT
    start = jsl.solve_triangular(L.T, vectors[:, best], lower=False).T.astype(complex)
    none, nothing = jnp.zeros(frozen.K.shape[0]), jnp.zeros(0, dtype=int)
    parts = ShellMatrices(frozen.K, frozen.M, frozen.G, frozen.D, none, nothing, None)
    root = jnp.sqrt(jnp.maximum(given, 1e-300))

    def follow(squared, v):
        sigma, v = switched_on(parts, root, jnp.sqrt(jnp.sqrt(-squared.astype(complex))), v)
        sigma, v = jax.lax.stop_gradient((sigma, v / jnp.linalg.norm(v)))
        now = jnp.sqrt(jnp.maximum(jnp.asarray(viscosity, dtype=float), 1e-300))
        F = pencil.K + sigma**4 * pencil.M + sigma**3 * now * pencil.G + (sigma * now) ** 2 * pencil.D
        slope = 4 * sigma**3 * frozen.M + 3 * sigma**2 * root * frozen.G + 2 * sigma * root**2 * frozen.D
        left = jax.lax.stop_gradient(F) @ v
        residual = jnp.linalg.norm(left) / (jnp.linalg.norm(frozen.K) * jnp.linalg.norm(v))
        # ds/dp = -vᵀ(∂F/∂p)v / vᵀF'v: one more step carries the derivative
        sigma = sigma - (v @ (F @ v)) / (v @ (slope @ v))
        return sigma**2, v / jnp.sqrt(v @ (frozen.M @ v)), residual

    return jax.vmap(follow)(squared, start)
