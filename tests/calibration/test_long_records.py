"""Long records, taken block by block, give what short ones give at one go."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jshell.calibration import Prior, fit_trajectories, long_records, prepare
from jshell.calibration.least_squares import value_and_jacobian
from jshell.calibration.linearization import linearized
from jshell.calibration.long_records import condensed, look_at_all
from jshell.calibration.parameters import unknowns
from jshell.calibration.problem import join, residual
from jshell.errors import Outcome
from jshell.oscillator import random_shell, random_trace

RATIO = float(random_shell(4).coefficients.alpha2 / random_shell(4).coefficients.alpha1)
SAMPLES = 500  # two blocks and a part of one, of 200


@pytest.fixture
def short_blocks(monkeypatch):
    monkeypatch.setattr(long_records, "BLOCK", 200)
    monkeypatch.setattr(long_records, "THINNED", 100)


@eqx.filter_jit
def _plain(u, args):
    return value_and_jacobian(lambda u: residual(u, args), u)


def noisy(seed: int):
    return random_trace(random_shell(seed), seed, samples=SAMPLES)


@pytest.mark.long
@pytest.mark.parametrize("loss", ["strict", "modal"])
def test_blocks_give_the_residual_the_gradient_and_the_jacobian_of_all_rows(loss, short_blocks):
    model, c, tau = prepare(noisy(3), loss), random_shell(3).coefficients, random_shell(3).tau
    p = [c.alpha1, 1.02 * c.alpha2, c.k_vs, c.beta1] if loss == "strict" else [c.alpha1, c.alpha2, 1.1 * c.k_vs**2, tau]
    p, problem = np.array(p, dtype=float), join(model)
    parameters = unknowns(model.names, frozenset({"alpha1", "alpha2"}))
    whole = linearized(p, problem, parameters)
    _, r, J, plain = look_at_all(p, problem.alone(0))
    # both find the linear parameters to rounding times the basis's condition
    np.testing.assert_allclose(r, whole.residual, atol=1e-7)
    np.testing.assert_allclose(J, whole.jacobian[:, :4], atol=1e-9 * np.abs(whole.jacobian).max())
    for mine, theirs in zip(plain, whole.design, strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-10 * np.abs(theirs).max())

    u = jnp.asarray(parameters.unconstrained(p[None])[0])
    rows = np.asarray(eqx.filter_jit(condensed)(u, (parameters, problem)))
    left, slopes = _plain(u, (parameters, problem))
    assert rows[:, -1] @ rows[:, -1] == pytest.approx(float(left @ left), rel=1e-10)
    gradient = np.asarray(slopes.T @ left)
    np.testing.assert_allclose(rows[:, :-1].T @ rows[:, -1], gradient, rtol=1e-6, atol=1e-9 * np.abs(gradient).max())


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:the plateau law:jshell.calibration.FitWarning")
@pytest.mark.parametrize("channels", [None, ("V",)])
def test_a_fit_by_blocks_is_the_fit(channels, short_blocks, monkeypatch):
    trace, fixed = noisy(4), None if channels is None else {"k_vs": 0.2}
    at_once = fit_trajectories(trace, channels=channels, fix=fixed)
    monkeypatch.setattr(long_records, "LONG", 100)
    by_blocks = fit_trajectories(trace, channels=channels, fix=fixed)
    assert by_blocks.outcome == at_once.outcome == Outcome.OK
    for mine, theirs in zip(by_blocks.estimates, at_once.estimates, strict=True):
        if mine.role == "constant":
            assert abs(mine.value - theirs.value) < 1e-4 * theirs.stderr
            assert mine.stderr == pytest.approx(theirs.stderr, rel=1e-4)
    assert by_blocks.chi_square == pytest.approx(at_once.chi_square, rel=1e-9)


def test_thinning_keeps_the_first_sample_and_the_spacing(short_blocks):
    record = prepare(noisy(3)).records[0]
    few = long_records._thinned(record)
    assert few.elapsed.size == 100
    np.testing.assert_allclose(np.diff(few.elapsed), 5 * record.elapsed[1], rtol=1e-9)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the plateau law:jshell.calibration.FitWarning")
@pytest.mark.parametrize(
    "options",
    [
        {"tie": {"alpha2": f"{RATIO!r}*alpha1"}},
        pytest.param({"robust": "huber"}, marks=pytest.mark.slow),
        pytest.param({"priors": {"beta1": Prior(1.0, 0.2)}}, marks=pytest.mark.slow),
        {"uncertain": {"gas_pressure": 0.02}, "equilibrium": "trace"},
    ],
    ids=lambda options: next(iter(options)),
)
def test_a_fit_with_more_than_constants_goes_by_blocks_too(options, short_blocks, monkeypatch):
    trace = noisy(4)
    at_once = fit_trajectories(trace, noise="white", **options)
    monkeypatch.setattr(long_records, "LONG", 100)
    used, real = [], long_records.condensed
    monkeypatch.setattr(long_records, "condensed", lambda *given: used.append(1) or real(*given))
    by_blocks = fit_trajectories(trace, noise="white", **options)
    assert used
    assert by_blocks.outcome == at_once.outcome
    for mine, theirs in zip(by_blocks.estimates, at_once.estimates, strict=True):
        if mine.role in ("constant", "tied"):
            assert abs(mine.value - theirs.value) < 1e-4 * theirs.stderr
            assert mine.stderr == pytest.approx(theirs.stderr, rel=1e-4)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:the plateau law:jshell.calibration.FitWarning")
def test_records_of_odd_lengths_share_programs_whatever_is_asked_of_them(monkeypatch):
    seen, real = [], long_records.from_many_starts

    def spied(function, args, *rest, **given):
        seen.append(args[1].model.records[0].elapsed.size)
        return real(function, args, *rest, **given)

    monkeypatch.setattr(long_records, "from_many_starts", spied)
    whole = noisy(4)
    for count in (301, 307):
        channels = {name: np.asarray(values)[:count] for name, values in whole.channels.items()}
        cut = type(whole)(np.asarray(whole.times)[:count], channels, whole.conditions)
        fit_trajectories(cut, tie={"alpha2": f"{RATIO!r}*alpha1"}, noise="white")
    assert seen == [512, 512]
