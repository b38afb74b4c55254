"""Stiffness against motions that are not axially symmetric.

The elastic energy of `energy`, written for any surface in space: its density is
a function of the first and second derivatives of position along and around the
shell, by the invariants of strain and curvature. A displacement

    a cos mφ along, b cos mφ away from, c sin mφ around the axis

about a shape of revolution costs ½ (a, b, c)·K_m(a, b, c). One Hessian of the
density per Gauss point serves every m, which enters through the φ-derivatives
of the displacement alone. The gas enters K_m, m >= 1, through P_ext - P only.

Symbols    E, F, G metric against the stress-free sphere [-]   b11, b12, b22 its second form [-]   J = √(EG - F²)
           K_m stiffness [E d]   m order around the axis
Valid for  as the elastic energy, without its axial symmetry
Source     Mokbel et al. 2021: Eq:bend, Eq:stretch; Koiter's measures λκ - 1 beyond principal axes: the symmetric part
           of U⁻¹b, Vitral and Hanna 2023
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jshell.contour import Azimuthal, Curve, Meridian
from jshell.membrane.energy import Area, Wall
from jshell.shell.elasticity import Scalar

JETS = 17  # displacement across the axis (2), then five derivatives of position with three components each
STIFF = 1e6  # of coordinates that may not move, among the eigenvalues
DEPENDENT = 1e-9  # squared share of a null motion that the others do not hold: less is rounding
LOCAL = 9  # a, b, c with first and second θ-derivatives


def density_in_space(jet: Float[Array, "17"], wall: Wall, difference: Scalar, area: Area | str) -> Float[Array, ""]:
    """Elastic energy plus ΔP times volume per θ and φ [E d R0²/rad²].

    Args:
        jet: Position across the axis (r, 0 on the meridian φ = 0), then X_θ, X_φ, X_θθ, X_θφ, X_φφ, each along the
            axis, away from it and around it.
        wall: Moduli at the point.
        difference: ΔP [E d/R0].
        area: Which elastic energy.
    """
    across = jet[:2]
    x_t, x_f, x_tt, x_tf, x_ff = jet[2:].reshape(5, 3)
    sine = jnp.sin(wall.angles)
    E, F, G = x_t @ x_t, x_t @ x_f / sine, x_f @ x_f / sine**2
    J = jnp.sqrt(E * G - F**2)
    both = jnp.sqrt(E + G + 2 * J)  # λ1 + λ2
    stretching = wall.area / 2 * (both - 2) ** 2 + wall.shear / 2 * (E + G - 2 * J)

    ring = jnp.cross(x_t, x_f)
    inward = -ring / (J * sine)
    b11, b12, b22 = inward @ x_tt, inward @ x_tf / sine, inward @ x_ff / sine**2
    if area == "koiter":
        # U⁻¹ = ((λ1 + λ2)² - J - C)/((λ1 + λ2) J), C the metric; the part of U⁻¹b around the normal does not count
        scale = both * J
        trace = ((both**2 - J) * (b11 + b22) - (E * b11 + 2 * F * b12 + G * b22)) / scale
        around = ((G - E) * b12 + F * (b11 - b22)) / (2 * scale)
        product = (b11 * b22 - b12**2) / J - around**2
        nu = (wall.area - wall.shear) / (wall.area + wall.shear)
        bending = wall.bending / 2 * ((trace - 2) ** 2 - 2 * (1 - nu) * (product - trace + 1))
    else:
        mean = (b11 * G - 2 * b12 * F + b22 * E) / (2 * J**2)
        bending = 2 * wall.bending * (mean - 1) ** 2
    surface = J * sine if area == "current" else sine
    return surface * (stretching + bending) + difference * (across @ ring[1:]) / 2


def jet_of(curve: Curve) -> Float[Array, "17 ..."]:
    """The jet of a surface of revolution."""
    x, r, x1, r1, x2, r2 = curve
    no = jnp.zeros_like(x)
    return jnp.stack([r, no, x1, r1, no, no, no, r, x2, r2, no, no, no, r1, no, -r, no])


@eqx.filter_jit
def point_hessians(
    shape: Meridian, q: Float[Array, "coordinates"], wall: Wall, difference: Scalar, area: Area | str
) -> Float[Array, "points 17 17"]:
    """Hessian of the density at the Gauss points, with their weights; every m shares it."""
    local = lambda jet, wall: density_in_space(jet, wall, difference, area)  # noqa: E731
    jets = jet_of(shape.at_points(q)).T
    return jax.vmap(jax.hessian(local))(jets, wall) * shape.weights[:, None, None]


def jet_matrix(m: Int[Array, ""] | int) -> Float[Array, "17 9"]:
    """The jet of a displacement of order m, without its cos mφ or sin mφ, from (a, a', a'', b, b', b'', c, c', c'')."""
    a0, a1, a2, b0, b1, b2, c0, c1, c2 = jnp.eye(LOCAL)
    around = lambda a, b, c: [-m * a, -m * b - c, m * c + b]  # noqa: E731
    twice = [-(m**2) * a0, -(m**2 + 1) * b0 - 2 * m * c0, -(m**2 + 1) * c0 - 2 * m * b0]
    rows = [b0, c0, a1, b1, c1, *around(a0, b0, c0), a2, b2, c2, *around(a1, b1, c1), *twice]
    return jnp.stack(rows)


def to_components() -> Float[Array, "9 9"]:
    """From (a, b + c, b - c) to (a, b, c), each with its θ-derivatives."""
    return jnp.asarray(np.kron(np.array([[1, 0, 0], [0, 0.5, 0.5], [0, 0.5, -0.5]]), np.eye(3)))


def local_form(hessians: Float[Array, "points 17 17"], m: Int[Array, ""] | int) -> Float[Array, "points 9 9"]:
    """Energy of order m at the Gauss points as a form in (a, b + c, b - c) and their θ-derivatives, φ integrated."""
    T = jet_matrix(m) @ to_components()
    weight = jnp.where(m == 0, 2 * jnp.pi, jnp.pi)
    return weight * jnp.einsum("ja,pjk,kb->pab", T, hessians, T)


def stiffness_of_order(
    splines: Azimuthal, hessians: Float[Array, "points 17 17"], m: Int[Array, ""] | int
) -> Float[Array, "motions motions"]:
    """K_m on the coordinates (a, b + c, b - c), m >= 1 [E d]; rows and columns that may not move are not taken out."""
    form = local_form(hessians, m)
    bases = [family.values for family in splines.motion(m)]
    points = form.shape[0]

    def block(i: int, j: int):
        local = form[:, 3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
        weighted = jnp.einsum("pab,bpn->apn", local, bases[j])
        rows = bases[i].reshape(3 * points, -1)
        return rows.T @ weighted.reshape(3 * points, -1)

    upper = {(i, j): block(i, j) for i in range(3) for j in range(i, 3)}
    return jnp.block([[upper[i, j] if i <= j else upper[j, i].T for j in range(3)] for i in range(3)])


def gram(splines: Azimuthal, shape: Meridian, m: Int[Array, ""] | int) -> Float[Array, "motions motions"]:
    """Integral of the squared displacement over the stress-free sphere as a form, m >= 1 [R0²]."""
    weights = jnp.pi * shape.weights * jnp.sin(shape.angles)
    a, p, g = (family.values[0] for family in splines.motion(m))
    form = lambda basis, share: share * (basis.T * weights[None]) @ basis  # noqa: E731
    none = jnp.zeros((splines.size, splines.size))
    return jnp.block([[form(a, 1.0), none, none], [none, form(p, 0.5), none], [none, none, form(g, 0.5)]])


@eqx.filter_jit
def null_motions(
    splines: Azimuthal, shape: Meridian, q: Float[Array, "coordinates"], uniform: Array
) -> Float[Array, "motions 3"]:
    """Motions of order 1 that cost nothing: shift across the axis, turn about one across it, wandering of the dimple.

    A wall of the same thickness everywhere may take its dimple elsewhere; that column is zero where it may not
    (`uniform` false), and all are where a pad holds the shell.
    """
    if shape.attached:
        return jnp.zeros((3 * splines.size, 3))
    curve = shape.at_points(q)
    one, no = jnp.ones_like(curve.x), jnp.zeros_like(curve.x)
    around = curve.r * jnp.cos(shape.angles) / jnp.sin(shape.angles)
    wander = tuple(jnp.where(uniform, part, 0.0) for part in (curve.x1, curve.r1 - around, curve.r1 + around))
    motions = (no, no, 2 * one), (-curve.r, no, 2 * curve.x), wander
    return jnp.stack([nearest_motion(splines, shape, motion, 1) for motion in motions], axis=1)


def nearest_motion(
    splines: Azimuthal, shape: Meridian, motion: tuple[Float[Array, "points"], ...], m: Int[Array, ""] | int
) -> Float[Array, "motions"]:
    """Coordinates of the splines nearest to a motion (a, b + c, b - c) at the Gauss points."""
    may = splines.moving(m).reshape(3, -1)

    def nearest(basis, values, may):
        weighted = basis.T * shape.weights[None]
        keep = may[:, None] & may[None]
        system = jnp.where(keep, weighted @ basis, 0.0) + jnp.diag(jnp.where(may, 0.0, 1.0))
        return jnp.linalg.solve(system, jnp.where(may, weighted @ values, 0.0))

    parts = zip((family.values[0] for family in splines.motion(m)), motion, may, strict=True)
    return jnp.concatenate([nearest(*part) for part in parts])


class Order(NamedTuple):
    """Stiffness of one order m; coordinates that may not move are stiff, and on their own.

    Attributes:
        m: The order.
        K: K_m [E d]. gram: Integral of the squared displacement over the stress-free sphere [R0²].
        nulls: Motions that cost nothing, orthonormal in `gram`; zero columns where there are fewer than three.
        moving: Which coordinates may move.
    """

    m: Int[Array, ""]
    K: Float[Array, "motions motions"]
    gram: Float[Array, "motions motions"]
    nulls: Float[Array, "motions 3"]
    moving: Bool[Array, "motions"]


def order_of(
    shape: Meridian,
    splines: Azimuthal,
    hessians: Float[Array, "points 17 17"],
    nulls: Float[Array, "motions 3"],
    m: Int[Array, ""],
) -> Order:
    """One order m >= 1 of a shape, from what all orders share: `point_hessians` and `null_motions`."""
    moving = splines.moving(m)
    N = only(gram(splines, shape, m), moving, 1.0)
    K = only(stiffness_of_order(splines, hessians, m), moving, STIFF)
    none = jnp.where(m == 1, nulls, 0.0)
    return Order(m, K, N, orthonormal(none, N), moving)


def only(matrix: Float[Array, "rows rows"], moving: Bool[Array, "rows"], diagonal: float) -> Float[Array, "rows rows"]:
    """The matrix without its links to what may not move, which gets a diagonal."""
    return jnp.where(moving[:, None] & moving[None], matrix, 0.0) + jnp.diag(jnp.where(moving, 0.0, diagonal))


def orthonormal(columns: Float[Array, "rows few"], form: Float[Array, "rows rows"]) -> Float[Array, "rows few"]:
    """A basis of what the columns span, orthonormal in a form; zeros fill up where they are dependent."""
    given = jax.lax.stop_gradient((columns, form))
    size = jnp.sqrt(jnp.sum(given[0] * (given[1] @ given[0]), axis=0))
    shares = 1 / jnp.where(size > 0, size, 1.0)
    unit = given[0] * shares[None]
    values, turns = jnp.linalg.eigh(unit.T @ given[1] @ unit)
    present = values > DEPENDENT
    turns = turns * jnp.where(present, 1 / jnp.sqrt(jnp.where(present, values, 1.0)), 0.0)[None]
    # eigenvectors of equal eigenvalues have no derivative, the span has: one step towards orthonormal carries it
    basis = columns @ (shares[:, None] * turns)
    return basis @ (1.5 * jnp.eye(values.shape[0]) - (basis.T @ form @ basis) / 2)
