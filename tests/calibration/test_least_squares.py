"""The solver and the errors, against SciPy, optimistix and closed forms."""

import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
import scipy.optimize

from jshell.calibration.least_squares import best_of, from_many_starts, levenberg_marquardt
from jshell.calibration.parameters import unknowns
from jshell.calibration.uncertainty import in_words, propagate, uncertainty
from jshell.errors import BadName, BadValue, Outcome

T = jnp.linspace(0.0, 3.0, 40)
DATA = 2.0 * jnp.exp(-0.7 * T) + 0.3 + 0.01 * jnp.sin(37 * T)
FREE = jnp.full(3, -jnp.inf), jnp.full(3, jnp.inf)


def _decay(u):
    return u[0] * jnp.exp(-u[1] * T) + u[2] - DATA


def _rosenbrock(u, _):
    return jnp.stack([1 - u[0], 10 * (u[1] - u[0] ** 2)])


def test_minimum_equals_that_of_optimistix_and_scipy():
    start = jnp.array([1.0, 1.0, 0.0])
    found = levenberg_marquardt(_decay, start, *FREE)
    solver = optx.LevenbergMarquardt(rtol=1e-12, atol=1e-12)
    other = optx.least_squares(lambda u, _: _decay(u), solver, start, throw=False, max_steps=200)
    third = scipy.optimize.least_squares(lambda u: np.asarray(_decay(jnp.asarray(u))), start, xtol=1e-14, ftol=1e-14)
    assert int(found.outcome) == Outcome.OK
    np.testing.assert_allclose(found.unknowns, other.value, rtol=1e-7)
    np.testing.assert_allclose(found.unknowns, third.x, rtol=1e-6)


def test_bounded_minimum_equals_scipys_and_is_marked():
    low, high = jnp.array([0.0, 0.0, 0.0]), jnp.array([1.5, 5.0, 0.35])
    found = levenberg_marquardt(_decay, jnp.array([1.0, 1.0, 0.1]), low, high)
    other = scipy.optimize.least_squares(
        lambda u: np.asarray(_decay(jnp.asarray(u))), [1.0, 1.0, 0.1], bounds=(low, high), xtol=1e-14, ftol=1e-14
    )
    assert int(found.outcome) == Outcome.AT_BOUND
    np.testing.assert_allclose(found.unknowns, other.x, rtol=1e-5)


def test_many_starts_reach_the_narrow_valley():
    starts = jnp.array([[-1.2, 1.0], [3.0, -2.0], [0.0, 5.0]])
    solution = from_many_starts(_rosenbrock, None, starts, jnp.full(2, -jnp.inf), jnp.full(2, jnp.inf))
    np.testing.assert_allclose(solution.unknowns, 1.0, atol=1e-8)
    best, same = best_of(solution, 1.0)
    assert same.all()
    assert best == 0


def test_running_out_of_steps_and_bad_numbers_are_outcomes():
    starts = jnp.array([[-1.2, 1.0], [jnp.nan, 0.0]])
    solution = from_many_starts(_rosenbrock, None, starts, jnp.full(2, -jnp.inf), jnp.full(2, jnp.inf), max_steps=2)
    assert list(np.asarray(solution.outcome)) == [Outcome.NOT_CONVERGED, Outcome.NOT_FINITE]


def test_errors_of_a_straight_line_are_the_textbooks():
    random = np.random.default_rng(0)
    x = np.linspace(0, 1, 30)
    y = 1 + 2 * x + 0.1 * random.standard_normal(30)
    J = np.stack([np.ones(30), x], axis=1)
    p = np.linalg.lstsq(J, y, rcond=None)[0]
    r = J @ p - y
    scaled = uncertainty(J, r, p, absolute=False)
    np.testing.assert_allclose(scaled.covariance, np.linalg.inv(J.T @ J) * (r @ r) / 28, rtol=1e-12)
    absolute = uncertainty(J / 0.1, r / 0.1, p, absolute=True)
    np.testing.assert_allclose(absolute.stderr, 0.1 * np.sqrt(np.diag(np.linalg.inv(J.T @ J))), rtol=1e-12)
    both = propagate(np.array([[1.0, 0.5]]), absolute.covariance)[0]
    assert both**2 == pytest.approx(np.array([1, 0.5]) @ absolute.covariance @ np.array([1, 0.5]))


def test_a_free_direction_is_named_and_has_no_error():
    J = np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 1.0], [3.0, 6.0, 0.0], [1.0, 2.0, 2.0]])
    found = uncertainty(J, np.ones(4) * 0.1, np.array([1.0, 1.0, 1.0]), absolute=False)
    assert np.isnan(found.stderr[:2]).all()
    assert np.isfinite(found.stderr[2])
    assert all(found.reasons[:2])
    assert not found.reasons[2]
    assert in_words(found.null[0], ("a", "b", "c")) == "a +100%, b -50%"


def test_impossible_parameters_are_refused():
    with pytest.raises(BadName, match="gamma"):
        unknowns(("a", "b"), frozenset(), {"gamma": 1.0})
    with pytest.raises(BadValue, match="fixed"):
        unknowns(("a",), frozenset(), {"a": 1.0})
    with pytest.raises(BadValue, match="bounds"):
        unknowns(("a",), frozenset({"a"}), None, {"a": (2.0, 1.0)})
    assert float(unknowns(("a",), frozenset({"a"}), None, {"a": (1.0, np.e)}).high[0]) == pytest.approx(1)


def test_names_of_the_release_before_answer_and_say_the_new_one():
    from jshell.calibration import least_squares, losses

    for room, old, new in (
        (least_squares, "Ending", least_squares.SolverResult),
        (losses, "left_over", losses.linear_residual),
        (losses, "best", losses.solve_linear),
    ):
        with pytest.warns(DeprecationWarning, match=new.__name__):
            assert getattr(room, old) is new
