"""The door of the driven shell: conditions, constants and a pressure in, a response out.

Symbols    V volume [R0³]   S area [R0²]   p added pressure, p_s scattered pressure [E d/R0]
           x poles [R0]   t time [sqrt(ρ_f R0³/(E d))]
Valid for  a shell that stays buckled; a run that leaves that state ends with an outcome (see `regimes`)
Source     Mokbel et al. 2021: eq:Lag; scattered pressure ρ V̈/(4π r) of a source
"""

import math
import warnings
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float, Int

from jshell import integrator
from jshell.errors import BadShape, BadValue, NotOk, Outcome, RangeWarning, choose
from jshell.oscillator.coefficients import Coefficients
from jshell.oscillator.drag import VISCOUS, Drag
from jshell.oscillator.fixed import DIVERGED, ENDINGS, march
from jshell.oscillator.lagrangian import gas_energy, kinetic_energy, wall_energy
from jshell.oscillator.linear import squares
from jshell.oscillator.motion import Driven, OscillatorState, back_position, front_position, front_velocity
from jshell.oscillator.simulate import is_buckled, is_uniform
from jshell.oscillator.unbuckling import unbuckling_volume
from jshell.pressure import Pressure, Zero
from jshell.shell.elasticity import SPHERE_VOLUME, moduli
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState, buckled_state
from jshell.trace import Trace, Values

# Order of accuracy of each solver in fixed steps; rk4 is ours, the rest are diffrax's.
ORDERS = {"rk4": 4, **integrator.ORDERS}
THICKEST_LAYER = 0.1  # √(2η̂/ω) up to which the law of a thin layer is off by 15 % in τ at most, as in `modes` [R0]
_ENDED = np.array([int(ending) for ending in ENDINGS] + [int(Outcome.NOT_CONVERGED), int(Outcome.OK)])


