"""The pencil finds poles that were put in."""

import numpy as np
import pytest

from jshell.signals.pencil import poles, rates

PUT_IN = np.array([-0.12 + 1.05j, -0.15 + 1.76j, -0.3 + 2.6j])


def record(times: np.ndarray, seed: int, channels: int = 1) -> np.ndarray:
    phases = np.random.default_rng(seed).normal(size=(channels, PUT_IN.size, 2)) @ np.array([1, 1j])
    return np.einsum("cm,mt->ct", phases, np.exp(np.outer(PUT_IN, times))).real


@pytest.mark.parametrize("channels", [1, 3])
def test_poles_of_a_noise_free_sum_are_exact(channels):
    step = 0.13
    values = record(step * np.arange(200), seed=0, channels=channels).T
    (found,) = poles(values, step, [6])
    upper = np.sort_complex(found[found.imag > 0])
    # the smallest of the six singular values is some thousand times below the largest
    np.testing.assert_allclose(upper, np.sort_complex(PUT_IN), atol=1e-9)


def test_every_order_gives_its_own_number_of_poles_and_no_numbers_none():
    values = record(0.1 * np.arange(120), seed=1).T
    assert [found.size for found in poles(values, 0.1, [2, 6])] == [2, 6]
    values[7] = np.nan
    assert [found.size for found in poles(values, 0.1, [2, 6])] == [0, 0]


def test_rates_of_an_uneven_record_are_near_those_put_in():
    times = np.cumsum(np.random.default_rng(2).uniform(0.05, 0.15, size=400))
    identified = rates(times, record(times - times[0], seed=2))
    # a start for the fit: each frequency within a tenth of its mode's width 2/τ or so
    for mode in PUT_IN:
        assert min(np.abs(s - mode).min() for s in identified) < 0.03
