"""Amplitudes eliminated: what is left, and how it changes."""

import numpy as np
import pytest

from jshell.inversion.projection import Modal, project

TIMES = np.linspace(0.0, 20.0, 120)


def modes(p: np.ndarray) -> Modal:
    """Two modes of two channels that two parameters change."""
    rates = np.array([-0.1 - 0.02 * p[0] + 1j * (1 + p[0]), -0.2 + 1j * (1.8 + 0.3 * p[1] + p[0] ** 2)])
    shapes = np.array([[1.0 + p[1], 0.5 + 0.1j * p[0]], [0.3 - 0.2j, 1.0 + 0.4 * p[0] * p[1]]])
    return Modal(rates, shapes, np.array([1.4 + 0.1 * p[0], 2.1 - 0.3 * p[1]]))


def changes(p: np.ndarray, step: float = 1e-6) -> Modal:
    pairs = [(modes(p + step * e), modes(p - step * e)) for e in np.eye(2)]
    return Modal(*(np.stack([(a[k] - b[k]) / (2 * step) for a, b in pairs]) for k in range(3)))


def data(noise: float) -> np.ndarray:
    truth = modes(np.array([0.1, 0.2]))
    wave = np.exp(np.outer(truth.rates, TIMES))
    moves = np.real((np.array([0.1 + 0.05j, 0.03j])[:, None] * truth.shapes).T @ wave)
    return truth.rest[:, None] + moves + noise * np.random.default_rng(0).standard_normal((2, TIMES.size))


def at(p, values, memory=0.0, **options):
    phi = np.full(values.shape, memory)
    return project(TIMES, values, np.array([100.0, 50.0]), phi, modes(p), changes(p), **options)


def test_nothing_is_left_of_the_modes_own_motion():
    found = at(np.array([0.1, 0.2]), data(0.0))
    assert np.abs(found.residual).max() < 1e-11
    np.testing.assert_allclose(found.amplitudes, [0.1 + 0.05j, 0.03j], atol=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("memory", [0.0, 0.7])
@pytest.mark.parametrize("free_rest", [False, True])
def test_the_jacobian_is_that_of_differences(memory, free_rest):
    p, values, step = np.array([0.12, 0.15]), data(0.01), 1e-5
    found = at(p, values, memory, free_rest=free_rest)
    for k, e in enumerate(np.eye(2)):
        high, low = (at(p + s * step * e, values, memory, free_rest=free_rest).residual for s in (1, -1))
        slope = (high - low) / (2 * step)
        # the modes' own derivatives are differences here, right to 1e-9
        assert np.abs(found.jacobian[:, k] - slope).max() < 1e-6 * np.abs(slope).max()


def test_a_free_rest_value_takes_any_offset():
    values = data(0.0) + np.array([[0.3], [-0.2]])
    assert np.abs(at(np.array([0.1, 0.2]), values, free_rest=True).residual).max() < 1e-11
    assert np.abs(at(np.array([0.1, 0.2]), values).residual).max() > 1.0