class Response(eqx.Module):
    """How a shell answers a pressure: samples on the first axis, a batch behind it.

    Attributes:
        times: (times,).
        motion: The state at each time; NaN after the motion ended.
        driven: What was integrated.
        outcome: ok; out_of_range (the shell flattened), contact (it emptied), no_buckled_state (its dimple
            vanished), not_converged, unusable_data (a number given was not finite).
        ended: When the motion ended, infinite where it did not.
        accepted: Steps taken.
        rejected: Steps the adaptive solver tried and took back.
        solver: Its name, and its step where fixed.
    """

    times: Float[Array, " times"]
    motion: OscillatorState
    driven: Driven
    outcome: Int[Array, "*batch"]
    ended: Float[Array, "*batch"]
    accepted: Int[Array, "*batch"]
    rejected: Int[Array, "*batch"]
    solver: str = eqx.field(static=True)

    @property
    @eqx.filter_jit
    def pressure(self) -> Float[Array, "times *batch"]:
        """The added pressure."""
        return self._each(lambda t, y: jnp.broadcast_to(jnp.asarray(self.driven.forcing(t), float), jnp.shape(y.V)))

    @property
    @eqx.filter_jit
    def radius(self) -> Float[Array, "times *batch"]:
        """Radius of the sphere of equal volume [R0]."""
        return jnp.cbrt(self.motion.V / SPHERE_VOLUME)

    @property
    @eqx.filter_jit
    def front(self) -> Float[Array, "times *batch"]:
        """Displacement of the buckling pole from rest, outwards positive [R0]."""
        rest = self.driven.begin()
        return front_position((self.motion.V, self.motion.S)) - front_position((rest.V, rest.S))

    @property
    @eqx.filter_jit
    def back(self) -> Float[Array, "times *batch"]:
        """Displacement of the opposite pole from rest along the same axis [R0]."""
        rest = self.driven.begin()
        return back_position((self.motion.V, self.motion.S)) - back_position((rest.V, rest.S))

    @property
    @eqx.filter_jit
    def front_speed(self) -> Float[Array, "times *batch"]:
        """Velocity of the buckling pole."""
        return front_velocity((self.motion.V, self.motion.S), (self.motion.dV, self.motion.dS))

    @property
    @eqx.filter_jit
    def scattered(self) -> Float[Array, "times *batch"]:
        """Scattered pressure times distance, V̈/(4π) [E d]: divide by the distance in R0."""
        return self._each(lambda t, y: self.driven.rate(t, y).dV) / (4 * jnp.pi)

    @property
    @eqx.filter_jit
    def imbalance(self) -> Float[Array, "times *batch"]:
        """Energy gained since the start, less all work done, over the larger of what was put in and the start's.

        Zero but for the solver's error; needs `budget`.
        """
        y = self.motion
        if not self.driven.budget:
            raise BadValue("imbalance", found="no works", expected="a run with budget=True", remedy="Run it again so.")
        energy = self._each(lambda t, y: self.driven.energy(y))
        kinetic = self._each(lambda t, y: kinetic_energy((y.V, y.S), (y.dV, y.dS), self.driven.coefficients))
        size = jnp.maximum(jnp.nanmax(jnp.abs(y.lost), axis=0), jnp.nanmax(kinetic, axis=0))
        return (energy - energy[0] - y.lost - y.gained) / size

    def trace(self) -> Trace:
        """The response of one shell as a record, with every channel the registry has a name for."""
        if self.motion.V.ndim != 1:
            raise BadShape(
                "response",
                found=f"a batch {self.motion.V.shape[1:]}",
                expected="one run",
                remedy="Use lane().",
            )
        c = self.driven.conditions
        channels = _channels(self)
        settings = (("model", "oscillator, driven"), ("solver", self.solver))
        return Trace(self.times, channels, c, outcome=self.outcome, settings=settings)

    def lane(self, index: int) -> "Response":
        """One run of a batch, to be read by itself."""
        pick = lambda leaf: leaf[..., index] if jnp.ndim(leaf) else leaf  # noqa: E731
        driven = jax.tree.map(lambda leaf: pick(leaf) if jnp.shape(leaf) == self.outcome.shape else leaf, self.driven)
        motion = jax.tree.map(pick, self.motion)
        ends = (pick(self.outcome), pick(self.ended), pick(self.accepted), pick(self.rejected))
        return Response(self.times, motion, driven, *ends, self.solver)

    def check(self) -> "Response":
        """The same response.

        Raises:
            NotOk: A run that did not end well.
        """
        worst = Outcome(int(np.max(np.asarray(self.outcome))))
        if worst != Outcome.OK:
            lost = "no buckled state, or the drive led out of it: raise the outer pressure, or drive less"
            raise NotOk("drive", worst, lost if worst == Outcome.NO_BUCKLED_STATE else "")
        return self

    def _each(self, function: Any) -> jax.Array:
        return jax.vmap(function)(self.times, self.motion)


@eqx.filter_jit
def _channels(response: Response) -> dict[str, Values]:
    """Every channel of one run."""
    y, d = response.motion, response.driven
    c, q, v = d.conditions, (y.V, y.S), (y.dV, y.dS)
    each = lambda function: jax.vmap(lambda y: function((y.V, y.S)))(y)  # noqa: E731
    found: dict[str, Values] = {
        "V": y.V,
        "S": y.S,
        "R_eq": response.radius,
        "x_front": front_position(q),
        "x_back": back_position(q),
        "v_front": response.front_speed,
        "P": d.state.pressure * jnp.exp(c.kappa * jnp.log(d.state.volume / y.V)),
        "P_ext": c.outer_pressure + response.pressure,
        "p_scattered": response.scattered,
        "kinetic": kinetic_energy(q, v, d.coefficients),
        "elastic": each(lambda q: wall_energy(q, d.state, d.coefficients, c)),
        "gas": each(lambda q: gas_energy(q, d.state, c)),
    }
    return found | ({"work_drag": y.lost, "work_pressure": y.gained} if d.budget else {})


