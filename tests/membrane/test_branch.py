"""The deflation branch, its marks, and rest shapes at a volume."""

import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.errors import BadName, BadValue, NotOk, Outcome
from jshell.membrane import (
    buckling_eigenvalue,
    deflation_branch,
    elastic_energy,
    estimate_error,
    maxwell_point,
    plateau_pressure,
    rest,
    wall,
)
from jshell.shell import SPHERE_VOLUME, Reduced, buckling_threshold

ELEMENTS = 24
PLATEAU = json.loads((Path(__file__).parents[1] / "data" / "reference" / "plateau.json").read_text())


@pytest.fixture(scope="module")
def branch(make_problem):
    return deflation_branch(make_problem(0.22, 0.9, 1.6), elements=ELEMENTS)


@pytest.fixture(scope="module")
def threshold():
    return buckling_eigenvalue(0.22)


@pytest.mark.long
def test_the_branch_passes_through_the_plateau_of_other_codes(branch):
    falling = np.flatnonzero(branch.held_stability > 0)
    order = falling[np.argsort(branch.volume_ratio[falling])]
    found = np.interp((0.6, 0.7, 0.8), branch.volume_ratio[order], branch.difference[order])
    # straight lines between states
    np.testing.assert_allclose(found, PLATEAU["0.22"][1:], rtol=1e-2)


@pytest.mark.long
def test_the_branch_runs_from_the_sphere_to_contact(branch, threshold):
    assert branch.outcome == Outcome.CONTACT
    assert 0 < branch.clearance[-1] < 0.01
    assert np.all(branch.clearance > 0)
    assert branch.gap[-1] > 0.22
    # it starts where the dimple is a fiftieth of the thickness: a percent below the eigenvalue
    assert branch.difference[0] == pytest.approx(float(threshold.difference), rel=1e-2)
    assert branch.volume_ratio[0] == pytest.approx(float(threshold.volume_ratio), rel=1e-3)


@pytest.mark.long
def test_the_branch_turns_in_volume_and_is_stable_on_one_side_only(branch):
    (fold,) = [fold for fold in branch.folds if fold.of == "volume"]
    assert fold.volume_ratio == pytest.approx(branch.volume_ratio.max(), abs=1e-3)
    at = int(np.argmax(branch.volume_ratio))
    assert np.all(branch.held_stability[: at - 1] < 0)
    assert np.all(branch.held_stability[at + 1 : -1] > 0)
    # a gas gives way, a held volume does not
    assert np.all(branch.held_stability >= branch.stability - 1e-9)


@pytest.mark.long
def test_energy_falls_by_the_work_of_the_pressure_along_the_branch(branch):
    work = -np.diff(branch.volume_ratio) * SPHERE_VOLUME * (branch.difference[1:] + branch.difference[:-1]) / 2
    # the trapezoid's error is third order in the step: a percent of the steps' work, in all
    assert np.sum(work) == pytest.approx(branch.elastic[-1] - branch.elastic[0], rel=1e-2)
    np.testing.assert_allclose(np.diff(branch.elastic), work, atol=1e-2 * np.abs(work).max())


@pytest.mark.long
def test_a_state_of_the_branch_has_its_volume_and_energy(branch, make_problem):
    k = int(np.argmin(np.abs(branch.volume_ratio - 0.7)))
    shape, q = branch.shape(k)
    plain = wall(shape, make_problem(0.22, 0.9, 1.6), jnp.ones_like(shape.angles))
    assert float(elastic_energy(shape, q, plain)) == pytest.approx(branch.elastic[k], rel=1e-10)


@pytest.mark.long
def test_at_the_maxwell_point_dimple_and_sphere_store_the_same(branch, make_problem):
    point = maxwell_point(make_problem(0.22, 0.9, 1.6), branch=branch)
    assert point.outcome == Outcome.OK
    strain = 1 - np.cbrt(point.volume_ratio)
    # the sphere's closed form, eq:NRJsph
    closed = 8 * np.pi * strain**2 * ((1 - strain) ** 2 + 0.22**2 / 9)
    assert point.elastic == pytest.approx(closed, rel=1e-6)
    (fold,) = [fold for fold in branch.folds if fold.of == "volume"]
    assert point.volume_ratio < fold.volume_ratio
    with pytest.raises(BadName, match="sphere"):
        maxwell_point(make_problem(0.22, 0.9, 1.6), branch=branch, sphere="round")


