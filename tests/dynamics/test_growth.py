"""Rates of motions out of round, growing ones too, without the matrices that they are found with.

A sphere compressed beyond its buckling load, in closed form but for the second difference of its own energy; dimples
by the energy in space and a flow of rings of sources. NumPy alone.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jshell import membrane
from jshell.contour import azimuthal
from jshell.dynamics.azimuthal import order_vibrations, orders_about
from jshell.membrane.energy import wall
from jshell.membrane.stability import shared
from jshell.shell import Reduced
from tests.membrane.test_azimuthal import energy_in_space


def sphere_energy(radius, degree, across, along, thickness, load):
    """Energy of a sphere of a radius displaced by `across` P_n outward and `along` dP_n/dθ, ν = 1/2, axisymmetric."""
    points, weights = np.polynomial.legendre.leggauss(80)
    legendre = np.polynomial.legendre.Legendre.basis(degree)
    y, dy, ddy, dddy = (legendre.deriv(k)(points) if k else legendre(points) for k in range(4))
    sine, cosine = np.sqrt(1 - points**2), points
    # derivatives along θ of P_n(cosθ)
    p = [y, -sine * dy, sine**2 * ddy - cosine * dy]
    p.append(-(sine**3) * dddy + 3 * sine * cosine * ddy + sine * dy)
    out = [radius + across * p[0], across * p[1], across * p[2]]
    way = [along * p[1], along * p[2], along * p[3]]
    r = out[0] * sine + way[0] * cosine
    x1 = out[1] * cosine - out[0] * sine - way[1] * sine - way[0] * cosine
    r1 = out[1] * sine + out[0] * cosine + way[1] * cosine - way[0] * sine
    x2 = out[2] * cosine - 2 * out[1] * sine - out[0] * cosine - way[2] * sine - 2 * way[1] * cosine + way[0] * sine
    r2 = out[2] * sine + 2 * out[1] * cosine - out[0] * sine + way[2] * cosine - 2 * way[1] * sine - way[0] * cosine
    pace = np.hypot(x1, r1)
    one, two = pace, r / sine
    mean = ((r2 * x1 - x2 * r1) / pace**3 - x1 / (r * pace)) / 2
    stretching = (one + two - 2) ** 2 / 2 + (one - two) ** 2 / 6
    bending = 2 * thickness**2 / 9 * (mean - 1) ** 2
    volume = -np.pi * np.sum(weights * r**2 * x1 / sine)
    return 2 * np.pi * np.sum(weights * one * two * (stretching + bending)) + load * volume


def second_differences(energy, size):
    """Hessian of a function of two numbers at 0, its error of second and fourth order taken off."""

    def at(h):
        e = {(i, j): energy(i * h, j * h) for i in (-1, 0, 1) for j in (-1, 0, 1)}
        aa = (e[1, 0] - 2 * e[0, 0] + e[-1, 0]) / h**2
        bb = (e[0, 1] - 2 * e[0, 0] + e[0, -1]) / h**2
        ab = (e[1, 1] - e[1, -1] - e[-1, 1] + e[-1, -1]) / (4 * h**2)
        return np.array([[aa, ab], [ab, bb]])

    one, two, four = at(size), at(2 * size), at(4 * size)
    near, far = (4 * one - two) / 3, (4 * two - four) / 3
    return (16 * near - far) / 15


def squared_rates(radius, thickness, load, degrees):
    """s² of each degree n: the liquid outside a sphere moves with 4π a³/((2n + 1)(n + 1))."""
    found = []
    for n in degrees:
        K = second_differences(lambda A, B, n=n: sphere_energy(radius, n, A, B, thickness, load), 4e-4)
        mass = 4 * np.pi * radius**3 / ((2 * n + 1) * (n + 1))
        found.append(-(K[0, 0] - K[0, 1] ** 2 / K[1, 1]) / mass)
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize("thickness", [0.1, 0.05])
@pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")
def test_an_overloaded_sphere_leaves_its_shape_at_the_rates_of_its_degrees(thickness, make_problem):
    threshold = membrane.buckling_eigenvalue(thickness, elements=48)
    radius = 1 - 1.15 * (1 - float(threshold.volume_ratio) ** (1 / 3))
    h = 1e-4
    swell = [sphere_energy(radius + k * h, 2, 0.0, 0.0, thickness, 0.0) for k in (-2, -1, 1, 2)]
    load = -(swell[0] - 8 * swell[1] + 8 * swell[2] - swell[3]) / (12 * h) / (4 * np.pi * radius**2)
    expected = squared_rates(radius, thickness, load, range(2, 16))
    assert np.sum(expected > 0) >= 3
    sphere = membrane.rest(make_problem(thickness, 0.9, 0.95), branch="sphere", elements=48)
    given = (sphere.meridian.sphere * radius, jnp.asarray(load))
    state = eqx.tree_at(lambda s: (s.coordinates, s.difference), sphere, given)
    found = np.asarray(order_vibrations(state, jnp.arange(1, 5), 4, 3, "ideal").rate)
    for m, row in zip(range(1, 5), found, strict=True):
        fastest = np.sort(expected[max(m, 2) - 2 :])[::-1][:3]
        np.testing.assert_allclose(np.real(row**2), fastest, rtol=1e-5, atol=1e-5 * np.max(expected))


def kinetic_form(shape, q, ways, m):
    """Twice the kinetic energy of the ideal liquid outside a shape as a form in motions of order m.

    Rings of sources inside the wall, to the least squares of the normal velocity.

    Args:
        ways: (motions, 2, points) of each, its amplitudes along the axis and away from it at the Gauss points.
    """
    x, r, x1, r1, x2, r2 = (np.asarray(part) for part in shape.at_points(q))
    pace = np.hypot(x1, r1)
    normal = np.stack([r1, -x1]) / pace
    root = np.sqrt(np.asarray(shape.weights) * pace * r)
    across = np.einsum("ikp,kp->pi", ways, normal)
    # as deep as the wall's bend allows
    inward = np.minimum(0.12, 0.6 * pace**3 / np.abs(x2 * r1 - r2 * x1))
    centre = slice(1, None, 2)
    at_x, at_r = (x - inward * normal[0])[centre], (r - inward * normal[1])[centre]
    phi = 2 * np.pi * np.arange(1500) / 1500
    potential, flow = [], []
    for cx, cr in zip(at_x, at_r, strict=True):
        dx, dr = (x - cx)[:, None], r[:, None] - cr * np.cos(phi)
        apart = np.sqrt(dx**2 + dr**2 + (cr * np.sin(phi)) ** 2)
        potential.append(np.mean(np.cos(m * phi) / apart, axis=1))
        slope = -(dx * normal[0][:, None] + dr * normal[1][:, None]) / apart**3
        flow.append(np.mean(np.cos(m * phi) * slope, axis=1))
    potential, flow = np.array(potential).T, np.array(flow).T * root[:, None]
    size = np.linalg.norm(flow, axis=0)
    strength = np.linalg.lstsq(flow / size, root[:, None] * across, rcond=1e-13)[0] / size[:, None]
    form = -np.pi * (across * root[:, None] ** 2).T @ (potential @ strength)
    return (form + form.T) / 2


def along(state, m, v):
    """(9, points) amplitudes a, b, c of a motion with their θ-derivatives."""
    parts = zip(azimuthal(state.meridian).motion(m), np.real(v).reshape(3, -1), strict=True)
    a, p, g = (np.asarray(family.values) @ part for family, part in parts)
    return np.concatenate([a, (p + g) / 2, (p - g) / 2])


def squared_rate(state, m, v):
    """s² of a motion of order m about a rest shape by Rayleigh's quotient, without motions that cost nothing."""
    shape, q, difference = state.meridian, state.coordinates, float(state.difference)
    moduli, curve = wall(shape, state.conditions, state.profile), shape.at_points(q)
    way = along(state, m, v)
    size = 1e-3 / float(np.max(np.abs(way[[0, 3, 6]])))

    def second(h):
        e = [energy_in_space(curve, k * h * way, moduli, difference, state.energy, m, shape) for k in (-1, 0, 1)]
        return (e[0] - 2 * e[1] + e[2]) / h**2

    stiffness = (4 * second(size) - second(2 * size)) / 3
    others = np.asarray(shared(state)[2]).T if m == 1 else ()
    ways = np.array([way[[0, 3]], *(along(state, m, null)[[0, 3]] for null in others)])
    M = kinetic_form(shape, q, ways, m)
    # what it holds of rigid motions moves nothing against the wall: the least energy over them
    mass = M[0, 0] - M[0, 1:] @ np.linalg.solve(M[1:, 1:], M[1:, 0]) if m == 1 else M[0, 0]
    return -stiffness / mass


