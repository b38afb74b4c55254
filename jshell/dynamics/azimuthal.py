"""Small vibrations that are not axially symmetric: motions of order m around the axis, in the liquid.

    (K_m + s Z_m(s)) v = 0,   s = -1/τ + iΩ

as for m = 0, by orders of a thin Stokes layer. A shape that is not round has a
motion that grows instead: s > 0. Motions that cost nothing (a free shell moves
and turns, and a plain wall may take its dimple elsewhere) are left out.

Symbols    ω = |s| frequency [1/time]   τ decay time   M_m added mass   H, W height and width of the outline [R0]
Valid for  small amplitude; a layer thin against the shell and against its radius over m
Source     `jshell.membrane.azimuthal`, `jshell.flow.azimuthal`; the layer as in `roots`
"""

import warnings
from collections.abc import Sequence
from typing import Unpack

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Int

from jshell.contour import Azimuthal
from jshell.dynamics.order_modes import GROUND, OrderModes
from jshell.dynamics.order_roots import deflated, order_roots
from jshell.dynamics.vibrations import LOSSLESS, RESIDUAL
from jshell.errors import BadName, BadValue, Outcome, RangeWarning, choose
from jshell.flow.azimuthal import OrderLayers, order_flow, order_layers
from jshell.flow.azimuthal_layer import order_second, order_slip, order_wall
from jshell.membrane import RestShape, rest
from jshell.membrane.azimuthal import only, order_of
from jshell.membrane.equilibrium import raise_unless_ok
from jshell.membrane.rest import ELEMENTS, RestOptions
from jshell.membrane.stability import checked_orders, shared
from jshell.shell.parameters import Reduced
from jshell.undetermined import undetermined

ORDER_LIQUIDS = ("second", "layer", "ideal")
LIQUID_AROUND = "second"  # what is meant where no liquid is named: the best that is known for m >= 1
# m √(2η̂/ω) up to which `layer` and `second` are off by 15 and 5 % in τ; on a sphere against the exact liquid
THICKEST_TURN = {"layer": 0.2, "second": 0.5}


def check_order_liquid(liquid: str) -> None:
    """Refuse what is no liquid of orders m >= 1.

    Raises:
        BadName: No such liquid, or the exact one.
    """
    if liquid == "exact":
        raise BadName(
            "liquid",
            found="'exact' for orders m >= 1",
            expected=f"one of {', '.join(ORDER_LIQUIDS)}: the exact liquid is known for m = 0 only",
            remedy="'second', the default there, is right to 0.7 % in τ at η̂ = 0.004 and to 2.5 % at 0.013, as on the "
            "sphere, where (n, m) is exact as (n, 0).",
        )
    choose("liquid", liquid, ORDER_LIQUIDS, remedy="second is right to 0.7 % in τ at η̂ = 0.004.")


def check_count(count: int, elements: int) -> None:
    """Refuse more modes of an order than the elements carry."""
    if not 1 <= count <= elements // 4:
        raise BadValue("count", found=repr(count), expected=f"1 to {elements // 4}", remedy="Raise `elements`.")


def azimuthal_modes(
    conditions: Reduced,
    azimuth: int | Sequence[int] = (1, 2, 3),
    *,
    count: int = 2,
    liquid: str = "second",
    throw: bool = False,
    **shape: Unpack[RestOptions],
) -> OrderModes:
    """Vibrations of orders m >= 1 about a rest shape; those of m = 0 are `modes`.

    Args:
        conditions: The problem without units.
        azimuth: m, one or several, from 1 to 40.
        count: Modes of each, slowest first.
        liquid: `second` or `layer`, a Stokes layer to that order, or `ideal`; the exact liquid is known for m = 0 only.
            `second` is right to 0.7 % in τ at η̂ = 0.004, 2.5 % at 0.013, 6 % at 0.03 (sphere, n <= 8).
        shape: Its branch, elements, attached, weak_spot, area, as in `jshell.membrane.rest`.
        throw: Raise `NotOk` unless rest shape and all modes are ok (outside `jit` only).

    Raises:
        BadName: No such liquid; the exact one.
        BadValue: Orders below 1 or above 40; `count` not between 1 and a quarter of the elements.

    Example:
        >>> import jshell as js
        >>> found = js.dynamics.azimuthal_modes(js.presets.R.conditions, (1, 2, 3, 4), liquid="ideal", elements=24)
        >>> print(found.omega[1].round(3))
        [1.339 2.396]
    """
    check_order_liquid(liquid)
    orders = checked_orders(azimuth)
    check_count(count, shape.get("elements", ELEMENTS))
    state = rest(conditions, throw=throw, **shape)
    found = orders_about(state, orders.tolist(), count, liquid)
    if throw:
        raise_unless_ok("azimuthal modes", jnp.max(found.outcome))
    warn_of_thick_order(found, liquid)
    return found


def orders_about(state: RestShape, orders: Sequence[int], count: int, liquid: str = LIQUID_AROUND) -> OrderModes:
    """Vibrations of orders m >= 1 about a rest shape that was found."""
    return order_vibrations(state, jnp.asarray(orders), max(2, *orders), count, liquid)


def warn_of_thick_order(found: OrderModes, liquid: str, level: int = 3) -> None:
    """Warn where the layer is thick against the length over which a motion varies (one concrete shell only)."""
    omega, viscosity = jax.lax.stop_gradient((found.omega, found.rest.conditions.viscosity))
    if liquid not in THICKEST_TURN or isinstance(omega, Tracer) or isinstance(viscosity, Tracer) or np.ndim(viscosity):
        return
    layers = np.sqrt(2 * float(viscosity) / np.nan_to_num(np.asarray(omega), nan=np.inf))
    # m = 1 varies over the length that m = 2 does
    shares = layers * np.maximum(np.asarray(found.orders), 2)[:, None]
    worst = np.unravel_index(np.argmax(shares), shares.shape)
    if shares[worst] > THICKEST_TURN[liquid]:
        warnings.warn(
            f"at m = {int(found.orders[worst[0]])} the Stokes layer is {layers[worst]:.2g} R0 thick, "
            f"{shares[worst]:.2g} of the length over which the motion varies; liquid={liquid!r} is made for less than "
            f"{THICKEST_TURN[liquid]:g}, and the exact liquid is known for m = 0 only",
            RangeWarning,
            stacklevel=level,
        )


def order_vibrations(state: RestShape, orders: Int[Array, "orders"], most: int, count: int, liquid: str) -> OrderModes:
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
    omega, Omega, tau, rate, dH, dW, vectors = undetermined(nothing, (omega, Omega, tau, rate, dH, dW, vectors))
    return OrderModes(
        orders=orders,
        omega=omega,
        Omega=Omega,
        tau=tau,
        rate=rate,
        dH=dH,
        dW=dW,
        shapes=vectors,
        outcome=outcome,
        rest=state,
    )
