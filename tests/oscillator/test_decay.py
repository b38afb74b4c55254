"""The decay that a run takes where nobody gives one: the law against the simulator's modes, its limits, its slopes."""

import importlib.util
import warnings
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

from jshell.errors import RangeWarning
from jshell.oscillator import (
    SOURCE,
    Coefficients,
    decay_by_law,
    decay_time,
    fitted_decay_time,
    matrices,
    ringing,
    simulate,
    simulated_decay,
    simulated_modes,
)
from jshell.oscillator.decay import FITTED, LARGEST_ERROR, MEDIAN_ERROR, Constants
from jshell.shell import Reduced, presets
from jshell.shell.rest import buckled_state

R = presets.R.conditions
SCRIPT = Path(__file__).parents[2] / "data" / "modes" / "fit_decay.py"


def test_r_which_is_not_in_the_table_rings_down_as_the_exact_modes_do():
    # the exact viscous liquid by three methods; the source's β1 says 85 for the second
    for viscosity, exact in ((0.0006, 16.143), (0.004, 7.180), (0.013, 4.679), (0.13, 2.502)):
        shell = Reduced(R.thickness, R.gas_pressure, R.outer_pressure, viscosity)
        assert float(fitted_decay_time(shell)) == pytest.approx(exact, rel=0.1), viscosity
    table = simulated_decay()
    assert not np.any(np.isclose(table.thickness, 0.22))


def test_the_stated_error_is_that_on_the_table():
    table = simulated_decay()
    rings = np.isfinite(table.tau[:, 0])
    shells = (table.thickness, table.gas_pressure, table.outer_pressure, table.viscosity)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RangeWarning)  # the table lies in the range that is stated
        tau = np.asarray(fitted_decay_time(Reduced(*(part[rings] for part in shells))))
    error = np.abs(tau / table.tau[rings, 0] - 1)
    assert rings.sum() == 427
    assert error.max() < LARGEST_ERROR
    assert np.median(error) == pytest.approx(MEDIAN_ERROR, abs=5e-4)
    assert np.quantile(error, 0.9) < 0.12
    assert error[table.viscosity[rings] < 0.02].max() < 0.22


