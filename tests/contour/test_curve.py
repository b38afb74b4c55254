"""The meridian: its sphere, its measures, its errors."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.contour import (
    WeakSpot,
    area,
    compressed_sphere,
    gap,
    height,
    meridian,
    poles,
    speed,
    volume,
    wall_profile,
    width,
)
from jshell.errors import BadValue


def shape_of(mesh, x, r):
    """Coordinates of the splines nearest to two functions of the angle."""
    fit = lambda basis, values: jnp.linalg.lstsq(basis[0], values)[0]  # noqa: E731
    return jnp.concatenate([fit(mesh.x_basis, x(mesh.angles)), fit(mesh.r_basis, r(mesh.angles))])


def spheroid(mesh, half_length):
    """A spheroid of the given half length along the axis and radius 1 across it."""
    return shape_of(mesh, lambda t: half_length * jnp.cos(t), jnp.sin)


def spheroid_area(c):
    """Closed form, half length c along the axis and 1 across."""
    if c > 1:
        e = np.sqrt(1 - 1 / c**2)
        return 2 * np.pi * (1 + c / e * np.arcsin(e))
    e = np.sqrt(1 - c**2)
    return 2 * np.pi * (1 + (1 - e**2) / e * np.arctanh(e))


def mean_curvature(mesh, q):
    """Sum of the two principal curvatures over 2 at the Gauss points."""
    c = mesh.at_points(q)
    ds = speed(c)
    return ((c.x1 * c.r2 - c.r1 * c.x2) / ds**3 - c.x1 / (c.r * ds)) / 2


def test_the_sphere_is_a_sphere(mesh):
    q = mesh.sphere
    # quintic splines of 24 elements: (π/24)^6 in position, two orders less in curvature
    assert float(volume(mesh, q)) == pytest.approx(4 * np.pi / 3, rel=1e-8)
    assert float(area(mesh, q)) == pytest.approx(4 * np.pi, rel=1e-8)
    assert float(height(mesh, q)) == pytest.approx(2, rel=1e-6)
    assert float(width(mesh, q)) == pytest.approx(2, rel=1e-6)
    assert float(gap(mesh, q)) == pytest.approx(2, rel=1e-8)
    np.testing.assert_allclose(poles(mesh, q), [1, -1], atol=1e-8)
    np.testing.assert_allclose(mean_curvature(mesh, q), 1, atol=1e-5)


@pytest.mark.parametrize("c", [0.5, 2.0])
def test_volume_and_area_of_spheroids_are_the_closed_forms(mesh, c):
    q = spheroid(mesh, c)
    # sixth order of the splines at 24 elements
    assert float(volume(mesh, q)) == pytest.approx(4 * np.pi / 3 * c, rel=1e-7)
    assert float(area(mesh, q)) == pytest.approx(spheroid_area(c), rel=1e-7)
    assert float(height(mesh, q)) == pytest.approx(2 * c, rel=1e-6)
    assert float(width(mesh, q)) == pytest.approx(2, rel=1e-6)


@pytest.mark.long
def test_geometry_converges_at_the_order_of_its_splines():
    position, curvature = [], []
    for elements in (8, 16, 32):
        mesh = meridian(elements)
        curve = mesh.at_points(mesh.sphere)
        position.append(float(jnp.abs(jnp.hypot(curve.x, curve.r) - 1).max()))
        curvature.append(float(jnp.abs(mean_curvature(mesh, mesh.sphere) - 1).max()))
    order = lambda errors: np.log2(errors[0] / errors[2]) / 2  # noqa: E731
    # quintic: 6 for position, 4 for second derivatives; 0.3 for not being in the limit yet
    assert order(position) > 5.7
    assert order(curvature) > 3.7


@pytest.mark.long
@pytest.mark.parametrize("measure", [volume, area, height, width, gap], ids=lambda f: f.__name__)
def test_gradient_of_a_measure_is_its_finite_difference(measure):
    mesh = meridian(12)
    random = np.random.default_rng(1)
    q = spheroid(mesh, 0.8) + 0.02 * random.standard_normal(mesh.sphere.shape)
    way = random.standard_normal(q.shape)
    of = jax.jit(lambda q: measure(mesh, q))
    h = 1e-5
    # the difference's own error is h² times a third derivative plus rounding over h: 1e-9
    central = (of(q + h * way) - of(q - h * way)) / (2 * h)
    assert float(jax.grad(of)(q) @ way) == pytest.approx(float(central), rel=1e-6, abs=1e-8)


def test_translation_changes_no_measure(mesh):
    q = spheroid(mesh, 0.7)
    moved = q + 0.4 * mesh.shift
    for measure in (volume, area, height, width, gap):
        assert float(measure(mesh, moved)) == pytest.approx(float(measure(mesh, q)), rel=1e-12)
    np.testing.assert_allclose(jnp.stack(poles(mesh, moved)), jnp.stack(poles(mesh, q)) + 0.4, atol=1e-12)


def test_a_pad_holds_position_and_slope():
    mesh = meridian(24, 0.3272)
    edge = float(jnp.pi - 0.3272)
    random = np.random.default_rng(2)
    q = mesh.whole(mesh.free(mesh.sphere) + 0.1 * random.standard_normal(mesh.active.shape), mesh.sphere)
    before, after = mesh.at_points(mesh.sphere), mesh.at_points(q)
    held = mesh.angles > edge
    assert np.any(held)
    for name in ("x", "r", "x1", "r1"):
        difference = np.abs(getattr(after, name) - getattr(before, name))
        # B-splines that vanish beyond the edge do so to rounding
        assert np.all(difference[held] < 1e-13)
        assert np.any(difference[~held] > 1e-3)
    assert np.all(mesh.shift == 0)


def test_a_compressed_sphere_keeps_its_pad_where_it_is():
    mesh = meridian(24, 0.3272)
    q = compressed_sphere(mesh, 0.9)
    # the front pole comes to -1 + 2 x 0.9; the back one stays at -1
    np.testing.assert_allclose(jnp.stack(poles(mesh, q)), [0.8, -1], atol=1e-6)


def test_a_weak_spot_thins_the_wall_around_the_buckling_pole(mesh):
    profile = np.asarray(wall_profile(mesh, WeakSpot(0.15, 0.35)))
    np.testing.assert_allclose(profile, 1 - 0.15 * np.exp(-((np.asarray(mesh.angles) / 0.35) ** 2)), rtol=1e-14)
    assert np.all(np.diff(profile) >= 0)


@pytest.mark.parametrize("elements", [7, 0, -3])
def test_a_bad_number_of_elements_is_refused(elements):
    with pytest.raises(BadValue, match="elements"):
        meridian(elements)


@pytest.mark.parametrize("attached", [-0.1, 2.5, float("nan")])
def test_a_pad_that_leaves_nothing_free_is_refused(attached):
    with pytest.raises(BadValue, match="attached"):
        meridian(24, attached)


@pytest.mark.parametrize(("depth", "width"), [(1.0, 0.35), (-0.1, 0.35), (0.15, 0.0), (0.15, 4.0)])
def test_a_weak_spot_outside_its_meaning_is_refused(depth, width):
    with pytest.raises(BadValue, match="weak spot"):
        WeakSpot(depth, width)