RINGING = [
    (0.1, 0.7, 0.5, "current"),
    (0.1, 0.85, 0.5, "current"),
    (0.05, 0.7, 0.5, "current"),
    (0.2, 0.5, 0.5, "current"),
    (0.1, 0.7, 0.3, "current"),
    (0.1, 0.7, 0.5, "koiter"),
    (0.1, 0.7, 0.5, "reference"),
]
GROWING = [
    (0.025, 0.7, 0.5, "current", (4, 5)),
    (0.02, 0.7, 0.5, "current", (7,)),
    (0.03, 0.5, 0.5, "current", (5, 6)),
    (0.015, 0.85, 0.5, "current", (6, 7)),
    (0.025, 0.7, 0.3, "current", (5, 6)),
    (0.025, 0.7, 0.5, "koiter", (5, 6)),
    (0.025, 0.7, 0.5, "reference", (4, 5)),
]


def _vibrations(thickness, ratio, poisson_ratio, area, elements, orders, count):
    """A dimple, and of each motion about it its order, its shape and its rate."""
    shell = Reduced(thickness, 0.9, 1.6, 0.0, 1.4, poisson_ratio)
    state = membrane.rest(shell, volume_ratio=ratio, elements=elements, area=area)
    found = orders_about(state, list(orders), count, "ideal")
    pairs = ((i, k) for i in range(len(orders)) for k in range(count))
    return state, [(orders[i], found.shapes[i, k], complex(found.rate[i, k])) for i, k in pairs]


@pytest.mark.slow
@pytest.mark.parametrize("wall", RINGING, ids=str)
@pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")
def test_dimples_ring_as_energy_in_space_and_rings_of_sources_say(wall):
    state, motions = _vibrations(*wall, 32, (1, 2, 3), 2)
    for m, v, rate in motions:
        assert abs(rate.real) < 1e-12
        # the sources' error; a motion that is off shows in second order only
        assert squared_rate(state, m, v) == pytest.approx((rate**2).real, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("wall", GROWING, ids=str)
@pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")
def test_dimples_grow_as_energy_in_space_and_rings_of_sources_say(wall):
    *wall, orders = wall
    state, motions = _vibrations(*wall, 48, orders, 1)
    for m, v, rate in motions:
        assert rate.real > 0.1
        assert abs(rate.imag) < 1e-12
        assert squared_rate(state, m, v) == pytest.approx((rate**2).real, rel=1e-4)
