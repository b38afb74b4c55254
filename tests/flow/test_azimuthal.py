"""The liquid of motions that vary around the axis: toroidal functions, spheres, spheroids sideways."""

import equinox as eqx
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from scipy.special import factorial, lpmv

from jshell.contour import azimuthal, meridian
from jshell.flow import flow, impedance, slip_matrix, viscous_liquid
from jshell.flow.azimuthal import order_flow, order_layers
from jshell.flow.azimuthal_layer import order_second, order_slip, order_wall
from jshell.flow.second_order import second_order
from jshell.flow.toroidal import toroidal
from jshell.membrane.azimuthal import nearest_motion, null_motions, point_hessians, stiffness_of_order
from jshell.membrane.energy import stiffness_at, wall
from jshell.membrane.equilibrium import find

ELEMENTS = 24
MOST = 4  # orders as many as where frequencies are looked at: one compiled program


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
    splines, parts = azimuthal(shape), order_layers(shape, q, MOST)
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


@eqx.filter_jit
def _order_zero(state, splines, none):
    """Stiffness and added mass of order 0 by the splines of every order, and by those of axisymmetric motions."""
    shape, q = state.meridian, state.coordinates
    moduli = wall(shape, state.conditions, state.profile)
    hessians = point_hessians(shape, q, moduli, state.difference, state.energy)
    mass = order_flow(shape, splines, order_layers(shape, q, MOST), none).mass
    usual = stiffness_at(shape, q, moduli, state.difference, state.energy), flow(shape, q).mass
    return (stiffness_of_order(splines, hessians, none), mass), usual


@pytest.mark.slow
@pytest.mark.parametrize(("attached", "crowded"), [(0.0, False), (0.3272, False), (0.3272, True)])
def test_order_zero_has_the_stiffness_and_the_added_mass_of_axisymmetric_motions(attached, crowded, R):
    """Of a dimple with a weak spot, free and held: the two sets of splines span the same motions."""
    base, spot = meridian(ELEMENTS, attached, crowded=crowded), (jnp.asarray(0.15), jnp.asarray(0.35))
    state = find(base, R.as_arrays(), spot, "buckled", "current", None, True)
    shape, splines = state.meridian, azimuthal(state.meridian)
    found, expected = _order_zero(state, splines, jnp.asarray(0))
    along, across, _ = splines.motion(0)
    turns = []
    for family, basis in ((along, shape.x_basis), (across, shape.r_basis)):
        values, wanted = (np.asarray(part).reshape(3 * shape.angles.size, -1) for part in (family.values, basis))
        turn = np.linalg.lstsq(values, wanted, rcond=1e-14)[0]
        np.testing.assert_allclose(values @ turn, wanted, atol=1e-12 * np.abs(wanted).max())
        turns.append(turn)
    X, r = turns
    no = np.zeros_like(X[:, :1])
    # c = 0: b + c and b - c are both the radial displacement
    ways = np.block([[X, no * r[:1]], [no * X[:1], r], [no * X[:1], r]])
    held = ~np.asarray(splines.moving(0))
    np.testing.assert_allclose(ways[held][:, np.asarray(shape.active)], 0, atol=1e-12)
    for mine, usual in zip(found, expected, strict=True):
        # rounding: 3e-15 of the stiffness and 3e-14 of the mass are seen, and 9e-12 where elements are 0.003 long
        close = (1e-10 if crowded else 1e-12) * float(jnp.abs(usual).max())
        np.testing.assert_allclose(ways.T @ mine @ ways, usual, rtol=0, atol=close)


def lamb(aspect):
    """Lamb's α0 and β0 of a spheroid whose axis is `aspect` times its width, arts. 114 and 373."""
    a, b = mp.mpf(aspect), mp.mpf(1)
    volume = a * b**2
    alpha = volume * mp.quad(lambda x: 1 / ((a**2 + x) ** 1.5 * (b**2 + x)), [0, 1, mp.inf])
    beta = volume * mp.quad(lambda x: 1 / ((a**2 + x) ** 0.5 * (b**2 + x) ** 2), [0, 1, mp.inf])
    return float(alpha), float(beta)


@pytest.mark.long
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


