"""Small vibrations that are not axially symmetric: motions of order m around the axis, in the liquid.

    (K_m + s Z_m(s)) v = 0,   s = -1/τ + iΩ

as for m = 0, by orders of a thin Stokes layer. A shape that is not round has a
motion that grows instead: s > 0. Motions that cost nothing (a free shell moves
and turns, and a plain wall may take its dimple elsewhere) are left out.

Symbols    ω = |s| frequency [1/time]   τ decay time   M_m added mass   H, W height and width of the outline [R0]
Valid for  small amplitude; a layer thin against the shell and against its radius over m
Source     `jshell.membrane.azimuthal`, `jshell.flow.azimuthal`; the layer as in `roots`
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.scipy.linalg as jsl
from jaxtyping import Array, Complex, Float, Int

from jshell.contour import Azimuthal
from jshell.display import FREQUENCY, TIME, ended, number, readable, shown
from jshell.dynamics.modes import LOSSLESS, RESIDUAL
from jshell.dynamics.roots import Matrices, switched_on
from jshell.errors import Outcome
from jshell.flow.azimuthal import OrderLayers, order_flow, order_layers
from jshell.flow.azimuthal_layer import order_second, order_slip, order_wall
from jshell.membrane import RestShape
from jshell.membrane.azimuthal import Order, only, order_of, orthonormal
from jshell.membrane.stability import HELD, shared
from jshell.undetermined import undetermined

SHIFT = 4.0  # squared rate added while roots are sought: no growth of a rest shape is as fast [1/time²]
GROUND = 1e-7  # of a squared rate: slower is rounding


class OrderModes(eqx.Module):
    """Vibrations of several orders, slowest first; arrays are (orders, modes).

    Attributes:
        orders: (orders,) m.
        omega: Frequency |s|; NaN where the motion grows instead [1/time].
        Omega: Damped frequency Im s [1/time].
        tau: Decay time -1/Re s; infinite without loss, negative where the motion grows [time].
        rate: Complex rate s [1/time].
        dH, dW: Change of height and width of the outline seen across the axis, along the mode with vᵀM v = 1: W by the
            best azimuth; H twice a period, since a ring that tilts is higher on one side. Zero for odd m and W [R0].
        shapes: (orders, modes, motions) motions (a, b + c, b - c).
        outcome: Integer of `Outcome`: ok; not_converged where a root was lost; or how the rest shape ended.
        rest: The shape they are vibrations of.
    """

    orders: Int[Array, "orders"]
    omega: Float[Array, "orders modes"]
    Omega: Float[Array, "orders modes"]
    tau: Float[Array, "orders modes"]
    rate: Complex[Array, "orders modes"]
    dH: Float[Array, "orders modes"]
    dW: Float[Array, "orders modes"]
    shapes: Complex[Array, "orders modes motions"]
    outcome: Int[Array, "orders modes"]
    rest: RestShape

    @readable
    def __repr__(self) -> str:
        lines = [
            f"m = {int(m)}: ω {number(omega, FREQUENCY)}, τ {number(tau, TIME)}"
            for m, omega, tau in zip(self.orders, self.omega, self.tau, strict=True)
        ]
        return shown(self, *lines, ended(jnp.max(self.outcome)))


class OrderPencil(NamedTuple):
    """Matrices of one order on (a, b + c, b - c): stiffness with null motions and what may not move made stiff, added
    mass without null motions, slip and second order of the layer, the integral of the squared displacement."""

    K: Float[Array, "motions motions"]
    M: Float[Array, "motions motions"]
    G: Float[Array, "motions motions"]
    D: Float[Array, "motions motions"]


def order_vibrations(
    state: RestShape, orders: Int[Array, "orders"], most: int, count: int, liquid: str
) -> OrderModes:
    """Vibrations of orders m >= 1 about a rest shape; differentiable in its conditions.

    Args:
        state: The rest shape.
        orders: m, none above `most`.
        count: Modes of each order.
        liquid: `ideal`, `layer` or `second`.
    """
    state = eqx.tree_at(lambda s: s.meridian, state, jax.lax.stop_gradient(state.meridian))
    parts = order_layers(state.meridian, state.coordinates, most)
    return _vibrations(state, *shared(state), parts, orders, count, liquid)


@eqx.filter_jit
def _vibrations(state: RestShape, splines: Azimuthal, hessians, nulls, parts: OrderLayers, orders, count, liquid):
    shape = state.meridian
    viscosity = jnp.zeros(()) if liquid == "ideal" else state.conditions.viscosity

    def one(m):
        order = order_of(shape, splines, hessians, nulls, m)
        current = order_flow(shape, splines, parts, m)
        G = D = jnp.zeros_like(order.K)
        if liquid != "ideal":
            wall = order_wall(shape, splines, parts, current, m)
            G = only(order_slip(shape, parts, wall), order.moving, 0.0)
        if liquid == "second":
            D = only(order_second(shape, splines, parts, wall, m), order.moving, 0.0)
        pencil = deflated(order, only(current.mass, order.moving, 0.0), G, D)
        return order_roots(pencil, viscosity, count)

    rate, vectors, residual = jax.vmap(one)(orders)
    return _measured(state, splines, orders, rate, vectors, residual)


def deflated(order: Order, M, G, D) -> OrderPencil:
    """The pencil of an order in which motions that cost nothing take no part."""
    held = order.gram @ order.nulls
    moved = M @ orthonormal(order.nulls, M)
    # of a vibration M v is orthogonal to them; which of them it holds besides does not matter
    return OrderPencil(order.K + HELD * held @ held.T, M - moved @ moved.T, G, D)


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
    parts = Matrices(frozen.K, frozen.M, frozen.G, frozen.D, none, nothing, None)
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


def _measured(state: RestShape, splines: Azimuthal, orders, rate, vectors, residual) -> OrderModes:
    """What is told of the roots: frequencies, and what a camera sees of them."""
    grows = jnp.real(rate) > GROUND
    lost = ~(residual < RESIDUAL) | ~(grows | (jnp.imag(rate) > 0))
    outcome = jnp.where(lost, Outcome.NOT_CONVERGED, Outcome.OK)
    outcome = jnp.where(state.outcome != Outcome.OK, state.outcome, outcome)
    settled = jnp.abs(jnp.real(rate)) > LOSSLESS * jnp.abs(rate)
    tau = jnp.where(settled, -1 / jnp.where(settled, jnp.real(rate), 1.0), jnp.inf)
    curve = state.meridian.at_points(state.coordinates)
    top, bottom, widest = jnp.argmax(curve.x), jnp.argmin(curve.x), jnp.argmax(curve.r)

    def seen(m, v):
        a, p, g = (family.values[0] @ part for family, part in zip(splines.motion(m), v.reshape(3, -1), strict=True))
        return jnp.abs(a[top]) + jnp.abs(a[bottom]), jnp.where(m % 2 == 0, jnp.abs((p + g)[widest]), 0.0)

    dH, dW = jax.vmap(lambda m, rows: jax.vmap(lambda v: seen(m, v))(rows))(orders, vectors)
    omega = undetermined(grows, jnp.abs(rate))
    Omega = undetermined(grows, jnp.imag(rate))
    nothing = outcome != Outcome.OK
    numbers = undetermined(nothing, (omega, Omega, tau, rate, dH, dW, vectors))
    return OrderModes(orders, *numbers, outcome, state)
