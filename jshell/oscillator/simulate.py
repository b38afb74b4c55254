"""The door: conditions and constants in, a trace or two frequencies out.

Symbols    V volume [R0³]   S area [R0²]   times [sqrt(ρ_f R0³/(E d))]
Valid for  as the rest law and the linear model say; results outside are marked, not hidden
Source     Mokbel et al. 2021: eq:eqmovadimV, eq:eqmovadimS, eq:defw, eq:limstab, eq:wsphere
"""

import warnings
from collections.abc import Callable
from typing import Unpack

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float, Int

from jshell import integrator
from jshell.errors import BadName, BadShape, BadValue, Outcome, RangeWarning, choose
from jshell.oscillator.coefficients import Coefficients
from jshell.oscillator.lagrangian import acceleration
from jshell.oscillator.linear import (
    matrices,
    propagator,
    squared_frequencies,
    stability_margin,
    state_matrix,
    uniform_propagator,
)
from jshell.shell.elasticity import SPHERE_AREA, SPHERE_VOLUME, buckling_threshold, moduli
from jshell.shell.parameters import Number, Reduced
from jshell.shell.rest import RestState, buckled_state, sphere_state, warn_outside_plateau_range
from jshell.shell.sphere import marmottant_frequency, sphere_frequency_at_load
from jshell.trace import Trace, Values
from jshell.undetermined import undetermined

NEAR_LIMIT = 1.05  # times the stability limit: up to here the short model warns
SOLVERS = ("exact", "diffrax")
MODELS = ("linear", "nonlinear")
LAWS: dict[str, Callable[[Reduced], RestState]] = {"coupier2019": buckled_state}


class Frequencies(eqx.Module):
    """What the short model says of a shell at a load.

    Attributes:
        omega_minus: Slow angular frequency [sqrt(E d/(ρ_f R0³))]; NaN where the slow mode is unstable.
        omega_plus: Fast angular frequency.
        volume: Volume at rest [R0³].
        pressure: Inner pressure at rest [E d/R0].
        stability_margin: 1 at the limit of eq:limstab, above it the slow mode is stable.
        stable: Whether the slow mode oscillates.
        omega_sphere: Angular frequency of the sphere under the same load, had it not buckled (eq:wsphere).
        omega_marmottant: Angular frequency of a bubble at the outer pressure.
        outcome: An integer of `Outcome`: no_buckled_state, where all numbers of the buckled shell are NaN;
            out_of_range where the slow mode is unstable, and its frequency alone is NaN.
    """

    omega_minus: Float[Array, ""]
    omega_plus: Float[Array, ""]
    volume: Float[Array, ""]
    pressure: Float[Array, ""]
    stability_margin: Float[Array, ""]
    stable: jax.Array
    omega_sphere: Float[Array, ""]
    omega_marmottant: Float[Array, ""]
    outcome: Int[Array, ""]


def frequencies(conditions: Reduced, coefficients: Coefficients, law: str = "coupier2019") -> Frequencies:
    """The two frequencies of a buckled shell, beside those of its rivals.

    Args:
        conditions: The shell and its load.
        coefficients: Constants of the short model.
        law: Rest law: `coupier2019`.

    Raises:
        BadName: No such law.

    Warns:
        RangeWarning: Outside the range of the rest law; within 5 % of the stability limit; at a load at which the
            sphere is stable as well (one shell with concrete numbers only).

    Source:
        eq:defw, eq:equiplateau, eq:equivol, eq:limstab, eq:wsphere.

    Example:
        >>> from jshell import Reduced
        >>> from jshell.oscillator import SOURCE, frequencies
        >>> found = frequencies(Reduced(0.08, 0.9, 1.2), SOURCE)
        >>> print(f"{found.omega_minus:.4f} {found.omega_plus:.4f}")
        0.8243 1.3543
    """
    choose("law", law, LAWS)
    if np.ndim(conditions.thickness) == 0:
        warn_outside_plateau_range(conditions.thickness, law)
    found, spherical = _frequencies(conditions.as_arrays(), coefficients.as_arrays(), law)
    _warn_of_edges(found, spherical)
    return found


