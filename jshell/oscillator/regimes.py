"""Buckling and unbuckling in time: the shell follows its pressure through both states.

A sphere obeys its own radial equation until its wall bears the classical
threshold ΔP_b; then it is the buckled oscillator. That one lasts until its
volume reaches the one at which the buckled branch meets the sphere's (see
`unbuckling`); then it is a sphere again. Volume and its rate carry over,
since the liquid far away feels V̇ and bears no jump; the area starts from the
sphere's. The elastic energy set free or taken up at a switch is not radiated.

Symbols    V volume [R0³]   S area [R0²]   R radius [R0]   P_ext outer pressure [E d/R0]
Valid for  the short model around one buckled rest state: far from it the wall's energy is an extrapolation
Source     Mokbel et al. 2021: section "Softening of buckled shells", eq:NRJsph; the unbuckling criterion is
           this project's
"""

from typing import Any, NamedTuple, Unpack

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from jshell import integrator
from jshell.errors import Outcome, choose
from jshell.oscillator.coefficients import Coefficients
from jshell.oscillator.drag import VISCOUS, Drag
from jshell.oscillator.drive import _as_arrays, _needs_viscosity, _spacing
from jshell.oscillator.fixed import ENDINGS
from jshell.oscillator.motion import Driven
from jshell.oscillator.simulate import is_buckled
from jshell.oscillator.unbuckling import borne, unbuckling_volume
from jshell.pressure import Pressure
from jshell.scalar_root import root_of
from jshell.shell.breathing import Pressures, radial_acceleration
from jshell.shell.elasticity import SPHERE_AREA, SPHERE_VOLUME, moduli
from jshell.shell.parameters import Number, Reduced
from jshell.shell.rest import RestState, buckled_state, gas_pressure, sphere_state
from jshell.shell.unbuckling import buckling_volume, wall_pressure
from jshell.trace import Trace, Values

SPHERE, BUCKLED = 0, 1
MOST_SWITCHES = 400


class Switch(NamedTuple):
    """One buckling or unbuckling: when, at which outer pressure, at which volume."""

    time: float
    outer_pressure: float
    volume: float
    buckles: bool


class Thresholds(NamedTuple):
    """Outer pressures and volumes at which a slowly loaded shell changes state [E d/R0], [R0³]."""

    buckling_pressure: float | jax.Array
    buckling_volume: float | jax.Array
    unbuckling_pressure: float | jax.Array
    unbuckling_volume: float | jax.Array


class Trajectory(eqx.Module):
    """How a shell followed its pressure.

    Attributes:
        trace: Channels V, S, P_ext, and `buckled` (1 or 0).
        switches: Every change of state, in order.
        thresholds: Where a slow load would change it.
        outcome: ok, not_converged, out_of_range or contact.
        accepted, rejected: Steps of the adaptive solver, all segments together.
    """

    trace: Trace
    switches: tuple[Switch, ...] = eqx.field(static=True)
    thresholds: Thresholds = eqx.field(static=True)
    outcome: Outcome = eqx.field(static=True)
    accepted: int = eqx.field(static=True)
    rejected: int = eqx.field(static=True)


def thresholds(conditions: Reduced, coefficients: Coefficients, equilibrium: RestState | None = None) -> Thresholds:
    """Where the states of a slowly loaded shell end.

    The buckled branch is that of the short model about its rest state; the
    plateau law alone would unbuckle at `shell.unbuckling.unbuckling_load`. Differentiable in all numbers.
    """
    V_b = buckling_volume(conditions)
    R_b = jnp.cbrt(V_b / SPHERE_VOLUME)
    state = buckled_state(conditions) if equilibrium is None else equilibrium
    V_u = unbuckling_volume(conditions, coefficients, state)
    out = gas_pressure(V_u, conditions) + borne(V_u, conditions, coefficients, state)
    load = gas_pressure(V_b, conditions) + wall_pressure(R_b, conditions)
    number = lambda x: x if isinstance(x, Tracer) else float(x)  # noqa: E731
    return Thresholds(number(load), number(V_b), number(out), number(V_u))


