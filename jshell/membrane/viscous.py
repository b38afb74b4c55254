"""What the wall itself takes: Kelvin-Voigt loss of stretching and of bending.

    D = ∮ [κ_s (ė1 + ė2)² + μ_s (ė1 - ė2)² + 4 κ_b Ḣ²] dA,    e_i = log λ_i

κ_s is the dilatational viscosity of contrast agents' coatings: a breathing
sphere feels the pressure 4 κ_s Ṙ/R² of Marmottant's model.

Symbols    κ_s, μ_s dilatational and shear viscosity of the wall [E d · time]   κ_b bending [E d R0² · time]
Source     Scriven 1960; Marmottant et al. 2005; Kelvin-Voigt: each modulus of eq:bend, eq:stretch times one time
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.contour import Meridian
from jshell.membrane.energy import Wall
from jshell.shell.parameters import Number, check


class WallLoss(eqx.Module):
    """Viscosities of the wall.

    Args:
        dilatation: κ_s [E d · time unit].
        shear: μ_s [E d · time unit].
        bending: κ_b [E d R0² · time unit].
        retardation: Kelvin-Voigt time [time unit]: adds each elastic modulus times it to the viscosity of its kind.
    """

    dilatation: Number = 0.0
    shear: Number = 0.0
    bending: Number = 0.0
    retardation: Number = 0.0

    def __check_init__(self) -> None:
        for name in ("dilatation", "shear", "bending", "retardation"):
            check(f"wall {name}", getattr(self, name), "a finite number of at least 0", lambda x: x >= 0)


def wall_resistance(
    shape: Meridian, q: Float[Array, "coordinates"], wall: Wall, loss: WallLoss
) -> Float[Array, "coordinates coordinates"]:
    """Matrix C of a shape: u·C u is the power lost in the wall, C symmetric positive semidefinite."""
    return sum(
        (rate.T @ (held[:, None] * rate) for rate, held in wall_rates(shape, q, wall, loss)), start=jnp.zeros(())
    )


def wall_rates(
    shape: Meridian, q: Float[Array, "coordinates"], wall: Wall, loss: WallLoss
) -> tuple[tuple[Float[Array, "points coordinates"], Float[Array, "points"]], ...]:
    """The rates of growth, shear and bending of the wall per velocity, each with what resists it on its ring."""
    curve = shape.at_points(q)
    even, odd = shape.x_basis.shape[2], shape.r_basis.shape[2]
    nothing_x, nothing_r = jnp.zeros((shape.angles.size, even)), jnp.zeros((shape.angles.size, odd))
    ds = jnp.sqrt(curve.x1**2 + curve.r1**2)
    column = lambda values: values[:, None]  # noqa: E731
    along = jnp.concatenate(
        [column(curve.x1 / ds**2) * shape.x_basis[1], column(curve.r1 / ds**2) * shape.r_basis[1]], axis=1
    )
    across = jnp.concatenate([nothing_x, column(1 / curve.r) * shape.r_basis[0]], axis=1)

    def mean_curvature(x1, r, r1, x2, r2):
        square = x1**2 + r1**2
        return (x1 * r2 - r1 * x2) / square**1.5 / 2 - x1 / (2 * r * jnp.sqrt(square))

    slopes = jax.vmap(jax.grad(mean_curvature, argnums=(0, 1, 2, 3, 4)))(
        curve.x1, curve.r, curve.r1, curve.x2, curve.r2
    )
    of_x1, of_r, of_r1, of_x2, of_r2 = map(column, slopes)
    X, R = shape.x_basis, shape.r_basis
    bends = jnp.concatenate([of_x1 * X[1] + of_x2 * X[2], nothing_r], axis=1)
    bends = bends + jnp.concatenate([nothing_x, of_r * R[0] + of_r1 * R[1] + of_r2 * R[2]], axis=1)

    surface = 2 * jnp.pi * shape.weights * curve.r * ds
    grows, shears = along + across, along - across
    time = loss.retardation
    return (
        (grows, surface * (loss.dilatation + time * wall.area)),
        (shears, surface * (loss.shear + time * wall.shear)),
        (bends, 4 * surface * (loss.bending + time * wall.bending)),
    )
