"""The viscous liquid around a wall that it sticks to, exact at any viscosity.

At the complex rate s the linearised Navier-Stokes liquid moves with

    u = ∇φ + ∇×(ψ e_φ),   ∇²φ = 0,   (∇² - λ²)(ψ e_φ) = 0,   λ² = s/η,   p = -s φ ,

so that two scalar exterior problems are enough. On a wall that moves with v
across and u_t along itself, no slip means

    φ_n = v - (r ψ)_s / r,     ψ_n = φ_s - (n_r/r) ψ - u_t .

The potential is that of the wall's own flow and of what ψ brings along, φ = φ_v
+ T ψ, both by Laplace's equation. Only the slip w = u_t - ∂φ_v/∂s drives ψ, and
Green's third identity, collocated at the nodes, gives it:

    L(λ) ψ = S_λ w,     L(λ) = 1/2 - D_λ + S_λ[∂_s T - n_r/r] .

L(0) vanishes: a harmonic ψ is a potential flow in other words. What quadrature
and splines leave of it is taken off at every λ, or the error of ψ would grow by
1/λ² towards steady flow; but not from waves near the mesh's shortest, which that
remainder keeps out of ψ. By Green's symmetry the liquid's force is

    u'·Z u = s u'·M u + s ∮ ψ w' dA - 2η ∮ [u_t' v_s + u_t v'_s - κ1 u_t u_t' - 2H v v'] dA ;

over η it depends on λ and on the shape alone.

Symbols    λ complex rate of decay into the liquid [1/R0], Re λ > 0   s = η̂ λ² [1/time]   Z impedance, M added mass
           v, u_t wall velocity across and along the meridian   κ1, H curvatures [1/R0]
Valid for  small amplitude about a wall at rest; layers 1/|λ| from 1/120 of the radius to steady flow
Source     Pozrikidis, Boundary Integral and Singularity Methods, ch. 7; Kim and Karrila, Microhydrodynamics, ch. 6
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.scipy.linalg as jsl
import numpy as np
from jaxtyping import Array, Complex, Float

from jshell.contour import Curve, Meridian, speed
from jshell.contour.mesh import Beside
from jshell.contour.splines import ParitySplines
from jshell.flow.added_mass import Flow, flow, slip_operator
from jshell.flow.rings import kernels
from jshell.flow.wall_motion import across_wall, across_wall_slope, along_wall, column, curvatures, every_motion

FAR_POINTS = 8  # Gauss points per element: exp(-λ h) must be integrated, h the element's length
NEAR_POINTS = 20  # graded points on each element that touches a node
AZIMUTH = 24  # Gauss points along half a ring
FADED = 36.0  # exp(-FADED) is rounding: the rest of a ring is left out

SMOOTH = 0.4  # of the shortest wave's number: ψ's waves up to here bear no trace of L(0)

INNER = slice(1, -1)  # ψ vanishes on the axis: it is collocated at the nodes between the poles


class Basis(NamedTuple):
    """Values and slopes, (2, …, ·), of the splines of x, r, φ (even) and ψ (odd) at source points."""

    x: Float[Array, "2 ..."]
    r: Float[Array, "2 ..."]
    phi: Float[Array, "2 ..."]
    psi: Float[Array, "2 ..."]


class Rings(NamedTuple):
    """Source points of every node: Gauss points of all elements, and graded ones on those that touch the node.

    Attributes:
        far_weights: (nodes, far), zero on the elements that touch a node.
        near_weights, gaps: (nodes, near) weights, and distances from the node [rad].
        far, near: The bases there.
        x_quotients, r_quotients: (2, nodes, near, ·) divided differences from the node, and their slopes.
        psi: (points, psis) values of ψ at the meridian's own Gauss points; `psi_nodes` (inner, psis) at the nodes.
    """

    far_weights: Float[Array, "nodes far"]
    near_weights: Float[Array, "nodes near"]
    gaps: Float[Array, "nodes near"]
    far: Basis
    near: Basis
    x_quotients: Float[Array, "2 nodes near even"]
    r_quotients: Float[Array, "2 nodes near odd"]
    psi: Float[Array, "points psis"]
    psi_nodes: Float[Array, "inner psis"]


def rings(shape: Meridian) -> Rings:
    """The quadrature of a discretisation."""
    breaks, edge = shape.nodes, shape.edge
    even, odd = ParitySplines(breaks, "even", edge), ParitySplines(breaks, "odd", edge)
    # φ and ψ know nothing of a pad's edge
    phi, psi = (even, odd) if edge is None else (ParitySplines(breaks, "even"), ParitySplines(breaks, "odd"))

    gauss, gauss_weights = np.polynomial.legendre.leggauss(FAR_POINTS)
    weights = (jnp.diff(breaks)[:, None] * gauss_weights[None] / 2).reshape(-1)
    element_of = np.repeat(np.arange(shape.elements), FAR_POINTS)
    node = np.arange(shape.elements + 1)[:, None]
    apart = (element_of[None] != node) & (element_of[None] != node - 1)

    def everywhere(splines: ParitySplines) -> Float[Array, "2 far size"]:
        return jnp.stack([jnp.asarray(splines.within(gauss, k)).reshape(-1, splines.size) for k in (0, 1)])

    beside = Beside(breaks, NEAR_POINTS)
    x, r = beside.polynomials(even, 4), beside.polynomials(odd, 4)
    near_phi = x if phi is even else beside.polynomials(phi, 2)
    near_psi = r if psi is odd else beside.polynomials(psi, 2)
    own, _ = np.polynomial.legendre.leggauss(shape.angles.size // shape.elements)
    return Rings(
        far_weights=jnp.where(apart, weights[None], 0.0),
        near_weights=beside.weights,
        gaps=beside.gaps,
        far=Basis(*map(everywhere, (even, odd, phi, psi))),
        near=Basis(*(jnp.stack(part[:2]) for part in (x, r, near_phi, near_psi))),
        x_quotients=jnp.stack(x[2:]),
        r_quotients=jnp.stack(r[2:]),
        psi=jnp.asarray(psi.within(own)).reshape(-1, psi.size),
        psi_nodes=jnp.asarray(psi.at_breaks())[INNER],
    )


class Distances(NamedTuple):
    """From nodes to source points: ρ₋², ρ₊² [R0²], the bend B as in `rings`, radius and tangent there, radius here."""

    shortest: Float[Array, "nodes sources"]
    longest: Float[Array, "nodes sources"]
    bend: Float[Array, "nodes sources"]
    r: Float[Array, "nodes sources"]
    x1: Float[Array, "nodes sources"]
    r1: Float[Array, "nodes sources"]
    r0: Float[Array, "nodes 1"]


def _distances(shape: Meridian, at: Rings, q: Float[Array, "coordinates"]) -> tuple[Distances, Distances]:
    """To the source points of all elements, and to the graded ones, where differences are divided differences."""
    (qx, qr), (x0, r0) = shape.split(q), shape.at_nodes(q)
    x0, r0 = x0[:, None], r0[:, None]
    wide = lambda row: jnp.broadcast_to(row[None], (x0.shape[0], row.size))  # noqa: E731

    x, x1, r, r1 = (wide(basis @ part) for bases, part in ((at.far.x, qx), (at.far.r, qr)) for basis in bases)
    dx, dr = x - x0, r - r0
    shortest = dx**2 + dr**2
    far = Distances(shortest, dx**2 + (r + r0) ** 2, (x1 * dr - r1 * dx) / shortest, r, x1, r1, r0)

    x1, r, r1 = at.near.x[1] @ qx, at.near.r[0] @ qr, at.near.r[1] @ qr
    (Qx, Qx1), (Qr, Qr1) = at.x_quotients @ qx, at.r_quotients @ qr
    squared = Qx**2 + Qr**2
    longest = (at.gaps * Qx) ** 2 + (r + r0) ** 2
    near = Distances(at.gaps**2 * squared, longest, (Qx1 * Qr - Qr1 * Qx) / squared, r, x1, r1, r0)
    return far, near


def yukawa(
    decay: Complex[Array, ""], to: Distances
) -> tuple[Complex[Array, "nodes sources"], Complex[Array, "nodes sources"]]:
    """The field cos φ e^{-λR}/(4πR) of a ring of sources, and that of dipoles times the area element per θ.

    With φ/2 = (ρ₋/c) sinh τ, c² = 4 r r', a near ring is smooth in τ. The part of a ring where e^{-λR} has faded
    against its nearest point is left out.
    """
    across = 4 * to.r * to.r0

    # the azimuth is a dummy variable: where its points lie carries no derivative
    rho, c, rate = jax.lax.stop_gradient((jnp.sqrt(to.shortest), jnp.sqrt(across), jnp.real(decay)))
    fading = FADED / rate
    half_ring = jnp.arcsin(jnp.minimum(jnp.sqrt(2 * rho * fading + fading**2) / c, 1.0))
    end = jnp.arcsinh(half_ring * c / rho)
    gauss, gauss_weights = np.polynomial.legendre.leggauss(AZIMUTH)

    def at(place, weight):
        half_angle = rho / c * jnp.sinh(place * end)
        step = weight * end * rho / c * jnp.cosh(place * end)
        sine = jnp.sin(half_angle) ** 2
        squared = to.shortest + across * sine
        R = jnp.sqrt(squared)
        source = step * (1 - 2 * sine) / (2 * jnp.pi * R) * jnp.exp(-decay * R)
        turned = (to.bend * to.shortest + 2 * to.r0 * to.x1 * sine) / squared
        return source, (1 + decay * R) * source * turned

    source, dipole = jax.vmap(at)(jnp.asarray((gauss + 1) / 2), jnp.asarray(gauss_weights))
    return jnp.sum(source, axis=0), to.r * jnp.sum(dipole, axis=0)


class ViscousLiquid(NamedTuple):
    """What the impedance of one shape needs at every rate. Build with `viscous_liquid`.

    Attributes:
        at: The source points.
        far, near: Distances from the nodes between the poles to them.
        spin: T, the potential's coefficients per coefficient of ψ.
        residue: L(0) of a smooth ψ: discretisation error, taken off at every λ.
        potential: Of the wall's own potential flow per coordinate velocity.
        slip: Slip at the Gauss points times the area of its ring.
        mass, strain: Coefficients of λ² and of 1 in Z/η̂.
    """

    at: Rings
    far: Distances
    near: Distances
    spin: Float[Array, "phis psis"]
    residue: Complex[Array, "inner psis"]
    potential: Float[Array, "phis coordinates"]
    slip: Float[Array, "points coordinates"]
    mass: Float[Array, "coordinates coordinates"]
    strain: Float[Array, "coordinates coordinates"]


@eqx.filter_jit
def viscous_liquid(shape: Meridian, q: Float[Array, "coordinates"], current: Flow | None = None) -> ViscousLiquid:
    """The liquid around a wall at rest.

    Args:
        shape, q: The wall.
        current: `flow(shape, q)`, where it is known already.
    """
    current = flow(shape, q) if current is None else current
    at = rings(shape)
    far, near = _distances(shape, at, q)

    # the potential of the flux (r ψ)_s / r
    lines = []
    for to, weights, psi in ((far, at.far_weights, at.far.psi), (near, at.near_weights, at.near.psi)):
        source, _ = kernels(to.shortest, to.longest, to.bend, to.r, to.x1)
        lines.append(_over(weights * source * to.r1, psi[0]) + _over(weights * source * to.r, psi[1]))
    spin = jsl.lu_solve(current.factors, lines[0] + lines[1])

    curve = shape.at_points(q)
    surface = column(2 * jnp.pi * shape.weights * curve.r * speed(curve))
    made = ViscousLiquid(
        at=at,
        far=_inner(far),
        near=_inner(near),
        spin=spin,
        residue=jnp.zeros(at.psi_nodes.shape, complex),
        potential=current.potential,
        slip=surface * slip_operator(shape, current),
        mass=current.mass,
        strain=_strain(shape, curve),
    )
    residue, _ = _vorticity(made, jnp.zeros((), complex))
    return made._replace(residue=residue @ _smooth(at))


def _inner(to: Distances) -> Distances:
    """From the nodes between the poles."""
    return jax.tree.map(lambda part: part[INNER], to)


def _smooth(at: Rings) -> Float[Array, "psis psis"]:
    """What is smooth on the mesh of a ψ: its waves of the nodes' number up to `SMOOTH` of the shortest."""
    nodes = at.psi_nodes.shape[0] + 1
    waves = np.sin(np.pi / nodes * np.outer(np.arange(1, nodes), np.arange(1, round(SMOOTH * nodes) + 1)))
    return jnp.linalg.solve(at.psi_nodes, jnp.asarray(2 / nodes * waves) @ (jnp.asarray(waves.T) @ at.psi_nodes))