def test_the_constants_are_those_that_the_script_finds():
    spec = importlib.util.spec_from_file_location("fit_decay", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    constants, viscosity, _ = script.fit()
    assert viscosity.size == 427
    # four digits are written down; 5e-4 is half of the last one of the smallest
    np.testing.assert_allclose(np.array(FITTED), np.array(constants), rtol=5e-4)
    assert constants._fields == Constants._fields


def test_the_two_tables_are_one_computation():
    modes, decay = simulated_modes(), simulated_decay()
    listed = decay.viscosity == 0.004
    both = listed & np.isin(decay.thickness, modes.thickness)
    np.testing.assert_array_equal(decay.tau[both], modes.tau[:, :2])
    assert np.all(decay.omega[both] < modes.omega[:, :2])  # the liquid's layer adds mass


def test_nothing_is_lost_without_viscosity_and_a_thin_layer_takes_its_root():
    at = lambda viscosity: float(fitted_decay_time(Reduced(0.1, 0.9, 1.3, viscosity).as_arrays()))  # noqa: E731
    with pytest.warns(RangeWarning, match="eta_hat"):
        # 1/τ ∝ √η̂; what is left of the saturation at η̂ = 1e-12 is 4e-6
        assert at(1e-12) / at(4e-12) == pytest.approx(2.0, rel=1e-5)
    assert np.isinf(at(0.0))
    assert float(ringing(Reduced(0.1, 0.9, 1.3, 0.0)).beta1) == 0.0


@pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")
def test_it_is_finite_positive_and_falls_with_viscosity_for_every_buckled_shell():
    d = jnp.array([1e-4, 0.02, 0.22, 0.5, 0.9])[:, None, None]
    load = jnp.array([1.3, 2.0, 8.0])[:, None]
    viscosity = jnp.geomspace(1e-12, 1e3, 40)
    d, load, viscosity = jnp.broadcast_arrays(d, load, viscosity)
    tau = np.asarray(fitted_decay_time(Reduced(d, jnp.full_like(d, 0.9), load, viscosity)))
    buckled = np.isfinite(tau)
    assert np.all(buckled == buckled[..., :1])  # a shell is buckled or not, whatever the liquid
    assert buckled[2, 1].all()
    assert np.all(tau[buckled] > 0)
    assert np.all(np.diff(tau[buckled[..., 0]]) < 0)


def test_a_sphere_has_no_decay_and_no_damping():
    sphere = Reduced(0.22, 0.9, 0.9, 0.004)
    assert np.isnan(fitted_decay_time(sphere))
    assert float(ringing(sphere).beta1) == 0.0
    assert decay_by_law(sphere).words == "none: the shell is not buckled"


def test_its_slopes_are_those_of_differences_and_none_is_nan():
    slope = jax.grad(lambda c: fitted_decay_time(c))
    found = slope(R.as_arrays())
    for name in ("thickness", "gas_pressure", "outer_pressure", "viscosity", "kappa"):
        at = float(getattr(R, name))
        step = 1e-5 * at
        moved = [Reduced(**(vars(R.as_arrays()) | {name: jnp.asarray(at + s)})) for s in (step, -step)]
        tau = [float(jax.jit(fitted_decay_time)(shell)) for shell in moved]
        # central differences of a smooth function: 1e-10 of truncation, 1e-11/1e-5 of rounding
        assert float(getattr(found, name)) == pytest.approx((tau[0] - tau[1]) / (2 * step), rel=1e-6), name
    for edge in (Reduced(0.22, 0.9, 1.6, 0.0), Reduced(0.22, 0.9, 0.9, 0.004)):
        assert all(np.isfinite(leaf) for leaf in jax.tree.leaves(slope(edge.as_arrays())))
        damping = jax.grad(lambda c: jnp.asarray(ringing(c).beta1))(edge.as_arrays())
        assert all(np.isfinite(leaf) for leaf in jax.tree.leaves(damping))


def test_a_batch_is_its_shells_one_by_one():
    d = jnp.array([0.05, 0.1, 0.2])
    batch = jax.jit(jax.vmap(lambda d: fitted_decay_time(Reduced(d, 0.9, 1.6, 0.004))))(d)
    single = [float(fitted_decay_time(Reduced(float(x), 0.9, 1.6, 0.004))) for x in d]
    np.testing.assert_allclose(batch, single, rtol=1e-13)


@pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")
def test_both_modes_ring_down_with_it():
    shell, tau = R.as_arrays(), float(fitted_decay_time(R))
    system = matrices(ringing(shell), buckled_state(shell), shell)
    # eigenvalues of the first-order form, by LAPACK
    zero, one = np.zeros((2, 2)), np.eye(2)
    inverse = np.linalg.inv(np.asarray(system.mass))
    A = np.block([[zero, one], [-inverse @ system.stiffness, -inverse @ system.damping]])
    np.testing.assert_allclose(scipy.linalg.eigvals(A).real, -1 / tau, rtol=1e-12)
    # the source's own constants let the same shell ring twelve times as long
    assert float(decay_time(SOURCE, R.viscosity)) == pytest.approx(85.0)


@pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")
def test_a_ring_of_r_is_over_when_the_simulators_is():
    times = np.linspace(0.0, 40.0, 401)

    def swing(constants: Coefficients) -> np.ndarray:
        trace = simulate(R, constants, initial=(-0.03, 0.0, 0.0, 0.0), times=times)
        return np.abs(np.asarray(trace["S"]) - 4 * np.pi)

    late = times > 30
    # e^(-30/7.2) = 1.6 %, and e^(-30/85) = 70 %
    assert swing(ringing(R))[late].max() < 0.03 * swing(ringing(R)).max()
    assert swing(SOURCE)[late].max() > 0.5 * swing(SOURCE).max()


def test_masses_are_kept_and_a_damping_of_their_own_is_not_read():
    given = Coefficients(3.0, 0.9, -0.2, beta1=7.0, beta2=1.0, dipole="printed")
    kept = ringing(Reduced(0.1, 0.9, 1.3, 0.004), given)
    assert (kept.alpha1, kept.alpha2, kept.k_vs, kept.beta2, kept.dipole) == (3.0, 0.9, -0.2, None, "printed")
    tau = float(fitted_decay_time(Reduced(0.1, 0.9, 1.3, 0.004)))
    assert float(decay_time(kept, 0.004)) == pytest.approx(tau, rel=1e-14)


def test_outside_its_range_it_answers_and_says_so():
    far = Reduced(0.4, 0.9, 2.2, 0.3, 1.2)
    with pytest.warns(RangeWarning, match=r"d_hat = 0.4 .*eta_hat = 0.3 .*kappa = 1.2"):
        assert 0 < float(fitted_decay_time(far)) < np.inf
    told = decay_by_law(far)
    assert len(told.outside) == 3
    assert "outside the law's range" in told.words
    assert decay_by_law(R).outside == ()
    assert told.record()["error"] == {"median": MEDIAN_ERROR, "largest": LARGEST_ERROR}


def test_the_words_name_the_origin_and_what_the_source_would_say():
    words = decay_by_law(R).words
    assert words.startswith("τ = 7.55 from a law fitted to the simulator's modes")
    assert "the source's β1 = 5.29 (τ = 85)" in words