def simulate_regimes(
    conditions: Reduced,
    coefficients: Coefficients,
    forcing: Pressure,
    *,
    times: Any,
    drag: Drag = VISCOUS,
    begin: str = "sphere",
    equilibrium: RestState | None = None,
    **adaptive: Unpack[integrator.Adaptive],
) -> Trajectory:
    """The motion of a shell that may buckle and unbuckle.

    Args:
        conditions: The shell; its outer pressure is where the buckled rest state is taken, and what `forcing`
            is added to.
        coefficients: Constants of the short model.
        forcing: Added pressure, a function of time.
        times: (times,) increasing.
        drag: Of the buckled state. The sphere takes its viscous, wall and sound losses, the first in closed form;
            of an `equal_decay` law it takes the same decay time.
        begin: `sphere` or `buckled`, each at rest under the pressure at the first time.
        equilibrium: Rest state of the buckled shell; None takes it from the plateau law.
        rtol, atol, adjoint: Of the adaptive solver, as in `simulate`.

    Returns:
        The trajectory. After an end by flattening (out_of_range), emptying (contact) or too many switches
        (not_converged) the samples are NaN.

    Raises:
        BadName: No such state to begin with.
        BadShape, BadValue: Times that do not increase.
    """
    choose("begin", begin, ("sphere", "buckled"), noun="state")
    ts = jnp.asarray(times, dtype=float)
    _spacing(ts, times, "dopri8", None)
    if drag.liquid == "reynolds" or drag.layer is not None:
        _needs_viscosity(conditions)
    state = buckled_state(conditions) if equilibrium is None else equilibrium
    at = thresholds(conditions, coefficients, equilibrium)
    parts = _as_arrays((conditions, coefficients, state, drag, forcing))
    how = integrator.adaptive(**adaptive)._replace(most_steps=2**20)
    driven = Driven(parts[0], parts[1], RestState(*parts[2]), parts[3], parts[4])
    outer = np.asarray(jax.vmap(lambda t: conditions.outer_pressure + jnp.asarray(forcing(t), float))(ts))

    regime = SPHERE if begin == "sphere" else BUCKLED
    first = _first_state(driven, regime, outer[0])
    rows = np.full((len(ts), 5), np.nan)
    switches: list[Switch] = []
    outcome, accepted, rejected = Outcome.OK, 0, 0
    if not bool(is_buckled(state)) or not np.all(np.isfinite(np.asarray(jax.tree.leaves(first)))):
        outcome = Outcome.NO_BUCKLED_STATE
    now, y = float(ts[0]), first
    while outcome == Outcome.OK:
        ends = (jnp.asarray(at.buckling_volume), jnp.asarray(at.unbuckling_volume))
        found, last, stop, hit, worked, steps = _segment(driven, y, jnp.asarray(now), ts, ends, regime, how)
        accepted, rejected = accepted + int(steps[0]), rejected + int(steps[1])
        stop = float(stop)
        mine = (np.asarray(ts) >= now) & (np.asarray(ts) <= stop)
        rows[mine, :4] = np.asarray(found).T[mine]
        rows[mine, 4] = regime
        hit = np.asarray(hit)
        if not bool(worked):
            outcome = Outcome.NOT_CONVERGED
        if outcome != Outcome.OK or not hit.any():
            break
        if regime == BUCKLED and not hit[2]:
            outcome = ENDINGS[int(np.argmax(hit))]
            break
        outer_now = float(conditions.outer_pressure + jnp.asarray(forcing(jnp.asarray(stop)), float))
        switches.append(Switch(stop, outer_now, float(last[0]), regime == SPHERE))
        if len(switches) > MOST_SWITCHES or stop >= float(ts[-1]):
            outcome = Outcome.OK if stop >= float(ts[-1]) else Outcome.NOT_CONVERGED
            break
        y, now, regime = _switched(driven, last, regime), stop, 1 - regime

    channels: dict[str, Values] = {"V": rows[:, 0], "S": rows[:, 1], "P_ext": outer, "buckled": rows[:, 4]}
    settings = (("model", "oscillator, both states"), ("solver", f"dopri8, rtol {how.rtol:g}, atol {how.atol:g}"))
    trace = Trace(np.asarray(ts), channels, conditions, outcome=int(outcome), settings=settings)
    return Trajectory(trace, tuple(switches), at, outcome, accepted, rejected)


