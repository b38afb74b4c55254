"""The door: conditions and constants in, a trace or two frequencies out.

Symbols    V volume [R0³]   S area [R0²]   times [sqrt(ρ_f R0³/(E d))]
Valid for  as the rest law and the linear model say; results outside are marked, not hidden
Source     Mokbel et al. 2021: eq:eqmovadimV, eq:eqmovadimS, eq:defw, eq:limstab, eq:wsphere
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float, Int

from jshell import integrator
from jshell.errors import BadName, BadShape, BadValue, Outcome, choose
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
from jshell.shell.elasticity import SPHERE_AREA, SPHERE_VOLUME, moduli
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState, buckled_state
from jshell.shell.sphere import marmottant_frequency, sphere_frequency_at_load
from jshell.trace import Trace, Values

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
        outcome: An integer of `Outcome`: no_buckled_state; out_of_range where the slow mode is unstable.
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
    state = LAWS[law](conditions)
    c = coefficients
    K_A = moduli(conditions.thickness, conditions.poisson_ratio).area
    w2 = squared_frequencies(
        state.volume, state.pressure, c.alpha1, c.alpha2, c.k_vs, kappa=conditions.kappa, area_modulus=K_A
    )

    stable = w2[0] > 0
    slow = jnp.where(stable, jnp.sqrt(jnp.where(stable, w2[0], 1.0)), jnp.nan)
    outcome = jnp.where(
        is_buckled(state), jnp.where(stable, int(Outcome.OK), int(Outcome.OUT_OF_RANGE)), int(Outcome.NO_BUCKLED_STATE)
    )
    return Frequencies(
        omega_minus=slow,
        omega_plus=jnp.sqrt(w2[1]),
        volume=state.volume,
        pressure=state.pressure,
        stability_margin=stability_margin(state, c, conditions),
        stable=stable,
        omega_sphere=sphere_frequency_at_load(conditions),
        omega_marmottant=marmottant_frequency(conditions),
        outcome=outcome,
    )


def is_buckled(state: RestState) -> jax.Array:
    """Whether a rest state exists and holds less than the stress-free sphere."""
    return state.volume < SPHERE_VOLUME


def simulate(
    conditions: Reduced,
    coefficients: Coefficients,
    *,
    initial: Values | tuple[float, float, float, float],
    times: Values,
    equilibrium: RestState | None = None,
    solver: str = "exact",
    model: str = "linear",
    rtol: float = 1e-9,
    atol: float = 1e-11,
    adjoint: str = "reverse",
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
        rtol: Relative tolerance of the adaptive solver.
        atol: Absolute tolerance of the adaptive solver.
        adjoint: How the adaptive solver is differentiated: `reverse` (checkpoints) or `forward` (for Jacobians).

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
    choose("adjoint", adjoint, integrator.ADJOINTS)
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

    state = buckled_state(conditions) if equilibrium is None else equilibrium
    state = RestState(jnp.asarray(state.volume, dtype=float), jnp.asarray(state.pressure, dtype=float))
    rest = jnp.stack([state.volume, jnp.asarray(SPHERE_AREA, dtype=float)])
    converged = jnp.asarray(True)
    if solver == "exact":
        system = matrices(coefficients, state, conditions)
        moves = _fundamental(system, ts) @ start
    else:
        options = (rtol, atol, adjoint)
        if model == "linear":
            A = state_matrix(matrices(coefficients, state, conditions))
            moves, converged = integrate(lambda t, y, A: A @ y, start, ts, A, options)
        else:
            field, args = _nonlinear_field, (rest, state, coefficients, conditions)
            moves, converged = integrate(field, start, ts, args, options)

    outcome = jnp.where(converged, int(Outcome.OK), int(Outcome.NOT_CONVERGED))
    outcome = jnp.where(is_buckled(state), outcome, int(Outcome.NO_BUCKLED_STATE))
    channels: dict[str, Values] = {"V": rest[0] + moves[:, 0], "S": rest[1] + moves[:, 1]}
    settings = (("model", f"oscillator, {model}"), ("solver", solver), *_written(coefficients))
    return Trace(ts, channels, conditions, outcome=outcome, settings=settings)


def is_uniform(times: Values) -> bool:
    """Whether concrete times lie on an even grid, to the rounding of their decimals."""
    if isinstance(times, Tracer):
        return False
    steps = np.diff(np.asarray(times))
    return bool(steps.size and np.all(np.abs(steps - steps.mean()) < 1e-9 * np.abs(steps.mean())))


def _fundamental(system, ts: Float[Array, " times"]) -> Float[Array, "times 4 4"]:
    """Propagators from the first time to all."""
    if is_uniform(ts):
        return uniform_propagator(system, (ts[-1] - ts[0]) / (ts.size - 1), ts.size)
    return propagator(system, ts - ts[0])


def integrate(
    field: Callable, start: Float[Array, "..."], times: Float[Array, " times"], args, options: tuple[float, float, str]
) -> tuple[jax.Array, jax.Array]:
    """Adaptive integration from the first time through all; whether it reached the last."""
    rtol, atol, adjoint = options
    how = integrator.Options(rtol, atol, adjoint=adjoint)
    found = integrator.integrate(field, start, times, how, args=args)
    return jnp.asarray(found.samples), found.worked


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
