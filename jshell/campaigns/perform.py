"""Doing one planned run: a plain importable function, for any engine.

What goes in and comes out can be pickled, and what comes out is all that is
kept: the findings are drawn from the record as it will be stored, rounded to
single precision, so that a reader of the files finds the same numbers.

Source     Mokbel et al. 2021, numerical method: ramp and hold, offset and kick, the sudden step on a sphere
"""

import importlib.metadata
import platform
import warnings
from dataclasses import dataclass, fields, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jshell.campaigns.findings import MODES, Findings
from jshell.campaigns.planned import Run
from jshell.comparators import sphere_run
from jshell.dynamics import Losses, Modes, OrderModes, kick, modes, offset, roundness, simulate, swell
from jshell.errors import JshellError, Outcome, RangeWarning
from jshell.membrane import rest
from jshell.shell.elasticity import SPHERE_VOLUME
from jshell.shell.parameters import Reduced
from jshell.shell.rest import sphere_state
from jshell.shell.sphere import sphere_frequency
from jshell.trace import Trace, Values

CHANNELS = ("V", "S", "H", "W", "x_front", "v_front")
SPHERE_LOSSES = Losses(stokes="none", bulk=True)  # a breathing wall slides nowhere: all its loss is the flow's own
KICKED = (1, 2)


@dataclass(frozen=True)
class Versions:
    """What a run was made with."""

    jshell: str
    python: str
    jax: str
    jaxlib: str
    numpy: str
    scipy: str


def versions() -> Versions:
    """Of this process."""
    return Versions(
        **{
            field.name: platform.python_version() if field.name == "python" else importlib.metadata.version(field.name)
            for field in fields(Versions)
        }
    )


@dataclass(frozen=True)
class Result:
    """A finished run, well or not.

    Attributes:
        run: What was asked.
        findings: What was found.
        versions: With what.
        times: (samples,) of the record; empty where nothing was run in time.
        channels: Channel to (samples,) values.
    """

    run: Run
    findings: Findings
    versions: Versions
    times: np.ndarray
    channels: dict[str, Values]

    @property
    def trace(self) -> Trace:
        """The record in single precision, under the problem it was made with, its offset included."""
        run, found = self.run, self.findings
        conditions = run.conditions
        if run.offset and found.V_e is not None:
            conditions = offset(conditions, found.V_e, run.offset)
        settings = (("campaign", run.key), ("kind", run.kind))
        return Trace(self.times, self.channels, conditions, outcome=Outcome[found.outcome.upper()], settings=settings)


def perform(run: Run) -> Result:
    """Do a run. What does not converge, touches or was asked outside its range is a result with that outcome."""
    nothing = np.zeros(0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RangeWarning)  # the ranges are those of the design; docs say what they mean
        try:
            if run.kind in ("step", "swell"):
                findings, trace = _sphere(run)
            else:
                findings, trace = _buckled(run)
        except JshellError as fault:
            refused = Findings(outcome=Outcome.OUT_OF_RANGE.word, reason=str(fault))
            return Result(run, refused, versions(), nothing, {})
    if trace is None:
        return Result(run, findings, versions(), nothing, {})
    return Result(run, findings, versions(), np.asarray(trace.times), dict(trace.channels))


