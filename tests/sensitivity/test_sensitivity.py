"""Slopes, information, shares of variance and designs, each against another way."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.errors import BadName, BadValue, Outcome
from jshell.oscillator import SOURCE, Coefficients, frequencies, random_shell
from jshell.sensitivity import Range, design, elasticities, information, loaded, next_experiment, sobol
from jshell.sensitivity.local import INPUTS, OBSERVABLES, point, problem
from jshell.sensitivity.variance import indices
from jshell.shell import Reduced, presets
from jshell.shell.sphere import buckling_load

pytestmark = pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")
R = presets.R.conditions


@pytest.mark.long
@pytest.mark.parametrize("name", ["omega_minus", "omega_plus", "tau", "omega_sphere"])
def test_elasticities_are_those_of_richardson_differences(name):
    c = Coefficients(3.6, 1.1, 0.23, 5.3)
    shell = Reduced(0.22, 0.9, 1.6, 0.004, 1.4, 0.45)
    found = elasticities(name, shell, c)
    many = jax.jit(jax.vmap(lambda x: OBSERVABLES[name](*problem(x, c))))
    x = np.asarray(point(shell, c))
    h = 2e-3
    rows = [x * (1 + s * n * h * (np.arange(x.size) == k)) for k in range(x.size) for n in (1, 2, 4) for s in (1, -1)]
    f = np.asarray(many(jnp.asarray(np.array(rows)))).reshape(x.size, 3, 2)
    d1, d2, d4 = ((f[:, i, 0] - f[:, i, 1]) / (2 * n * h) / found.value for i, n in enumerate((1, 2, 4)))
    first, second = (4 * d1 - d2) / 3, (4 * d2 - d4) / 3
    np.testing.assert_allclose(found.elasticity, (16 * first - second) / 15, atol=1e-8)
    assert found.inputs == INPUTS


def test_elasticities_of_a_users_own_number_and_of_none():
    found = elasticities(lambda c, k: jnp.asarray(k.alpha1 * c.kappa**2), R, SOURCE)
    assert dict(zip(found.inputs, found.elasticity, strict=True))["kappa"] == pytest.approx(2)
    with pytest.raises(BadValue, match="omega_minus"):
        elasticities("omega_minus", Reduced(0.22, 0.9, 0.95, 0.004), SOURCE)
    with pytest.raises(BadName, match="observable"):
        elasticities("colour", R, SOURCE)


def test_one_shell_leaves_one_direction_free_and_another_pressure_closes_it():
    alone = information(R, SOURCE)
    assert alone.free.shape == (3, 1)
    assert len(alone.words) == 1
    assert np.all(np.isinf(alone.stderr))
    # along the free direction the frequencies do not move
    step = 1e-4 * alone.free[:, 0]
    there = Coefficients(*(np.array([3.6, 1.1, 0.23]) * np.exp(step)))
    moved = [frequencies(R, k) for k in (SOURCE, there)]
    for name in ("omega_minus", "omega_plus"):
        assert float(getattr(moved[1], name) / getattr(moved[0], name)) == pytest.approx(1, abs=1e-7)
    both = information(Reduced(0.22, 0.9, jnp.array([1.6, 2.5])), SOURCE)
    assert both.free.shape == (3, 0)
    assert np.all(np.isfinite(both.stderr))


def test_the_next_experiment_is_the_best_of_all_tried_in_turn():
    pressures = jnp.linspace(1.3, 4.0, 9)
    candidates = Reduced(jnp.full(9, 0.22), 0.9, pressures)
    done = Reduced(0.22, 0.9, jnp.array([1.6, 1.7]))
    found = next_experiment(candidates, SOURCE, done)
    volumes = []
    for P in pressures:
        told = information(Reduced(0.22, 0.9, jnp.array([1.6, 1.7, float(P)])), SOURCE)
        volumes.append(np.linalg.det(told.matrix))
    assert found.best == int(np.argmax(volumes))
    assert np.all(found.after <= found.before)
    assert float(found.conditions.outer_pressure) == pytest.approx(float(pressures[found.best]))


def at_threshold(c):
    return Reduced(c.thickness, c.gas_pressure, buckling_load(c), c.viscosity, c.kappa, c.poisson_ratio)


def test_sobol_indices_of_a_known_function():
    """f = x1 + 2 x2 of even inputs on (0, 1): shares 1/5 and 4/5, no interaction."""
    ranges = {"alpha1": Range(1.0, 2.0), "alpha2": Range(1.0, 2.0)}
    found = sobol(lambda c, k: jnp.asarray(k.alpha1 + 2 * k.alpha2), ranges, R, SOURCE, rows=256)
    for got, ends, true in zip(found.first, found.first_interval, (0.2, 0.8), strict=True):
        assert got == pytest.approx(true, abs=0.02)
        assert ends[0] <= true <= ends[1]
    np.testing.assert_allclose(found.total, [0.2, 0.8], atol=0.02)
    assert found.runs == 1024
    assert found.missing == 0


def test_sobol_indices_of_the_macroshells_against_salib():
    """ω- over Table 1's macroshells, loaded at their own thresholds, by SALib's own sampling and estimators."""
    pytest.importorskip("SALib", reason="no SALib: pip install SALib")
    from SALib.analyze import sobol as analyse
    from SALib.sample import sobol as sample

    table = presets.RANGES["macroshell"]
    ranges = {"thickness": Range(*table.d_hat, "log"), "gas_pressure": Range(*table.P0_hat, "log")}
    found = sobol("omega_minus", ranges, R, SOURCE, rows=1024, at=at_threshold, missing="drop")
    bounds = [[np.log(one.low), np.log(one.high)] for one in ranges.values()]
    task = {"num_vars": 2, "names": list(ranges), "bounds": bounds}
    X = sample.sample(task, 1024, calc_second_order=False, seed=1)
    one = jax.jit(jax.vmap(lambda x: frequencies(loaded(*jnp.exp(x), viscosity=0.004), SOURCE).omega_minus))
    Y = np.asarray(one(jnp.asarray(X)))
    assert np.all(np.isfinite(Y))
    other = analyse.analyze(task, np.array(Y), calc_second_order=False, seed=1)
    for i in range(2):
        for mine, ends, key in ((found.first, found.first_interval, "S1"), (found.total, found.total_interval, "ST")):
            assert ends[i, 0] <= other[key][i] <= ends[i, 1]
            assert abs(mine[i] - other[key][i]) <= other[key + "_conf"][i]


def test_runs_without_a_number_are_refused_with_their_count():
    ranges = {"outer_pressure": Range(0.8, 1.6)}  # below about 1 there is no buckled state
    with pytest.raises(BadValue, match=r"\d+ of 768 runs without a number"):
        sobol("omega_minus", ranges, R, SOURCE, rows=256)
    kept = sobol("omega_minus", ranges, R, SOURCE, rows=256, missing="drop")
    assert 0 < kept.rows < 256
    assert kept.missing > 0
    assert np.all(np.isfinite(kept.first_interval))


def test_the_callers_numbers_are_left_alone():
    values = np.random.default_rng(0).standard_normal((3, 64))
    before = values.copy()
    indices("x", ("alpha1",), values, 0, 0.95, "refuse")
    np.testing.assert_array_equal(values, before)


def test_wrong_ranges_are_refused():
    with pytest.raises(BadName, match="colour"):
        sobol("omega_minus", {"colour": Range(0, 1)}, R, SOURCE)
    with pytest.raises(BadValue, match="range"):
        Range(2.0, 1.0)
    with pytest.raises(BadValue, match="power of two"):
        sobol("omega_minus", {"alpha1": Range(1, 2)}, R, SOURCE, rows=100)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(20))
def test_designs_recover_twenty_random_shells(seed):
    random = np.random.default_rng(seed)
    d = np.exp(random.uniform(np.log(0.01), np.log(0.3)))
    P0 = np.exp(random.uniform(np.log(0.2), np.log(10.0)))
    c = Coefficients(3.6, 1.1, 0.23)
    wanted = jax.jit(lambda d, P0: frequencies(loaded(d, P0), c))(d, P0)
    found = design(float(wanted.omega_minus), float(wanted.omega_plus), c)
    assert found.outcome == Outcome.OK
    gaps = [max(abs(one.thickness / d - 1), abs(one.gas_pressure / P0 - 1)) for one in found.shells]
    assert min(gaps) < 1e-6  # where two shells ring alike both are given


@pytest.mark.long
@pytest.mark.parametrize("excess", [1.0, 1.02, 1.05, 1.1])
def test_both_shells_of_a_wish_are_found(excess):
    # the curves ω- = 0.8 and ω+ = 1.6 cross twice at each of these loads; the nearest grid points are all at one
    found = design(0.8, 1.6, SOURCE, excess=excess)
    assert sorted(shell.thickness > 0.1 for shell in found.shells) == [False, True]


@pytest.mark.long
def test_a_design_that_no_shell_meets_says_so():
    found = design(0.1, 50.0, SOURCE)
    assert found.outcome == Outcome.OUT_OF_RANGE
    assert found.shells == ()
    assert found.gap > 0.01
    with pytest.raises(BadValue, match="slow below fast"):
        design(2.0, 1.0, SOURCE)


def test_random_shells_have_information_of_full_rank_together():
    shells = [random_shell(seed).conditions for seed in range(6)]
    stacked = jax.tree.map(lambda *leaves: jnp.asarray(leaves, float), *shells)
    assert information(stacked, SOURCE).free.shape[1] == 0