def drive(
    conditions: Reduced,
    coefficients: Coefficients,
    forcing: Pressure = Zero(),
    *,
    times: Values,
    drag: Drag = VISCOUS,
    initial: Any = (0.0, 0.0, 0.0, 0.0),
    equilibrium: RestState | None = None,
    solver: str = "dopri8",
    step: float | None = None,
    rtol: float = 1e-9,
    atol: float = 1e-11,
    budget: bool = True,
    adjoint: str = "reverse",
) -> Response:
    """The nonlinear motion of a buckled shell under any added pressure.

    Args:
        conditions: The shell and its steady load.
        coefficients: Constants of the short model.
        forcing: Added pressure [E d/R0], a function of time: one of `jshell.pressure`, or any callable.
        times: (times,) increasing; evenly spaced for `rk4`.
        drag: What takes energy away.
        initial: (ΔV, ΔS, ΔV̇, ΔṠ) at the first time.
        equilibrium: Rest state; None takes it from the plateau law.
        solver: A key of `ORDERS`. `rk4` carries a batch: numbers of shape (lanes,) anywhere above.
        step: Length of fixed steps; None is adaptive (for `rk4` the spacing of the times).
        rtol, atol: Tolerances of the adaptive solver.
        budget: Carry the work of drag and of the added pressure along.
        adjoint: How the adaptive solver is differentiated: `reverse` (checkpoints) or `forward` (for Jacobians).

    Returns:
        The response. A motion that ends early keeps its samples before that, says when and how.

    Raises:
        BadName: No such solver.
        BadShape, BadValue: Times or steps that are not what they should be; a Reynolds law without viscosity.

    Warns:
        RangeWarning: A Stokes layer thicker than a tenth of the radius, for which its law is not made.

    Source:
        eq:Lag with P_ext(t); drag as `drag` says.

    Example:
        >>> import numpy as np
        >>> from jshell import Reduced
        >>> from jshell.oscillator import SOURCE, Tone, drive
        >>> shell = Reduced(0.08, 0.9, 1.2, 0.004)
        >>> answer = drive(shell, SOURCE, Tone(0.01, 0.8), times=np.linspace(0.0, 50.0, 101))
        >>> print(int(answer.outcome), f"{float(np.max(answer.motion.V - answer.driven.state.volume)):.2f}")
        0 0.13
    """
    choose("solver", solver, ORDERS)
    ts = jnp.asarray(times, dtype=float)
    spacing = _spacing(ts, times, solver, step)
    if drag.liquid == "reynolds" or drag.layer is not None:
        _needs_viscosity(conditions)

    state = buckled_state(conditions) if equilibrium is None else equilibrium
    if drag.layer is not None:
        _warn_of_thick_layer(layer_thickness(conditions, coefficients, state))
    given = (conditions, coefficients, state, drag, forcing, tuple(initial))
    options = (rtol, atol, adjoint)
    return _run(_as_arrays(given), ts, jnp.asarray(spacing), _substeps(spacing, step), step, solver, options, budget)


def layer_thickness(conditions: Reduced, coefficients: Coefficients, state: RestState) -> float:
    """√(2η̂/ω-), the thickness of the Stokes layer of the slow mode [R0]; NaN where numbers are traced or many."""
    c = coefficients
    numbers = (*state, c.alpha1, c.alpha2, c.k_vs, conditions.kappa, conditions.thickness, conditions.poisson_ratio,
               conditions.viscosity)  # fmt: skip
    if any(isinstance(x, Tracer) or np.ndim(x) for x in numbers):
        return math.nan
    V, P, alpha1, alpha2, k_vs, kappa, thickness, ratio, viscosity = (float(x) for x in numbers)
    with np.errstate(all="ignore"):
        slow, _ = squares(V, P, alpha1, alpha2, k_vs**2, kappa, float(moduli(thickness, ratio).area))
        return float(np.sqrt(2 * viscosity / np.sqrt(slow)))


