"""What viscosity takes from the potential flow itself, far from any wall layer.

The strain rates of a potential flow dissipate 2η e:e throughout the liquid.
Because ∇²|∇φ|² = 2 e:e, the volume integral is one over the wall,

    D = 2η ∮ (2H v² + κ1 u_s² - 2 u_s ∂v/∂s) dA = u·(η B) u ,

v the normal velocity and u_s = ∂φ/∂s that of the liquid along the wall.

Symbols    B resistance per viscosity [R0]   v, u_s velocities of the liquid at the wall   H, κ1 curvatures
Valid for  η̂ << 1 and a wall that slips freely: the whole loss of a clean bubble. On a wall that the liquid sticks to it
           is one of four terms of its order, see `second_order`
Source     Lamb, Hydrodynamics, arts. 329 and 348; a bubble's shapes decay with (n + 2)(2n + 1) η
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.contour import Curve, Meridian, speed
from jshell.flow.added_mass import Flow
from jshell.flow.wall_motion import Columns, across_wall, across_wall_slope, column, curvatures, every_motion


def bulk_stress(shape: Meridian, curve: Curve, v: Columns, v_s: Columns, u_s: Columns) -> tuple[Columns, ...]:
    """What works on v, on ∂v/∂s and on u_s, integrated over the wall's rings, for one or many motions."""
    bent = curvatures(curve)
    surface = column(4 * jnp.pi * shape.weights * curve.r * speed(curve))
    on_v = surface * column(bent.twice_mean) * v
    return on_v, -surface * u_s, surface * (column(bent.meridian) * u_s - v_s)


def bulk_resistance(shape: Meridian, current: Flow) -> Float[Array, "coordinates coordinates"]:
    """B of a shape, symmetric: u·B u times the viscosity is the power lost in the flow [R0]."""
    curve, motion = current.parts.curve, every_motion(shape)
    v, v_s = across_wall(curve, motion), across_wall_slope(curve, motion)
    u_s = (shape.potential_basis[1] @ current.potential) / column(speed(curve))
    on_v, on_v_s, on_u_s = bulk_stress(shape, curve, v, v_s, u_s)
    return v.T @ on_v + v_s.T @ on_v_s + u_s.T @ on_u_s
