"""How much room a wall leaves itself, its thickness taken off: shapes whose room is known, and a brute-force search."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from jshell.contour import clearance
from jshell.membrane import rest
from jshell.shell import Reduced


def room(mesh, q, thickness, every=1):
    return float(clearance(mesh, q, jnp.full_like(mesh.angles, thickness), every))


def test_a_sphere_has_its_diameter_less_its_wall(mesh):
    assert room(mesh, mesh.sphere, 0.2) == pytest.approx(1.8, abs=1e-6)
    assert room(mesh, mesh.sphere, 0.2, every=2) == pytest.approx(1.8, abs=1e-6)


@pytest.mark.parametrize("flat", [0.4, 0.3])
def test_a_flat_spheroid_touches_itself_at_its_poles(mesh, flat):
    q = jnp.concatenate([flat * mesh.sphere[: mesh.x_size], mesh.sphere[mesh.x_size :]])
    assert room(mesh, q, 0.2) == pytest.approx(2 * flat - 0.2, abs=2e-3)
    assert (room(mesh, q, 0.2) > 0) == (flat > 0.1)
    assert room(mesh, q, 2 * flat + 0.05) < 0


def test_a_waist_touches_itself_across_the_axis(mesh):
    q = jnp.linalg.lstsq(mesh.r_basis[0], jnp.sin(mesh.angles) * (1 - 0.9 * jnp.sin(mesh.angles) ** 4))[0]
    q = jnp.concatenate([2 * mesh.sphere[: mesh.x_size], q])
    assert room(mesh, q, 0.1) == pytest.approx(2 * 0.1 - 0.1, abs=5e-3)
    assert room(mesh, q, 0.25) < 0


@pytest.mark.parametrize(("thickness", "load"), [(0.22, 1.6), (0.3, 2.0), (0.1, 2.0)])
def test_the_room_of_a_dimple_is_that_of_a_brute_force_search(thickness, load):
    found = rest(Reduced(thickness, 0.9, load), elements=24)
    mesh, q = found.meridian, found.coordinates
    # a bead on one wall and the nearest point of the same closed curve beyond a half turn of its own arc
    fine = np.linspace(1e-3, np.pi - 1e-3, 1201)
    x, r = (CubicSpline(np.asarray(mesh.angles), np.asarray(part))(fine) for part in mesh.at_points(q)[:2])
    points = np.stack([np.concatenate([x, x[::-1]]), np.concatenate([r, -r[::-1]])], axis=1)
    distance = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    # local minima of the distance in both places: where the line between them is square to both
    ring = lambda shift, axis: np.roll(distance, shift, axis)  # noqa: E731
    lowest = (distance < ring(1, 0)) & (distance < ring(-1, 0)) & (distance < ring(1, 1)) & (distance < ring(-1, 1))
    free = min(np.min(distance[lowest & (distance > 0.02)], initial=9.0), float(found.gap)) - thickness
    assert float(found.clearance) == pytest.approx(free, abs=5e-3)


def test_a_coarser_look_sees_the_same():
    found = rest(Reduced(0.3, 0.9, 2.0), elements=24)
    whole, half = (room(found.meridian, found.coordinates, 0.3, every) for every in (1, 2))
    assert half == pytest.approx(whole, abs=2e-3)
