"""Rest shapes against two other codes, closed forms and differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

from jshell.contour import NO_WEAK_SPOT, WeakSpot
from jshell.errors import NotOk, Outcome
from jshell.membrane import potential_energy, rest, wall
from jshell.shell import SPHERE_AREA, SPHERE_VOLUME, sphere_state
from jshell.shell.parameters import Reduced

ELEMENTS = 24


def test_rest_shape_of_the_reference_shell(rest_R):
    assert int(rest_R.outcome) == Outcome.OK
    # printed with four and five digits; 24 elements are within 1e-6 of the limit
    assert float(rest_R.volume_ratio) == pytest.approx(0.69918, rel=1e-4)
    assert float(rest_R.area_ratio) == pytest.approx(0.94838, rel=1e-4)
    assert float(rest_R.pressure) == pytest.approx(1.48532, rel=1e-4)
    assert float(rest_R.gap) == pytest.approx(0.84861, rel=1e-4)
    assert float(rest_R.stability) > 0


@pytest.mark.long
def test_rest_shapes_of_other_shells(family, cases):
    found = family.modes.rest
    for k, case in enumerate(cases):
        assert int(found.outcome[k]) == Outcome.OK
        # five digits are given; the thinnest shell, 0.1, is the coarsest on 24 elements
        assert float(found.volume[k]) / SPHERE_VOLUME == pytest.approx(case["V"], rel=5e-4)
        assert float(found.area[k]) / SPHERE_AREA == pytest.approx(case["S"], rel=5e-4)
        assert float(found.pressure[k]) == pytest.approx(case["P"], rel=5e-4)
        assert float(found.gap[k]) == pytest.approx(case["gap"], rel=5e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("area", "V", "S", "P", "omega"),
    [
        ("reference", 0.6986, 0.9651, 1.4870, [1.216, 2.047, 2.978, 4.496]),
        ("koiter", 0.6952, 0.9586, 1.4973, [1.258, 2.181, 3.034, 4.534]),
    ],
)
def test_other_energies_give_their_own_shapes_and_modes(area, V, S, P, omega, R, liquid, solid):
    found = rest(R, elements=ELEMENTS, area=area)
    # printed with four digits
    assert float(found.volume_ratio) == pytest.approx(V, rel=2e-4)
    assert float(found.area_ratio) == pytest.approx(S, rel=2e-4)
    assert float(found.pressure) == pytest.approx(P, rel=2e-4)

    shape, q = found.meridian, found.coordinates
    M, _ = liquid(shape, q)
    pushforward = M @ shape.shift
    K = solid(shape, q, wall(shape, R, found.profile), R, area)
    # the translation is given a frequency of 100, above all that are read
    held = K + 1e4 / (shape.shift @ pushforward) * jnp.outer(pushforward, pushforward)
    values = eigh(M, held, eigvals_only=True)
    # half a unit of the fourth printed digit, 4e-4
    np.testing.assert_allclose(values[::-1][:4] ** -0.5, omega, rtol=5e-4)


def test_at_rest_no_force_is_left(rest_R, R):
    shape, q = rest_R.meridian, rest_R.coordinates
    force = jax.jit(jax.grad(lambda q: potential_energy(shape, q, wall(shape, R, rest_R.profile), R)))(q)
    # Newton to 1e-9 in position, squared
    assert float(jnp.abs(force).max()) < 1e-11


def test_inner_pressure_is_the_adiabatic_gas(rest_R):
    assert float(rest_R.pressure) == pytest.approx(0.9 * float(rest_R.volume_ratio) ** -1.4, rel=1e-13)


@pytest.mark.long
def test_a_batch_gives_the_same_shape_as_a_single_call(family, rest_R):
    batch = jax.tree.map(lambda leaf: leaf[0], family.modes.rest)
    # the first case of the batch is R; both converge to rounding times the condition of K
    assert float(batch.volume) == pytest.approx(float(rest_R.volume), rel=1e-11)
    np.testing.assert_allclose(batch.coordinates, rest_R.coordinates, atol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("name", ["thickness", "gas_pressure", "outer_pressure"])
def test_volume_by_condition_is_the_central_difference(name, family, slopes, R):
    wanted = family.difference(lambda found: found.rest.volume, name)
    # h² of the difference: 1e-8 relative
    assert float(getattr(slopes["volume"], name)) == pytest.approx(float(wanted), rel=1e-5)


@pytest.mark.long
def test_backward_and_forward_derivative_agree(slopes, R):
    backward = jax.jit(jax.grad(lambda conditions: rest(conditions, elements=ELEMENTS).volume))(R)
    for name in ("thickness", "gas_pressure", "outer_pressure", "kappa", "poisson_ratio"):
        # the same frozen matrix, solved from either side
        assert float(getattr(backward, name)) == pytest.approx(float(getattr(slopes["volume"], name)), rel=1e-9)
    assert float(backward.viscosity) == 0


@pytest.mark.long
def test_a_shell_below_the_plateau_has_no_buckled_state(family, make_problem):
    assert int(family.modes.rest.outcome[family.no_buckled_state]) == Outcome.NO_BUCKLED_STATE
    with pytest.raises(NotOk, match="no_buckled_state") as caught:
        rest(make_problem(0.22, 0.9, 1.1, 0.004), elements=ELEMENTS, throw=True)
    assert caught.value.outcome is Outcome.NO_BUCKLED_STATE


@pytest.mark.long
def test_too_weak_a_gas_ends_in_contact_or_is_not_converged(family):
    assert int(family.modes.rest.outcome[family.weak_gas]) in (Outcome.CONTACT, Outcome.NOT_CONVERGED)


def on_sphere(problem, spot=NO_WEAK_SPOT):
    return rest(problem, branch="sphere", elements=ELEMENTS, weak_spot=spot)


@pytest.mark.parametrize("load", [0.95, 1.2, 1.6])
def test_the_sphere_branch_is_the_closed_form(load, make_problem):
    problem = make_problem(0.22, 0.9, load)
    found = on_sphere(problem)
    assert int(found.outcome) == Outcome.OK
    # the splined sphere against the sphere, found also where it is unstable (1.6)
    assert float(found.volume) == pytest.approx(float(sphere_state(problem).volume), rel=1e-6)


def test_the_sphere_loses_stability_at_the_known_load(make_problem):
    """First axisymmetric eigenvalue at 0.889 of the classical threshold for d̂ = 0.22, energy over the current area."""

    def load(difference):
        excess = lambda outer: outer - float(sphere_state(make_problem(0.22, 0.9, outer)).pressure) - difference  # noqa: E731
        return brentq(excess, 0.91, 1.6, xtol=1e-10)

    threshold = 4 * 0.22 / 3
    # half a unit of the last printed digit on either side
    assert float(on_sphere(make_problem(0.22, 0.9, load(0.8885 * threshold))).stability) > 0
    assert float(on_sphere(make_problem(0.22, 0.9, load(0.8895 * threshold))).stability) < 0


def test_a_weak_spot_makes_the_sphere_less_stable(make_problem):
    problem = make_problem(0.22, 0.9, 1.15)
    plain, weak = on_sphere(problem), on_sphere(problem, WeakSpot(0.15, 0.35))
    assert float(plain.stability) > 0
    assert float(weak.stability) < float(plain.stability)


@pytest.mark.long
def test_a_compressed_sphere_on_a_pad_is_found_under_its_load():
    c = Reduced(0.22, 0.9, 1.2, 0.004)
    held = rest(c, branch="sphere", attached=0.3272)
    assert int(held.outcome) == Outcome.OK
    # the pad keeps a fortieth of the wall where it was; the rest is compressed as a free sphere is
    assert float(held.volume) == pytest.approx(float(sphere_state(c).volume), rel=0.03)


@pytest.mark.long
def test_a_deep_dimple_on_a_pad_is_found_from_even_elements(make_problem):
    """From a mirrored cap the small elements at the pad's edge do not converge."""
    problem = make_problem(0.1, 0.4, 0.8)
    found = rest(problem, attached=0.3272)
    assert found.outcome == Outcome.OK
    assert float(found.volume_ratio) == pytest.approx(0.626493, abs=2e-6)  # of 32 even elements
    assert found.meridian.crowded