@eqx.filter_jit
def _first_state(driven: Driven, regime: int, outer: Number) -> tuple[jax.Array, ...]:
    """Leaves of a state at rest under an outer pressure."""
    c = driven.conditions
    loaded = c.replace(outer_pressure=jnp.asarray(outer))
    if regime == SPHERE:
        V = sphere_state(loaded).volume
        return (V, _sphere_area(V), jnp.zeros(()), jnp.zeros(()))
    modulus = moduli(c.thickness, c.poisson_ratio).area
    A_VS = driven.coefficients.k_vs / driven.state.volume
    V_e, P_e = driven.state

    def imbalance(V: jax.Array, args: Any) -> jax.Array:
        stretched = -A_VS / modulus * SPHERE_AREA * (V - V_e)
        return P_e * (V_e / V) ** c.kappa + (c.outer_pressure - P_e) - A_VS * stretched - outer

    V = root_of(imbalance, V_e)
    start = driven.begin((V - V_e, -A_VS / modulus * SPHERE_AREA * (V - V_e), 0.0, 0.0))
    return tuple(jax.tree.leaves(start))


def _switched(driven: Driven, last: list[jax.Array], regime: int) -> tuple[jax.Array, ...]:
    """Leaves of the other state, of the same volume and volume rate."""
    V, dV = last[0], last[2]
    R = jnp.cbrt(V / SPHERE_VOLUME)
    area, rate = _sphere_area(V), 2 * dV / R
    if regime == BUCKLED:
        return (V, area, dV, rate)
    start = driven.begin((V - driven.state.volume, area - SPHERE_AREA, dV, rate))
    return tuple(jax.tree.leaves(start))


def _sphere_area(V: jax.Array) -> jax.Array:
    return SPHERE_AREA * jnp.cbrt(V / SPHERE_VOLUME) ** 2


def _sphere_rate(driven: Driven, t: jax.Array, y: Any) -> list[jax.Array]:
    """(V̇, Ṡ, V̈, S̈) of the sphere, from its radial equation."""
    c, drag = driven.conditions, driven.drag
    V, dV = y[0], y[2]
    R = jnp.cbrt(V / SPHERE_VOLUME)
    speed = dV / (4 * jnp.pi * R**2)
    outer = jnp.asarray(c.outer_pressure + driven.forcing(t))
    extra = 2 / jnp.asarray(drag.tau) * R * speed if drag.liquid == "equal_decay" else 0.0
    acceleration = radial_acceleration(
        R,
        speed,
        Pressures(gas_pressure(V, c), wall_pressure(R, c) - extra, outer),
        viscosity=0.0 if drag.liquid in ("none", "equal_decay") else c.viscosity,
        kappa=c.kappa,
        wall_viscosity=drag.wall_viscosity,
        sound_speed=drag.sound_speed,
    )
    ddV = 4 * jnp.pi * (R**2 * acceleration + 2 * R * speed**2)
    return [dV, 8 * jnp.pi * R * speed, ddV, 8 * jnp.pi * (speed**2 + R * acceleration)]


@eqx.filter_jit
def _segment(driven: Driven, y: Any, now: jax.Array, ts: jax.Array, ends: Any, regime: int, how: integrator.Scheme):
    """One state's motion until it ends or the times do: samples, last state, when, which end, success, steps."""
    buckling, unbuckling = ends
    tree = jax.tree.structure(driven.begin())
    whole = lambda leaves: jax.tree.unflatten(tree, leaves)  # noqa: E731
    if regime == SPHERE:
        field = lambda t, y, args: _sphere_rate(driven, t, y)  # noqa: E731
        margins = [lambda t, y, args: y[0] - buckling]
    else:
        field = lambda t, y, args: jax.tree.leaves(driven.rate(t, whole(y)))  # noqa: E731
        margins = [lambda t, y, args, k=k: driven.margins(whole(y), unbuckling)[k] for k in range(len(ENDINGS))]
    found = integrator.integrate(field, list(y), ts, how, begin=now, margins=margins)
    steps = (found.accepted, found.rejected)
    return jnp.stack(found.samples[:4]), found.last, found.stop, found.hit, found.worked, steps
