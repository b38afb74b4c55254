"""Loads, starts, files of a run, tolerance, batches: what a user may ask of a run."""

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.contour import regrade, volume
from jshell.dynamics import (
    Losses,
    Ramp,
    estimate_error,
    estimate_modes_error,
    kick,
    modes,
    offset,
    record,
    simulate,
    simulate_many,
    swell,
)
from jshell.dynamics.refinement import LEVELS, refine
from jshell.errors import BadFile, BadShape, BadValue, Outcome
from jshell.membrane import rest

SHORT = {"duration": 1.0, "elements": 16, "losses": Losses("frequency", frequency=1.2)}


@pytest.mark.long
def test_a_pressure_may_be_a_law_or_a_record(R):
    by_ramp = simulate(R, ramp=0.5, **SHORT)
    times = np.array([0.0, 0.5, 2.0])
    by_record = simulate(R, pressure=(times, np.array([0.9, 1.6, 1.6])), **SHORT)
    by_law = simulate(R, pressure=Ramp(start=0.9, stop=1.6, duration=0.5), **SHORT)
    np.testing.assert_allclose(by_record["V"], by_ramp["V"], rtol=1e-12)
    np.testing.assert_allclose(by_law["V"], by_ramp["V"], rtol=1e-12)


@pytest.mark.long
def test_a_forcing_adds_to_the_pressure(R):
    driven = simulate(R, ramp=0.5, forcing=lambda t: 0.1 * jnp.sin(t), **SHORT)
    steady = 0.9 + 0.7 * np.clip(np.asarray(driven.times) / 0.5, 0, 1)
    np.testing.assert_allclose(driven["P_ext"], steady + 0.1 * np.sin(driven.times), rtol=1e-12)


@pytest.mark.slow
def test_a_forcing_that_holds_what_is_traced_is_differentiated(R):
    def last(size):
        return simulate(R, ramp=0.5, forcing=lambda t: size * jnp.sin(t), **SHORT)["V"][-1]

    h = 1e-4
    slope = float(jax.jit(jax.jacfwd(last))(jnp.asarray(0.1)))
    # h² times a third derivative
    assert slope == pytest.approx(float(last(0.1 + h) - last(0.1 - h)) / (2 * h), rel=1e-6)


@pytest.mark.parametrize("record", [([0.0, 0.0], [1.0, 1.0]), ([0.0, 1.0], [1.0, np.nan])])
def test_a_bad_record_of_pressure_is_refused(R, record):
    with pytest.raises(BadValue, match="pressure"):
        simulate(R, pressure=record, **SHORT)
    with pytest.raises(BadShape, match="pressure"):
        simulate(R, pressure=([0.0, 1.0, 2.0], [1.0, 2.0]), **SHORT)


def test_an_offset_of_both_pressures_keeps_the_shape_and_stiffens_the_gas(R, rest_R, modes_R):
    stiffer = offset(R, rest_R.volume, 1.0)
    kept = rest(stiffer, elements=24)
    assert float(kept.volume) == pytest.approx(float(rest_R.volume), rel=1e-9)
    assert float(kept.pressure) == pytest.approx(float(rest_R.pressure) + 1.0, rel=1e-9)
    assert float(modes(stiffer, elements=24).omega[0]) > float(modes_R.omega[0])


def test_kicks_move_the_volume_as_they_say(modes_R, rest_R):
    u = kick(modes_R, 0.01, (1,))
    # the mode's dV is real and positive by convention: the velocity is ω times the swing
    swing = 0.01 * float(rest_R.volume)
    h = 1e-6
    shape, q = rest_R.meridian, rest_R.coordinates
    rate = float(volume(shape, q + h * u) - volume(shape, q - h * u)) / (2 * h)
    assert rate == pytest.approx(float(modes_R.Omega[0]) * swing, rel=1e-6)
    v = swell(rest_R, 0.2)
    rate = float(volume(shape, q + h * v) - volume(shape, q - h * v)) / (2 * h)
    assert rate == pytest.approx(0.2 * float(rest_R.volume), rel=1e-6)
    with pytest.raises(BadValue, match="modes"):
        kick(modes_R, 0.01, (9,))


@pytest.mark.long
def test_a_run_goes_on_from_its_file_bit_for_bit(R, tmp_path, monkeypatch):
    import importlib

    module = importlib.import_module("jshell.dynamics.simulate")
    monkeypatch.setattr(module, "REPORT", 1)
    longer = SHORT | {"duration": 4.0}
    whole = simulate(R, ramp=0.5, checkpoint=tmp_path / "whole.npz", **longer)

    class Killed(Exception):
        pass

    def die(fraction):
        if fraction > 0.5:
            raise Killed

    path = tmp_path / "run.npz"
    with pytest.raises(Killed):
        simulate(R, ramp=0.5, checkpoint=path, progress=die, **longer)
    seen = []
    again = simulate(R, ramp=0.5, checkpoint=path, progress=seen.append, **longer)
    assert seen == [1.0]
    for name in whole.channels:
        np.testing.assert_array_equal(np.asarray(again[name]), np.asarray(whole[name]))
    with pytest.raises(BadFile, match="another run"):
        simulate(R, ramp=0.6, checkpoint=path, **longer)
    path.write_bytes(b"junk")
    with pytest.raises(BadFile, match="checkpoint"):
        simulate(R, ramp=0.5, checkpoint=path, **longer)
    assert path.read_bytes() == b"junk"


