"""The intact sphere: printed form, energy, threshold."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.comparators import radial_frequencies
from jshell.shell import Reduced, sphere_energy, sphere_state
from jshell.shell.elasticity import SPHERE_VOLUME
from jshell.shell.rest import RestState
from jshell.shell.sphere import buckling_load, minnaert_frequency, sphere_frequency

THICK = Reduced(0.3, 0.9, 1.5, 0.0, 1.4, 0.4)


def test_sphere_frequency_is_the_printed_form():
    """eq:wsphere as printed, in volumes."""
    state = sphere_state(THICK)
    V, V0, P = float(state.volume), SPHERE_VOLUME, float(state.pressure)
    K_a, K_b = 1 / (2 * 0.6), 0.3**2 / (12 * (1 - 0.16))
    R = (V / V0) ** (1 / 3)
    bend = 4 * np.pi * K_b * (2 * V0 ** (1 / 3) - V ** (1 / 3))
    stretch = (36 * np.pi) ** (1 / 3) * K_a * V ** (1 / 3) * (2 * V ** (2 / 3) - V0 ** (2 / 3))
    printed = (3 * 1.4 * P + 4 / 3 * V ** (-2 / 3) * V0 ** (-2 / 3) * (bend + stretch)) / R**2
    assert float(sphere_frequency(state, THICK)) == pytest.approx(np.sqrt(printed), rel=1e-13)


def test_sphere_frequency_is_the_curvature_of_the_energy():
    state = sphere_state(THICK)

    def energy(V):
        gas = state.pressure * state.volume**1.4 / (0.4 * V**0.4)
        return gas + 1.5 * V + sphere_energy(jnp.cbrt(V / SPHERE_VOLUME), 0.3, 0.4)

    R = jnp.cbrt(state.volume / SPHERE_VOLUME)
    stiffness = jax.grad(jax.grad(energy))(state.volume)
    np.testing.assert_allclose(sphere_frequency(state, THICK) ** 2, 4 * np.pi * R * stiffness, rtol=1e-12)


def test_stress_free_membrane_rings_as_the_usual_expression():
    thin = Reduced(1e-6, 0.9, 0.9)
    rest = RestState(jnp.asarray(SPHERE_VOLUME), jnp.asarray(0.9))
    assert float(sphere_frequency(rest, thin)) ** 2 == pytest.approx(3 * 1.4 * 0.9 + 4, rel=1e-10)


@pytest.mark.parametrize("d", [0.02, 0.22, 0.3])
def test_at_the_buckling_load_the_wall_bears_the_threshold(d):
    load = float(buckling_load(Reduced(d, 0.9, 0.9)))
    state = sphere_state(Reduced(d, 0.9, load))
    assert load - float(state.pressure) == pytest.approx(4 * d / 3, rel=1e-11)


def test_bubbles_ring_at_their_pressure():
    found = radial_frequencies(Reduced(0.22, 0.9, 1.6))
    assert float(found.marmottant) == pytest.approx(np.sqrt(3 * 1.4 * 1.6))
    assert float(found.minnaert) == pytest.approx(np.sqrt(3 * 1.4 * 0.9))
    assert float(minnaert_frequency(1.0, 1.0)) == pytest.approx(np.sqrt(3))
