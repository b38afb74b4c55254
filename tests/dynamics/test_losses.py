"""What takes energy: against Lamb's bubble, Marmottant's coating, and the exact roots of the Stokes layer."""

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial.legendre import Legendre
from scipy.optimize import least_squares

from jshell.contour import meridian
from jshell.dynamics import Losses, modes, simulate
from jshell.errors import BadName, BadValue
from jshell.flow import bulk_resistance, flow
from jshell.membrane import WallLoss, wall, wall_resistance
from jshell.memory import half_derivative


@pytest.fixture(scope="module")
def bubble():
    """A sphere and its flow."""
    shape = meridian(24)
    return shape, flow(shape, shape.sphere)


@pytest.mark.parametrize("n", range(6))
def test_a_bubble_decays_with_lambs_rate(bubble, n):
    shape, current = bubble
    P = Legendre.basis(n)(np.cos(shape.angles))
    along = [np.linalg.lstsq(basis[0], P * f(shape.angles), rcond=None)[0]
             for basis, f in ((shape.x_basis, np.cos), (shape.r_basis, np.sin))]  # fmt: skip
    u = np.concatenate(along)
    rate = u @ bulk_resistance(shape, current) @ u / (u @ current.mass @ u) / 2
    # the spline of P_n on 24 elements
    assert rate == pytest.approx((n + 2) * (2 * n + 1), rel=1e-6)


def test_a_breathing_wall_loses_what_marmottants_does(bubble, R):
    shape, _ = bubble
    even = wall(shape, R, jnp.ones(shape.angles.size))
    C = wall_resistance(shape, shape.sphere, even, WallLoss(dilatation=0.7))
    # 4πR² · 4κ_s Ṙ²/R²
    assert float(shape.sphere @ C @ shape.sphere) == pytest.approx(16 * np.pi * 0.7, rel=1e-10)
    assert np.linalg.eigvalsh(C).min() > -1e-9


def test_half_derivative_holds_over_its_band():
    half = half_derivative()
    assert float(half.error()) < 5e-4
    s = (1j - 0.2) * jnp.geomspace(0.1, 20.0, 50)
    # decaying rates lie nearer to the poles of the sum: 6e-4 is seen
    np.testing.assert_allclose(half(s), jnp.sqrt(s), rtol=1e-3)
    assert min(float(half.mass), float(half.resistance), float(half.weights.min())) >= 0


def test_more_terms_hold_better():
    assert float(half_derivative(terms=8).error()) < float(half_derivative(terms=6).error()) / 3


@pytest.mark.parametrize("band", [(1.0, 0.5), (0.0, 1.0), (1.0, float("inf"))])
def test_an_empty_band_is_refused(band):
    with pytest.raises(BadValue, match="slowest"):
        half_derivative(*band)


def test_choices_that_do_not_exist_are_refused():
    with pytest.raises(BadName, match="stokes"):
        Losses("always")
    with pytest.raises(BadValue, match="frequency"):
        Losses("frequency")
    with pytest.raises(BadValue, match="drag"):
        Losses(drag=3.0)  # type: ignore[arg-type]
    with pytest.raises(BadValue, match="dilatation"):
        WallLoss(dilatation=-1.0)


def heard(trace, rates):
    """The first of several damped sinusoids beside the layer's own slow relaxations, by least squares."""
    t, V = np.asarray(trace.times), np.asarray(trace["V"])
    slow = np.exp(-np.outer(t, np.geomspace(0.03, 1.0, 4)))

    def left(numbers):
        decay, omega = np.split(numbers, 2)
        envelope, angle = np.exp(-np.outer(t, decay)), np.outer(t, omega)
        columns = [envelope * np.cos(angle), envelope * np.sin(angle), slow, np.ones((t.size, 1))]
        matrix = np.concatenate(columns, axis=1)
        return V - matrix @ np.linalg.lstsq(matrix, V, rcond=None)[0]

    start = np.concatenate([-np.real(rates), np.imag(rates)])
    found = least_squares(left, start, x_scale=np.maximum(np.abs(start), 1e-2), xtol=1e-14, ftol=1e-14)
    decay, omega = np.split(found.x, 2)
    return complex(-decay[0], omega[0])


@pytest.mark.slow
@pytest.mark.parametrize("mode", [0, 1])
@pytest.mark.parametrize("viscosity", [0.0006, 0.004, 0.013])
def test_the_memory_in_time_rings_as_the_exact_layer(make_problem, viscosity, mode):
    problem = make_problem(0.22, 0.9, 1.6, viscosity)
    found = modes(problem, elements=24)
    s, v = complex(found.rate[mode]), found.shapes[mode]
    a = 1e-3 / float(found.dV[mode])
    trace = simulate(problem, start=found.rest, displacement=a * v.real, velocity=a * (v * s).real, duration=50.0)
    order = [mode] + [k for k in range(4) if k != mode]
    got = heard(trace, np.asarray(found.rate)[order])
    # asked: 0.5 % and 2 %; 3e-4 and 1e-3 are seen
    assert abs(got) == pytest.approx(abs(s), rel=1e-3)
    assert -1 / got.real == pytest.approx(float(found.tau[mode]), rel=5e-3)
