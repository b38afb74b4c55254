"""Splines that know the poles."""

import numpy as np
import pytest

from jshell.contour import breakpoints
from jshell.contour.splines import DEGREE, ParitySplines

POLES = np.array([0.0, np.pi])
BREAKS = np.linspace(0, np.pi, 13)
UNEVEN = np.pi * (np.linspace(0, 1, 13) + 0.05 * np.sin(3 * np.pi * np.linspace(0, 1, 13)))


@pytest.mark.parametrize("breaks", [BREAKS, UNEVEN], ids=["even spacing", "uneven spacing"])
@pytest.mark.parametrize(("parity", "vanishing"), [("even", (1, 3)), ("odd", (0, 2, 4))])
def test_derivatives_of_the_wrong_parity_vanish_at_the_poles(breaks, parity, vanishing):
    basis = ParitySplines(breaks, parity)
    for order in range(DEGREE):
        largest = np.abs(basis(POLES, order)).max(axis=1)
        # derivatives of order k are of size spacing^-k: rounding is relative to that
        unit = (1 / np.diff(breaks).min()) ** order
        if order in vanishing:
            assert np.all(largest < 1e-11 * unit)
        else:
            assert np.all(largest > 1e-3)


@pytest.mark.parametrize("parity", ["even", "odd"])
def test_waves_lie_in_the_span_to_sixth_order(parity):
    angles = np.linspace(0, np.pi, 301)
    wave = (np.cos if parity == "even" else np.sin)(2 * angles)
    errors = []
    for elements in (12, 24):
        basis = ParitySplines(np.linspace(0, np.pi, elements + 1), parity)
        found = np.linalg.lstsq(basis(angles), wave, rcond=None)[0]
        errors.append(np.abs(basis(angles) @ found - wave).max())
    # sixth order: a factor of 64 per halving; 40 leaves room for its constant
    assert errors[0] / errors[1] > 40


def test_taylor_coefficients_are_the_one_sided_derivatives():
    basis = ParitySplines(UNEVEN, "even")
    for node, side in ((3, 1), (3, -1), (0, 1), (12, -1)):
        step = side * 0.3 * np.diff(UNEVEN).min()
        element = node if side > 0 else node - 1
        u = 2 * step / np.diff(UNEVEN)[element]
        value = u ** np.arange(DEGREE + 1) @ basis.taylor(side)[element]
        np.testing.assert_allclose(value, basis(np.array(UNEVEN[node] + step)), atol=1e-13)


@pytest.mark.parametrize("attached", [0.05, 0.3272, 1.0])
def test_the_edge_of_a_pad_is_a_breakpoint(attached):
    breaks, edge = breakpoints(24, attached)
    assert breaks[edge] == np.pi - attached
    assert len(breaks) == 25
    assert np.all(np.diff(breaks) > 0)
    assert len(breaks) - 1 - edge >= 2


def test_value_and_slope_alone_are_continuous_at_the_edge_of_a_pad():
    breaks, edge = breakpoints(24, 0.3272)
    basis = ParitySplines(breaks, "even", edge)
    half = np.diff(breaks) / 2
    order = np.arange(DEGREE + 1)[:, None]
    after, before = basis.taylor(1)[edge] / half[edge] ** order, basis.taylor(-1)[edge - 1] / half[edge - 1] ** order
    jump = np.abs(after - before).max(axis=1)
    assert np.all(jump[:2] < 1e-10)
    assert np.all(jump[2:] > 1.0)
