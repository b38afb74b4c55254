"""The equation of motion of the driven, damped, buckled shell.

One right-hand side for every solver. A state is a tuple of arrays of one
shape, a batch in their last axis, so that the fast loop and the adaptive
solver share it. Work done by drag and by the added pressure are states too:
energy less work is then a constant that a run can be held against.

Symbols    V volume [R0³]   S area [R0²]   p added pressure [E d/R0]   y_k velocities of the Stokes layer
           x poles [R0]: dimple tip h = sqrt(S² - 4π²)/2π from the flanks, poles 3V/π apart
Valid for  S > 2π, V > 0
Source     Mokbel et al. 2021: eq:Lag, caption of fig:schememodel; Keller & Miksis 1980 for the sound
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.oscillator.coefficients import Coefficients
from jshell.oscillator.drag import VISCOUS, Drag
from jshell.oscillator.lagrangian import (
    SMALLEST_AREA,
    dipole_moment,
    elastic_force,
    inertial_force,
    kinetic_energy,
    masses,
    potential_energy,
    viscous_force,
)
from jshell.pressure import Pressure, Zero
from jshell.shell.elasticity import SPHERE_AREA
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState

Values = Float[Array, "*batch"]
ABSENT = ()  # a state that this drag does not need; solvers take None for a missing array
LEAST_VOLUME = 1e-6  # the motion ends at twice this volume, and at twice this excess of area
LEAST_AREA = (1 + 1e-6) * SMALLEST_AREA
FASTEST = 1e6  # a rate beyond it is no motion of a shell


class OscillatorState(NamedTuple):
    """Where the shell is and how it moves; the last four are there only where they are needed.

    Attributes:
        V, S: Volume and area.
        dV, dS: Their rates.
        speed_square: Mean square speed of the buckling pole over its span (quasi-steady Reynolds law).
        layer: Relaxing dipole moments of the Stokes layer, one per exponential.
        lost: Work done by all drag so far, negative.
        gained: Work done by the added pressure so far.
    """

    V: Any
    S: Any
    dV: Any
    dS: Any
    speed_square: Any = ABSENT
    layer: tuple = ABSENT
    lost: Any = ABSENT
    gained: Any = ABSENT


class Driven(eqx.Module):
    """A buckled shell, what drives it and what slows it.

    Args:
        conditions: The shell and its steady load.
        coefficients: Constants of the short model.
        state: Rest state.
        drag: What takes energy away.
        forcing: Added pressure, a function of time.
        budget: Whether to carry the two works along.
    """

    conditions: Reduced
    coefficients: Coefficients
    state: RestState
    drag: Drag = VISCOUS
    forcing: Pressure = Zero()
    budget: bool = eqx.field(static=True, default=False)

    def begin(self, initial: Any = (0.0, 0.0, 0.0, 0.0)) -> OscillatorState:
        """The state at (ΔV, ΔS, ΔV̇, ΔṠ) from rest."""
        parts = (jnp.asarray(part, dtype=float) for part in initial)
        dV, dS, vV, vS = jnp.broadcast_arrays(*parts)
        V, S = self.state.volume + dV, SPHERE_AREA + dS
        still = jnp.zeros_like(V)
        layer = self.drag.layer
        moment = dipole_moment((V, S)) * vS
        # a layer that has been at rest: its velocities are 0, and a shell set in motion at once drags it along
        relaxing = () if layer is None else tuple(jnp.zeros_like(moment) for _ in range(layer.memory.rates.size))
        return OscillatorState(
            V,
            S,
            vV + still,
            vS + still,
            front_velocity((V, S), (vV + still, vS + still)) ** 2 / 2 if self.drag.remembers_speed else ABSENT,
            relaxing,
            still if self.budget else ABSENT,
            still if self.budget else ABSENT,
        )

    def rate(self, t: Any, y: OscillatorState, args: Any = None) -> OscillatorState:
        """Time derivative of the state; beyond the end of the motion (`margins`) anything finite."""
        y = self._kept_sound(y)
        q, v = (y.V, y.S), (y.dV, y.dS)
        pressure = self.forcing(t)
        square = front_velocity(q, v) ** 2
        a, drag = self._forces(q, v, y, pressure, square)
        lost = drag[0] * y.dV + drag[1] * y.dS if self.budget else ABSENT
        gained = -pressure * y.dV if self.budget else ABSENT
        past = ABSENT
        if self.drag.remembers_speed:
            past = (square - y.speed_square) / self.drag.reynolds.span
        layer = ()
        if self.drag.layer is not None:
            moment = dipole_moment(q) * y.dS
            rates = self.drag.layer.memory.rates
            layer = tuple(rates[k] * (moment - relaxed) for k, relaxed in enumerate(y.layer))
        return OscillatorState(y.dV, y.dS, a[0], a[1], past, layer, lost, gained)

    def volume_acceleration(self, t: Any, y: OscillatorState) -> Values:
        """V̈, which is what is heard far away: scattered pressure V̈/(4π r)."""
        return self.rate(t, y).dV

    def energy(self, y: OscillatorState) -> Values:
        """Kinetic and potential energy, steady outer pressure included [E d R0²]."""
        q, v = (y.V, y.S), (y.dV, y.dS)
        return kinetic_energy(q, v, self.coefficients) + potential_energy(
            q, self.state, self.coefficients, self.conditions
        )

    def margins(self, y: OscillatorState, unbuckled: Any) -> tuple[Any, Any, Any, Any]:
        """What must stay above 0: area over the flat state, volume, volume below the sphere's, and sense of speed."""
        speed = jnp.maximum(jnp.abs(y.dV), jnp.abs(y.dS))
        return y.S - 2 * LEAST_AREA + SMALLEST_AREA, y.V - 2 * LEAST_VOLUME, unbuckled - y.V, FASTEST - speed

    def _kept_sound(self, y: OscillatorState) -> OscillatorState:
        """A trial stage that overshoots the end of the motion must not poison the derivatives of other lanes."""
        V = jnp.where(y.V > LEAST_VOLUME, y.V, self.state.volume)
        S = jnp.where(y.S > LEAST_AREA, y.S, SPHERE_AREA)
        dV, dS = (jnp.where(jnp.abs(rate) < FASTEST, rate, 0.0) for rate in (y.dV, y.dS))
        return y._replace(V=V, S=S, dV=dV, dS=dS)

    def _forces(
        self, q: Any, v: Any, y: OscillatorState, pressure: Any, square: Any
    ) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        """Accelerations, and the generalised forces of all drag."""
        drag, c, eta = self.drag, self.coefficients, self.conditions.viscosity
        mass_V, mass_S = masses(q, c)
        inertia = inertial_force(q, v, c)
        elastic = elastic_force(q, self.state, c, self.conditions)

        slow_V, slow_S = jnp.zeros_like(y.V), jnp.zeros_like(y.S)
        if drag.liquid == "viscous":
            slow_V, slow_S = viscous_force(q, v, c, self.conditions)
        elif drag.liquid != "none":
            if drag.liquid == "equal_decay":
                rate = 2 / jnp.asarray(drag.tau)
            else:
                speed = square if not drag.remembers_speed else 2 * jnp.maximum(y.speed_square, 0.0)
                rate = drag.reynolds.rate(speed, eta)
            slow_V, slow_S = -rate * mass_V * y.dV, -rate * mass_S * y.dS
        slow_S = slow_S - drag.wall_viscosity * y.dS / y.S
        if drag.sound_speed is not None:
            force = lambda *q: elastic_force(q, self.state, c, self.conditions)[0]  # noqa: E731
            slow_V = slow_V + jax.jvp(force, q, v)[1] / drag.sound_speed

        extra = jnp.zeros_like(y.S)
        if drag.layer is not None:
            g, turn = jax.jvp(lambda *q: dipole_moment(q), q, v)
            memory, moment = drag.layer.memory, g * y.dS
            size = drag.layer.gamma * 3 / (2 * jnp.pi) * jnp.sqrt(jnp.asarray(eta))
            slip = memory.resistance * moment + memory.mass * turn * y.dS
            for k, relaxed in enumerate(y.layer):
                slip = slip + memory.weights[k] * (moment - relaxed)
            extra = size * memory.mass * g**2
            slow_S = slow_S - size * g * slip

        a_V = (inertia[0] + elastic[0] + slow_V - pressure) / mass_V
        a_S = (inertia[1] + elastic[1] + slow_S) / (mass_S + extra)
        return (a_V, a_S), (slow_V, slow_S - extra * a_S)


def front_position(q: tuple[Values, Values]) -> Values:
    """Buckling pole along the axis, from the plane of the flanks [R0]."""
    V, S = q
    return 3 * V / (2 * jnp.pi) - _tip(S)


def back_position(q: tuple[Values, Values]) -> Values:
    """Opposite pole along the axis, from the plane of the flanks [R0]."""
    V, S = q
    return -3 * V / (2 * jnp.pi) - _tip(S)


def front_velocity(q: tuple[Values, Values], v: tuple[Values, Values]) -> Values:
    """Velocity of the buckling pole, outwards positive.

    Source:
        V = π ℓ/3 for the distance ℓ of the poles, and the midsurface S/2 = π sqrt(1 + h²).
    """
    return jax.jvp(lambda *q: front_position(q), q, v)[1]


def _tip(S: Values) -> Values:
    """Height of the midsurface's tip, a cone over the flanks of radius 1."""
    square = (S / SMALLEST_AREA) ** 2 - 1
    bent = square > 0
    return jnp.where(bent, jnp.sqrt(jnp.where(bent, square, 1.0)), 0.0)
