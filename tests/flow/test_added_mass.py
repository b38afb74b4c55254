"""Added mass of spheres and spheroids, and the Stokes layer's slip."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import eval_legendre

from jshell.contour import meridian
from jshell.flow import flow, single_frequency


def fitted(mesh, x, r):
    """Coordinates of two functions of the angle, given as arrays at the Gauss points."""
    fit = lambda basis, values: np.linalg.lstsq(np.asarray(basis[0]), values, rcond=None)[0]  # noqa: E731
    return jnp.concatenate([jnp.asarray(fit(mesh.x_basis, x)), jnp.asarray(fit(mesh.r_basis, r))])


def legendre(mesh, n):
    """Velocity along the sphere's normal of size P_n(cos θ)."""
    t = np.asarray(mesh.angles)
    size = eval_legendre(n, np.cos(t))
    return fitted(mesh, size * np.cos(t), size * np.sin(t))


def exact(n):
    """Lamb, art. 17: φ_n = -P_n/((n+1) r^(n+1))."""
    return 4 * np.pi / ((n + 1) * (2 * n + 1))


@pytest.fixture(scope="module")
def fine():
    return meridian(96)


@pytest.fixture(scope="module")
def sphere_mass(fine, liquid):
    return liquid(fine, fine.sphere)[0]


@pytest.mark.long
@pytest.mark.parametrize("n", range(6))
def test_added_mass_of_the_sphere_is_the_closed_form(n, fine, sphere_mass):
    u = legendre(fine, n)
    # 96 elements of sixth order: what is left is 1e-8
    assert float(u @ sphere_mass @ u) == pytest.approx(exact(n), rel=1e-6)


@pytest.mark.parametrize(
    ("half_length", "coefficient"), [(2, 0.2100150), (4, 0.0815573), (1 / 2, 1.1150605), (1 / 4, 2.3742915)]
)
def test_added_mass_of_spheroids_is_lambs(half_length, coefficient, fine, liquid):
    t = np.asarray(fine.angles)
    M, _ = liquid(fine, fitted(fine, half_length * np.cos(t), np.sin(t)))
    displaced = 4 * np.pi / 3 * half_length
    # the coefficients (Lamb, art. 114) are given to seven decimals, 6e-7 of the smallest
    assert float(fine.shift @ M @ fine.shift) / displaced == pytest.approx(coefficient, rel=1e-6)


def test_added_mass_converges_at_sixth_order_or_better(liquid):
    errors = []
    for elements in (12, 24):
        mesh = meridian(elements)
        u = legendre(mesh, 5)
        errors.append(abs(float(u @ liquid(mesh, mesh.sphere)[0] @ u) / exact(5) - 1))
    assert np.log2(errors[0] / errors[1]) > 6


def test_kinetic_energy_is_never_negative(rest_R, liquid):
    M, _ = liquid(rest_R.meridian, rest_R.coordinates)
    values = np.linalg.eigvalsh(M)
    # M is semidefinite with many zeros, and collocation keeps that up to discretisation only: 6e-6 at 24 elements
    assert values[0] > -2e-5 * values[-1]


def test_green_symmetry_holds_before_it_is_enforced(rest_R):
    """u1·∮φ2 and u2·∮φ1 agree for smooth motions, although collocation does not build it in."""
    shape = rest_R.meridian
    current = jax.jit(flow)(shape, rest_R.coordinates)
    potentials = shape.potential_basis[0] @ current.potential
    half = -2 * jnp.pi * (current.flux.T * shape.weights[None]) @ potentials
    smooth = jnp.stack([legendre(shape, n) for n in range(4)])
    power = smooth @ half @ smooth.T
    # the error of 24 elements on a shape with a rim
    np.testing.assert_allclose(power, power.T, atol=1e-4 * float(jnp.abs(power).max()))


def test_slip_of_a_translating_sphere_is_three_halves_of_its_speed(mesh, liquid):
    """w = (3/2) sin θ, so ∮ w² dA = 6π."""
    _, G = liquid(mesh, mesh.sphere)
    # 24 elements, one order below the added mass
    assert float(mesh.shift @ G @ mesh.shift) == pytest.approx(6 * np.pi, rel=1e-5)


def test_a_breathing_sphere_does_not_slip(mesh, liquid):
    _, G = liquid(mesh, mesh.sphere)
    # the slip itself is the error of discretisation, 1e-6; squared here
    assert abs(float(mesh.sphere @ G @ mesh.sphere)) < 1e-10


@pytest.mark.parametrize("rate", [1.2, -0.13 + 1.02j])
def test_single_frequency_layer_is_exact_at_its_rate(rate):
    layer = single_frequency(0.004, rate)
    s = rate if isinstance(rate, complex) else 1j * rate
    # rounding
    np.testing.assert_allclose(s * layer.mass + layer.resistance, np.sqrt(s * 0.004), rtol=1e-13)
    assert layer.mass > 0
    assert layer.resistance > 0
