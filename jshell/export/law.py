"""The short model as one equation for the volume, in SI: what a code with one radius needs of a buckled shell.

Of two variables one is left, so something is lost; what must be right decides which law to take.

`mode`   V and S move together as in the slow mode: frequency, energy and the answer to a sound near its resonance are
         the short model's. A slow load meets a stiffness that is too large, by `stiffening`.
`rest`   the area is at rest at every volume: P(V), its energy and the loads of unbuckling are the short model's; mass
         and damping are those with which it rings as the slow mode does at every V. It answers to a sound too much.

    M(V) V̈ + ½ M'(V) V̇² + C(V) V̇ = P(V) - P_ext(t)

Symbols    V volume [m³]   P pressure [Pa]   M mass [kg/m⁴], ρ/4πR of a sphere   C damping [Pa s/m³]
Valid for  the short model around one buckled rest state, slow motion: far from it the wall's energy is an extrapolation
Source     Mokbel et al. 2021: eq:Lag, eq:US, eq:NRJsph; the reduction is this project's
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jshell.errors import BadValue, UnusableData, choose
from jshell.oscillator import Coefficients, thresholds
from jshell.oscillator.lagrangian import dissipation, masses, potential_energy
from jshell.oscillator.simulate import is_buckled
from jshell.oscillator.unbuckling import borne
from jshell.shell.elasticity import SPHERE_AREA, SPHERE_VOLUME, moduli
from jshell.shell.parameters import Reduced, Scales
from jshell.shell.rest import RestState, buckled_state, gas_pressure
from jshell.shell.unbuckling import wall_pressure

ROWS = 401
SMALLEST = 0.6  # of the rest volume, where the table of the buckled branch begins
LARGEST = 1.25  # of the stress-free volume, where that of the sphere ends
FLAT = 1.02  # of the area of the flat state, which the short model does not reach

Values = Float[np.ndarray, "rows"]


@dataclass(frozen=True)
class LawBranch:
    """One branch of rest states, by volume.

    Attributes:
        volume: Ascending [m³].
        pressure: What gas and wall bear together [Pa].
        gas: Pressure of the gas [Pa].
        mass: M [kg/m⁴].
        damping: C [Pa s/m³].
    """

    volume: Values
    pressure: Values
    gas: Values
    mass: Values
    damping: Values

    @property
    def radius(self) -> Values:
        """Radius of a sphere of the same volume [m]."""
        return np.cbrt(3 * self.volume / (4 * np.pi))


@dataclass(frozen=True)
class RadialLaw:
    """A shell as one equation for its volume, in SI.

    Attributes:
        buckled, sphere: Its two branches.
        rest_volume, rest_pressure: Volume and outer pressure of the buckled rest state [m³], [Pa].
        buckling_volume: Below this volume the sphere buckles [m³].
        unbuckling_volume: Above this volume the dimple is gone [m³].
        density: Of the liquid [kg/m³].
        viscosity: Of the liquid [Pa s].
        kappa: Polytropic exponent of the gas [-].
        stiffening: Stiffness of the slow mode's volume at rest over the static one, less 1 [-].
        along: `mode` or `rest`.
    """

    buckled: LawBranch
    sphere: LawBranch
    rest_volume: float
    rest_pressure: float
    buckling_volume: float
    unbuckling_volume: float
    density: float
    viscosity: float
    kappa: float
    stiffening: float
    along: str

    def slow_mode(self, volume: float | None = None) -> tuple[float, float]:
        """Intrinsic angular frequency [rad/s] and decay time [s] of small motion about a buckled state."""
        at = self.rest_volume if volume is None else volume
        row = self.buckled
        stiffness = -np.interp(at, row.volume, np.gradient(row.pressure, row.volume, edge_order=2))
        mass, damping = (float(np.interp(at, row.volume, part)) for part in (row.mass, row.damping))
        return float(np.sqrt(stiffness / mass)), 2 * mass / damping if damping > 0 else float("inf")


def radial_law(
    conditions: Reduced,
    coefficients: Coefficients,
    scales: Scales,
    *,
    along: str = "mode",
    equilibrium: RestState | None = None,
    rows: int = ROWS,
) -> RadialLaw:
    """The law of a shell, from the short model.

    Args:
        conditions: The shell; its outer pressure is where it rests buckled.
        coefficients: Constants of the short model.
        scales: The units of `conditions`: `jshell.shell.scales(shell, liquid)`.
        along: `mode`, for sound; `rest`, for slow loads.
        equilibrium: Rest state of the buckled shell; None takes it from the plateau law.
        rows: Of each table.

    Raises:
        BadName: No such `along`.
        BadValue: Fewer than 11 rows.
        UnusableData: No buckled state, no end of the buckled branch, or a slow motion that does not swing.

    Example:
        >>> import jshell as js
        >>> units = js.shell.scales(js.Shell(0.0225, 0.0018, 0.5e6), js.Liquid(1260.0))
        >>> law = js.export.radial_law(js.Reduced(0.08, 0.9, 1.2), js.Coefficients(3.6, 1.1, 0.23), units)
        >>> omega, tau = law.slow_mode()
        >>> omega * units.time
        0.8242...
    """
    choose("along", along, ("mode", "rest"))
    if rows < 11:
        raise BadValue("rows", found=str(rows), expected="11 or more", remedy="Leave it out.")
    state = buckled_state(conditions) if equilibrium is None else equilibrium
    ends = thresholds(conditions, coefficients, equilibrium)
    if not bool(is_buckled(state)) or not np.isfinite(float(ends.unbuckling_volume)):
        raise UnusableData(
            "conditions",
            found="no buckled rest state, or a branch that does not meet the sphere's",
            expected="a shell that buckles at this load",
            remedy="Raise the outer pressure, or give `equilibrium`.",
        )
    V_e, V_u, V_b = float(state.volume), float(ends.unbuckling_volume), float(ends.buckling_volume)
    slope = _area_slope(conditions, coefficients, state, along)
    least = FLAT * 2 * np.pi
    flat = V_e + (least - SPHERE_AREA) / slope if slope else np.inf  # no flatter than the short model can be
    ends_at = (max(SMALLEST * V_e, flat), V_u) if slope > 0 else (SMALLEST * V_e, min(V_u, flat))
    volumes = np.linspace(*ends_at, rows)
    table = (_along_mode if along == "mode" else _along_rest)(volumes, slope, conditions, coefficients, state)
    if not np.all(np.isfinite(table)) or np.any(table[3] <= 0):
        raise UnusableData(
            "conditions, coefficients",
            found="a slow motion that creeps, or runs away, somewhere on the branch",
            expected="one that swings",
            remedy="Lower viscosity, beta or k_vs.",
        )
    pressure, length, time = float(scales.pressure), float(scales.length), float(scales.time)
    units = np.array([length**3, pressure, pressure, pressure * time**2 / length**3, pressure * time / length**3])
    sphere = _sphere(np.linspace(0.9 * V_b, LARGEST * SPHERE_VOLUME, rows), conditions)
    return RadialLaw(
        LawBranch(*(table * units[:, None])),
        LawBranch(*(sphere * units[:, None])),
        V_e * length**3,
        float(conditions.outer_pressure) * pressure,
        V_b * length**3,
        V_u * length**3,
        float(scales.density),
        float(conditions.viscosity) * pressure * time,
        float(conditions.kappa),
        _stiffening(conditions, coefficients, state),
        along,
    )


def _matrices(V, slope: float, conditions: Reduced, coefficients: Coefficients, state: RestState):
    """Diagonals of mass and damping (2, rows), and stiffness, of small motion about states of an area's slope."""
    V = jnp.asarray(V)
    position = (V, SPHERE_AREA + slope * (V - state.volume))
    still, one = jnp.zeros_like(V), jnp.ones_like(V)
    # the dissipation is quadratic in the rates: C is twice its value at a rate of 1
    loss = [2 * dissipation(position, rate, coefficients, conditions) for rate in ((one, still), (still, one))]
    gas = state.pressure * (state.volume / V) ** conditions.kappa
    A_VS, A_SS = _wall(conditions, coefficients, state)
    mass = np.stack([np.asarray(part) for part in masses(position, coefficients)])
    return mass, np.stack([np.asarray(part) for part in loss]), np.asarray(conditions.kappa * gas / V), A_VS, A_SS


