"""Marmottant's bubble: a film that buckles, stretches and breaks.

The film's tension is zero below the buckling radius, elastic above it, and
water's where the film has broken. There is no other memory of the shell: in the
buckled state only the gas resists.

Everything is SI here, as its literature is; inside, lengths are R0, pressures
p0 and the density 1.

Symbols    R radius [m]   σ tension, χ elastic modulus of the film [N/m]   κ_s viscosity of the film [kg/s]
Valid for  R Ṙ/c small; a bubble small against the wavelength
Source     Marmottant et al. 2005, eq. 1-3
"""

from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell import integrator
from jshell.errors import BadShape, BadValue, Outcome
from jshell.renamed import renamed_attribute
from jshell.shell.breathing import Pressures, radial_acceleration
from jshell.shell.parameters import check


@dataclass(frozen=True)
class Marmottant:
    """A coated bubble.

    Args:
        radius: R0 at rest [m].
        elasticity: χ of the film [N/m].
        film_viscosity: κ_s [kg/s].
        initial_tension: σ0 at rest [N/m].
        break_tension: σ_c above which the film breaks [N/m]; infinite never breaks.
        water_tension: Tension of a broken film [N/m].
        kappa: Polytropic exponent.
        density: Of the liquid [kg/m³].
        sound_speed: c in the liquid [m/s].
        viscosity: Of the liquid [Pa s].
        pressure: p0, ambient [Pa].

    Raises:
        BadValue: A number outside its meaning.
    """

    radius: float
    elasticity: float
    film_viscosity: float = 0.0
    initial_tension: float = 0.0
    break_tension: float = float("inf")
    water_tension: float = 0.073
    kappa: float = 1.095
    density: float = 1000.0
    sound_speed: float = 1480.0
    viscosity: float = 1e-3
    pressure: float = 1e5

    def __post_init__(self) -> None:
        for name in ("radius", "elasticity", "density", "sound_speed", "pressure", "break_tension"):
            value = getattr(self, name)
            if not value > 0:
                raise BadValue(name, found=f"{value:g}", expected="a number above 0", remedy="Check value and unit.")
        for name in ("film_viscosity", "initial_tension", "viscosity", "water_tension"):
            check(name, getattr(self, name), "a finite number of at least 0", lambda x: x >= 0)
        check("kappa", self.kappa, "a number of at least 1", lambda x: x >= 1)

    @property
    def buckling_radius(self) -> float:
        """R_b = R0/sqrt(1 + σ0/χ) [m]."""
        return self.radius / float(np.sqrt(1 + self.initial_tension / self.elasticity))

    @property
    def break_radius(self) -> float:
        """Radius at which the tension reaches σ_c [m]."""
        return self.buckling_radius * float(np.sqrt(1 + self.break_tension / self.elasticity))

    @property
    def ruptured_radius(self) -> float:
        """Radius above which a broken film has water's tension [m]."""
        return self.buckling_radius * float(np.sqrt(1 + self.water_tension / self.elasticity))

    @property
    def time_unit(self) -> float:
        """R0 sqrt(ρ/p0) [s]."""
        return self.radius * float(np.sqrt(self.density / self.pressure))

    def tension(self, radius: Float[Array, "*batch"], broken: bool = False) -> Float[Array, "*batch"]:
        """σ(R) [N/m]: 0 | χ (R²/R_b² - 1) | water's once it exceeds the break tension.

        Args:
            radius: R [m].
            broken: Whether the film has been broken before: then it bears water's tension at most.
        """
        elastic = self.elasticity * ((radius / self.buckling_radius) ** 2 - 1)
        limit = self.water_tension if broken else self.break_tension
        return jnp.where(elastic <= 0, 0.0, jnp.where(elastic >= limit, self.water_tension, elastic))

    @property
    def linear_angular_frequencies(self) -> tuple[float, float]:
        """Undamped angular frequencies of the elastic and of the buckled bubble [1/s]: film's law, and gas alone.

        Source:
            ω² = (3κ p_g - 2σ0/R0 + 4χ/R0 (1 + σ0/χ))/(ρ R0²), p_g = p0 + 2σ0/R0, from the linear part of eq. 3;
            buckled: 3κ p0/(ρ R0²).
        """
        R, s = self.radius, self.initial_tension
        gas = self.pressure + 2 * s / R
        film = 3 * self.kappa * gas - 2 * s / R + 4 * (self.elasticity + s) / R
        scale = self.density * R**2
        elastic = np.sqrt(film / scale)
        return float(elastic), float(np.sqrt(3 * self.kappa * self.pressure / scale))

    linear_pulsations = renamed_attribute("linear_pulsations", "linear_angular_frequencies")


