"""Energies against the closed matrices, and the nonlinear motion."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.oscillator import Coefficients, random_shell, simulate
from jshell.oscillator.lagrangian import (
    acceleration,
    dipole_moment,
    dissipation,
    kinetic_energy,
    potential_energy,
)
from jshell.oscillator.linear import matrices, state_matrix
from jshell.shell import Reduced
from jshell.shell.elasticity import SPHERE_AREA
from jshell.shell.rest import RestState

REST = RestState(jnp.asarray(2.913284), jnp.asarray(1.496341))


def _problem(nu, kappa):
    V = REST.volume
    P = 0.9 * (4 * jnp.pi / 3 / V) ** kappa
    numbers = (jnp.asarray(x) for x in (0.22, 0.9, 1.6, 0.004, kappa, nu))  # arrays, so that one program serves all
    return Reduced(*numbers), RestState(V, P)


@eqx.filter_jit
def _linearised(state, coefficients, conditions):
    """Motion at rest, and its Jacobian."""
    rest = jnp.stack([state.volume, jnp.asarray(SPHERE_AREA)])

    def motion(y):
        return jnp.concatenate([y[2:], acceleration(rest + y[:2], y[2:], state, coefficients, conditions)])

    return motion(jnp.zeros(4)), jax.jacfwd(motion)(jnp.zeros(4))


@pytest.mark.long
@pytest.mark.parametrize("dipole", ["corrected", "printed"])
@pytest.mark.parametrize(("nu", "kappa"), [(0.5, 1.4), (0.3, 1.07), (0.5, 1.0)])
def test_linearised_motion_equals_the_closed_matrices(dipole, nu, kappa):
    conditions, state = _problem(nu, kappa)
    coefficients = Coefficients(3.6, 1.1, -0.23, 4.0, 0.7, dipole)
    still, linear = _linearised(state, coefficients, conditions)
    closed = state_matrix(matrices(coefficients, state, conditions))
    np.testing.assert_allclose(linear, closed, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(still, 0, atol=1e-14)


def test_matrices_are_the_hessians_of_the_energies():
    conditions, state = _problem(0.5, 1.4)
    c = Coefficients(3.6, 1.1, 0.23, 4.0, 0.7)
    rest = jnp.stack([state.volume, jnp.asarray(SPHERE_AREA)])
    still = jnp.zeros(2)
    closed = matrices(c, state, conditions)
    np.testing.assert_allclose(jax.hessian(kinetic_energy, 1)(rest, still, c), closed.mass, rtol=1e-12)
    np.testing.assert_allclose(jax.hessian(dissipation, 1)(rest, still, c, conditions), closed.damping, rtol=1e-12)
    np.testing.assert_allclose(jax.hessian(potential_energy)(rest, state, c, conditions), closed.stiffness, rtol=1e-12)


def test_dipole_moment_at_rest_is_the_printed_one():
    V = 2.9
    assert dipole_moment(jnp.array([V, SPHERE_AREA])) ** 2 == pytest.approx(4 * V**2 / (3 * np.pi**2), rel=1e-14)


def test_power_lost_is_twice_the_dissipation():
    conditions, state = _problem(0.5, 1.4)
    c = Coefficients(3.6, 1.1, 0.23, 4.0)
    q = jnp.array([2.8, 12.2])
    v = jnp.array([0.1, -0.2])

    def energy(q, v):
        return kinetic_energy(q, v, c) + potential_energy(q, state, c, conditions)

    a = acceleration(q, v, state, c, conditions)
    rate = jax.jvp(energy, (q, v), (v, a))[1]
    np.testing.assert_allclose(rate, -2 * dissipation(q, v, c, conditions), rtol=1e-12)


@pytest.mark.long
def test_nonlinear_motion_tends_to_the_linear_one_quadratically():
    shell = random_shell(4)
    times = np.linspace(0, 5, 20)
    options = {"times": times, "equilibrium": shell.state, "solver": "diffrax", "rtol": 1e-12, "atol": 1e-15}
    gaps = []
    for size in (1e-2, 1e-3):
        runs = [
            simulate(shell.conditions, shell.coefficients, initial=size * shell.initial, model=model, **options)
            for model in ("linear", "nonlinear")
        ]
        gaps.append(np.abs(runs[0]["V"] - runs[1]["V"]).max())
    assert gaps[0] / gaps[1] == pytest.approx(100, rel=0.05)
