"""The liquid of motions that vary around the axis: toroidal functions, spheres, spheroids sideways."""

import equinox as eqx
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from scipy.special import lpmv

from jshell.contour import azimuthal, meridian
from jshell.flow.azimuthal import order_flow, order_layers
from jshell.flow.azimuthal_layer import order_second, order_slip, order_wall
from jshell.flow.toroidal import toroidal
from jshell.membrane.azimuthal import nearest_motion, null_motions

ELEMENTS = 24


def exact(m, t):
    """Q_{m-1/2}(1 + t) by its series in exp(-2η), 40 digits."""
    with mp.workdps(40):
        eta = mp.acosh(1 + mp.mpf(t))
        half = m + mp.mpf(1) / 2
        factor = mp.sqrt(mp.pi) * mp.gamma(half) / mp.gamma(m + 1) * mp.exp(-half * eta)
        return float(factor * mp.hyp2f1(0.5, half, m + 1, mp.exp(-2 * eta)))


@pytest.mark.parametrize("t", [1e-12, 1e-4, 0.044, 0.046, 1.0, 1e4])
def test_toroidal_functions_are_those_of_exact_arithmetic(t):
    found = np.asarray(toroidal(jnp.array(t), 12))
    np.testing.assert_allclose(found, [exact(m, t) for m in range(13)], rtol=1e-13)


def _liquid(shape, q, m):
    splines, parts = azimuthal(shape), order_layers(shape, q, 2)
    rigid = null_motions(splines, shape, q, jnp.asarray(False))
    return (splines, *_matrices(shape, splines, parts, m), rigid)


@eqx.filter_jit
def _matrices(shape, splines, parts, m):
    current = order_flow(shape, splines, parts, m)
    wall = order_wall(shape, splines, parts, current, m)
    second = order_second(shape, splines, parts, wall, m)
    return current.mass, order_slip(shape, parts, wall), second


@pytest.fixture(scope="module")
def sphere():
    shape = meridian(ELEMENTS)
    return shape, {m: _liquid(shape, shape.sphere, jnp.asarray(m)) for m in (1, 2)}


def lamb(aspect):
    """Lamb's α0 and β0 of a spheroid whose axis is `aspect` times its width, arts. 114 and 373."""
    a, b = mp.mpf(aspect), mp.mpf(1)
    volume = a * b**2
    alpha = volume * mp.quad(lambda x: 1 / ((a**2 + x) ** 1.5 * (b**2 + x)), [0, 1, mp.inf])
    beta = volume * mp.quad(lambda x: 1 / ((a**2 + x) ** 0.5 * (b**2 + x) ** 2), [0, 1, mp.inf])
    return float(alpha), float(beta)


@pytest.mark.parametrize("aspect", [2.0, 0.5, 4.0, 0.25])
def test_spheroids_moving_sideways_and_turning_have_their_added_mass(aspect, sphere):
    shape, _ = sphere
    x, r = shape.split(shape.sphere)
    _, M, _, _, rigid = _liquid(shape, jnp.concatenate([aspect * x, r]), jnp.asarray(1))
    alpha, beta = lamb(aspect)
    displaced, a2 = 4 / 3 * np.pi * aspect, aspect**2
    sideways = beta / (2 - beta) * displaced
    turning = (a2 - 1) ** 2 * (beta - alpha) / (2 * (a2 - 1) + (a2 + 1) * (alpha - beta)) * displaced / 5
    found = np.diag(rigid.T @ M @ rigid)[:2]
    # the splines' error at 24 elements; 32 leave 1e-8
    np.testing.assert_allclose(found, [sideways, turning], rtol=1e-6)


@pytest.mark.parametrize(("degree", "order"), [(1, 1), (2, 1), (2, 2), (3, 2)])
def test_a_sphere_does_not_know_its_axis(degree, order, sphere):
    shape, liquids = sphere
    splines, M, G, D, _ = liquids[order]
    n, L, theta = degree, degree * (degree + 1), np.asarray(shape.angles)
    sine, cosine = np.sin(theta), np.cos(theta)
    y = lpmv(order, n, cosine)
    # sinθ dP/dθ by the recurrence of Legendre functions
    slope = (n * cosine * y - (n + order) * lpmv(order, n - 1, cosine)) / sine
    norm = np.pi * np.sum(np.asarray(shape.weights) * sine * y**2)
    A, B = 0.7, 0.4  # radial A Y, tangential B ∇Y
    radial, along, around = A * y, B * slope, -B * order * y / sine
    a, b, c = radial * cosine - along * sine, radial * sine + along * cosine, around
    v = nearest_motion(splines, shape, tuple(map(jnp.asarray, (a, b + c, b - c))), order)
    form = lambda matrix: float(v @ matrix @ v) / norm  # noqa: E731
    w = B + A / (n + 1)  # the liquid slips by -A/(n + 1) ∇Y
    assert form(M) == pytest.approx(A**2 / (n + 1), rel=1e-6)
    assert form(G) == pytest.approx(L * w**2, rel=1e-6)
    bulk, shear = 2 * (n + 2) * (2 * n + 1) / (n + 1), 4 * n * (n + 2)
    expected = bulk * A**2 - shear * A * w + n * (n + 1) * (n + 2) * w**2
    assert form(D) == pytest.approx(expected, rel=1e-5)
