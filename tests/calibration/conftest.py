"""Fits that several tests read: one record of V and S, and what was made of it."""

import pytest

from jshell.calibration import fit_trajectories
from jshell.oscillator import random_shell, random_trace

SEED = 3  # its thickness lies in the plateau law's range: nothing is warned of


@pytest.fixture(scope="session")
def shell():
    return random_shell(SEED)


@pytest.fixture(scope="session")
def trace(shell):
    return random_trace(shell, SEED)


@pytest.fixture(scope="session")
def fit(trace):
    return fit_trajectories(trace)