class RadialRun(eqx.Module):
    """A radial motion.

    Attributes:
        times: (times,) [s].
        radius: (times,) [m].
        speed: (times,) [m/s].
        pressure: (times,) added pressure [Pa].
        scattered: (times,) pressure times distance, ρ (R² R̈ + 2 R Ṙ²) [Pa m].
        outcome: ok or not_converged.
        broken: Whether the film broke.
        accepted, rejected: Steps of the solver.
        bubble: What moved.
    """

    times: np.ndarray
    radius: np.ndarray
    speed: np.ndarray
    pressure: np.ndarray
    scattered: np.ndarray
    outcome: Outcome = eqx.field(static=True)
    broken: bool = eqx.field(static=True)
    accepted: int = eqx.field(static=True)
    rejected: int = eqx.field(static=True)
    bubble: Marmottant = eqx.field(static=True)


def radial_run(
    bubble: Marmottant,
    pressure: Any,
    *,
    times: Any,
    rtol: float = 1e-10,
    atol: float = 1e-12,
) -> RadialRun:
    """The radial motion of a coated bubble from rest.

    Args:
        bubble: The bubble.
        pressure: Added pressure [Pa], a function of time [s] that JAX can read.
        times: (times,) increasing [s].
        rtol, atol: Tolerances, relative to R0.

    Returns:
        The run. Kinks of the tension are met by the adaptive step; after the break
        tension is first exceeded the film is a broken one, from the located instant on.

    Raises:
        BadShape: Times that do not increase.
    """
    t = np.asarray(times, dtype=float)
    if t.ndim != 1 or t.size < 2 or not np.all(np.diff(t) > 0):
        raise BadShape("times", found=f"shape {t.shape}", expected="increasing times", remedy="Sort them.")
    ts = jnp.asarray(t / bubble.time_unit)
    rows = np.full((2, t.size), np.nan)
    y, now, broken, steps = jnp.array([1.0, 0.0]), ts[0], False, np.zeros(2, int)
    while True:
        samples, last, stop, hit, worked, counts = _segment(bubble, pressure, broken, y, now, ts, rtol, atol)
        steps = steps + np.array([int(count) for count in counts])
        mine = (np.asarray(ts) >= float(now)) & (np.asarray(ts) <= float(stop))
        rows[:, mine] = np.asarray(samples).T[:, mine]
        if not (bool(hit) and bool(worked)):
            break
        y, now, broken = last, stop, True
    rate = np.asarray(jax.vmap(lambda t, y: _rate(bubble, pressure, broken, t, y)[1])(ts, jnp.asarray(rows.T)))
    unit, speed = bubble.time_unit, bubble.radius / bubble.time_unit
    R, v, a = rows[0], rows[1], rate
    scattered = bubble.pressure * bubble.radius * (R**2 * a + 2 * R * v**2)
    drive = np.asarray(jax.vmap(lambda t: jnp.asarray(pressure(t * unit), float))(ts))
    outcome = Outcome.OK if bool(worked) and np.all(np.isfinite(rows)) else Outcome.NOT_CONVERGED
    return RadialRun(
        t, R * bubble.radius, v * speed, drive, scattered, outcome, broken, int(steps[0]), int(steps[1]), bubble
    )


def _rate(bubble: Marmottant, pressure: Any, broken: bool, t: Any, y: Any) -> jax.Array:
    """(Ṙ, R̈) without units."""
    R, v = y[0], y[1]
    p0, R0, unit = bubble.pressure, bubble.radius, bubble.time_unit
    gas = (1 + 2 * bubble.initial_tension / (R0 * p0)) * R ** (-3 * bubble.kappa)
    wall = -2 * bubble.tension(R * R0, broken) / (R0 * p0) / R
    outer = 1 + pressure(t * unit) / p0
    acceleration = radial_acceleration(
        R,
        v,
        Pressures(gas, wall, outer),
        viscosity=bubble.viscosity / (p0 * unit),
        kappa=bubble.kappa,
        wall_viscosity=bubble.film_viscosity / (p0 * unit * R0),
        sound_speed=bubble.sound_speed * unit / R0,
    )
    return jnp.stack([v, acceleration])


@eqx.filter_jit
def _segment(bubble: Marmottant, pressure: Any, broken: bool, y: Any, now: Any, ts: Any, rtol: float, atol: float):
    limit = bubble.break_radius / bubble.radius
    breaks = [lambda t, y, args: limit - y[0]] if np.isfinite(limit) and not broken else []
    field = lambda t, y, args: _rate(bubble, pressure, broken, t, y)  # noqa: E731
    how = integrator.Scheme(rtol, atol, most_steps=2**18)
    found = integrator.integrate(field, y, ts, how, begin=now, margins=breaks)
    return found.samples, found.last, found.stop, jnp.any(found.hit), found.worked, (found.accepted, found.rejected)
