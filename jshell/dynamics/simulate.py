"""A shell in time: ramp the outer pressure, watch it snap and ring.

Symbols    t time [sqrt(ρ_f R0³/(E d))]   V, S, H, W volume, area, height, width   P inner pressure
Valid for  axial symmetry (real dimples lose it below d̂ ~ 0.05); Stokes layer at one reference frequency
Source     Mokbel et al. 2021, numerical method, with a potential flow and its Stokes layer for the liquid
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float, Int

from jshell.contour import WeakSpot, area, gap, height, poles, speed, volume, wall_profile, width
from jshell.dynamics.modes import vibrations
from jshell.dynamics.motion import Body, State, advance, launch, relax
from jshell.dynamics.protocol import Hold, Ramp
from jshell.errors import BadShape, BadValue, Outcome
from jshell.flow import single_frequency
from jshell.membrane import RestShape, elastic_energy, gas_energy, rest_shape, wall
from jshell.membrane.energy import Area, check_area
from jshell.membrane.rest import CONTACT_GAP, cached_meridian, raise_unless_ok
from jshell.shell.elasticity import Scalar
from jshell.shell.parameters import Reduced
from jshell.shell.rest import gas_pressure
from jshell.trace import Trace

LONGEST_STEP = 0.025  # [time unit]: a sixtieth of the period of mode 4 of R
RADIUS = 0.5  # spectral radius at infinity: 0.8 lets an undamped massless wall run away, 0 damps the modes
LARGEST_MOVE = 0.2  # no node may move further than this in a step [R0]
STRETCH = (0.2, 5.0)  # a meridional stretch outside is a spoiled mesh [-]
CHANNELS = ("V", "S", "H", "W", "x_front", "x_back", "v_front", "v_back", "P", "P_ext", "kinetic", "elastic", "gas")


def simulate(
    conditions: Reduced,
    *,
    duration: float = 70.0,
    every: float = 0.05,
    ramp: float = 25.0,
    start: RestShape | None = None,
    displacement: Float[Array, "coordinates"] | None = None,
    velocity: Float[Array, "coordinates"] | None = None,
    elements: int = 32,
    attached: float = 0.0,
    weak_spot: WeakSpot | None = None,
    stokes_frequency: Scalar | complex | None = None,
    step: float = LONGEST_STEP,
    area: Area | str = "current",
    throw: bool = False,
) -> Trace:
    """Simulate a shell: by default from the stress-free sphere, ramped to the outer pressure, then held.

    Differentiable and vmappable in the conditions and in the initial displacement and velocity.

    Args:
        conditions: The problem without units; its outer pressure is the final one.
        duration: Length of the run [time unit].
        every: Spacing of the samples [time unit].
        ramp: Time the outer pressure takes from P̂0 to P̂ext; 0 is a sudden step.
        start: Begin at this rest shape under constant outer pressure instead; its mesh, pad and weak spot are kept.
        displacement, velocity: (coordinates,) added to the start [R0], [R0/time unit]; only with `start`. A
            displaced wall first slides along itself until its tangential forces vanish, as a massless wall must.
        elements, attached: As in `jshell.membrane.rest`.
        weak_spot: Thinner wall that decides where the dimple starts; `WeakSpot()` by default.
        stokes_frequency: Reference frequency of the Stokes layer, real, or a mode's complex rate
            (`Modes.rate`) at which the layer is then exact; by default the geometric mean of the first two
            undamped modes of the final rest state.
        step: Longest time step; the samples' spacing is divided evenly.
        area: Which elastic energy.
        throw: Raise `NotOk` unless the run reached its end (outside `jit` only).

    Returns:
        A trace with channels V, S, H, W, x_front, x_back, v_front, v_back, P, P_ext, kinetic, elastic, gas.
        Its outcome is ok, contact, mesh or, where the reference frequency could not be found, what
        prevented that. A run that ended early holds its samples up to the event
        (under `jit`: repeats the last good sample to the end).

    Raises:
        BadValue, BadShape: Options that do not fit together or are outside their meaning.
    """
    check_area(area)
    _check_times(duration, every, step, ramp)
    conditions = conditions.as_arrays()
    if start is None:
        if displacement is not None or velocity is not None:
            raise BadValue(
                "displacement, velocity",
                found="no start",
                expected="a `start` to displace",
                remedy="Pass start=rest(...).",
            )
        shape = cached_meridian(elements, attached)
        profile = wall_profile(shape, WeakSpot() if weak_spot is None else weak_spot)
        q = shape.sphere
        protocol = Ramp(conditions.gas_pressure, conditions.outer_pressure, jnp.asarray(ramp, dtype=float))
    else:
        shape, profile, q = start.meridian, start.profile, start.coordinates
        protocol = Hold(conditions.outer_pressure)
    zero = jnp.zeros_like(q)
    move, kick = (zero if given is None else _coordinates(given, q) for given in (displacement, velocity))

    count = round(duration / every)
    inner = math.ceil(every / step - 1e-9)
    frequency, found = _reference_frequency(shape, conditions, profile, stokes_frequency, start, area)
    layer = single_frequency(conditions.viscosity, frequency)
    body = Body(shape, wall(shape, conditions, profile), conditions, layer)
    start_at = q if displacement is None else relax(body, q + move, conditions.outer_pressure, area)
    record = run(body, start_at, kick, protocol, every, count, inner, area)
    outcome = jnp.where(found != Outcome.OK, found, record.outcome)
    return _trace(
        conditions, record, outcome, every, count, shape, frequency, every / inner, protocol, weak_spot, throw
    )


class Record(NamedTuple):
    """What a compiled run returns: (samples, channels), the good samples among them, and the outcome."""

    samples: Float[Array, "samples channels"]
    good: Int[Array, ""]
    outcome: Int[Array, ""]


@eqx.filter_jit
def run(
    body: Body,
    q: Float[Array, "coordinates"],
    u: Float[Array, "coordinates"],
    protocol: Ramp | Hold,
    every: float,
    count: int,
    inner: int,
    area: Area | str,
) -> Record:
    """The compiled run: `count` samples after the first, `inner` steps between two."""
    h = every / inner
    stage = h / (1 + RADIUS)

    def steps(carry, t):
        def one(carry, k):
            state, outcome = carry
            now = t + k * h
            following = jax.lax.cond(
                outcome == Outcome.OK,
                lambda state: advance(body, state, protocol(now + stage), h, RADIUS, area),
                lambda state: state,
                state,
            )
            event = _event(body, state, following)
            outcome = jnp.where(outcome == Outcome.OK, event, outcome)
            state = jax.tree.map(lambda a, b: jnp.where(outcome == Outcome.OK, a, b), following, state)
            return (state, outcome), None

        (state, outcome), _ = jax.lax.scan(one, carry, jnp.arange(inner))
        return (state, outcome), (_sample(body, state, protocol(t + every), area), outcome == Outcome.OK)

    first = launch(body, q, u, protocol(jnp.asarray(0.0)), area)
    began = (first, jnp.asarray(int(Outcome.OK)))
    (_, outcome), (samples, good) = jax.lax.scan(jax.checkpoint(steps), began, every * jnp.arange(count))
    samples = jnp.concatenate([_sample(body, first, protocol(jnp.asarray(0.0)), area)[None], samples])
    return Record(samples, 1 + jnp.sum(good), outcome)


def _event(body: Body, before: State, after: State) -> Int[Array, ""]:
    """What ends a run: poles that touch, a spoiled mesh, numbers that ran away."""
    shape = body.shape
    curve = shape.at_points(after.q)
    stretch = speed(curve)
    finite = jnp.all(jnp.isfinite(after.q)) & jnp.all(jnp.isfinite(after.momentum))
    sound = (jnp.min(stretch) > STRETCH[0]) & (jnp.max(stretch) < STRETCH[1]) & (jnp.min(curve.r) > 0)
    moved = jnp.max(jnp.abs(after.q - before.q))
    spoiled = ~(finite & sound & (moved < LARGEST_MOVE))
    touching = gap(shape, after.q) < CONTACT_GAP
    return jnp.where(spoiled, Outcome.MESH, jnp.where(touching, Outcome.CONTACT, Outcome.OK))


def _sample(body: Body, state: State, pressure, energy: Area | str) -> Float[Array, "channels"]:
    shape, q = body.shape, state.q
    V = volume(shape, q)
    front, back = poles(shape, q)
    v_front, v_back = poles(shape, state.velocity)
    numbers = (
        V,
        area(shape, q),
        height(shape, q),
        width(shape, q),
        front,
        back,
        v_front,
        v_back,
        gas_pressure(V, body.conditions),
        pressure,
        state.momentum @ state.velocity / 2,
        elastic_energy(shape, q, body.wall, energy),
        gas_energy(V, body.conditions),
    )
    return jnp.stack([jnp.asarray(number) for number in numbers])


def _reference_frequency(shape, conditions, profile, given, start, energy):
    """The layer's reference frequency, and whether it could be found."""
    ok = jnp.asarray(int(Outcome.OK))
    if given is not None:
        oscillation = np.imag(given) if np.iscomplexobj(given) else given
        if not isinstance(given, Tracer) and not (np.isfinite(given) and oscillation > 0):
            raise BadValue(
                "stokes_frequency", found=repr(given), expected="above 0", remedy="Leave it out for the default."
            )
        return given, ok
    if not isinstance(conditions.viscosity, Tracer) and np.all(np.asarray(conditions.viscosity) == 0):
        return 1.0, ok
    final = rest_shape(shape, conditions, profile, "buckled", energy) if start is None else start
    pair = vibrations(final, conditions, 2, False, energy)
    return jnp.sqrt(pair.omega[0] * pair.omega[1]), jnp.max(pair.outcome)