def _wall(conditions: Reduced, coefficients: Coefficients, state: RestState) -> tuple[float, float]:
    area = moduli(conditions.thickness, conditions.poisson_ratio).area
    return float(coefficients.k_vs / state.volume), float(area / SPHERE_AREA)


def _area_slope(conditions: Reduced, coefficients: Coefficients, state: RestState, along: str) -> float:
    """dS/dV at rest: of the slow mode, or of an area at rest."""
    A_VS, A_SS = _wall(conditions, coefficients, state)
    if along == "rest":
        return -A_VS / A_SS
    mass, _, gas, *_ = _matrices(np.array([float(state.volume)]), 0.0, conditions, coefficients, state)
    (m, n), a = mass[:, 0], float(gas[0])
    low = np.linalg.eigvals(np.array([[a / m, A_VS / m], [A_VS / n, A_SS / n]])).real.min()
    return -A_VS / (A_SS - low * n)


def _stiffening(conditions: Reduced, coefficients: Coefficients, state: RestState) -> float:
    _, _, gas, A_VS, A_SS = _matrices(np.array([float(state.volume)]), 0.0, conditions, coefficients, state)
    slope, a = _area_slope(conditions, coefficients, state, "mode"), float(gas[0])
    return float((a + 2 * A_VS * slope + A_SS * slope**2) / (a - A_VS**2 / A_SS) - 1)


