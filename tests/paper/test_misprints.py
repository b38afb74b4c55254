"""Misprints of the source: each test holds for the right form and fails for the printed one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.contour import Meridian, meridian, speed
from jshell.membrane import Wall, elastic_energy
from jshell.oscillator import Coefficients, damped_modes, matrices
from jshell.shell import Reduced, presets
from jshell.shell.rest import RestState

ELEMENTS = 24


@pytest.fixture(scope="module")
def shape() -> Meridian:
    return meridian(ELEMENTS)


def wall_of(shape: Meridian, *, area: float, shear: float, bending: float) -> Wall:
    ones = jnp.ones_like(shape.angles)
    return Wall(area * ones, shear * ones, bending * ones, shape.angles, ones)


def on_basis(shape: Meridian, x: np.ndarray, r: np.ndarray) -> jax.Array:
    """Coefficients of a displacement given at the Gauss points."""
    even = np.linalg.lstsq(np.asarray(shape.x_basis[0]), x, rcond=None)[0]
    odd = np.linalg.lstsq(np.asarray(shape.r_basis[0]), r, rcond=None)[0]
    return jnp.asarray(np.concatenate([even, odd]))


def test_e1_decay_time_is_half_alpha1_over_beta1():
    c = Reduced(0.08, 0.9, 1.2, 0.004)
    state = RestState(jnp.asarray(3.0), jnp.asarray(1.3))
    constants = Coefficients.equal_decay(3.6, 1.1, 0.23, 5.0)
    s = np.asarray(damped_modes(matrices(constants, state, c))[0])
    tau = -1 / np.real(s)
    right, printed = 0.5 * 3.6 / 5.0 / 0.004, 2 * 3.6 / 5.0 / 0.004
    np.testing.assert_allclose(tau, right, rtol=1e-9)  # eigenvalues of a 4 x 4 matrix
    assert np.all(np.abs(tau / printed - 1) > 0.7)


def test_e2_dipole_dissipates_three_over_two_pi():
    # u = ∇ of a dipole p = 1 outside the unit sphere; D = η ∫ u_ij u_ij with both off-diagonal strains
    def velocity(y):
        rho = jnp.sqrt(jnp.sum(y**2))
        return 3 * y[0] * y / (4 * jnp.pi * rho**5) - jnp.array([1.0, 0.0, 0.0]) / (4 * jnp.pi * rho**3)

    nodes, weights = np.polynomial.legendre.leggauss(24)
    mu = nodes  # cos θ
    inverse = (nodes + 1) / 2  # 1/r from 0 to 1
    points = np.stack([np.array([m / i, np.sqrt(1 - m**2) / i, 0.0]) for i in inverse for m in mu])
    strain = jax.vmap(jax.jacfwd(velocity))(jnp.asarray(points))
    symmetric = (strain + jnp.swapaxes(strain, 1, 2)) / 2
    density = np.asarray(jnp.sum(symmetric**2, axis=(1, 2))).reshape(24, 24)
    shells = 2 * np.pi * density @ weights / inverse**4  # r² dr = d(1/r)/(1/r)⁴
    integral = float(np.sum(shells * weights / 2))
    assert integral == pytest.approx(3 / (2 * np.pi), rel=1e-10)  # polynomial integrand
    assert abs(integral / (6 / (5 * np.pi)) - 1) > 0.2


def test_e3_bending_force_has_the_factor_minus_two(shape):
    K_B, R = 0.01, 0.9
    wall = wall_of(shape, area=0.0, shear=0.0, bending=K_B)
    outward = shape.sphere
    slope = jax.jvp(lambda q: elastic_energy(shape, q, wall), (R * shape.sphere,), (outward,))[1]
    H, K_g = 1 / R, 1 / R**2
    bracket = (4 * H**2 - 2 * K_g) * (H - 1) - 2 * H * (H - 1) ** 2
    surface = 4 * np.pi * R**2
    assert slope == pytest.approx(-2 * K_B * bracket * surface, rel=1e-7)  # the sphere in splines: 1e-9
    assert abs(slope / (4 * K_B * bracket * surface) - 1) > 1


def weak_stretching_force(shape: Meridian, q: jax.Array, wall: Wall, *, printed: bool) -> np.ndarray:
    """eq:stretchingForce tested with every basis function, tangential derivative integrated by parts."""
    curve, ds = shape.at_points(q), speed(shape.at_points(q))
    e1, e2 = ds - 1, curve.r / jnp.sin(shape.angles) - 1
    T1 = (wall.area + wall.shear) * e1 + (wall.area - wall.shear) * e2
    hoop = 2 * wall.shear * (e2 - e1) / (1.0 if printed else curve.r)
    surface = 2 * jnp.pi * shape.weights * curve.r * ds
    X, R = shape.x_basis, shape.r_basis
    along_x = (surface * T1 * curve.x1 / ds**2) @ X[1]
    along_r = (surface * T1 * curve.r1 / ds**2) @ R[1] + (surface * T1 / curve.r) @ R[0]
    return np.asarray(jnp.concatenate([along_x, along_r + (surface * hoop) @ R[0]]))


def test_e4_hoop_force_divides_by_the_distance_to_the_axis(shape):
    wall = wall_of(shape, area=1.0, shear=1 / 3, bending=0.0)
    theta = np.asarray(shape.angles)
    # a motion along the axis stretches the two directions unequally; a normal one would not
    stretch = 1e-5 * on_basis(shape, np.cos(2 * theta), np.zeros_like(theta))
    gradient = np.asarray(jax.grad(lambda q: elastic_energy(shape, q, wall))(shape.sphere + stretch))
    size = np.linalg.norm(gradient)
    right = weak_stretching_force(shape, shape.sphere + stretch, wall, printed=False)
    wrong = weak_stretching_force(shape, shape.sphere + stretch, wall, printed=True)
    assert np.linalg.norm(right - gradient) < 1e-3 * size  # both are linear in 1e-5, up to its square
    assert np.linalg.norm(wrong - gradient) > 0.03 * size


@pytest.mark.parametrize("area", ["current", "reference"])
def test_e5_linearised_force_is_the_gradient_of_neither_energy(shape, area):
    wall = wall_of(shape, area=1.0, shear=1 / 3, bending=0.0)
    compressed = 0.9 * shape.sphere
    gradient = np.asarray(jax.grad(lambda q: elastic_energy(shape, q, wall, area))(compressed))
    force = weak_stretching_force(shape, compressed, wall, printed=False)
    assert np.linalg.norm(force - gradient) > 0.03 * np.linalg.norm(gradient)


def test_e6_a_bubbles_squared_frequency_falls_with_the_two_thirds_power_of_its_volume():
    def squared(radius, pressure=1.0, kappa=1.4):
        """A gas bubble from its energy: ω² = U''/M in the radius, M = 4πR³."""
        energy = lambda r: pressure * radius ** (3 * kappa) * r ** (3 - 3 * kappa) / (kappa - 1) + pressure * r**3  # noqa: E731
        return 4 * jnp.pi / 3 * jax.hessian(energy)(radius) / (4 * jnp.pi * radius**3)

    slope = np.log(squared(1.2) / squared(1.0)) / np.log(1.2**3)
    assert slope == pytest.approx(-2 / 3, rel=1e-12)


def test_e7_caption_frequencies_are_those_of_water():
    unit = presets.R_MACRO.unit
    P0, K = 1e5, 0.5e6 * 5e-3 / 22.5e-3
    sphere = lambda rho: np.sqrt((3 * 1.4 * P0 + 4 * K) / rho) / (2 * np.pi * 22.5e-3)  # noqa: E731
    gas = lambda rho: np.sqrt(3 * 1.4 * P0 / rho) / (2 * np.pi * 22.5e-3)  # noqa: E731
    assert unit.density == 1260
    assert [round(sphere(1260)), round(gas(1260))] == [185, 129]
    assert sphere(1000) == pytest.approx(210, rel=0.03)
    assert gas(1000) == pytest.approx(140, rel=0.04)


def test_e8_a_potential_flow_feels_no_viscous_force():
    # stagnation flow v = (2x, -r): S_rr = -2η, S_θθ = 2η v_r/r = -2η, so (∇·S)_r = S_rr/r ∓ 2η v_r/r² must vanish
    eta, r = 0.7, 0.3
    v_r = -r
    S_rr = -2 * eta
    assert S_rr / r - 2 * eta * v_r / r**2 == pytest.approx(0.0, abs=1e-12)
    assert abs(S_rr / r + 2 * eta * v_r / r**2) > 1.0
