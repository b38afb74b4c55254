"""The intact sphere in motion: what the shell would do if it could not buckle.

Symbols    R radius [R0]   P_ext outer pressure [E d/R0]   t time [sqrt(ρ_f R0³/(E d))]
Valid for  radial motion; `buckles` says from when on a real shell would have left it
Source     Mokbel et al. 2021: eq:NRJsph, eq:wsphere for its small oscillations
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jshell import integrator
from jshell.errors import Outcome
from jshell.shell.breathing import Pressures, radial_acceleration
from jshell.shell.elasticity import SPHERE_AREA, SPHERE_VOLUME
from jshell.shell.parameters import Number, Reduced
from jshell.shell.rest import gas_pressure, sphere_state
from jshell.shell.unbuckling import buckling_volume, wall_pressure
from jshell.trace import Trace, Values


class SphereRun(eqx.Module):
    """A radial motion of the intact sphere.

    Attributes:
        times: (times,).
        radius: (times,) R.
        speed: (times,) Ṙ.
        outcome: ok or not_converged.
        buckles: First sampled time at which the wall bears the buckling threshold; infinite where it never does.
        conditions: The problem.
    """

    times: Float[Array, " times"]
    radius: Float[Array, " times"]
    speed: Float[Array, " times"]
    outcome: Int[Array, ""]
    buckles: Float[Array, ""]
    conditions: Reduced

    def trace(self) -> Trace:
        """The run as a record with channels V and S."""
        channels: dict[str, Values] = {"V": SPHERE_VOLUME * self.radius**3, "S": SPHERE_AREA * self.radius**2}
        settings = (("model", "intact sphere"),)
        return Trace(self.times, channels, self.conditions, outcome=self.outcome, settings=settings)


def sphere_run(
    conditions: Reduced,
    forcing: Callable[[jax.Array], jax.Array],
    *,
    times: Values,
    initial: tuple[float | int, float | int] = (0.0, 0.0),
    wall_viscosity: Number = 0.0,
    sound_speed: Number | None = None,
    rtol: float = 1e-10,
    atol: float = 1e-12,
) -> SphereRun:
    """The radial motion of the intact sphere about its rest under the outer pressure of `conditions`.

    Args:
        conditions: The shell and its steady load.
        forcing: Added pressure [E d/R0], a function of time.
        times: (times,) increasing.
        initial: (ΔR, Ṙ) at the first time.
        wall_viscosity: κ_s [E d time].
        sound_speed: Speed of sound; None is an incompressible liquid.
        rtol, atol: Tolerances of the adaptive solver.
    """
    start, losses = jnp.asarray(initial, float), jnp.asarray(wall_viscosity, float)
    forcing = jax.tree.map(lambda leaf: jnp.asarray(leaf, float) if isinstance(leaf, float | int) else leaf, forcing)
    return _run(conditions.as_arrays(), forcing, jnp.asarray(times, float), start, losses, sound_speed, rtol, atol)


@eqx.filter_jit
def _run(
    c: Reduced, forcing: Any, ts: Any, initial: Any, wall_viscosity: Any, sound_speed: Any, rtol: float, atol: float
) -> SphereRun:
    """The run itself, compiled once per kind of forcing."""

    def rate(t: Any, y: Any, args: Any) -> jax.Array:
        R, v = y[0], y[1]
        acceleration = radial_acceleration(
            R,
            v,
            Pressures(
                gas_pressure(SPHERE_VOLUME * R**3, c), wall_pressure(R, c), jnp.asarray(c.outer_pressure + forcing(t))
            ),
            viscosity=c.viscosity,
            kappa=c.kappa,
            wall_viscosity=wall_viscosity,
            sound_speed=sound_speed,
        )
        return jnp.stack([v, acceleration])

    rest = jnp.cbrt(sphere_state(c).volume / SPHERE_VOLUME)
    start = jnp.stack([rest + initial[0], initial[1]])
    solution = integrator.integrate(rate, start, ts, integrator.Scheme(rtol, atol))
    found = jnp.asarray(solution.samples)
    worked = solution.worked & jnp.all(jnp.isfinite(found))
    found = jnp.where(worked, found, jnp.nan)
    borne = SPHERE_VOLUME * found[:, 0] ** 3 <= buckling_volume(c)
    buckles = jnp.where(jnp.any(borne), ts[jnp.argmax(borne)], jnp.inf)
    outcome = jnp.where(worked, int(Outcome.OK), int(Outcome.NOT_CONVERGED))
    return SphereRun(ts, found[:, 0], found[:, 1], outcome, buckles, c)