def _warn_of_thick_layer(thickness: float) -> None:
    """Warn where a layer is too thick for the law of a thin one."""
    if thickness > THICKEST_LAYER:
        warnings.warn(
            f"the Stokes layer of the slow mode is {thickness:.2g} R0 thick, its law is made for less than "
            f"{THICKEST_LAYER:g}: jshell.dynamics.modes(…, liquid='exact') says what the exact liquid does",
            RangeWarning,
            stacklevel=3,
        )


@eqx.filter_jit
def _run(
    given: Any,
    ts: jax.Array,
    spacing: jax.Array,
    substeps: int,
    step: float | None,
    solver: str,
    options: tuple[float, float, str],
    budget: bool,
) -> Response:
    """The run itself, compiled once per shape: numbers arrive as arrays."""
    finite, (conditions, coefficients, state, drag, forcing, initial) = _sound(given)
    driven = Driven(conditions, coefficients, RestState(*state), drag, forcing, budget)
    shape = batch_shape(driven, initial, ts[0])
    start = jax.tree.map(lambda part: jnp.broadcast_to(part, shape), driven.begin(initial))
    limit = unbuckling_volume(conditions, coefficients, driven.state)

    if solver == "rk4":
        run = march(driven, start, ts[0], spacing / substeps, ts.size - 1, substeps, limit)
        motion, ended = run.motion, run.ended
        accepted = jnp.full(shape, (ts.size - 1) * substeps)
        rejected = jnp.zeros_like(accepted)
        outcome = jnp.asarray(_ENDED)[jnp.where(run.ending < 0, DIVERGED + 1, run.ending)]
        words = f"rk4, {substeps} steps a sample"
    else:
        motion, ended, outcome, accepted, rejected = _adaptive(driven, start, ts, solver, step, options, limit)
        words = solver + (f", rtol {options[0]:g}, atol {options[1]:g}" if step is None else f", step {step:g}")

    outcome = jnp.where(is_buckled(driven.state), outcome, int(Outcome.NO_BUCKLED_STATE))
    usable = jnp.asarray(True)
    for mask in jax.tree.leaves(finite):
        usable = usable & (mask if mask.shape == shape else jnp.all(mask))
    absent = ~jnp.isfinite(given[2][0])  # no rest state: the law's word, not the caller's
    outcome = jnp.where(usable | absent, outcome, int(Outcome.UNUSABLE_DATA))
    outcome = jnp.where(absent, int(Outcome.NO_BUCKLED_STATE), outcome)
    outcome = jnp.broadcast_to(outcome, shape)
    ended = jnp.where(outcome == int(Outcome.UNUSABLE_DATA), ts[0], ended)
    failed = (outcome != int(Outcome.OK)) & ~jnp.isfinite(ended)
    past = (ts.reshape(-1, *(1,) * len(shape)) >= ended[None]) | failed[None]
    motion = jax.tree.map(lambda part: jnp.where(past, jnp.nan, part), motion)
    return Response(ts, motion, driven, outcome, ended, accepted, rejected, words)


def batch_shape(driven: Driven, initial: Any, t: jax.Array) -> tuple[int, ...]:
    """Shape of the batch that the numbers of a problem carry."""
    d = driven.drag
    given = [driven.conditions, driven.coefficients, driven.state, initial, d.tau, d.wall_viscosity, d.sound_speed]
    given += [d.reynolds.prefactor, d.reynolds.span, None if d.layer is None else d.layer.gamma]
    shapes = [leaf.shape for leaf in jax.tree.leaves(given)]
    return np.broadcast_shapes(*shapes, jax.eval_shape(driven.forcing, t).shape)


