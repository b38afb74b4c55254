"""Inertia and losses of a moving shell, as matrices and as actions on one velocity.

A step of time solves with matrices. Its derivative needs none: the derivative
of a solution is a solution with the derivative of the equations, which only
act on velocities that are known. So everything here exists twice, and a test
holds the two together: `Dense` for the step, `Free` for its derivative.

Symbols    M mass   y = P u potential of a velocity   z adjoint of the boundary equation   W slip, A surface
Source     Green's symmetry for the transposed potential; implicit differentiation of linear equations
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.contour import Meridian, poles, speed
from jshell.dynamics.losses import Losses, drag_rate
from jshell.flow import bulk_resistance, flow, gyroscopic, second_resistance, slip_operator
from jshell.flow.gyroscopic import gyroscopic_parts
from jshell.flow.panels import Layers, flux_of, flux_operator, green_of, layers, single_layer_of
from jshell.flow.second_order import AtWall, displaced_source, inverse_of, stresses
from jshell.flow.wall_motion import across_wall, across_wall_slope, along_wall, column, every_motion, one_motion
from jshell.membrane import Wall, wall_resistance
from jshell.membrane.viscous import wall_rates
from jshell.memory import HalfDerivative
from jshell.shell.elasticity import Scalar
from jshell.shell.parameters import Reduced

Coordinates = Float[Array, "coordinates"]
Matrix = Float[Array, "coordinates coordinates"]
Points = Float[Array, "points"]


class Body(NamedTuple):
    """All that does not change within a step: discretisation, wall, conditions, layer, losses, the wall's own mass,
    what of a motion the mesh resolves, and what takes a slip to its nearest splines."""

    shape: Meridian
    wall: Wall
    conditions: Reduced
    layer: HalfDerivative
    losses: Losses
    solid: Matrix
    resolved: Matrix
    nearest: Float[Array, "odd points"]


class Dense(NamedTuple):
    """Matrices of a shape in motion: mass M, slip W, gyroscopic T = ∂(M u)/∂q, the liquid's loss B beside the layer's
    first order, the wall's loss C; the inverse of 1/2 - D."""

    M: Matrix
    W: Float[Array, "points coordinates"]
    T: Matrix
    B: Matrix
    C: Matrix
    kinetic_gradient: Coordinates
    surface: Points
    drag: Scalar
    inverse: Float[Array, "nodes nodes"]


def dense(body: Body, q: Coordinates, u: Coordinates) -> Dense:
    """Matrices of a shape q moving with velocity u."""
    shape = body.shape
    current = flow(shape, q)
    # the wall slips past the potential flow: W takes the velocity of the wall to the slip at the Gauss points
    W = slip_operator(shape, current)
    curve = current.parts.curve
    surface = 2 * jnp.pi * shape.weights * curve.r * speed(curve)
    # liquid, the layer's own mass on the slip, and the wall: one kinetic energy, one symmetric matrix
    M = current.mass + body.layer.mass * ((W.T * surface[None]) @ W) + body.solid
    inverse = inverse_of(current)
    none, viscosity = jnp.zeros_like(M), jnp.asarray(body.conditions.viscosity)
    if body.losses.second:
        # what the mesh does not resolve would get a second order of the wrong sign
        second = second_resistance(shape, current, W, inverse, body.nearest)
        B = viscosity * body.resolved.T @ second @ body.resolved
    else:
        B = viscosity * bulk_resistance(shape, current) if body.losses.bulk else none
    viscous = body.losses.wall
    C = none if viscous is None else wall_resistance(shape, q, body.wall, viscous)
    # y and z freeze the boundary equation: the gradient of the kinetic energy then costs one adjoint, not a matrix
    y = current.potential @ u
    z = -inverse.T @ jax.grad(kinetic, argnums=3)(body, q, u, y)
    # a law of drag acts on the speed of the buckling pole, like the source's Reynolds law
    drag = drag_rate(body.losses, poles(shape, u)[0], body.conditions.viscosity)
    T = gyroscopic(shape, q, current, u)
    return Dense(M, W, T, B, C, _kinetic_gradient(body, q, u, y, z), surface, drag, inverse)