def _buckled(run: Run) -> tuple[Findings, Trace | None]:
    """A run about the buckled branch: modes, and the snap or the kick in time."""
    mesh = {"elements": run.elements, "attached": run.attached}
    spot = run.weak_spot
    conditions = run.conditions.as_arrays()
    state = rest(conditions, weak_spot=spot, **mesh)
    if run.offset and int(state.outcome) == Outcome.OK:
        conditions = offset(conditions, state.volume, jnp.asarray(run.offset)).as_arrays()
    found, around = _modes(run, conditions, mesh)
    lossless = modes(conditions, count=MODES, liquid="ideal", weak_spot=spot, **mesh)
    outcome = Outcome(int(found.rest.outcome))
    findings = Findings(outcome=outcome.word, P_ext=float(np.asarray(conditions.outer_pressure)))
    if outcome == Outcome.OK:
        findings = findings.with_rest(found.rest).with_modes(found, lossless)
        if run.symmetry:
            findings = findings.with_symmetry(roundness(found.rest))
        if around is not None:
            findings = findings.with_azimuth(around)
    elif run.kind != "snap":
        return replace(findings, reason=outcome.advice), None
    if run.kind == "modes":
        return findings, None
    common = {"duration": run.duration, "every": run.every, "follow": run.follow}
    if run.kind == "snap":
        trace = simulate(run.conditions, ramp=run.ramp, weak_spot=spot, **mesh, **common)
        if "buckled_at" in dict(trace.settings) or int(trace.outcome) != Outcome.OK:
            return _with_modes(findings, trace, None, None)
        undimpled = replace(findings, reason="no dimple formed at the buckling pole: raise the outer pressure")
        return _with_modes(undimpled, trace, Outcome.NO_BUCKLED_STATE, None)
    start = kick(found, jnp.asarray(run.amplitude), KICKED)
    trace = simulate(conditions, start=found.rest, velocity=start, **common)
    return _with_modes(findings, trace, None, 0.0)


def _modes(run: Run, conditions: Reduced, mesh: dict[str, Any]) -> tuple[Modes, OrderModes | None]:
    """The vibrations of a run, of m = 0 and of the orders that were asked for."""
    if not run.azimuth:
        return modes(conditions, count=MODES, liquid=run.liquid, weak_spot=run.weak_spot, **mesh), None
    # of no liquid is meant: the exact one where it is known
    liquid = None if run.liquid == "exact" else run.liquid
    orders = range(run.azimuth + 1)
    every = modes(conditions, azimuth=orders, count=MODES, liquid=liquid, weak_spot=run.weak_spot, **mesh)
    axial = every.axial
    assert axial is not None  # m = 0 is among them
    return axial, every.around


def _sphere(run: Run) -> tuple[Findings, Trace]:
    """A run about the sphere: a sudden step of the outer pressure, or a breath about the compressed rest state."""
    conditions = run.conditions.as_arrays()
    state = sphere_state(conditions)
    common = {"duration": run.duration, "every": run.every, "losses": SPHERE_LOSSES}
    omega = sphere_frequency(state, conditions)
    if run.kind == "step":
        trace = simulate(conditions, ramp=0.0, weak_spot=run.weak_spot, elements=run.elements, **common)
    else:
        still = rest(conditions, branch="sphere", elements=run.elements)
        trace = simulate(conditions, start=still, velocity=swell(still, run.amplitude * omega), **common)
    findings = Findings(
        outcome=Outcome.OK.word,
        P_ext=run.Pext_hat,
        V_e=float(state.volume),
        P_e=float(state.pressure),
        omega_sphere=float(omega),
    )
    if run.kind == "step":
        times = run.every * np.arange(round(run.duration / run.every) + 1)
        released = (float(1 - np.cbrt(np.asarray(state.volume) / SPHERE_VOLUME)), 0.0)
        findings = findings.with_radial(sphere_run(conditions, _steady, times=times, initial=released).trace())
    return _with_modes(findings, trace, None, 0.0)


def _steady(t: jax.Array) -> jax.Array:
    """Nothing added to the outer pressure."""
    return jnp.zeros_like(t)


def _with_modes(
    findings: Findings, trace: Trace, instead: Outcome | None, start: float | None
) -> tuple[Findings, Trace]:
    """The findings of a record, and the record as it is kept."""
    ended = Outcome(int(trace.outcome)) if instead is None else instead
    if ended == Outcome.OK and not all(np.all(np.isfinite(values)) for values in trace.channels.values()):
        ended = Outcome.NOT_FINITE
    kept: dict[str, Values] = {name: np.asarray(trace[name], dtype=np.float32) for name in CHANNELS}
    trace = Trace(np.asarray(trace.times), kept, trace.conditions)
    reason = "" if ended == Outcome.OK else findings.reason or ended.advice
    findings = replace(findings, outcome=ended.word, reason=reason)
    return findings.with_record(trace, start), trace