def _over(kernel, basis):
    """Sum over source points: the same for all nodes (far), or each node's own (near)."""
    return kernel @ basis if basis.ndim == 2 else jnp.einsum("ns,nsk->nk", kernel, basis)


def _vorticity(
    liquid: ViscousLiquid, decay: Complex[Array, ""]
) -> tuple[Complex[Array, "inner psis"], Complex[Array, "inner coordinates"]]:
    """L(λ), and S_λ w of every motion of the wall."""
    at = liquid.at
    parts = []
    for to, weights, basis in ((liquid.far, at.far_weights, at.far), (liquid.near, at.near_weights, at.near)):
        own = basis if basis.x.ndim == 3 else Basis(*(part[:, INNER] for part in basis))
        source, dipole = (weights[INNER] * kernel for kernel in yukawa(decay, to))
        ring = source * to.r
        parts.append(
            (
                _over(ring, own.phi[1]),  # S_λ ∂_s φ
                _over(dipole - source * to.x1, own.psi[0]),  # D_λ ψ + S_λ (n_r/r) ψ, as n_r ds/dθ = -x'
                jnp.concatenate([_over(ring * to.x1, own.x[0]), _over(ring * to.r1, own.r[0])], axis=1),  # S_λ u_t
            )
        )
    drawn, held, along = (far + near for far, near in zip(*parts, strict=True))
    operator = at.psi_nodes / 2 - held + drawn @ liquid.spin - liquid.residue
    return operator, along - drawn @ liquid.potential


