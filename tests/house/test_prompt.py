"""What the prompt shows of a value, and the verbs at the top."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jshell as js
from jshell.calibration import Estimate

SHORT = 400  # characters, a few lines of a terminal


def values(R, modes_R) -> list:
    times = np.linspace(0.0, 40.0, 400)
    wave = np.exp(-times / 10) * (np.cos(times) + np.cos(2 * times))
    trace = js.Trace(times, {"V": 3 + wave, "S": 12 + wave}, R)
    return [R, trace, js.signals.extract(trace, "V", start=0.0), modes_R.rest, modes_R]


@pytest.mark.long
def test_values_show_numbers_with_units_in_a_few_lines(R, modes_R):
    wanted = (
        ("thickness=0.22 [R0]", "outer_pressure=1.6 [E d/R0]"),
        ("400 samples", "t 0 … 40", "channels V S", "thickness=0.22", "ok"),
        ("ω− 1.00", "ω+ 2.00", "τ 10 [", "modes needed: two", "ok"),
        ("V/V0 0.699", "inner pressure 1.48", "[E d/R0]", "ok"),
        ("ω 1.0", "[√(E d/(ρ_f R0³))]", "τ ", "ok"),
    )
    for value, words in zip(values(R, modes_R), wanted, strict=True):
        shown = repr(value)
        assert len(shown) < SHORT
        for word in words:
            assert word in shown, (word, shown)


def test_a_laboratory_record_shows_hertz(R):
    times = np.linspace(0.0, 40.0, 400)
    wave = np.exp(-times / 10) * (np.cos(times) + np.cos(2 * times))
    trace = js.Trace(times, {"V": 3 + wave}, R, scales=js.Scales(1e-6, 1e5, 1e3))
    assert "[Hz]" in repr(js.extract(trace, "V", start=0.0))


@pytest.mark.parametrize("kind", [0, 1, 3, 4])
def test_what_is_traced_or_batched_shows_its_shape(kind, R, modes_R):
    value = values(R, modes_R)[kind]
    seen = []

    def look(traced):
        seen.append(repr(traced))
        return jax.tree.leaves(traced)[0]

    jax.jit(look)(jax.tree.map(jnp.asarray, value))
    batch = jax.tree.map(lambda leaf: jnp.stack([jnp.asarray(leaf)] * 2), value)
    seen.append(repr(batch))
    jax.vmap(look)(batch)
    # what JAX puts in the place of numbers while it takes a structure apart
    seen += [repr(jax.tree.map(lambda leaf, put=put: put, value)) for put in (None, object(), 0, True)]
    seen.append(repr(jax.eval_shape(lambda x: x, value)))
    assert all(text.startswith(type(value).__name__ + "(") for text in seen)
    assert max(map(len, seen)) < 2 * SHORT


def test_verbs_at_the_top_are_those_of_the_rooms():
    assert js.simulate is js.dynamics.simulate
    assert js.modes is js.dynamics.modes
    assert js.extract is js.signals.extract
    assert js.fit is js.calibration.fit_trajectories


def test_fits_show_their_constants_and_how_they_ended():
    pair = (Estimate("alpha1", 3.6, 0.1), Estimate("alpha2", 1.1, 0.2), Estimate("dV[1]", 0.1, 0.01))
    fitted = js.FitResult(
        "Strict fit of 1 trace", js.Outcome.OK, pair, (), np.eye(2), np.eye(2), ("alpha1", "alpha2"), np.zeros(10), 8.0,
        10, 2, False,
    )  # fmt: skip
    wanted = "alpha1 3.6 ± 0.1, alpha2 1.1 ± 0.2, reduced χ² 1, 10 data, ok"
    assert repr(fitted) == f"FitResult(Strict fit of 1 trace, {wanted})"


def test_a_batch_shows_medians_and_how_its_rows_ended():
    rows, none = np.tile([3.6, 1.1, 0.23, 8.0, np.nan], (3, 1)), np.zeros(3)
    outcome, misfit = np.array([0, 0, js.Outcome.STALLED]), np.array([False, True, False])
    batch = js.calibration.BatchResult(
        rows, rows, np.zeros((3, 5, 5)), rows[:, :2], np.zeros((3, 6)), rows[:, :2], outcome, none, none, misfit,
        np.zeros((3, 4)), none, none, none, (), False,
    )  # fmt: skip
    wanted = "3 rows, median alpha1 3.6, median alpha2 1.1, median k_vs 0.23, median tau 8, median beta1 nan, 1 misfits"
    assert repr(batch) == f"BatchResult({wanted}, 2 ok, 1 stalled)"
