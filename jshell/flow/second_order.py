"""The second order of a thin Stokes layer: what viscosity takes beside the layer itself, on a wall of any shape.

At a rate s the impedance of a wall that the liquid sticks to is a series in sqrt(η̂),

    Z = s M + sqrt(s η̂) G + η̂ D + O(η̂^{3/2}),

    D = 2 ∫ e:e dV - 4 ∮ w e_nt dA + ∮ (H + κ1) w² dA + ∮ div_S(w) N div_S(w) dA

as quadratic forms: the loss of the potential flow itself, the work of its shear
at the wall on the slip, the layer on a curved wall, and the flow that the layer
drives by displacing liquid. The first alone is the loss of a wall that slips.

Symbols    w slip, e_nt = ∂v/∂s - κ1 u_s shear of the potential flow at the wall   v, u_s its velocities
           κ1, H curvatures [1/R0]   N map from normal velocity to -φ   D resistance per viscosity [R0]
Valid for  η̂ << 1: at R 0.6 % in τ at η̂ = 0.004, 2 % at 0.013, 8 % at 0.05. Its lowest eigenvalues may be slightly
           negative, in motions so stiff that the layer takes far more from them
Source     matched expansion of the impedance of `viscous`, which it agrees with; on a sphere its closed form
"""

from typing import NamedTuple

import jax.numpy as jnp
import jax.scipy.linalg as jsl
from jaxtyping import Array, Float

from jshell.contour import Curve, Meridian, speed
from jshell.flow.added_mass import Flow, slip_operator
from jshell.flow.bulk_loss import bulk_resistance
from jshell.flow.panels import Layers
from jshell.flow.wall_motion import Columns, across_wall, across_wall_slope, column, curvatures, every_motion

Matrix = Float[Array, "coordinates coordinates"]


class SecondOrder(NamedTuple):
    """The four parts of D, each symmetric: bulk, shear at the wall, curvature, displaced liquid [R0]."""

    bulk: Matrix
    shear: Matrix
    curvature: Matrix
    displaced: Matrix


class AtWall(NamedTuple):
    """What motions do at the wall, one column each: v and ∂v/∂s across it, u_s of the liquid along it, slip w."""

    v: Columns
    v_s: Columns
    u_s: Columns
    w: Columns


def at_wall(shape: Meridian, current: Flow, slip: Columns) -> AtWall:
    """Of every motion of the wall."""
    curve, motion = current.parts.curve, every_motion(shape)
    u_s = (shape.potential_basis[1] @ current.potential) / column(speed(curve))
    return AtWall(across_wall(curve, motion), across_wall_slope(curve, motion), u_s, slip)


def second_order(shape: Meridian, current: Flow) -> SecondOrder:
    """D of a shape by its four parts; `second_resistance` is their sum at half the work.

    Args:
        shape, current: The wall and `flow` of it.
    """
    wall = at_wall(shape, current, slip_operator(shape, current))
    curve = current.parts.curve
    bent = curvatures(curve)
    surface = column(2 * jnp.pi * shape.weights * curve.r * speed(curve))
    work = -2 * wall.w.T @ (surface * (wall.v_s - column(bent.meridian) * wall.u_s))
    curved = wall.w.T @ (surface * column(bent.twice_mean / 2 + bent.meridian) * wall.w)
    displaced = displacement(shape, current.parts, inverse_of(current), slip_splines(shape) @ wall.w)
    return SecondOrder(bulk_resistance(shape, current), work + work.T, curved, displaced)


def second_resistance(
    shape: Meridian,
    current: Flow,
    slip: Columns | None = None,
    inverse: Float[Array, "nodes nodes"] | None = None,
    nearest: Float[Array, "odd points"] | None = None,
) -> Matrix:
    """D of a shape, symmetric [R0]: u·D u times the viscosity is the power of second order.

    Args:
        shape, current: The wall and `flow` of it.
        slip, inverse, nearest: `slip_operator(shape, current)`, the inverse of 1/2 - D and `slip_splines(shape)`, where
            they are known already.
    """
    wall = at_wall(shape, current, slip_operator(shape, current) if slip is None else slip)
    known = inverse_of(current) if inverse is None else inverse
    splines = slip_splines(shape) if nearest is None else nearest
    local = jnp.concatenate(wall).T @ jnp.concatenate(stresses(shape, current.parts.curve, wall))
    return local + displacement(shape, current.parts, known, splines @ wall.w)


def inverse_of(current: Flow) -> Float[Array, "nodes nodes"]:
    """The inverse of 1/2 - D."""
    return jsl.lu_solve(current.factors, jnp.eye(current.potential.shape[0]))


def stresses(shape: Meridian, curve: Curve, wall: AtWall) -> AtWall:
    """What works on v, v_s, u_s and w at each ring of the wall; their sum is u·D u but for the displaced liquid."""
    bent = curvatures(curve)
    surface = column(2 * jnp.pi * shape.weights * curve.r * speed(curve))
    kappa1, twice_H = column(bent.meridian), column(bent.twice_mean)
    shear = wall.v_s - kappa1 * wall.u_s
    return AtWall(
        2 * surface * twice_H * wall.v,
        -2 * surface * (wall.u_s + wall.w),
        2 * surface * (kappa1 * wall.w - shear),
        surface * ((twice_H / 2 + kappa1) * wall.w - 2 * shear),
    )


def displacement(
    shape: Meridian, parts: Layers, inverse: Float[Array, "nodes nodes"], w: Float[Array, "odd columns"]
) -> Matrix:
    """∮ div_S(w) N div_S(w) dA: the flow that a layer of slip w, given by its splines, drives by displacing liquid."""
    source = displaced_source(shape, parts)
    ring = column(2 * jnp.pi * shape.weights * parts.curve.r)
    # by parts: ∮ ∂φ/∂s w dA, φ the potential of the displaced liquid
    one_way = -(shape.r_basis[0].T @ (ring * shape.potential_basis[1])) @ (inverse @ source)
    return w.T @ ((one_way + one_way.T) / 2 @ w)


def slip_splines(shape: Meridian) -> Float[Array, "odd points"]:
    """Takes a slip at the Gauss points to the coefficients of the odd splines nearest to it; it belongs to the mesh."""
    basis = shape.r_basis[0]
    weighted = basis.T * shape.weights[None]
    return jnp.linalg.solve(weighted @ basis, weighted)


def displaced_source(shape: Meridian, parts: Layers) -> Float[Array, "nodes odd"]:
    """Single layer at the nodes of the flux (r w)' per θ that each spline of slip w displaces."""
    curve, local, near = parts.curve, parts.near_curve, shape.near
    far = (parts.far_source * curve.r1[None]) @ shape.r_basis[0] + (parts.far_source * curve.r[None]) @ shape.r_basis[1]
    over = lambda kernel, basis: jnp.einsum("ns,nsk->nk", kernel, basis)  # noqa: E731
    return far + over(parts.near_source * local.r1, near.r_value) + over(parts.near_source * local.r, near.r_slope)
