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
from jshell.flow.wall_motion import across_wall_slope, column, curvatures, every_motion

Matrix = Float[Array, "coordinates coordinates"]


class SecondOrder(NamedTuple):
    """The four parts of D, each symmetric: bulk, shear at the wall, curvature, displaced liquid [R0]."""

    bulk: Matrix
    shear: Matrix
    curvature: Matrix
    displaced: Matrix


def second_order(shape: Meridian, current: Flow, slip: Float[Array, "points coordinates"] | None = None) -> SecondOrder:
    """D of a shape by its parts; their sum times the viscosity is the resistance of second order.

    Args:
        shape, current: The wall and `flow` of it.
        slip: `slip_operator(shape, current)`, where it is known already.
    """
    W = slip_operator(shape, current) if slip is None else slip
    curve = current.parts.curve
    bent = curvatures(curve)
    surface = column(2 * jnp.pi * shape.weights * curve.r * speed(curve))
    u_s = (shape.potential_basis[1] @ current.potential) / column(speed(curve))
    shear = across_wall_slope(curve, every_motion(shape)) - column(bent.meridian) * u_s

    work = -2 * W.T @ (surface * shear)
    curved = W.T @ (surface * column(bent.twice_mean / 2 + bent.meridian) * W)
    source = displaced_source(shape, current.parts, slip_splines(shape, W))
    driven = shape.potential_basis[1] @ -jsl.lu_solve(current.factors, source)
    displaced = W.T @ (column(2 * jnp.pi * shape.weights * curve.r) * driven)
    return SecondOrder(bulk_resistance(shape, current), work + work.T, curved, (displaced + displaced.T) / 2)


def second_resistance(shape: Meridian, current: Flow, slip: Float[Array, "points coordinates"] | None = None) -> Matrix:
    """D of a shape [R0]: u·D u times the viscosity is the power of second order."""
    return sum(second_order(shape, current, slip), start=jnp.zeros(()))


def slip_splines(shape: Meridian, w: Float[Array, "points ..."]) -> Float[Array, "odd ..."]:
    """Coefficients of the odd splines nearest to a slip at the Gauss points."""
    basis = shape.r_basis[0]
    weighted = basis.T * shape.weights[None]
    return jnp.linalg.solve(weighted @ basis, weighted @ w)


def displaced_source(shape: Meridian, parts: Layers, w: Float[Array, "odd ..."]) -> Float[Array, "nodes ..."]:
    """Single layer at the nodes of the flux div_S(w) that a layer of slip w displaces."""
    near = shape.near

    def flux(curve: Curve, value, slope):
        # (r w)' per θ
        lift = lambda row: row.reshape(row.shape + (1,) * (value.ndim - row.ndim))  # noqa: E731
        return lift(curve.r1) * value + lift(curve.r) * slope

    far = parts.far_source @ flux(parts.curve, shape.r_basis[0] @ w, shape.r_basis[1] @ w)
    local = parts.near_curve
    beside = flux(local, near.r_value @ w, near.r_slope @ w)
    return far + jnp.einsum("ns,ns...->n...", parts.near_source, beside)
