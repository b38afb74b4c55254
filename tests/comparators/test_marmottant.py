"""Marmottant's bubble against SciPy, its published benchmark, and the sphere against its closed frequency."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jshell.comparators import Marmottant, radial_run, sphere_run
from jshell.errors import BadValue, Outcome
from jshell.oscillator import Step
from jshell.oscillator.spectrum import harmonics
from jshell.shell import Reduced
from jshell.shell.sphere import sphere_frequency_at_load

# Marmottant et al. 2005: R0 0.975 µm, χ 1 N/m, κ_s 15e-9 kg/s, σ0 0, 2.9 MHz, 130 kPa
BUBBLE = Marmottant(0.975e-6, 1.0, 15e-9, 0.0, 0.073, 0.073, 1.095, 1000.0, 1480.0, 1e-3, 1e5)
FREQUENCY, AMPLITUDE, CYCLES = 2.9e6, 130e3, 16
TIMES = np.linspace(0, CYCLES / FREQUENCY, 3201)


def _tone(t):
    return -AMPLITUDE * jnp.sin(2 * jnp.pi * FREQUENCY * t)


@pytest.fixture(scope="module")
def benchmark():
    return radial_run(BUBBLE, _tone, times=TIMES)


@pytest.fixture(scope="module")
def by_scipy():
    """The same bubble written out in SI, with the published constants again."""

    def rate(t, y):
        R, v = y
        elastic = (R / 0.975e-6) ** 2 - 1
        sigma = 0.0 if elastic <= 0 else (0.073 if elastic >= 0.073 else elastic)
        gas = 1e5 * (R / 0.975e-6) ** (-3 * 1.095) * (1 - 3 * 1.095 * v / 1480)
        outer = 1e5 - 130e3 * np.sin(2 * np.pi * 2.9e6 * t)
        slowed = 2 * sigma / R + 4e-3 * v / R + 4 * 15e-9 * v / R**2
        return [v, (gas - outer - slowed - 1500 * v * v) / (1000 * R)]

    found = solve_ivp(rate, (0, TIMES[-1]), [0.975e-6, 0.0], method="DOP853", t_eval=TIMES, rtol=1e-11,
                      atol=[1e-18, 1e-11], max_step=1 / FREQUENCY / 100)  # fmt: skip
    return found.y[0]


@pytest.mark.long
def test_the_published_benchmark_agrees_with_an_independent_integration(benchmark, by_scipy):
    R0 = BUBBLE.radius
    assert benchmark.outcome == Outcome.OK
    assert not benchmark.broken
    np.testing.assert_allclose(benchmark.radius / R0, by_scipy / R0, atol=1e-6)
    late = TIMES > 8 / FREQUENCY
    mine, other = (np.asarray(r)[late] / R0 for r in (benchmark.radius, by_scipy))
    assert mine.max() == pytest.approx(other.max(), abs=1e-6)
    # below R_b the film bears nothing: how much of the time, and how deep, is its buckled plateau
    assert np.mean(mine < 1) == pytest.approx(np.mean(other < 1), abs=1e-9)
    assert mine.min() == pytest.approx(other.min(), abs=1e-6)
    heard = [harmonics(jnp.asarray(TIMES[late]), jnp.asarray(r), 2 * np.pi * FREQUENCY) for r in (mine, other)]
    np.testing.assert_allclose(heard[0], heard[1], atol=1e-6)


@pytest.mark.long
def test_the_bubble_compresses_more_than_it_expands(benchmark):
    """The benchmark's point, `compression-only` behaviour."""
    R = benchmark.radius / BUBBLE.radius
    assert 1 - R.min() > 3 * (R.max() - 1)


def test_the_tension_is_zero_elastic_or_waters():
    R = BUBBLE.radius * jnp.array([0.9, 1.0, 1.02, 1.2])
    np.testing.assert_allclose(BUBBLE.tension(R), [0, 0, 1.02**2 - 1, 0.073], atol=1e-15)
    assert BUBBLE.break_radius == pytest.approx(BUBBLE.radius * np.sqrt(1.073))


@pytest.mark.slow
def test_a_film_that_breaks_is_told_and_stays_broken():
    strong = radial_run(BUBBLE, lambda t: 2.5 * _tone(t), times=TIMES[:801])
    assert strong.outcome == Outcome.OK
    assert strong.broken
    assert np.all(np.isfinite(strong.radius))


@pytest.mark.slow
def test_small_oscillations_have_the_linear_frequencies():
    """Elastic film: about σ0 > 0; buckled: slightly compressed, the gas alone."""
    still = Marmottant(2e-6, 0.5, 0.0, 0.02, viscosity=0.0, sound_speed=1e9)
    t = np.linspace(0, 20 * 2 * np.pi / still.linear_angular_frequencies[0], 4001)
    run = radial_run(still, lambda t: jnp.where(t < 1e-7, 10.0, 0.0), times=t)
    spectrum = np.abs(np.fft.rfft((run.radius - run.radius.mean()) * np.hanning(t.size), 2**18))
    heard = 2 * np.pi * np.argmax(spectrum) / (2**18 * (t[1] - t[0]))
    assert heard == pytest.approx(still.linear_angular_frequencies[0], rel=2e-3)
    assert still.linear_angular_frequencies[1] == pytest.approx(np.sqrt(3 * 1.095 * 1e5 / 1000) / 2e-6, rel=1e-12)


def test_wrong_bubbles_are_refused():
    with pytest.raises(BadValue, match="radius"):
        Marmottant(-1e-6, 1.0)


def test_the_intact_sphere_rings_at_its_closed_frequency():
    conditions = Reduced(0.08, 0.9, 1.0)
    period = 2 * np.pi / float(sphere_frequency_at_load(conditions))
    run = sphere_run(conditions, Step(0.0), times=np.linspace(0, 10 * period, 401), initial=(1e-6, 0.0))
    assert int(run.outcome) == Outcome.OK
    moved = np.asarray(run.radius) - float(run.radius[0])
    # after ten periods it is back; a millionth of amplitude detunes by less than that
    assert abs(moved[-1]) < 1e-4 * np.ptp(moved)
    assert not np.isfinite(float(run.buckles))
    pushed = sphere_run(conditions, Step(0.5), times=np.linspace(0, 10 * period, 401))
    assert np.isfinite(float(pushed.buckles))
    assert set(pushed.trace().channels) == {"V", "S"}
