"""Walls do not pass through each other, and what no outcome stands behind is no number."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.contour import clearance
from jshell.errors import Outcome
from jshell.membrane import deflation_branch, rest
from jshell.shell import Reduced

NUMBERS = ("volume", "area", "pressure", "stability", "difference", "elastic", "volume_ratio", "area_ratio")


def at(load, thickness=0.3, **options):
    return rest(Reduced(thickness, 0.9, load), elements=16, **options)


@pytest.mark.long
@pytest.mark.parametrize("load", [2.4, 2.6, 5.0])
def test_a_wall_whose_thickness_is_used_up_touches(load):
    found = at(load)
    assert Outcome(int(found.outcome)) == Outcome.CONTACT
    assert all(np.isnan(float(getattr(found, name))) for name in NUMBERS)
    assert not float(found.clearance) > 0  # the reason stays


@pytest.mark.long
def test_room_is_left_below_that_load():
    found = at(2.0)
    assert Outcome(int(found.outcome)) == Outcome.OK
    assert float(found.clearance) > 0


@pytest.mark.long
@pytest.mark.parametrize("load", [1.2, 2.6, 20.0])
def test_lanes_and_derivatives_of_what_is_no_answer_are_nan(load):
    ratio = lambda p: at(p).volume_ratio  # noqa: E731
    loads = jnp.array([2.0, load])
    values, slopes = jax.vmap(jax.value_and_grad(ratio))(loads)
    assert np.isfinite(float(values[0]))
    assert np.isfinite(float(slopes[0]))
    assert np.isnan(float(values[1]))
    assert np.isnan(float(slopes[1]))


@pytest.mark.long
def test_the_branch_ends_before_its_wall_touches_itself():
    found = deflation_branch(Reduced(0.3, 0.9, 2.0), elements=16, lowest=0.2)
    assert found.outcome == Outcome.CONTACT
    assert np.all(found.clearance > 0)
    assert found.clearance[-1] < 0.02


@pytest.mark.long
@pytest.mark.parametrize("name", ["thickness", "outer_pressure", "poisson_ratio"])
def test_a_derivative_outside_jit_is_that_inside(name):
    at = {"thickness": 0.22, "outer_pressure": 1.6, "poisson_ratio": 0.5}
    ratio = lambda x: rest(Reduced(**{**at, name: x}, gas_pressure=0.9), elements=16).volume_ratio  # noqa: E731
    slope = jax.grad(ratio)
    assert float(slope(at[name])) == pytest.approx(float(jax.jit(slope)(at[name])), rel=1e-9)


@pytest.mark.slow
def test_two_hundred_random_shapes_that_end_ok_have_room():
    generator = np.random.default_rng(0)
    draw = lambda low, high: generator.uniform(low, high, 200)  # noqa: E731
    thickness, gas, load, ratio = draw(0.06, 0.4), draw(0.3, 2.0), draw(0.3, 2.5), draw(0.0, 0.5)
    problems = Reduced(*(jnp.asarray(part) for part in (thickness, gas, gas + load)), poisson_ratio=jnp.asarray(ratio))
    found = jax.lax.map(lambda one: rest(one, elements=24), problems.as_arrays().replace(
        viscosity=jnp.zeros(200), kappa=jnp.full(200, 1.4)
    ))  # fmt: skip
    ok = np.asarray(found.outcome) == Outcome.OK
    assert ok.sum() > 80
    assert (np.asarray(found.outcome) == Outcome.CONTACT).sum() > 5
    for k in np.flatnonzero(ok):
        one = jax.tree.map(lambda leaf, k=k: leaf[k], found)
        assert float(clearance(one.meridian, one.coordinates, jnp.full(one.profile.shape, thickness[k]))) > 0
    assert np.all(np.isnan(np.asarray(found.volume)[~ok]))