def _warn_of_edges(found: Frequencies, spherical: jax.Array) -> None:
    """Warn near the model's stability limit, and where the sphere is stable as well (one concrete shell only)."""
    margin, spherical, outcome = jax.lax.stop_gradient((found.stability_margin, spherical, found.outcome))
    if any(isinstance(part, Tracer) or np.ndim(part) for part in (margin, spherical, outcome)):
        return
    if int(outcome) != Outcome.OK:
        return
    margin = float(margin)
    if margin < NEAR_LIMIT:
        warnings.warn(
            f"at {margin:.3f} times the stability limit of the short model: omega_minus goes to 0 there, a limit that "
            "the axisymmetric shell does not have; jshell.dynamics.modes computes it",
            RangeWarning,
            stacklevel=3,
        )
    if bool(spherical):
        warnings.warn(
            "at this load the sphere has not buckled yet: the short model has two states, and these are the numbers of "
            "the buckled one; whether the whole shell can rest there, jshell.membrane.rest tells",
            RangeWarning,
            stacklevel=3,
        )


@eqx.filter_jit
def _frequencies(conditions: Reduced, coefficients: Coefficients, law: str) -> tuple[Frequencies, jax.Array]:
    state = LAWS[law](conditions)
    c = coefficients
    K_A = moduli(conditions.thickness, conditions.poisson_ratio).area
    w2 = squared_frequencies(
        state.volume, state.pressure, c.alpha1, c.alpha2, c.k_vs, kappa=conditions.kappa, area_modulus=K_A
    )

    stable = w2[0] > 0
    buckled = is_buckled(state)
    slow = undetermined(~stable, jnp.sqrt(jnp.where(stable, w2[0], 1.0)))
    outcome = jnp.where(
        buckled, jnp.where(stable, int(Outcome.OK), int(Outcome.OUT_OF_RANGE)), int(Outcome.NO_BUCKLED_STATE)
    )
    answer = slow, jnp.sqrt(w2[1]), jnp.asarray(state.volume), jnp.asarray(state.pressure)
    margin = stability_margin(state, c, conditions)
    omega_minus, omega_plus, volume, pressure, margin = undetermined(~buckled, (*answer, margin))
    # the sphere buckles where the wall bears the classical threshold
    borne = conditions.outer_pressure - sphere_state(conditions).pressure
    spherical = jnp.asarray(borne < buckling_threshold(conditions.thickness, conditions.poisson_ratio))
    found = Frequencies(
        omega_minus=omega_minus,
        omega_plus=omega_plus,
        volume=volume,
        pressure=pressure,
        stability_margin=margin,
        stable=stable & buckled,
        omega_sphere=sphere_frequency_at_load(conditions),
        omega_marmottant=marmottant_frequency(conditions),
        outcome=outcome,
    )
    return found, spherical


def is_buckled(state: RestState) -> jax.Array:
    """Whether a rest state exists and holds less than the stress-free sphere."""
    return state.volume < SPHERE_VOLUME