def angular(degree, order, theta):
    """P_n^m(cosθ) and its θ-derivative, by the recurrence of Legendre functions."""
    n, sine, cosine = degree, np.sin(theta), np.cos(theta)
    y = lpmv(order, n, cosine)
    return y, (n * cosine * y - (n + order) * lpmv(order, n - 1, cosine)) / sine


def motion(degree, order, A, B, shape):
    """A Y radial and B ∇Y tangential on a sphere as (a, b, c) at the Gauss points; ∮Y² dA of the sphere."""
    theta = np.asarray(shape.angles)
    sine, cosine = np.sin(theta), np.cos(theta)
    y, slope = angular(degree, order, theta)
    around = 2 * np.pi if order == 0 else np.pi
    norm = around * np.sum(np.asarray(shape.weights) * sine * y**2)
    radial, along, turned = A * y, B * slope, -B * order * y / sine
    return radial * cosine - along * sine, radial * sine + along * cosine, turned, norm


@pytest.mark.parametrize(("degree", "order"), [(1, 1), (2, 1), (2, 2), (3, 2)])
def test_a_sphere_does_not_know_its_axis(degree, order, sphere):
    shape, liquids = sphere
    splines, M, G, D, _ = liquids[order]
    n, L = degree, degree * (degree + 1)
    A, B = 0.7, 0.4  # radial A Y, tangential B ∇Y
    a, b, c, norm = motion(degree, order, A, B, shape)
    v = nearest_motion(splines, shape, tuple(map(jnp.asarray, (a, b + c, b - c))), order)
    form = lambda matrix: float(v @ matrix @ v) / norm  # noqa: E731
    w = B + A / (n + 1)  # the liquid slips by -A/(n + 1) ∇Y
    assert form(M) == pytest.approx(A**2 / (n + 1), rel=1e-6)
    assert form(G) == pytest.approx(L * w**2, rel=1e-6)
    bulk, shear = 2 * (n + 2) * (2 * n + 1) / (n + 1), 4 * n * (n + 2)
    expected = bulk * A**2 - shear * A * w + n * (n + 1) * (n + 2) * w**2
    assert form(D) == pytest.approx(expected, rel=1e-5)


def drag(aspect, decay, order=1, highest=28):
    """Force of a viscous liquid, of η̂ = 1 and s = decay², on a spheroid that moves across its axis (order 1).

    The linear Navier-Stokes equations without thin layers: potential flow, poloidal and toroidal waves about the
    centre, to the least squares of no slip; the far pressure tells the force. SciPy and NumPy alone.
    """
    points, weights = np.polynomial.legendre.leggauss(100)
    theta = np.arccos(points)
    x, rho = aspect * points, np.sin(theta)
    r, root = np.hypot(x, rho), np.sqrt(weights)
    polar = np.arctan2(rho, x)

    def bessel(n, z):  # k_n(z) e^z
        j = np.arange(n + 1)[:, None]
        return np.sum(factorial(n + j) / (factorial(j) * factorial(n - j)) / (2 * z) ** j, axis=0) / z

    columns = []
    for n in range(1, highest + 1):
        y, slope = angular(n, order, polar)
        scale = np.sqrt(np.sum(weights * lpmv(order, n, points) ** 2))
        y, slope, turned = y / scale, slope / scale, order * y / scale / np.sin(polar)
        z = decay * r
        fall = np.exp(decay - z) / bessel(n, np.array([decay]))
        wave, before = bessel(n, z) * fall, bessel(n - 1, z) * fall
        if n % 2:
            columns.append((-(n + 1) * r ** (-n - 2.0) * y, r ** (-n - 2.0) * slope, -(r ** (-n - 2.0)) * turned))
            spread = wave / r - decay * (before + (n + 1) / z * wave)
            columns.append((n * (n + 1) / r * wave * y / decay, spread * slope / decay, -spread * turned / decay))
        elif order:
            columns.append((0 * y, wave * turned, -wave * slope))
    moves = (np.sin(polar), np.cos(polar), -np.ones_like(r)) if order else (np.cos(polar), -np.sin(polar), 0 * r)
    system = np.array([np.concatenate([root * part for part in column]) for column in columns]).T
    size = np.linalg.norm(system, axis=0)
    found = np.linalg.lstsq(system / size, np.concatenate([root * part for part in moves]), rcond=1e-15)[0] / size
    # the potential's dipole; lpmv has P_1^1 = -sinθ
    dipole = found[0] / np.sqrt(np.sum(weights * lpmv(order, 1, points) ** 2)) * (-1 if order else 1)
    return -4 * np.pi * decay**2 * dipole - decay**2 * 4 / 3 * np.pi * aspect


