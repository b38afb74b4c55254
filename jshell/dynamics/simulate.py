"""A shell in time: load it, watch it snap and ring.

Symbols    t time [sqrt(ρ_f R0³/(E d))]   V, S, H, W volume, area, height, width   P inner pressure
Valid for  axial symmetry: deep dimples of thin shells lose it, see `jshell.membrane.stability`
Source     Mokbel et al. 2021, numerical method; the liquid is a potential flow and its Stokes layer to second order
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from jshell.contour import WeakSpot, wall_profile
from jshell.dynamics.asymmetry import computed_symmetry, warn_of_asymmetry
from jshell.dynamics.checkpoint import Checkpoint
from jshell.dynamics.losses import Losses
from jshell.dynamics.refinement import Level, refine
from jshell.dynamics.run import (
    CHANNELS,
    Pace,
    RunState,
    Sample,
    Schedule,
    Setup,
    begin,
    body_of,
    go_on,
    schedule,
)
from jshell.dynamics.starts import relax
from jshell.dynamics.validity import TOLERATED, series_error, warn_of_thick_layer
from jshell.errors import BadShape, BadValue, Outcome
from jshell.membrane import RestShape
from jshell.membrane.energy import Area, check_area
from jshell.membrane.equilibrium import cached_meridian, raise_unless_ok
from jshell.pressure import Hold, Pressure, Ramp, Recorded, Sum
from jshell.shell.elasticity import SPHERE_VOLUME, Scalar
from jshell.shell.parameters import Number, Reduced, check
from jshell.sizes import count_of_samples, limited
from jshell.trace import Trace, Values

MOST_STEPS = 20_000_000  # of a run: three pressures are kept for each
LONGEST_STEP = 1 / 60  # [time unit]: a kicked shell keeps its energy to 1e-4 over ten periods
CHUNK = 20  # samples that one program takes: runs of any length share it
FILLED = 600  # steps: longer pieces are not filled up, a run of few samples far apart would take many times as long
REPORT = 10  # chunks between two reports of progress


class Motion(eqx.Module):
    """A run with its shapes.

    Attributes:
        trace: The channels in time.
        coordinates, velocity: (samples, coordinates) of the meridian at each sample [R0], [R0/time unit].
        nodes: (samples, nodes) breakpoints of the meridian at each sample [rad]; they move when they follow the rim.
        setup: What the run was made of; `setup.shape` is the meridian it started on.
    """

    trace: Trace
    coordinates: Float[Array, "samples coordinates"]
    velocity: Float[Array, "samples coordinates"]
    nodes: Float[Array, "samples nodes"]
    setup: Setup


@dataclass(frozen=True)
class RunOptions:
    """What `simulate` and `record` are options for; each is told at `simulate`."""

    duration: Any = 70.0
    every: Any = 0.05
    ramp: Any = 25.0
    pressure: Any = None
    forcing: Any = None
    start: RestShape | None = None
    displacement: Any = None
    velocity: Any = None
    elements: int = 32
    attached: Any = 0.0
    weak_spot: WeakSpot | None = None
    losses: Losses | None = None
    shell_density: Any = 0.0
    stokes_frequency: Any = None
    step: Any = LONGEST_STEP
    follow: bool = False
    area: Area | str = "current"
    symmetry: bool = False
    checkpoint: Path | str | None = None
    progress: Callable[[float], None] | None = None
    throw: bool = False


def simulate(
    conditions: Reduced,
    *,
    duration: float | int = 70.0,
    every: float | int = 0.05,
    ramp: Number = 25.0,
    pressure: Pressure | tuple | None = None,
    forcing: Pressure | None = None,
    start: RestShape | None = None,
    displacement: Float[Array, "coordinates"] | None = None,
    velocity: Float[Array, "coordinates"] | None = None,
    elements: int = 32,
    attached: float | int = 0.0,
    weak_spot: WeakSpot | None = None,
    losses: Losses | None = None,
    shell_density: Number = 0.0,
    stokes_frequency: Scalar | complex | None = None,
    step: float | int = LONGEST_STEP,
    follow: bool = False,
    tolerance: float | None = None,
    area: Area | str = "current",
    symmetry: bool = False,
    checkpoint: Path | str | None = None,
    progress: Callable[[float], None] | None = None,
    throw: bool = False,
) -> Trace:
    """Simulate a shell: by default from the stress-free sphere, ramped to the outer pressure, then held.

    Differentiable and vmappable in the conditions and in the initial displacement and velocity.

    Args:
        conditions: The problem without units; its outer pressure is the final one.
        duration: Length of the run [time unit].
        every: Spacing of the samples [time unit].
        ramp: Time the outer pressure takes from P̂0 to P̂ext; 0 is a sudden step.
        pressure: The outer pressure itself instead of ramp and hold: a function of time, or `(times, values)`.
        forcing: A function of time added to the outer pressure: a tone, a burst of `jshell.oscillator`.
        start: Begin at this rest shape under constant outer pressure instead; its mesh, pad and weak spot are kept.
        displacement, velocity: (coordinates,) added to the start [R0], [R0/time unit]; only with `start`. A
            displaced wall first slides along itself until its tangential forces vanish, as a massless wall must.
        elements, attached: As in `jshell.membrane.rest`; a pad's small elements make a run two or three times as long.
        weak_spot: Thinner wall that decides where the dimple starts; `WeakSpot()` by default.
        losses: What takes energy; by default the Stokes layer to second order, its first with its memory.
        shell_density: Density of the wall over the liquid's, ρ_s/ρ_f [-]; the source's shell has none.
        stokes_frequency: Short for `Losses("frequency", frequency=...)`: the layer at one frequency, cheaper.
        step: Longest time step; the samples' spacing is divided evenly.
        follow: Whether the nodes follow the rim of the dimple; thin shells then need few elements.
        tolerance: How far V may be from that of a finer mesh and step, over V0: picks elements and step itself,
            from the stress-free sphere only. A run that does not get there has the outcome not_converged.
        area: Which elastic energy.
        symmetry: Compute whether the dimple is round where it is deepest and at the end, and how fast it leaves its
            symmetry if not; otherwise the law for free, even walls says so (not under `jit`).
        checkpoint: A file in which the run is kept while it goes on; the same call continues from it.
        progress: Called with the fraction done, now and then.
        throw: Raise `NotOk` unless the run reached its end (outside `jit` only).

    Returns:
        A trace with the channels V, S, H, W, x_front, x_back, v_front, v_back, V_rate, P, P_ext, the energies
        kinetic, elastic, gas, and the energy ledger: work (of the outer pressure), loss_layer, lent_layer, loss_bulk,
        loss_wall, loss_drag. kinetic + elastic + gas + losses - work stays constant. Its outcome is ok, contact
        or mesh. A run that ended early holds its samples up to the event (under `jit`: repeats the last good
        sample to the end, without derivative). Its settings say when a dimple formed, returned, became steady.
        Where the layer is so thick that its series is off by more than 5 % in τ, a `RangeWarning` says so and gives
        the exact modes of the rest shape beside it; the settings keep both.

    Raises:
        BadValue, BadShape: Options that do not fit together or are outside their meaning.
    """
    given: dict[str, Any] = dict(locals())
    del given["conditions"], given["tolerance"]
    options = RunOptions(**given)
    if tolerance is None:
        return _run(conditions, options, shapes=False)[0]
    if start is not None or checkpoint is not None:
        raise BadValue(
            "tolerance",
            found="a start or a checkpoint as well",
            expected="a run from the stress-free sphere",
            remedy="Compare with a finer start yourself, or leave the tolerance out.",
        )

    def at(level: Level) -> Trace:
        chosen = replace(options, elements=level.elements, step=level.step, throw=False)
        return _run(conditions, chosen, shapes=False)[0]

    found = refine(at, volume_apart, tolerance)
    trace: Trace = found.result  # type: ignore[assignment]
    settings = (*trace.settings, ("tolerance", repr(tolerance)), ("error_estimate", repr(found.error)))
    ended_well = int(trace.outcome) == Outcome.OK
    outcome = Outcome.NOT_CONVERGED if ended_well and not found.reached else int(trace.outcome)
    if throw:
        raise_unless_ok("simulation", jnp.asarray(int(outcome)))
    return eqx.tree_at(lambda t: t.outcome, replace(trace, settings=settings), jnp.asarray(int(outcome)))


def volume_apart(coarse: Trace, fine: Trace) -> float:
    """Largest difference of V over V0 between two runs of one sampling; infinite unless both reached their end."""
    if int(coarse.outcome) != Outcome.OK or int(fine.outcome) != Outcome.OK:
        return float("inf")
    return float(np.max(np.abs(np.asarray(coarse["V"]) - np.asarray(fine["V"])))) / SPHERE_VOLUME


def record(conditions: Reduced, **options) -> Motion:
    """A run with the shape of the shell at each sample; takes the options of `simulate`.

    Example:
        >>> import jshell as js
        >>> motion = js.dynamics.record(js.presets.R.conditions, duration=0.5, elements=16)
        >>> motion.coordinates.shape == (11, motion.setup.shape.sphere.size)
        True
    """
    trace, sample, setup = _run(conditions, RunOptions(**options), shapes=True)
    kept = len(trace.times)
    return Motion(trace, sample.q[:kept], sample.velocity[:kept], sample.nodes[:kept], setup)


def _run(conditions: Reduced, options: RunOptions, *, shapes: bool) -> tuple[Trace, Sample, Setup]:
    area, start = options.area, options.start
    check_area(area)
    _check_times(options.duration, options.every, options.step, options.ramp)
    check("shell_density", options.shell_density, "a finite number of at least 0", lambda x: x >= 0)
    conditions = conditions.as_arrays()
    if start is None:
        if options.displacement is not None or options.velocity is not None:
            raise BadValue(
                "displacement, velocity",
                found="no start",
                expected="a `start` to displace",
                remedy="Pass start=rest(...).",
            )
        spot = WeakSpot() if options.weak_spot is None else options.weak_spot
        shape = cached_meridian(options.elements, options.attached, options.attached != 0.0)
        profile, q = wall_profile(shape, spot), shape.sphere
        steady = Ramp(
            start=conditions.gas_pressure,
            stop=conditions.outer_pressure,
            duration=jnp.asarray(options.ramp, dtype=float),
        )
    else:
        spot, shape, profile, q = None, start.meridian, start.profile, start.coordinates
        steady = Hold(conditions.outer_pressure)
    protocol = _protocol(steady, options.pressure, options.forcing)
    density = jnp.asarray(options.shell_density, dtype=float)
    setup = Setup(shape, profile, spot, conditions, _losses(options), density, area)
    zero = jnp.zeros_like(q)
    move, kick = (
        zero if given is None else _coordinates(given, q) for given in (options.displacement, options.velocity)
    )
    if options.displacement is not None:
        q = relax(body_of(setup, shape), q + move, protocol(jnp.asarray(0.0)), area)

    count = count_of_samples("duration, every", options.duration, options.every)
    inner = limited(
        "step", math.ceil(options.every / options.step - 1e-9), MOST_STEPS // count, "steps between samples"
    )
    pace = Pace(float(options.every), inner, bool(options.follow), shapes)
    # the last piece is run to its end and then cut: runs of any length share one program
    size = pace.stretch * max(1, CHUNK // pace.stretch)
    piece = size if size * inner <= FILLED else pace.stretch
    ahead = schedule(protocol, piece * math.ceil(count / piece), pace, count)
    # a law of the pressure may hold what is traced where nobody sees it: its numbers tell
    traced = any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((setup, q, kick, ahead)))
    # outside a trace one program serves all runs: those that keep no shapes have them and drop them
    pace = pace._replace(shapes=shapes or not traced)
    began, first = begin(setup, q, kick, protocol(jnp.asarray(0.0)))
    opening = Sample(first, jnp.asarray(True), *((q, kick, shape.nodes) if pace.shapes else (jnp.zeros(0),) * 3))
    if traced and options.checkpoint is None and options.progress is None:
        # one program of its own anyway; where the nodes follow the rim, whole stretches
        whole = ahead.part(0, pace.stretch * math.ceil(count / pace.stretch))
        state, samples = go_on(setup, began, whole, jnp.asarray(0), pace)
    else:
        state, samples = _in_chunks(setup, began, ahead, pace, size, options.checkpoint, options.progress)
    samples = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b[:count]]), opening, samples)
    trace = _trace(setup, state, samples, steady, pace, count, options.throw)
    if setup.losses.second and not isinstance(trace["V"], Tracer):
        error = series_error(trace)
        if error > TOLERATED:
            beside = warn_of_thick_layer(error, conditions, start, options.elements, shape.attached, spot, area)
            trace = replace(trace, settings=(*trace.settings, *beside))
    if options.symmetry:
        said = computed_symmetry(trace, conditions, start, options.elements, shape.attached, spot, str(area))
    else:
        said = warn_of_asymmetry(trace, conditions)
    trace = replace(trace, settings=(*trace.settings, *said))
    return trace, samples, setup


def _losses(options: RunOptions) -> Losses:
    """What takes energy, from the two options that say it."""
    if options.losses is None:
        return Losses() if options.stokes_frequency is None else Losses("frequency", frequency=options.stokes_frequency)
    if options.stokes_frequency is not None:
        raise BadValue(
            "stokes_frequency", found="losses as well", expected="one of the two", remedy="Give it inside `losses`."
        )
    return options.losses


def _protocol(steady: Pressure, pressure, forcing) -> Pressure:
    """The outer pressure in time, from what the user gave."""
    if isinstance(pressure, tuple | list):
        steady = Recorded(*(jnp.asarray(part, dtype=float) for part in pressure))
    elif pressure is not None:
        steady = pressure
    return steady if forcing is None else Sum((steady, forcing))


def _in_chunks(setup, began, ahead: Schedule, pace, size: int, checkpoint, report) -> tuple[RunState, Sample]:
    """The run in pieces of one length, kept in a file and reported now and then; the same numbers as in one piece."""
    file = None if checkpoint is None else Checkpoint(Path(checkpoint), (setup, ahead, pace))
    state, parts, done, count = began, [], 0, ahead.after.shape[0]
    if file is not None:
        state, parts, done = file.load(began, parts)
    while done < count:
        state, samples = go_on(setup, state, ahead.part(done, done + size), jnp.asarray(done), pace)
        parts.append(samples)
        # a run that ended has nothing more to say
        ended = not isinstance(state.outcome, Tracer) and int(state.outcome) != Outcome.OK
        done = count if ended else min(done + size, count)
        if done == count or done // size % REPORT == 0:
            if file is not None:
                file.save(state, parts, done)
            if report is not None:
                report(done / count)
    return state, jax.tree.map(lambda *pieces: jnp.concatenate([jnp.asarray(p) for p in pieces]), *parts)


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
                name, found=repr(value), expected="a finite time above 0", remedy="70, 0.05 and 1/60 are usual."
            )
    if not isinstance(ramp, Tracer) and not (np.all(np.isfinite(ramp)) and np.all(np.asarray(ramp) >= 0)):
        raise BadValue(
            "ramp", found=repr(ramp), expected="a finite time of at least 0", remedy="25 is slow enough for R."
        )
    if duration < every:
        raise BadValue(
            "every", found=f"{every:g}", expected=f"at most the duration {duration:g}", remedy="Sample more often."
        )


def _trace(setup: Setup, last: RunState, samples: Sample, steady, pace: Pace, count: int, throw: bool) -> Trace:
    numbers, times, shape = samples.channels, pace.every * jnp.arange(count + 1), setup.shape
    step = pace.every / pace.inner
    settings = [("elements", str(shape.elements)), ("attached", repr(shape.attached)), ("step", repr(step))]
    settings += [("follow", str(pace.follow)), ("stokes", setup.losses.stokes)]
    if setup.losses.stokes != "none":
        settings.append(("order", str(setup.losses.order)))
    if not isinstance(numbers, Tracer):
        if throw:
            raise_unless_ok("simulation", last.outcome)
        kept = int(jnp.sum(samples.good))
        numbers, times = numbers[:kept], times[:kept]
        if setup.losses.stokes == "frequency":
            settings.append(("stokes_frequency", str(np.asarray(setup.losses.frequency))))
        for name in ("buckled", "returned", "steady", "ended"):
            when = float(getattr(last.events, name))
            if np.isfinite(when):
                settings.append((f"{name}_at", repr(when)))
    if isinstance(steady, Ramp):
        settings.append(("ramp", str(steady.duration)))
    if setup.spot is not None:
        settings.append(("weak_spot", f"{setup.spot.depth!r},{setup.spot.width!r}"))
    channels: dict[str, Values] = {name: numbers[:, k] for k, name in enumerate(CHANNELS)}
    return Trace(times, channels, setup.conditions, outcome=last.outcome, settings=tuple(settings))
