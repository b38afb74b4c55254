"""The viscous liquid against closed forms of spheres and spheroids; its second order by closed form and by terms."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial.legendre import Legendre
from scipy.special import kv

from jshell.contour import meridian
from jshell.flow import flow, impedance, second_order, second_resistance, viscous_liquid

ORDERS = range(7)
# λ from a layer of 1/117 of the radius to nearly steady flow, on and off the half-order ray
DECAYS = [117 * np.exp(0.26j * np.pi), 40 * np.exp(0.27j * np.pi), 16 * np.exp(0.3j * np.pi), 5 * np.exp(0.45j * np.pi),
          0.88 * np.exp(0.25j * np.pi), 0.01 + 0j]  # fmt: skip


class OnSphere:
    """A sphere's liquid, and its spherical harmonics as motions: radial P_n and tangential dP_n/dθ."""

    def __init__(self, elements: int) -> None:
        self.shape = meridian(elements)
        self.liquid = viscous_liquid(self.shape, self.shape.sphere)

    def motions(self, n: int) -> np.ndarray:
        angles, P = np.asarray(self.shape.angles), Legendre.basis(n)
        c, s = np.cos(angles), np.sin(angles)
        radial, along = P(c), -s * P.deriv()(c)
        return np.array([self.fitted(radial * c, radial * s), self.fitted(-along * s, along * c)])

    def fitted(self, x: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Coordinates of the splines nearest to a motion."""
        weight = np.sqrt(np.asarray(self.shape.weights))
        parts = [np.linalg.lstsq(np.asarray(basis[0]) * weight[:, None], values * weight, rcond=None)[0]
                 for basis, values in ((self.shape.x_basis, x), (self.shape.r_basis, r))]  # fmt: skip
        return np.concatenate(parts)


def closed(n: int, decay: complex) -> np.ndarray:
    """Z/η̂ of a sphere on (A P_n radial, B dP_n/dθ along): potential and vorticity by modified Bessel functions."""
    L = n * (n + 1)
    p = -decay * kv(abs(n - 0.5), decay) / kv(n + 0.5, decay) - (n + 1)  # λ k_n'/k_n
    Z = np.zeros((2, 2), complex)
    for k, (A, B) in enumerate(np.eye(2)):
        if n == 0:
            c, d = (-1.0, 0.0) if k == 0 else (0.0, 0.0)
        else:
            c, d = np.linalg.solve([[-(n + 1), L], [1, 1 + p]], [A, B])
        t_r = decay**2 * c + 2 * (-2 * A + L * B)
        t_along = -(n + 2) * c + d * (decay**2 + L - p - 1) - B + A
        Z[:, k] = -t_r, -L * t_along
    return 4 * np.pi / (2 * n + 1) * Z


@pytest.fixture(scope="module")
def sphere():
    return OnSphere(48)


@pytest.fixture(scope="module")
def resistances(sphere):
    return np.stack([np.asarray(impedance(sphere.liquid, jnp.asarray(decay))) for decay in DECAYS])


@pytest.mark.long
@pytest.mark.parametrize("n", ORDERS)
def test_impedance_of_a_sphere_is_the_closed_form(n, sphere, resistances):
    motions = sphere.motions(n)
    for decay, Z in zip(DECAYS, resistances, strict=True):
        known, found = closed(n, decay), motions @ Z @ motions.T
        # asked for 1e-6; 4e-7 is seen, the spline of P_6 on 48 elements
        np.testing.assert_allclose(found, known, rtol=0, atol=1e-6 * np.abs(known).max())


@pytest.mark.long
def test_a_rigid_sphere_feels_bassets_force(sphere, resistances):
    t = np.asarray(sphere.shape.shift)
    for decay, Z in zip(DECAYS, resistances, strict=True):
        assert t @ Z @ t == pytest.approx(6 * np.pi * (1 + decay + decay**2 / 9), rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize(("stretch", "drag"), [(2.0, 22.69375), (0.5, 17.06460)], ids=["prolate", "oblate"])
def test_spheroids_feel_stokes_drag(stretch, drag, sphere):
    """Moving along the axis, equatorial radius 1; Happel and Brenner. At a low rate: + λ F²/(6π) of the drag F."""
    shape, decay = sphere.shape, 1e-3
    q = jnp.concatenate([stretch * shape.sphere[: shape.x_size], shape.sphere[shape.x_size :]])
    Z = impedance(viscous_liquid(shape, q), jnp.asarray(decay + 0j))
    found = float((shape.shift @ Z @ shape.shift).real)
    # seven digits are known; the next term in λ is of order 1e-6
    assert found == pytest.approx(drag + decay * drag**2 / (6 * np.pi), rel=1e-5)


@pytest.mark.long
def test_impedance_is_symmetric_and_takes_energy(sphere):
    Z = np.asarray(impedance(sphere.liquid, jnp.asarray(3.0 + 0j)))
    np.testing.assert_allclose(Z, Z.T, rtol=0, atol=1e-12 * np.abs(Z).max())
    for n in ORDERS:
        motions = sphere.motions(n)
        assert np.linalg.eigvalsh((motions @ Z @ motions.T).real).min() > -1e-6


def test_second_order_of_a_sphere_is_its_closed_form(sphere):
    shape = sphere.shape
    D = np.asarray(eqx.filter_jit(lambda q: second_resistance(shape, flow(shape, q)))(shape.sphere))
    for n in range(1, 7):
        motions = sphere.motions(n)
        # A normal and w slip; the tangential motion slips by itself, the radial one by A/(n + 1) over its flow
        slip = np.array([[1, 0], [1 / (n + 1), 1]])
        form = np.array([[2 * (n + 2) * (2 * n + 1) / (n + 1), -2 * n * (n + 2)],
                         [-2 * n * (n + 2), n * (n + 1) * (n + 2)]])  # fmt: skip
        known = 4 * np.pi / (2 * n + 1) * slip.T @ form @ slip
        # the spline of P_6
        np.testing.assert_allclose(motions @ D @ motions.T, known, rtol=0, atol=1e-6 * np.abs(known).max())


@pytest.mark.long
def test_second_order_of_the_reference_shell_by_its_terms(undamped_R):
    shape, q = undamped_R.rest.meridian, undamped_R.rest.coordinates
    both = eqx.filter_jit(lambda q: (second_order(shape, now := flow(shape, q)), second_resistance(shape, now)))
    parts, whole = both(q)
    v = np.asarray(undamped_R.shapes).real
    # another code's, whose modes are normalised by vᵀK v = 1: vᵀM v = 1/ω²
    v = v / np.asarray(undamped_R.omega)[:, None]
    terms = [float(v[0] @ np.asarray(part) @ v[0]) for part in parts]
    np.testing.assert_allclose(terms, [29.51, -41.79, 9.79, 9.95], rtol=3e-3)
    sums = [float(one @ np.asarray(whole) @ one) for one in v[:3]]
    np.testing.assert_allclose(sums, [7.46, 4.80, 3.63], rtol=3e-3)
    assert sum(terms) == pytest.approx(sums[0], rel=1e-10)