def test_the_drag_of_a_sphere_is_the_closed_form():
    for order in (0, 1):
        assert drag(1.0, 5.0, order) == pytest.approx(6 * np.pi * (1 + 5 + 25 / 9), rel=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("aspect", [1.2, 0.8])
@pytest.mark.parametrize("decay", [0.5, 3.0, 4 * np.exp(0.27j * np.pi)])
def test_the_exact_liquid_takes_of_a_spheroid_moving_along_its_axis_what_other_waves_say(aspect, decay):
    shape = meridian(48)
    x, r = shape.split(shape.sphere)
    Z = impedance(viscous_liquid(shape, jnp.concatenate([aspect * x, r])), jnp.asarray(decay + 0j))
    # asked: 2e-4
    assert complex(shape.shift @ Z @ shape.shift) == pytest.approx(drag(aspect, decay, 0), rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("aspect", [1.2, pytest.param(0.8, marks=pytest.mark.slow)])
def test_a_spheroid_moving_sideways_loses_what_a_viscous_liquid_takes(aspect, sphere):
    shape, _ = sphere
    x, r = shape.split(shape.sphere)
    _, M, G, D, rigid = _liquid(shape, jnp.concatenate([aspect * x, r]), jnp.asarray(1))
    mass, slip, second = (float(rigid[:, 0] @ matrix @ rigid[:, 0]) for matrix in (M, G, D))
    # the drag is M λ² + G λ + D + O(1/λ)
    decay = np.array([6.0, 8, 10, 12, 15, 18, 20])
    powers = np.stack([decay**2, decay, *(decay**-k for k in range(5))], axis=1)
    size = np.linalg.norm(powers, axis=0)
    expected = np.linalg.lstsq(powers / size, [drag(aspect, d) for d in decay], rcond=None)[0] / size
    np.testing.assert_allclose([mass, slip], expected[:2], rtol=1e-6)
    assert second == pytest.approx(expected[2], rel=2e-5)  # what the fit of seven powers leaves


@pytest.mark.slow
@pytest.mark.parametrize("degree", [1, 2, 3])
def test_a_bump_on_a_sphere_does_not_know_how_the_motion_is_turned(degree, sphere):
    """Matrices change by a bump P2 as 3m² - n(n + 1) from order to order of a motion (n, m): Wigner and Eckart."""
    shape, _ = sphere
    splines, theta = azimuthal(shape), np.asarray(shape.angles)
    root = np.sqrt(np.asarray(shape.weights))[:, None]

    def axial(x, r):
        parts = zip((shape.x_basis[0], shape.r_basis[0]), (x, r), strict=True)
        return np.concatenate(
            [np.linalg.lstsq(root * basis, root[:, 0] * part, rcond=None)[0] for basis, part in parts]
        )

    @eqx.filter_jit
    def axisymmetric(q):
        current = flow(shape, q)
        return current.mass, slip_matrix(shape, current), sum(second_order(shape, current))

    def forms(order, size):
        a, b, c, norm = motion(degree, order, 0.7, 0.4, shape)
        q = shape.sphere + size * axial(bump * np.cos(theta), bump * np.sin(theta))
        if order == 0:
            v, matrices = axial(a, b), axisymmetric(q)
        else:
            v = nearest_motion(splines, shape, tuple(map(jnp.asarray, (a, b + c, b - c))), order)
            matrices = _matrices(shape, splines, order_layers(shape, q, MOST), jnp.asarray(order))
        return np.array([v @ matrix @ v for matrix in matrices]) / norm

    bump = (3 * np.cos(theta) ** 2 - 1) / 2
    changes = np.array([(forms(m, 1e-3) - forms(m, -1e-3)) / 2e-3 for m in range(degree + 1)])
    shares = 3 * np.arange(degree + 1) ** 2 - degree * (degree + 1)
    # splines and differences
    np.testing.assert_allclose(changes, changes[:1] / shares[0] * shares[:, None], rtol=1e-5, atol=1e-5)
