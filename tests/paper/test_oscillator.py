"""The source's numbers for the short model, and its misprints."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.oscillator import SOURCE, frequencies, squared_frequencies
from jshell.shell import Reduced, presets
from jshell.shell.sphere import buckling_load

R = presets.R.conditions
pytestmark = pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")


def test_reference_configuration():
    found = frequencies(R, SOURCE)
    assert float(found.pressure) == pytest.approx(1.496341, abs=5e-7)
    assert float(found.volume) == pytest.approx(2.913284, abs=5e-7)
    assert float(found.volume) / (4 * np.pi / 3) == pytest.approx(0.695495, abs=5e-7)
    assert float(found.omega_minus) == pytest.approx(0.988525, abs=5e-7)
    assert float(found.omega_plus) == pytest.approx(1.649904, abs=5e-7)
    assert float(found.omega_marmottant) == pytest.approx(np.sqrt(3 * 1.4 * 1.6))
    assert int(found.outcome) == 0


def test_eq_defw_as_printed():
    V, P, a1, a2, k, kappa = 2.913284, 1.496341, 3.6, 1.1, 0.23, 1.4
    pi = np.pi
    plus, minus = 9 * pi**2 * a1 + 32 * pi * a2 * kappa * V * P, 9 * pi**2 * a1 - 32 * pi * a2 * kappa * V * P
    root = np.sqrt(minus**2 + 2 * a1 * a2 * (48 * pi**2 * k) ** 2)
    printed = np.array([plus - root, plus + root]) / (16 * a1 * a2 * V**2)
    np.testing.assert_allclose(squared_frequencies(V, P, a1, a2, k, kappa=kappa), printed, rtol=1e-13)


@pytest.mark.parametrize("constants", [(4.40, 0.6, 0.344), (3.47, 0.8, 0.315), (3.09, 1.0, 0.238), (2.87, 1.2, 0.081)])
def test_many_constants_give_one_shape_the_same_two_frequencies(constants):
    # rest state of the computed shape, not of the plateau law; the constants are quoted to two or three digits
    w = jnp.sqrt(squared_frequencies(0.6992 * 4 * np.pi / 3, 1.4853, *constants))
    np.testing.assert_allclose(w, [1.028, 1.769], rtol=2e-3)


def test_softening_just_after_the_threshold():
    """Sphere just before over buckled just after: 4.53 and 2.51; Marmottant's law 1.76."""
    thin = Reduced(0.02, 0.4, 0.4)
    load = buckling_load(thin)
    found = frequencies(Reduced(0.02, 0.4, float(load)), SOURCE)
    ratios = [float(found.omega_sphere / w) for w in (found.omega_minus, found.omega_plus, found.omega_marmottant)]
    np.testing.assert_allclose(ratios, [4.53, 2.51, 1.76], atol=0.005)


def test_source_damping_read_with_the_right_prefactor():
    """E1: the 0.17 read with τ = 2 (α1/β1)/η is 0.68 with τ = ½ (α1/β1)/η."""
    assert SOURCE.alpha1 / SOURCE.beta1 == pytest.approx(4 * 0.17)


def test_pressure_limits_of_the_source_are_those_of_the_closed_form():
    slopes = jax.vmap(lambda P: squared_frequencies(2.9, P, 3.6, 1.1, 0.23))(jnp.array([1e5, 2e5]))
    assert float(slopes[1, 1] / slopes[0, 1]) == pytest.approx(2, rel=1e-4)
    assert float(slopes[1, 0] / slopes[0, 0]) == pytest.approx(1, rel=1e-4)