def kinetic(body: Body, q: Coordinates, u: Coordinates, y: Float[Array, "nodes"]) -> Float[Array, ""]:
    """Kinetic energy of liquid and layer at a velocity and its potential."""
    shape = body.shape
    curve, ds = shape.at_points(q), speed(shape.at_points(q))
    ux, ur = shape.split(u)
    wall_x, wall_r = shape.x_basis[0] @ ux, shape.r_basis[0] @ ur
    bulk = -jnp.pi * jnp.sum(shape.weights * (shape.potential_basis[0] @ y) * flux_of(curve, wall_x, wall_r))
    slip = (curve.x1 * wall_x + curve.r1 * wall_r - shape.potential_basis[1] @ y) / ds
    return bulk + jnp.pi * body.layer.mass * jnp.sum(shape.weights * curve.r * ds * slip**2)


def _kinetic_gradient(body: Body, q: Coordinates, u: Coordinates, y, z) -> Coordinates:
    """½ ∂(u·M u)/∂q: with y and an adjoint z of the boundary equation held, the gradient of one scalar."""
    shape = body.shape

    # Lagrange's function: kinetic energy, and z times the boundary equation that y obeys
    def constrained(q):
        parts = layers(shape, q)
        return kinetic(body, q, u, y) + z @ (green_of(shape, parts, y) + single_layer_of(shape, parts, u))

    return jax.grad(constrained)(q)


class Through(NamedTuple):
    """A force on the wall: part of it acts directly, part on the potential that a velocity makes (Pᵀ of it)."""

    direct: Coordinates
    potential: Float[Array, "nodes"]

    def plus(self, other: "Through", times: Scalar = 1.0) -> "Through":
        """The sum of two forces, the other one scaled."""
        return Through(self.direct + times * other.direct, self.potential + times * other.potential)


