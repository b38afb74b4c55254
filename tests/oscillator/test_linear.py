"""Closed forms against eigenvalue solvers, limits and invariants."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
import scipy.linalg

from jshell.oscillator import SOURCE, Coefficients, random_shell
from jshell.oscillator.linear import (
    damped_modes,
    matrices,
    propagator,
    squared_frequencies,
    stability_margin,
    state_matrix,
    uniform_propagator,
)
from jshell.shell import Reduced
from jshell.shell.rest import RestState

CONDITIONS = Reduced(0.22, 0.9, 1.6, 0.004, 1.4, 0.3)
REST = RestState(jnp.asarray(2.9), jnp.asarray(1.5))


def _w2(state, c, conditions):
    K_A = 1 / (2 * (1 - conditions.poisson_ratio))
    return squared_frequencies(
        state.volume, state.pressure, c.alpha1, c.alpha2, c.k_vs, kappa=conditions.kappa, area_modulus=K_A
    )


def test_closed_form_equals_the_generalised_eigenvalues_at_any_poisson_ratio():
    system = matrices(SOURCE, REST, CONDITIONS)
    expected = scipy.linalg.eigh(system.stiffness, system.mass, eigvals_only=True)
    np.testing.assert_allclose(_w2(REST, SOURCE, CONDITIONS), expected, rtol=1e-13)


def test_slow_mode_vanishes_at_the_stability_limit():
    V = REST.volume
    P = 4 * jnp.pi * 0.23**2 / (1.4 * V)
    conditions = Reduced(0.22, 0.9, 1.6, 0.004)
    state = RestState(V, P)
    assert stability_margin(state, SOURCE, conditions) == pytest.approx(1.0, rel=1e-14)
    assert abs(_w2(state, SOURCE, conditions)[0]) < 1e-14
    assert _w2(RestState(V, 0.9 * P), SOURCE, conditions)[0] < 0


def test_slow_root_keeps_its_digits_at_large_pressure():
    P = 5e4
    with mpmath.workdps(50):
        V, pi = mpmath.mpf(2.9), mpmath.pi
        a = 4 * pi * mpmath.mpf(1.4) * P / (mpmath.mpf(3.6) * V)
        b = 9 * pi**2 / (8 * mpmath.mpf(1.1) * V**2)
        c = 18 * pi**4 * mpmath.mpf(0.23) ** 2 / (mpmath.mpf(3.6) * mpmath.mpf(1.1) * V**4)
        slow = float((a + b) / 2 - mpmath.sqrt(((a - b) / 2) ** 2 + c))
    assert float(squared_frequencies(2.9, P, 3.6, 1.1, 0.23)[0]) == pytest.approx(slow, rel=1e-15)


def test_frequencies_are_finite_in_single_precision():
    single = [jnp.float32(x) for x in (2.9, 5e4, 3.6, 1.1, 0.23)]
    w2 = squared_frequencies(*single, kappa=jnp.float32(1.4))
    assert w2.dtype == jnp.float32
    np.testing.assert_allclose(w2, squared_frequencies(*(float(x) for x in single)), rtol=1e-6)


def test_large_pressure_limits():
    V, P = 2.9, 1e8
    slow, fast = squared_frequencies(V, P, 3.6, 1.1, 0.23)
    assert float(slow) == pytest.approx(9 * np.pi**2 / (8 * 1.1 * V**2), rel=1e-7)
    assert float(fast) == pytest.approx(4 * np.pi * 1.4 * P / (3.6 * V), rel=1e-7)


def test_gradient_of_the_frequencies_equals_a_finite_difference():
    f = lambda x: squared_frequencies(2.9, 1.5, x[0], x[1], x[2])  # noqa: E731
    x, h = jnp.array([3.6, 1.1, 0.23]), 1e-6
    expected = np.stack([(f(x.at[i].add(h)) - f(x.at[i].add(-h))) / (2 * h) for i in range(3)], axis=1)
    np.testing.assert_allclose(jax.jacfwd(f)(x), expected, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("dipole", ["corrected", "printed"])
def test_equal_decay_makes_the_damping_a_multiple_of_the_mass(dipole):
    shell = random_shell(0)
    tau, eta = shell.tau, shell.conditions.viscosity
    c = shell.coefficients
    tied = Coefficients.with_decay_time(c.alpha1, c.alpha2, c.k_vs, tau, eta, dipole=dipole)
    system = matrices(tied, shell.state, shell.conditions)
    np.testing.assert_allclose(system.damping, 2 / tau * system.mass, rtol=1e-13)

    roots = damped_modes(system)
    w2 = _w2(shell.state, tied, shell.conditions)
    np.testing.assert_allclose(roots.real, -1 / tau, rtol=1e-10)
    np.testing.assert_allclose(roots.imag[jnp.array([0, 2])] ** 2 + 1 / tau**2, w2, rtol=1e-10)
    np.testing.assert_allclose(roots[1::2], roots[::2].conj(), rtol=1e-10)


def test_propagators_equal_scipys_exponential():
    c = Coefficients(3.6, 1.1, 0.23, 9.0, 3.0)
    system = matrices(c, REST, CONDITIONS)
    A = np.asarray(state_matrix(system))
    times = np.array([0.0, 0.3, 2.0, 17.0, 40.0])
    expected = np.stack([scipy.linalg.expm(A * t) for t in times])
    # forty time units: rounding grows with the number of squarings
    np.testing.assert_allclose(propagator(system, jnp.asarray(times)), expected, atol=1e-12)
    grid = uniform_propagator(system, 0.1, 401)
    np.testing.assert_allclose(grid[jnp.array([0, 3, 20, 170, 400])], expected, atol=1e-12)


def test_energy_is_conserved_without_damping():
    system = matrices(Coefficients(3.6, 1.1, 0.23), REST, CONDITIONS)
    y = uniform_propagator(system, 0.1, 300) @ jnp.array([0.1, -0.2, 0.05, 0.1])
    q, v = y[:, :2], y[:, 2:]
    energy = jnp.einsum("ti,ij,tj->t", v, system.mass, v) + jnp.einsum("ti,ij,tj->t", q, system.stiffness, q)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-11)


@pytest.mark.parametrize(("precision", "tolerance"), [("float64", 1e-9), ("float32", 1e-5)])
def test_frequencies_keep_their_digits_at_every_pressure(precision, tolerance):
    """Inner pressures 0.2 … 1e5 against arithmetic of 50 digits."""
    volume = np.asarray(0.7 * 4 * np.pi / 3, precision)
    pressures = np.geomspace(0.2, 1e5, 40).astype(precision)
    constants = [np.asarray(x, precision) for x in (3.6, 1.1, 0.1)]
    kappa = np.asarray(1.4, precision)
    area = np.asarray(1.0, precision)
    of = jax.jit(jax.vmap(lambda P: squared_frequencies(volume, P, *constants, kappa=kappa, area_modulus=area)))
    found = np.sqrt(np.asarray(of(pressures)))
    assert found.dtype == precision

    with mpmath.workdps(50):
        V, alpha1, alpha2, k = (mpmath.mpf(float(x)) for x in (volume, *constants))
        for row, pressure in zip(found, pressures, strict=True):
            a = 4 * mpmath.pi * mpmath.mpf(float(kappa)) * mpmath.mpf(float(pressure)) / (alpha1 * V)
            b = 9 * mpmath.pi**2 / (8 * alpha2 * V**2)
            c = 18 * mpmath.pi**4 * k**2 / (alpha1 * alpha2 * V**4)
            root = mpmath.sqrt((a - b) ** 2 / 4 + c)
            exact = [float(mpmath.sqrt((a + b) / 2 - root)), float(mpmath.sqrt((a + b) / 2 + root))]
            np.testing.assert_allclose(row, exact, rtol=tolerance)
