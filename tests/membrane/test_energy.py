"""The energy of a shape against closed forms, and its derivatives against differences."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.contour import WeakSpot, compressed_sphere, meridian, wall_profile
from jshell.errors import BadName
from jshell.membrane import elastic_energy, gas_energy, potential_energy, stiffness, wall
from jshell.membrane.energy import AREAS, check_area
from jshell.shell import SPHERE_VOLUME, Reduced, sphere_energy

D = 0.22
K_A, K_B = 1.0, D**2 / 9  # ν = 1/2


@pytest.fixture(scope="module")
def rough():
    """A few elements and a random smooth shape, a wall with a weak spot."""
    shape = meridian(9)
    random = np.random.default_rng(5)
    t = shape.angles
    x = jnp.cos(t) + 0.05 * random.standard_normal(4) @ jnp.cos(jnp.arange(4)[:, None] * t[None])
    r = jnp.sin(t) * (1 + 0.05 * random.standard_normal(4) @ jnp.cos(jnp.arange(4)[:, None] * t[None]))
    q = jnp.concatenate([jnp.linalg.lstsq(shape.x_basis[0], x)[0], jnp.linalg.lstsq(shape.r_basis[0], r)[0]])
    return shape, q, wall_profile(shape, WeakSpot(0.3, 0.5))


@pytest.mark.parametrize("radius", [0.8, 0.95, 1.1])
def test_energy_of_a_compressed_sphere_is_the_closed_form(radius, mesh, R):
    q = compressed_sphere(mesh, radius)
    plain = wall(mesh, R, jnp.ones_like(mesh.angles))
    found = {area: float(elastic_energy(mesh, q, plain, area)) for area in AREAS}
    strain = 8 * np.pi * (1 - radius) ** 2
    # curvature of the splined sphere: (π/24)^4 times its fifth derivative, 1e-7 of the energy
    assert found["current"] == pytest.approx(float(sphere_energy(radius, D)), rel=1e-6)
    assert found["reference"] == pytest.approx(strain * (K_A + K_B / radius**2), rel=1e-6)
    # Koiter's bending measure λκ - 1 does not see a change of size
    assert found["koiter"] == pytest.approx(strain * K_A, rel=1e-6)


def test_all_energies_grow_alike_near_the_stress_free_sphere(mesh, R):
    """The three energies differ at third order, apart from Koiter's bending of a uniform compression."""
    plain = wall(mesh, R, jnp.ones_like(mesh.angles))
    h = 1e-3
    energy = lambda area: float(elastic_energy(mesh, compressed_sphere(mesh, 1 - h), plain, area)) / h**2  # noqa: E731
    # next order in h
    assert energy("current") == pytest.approx(8 * np.pi * (K_A + K_B), rel=5 * h)
    assert energy("reference") == pytest.approx(8 * np.pi * (K_A + K_B), rel=5 * h)
    assert energy("koiter") == pytest.approx(8 * np.pi * K_A, rel=5 * h)


@pytest.mark.long
@pytest.mark.parametrize("area", AREAS)
def test_stiffness_is_the_hessian_of_the_potential_energy(area, rough, R):
    shape, q, profile = rough
    moduli = wall(shape, R, profile)
    energy = lambda q: potential_energy(shape, q, moduli, R, area)  # noqa: E731
    wanted = jax.jit(jax.hessian(energy))(q)
    found = jax.jit(lambda q: stiffness(shape, q, moduli, R, area))(q)
    # rounding
    np.testing.assert_allclose(found, wanted, atol=1e-11 * float(jnp.abs(wanted).max()))


@pytest.mark.long
@pytest.mark.parametrize("area", AREAS)
def test_gradient_is_the_central_difference(area, rough, R):
    shape, q, profile = rough
    energy = jax.jit(lambda q: potential_energy(shape, q, wall(shape, R, profile), R, area))
    way = jnp.asarray(np.random.default_rng(6).standard_normal(q.shape))
    way = way / jnp.linalg.norm(way)
    h = 1e-5
    central = (energy(q + h * way) - energy(q - h * way)) / (2 * h)
    # h² times a third derivative of bending (1e2), and rounding over h
    assert float(jax.grad(energy)(q) @ way) == pytest.approx(float(central), rel=1e-6)


@pytest.mark.parametrize("area", AREAS)
def test_energy_does_not_change_with_a_translation(area, rough, R):
    shape, q, profile = rough
    energy = partial(elastic_energy, shape, wall=wall(shape, R, profile), area=area)
    # rounding
    assert float(energy(q + 0.7 * shape.shift)) == pytest.approx(float(energy(q)), rel=1e-11)


def test_stiffness_has_no_resistance_to_a_translation(rest_R, R, solid):
    shape = rest_R.meridian
    K = solid(shape, rest_R.coordinates, wall(shape, R, rest_R.profile), R, "current")
    # rounding of the entries
    np.testing.assert_allclose(K @ shape.shift, 0, atol=1e-11 * float(jnp.abs(K).max()))


@pytest.mark.parametrize("kappa", [1.4, 1.0, 1.0 + 1e-9])
def test_the_gas_pushes_with_its_pressure(kappa, R):
    """-dU_g/dV = P̂0 (V0/V)^κ, the isothermal limit included."""
    gas = eqx.tree_at(lambda c: c.kappa, R, jnp.asarray(kappa))
    V = jnp.asarray(0.7 * SPHERE_VOLUME)
    # rounding over κ - 1 is what the formula has to avoid
    assert float(-jax.grad(gas_energy)(V, gas)) == pytest.approx(0.9 * 0.7**-kappa, rel=1e-9)
    assert float(gas_energy(jnp.asarray(SPHERE_VOLUME), gas)) == pytest.approx(0, abs=1e-12)


def test_moduli_follow_the_local_thickness(mesh, R):
    thin = wall(mesh, R, jnp.full_like(mesh.angles, 0.5))
    np.testing.assert_allclose(thin.area, K_A / 2, rtol=1e-14)
    np.testing.assert_allclose(thin.shear, 1 / 6, rtol=1e-14)
    np.testing.assert_allclose(thin.bending, K_B / 8, rtol=1e-14)


def test_an_unknown_energy_is_refused():
    with pytest.raises(BadName, match="current is the source's"):
        check_area("printed")


def test_gas_energy_feels_the_exponent_at_the_isothermal_point_too():
    # ∂²U/∂V∂κ = -∂P/∂κ = P ln(V/V0), from P = P0 (V0/V)^κ
    V = 3.0

    def pullback(kappa):
        return jax.grad(lambda v: gas_energy(v, Reduced(0.22, 0.9, 1.6, 0.0, kappa)))(jnp.asarray(V))

    sphere = 4 * np.pi / 3
    for kappa in (1.0, 1.00005, 1.4):
        wanted = 0.9 * (sphere / V) ** kappa * np.log(V / sphere)
        assert float(jax.grad(pullback)(kappa)) == pytest.approx(wanted, rel=1e-6)  # series to third order below 1e-4
