"""The constants and their conventions."""

import math

import numpy as np
import pytest

from jshell.errors import BadName, BadValue
from jshell.oscillator import Coefficients, decay_time
from jshell.oscillator.coefficients import DIPOLE_DISSIPATION
from jshell.shell import presets
from jshell.shell.rest import RestState

R = presets.R.conditions
REST = RestState(*(np.float64(x) for x in (2.913284, 1.496341)))


def test_tied_damping_satisfies_the_relation_of_each_convention():
    corrected = Coefficients(3.6, 1.1, 0.23, beta1=2.0)
    assert pytest.approx(9 * 3.6 * corrected.area_damping, rel=1e-14) == 2 * 1.1 * 2.0
    printed = Coefficients.equal_decay(3.6, 1.1, 0.23, 2.0, dipole="printed")
    assert pytest.approx(18 * 3.6 * printed.beta2, rel=1e-14) == 5 * 1.1 * 2.0


def test_dipole_dissipation_is_the_integral_of_the_strain_of_the_flow():
    """D = η ∫ e:e over r > 1 of the flow of a dipole of unit moment, by quadrature; 3/(2π), not 6/(5π)."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    mu, w_mu = nodes, weights  # cos θ
    s, w_s = (nodes + 1) / 2, weights / 2  # r = 1/s
    r = 1 / s[:, None]
    cos, sin = mu[None, :], np.sqrt(1 - mu[None, :] ** 2)
    p = 1 / (4 * math.pi)
    e_rr = -6 * p * cos / r**4
    e_tt = 3 * p * cos / r**4
    e_pp = 3 * p * cos / r**4
    e_rt = -3 * p * sin / r**4
    density = e_rr**2 + e_tt**2 + e_pp**2 + 2 * e_rt**2
    volume = 2 * math.pi * r**2 * r**2  # dr = r² ds
    total = np.einsum("i,j,ij->", w_s, w_mu, density * volume)
    assert total == pytest.approx(DIPOLE_DISSIPATION["corrected"], rel=1e-12)
    once = np.einsum("i,j,ij->", w_s, w_mu, (density - e_rt**2) * volume)
    assert once == pytest.approx(DIPOLE_DISSIPATION["printed"], rel=1e-12)


def test_decay_time_uses_the_corrected_prefactor():
    assert float(decay_time(Coefficients(3.6, 1.1, 0.23, beta1=1.8), 0.01)) == pytest.approx(100.0)
    assert float(decay_time(Coefficients.with_decay_time(3.6, 1.1, 0.23, 7.0, 0.01), 0.01)) == pytest.approx(7.0)
    assert np.isinf(decay_time(Coefficients(3.6, 1.1, 0.23), 0.01))


def test_impossible_constants_are_refused():
    with pytest.raises(BadValue, match="alpha1"):
        Coefficients(-1.0, 1.1, 0.2)
    with pytest.raises(BadValue, match="beta2"):
        Coefficients(3.6, 1.1, 0.2, 1.0, -1.0)
    with pytest.raises(BadName, match="dipole"):
        Coefficients(3.6, 1.1, 0.2, dipole="wrong")
