"""Vibrations that are not axisymmetric: against another code, the sphere, and what is not round."""

import json
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell import dynamics, membrane
from jshell.contour import height, width
from jshell.dynamics.azimuthal import order_vibrations, warn_of_thick_order
from jshell.errors import BadName, BadValue, RangeWarning
from jshell.membrane.stability import spectrum

FOURIER = json.loads((Path(__file__).parents[1] / "data" / "reference" / "fourier.json").read_text())
ELEMENTS = 24
ORDERS = jnp.arange(1, 5)


@pytest.fixture(scope="module")
def every(R):
    return dynamics.modes(R, azimuth=range(5), liquid="ideal", elements=ELEMENTS)


@pytest.fixture(scope="module")
def ideal(every):
    return every.around


@pytest.mark.long
def test_frequencies_of_R_are_those_of_another_code(ideal):
    expected = [FOURIER["frequencies_R"][str(m)] for m in range(1, 5)]
    np.testing.assert_allclose(ideal.omega[:, :2], expected, rtol=1e-4)
    assert np.all(np.isinf(ideal.tau))
    assert np.all(np.asarray(ideal.outcome) == 0)


@pytest.mark.long
def test_only_even_orders_change_the_width(ideal):
    assert np.all(ideal.dW[::2] == 0)
    assert np.all(ideal.dW[1::2] > 0)


def test_every_order_comes_in_one_table(every, undamped_R):
    np.testing.assert_array_equal(every.axial.omega, undamped_R.omega)
    rows = every.table()
    assert [row.omega for row in rows] == sorted(row.omega for row in rows)
    assert len(rows) == 5 * 4
    # another code has m = 2 at 1.339 and m = 1 at 1.396 between the two frequencies of m = 0
    assert [row.azimuth for row in every.between(*map(float, undamped_R.omega[:2]))] == [2, 1]
    assert [row.seen for row in rows[:2]] == ["V, S, H, W, outline", "outline, W; H twice a period"]
    assert "m = 4" in repr(every)


@pytest.mark.slow
def test_height_and_width_move_along_an_axisymmetric_mode_as_they_do_from_shape_to_shape(every):
    shape, q, size = every.rest.meridian, every.rest.coordinates, 1e-4
    for row in (row for row in every.table() if row.azimuth == 0):
        way = jnp.real(every.axial.shapes[row.mode - 1])
        for change, measure in ((row.dH, height), (row.dW, width)):
            apart = float(measure(shape, q + size * way) - measure(shape, q - size * way)) / (2 * size)
            assert change == pytest.approx(abs(apart), abs=1e-6)


def test_the_exact_liquid_is_refused_where_it_is_not_known(R):
    for ask in (dynamics.modes, dynamics.azimuthal_modes):
        with pytest.raises(BadName, match=r"m = 0 only.*'second'.* 0.7 %"):
            ask(R, azimuth=(1, 2), liquid="exact")
    for orders in ((), (-1,), 41):
        with pytest.raises(BadValue, match="azimuth"):
            dynamics.modes(R, azimuth=orders)


@pytest.mark.long
def test_a_layer_that_is_thick_against_the_waves_around_is_warned_of(ideal):
    def at(viscosity):
        return eqx.tree_at(lambda found: found.rest.conditions.viscosity, ideal, jnp.asarray(viscosity))

    warn_of_thick_order(at(0.004), "second")
    with pytest.warns(RangeWarning, match=r"at m = \d the Stokes layer .*'second'"):
        warn_of_thick_order(at(0.05), "second")


@pytest.mark.slow
def test_a_layer_slows_and_damps_every_order(rest_R, ideal):
    found = order_vibrations(rest_R, ORDERS, 4, 2, "second")
    assert np.all(found.omega < ideal.omega[:, :2])
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