def _gas(volumes: Values, conditions: Reduced, state: RestState) -> Values:
    return np.asarray(state.pressure * (state.volume / volumes) ** conditions.kappa)


def _along_mode(volumes: Values, slope: float, conditions: Reduced, coefficients: Coefficients, state: RestState):
    """(5, rows) volume, pressure, gas, mass and damping where the area moves with the volume as in the slow mode."""

    def energy(V):
        return potential_energy((V, SPHERE_AREA + slope * (V - state.volume)), state, coefficients, conditions)

    pressure = conditions.outer_pressure - jax.vmap(jax.grad(energy))(jnp.asarray(volumes))
    mass, loss, *_ = _matrices(volumes, slope, conditions, coefficients, state)
    weight = np.array([[1.0], [slope**2]])
    whole, damping = np.sum(mass * weight, axis=0), np.sum(loss * weight, axis=0)
    return np.stack([volumes, np.asarray(pressure), _gas(volumes, conditions, state), whole, damping])


def _along_rest(volumes: Values, slope: float, conditions: Reduced, coefficients: Coefficients, state: RestState):
    """The same where the area is at rest; NaN where the slow root of det(s² M + s C + K) = 0 does not swing."""
    mass, loss, gas, A_VS, A_SS = _matrices(volumes, slope, conditions, coefficients, state)
    roots = np.full(len(volumes), np.nan + 0j)
    for k, (m, c, a) in enumerate(zip(mass.T, loss.T, gas, strict=True)):
        found = np.roots(np.polysub(np.polymul([m[0], c[0], a], [m[1], c[1], A_SS]), [A_VS**2]))
        slow = complex(min(found[found.imag >= 0], key=abs, default=np.nan))
        roots[k] = slow if abs(slow.imag) > 1e-9 * abs(slow) else np.nan
    whole = (gas - A_VS**2 / A_SS) / np.abs(roots) ** 2
    pressure = _gas(volumes, conditions, state) + borne(volumes, conditions, coefficients, state)
    return np.stack(
        [volumes, np.asarray(pressure), _gas(volumes, conditions, state), whole, -2 * np.real(roots) * whole]
    )


def _sphere(volumes: Values, conditions: Reduced) -> Float[np.ndarray, "5 rows"]:
    """The sphere before it buckles: its own radial equation, no reduction."""
    radius = np.cbrt(volumes / SPHERE_VOLUME)
    gas = jax.vmap(lambda V: gas_pressure(V, conditions))(jnp.asarray(volumes))
    wall = jax.vmap(lambda R: wall_pressure(R, conditions))(jnp.asarray(radius))
    mass, damping = 1 / (4 * np.pi * radius), float(conditions.viscosity) / (np.pi * radius**3)
    return np.stack([volumes, np.asarray(gas + wall), np.asarray(gas), mass, damping])
