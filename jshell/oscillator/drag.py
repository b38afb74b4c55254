"""What takes energy from the motion: liquid, boundary layer, wall, sound.

In the liquid one of: the flow's own viscous dissipation (β1, β2), one decay
time for both modes, or the law of a settling sphere, whose drag coefficient
depends on the Reynolds number of the buckling pole. Beside it, where asked:
a Stokes layer that remembers, a viscous wall, and sound that carries energy off.

Symbols    Re Reynolds number   C drag coefficient   τ decay time   κ_s wall viscosity [E d time]
           γ Stokes-layer factor [-]   c speed of sound [sqrt(E d/(ρ_f R0))]
Valid for  Re 1e-8 to 1e6
Source     Mokbel et al. 2021: eq:D, eq:taureal, section "Damping"; Almedeij 2008; Clift, Grace & Weber 1978,
           Table 5.12. Misprint: the source mixes a drag coefficient of the diameter with a Reynolds number of
           the radius, so the length is a choice here.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jshell.errors import BadName, choose
from jshell.memory import HalfDerivative
from jshell.shell.parameters import Number, check

LIQUIDS = ("viscous", "equal_decay", "reynolds", "none")
CURVES = ("almedeij", "clift")
LENGTHS = {"radius": 1.0, "diameter": 2.0}
SPEEDS = ("instantaneous", "quasi_steady")
DISPLACED_MASS = 8 / 3  # the source's prefactor: a sphere that moves the mass of the liquid it displaces
LEAST_RE = 1e-8
Values = Float[Array, "*batch"]


def drag_coefficient(reynolds: Values, curve: str = "almedeij") -> Values:
    """Drag coefficient of a sphere, from creeping flow past the drag crisis.

    Args:
        reynolds: Of the diameter, as both curves take it; 1e-8 to 1e6.
        curve: `almedeij` (smooth) or `clift` (the standard curve, in pieces).

    Source:
        Almedeij 2008, in logarithms: its tenth powers overflow.

    Example:
        >>> import jax.numpy as jnp
        >>> from jshell.oscillator.drag import drag_coefficient
        >>> print(f"{float(drag_coefficient(jnp.asarray(100.0))):.5f}")
        0.99251
    """
    choose("curve", curve, CURVES)
    return jnp.exp(_log_coefficient(jnp.log(jnp.maximum(reynolds, LEAST_RE)), curve))


def _log_coefficient(x: Values, curve: str) -> Values:
    """ln C of x = ln Re."""
    if curve == "clift":
        return _clift(x)
    ln, add = math.log, jnp.logaddexp
    p1 = add(add(10 * ln(24) - 10 * x, 10 * ln(21) - 6.7 * x), add(10 * ln(4) - 3.3 * x, 10 * ln(0.4)))
    p2 = -add(-10 * (ln(0.148) + 0.11 * x), -10 * ln(0.5))
    p3 = 10 * (ln(1.57e8) - 1.625 * x)
    p4 = -add(-10 * (ln(6e-17) + 2.63 * x), -10 * ln(0.2))
    return add(-add(-add(p1, p2), -p3), p4) / 10


def _clift(x: Values) -> Values:
    """ln C of x = ln Re by the ten pieces of the standard drag curve."""
    w, ten = x / math.log(10), math.log(10)
    creeping = jnp.log(24.0) - x
    re = jnp.exp(jnp.minimum(x, math.log(1e7)))
    pieces = (
        (math.log(0.01), creeping + jnp.log1p(re / 128)),
        (math.log(20), creeping + jnp.log1p(0.1315 * jnp.exp((0.82 - 0.05 * w) * x))),
        (math.log(260), creeping + jnp.log1p(0.1935 * jnp.exp(0.6305 * x))),
        (math.log(1.5e3), ten * (1.6435 - 1.1242 * w + 0.1558 * w**2)),
        (math.log(1.2e4), ten * (-2.4571 + 2.5558 * w - 0.9295 * w**2 + 0.1049 * w**3)),
        (math.log(4.4e4), ten * (-1.9181 + 0.6370 * w - 0.0636 * w**2)),
        (math.log(3.38e5), ten * (-4.3390 + 1.5809 * w - 0.1546 * w**2)),
        (math.log(4e5), jnp.log(jnp.maximum(29.78 - 5.3 * w, 1e-3))),
        (math.log(1e6), jnp.log(jnp.maximum(0.1 * w - 0.49, 1e-3))),
    )
    found = jnp.log(jnp.maximum(0.19 - 8e4 / re, 1e-3))
    for end, piece in reversed(pieces):
        found = jnp.where(x < end, piece, found)
    return found


def reynolds_decay_time(
    reynolds: Values, *, length: str = "radius", prefactor: float = DISPLACED_MASS, curve: str = "almedeij"
) -> Values:
    """Decay time of a settling sphere, η τ/(ρ R0²) [-].

    Args:
        reynolds: Of the `length`.
        length: `radius`, as the source reads the law, or `diameter`, as the drag curves are made.
        prefactor: 8/3 takes the displaced mass as the mass that moves.
        curve: `almedeij` or `clift`.

    Returns:
        1/9 and 2/9 at small Re for the radius and the diameter.

    Source:
        Section "Damping": τ = (8/3) ρ R0²/(η C Re).
    """
    choose("length", length, LENGTHS)
    choose("curve", curve, CURVES)
    x = jnp.log(jnp.maximum(reynolds, LEAST_RE))
    return prefactor * LENGTHS[length] * jnp.exp(-(_log_coefficient(x, curve) + x))


class Reynolds(eqx.Module):
    """The drag law of a settling sphere, read at the buckling pole.

    Args:
        length: `radius` or `diameter` in the Reynolds number.
        prefactor: See `reynolds_decay_time`.
        curve: `almedeij` or `clift`.
        speed: `instantaneous`: |ẋ| of the pole now; `quasi_steady`: its amplitude, √2 times the root mean
            square over the past `span`.
        span: Time over which a quasi-steady speed is remembered; about a period of the slow mode.
    """

    length: str = eqx.field(static=True, default="radius")
    prefactor: Number = DISPLACED_MASS
    curve: str = eqx.field(static=True, default="almedeij")
    speed: str = eqx.field(static=True, default="instantaneous")
    span: Number = 6.0

    def __check_init__(self) -> None:
        choose("length", self.length, LENGTHS)
        choose("curve", self.curve, CURVES)
        choose("speed", self.speed, SPEEDS)
        check("prefactor", self.prefactor, "a number above 0", lambda x: x > 0)
        check("span", self.span, "a time above 0", lambda x: x > 0)

    def rate(self, square: Values, viscosity: Number) -> Values:
        """2/τ at a squared speed of the pole."""
        size = LENGTHS[self.length]
        least = LEAST_RE * viscosity / size
        x = 0.5 * jnp.log(jnp.maximum(square, least**2)) + jnp.log(size / jnp.asarray(viscosity))
        return jnp.asarray(2 * viscosity / (self.prefactor * size) * jnp.exp(_log_coefficient(x, self.curve) + x))


class StokesLayer(eqx.Module):
    """The oscillating boundary layer of the dipole flow, as a force that remembers.

    A translating sphere whose dipole moment is p slips with 3 p sin θ/(4π), so
    the layer resists with 3/(2π) √η g D^{1/2}(g Ṡ).

    Args:
        memory: The half-order derivative, from `jshell.memory.half_derivative`.
        gamma: Factor on the sphere's slip [-], to be fitted like α and β.
    """

    memory: HalfDerivative
    gamma: Number = 1.0

    def __check_init__(self) -> None:
        check("gamma", self.gamma, "a finite number of at least 0", lambda x: x >= 0)


class Drag(eqx.Module):
    """Everything that takes energy away.

    Args:
        liquid: `viscous` (β1, β2 of the coefficients, eq:D), `equal_decay` (both modes as exp(-t/τ), τ given),
            `reynolds`, or `none`.
        tau: Decay time of `equal_decay`.
        reynolds: The law of `reynolds`.
        layer: A Stokes layer beside it; None is none.
        wall_viscosity: κ_s of the shell material [E d time].
        sound_speed: Speed of sound in the liquid; None is an incompressible liquid.

    Raises:
        BadName, BadValue: A law or number that does not exist.
    """

    liquid: str = eqx.field(static=True, default="viscous")
    tau: Number | None = None
    reynolds: Reynolds = Reynolds()
    layer: StokesLayer | None = None
    wall_viscosity: Number = 0.0
    sound_speed: Number | None = None

    def __check_init__(self) -> None:
        choose("liquid", self.liquid, LIQUIDS)
        if self.liquid == "equal_decay" and self.tau is None:
            raise BadName("tau", found="none", expected="a decay time for equal_decay", remedy="Give tau=….")
        check("tau", self.tau, "a time above 0", lambda x: x > 0, optional=True)
        check("wall_viscosity", self.wall_viscosity, "a finite number of at least 0", lambda x: x >= 0)
        check("sound_speed", self.sound_speed, "a number above 0", lambda x: x > 0, optional=True)

    @property
    def remembers_speed(self) -> bool:
        """Whether a state is needed for the pole's past speed."""
        return self.liquid == "reynolds" and self.reynolds.speed == "quasi_steady"


VISCOUS = Drag()


def drag_slope(reynolds: jax.Array, curve: str = "almedeij") -> jax.Array:
    """Slope d ln C/d ln Re, -1 in creeping flow."""
    return jax.grad(lambda x: jnp.sum(_log_coefficient(x, curve)))(jnp.log(jnp.maximum(reynolds, LEAST_RE)))