class Free(NamedTuple):
    """The same without matrices, differentiable at the cost of a few assemblies; the inverse of 1/2 - D is held.

    Forces come as `Through` and are gathered by `on_wall`, so that many share one transposed solve.
    """

    body: Body
    q: Coordinates
    u: Coordinates
    parts: Layers
    inverse: Float[Array, "nodes nodes"]

    @property
    def surface(self) -> Points:
        """Area of the ring at each Gauss point."""
        curve = self.parts.curve
        return 2 * jnp.pi * self.body.shape.weights * curve.r * speed(curve)

    @property
    def drag(self) -> Scalar:
        """2/τ of the drag law."""
        return drag_rate(self.body.losses, poles(self.body.shape, self.u)[0], self.body.conditions.viscosity)

    @property
    def kinetic_gradient(self) -> Coordinates:
        """½ ∂(u·M u)/∂q."""
        y = self.potential(self.u)
        z = self._adjoint(jax.grad(kinetic, argnums=3)(self.body, self.q, self.u, y))
        return _kinetic_gradient(self.body, self.q, self.u, y, z)

    def potential(self, v: Coordinates) -> Float[Array, "nodes"]:
        """y = P v."""
        return self._flow(single_layer_of(self.body.shape, self.parts, v))

    def _flow(self, load: Float[Array, "nodes"]) -> Float[Array, "nodes"]:
        """Potential of a single layer: one solve, and one Newton step with the held inverse for the derivative."""
        # the value comes from the inverse that the step has made; the Newton step adds nothing to it but the derivative
        held = jax.lax.stop_gradient(-self.inverse @ load)
        return held - self.inverse @ (green_of(self.body.shape, self.parts, held) + load)

    def _adjoint(self, f: Float[Array, "nodes"]) -> Float[Array, "nodes"]:
        """z with (1/2 - D)ᵀ z = -f."""
        shape, parts = self.body.shape, self.parts
        # the transpose of an action is as cheap as the action: the boundary matrix is never formed
        transposed = jax.linear_transpose(lambda y: green_of(shape, parts, y), f)
        held = jax.lax.stop_gradient(-self.inverse.T @ f)
        return held - self.inverse.T @ (transposed(held)[0] + f)

    def on_wall(self, force: Through) -> Coordinates:
        """The force on the coordinates."""
        shape, parts = self.body.shape, self.parts
        transposed = jax.linear_transpose(lambda v: single_layer_of(shape, parts, v), self.u)
        return force.direct + transposed(self._adjoint(force.potential))[0]

    def mass(self, v: Coordinates, y: Float[Array, "nodes"]) -> Through:
        """M v, the layer's mass and the wall's own included; y is the potential of v."""
        direct, through = jax.grad(kinetic, argnums=(2, 3))(self.body, self.q, v, y)
        return Through(direct + self.body.solid @ v, through)

    def slip(self, v: Coordinates, y: Float[Array, "nodes"]) -> Points:
        """W v."""
        shape, curve = self.body.shape, self.parts.curve
        return along_wall(curve, one_motion(shape, v))[:, 0] - shape.potential_basis[1] @ y / speed(curve)

    def slip_transposed(self, f: Points) -> Through:
        """Wᵀ f."""
        shape, curve = self.body.shape, self.parts.curve
        (direct,) = jax.linear_transpose(lambda v: along_wall(curve, one_motion(shape, v))[:, 0], self.u)(f)
        return Through(direct, -shape.potential_basis[1].T @ (f / speed(curve)))

    def gyroscopic(self, c: Coordinates) -> Through:
        """∂(M u)/∂q c."""
        shape, curve = self.body.shape, self.parts.curve
        # one displacement instead of all: a column of the matrix, not the matrix
        part = gyroscopic_parts(shape, curve, self.potential(self.u), self.u, one_motion(shape, c))
        direct = flux_operator(shape, curve).T @ part.carried[:, 0] + part.held[:, 0]
        return Through(direct, shape.potential_basis[0].T @ part.source[:, 0])

    def gyroscopic_transposed(self, c: Coordinates) -> Coordinates:
        """(∂(M u)/∂q)ᵀ c."""
        return jax.linear_transpose(self.gyroscopic, c)(Through(c, self.potential(c)))[0]

    def bulk(self, v: Coordinates) -> Coordinates:
        """What the liquid takes beside the layer's first order: its second, or the loss of a slipping wall's flow."""
        if not (self.body.losses.second or self.body.losses.bulk):
            return jnp.zeros_like(v)
        shape, curve, ds = self.body.shape, self.parts.curve, speed(self.parts.curve)
        second, slope = self.body.losses.second, shape.potential_basis[1]
        # what the mesh does not resolve would get a second order of the wrong sign: it is filtered on both sides
        v = self.body.resolved @ v if second else v
        y = self.potential(v)
        one, u_s = one_motion(shape, v), slope @ y / ds
        w = self.slip(v, y) if second else jnp.zeros_like(u_s)
        # the motion at the wall as the stress law wants it: across, its slope, along, and the slip
        wall = AtWall(across_wall(curve, one), across_wall_slope(curve, one), column(u_s), column(w))
        on = AtWall(*(part[:, 0] for part in stresses(shape, curve, wall)))
        each = every_motion(shape)
        direct = across_wall(curve, each).T @ on.v + across_wall_slope(curve, each).T @ on.v_s
        force = Through(direct, slope.T @ (on.u_s / ds))
        if second:
            force = force.plus(self.slip_transposed(on.w + self._displaced(w)))
        pulled = jnp.asarray(self.body.conditions.viscosity) * self.on_wall(force)
        return self.body.resolved.T @ pulled if second else pulled

    def _displaced(self, w: Points) -> Points:
        """Force on the slip by the liquid that a layer of slip w displaces."""
        shape, parts = self.body.shape, self.parts
        slip, source = self.body.nearest @ w, displaced_source(shape, parts)
        across = (shape.r_basis[0] * (2 * jnp.pi * shape.weights * parts.curve.r)[:, None]).T @ shape.potential_basis[1]
        # symmetric: what the slip drives, and what its reaction does
        on_splines = (across @ self._flow(source @ slip) + source.T @ self._adjoint(across.T @ slip)) / 2
        return self.body.nearest.T @ on_splines

    def solid(self, v: Coordinates) -> Coordinates:
        """Resistance of the wall."""
        viscous = self.body.losses.wall
        if viscous is None:
            return jnp.zeros_like(v)
        rates = wall_rates(self.body.shape, self.q, self.body.wall, viscous)
        return sum((rate.T @ (held * (rate @ v)) for rate, held in rates), start=jnp.zeros_like(v))


def free(body: Body, q: Coordinates, u: Coordinates, inverse: Float[Array, "nodes nodes"]) -> Free:
    """Actions of a shape q moving with velocity u, given the inverse of its boundary equation."""
    return Free(body, q, u, layers(body.shape, q), jax.lax.stop_gradient(inverse))
