"""The liquid away from the wall: exact flows about the sphere, the flux of a dented shell, refused points."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import legendre
from scipy.special import eval_legendre

from jshell.contour import dimple, meridian, volume
from jshell.errors import BadShape, BadValue
from jshell.flow import field

DISTANCES = (0.05, 0.2, 1.0)
ANGLES = np.linspace(0.0, np.pi, 61)  # both poles are among them; every call asks for 183 points: one program


@pytest.fixture(scope="module")
def wall():
    return meridian(32)


def legendre_motion(mesh, n):
    """Velocity along the sphere's normal of size P_n(cos θ)."""
    t = np.asarray(mesh.angles)
    size = eval_legendre(n, np.cos(t))
    fit = lambda basis, values: np.linalg.lstsq(np.asarray(basis[0]), values, rcond=None)[0]  # noqa: E731
    return jnp.concatenate(
        [jnp.asarray(fit(mesh.x_basis, size * np.cos(t))), jnp.asarray(fit(mesh.r_basis, size * np.sin(t)))]
    )


def exact(n, radius, angle):
    """Lamb, art. 17: φ = -P_n/((n+1) R^(n+1)), and its gradient along and across the axis."""
    c, s = np.cos(angle), np.sin(angle)
    P = eval_legendre(n, c)
    slope = legendre.legval(c, legendre.legder(np.eye(n + 1)[n])) if n else 0 * c
    outward, along = P / radius ** (n + 2), slope * s / ((n + 1) * radius ** (n + 2))
    return -P / ((n + 1) * radius ** (n + 1)), outward * c - along * s, outward * s + along * c


@pytest.mark.long
@pytest.mark.parametrize("n", [0, 1, 2])
def test_the_flow_about_a_sphere_is_the_exact_one(n, wall):
    """n = 0 breathes with 1/r², n = 1 translates as a dipole, n = 2 changes its shape."""
    radius, angle = (part.ravel() for part in np.meshgrid(1 + np.array(DISTANCES), ANGLES, indexing="ij"))
    found = field(wall, wall.sphere, legendre_motion(wall, n), radius * np.cos(angle), np.abs(radius * np.sin(angle)))
    assert np.all(found.outside)
    for numbers, known in zip((found.potential, found.v_x, found.v_r), exact(n, radius, angle), strict=True):
        # 32 elements of sixth order: 1e-9 at 0.2 and beyond, where 1e-6 is asked; 3e-8 at half an element
        error = np.abs(np.asarray(numbers) - known).reshape(len(DISTANCES), -1).max(axis=1)
        assert np.all(error < [1e-7, 1e-8, 1e-8])
    np.testing.assert_allclose(found.distance, radius - 1, atol=1e-4)
    on_axis = np.isin(angle, (0.0, np.pi))
    np.testing.assert_allclose(np.asarray(found.v_r)[on_axis], 0.0, atol=1e-12)


@pytest.mark.long
def test_as_much_liquid_leaves_as_the_dented_shell_grows(wall):
    """Through a sphere about the shell flows dV/dt, and far away the potential is that of a source of as much."""
    q = dimple(wall, jnp.asarray(0.7), jnp.asarray(0.22))
    u = legendre_motion(wall, 0) + legendre_motion(wall, 3)
    rate = float(jax.jvp(lambda q: volume(wall, q), (q,), (u,))[1])
    c, weights = legendre.leggauss(len(DISTANCES) * ANGLES.size - 1)
    s = np.sqrt(1 - c**2)
    found = field(wall, q, u, np.append(2 * c, 0.0), np.append(2 * s, 1e4))
    outward = np.asarray(found.v_x)[:-1] * c + np.asarray(found.v_r)[:-1] * s
    through = 2 * np.pi * 4 * np.sum(weights * outward)
    # 32 elements on a shape with a rim
    assert through == pytest.approx(rate, rel=1e-5)
    assert float(found.potential[-1]) == pytest.approx(-rate / (4 * np.pi * 1e4), rel=1e-3)  # a dipole is 1e-4 of it


def test_points_inside_and_too_near_are_told_not_computed(wall):
    x, r = np.full((len(DISTANCES), ANGLES.size), 2.0), np.zeros((len(DISTANCES), ANGLES.size))
    x[0, :4], r[0, :4] = [0.0, 0.5, 1.001, 2.0], [0.0, 0.5, 0.0, 0.0]
    found = field(wall, wall.sphere, wall.sphere, x, r)
    assert list(np.asarray(found.outside)[0, :4]) == [False, False, False, True]
    for numbers in (found.potential, found.v_x, found.v_r, found.speed):
        assert np.all(np.asarray(numbers)[0, :3] == 0.0)
        assert numbers.shape == x.shape
        assert np.all(np.isfinite(numbers))
    with pytest.raises(BadValue, match="3 points inside the shell"):
        field(wall, wall.sphere, wall.sphere, x, r, throw=True)


def test_points_that_make_no_sense_are_refused(wall):
    with pytest.raises(BadShape, match="x, r"):
        field(wall, wall.sphere, wall.sphere, np.zeros(3), np.zeros(2))
    with pytest.raises(BadValue, match="axis"):
        field(wall, wall.sphere, wall.sphere, np.zeros(1), -np.ones(1))