def simulate(
    conditions: Reduced,
    coefficients: Coefficients,
    *,
    initial: Values | tuple[Number, Number, Number, Number],
    times: Values,
    equilibrium: RestState | None = None,
    solver: str = "exact",
    model: str = "linear",
    **adaptive: Unpack[integrator.Adaptive],
) -> Trace:
    """The motion of volume and area about the buckled rest state.

    Args:
        conditions: The shell and its load.
        coefficients: Constants of the short model.
        initial: (ΔV, ΔS, ΔV̇, ΔṠ) at the first time.
        times: (times,) increasing.
        equilibrium: Rest state; None takes it from the plateau law.
        solver: `exact` propagator or `diffrax` (Dopri8, adaptive).
        model: `linear`, or `nonlinear` (by diffrax only).
        rtol, atol: Tolerances of the adaptive solver, 1e-9 and 1e-11.
        adjoint: How the adaptive solver is differentiated: `reverse` (checkpoints, the default) or `forward` (for
            Jacobians).

    Returns:
        A trace with channels V and S, absolute values.

    Raises:
        BadName: No such solver, model or adjoint; the exact solver with the nonlinear model.
        BadShape: Not four initial numbers, or times that are not a list.
        BadValue: Initial numbers or times that are not finite.

    Source:
        eq:eqmovadimV, eq:eqmovadimS; nonlinear: eq:Lag.
    """
    choose("solver", solver, SOLVERS)
    choose("model", model, MODELS)
    scheme = integrator.adaptive(**adaptive)
    if model == "nonlinear" and solver == "exact":
        raise BadName(
            "solver 'exact'",
            found="the nonlinear model",
            expected="solver 'diffrax'",
            remedy="The nonlinear model has no closed form.",
        )
    start = jnp.asarray(initial, dtype=float)
    ts = jnp.asarray(times, dtype=float)
    if start.shape != (4,) or ts.ndim != 1:
        raise BadShape(
            "initial, times",
            found=f"shapes {start.shape}, {ts.shape}",
            expected="shapes (4,), (times,)",
            remedy="Use jax.vmap over a batch.",
        )

    for name, values in (("initial", start), ("times", ts)):
        if not isinstance(values, Tracer) and not np.all(np.isfinite(np.asarray(values))):
            raise BadValue(name, found="not a finite number", expected="finite numbers", remedy="Check the values.")

    if equilibrium is not None:
        equilibrium = RestState(*(jnp.asarray(part, dtype=float) for part in equilibrium))
    how = scheme if solver == "diffrax" else None
    given = conditions.as_arrays(), coefficients.as_arrays(), equilibrium, start, ts
    V, S, outcome = _motion(*given, is_uniform(ts), model, how)
    channels: dict[str, Values] = {"V": V, "S": S}
    settings = (("model", f"oscillator, {model}"), ("solver", solver), *_written(coefficients))
    return Trace(ts, channels, conditions, outcome=outcome, settings=settings)


@eqx.filter_jit
def _motion(
    conditions: Reduced,
    coefficients: Coefficients,
    equilibrium: RestState | None,
    start: Float[Array, "4"],
    ts: Float[Array, " times"],
    even: bool,
    model: str,
    options: integrator.Scheme | None,
) -> tuple[Float[Array, " times"], Float[Array, " times"], Int[Array, ""]]:
    """V, S and how the motion ended; one program for all numbers."""
    state = buckled_state(conditions) if equilibrium is None else equilibrium
    rest = jnp.stack([state.volume, jnp.asarray(SPHERE_AREA, dtype=float)])
    converged = jnp.asarray(True)
    if options is None:
        system = matrices(coefficients, state, conditions)
        elapsed = ts - ts[0]
        pace = elapsed[-1] / max(ts.size - 1, 1)
        moves = (uniform_propagator(system, pace, ts.size) if even else propagator(system, elapsed)) @ start
    else:
        if model == "linear":
            A = state_matrix(matrices(coefficients, state, conditions))
            found = integrator.integrate(lambda t, y, A: A @ y, start, ts, options, args=A)
        else:
            field, args = _nonlinear_field, (rest, state, coefficients, conditions)
            found = integrator.integrate(field, start, ts, options, args=args)
        moves, converged = jnp.asarray(found.samples), found.worked

    outcome = jnp.where(converged, int(Outcome.OK), int(Outcome.NOT_CONVERGED))
    outcome = jnp.where(is_buckled(state), outcome, int(Outcome.NO_BUCKLED_STATE))
    V, S = undetermined(outcome != Outcome.OK, rest[:, None] + moves[:, :2].T)
    return V, S, outcome


def is_uniform(times: Values) -> bool:
    """Whether concrete times lie on an even grid, to the rounding of their decimals."""
    if isinstance(times, Tracer):
        return False
    steps = np.diff(np.asarray(times))
    return bool(steps.size and np.all(np.abs(steps - steps.mean()) < 1e-9 * np.abs(steps.mean())))


def _nonlinear_field(t, moved, args):
    rest, state, coefficients, conditions = args
    position, velocity = rest + moved[:2], moved[2:]
    return jnp.concatenate([velocity, acceleration(position, velocity, state, coefficients, conditions)])


def _written(coefficients: Coefficients) -> tuple[tuple[str, str], ...]:
    """The constants as text, where they are concrete numbers."""
    c = coefficients
    values = {"alpha1": c.alpha1, "alpha2": c.alpha2, "k_vs": c.k_vs, "beta1": c.beta1, "beta2": c.area_damping}
    if any(isinstance(value, Tracer) or np.ndim(value) for value in values.values()):
        return ()
    return (*((name, f"{float(value):.17g}") for name, value in values.items()), ("dipole", c.dipole))
