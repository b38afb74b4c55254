"""Where a run may start besides at rest: displaced, or kicked.

Symbols    q coordinates [R0]   u velocities [R0/time unit]   V volume [R0³]
Source     Mokbel et al. 2021, numerical method: a small kick about a rest shape
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.contour import volume
from jshell.dynamics.motion import Body, at_pressure
from jshell.dynamics.vibrations import Modes
from jshell.errors import BadValue
from jshell.flow import flow
from jshell.membrane import RestShape, potential_energy, stiffness
from jshell.membrane.energy import Area
from jshell.shell.elasticity import Scalar
from jshell.shell.parameters import Number

SLIDING_TIME = 0.01  # what moves liquid moves by the square of it, 1e-4 of a displacement
SLIDING_STEPS = 4  # Newton steps


@eqx.filter_jit
def relax(
    body: Body, q: Float[Array, "coordinates"], pressure: Scalar, area: Area | str
) -> Float[Array, "coordinates"]:
    """Let a displaced wall slide along itself until no tangential force is left, its shape all but unmoved.

    Newton steps in which inertia over a short time holds whatever moves liquid; what moves none is free.
    """
    shape, loaded, free = body.shape, at_pressure(body.conditions, pressure), body.shape.active

    def slide(q, _):
        slope = jax.grad(lambda q: potential_energy(shape, q, body.wall, loaded, area))(q)
        held = stiffness(shape, q, body.wall, loaded, area) + flow(shape, q).mass / SLIDING_TIME**2
        return q.at[free].add(-jnp.linalg.solve(held[free][:, free], slope[free])), None

    return jax.lax.scan(slide, q, None, length=SLIDING_STEPS)[0]


def kick(found: Modes, amplitude: Number, modes: tuple[int, ...] = (1,)) -> Float[Array, "coordinates"]:
    """A velocity along modes after which the volume swings by about an amplitude.

    Args:
        found: Modes of the rest shape the run starts at.
        amplitude: Relative change of volume [-], shared evenly between the modes.
        modes: Which modes, counted from 1.

    Raises:
        BadValue: A mode that was not computed, or one that does not change the volume.
    """
    if not modes or min(modes) < 1 or max(modes) > found.omega.shape[0]:
        raise BadValue(
            "modes",
            found=repr(modes),
            expected=f"numbers from 1 to {found.omega.shape[0]}",
            remedy="Compute more modes.",
        )
    total = jnp.zeros(found.shapes.shape[-1])
    for number in modes:
        k = number - 1
        swing = amplitude / len(modes) * found.rest.volume / found.dV[k]
        total = total + swing * (found.rate[k] * found.shapes[k] / 1j).real
    return total


def swell(found: RestShape, rate: Number) -> Float[Array, "coordinates"]:
    """A velocity of the whole wall along the gradient of its volume, dV/dt given over V [1/time unit]."""
    shape, q = found.meridian, found.coordinates
    slope = jax.grad(lambda q: volume(shape, q))(q)
    held = jnp.zeros_like(q).at[shape.active].set(1.0)
    slope = slope * held
    return rate * found.volume * slope / (slope @ slope)
