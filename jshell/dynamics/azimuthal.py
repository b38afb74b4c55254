"""Small vibrations that are not axially symmetric: motions of order m around the axis, in the liquid.

    (K_m + s Z_m(s)) v = 0,   s = -1/τ + iΩ

as for m = 0, by orders of a thin Stokes layer. A shape that is not round has a
motion that grows instead: s > 0. Motions that cost nothing (a free shell moves
and turns, and a plain wall may take its dimple elsewhere) are left out.

Symbols    ω = |s| frequency [1/time]   τ decay time   M_m added mass   H, W height and width of the outline [R0]
Valid for  small amplitude; a layer thin against the shell and against its radius over m
Source     `jshell.membrane.azimuthal`, `jshell.flow.azimuthal`; the layer as in `roots`
"""

from collections.abc import Sequence
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Int

from jshell.contour import NO_WEAK_SPOT, Azimuthal, WeakSpot
from jshell.display import FREQUENCY, TIME, ended, number, readable, shown
from jshell.dynamics.modes import LOSSLESS, RESIDUAL
from jshell.dynamics.order_roots import deflated, order_roots
from jshell.errors import BadValue, Outcome, choose
from jshell.flow.azimuthal import OrderLayers, order_flow, order_layers
from jshell.flow.azimuthal_layer import order_second, order_slip, order_wall
from jshell.membrane import RestShape, rest
from jshell.membrane.azimuthal import only, order_of
from jshell.membrane.energy import Area
from jshell.membrane.equilibrium import raise_unless_ok
from jshell.membrane.rest import Branch
from jshell.membrane.stability import checked_orders, shared
from jshell.shell.parameters import Reduced
from jshell.undetermined import undetermined

ORDER_LIQUIDS = ("second", "layer", "ideal")
GROUND = 1e-7  # of a squared rate: slower is rounding


@dataclass(frozen=True)
class OrderMode:
    """One mode of one order as a table shows it; None where there is nothing to say.

    Attributes:
        azimuth, mode: m, and its number within that order, from 1.
        omega, Omega: |s| and Im s [1/time]; None where it grows.
        tau: Decay time [time]; None without loss or where it grows.
        growth: Rate at which it grows [1/time], or None.
        dH, dW: Change of height, twice a period, and of width of the outline; vᵀM v = 1 [R0].
        outcome: `ok`, or why there is nothing.
    """

    azimuth: int
    mode: int
    omega: float | None
    Omega: float | None
    tau: float | None
    growth: float | None
    dH: float | None
    dW: float | None
    outcome: str


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
        return shown(self, *lines, ended(self.outcome))

    def table(self) -> tuple[OrderMode, ...]:
        """The modes as rows of plain numbers, by orders."""
        finite = lambda x: float(x) if np.isfinite(x) else None  # noqa: E731
        rows = []
        for i, m in enumerate(np.asarray(self.orders).tolist()):
            for k in range(self.omega.shape[1]):
                real = float(jnp.real(self.rate[i, k]))
                grows = real > GROUND
                measured = (finite(part[i, k]) for part in (self.omega, self.Omega, self.tau, self.dH, self.dW))
                omega, Omega, tau, dH, dW = measured
                tau, growth = (None, real) if grows else (tau, None)
                word = Outcome(int(self.outcome[i, k])).word
                rows.append(OrderMode(m, k + 1, omega, Omega, tau, growth, dH, dW, word))
        return tuple(rows)


def azimuthal_modes(
    conditions: Reduced,
    azimuth: int | Sequence[int] = (1, 2, 3),
    *,
    count: int = 2,
    liquid: str = "second",
    branch: Branch | str = "buckled",
    elements: int = 32,
    attached: float = 0.0,
    weak_spot: WeakSpot = NO_WEAK_SPOT,
    area: Area | str = "current",
    throw: bool = False,
) -> OrderModes:
    """Vibrations of orders m >= 1 about a rest shape; those of m = 0 are `modes`.

    Args:
        conditions: The problem without units.
        azimuth: m, one or several, from 1 to 40.
        count: Modes of each, slowest first.
        liquid: `second` or `layer`, a Stokes layer to that order, or `ideal`; the exact liquid is known for m = 0 only.
        branch, elements, attached, weak_spot, area: As in `jshell.membrane.rest`.
        throw: Raise `NotOk` unless rest shape and all modes are ok (outside `jit` only).

    Raises:
        BadName: No such liquid.
        BadValue: Orders below 1 or above 40; `count` not between 1 and a quarter of the elements.

    Example:
        >>> import jshell as js
        >>> found = js.dynamics.azimuthal_modes(js.presets.R.conditions, (1, 2, 3, 4), liquid="ideal", elements=24)
        >>> print(found.omega[1].round(3))
        [1.339 2.396]
    """
    choose("liquid", liquid, ORDER_LIQUIDS, remedy="second is right to 0.6 % in τ at η̂ = 0.004.")
    orders = checked_orders(azimuth)
    if not 1 <= count <= elements // 4:
        raise BadValue("count", found=repr(count), expected=f"1 to {elements // 4}", remedy="Raise `elements`.")
    state = rest(
        conditions, branch=branch, elements=elements, attached=attached, weak_spot=weak_spot, area=area, throw=throw
    )
    found = order_vibrations(state, jnp.asarray(orders), max(2, int(orders.max())), count, liquid)
    if throw:
        raise_unless_ok("azimuthal modes", jnp.max(found.outcome))
    return found


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
