"""Vibrations that are not axisymmetric: against another code, the sphere, and what is not round."""

import json
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell import dynamics, membrane
from jshell.dynamics.azimuthal import order_vibrations
from jshell.membrane.stability import spectrum

FOURIER = json.loads((Path(__file__).parents[1] / "data" / "reference" / "fourier.json").read_text())
ORDERS = jnp.arange(1, 5)


@pytest.fixture(scope="module")
def ideal(rest_R):
    return order_vibrations(rest_R, ORDERS, 4, 2, "ideal")


def test_frequencies_of_R_are_those_of_another_code(ideal):
    expected = [FOURIER["frequencies_R"][str(m)] for m in range(1, 5)]
    np.testing.assert_allclose(ideal.omega, expected, rtol=1e-4)
    assert np.all(np.isinf(ideal.tau))
    assert np.all(np.asarray(ideal.outcome) == 0)


def test_only_even_orders_change_the_width(ideal):
    assert np.all(ideal.dW[::2] == 0)
    assert np.all(ideal.dW[1::2] > 0)


@pytest.mark.slow
def test_a_layer_slows_and_damps_every_order(rest_R, ideal):
    found = order_vibrations(rest_R, ORDERS, 4, 2, "second")
    assert np.all(found.omega < ideal.omega)
    assert np.all((found.tau > 1) & (found.tau < 10))


@pytest.mark.slow
@pytest.mark.parametrize("liquid", ["ideal", "second"])
def test_frequencies_have_the_derivatives_of_their_differences(liquid, R):
    def numbers(given):
        changed = eqx.tree_at(lambda c: (c.thickness, c.outer_pressure), R, tuple(given))
        found = dynamics.azimuthal_modes(changed, (1, 2), liquid=liquid, count=2, elements=elements)
        return jnp.concatenate(
            [found.omega.ravel(), found.tau.ravel()] if liquid == "second" else [found.omega.ravel()]
        )

    elements = 48 if liquid == "second" else 32
    at = jnp.array([0.22, 1.6])
    exact = jax.jacfwd(numbers)(at)
    for k, step in enumerate((2e-4, 1e-3)):
        way = jnp.zeros(2).at[k].set(step)
        one, two = ((numbers(at + h * way) - numbers(at - h * way)) / (2 * h * step) for h in (1, 2))
        # the second frequency of m = 1 nearly does not know P_ext; where the nodes are is not differentiated
        np.testing.assert_allclose(exact[:, k], (4 * one - two) / 3, rtol=1e-5, atol=1e-7)
    if liquid == "ideal":
        np.testing.assert_allclose(jax.jit(jax.jacfwd(numbers))(at), exact, rtol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("thickness", [0.30, 0.22, 0.10, 0.05])
@pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning")
def test_a_compressed_sphere_rings_alike_in_every_direction(thickness, make_problem):
    c = make_problem(thickness, 0.9, 0.9 + thickness**2 / 3)
    elements = 48
    axial = dynamics.modes(c, branch="sphere", liquid="ideal", elements=elements, count=6)
    # by its degree n, the translation left out; the breathing motion is the one that changes the volume
    breathes = int(np.argmax(np.abs(axial.dV)))
    degrees = np.delete(np.asarray(axial.omega), breathes)
    found = order_vibrations(axial.rest, ORDERS, 4, 3, "ideal")
    for m, row in zip(ORDERS, found.omega, strict=True):
        first = max(int(m), 2) - 2
        np.testing.assert_allclose(row[:2], degrees[first : first + 2], rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("thickness", [0.30, 0.22, 0.10, 0.05])
def test_a_sphere_buckles_at_one_load_in_every_direction(thickness, make_problem):
    threshold = membrane.buckling_eigenvalue(thickness, elements=48)
    found = membrane.rest(make_problem(thickness, 0.9, 0.95), branch="sphere", elements=48)
    # a rest shape found at the bifurcation itself would hold some of the buckling mode
    q = found.meridian.sphere * threshold.volume_ratio ** (1 / 3)

    def lowest(load):
        given = (q, threshold.difference * load)
        return spectrum(eqx.tree_at(lambda s: (s.coordinates, s.difference), found, given), jnp.arange(1, 9))[0]

    values, more = lowest(1.0), lowest(1.001)
    # orders up to the degree of the buckling mode lose their stiffness at its load
    degree = max(2, round(1.9 / np.sqrt(thickness)) - 1)
    off = values[:degree] / ((more - values)[:degree] / 0.001)
    assert np.all(np.abs(off) < 1e-6)
