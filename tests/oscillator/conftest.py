"""One driven shell that the tests of the driven oscillator share."""

import jax.numpy as jnp
import numpy as np
import pytest

from jshell.oscillator import Tone, drive
from jshell.oscillator.coefficients import Coefficients
from jshell.shell import Reduced

TIMES = np.linspace(0.0, 50.0, 101)


@pytest.fixture(scope="session")
def shell() -> Reduced:
    return Reduced(*(jnp.asarray(x) for x in (0.08, 0.9, 1.2, 0.02, 1.4, 0.5)))


@pytest.fixture(scope="session")
def constants() -> Coefficients:
    return Coefficients(*(jnp.asarray(x) for x in (3.6, 1.1, 0.23, 5.3, 2.0)))


@pytest.fixture(scope="session")
def driven_run(shell, constants):
    return drive(shell, constants, Tone(0.02, 0.8), times=TIMES, rtol=1e-11, atol=1e-13)