@pytest.mark.parametrize(
    ("d", "asked"),
    [
        (0.22, 0.889),
        *(pytest.param(*one, marks=pytest.mark.long) for one in ((0.30, 0.850), (0.10, 0.959), (0.05, 0.978))),
    ],
)
def test_first_eigenvalue_of_the_compressed_sphere(d, asked):
    found = buckling_eigenvalue(d)
    assert int(found.outcome) == Outcome.OK
    # two independent codes, three digits
    assert float(found.over_classical) == pytest.approx(asked, abs=1e-3)
    assert float(found.over_classical * buckling_threshold(d)) == pytest.approx(float(found.difference), rel=1e-12)


@pytest.fixture(scope="module")
def held():
    def pressures(d, ratio):
        found = rest(Reduced(d, 0.9, 1.6), volume_ratio=ratio, elements=32)
        return found.difference, found

    return jax.jit(pressures)


@pytest.mark.long
@pytest.mark.parametrize(("d", "ratio", "asked"), [(0.22, 0.7, 0.11475), (0.05, 0.6, 0.01014), (0.1, 0.8, 0.03237)])
def test_a_held_volume_is_met_at_the_plateau_of_other_codes(d, ratio, asked, held):
    p, found = held(d, ratio)
    assert int(found.outcome) == Outcome.OK
    assert float(found.volume_ratio) == pytest.approx(ratio, rel=1e-12)
    assert float(found.stability) > 0
    assert float(p) == pytest.approx(asked, rel=1e-3)


@pytest.mark.long
def test_a_held_shape_is_the_shape_at_its_load(held, R, rest_R):
    _, found = held(0.22, float(rest_R.volume_ratio))
    assert float(found.outer_pressure) == pytest.approx(1.6, rel=1e-8)
    assert float(found.area_ratio) == pytest.approx(float(rest_R.area_ratio), rel=1e-8)


@pytest.mark.long
@pytest.mark.parametrize("which", [0, 1], ids=["thickness", "volume"])
def test_gradient_of_the_held_pressure_is_its_difference(which, held):
    at = [0.22, 0.7]
    h = 2e-5 * at[which]
    slope = jax.jit(jax.grad(lambda d, ratio: held(d, ratio)[0], argnums=which))(*at)
    more, less = (held(*[value + sign * h * (k == which) for k, value in enumerate(at)])[0] for sign in (1, -1))
    # the nodes move with the shape and their error with them: 2e-6 on 24 elements, a tenth of it on 32
    assert float(slope) == pytest.approx(float(more - less) / (2 * h), rel=1e-6)


@pytest.mark.slow
def test_the_estimated_error_is_the_error(R, rest_R):
    coarse = rest(R, elements=12)
    found = estimate_error(coarse, R)
    assert int(found.outcome) == Outcome.OK
    # 24 elements leave a hundredth and less of the error of 12
    for name in ("volume_ratio", "area_ratio", "pressure"):
        true = float(getattr(coarse, name) - getattr(rest_R, name))
        assert float(getattr(found, name)) == pytest.approx(true, rel=0.05)
    assert abs(float(found.volume_ratio)) > 1e-7


@pytest.mark.long
def test_a_sphere_has_no_plateau(make_problem):
    with pytest.raises(NotOk, match="no_buckled_state"):
        plateau_pressure(0.3, volume_ratio=0.96, elements=ELEMENTS)
    with pytest.raises(BadName, match="law"):
        plateau_pressure(0.1, law="euler")
    with pytest.raises(BadValue, match="start"):
        deflation_branch(make_problem(0.22, 0.9, 1.6), start=0.2)
    with pytest.raises(BadValue, match="volume_ratio"):
        rest(make_problem(0.22, 0.9, 1.6), volume_ratio=1.5)
    with pytest.raises(BadName, match="grading"):
        rest(make_problem(0.22, 0.9, 1.6), grading="fine")