def _coordinates(given, q):
    given = jnp.asarray(given)
    if given.shape != q.shape:
        raise BadShape(
            "displacement or velocity",
            found=f"shape {given.shape}",
            expected=f"shape {q.shape}",
            remedy="Give one number per coordinate.",
        )
    return given


def _check_times(duration, every, step, ramp):
    for name, value, low in (("duration", duration, 0.0), ("every", every, 0.0), ("step", step, 0.0)):
        if not (np.isfinite(value) and value > low):
            raise BadValue(
                name, found=repr(value), expected="a finite time above 0", remedy="70, 0.05 and 0.025 are usual."
            )
    if not isinstance(ramp, Tracer) and not (np.isfinite(ramp) and ramp >= 0):
        raise BadValue(
            "ramp", found=repr(ramp), expected="a finite time of at least 0", remedy="25 is slow enough for R."
        )
    if duration < every:
        raise BadValue(
            "every", found=f"{every:g}", expected=f"at most the duration {duration:g}", remedy="Sample more often."
        )


def _trace(conditions, record, outcome, every, count, shape, frequency, step, protocol, weak_spot, throw) -> Trace:
    samples, times = record.samples, every * jnp.arange(count + 1)
    settings = [("elements", str(shape.elements)), ("attached", repr(shape.attached)), ("step", repr(step))]
    if not isinstance(samples, Tracer):
        if throw:
            raise_unless_ok("simulation", outcome)
        samples, times = samples[: int(record.good)], times[: int(record.good)]
        settings.append(("stokes_frequency", str(np.asarray(frequency))))
    if isinstance(protocol, Ramp):
        spot = WeakSpot() if weak_spot is None else weak_spot
        settings += [("ramp", str(protocol.duration)), ("weak_spot", f"{spot.depth!r},{spot.width!r}")]
    channels = {name: samples[:, k] for k, name in enumerate(CHANNELS)}
    return Trace(times, channels, conditions, outcome=outcome, settings=tuple(settings))