@eqx.filter_jit
def impedance(liquid: ViscousLiquid, decay: Complex[Array, ""]) -> Complex[Array, "coordinates coordinates"]:
    """Z/η̂ at one rate, complex symmetric [R0]: the liquid adds s Z u to the forces K u of the wall.

    Args:
        liquid: From `viscous_liquid`.
        decay: λ = sqrt(s/η̂), Re λ > 0 [1/R0]; Z/η̂ is analytic in it, and a function of it and the shape alone.

    Example:
        >>> import jax.numpy as jnp
        >>> from jshell.contour import meridian
        >>> from jshell.flow import impedance, viscous_liquid
        >>> shape = meridian(16)
        >>> resistance = impedance(viscous_liquid(shape, shape.sphere), jnp.asarray(1e-4 + 0j))
        >>> print((shape.shift @ resistance @ shape.shift / (6 * jnp.pi)).real.round(3))  # Stokes
        1.0
    """
    operator, driven = _vorticity(liquid, decay)
    psi = jnp.linalg.solve(operator, driven)
    vorticity = liquid.slip.T @ (liquid.at.psi @ psi)
    return decay**2 * (liquid.mass + (vorticity + vorticity.T) / 2) + liquid.strain


def _strain(shape: Meridian, curve: Curve) -> Float[Array, "coordinates coordinates"]:
    """-2 ∮ [u_t' v_s + u_t v'_s - κ1 u_t u_t' - 2H v v'] dA: stress by the wall's own stretching and turning [R0]."""
    motion, bent = every_motion(shape), curvatures(curve)
    v, v_s, u_t = across_wall(curve, motion), across_wall_slope(curve, motion), along_wall(curve, motion)
    surface = column(4 * jnp.pi * shape.weights * curve.r * speed(curve))
    mixed = u_t.T @ (surface * v_s)
    kept = u_t.T @ (surface * column(bent.meridian) * u_t) + v.T @ (surface * column(bent.twice_mean) * v)
    return kept - mixed - mixed.T
