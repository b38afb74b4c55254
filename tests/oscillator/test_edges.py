"""Edges of the short model: where it says nothing, it gives no number; where two answers are possible, it says so."""

import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jshell as js
from jshell.errors import Outcome, RangeWarning
from jshell.oscillator import SOURCE, Coefficients, frequencies, harmonics, simulate
from jshell.oscillator.spectrum import spectrum

BUCKLED = ("omega_minus", "omega_plus", "volume", "pressure", "stability_margin")


def shell(load):
    return js.Reduced(0.08, 0.9, load)


@pytest.mark.parametrize("load", [0.5, 0.9])
def test_no_buckled_state_has_no_numbers(load):
    found = frequencies(shell(load), SOURCE)
    assert int(found.outcome) == Outcome.NO_BUCKLED_STATE
    assert all(np.isnan(float(getattr(found, name))) for name in BUCKLED)
    assert np.isfinite(float(found.omega_sphere))
    assert not bool(found.stable)
    slope = jax.vmap(jax.grad(lambda p: frequencies(shell(p), SOURCE).omega_plus))(jnp.array([1.2, load]))
    assert list(np.isfinite(np.asarray(slope))) == [True, False]
    ring = simulate(shell(load), SOURCE, initial=(0.1, 0.0, 0.0, 0.0), times=np.linspace(0, 5, 51))
    assert np.all(np.isnan(np.asarray(ring["V"])))


def test_beyond_the_stability_limit_the_slow_frequency_alone_is_missing():
    found = frequencies(shell(1.2), Coefficients(3.6, 1.1, 0.8, 5.3))
    assert int(found.outcome) == Outcome.OUT_OF_RANGE
    assert np.isnan(float(found.omega_minus))
    assert np.isfinite(float(found.omega_plus))


def test_near_the_stability_limit_and_where_the_sphere_stands_it_says_so():
    margin = float(frequencies(shell(1.2), SOURCE).stability_margin)
    near = Coefficients(3.6, 1.1, 0.23 * np.sqrt(margin / 1.02), 5.3)
    with pytest.warns(RangeWarning, match="stability limit"):
        frequencies(shell(1.2), near)
    with pytest.warns(RangeWarning, match="two states"):
        frequencies(shell(1.0), SOURCE)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        frequencies(shell(1.2), SOURCE)


def test_multiples_faster_than_half_the_sampling_are_not_told():
    times = np.linspace(0.0, 40.0, 161)  # half the sampling is 4π
    values = np.cos(5.0 * times) + 0.3 * np.cos(10.0 * times) + 0.2 * np.cos(15.0 * times)
    found = np.asarray(harmonics(jnp.asarray(times), jnp.asarray(values), 5.0, (1.0, 2.0, 3.0)))
    assert np.isnan(found[2])
    # the third, folded to 10.13, leaks into the second; the first is not touched
    assert found[0] == pytest.approx(1.0, abs=0.02)
    assert float(spectrum(jnp.asarray(times), jnp.asarray(values)).highest) == pytest.approx(4 * np.pi, rel=0.02)