@pytest.mark.long
def test_a_recorded_run_holds_its_shapes(R):
    motion = record(R, ramp=0.5, **SHORT)
    shape = motion.setup.shape
    assert motion.coordinates.shape == (21, shape.sphere.size)
    last = regrade(shape, motion.nodes[-1])
    assert float(volume(last, motion.coordinates[-1])) == pytest.approx(float(motion.trace["V"][-1]), rel=1e-12)


@pytest.mark.slow
def test_the_error_of_a_run_is_estimated_by_a_finer_one(R):
    found = estimate_error(R, elements=16, duration=2.0)
    assert 0 < found.volume < 1e-4
    assert (found.coarse.settings[0], found.fine.settings[0]) == (("elements", "16"), ("elements", "24"))


@pytest.mark.slow
def test_nodes_that_follow_the_rim_hear_the_same_snap(make_problem, snap):
    followed = simulate(make_problem(0.22, 0.9, 1.62, 0.004), duration=70.0, elements=24, follow=True)
    assert int(followed.outcome) == Outcome.OK
    np.testing.assert_allclose(followed["V"], snap["V"], atol=2e-3)


def test_refinement_stops_where_neighbours_agree_and_says_when_they_never_do():
    found = refine(lambda level: 1 + 10.0 / level.elements**2, lambda a, b: abs(a - b), 1e-2)
    assert found.reached
    assert found.level == LEVELS[2]
    lost = refine(lambda level: float(level.elements), lambda a, b: abs(a - b), 1e-2)
    assert not lost.reached
    with pytest.raises(BadValue, match="tolerance"):
        refine(lambda level: 0.0, lambda a, b: 0.0, -1.0)


@pytest.mark.slow
def test_a_tolerance_is_met(make_problem):
    problem = make_problem(0.22, 0.9, 1.62, 0.004)
    asked = simulate(problem, duration=40.0, tolerance=1e-3)
    settings = dict(asked.settings)
    assert float(settings["error_estimate"]) <= 1e-3
    fine = simulate(problem, duration=40.0, elements=48, step=1 / 160)
    assert np.abs(np.asarray(asked["V"] - fine["V"])).max() / (4 * np.pi / 3) < 1e-3


@pytest.mark.slow
def test_modes_at_the_usual_elements_are_converged(R):
    found = estimate_modes_error(R, elements=32, count=4, liquid="ideal")
    # asked: 5e-4
    assert found.omega.max() < 2e-5


def test_batches_refuse_what_only_a_single_run_can(R):
    with pytest.raises(BadValue, match="tolerance"):
        simulate_many(R, tolerance=1e-3)
    with pytest.raises(BadShape, match="conditions"):
        simulate_many(R)


@pytest.mark.slow
def test_a_second_batch_finds_its_program(make_problem):
    compiled = []

    def note(event, seconds, **_):
        if event.endswith("backend_compile_duration"):
            compiled.append(seconds)

    shells = make_problem(0.22, 0.9, np.array([1.6, 1.62]), 0.004)
    jax.monitoring.register_event_duration_secs_listener(note)
    try:
        first = simulate_many(shells, ramp=0.5, **SHORT)
        before = len(compiled)
        again = simulate_many(shells, ramp=0.5, **SHORT)
    finally:
        jax.monitoring.unregister_event_duration_listener(note)
    assert before > 0
    assert len(compiled) == before
    np.testing.assert_array_equal(np.asarray(first["V"]), np.asarray(again["V"]))


SPREAD = """
import numpy as np, jax, jshell as js
assert len(jax.devices()) == 2
shells = js.Reduced(0.22, 0.9, np.array([1.6, 1.62, 1.65]), 0.004)
options = dict(duration=1.0, ramp=0.5, elements=16, losses=js.dynamics.Losses("frequency", frequency=1.2))
many = js.dynamics.simulate_many(shells, **options)
one = js.dynamics.simulate_many(shells, devices=jax.devices()[:1], **options)
assert many["V"].shape == (3, 21)
np.testing.assert_allclose(many["V"], one["V"], rtol=1e-12)
print("same")
"""


@pytest.mark.slow
def test_a_batch_is_the_same_on_two_devices():
    import os

    flags = os.environ.get("XLA_FLAGS", "") + " --xla_force_host_platform_device_count=2"
    environment = os.environ | {"XLA_FLAGS": flags}
    done = subprocess.run([sys.executable, "-c", SPREAD], env=environment, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "same", done.stderr[-2000:]


@pytest.mark.slow
def test_a_lane_that_ends_leaves_the_others_and_hands_on_no_derivative(make_problem):
    import equinox as eqx
    import jax

    # the second shell is crushed, the first snaps
    options = {"duration": 12.0, "ramp": 1.0, "elements": 16, "losses": Losses("frequency", frequency=1.2)}
    pressures = jnp.array([1.62, 3.2])
    problem = make_problem(0.22, 0.4, 1.62, 0.004)
    run = lambda P: simulate(eqx.tree_at(lambda c: c.outer_pressure, problem, P), **options)  # noqa: E731
    traces = jax.jit(jax.vmap(run))(pressures)
    assert int(traces.outcome[1]) in (Outcome.CONTACT, Outcome.MESH)
    assert bool(jnp.all(jnp.isfinite(traces["V"])))
    alone = run(pressures[0])
    if int(alone.outcome) == Outcome.OK:
        np.testing.assert_allclose(traces["V"][0], alone["V"], rtol=1e-9)
    last = jax.jit(jax.vmap(jax.grad(lambda P: run(P)["V"][-1])))(pressures)
    assert bool(jnp.all(jnp.isfinite(last)))
    assert float(last[1]) == 0.0
