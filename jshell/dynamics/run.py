"""The compiled run: steps, samples, events, and nodes that follow the rim.

A run is a loop over samples of a loop over steps. What can end it (poles that
touch, a spoiled mesh) and what may happen in it (a dimple, its return to the
sphere, a steady state) is watched inside; a run that ended keeps its last good
state, steps a harmless one instead, and hands no derivative on.

Symbols    t time [time unit]   V, S, H, W volume, area, height, width   P inner pressure
Source     Mokbel et al. 2021, numerical method
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jshell.contour import (
    Meridian,
    WeakSpot,
    area,
    carry,
    clearance,
    gap,
    height,
    poles,
    regrade,
    rim_breaks,
    speed,
    transfer,
    volume,
    wall_profile,
    width,
)
from jshell.contour.splines import ParitySplines
from jshell.dynamics.losses import Losses, layer
from jshell.dynamics.motion import (
    Body,
    Loads,
    State,
    advance,
    initialise,
    resolved_motions,
    restart,
    solid_mass,
    velocity,
)
from jshell.errors import Outcome
from jshell.flow.second_order import slip_splines
from jshell.membrane import elastic_energy, gas_energy, wall
from jshell.membrane.energy import Area
from jshell.membrane.equilibrium import DIMPLE_DEPTH
from jshell.pressure import Pressure
from jshell.shell.elasticity import Scalar
from jshell.shell.parameters import Reduced
from jshell.shell.rest import gas_pressure

RADIUS = 0.5  # spectral radius at infinity: what a massless wall does faster than a step is damped
LARGEST_MOVE = 0.2  # no node may move further than this in a step [R0]
STRETCH = (0.2, 5.0)  # a meridional stretch outside is a spoiled mesh [-]
FOLLOW_EVERY = 0.5  # the nodes catch up with the rim this often [time unit]
BUCKLED = 0.05  # a pole this far below the top is a dimple; it has returned under DIMPLE_DEPTH [R0]
STILL = 1e-8  # kinetic energy of a shell called steady [E d R0²]
CALM = 6.0  # time over which it must stay so: about a period of the slow mode of R [time unit]
CHANNELS = (
    "V", "S", "H", "W", "x_front", "x_back", "v_front", "v_back", "V_rate", "P", "P_ext", "kinetic", "elastic", "gas",
    "work", "loss_layer", "lent_layer", "loss_bulk", "loss_wall", "loss_drag",
)  # fmt: skip


class Events(NamedTuple):
    """When things happened [time unit]; infinite where they did not. `stir` is the recent kinetic energy."""

    buckled: Float[Array, ""]
    returned: Float[Array, ""]
    steady: Float[Array, ""]
    ended: Float[Array, ""]
    stir: Float[Array, ""]


class RunState(NamedTuple):
    """All that a run needs to go on: where the nodes are, the state, and what happened."""

    nodes: Float[Array, "nodes"]
    state: State
    outcome: Int[Array, ""]
    events: Events


class Sample(NamedTuple):
    """One sample: the channels, whether it is good, and the shape where it was asked for."""

    channels: Float[Array, "... channels"]
    good: Array
    q: Float[Array, "... kept"]
    velocity: Float[Array, "... kept"]
    nodes: Float[Array, "... kept_nodes"]


class Setup(NamedTuple):
    """What a run is made of: discretisation, thickness profile there and its law, conditions, losses, density."""

    shape: Meridian
    profile: Float[Array, "points"]
    spot: WeakSpot | None
    conditions: Reduced
    losses: Losses
    shell_density: Scalar
    area: Area | str


class Pace(NamedTuple):
    """Sampling and stepping: spacing of the samples, steps between two, whether the nodes follow, what is kept."""

    every: float
    inner: int
    follow: bool
    shapes: bool

    @property
    def stretch(self) -> int:
        """Samples between two moves of the nodes."""
        return max(1, round(FOLLOW_EVERY / self.every)) if self.follow else 1


class Schedule(NamedTuple):
    """What the outer pressure does over a run: at every step, at the end of every sample, and whether it rests there.

    Numbers, and not the law that they came from: every law then shares one compiled program.
    """

    loads: Loads
    after: Float[Array, "samples"]
    held: Array
    asked: Array

    def part(self, start: int, stop: int) -> "Schedule":
        """That of the samples from one number to another."""
        return jax.tree.map(lambda values: values[start:stop], self)


def schedule(protocol: Pressure, count: int, pace: Pace, asked: int) -> Schedule:
    """The outer pressure of a whole run of `count` samples, of which the first `asked` were asked for."""
    h = pace.every / pace.inner
    stage = h / (1 + RADIUS)

    def step(k, i):
        t = k * pace.every + i * h
        return Loads(protocol(t), protocol(t + stage), protocol(t + h))

    def sample(k):
        after = protocol(k * pace.every + pace.every)
        return after, protocol(k * pace.every + 2 * pace.every) == after

    numbers = jnp.arange(count)
    loads = jax.vmap(lambda k: jax.vmap(lambda i: step(k, i))(jnp.arange(pace.inner)))(numbers)
    return Schedule(loads, *jax.vmap(sample)(numbers), numbers < asked)


def body_of(setup: Setup, shape: Meridian) -> Body:
    """The body on a discretisation."""
    s, c = setup, setup.conditions
    if s.spot is not None:
        profile = wall_profile(shape, s.spot)
    elif shape is s.shape:
        profile = s.profile
    else:
        profile = jnp.interp(shape.angles, s.shape.angles, s.profile)
    solid = solid_mass(shape, profile, c.thickness, s.shell_density)
    return Body(
        shape,
        wall(shape, c, profile),
        c,
        layer(s.losses, c.viscosity),
        s.losses,
        solid,
        resolved_motions(shape),
        slip_splines(shape),
    )


@eqx.filter_jit
def begin(setup: Setup, q, u, pressure: Scalar) -> tuple[RunState, Float[Array, "channels"]]:
    """The beginning of a run, and its first sample."""
    body = body_of(setup, setup.shape)
    state = initialise(body, q, u, pressure, setup.area)
    # numbers of a set type, as the steps return them: a Python number's would have the steps compiled twice
    never, stirred = jnp.asarray(jnp.inf, dtype=float), jnp.asarray(1.0, dtype=float)
    events = Events(never, never, never, never, stirred)
    progress = RunState(setup.shape.nodes, state, jnp.asarray(int(Outcome.OK)), events)
    return progress, _sample(body, state, pressure, setup.area)


@eqx.filter_jit
def go_on(
    setup: Setup, progress: RunState, ahead: Schedule, first: Int[Array, ""], pace: Pace
) -> tuple[RunState, Sample]:
    """Take the samples of a schedule after the sample number `first`; whole stretches where the nodes follow."""
    count = ahead.after.shape[0]
    numbers = first + jnp.arange(count)
    if not pace.follow:
        return _stretch(setup, body_of(setup, setup.shape), progress, ahead, numbers, pace)

    def stretch(progress, part):
        ahead, numbers = part
        body, progress = _follow(setup, progress, ahead.loads.start[0, 0])
        return _stretch(setup, body, progress, ahead, numbers, pace)

    parts = jax.tree.map(lambda x: x.reshape((-1, pace.stretch, *x.shape[1:])), (ahead, numbers))
    progress, samples = jax.lax.scan(jax.checkpoint(stretch), progress, parts)
    return progress, jax.tree.map(lambda x: x.reshape((count, *x.shape[2:])), samples)


def _follow(setup: Setup, progress: RunState, pressure) -> tuple[Body, RunState]:
    """Move the nodes to where the rim is now, and the state with them."""
    old = regrade(setup.shape, progress.nodes)
    state = progress.state
    breaks = jax.lax.stop_gradient(rim_breaks(old, state.q))
    new = regrade(setup.shape, breaks)
    body = body_of(setup, new)
    q, u = transfer(state.q, old, new), carry(velocity(state, RADIUS), old, new)

    def remember(memory):
        # slip is odd about the poles, like r
        gram = (old.r_basis[0].T * old.weights[None]) @ old.r_basis[0]
        odd = jnp.linalg.solve(gram, (old.r_basis[0].T * old.weights[None]) @ memory)
        return ParitySplines(old.nodes, "odd", old.edge)(new.angles) @ odd

    memory = jax.vmap(remember)(state.memory) if state.memory.shape[0] else state.memory
    state = restart(body, q, u, memory, state.ledger, pressure, setup.area)
    earlier = carry(progress.state.earlier_stage, old, new)
    state = state._replace(stage=carry(progress.state.stage, old, new), earlier_stage=earlier)
    return body, progress._replace(nodes=breaks, state=state)


def _stretch(setup: Setup, body: Body, progress: RunState, ahead: Schedule, numbers, pace: Pace):
    h = pace.every / pace.inner
    harmless = progress.state

    def steps(carry, part):
        k, now = part

        def one(carry, loads):
            state, outcome = carry
            alive = outcome == Outcome.OK
            safe = jax.tree.map(lambda a, b: jnp.where(alive, a, b), state, harmless)
            following = advance(body, safe, loads, h, RADIUS, setup.area)
            outcome = jnp.where(alive, _end(body, state, following), outcome)
            state = jax.tree.map(lambda a, b: jnp.where(outcome == Outcome.OK, a, b), following, state)
            return (state, outcome), None

        # a step is computed again on the way back: the states between are all that is kept
        again = jax.checkpoint(one, prevent_cse=False)
        progress = carry
        begun = (progress.state, progress.outcome)
        ended, _ = jax.lax.scan(again, begun, now.loads)
        # samples after the last one asked for fill up a piece of usual length: the run has ended before them
        state, outcome = jax.tree.map(lambda a, b: jnp.where(now.asked, a, b), ended, begun)
        good = outcome == Outcome.OK
        channels = _sample(body, state, now.after, setup.area)
        channels = jnp.where(good, channels, jax.lax.stop_gradient(channels))
        t = k * pace.every + pace.every
        events = _watch(body, state, channels, progress.events, good, t, now.held, pace.every)
        events = jax.tree.map(lambda a, b: jnp.where(now.asked, a, b), events, progress.events)
        kept = (state.q, velocity(state, RADIUS), body.shape.nodes) if pace.shapes else (jnp.zeros(0),) * 3
        return RunState(progress.nodes, state, outcome, events), Sample(channels, good, *kept)

    return jax.lax.scan(steps, progress, (numbers, ahead))


def _end(body: Body, before: State, after: State) -> Int[Array, ""]:
    """What ends a run: a wall that touches itself, a spoiled mesh, numbers that ran away."""
    shape = body.shape
    curve = shape.at_points(after.q)
    stretch = speed(curve)
    finite = jnp.all(jnp.isfinite(after.q)) & jnp.all(jnp.isfinite(after.momentum))
    sound = (jnp.min(stretch) > STRETCH[0]) & (jnp.max(stretch) < STRETCH[1]) & (jnp.min(curve.r) > 0)
    moved = jnp.max(jnp.abs(after.q - before.q))
    spoiled = ~(finite & sound & (moved < LARGEST_MOVE))
    free = clearance(shape, after.q, body.wall.thickness, every=2)
    touching = ~(free > 0)
    return jnp.where(spoiled, Outcome.MESH, jnp.where(touching, Outcome.CONTACT, Outcome.OK))


def _watch(body: Body, state: State, channels, events: Events, good, t, held, every: float) -> Events:
    """Note what happened by now."""
    sunk = height(body.shape, state.q) - gap(body.shape, state.q)
    first = lambda before, now: jnp.where(jnp.isinf(before) & now & good, t, before)  # noqa: E731
    kinetic = channels[CHANNELS.index("kinetic")]
    stir = jnp.maximum(kinetic, events.stir * jnp.exp(-every / CALM * jnp.log(1 / STILL) / 2))
    buckled = first(events.buckled, sunk > BUCKLED)
    returned = first(events.returned, ~jnp.isinf(buckled) & (sunk < DIMPLE_DEPTH))
    ended = jnp.where(jnp.isinf(events.ended) & ~good, t - every, events.ended)
    return jax.lax.stop_gradient(Events(buckled, returned, first(events.steady, (stir < STILL) & held), ended, stir))


def _sample(body: Body, state: State, pressure, energy: Area | str) -> Float[Array, "channels"]:
    shape, q = body.shape, state.q
    u = velocity(state, RADIUS)
    V, slope = jax.value_and_grad(lambda q: volume(shape, q))(q)
    front, back = poles(shape, q)
    v_front, v_back = poles(shape, u)
    ledger = state.ledger
    numbers = (
        V,
        area(shape, q),
        height(shape, q),
        width(shape, q),
        front,
        back,
        v_front,
        v_back,
        slope @ u,
        gas_pressure(V, body.conditions),
        pressure,
        state.momentum @ u / 2,
        elastic_energy(shape, q, body.wall, energy),
        gas_energy(V, body.conditions),
        ledger.work,
        ledger.layer,
        ledger.stored,
        ledger.bulk,
        ledger.wall,
        ledger.drag,
    )
    return jnp.stack([jnp.asarray(number) for number in numbers])