def _adaptive(driven: Driven, start: OscillatorState, ts, solver: str, step, options: tuple[float, float, str], limit):
    """One run by the integrator, its end located to the solver's accuracy."""
    if start.V.ndim:
        raise BadShape(
            "conditions",
            found=f"a batch {start.V.shape}",
            expected="one shell",
            remedy="Use jax.vmap, or rk4.",
        )
    rtol, atol, adjoint = options
    leaves, tree = jax.tree.flatten(start)  # diffrax wants arrays only; some of the state may be absent
    whole = lambda leaves: jax.tree.unflatten(tree, leaves)  # noqa: E731
    field = lambda t, y, args: jax.tree.leaves(driven.rate(t, whole(y)))  # noqa: E731
    ends = [lambda t, y, args, k=k: driven.margins(whole(y), limit)[k] for k in range(len(ENDINGS))]
    most = 2**20 if step is not None else 2**16
    how = integrator.Scheme(rtol, atol, solver, step, adjoint, event_tolerance=1e-10, most_steps=most)
    found = integrator.integrate(field, leaves, ts, how, margins=ends)
    any_hit = jnp.any(found.hit)
    outcome = jnp.where(any_hit, jnp.asarray(_ENDED)[jnp.argmax(found.hit)], int(Outcome.OK))
    outcome = jnp.where(found.worked, outcome, int(Outcome.NOT_CONVERGED))
    ended = jnp.where(any_hit, found.stop, jnp.inf)
    motion = whole(found.samples)
    counts = (jnp.asarray(found.accepted), jnp.asarray(found.rejected))
    return motion, ended, outcome, *counts


def _as_arrays(given: Any) -> Any:
    """The same tree with every number an array, so that one program serves all values."""
    number = lambda leaf: isinstance(leaf, float | int | np.generic | np.ndarray | jax.Array)  # noqa: E731
    return jax.tree.map(lambda leaf: jnp.asarray(leaf, float) if number(leaf) else leaf, given)


def _sound(given: Any) -> tuple[Any, Any]:
    """Where the tree holds finite numbers, and the tree with 1 in place of the others."""
    arrays, rest = eqx.partition(given, eqx.is_inexact_array)
    finite = jax.tree.map(jnp.isfinite, arrays)
    return finite, eqx.combine(jax.tree.map(lambda leaf: jnp.where(jnp.isfinite(leaf), leaf, 1.0), arrays), rest)


def _substeps(spacing: float, step: float | None) -> int:
    """Fixed steps between two samples."""
    return 1 if step is None or spacing == 0 else max(1, math.ceil(spacing / step - 1e-9))


def _needs_viscosity(conditions: Reduced) -> None:
    if not isinstance(conditions.viscosity, Tracer) and np.any(np.asarray(conditions.viscosity) <= 0):
        raise BadValue(
            "viscosity",
            found="0",
            expected="a viscosity above 0 for a Reynolds law or a Stokes layer",
            remedy="Give the viscosity, or another drag.",
        )


def _spacing(ts: jax.Array, given: Values, solver: str, step: float | None) -> float:
    """The even spacing of the times, or 0 where the solver does not need one."""
    if ts.ndim != 1 or ts.size < 2:
        raise BadShape("times", found=f"shape {ts.shape}", expected="(times,), at least 2", remedy="Give a list.")
    if step is not None and not (step > 0 and math.isfinite(step)):
        raise BadValue("step", found=f"{step!r}", expected="a time above 0", remedy="Choose a step.")
    if isinstance(given, Tracer):
        concrete = None
    else:
        concrete = np.asarray(given, dtype=float)
        if not np.all(np.isfinite(concrete)) or not np.all(np.diff(concrete) > 0):
            raise BadValue("times", found="times that do not increase", expected="increasing times", remedy="Sort.")
    if solver != "rk4":
        return 0.0
    if concrete is None or not is_uniform(concrete):
        raise BadValue(
            "times",
            found="times that are not evenly spaced numbers",
            expected="an even grid for rk4",
            remedy="Use numpy.linspace outside jit, or another solver.",
        )
    return float((concrete[-1] - concrete[0]) / (concrete.size - 1))
