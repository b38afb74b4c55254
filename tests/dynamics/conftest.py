"""Runs in time that several tests read."""

import jax.numpy as jnp
import pytest

from jshell.dynamics import LONGEST_STEP, NO_LOSSES, Losses, simulate

ELEMENTS = 24
DURATION = 50.0


@pytest.fixture(scope="session")
def snap(make_problem):
    """The reference shell at 1.62: ramp, snap, ring-down; all options at their defaults."""
    return simulate(make_problem(0.22, 0.9, 1.62, 0.004), duration=70.0, elements=ELEMENTS)


@pytest.fixture(scope="session")
def attached_snap(make_problem):
    """The same held by a pad."""
    problem = make_problem(0.22, 0.9, 1.62, 0.004)
    return simulate(problem, duration=90.0, elements=ELEMENTS, attached=0.314, stokes_frequency=1.2)


@pytest.fixture(scope="session")
def kick(rest_R, make_problem):
    """A run from R at rest, moved by a displacement and a velocity."""

    def run(displacement, velocity, viscosity=0.0, stokes_frequency=None, step=LONGEST_STEP):
        return simulate(
            make_problem(0.22, 0.9, 1.6, viscosity),
            start=rest_R,
            displacement=jnp.asarray(displacement),
            velocity=jnp.asarray(velocity),
            duration=DURATION,
            losses=NO_LOSSES if stokes_frequency is None else Losses("frequency", frequency=stokes_frequency),
            step=step,
        )

    return run


@pytest.fixture(scope="session")
def two_modes(undamped_R):
    """A velocity along modes 1 and 2 of R after which V moves by about 1 %."""
    m = undamped_R
    size = 0.005 * m.rest.volume / m.dV[:2] * m.omega[:2]
    return size @ m.shapes.real[:2]


@pytest.fixture(scope="session")
def undamped_kick(kick, two_modes):
    return kick(jnp.zeros_like(two_modes), two_modes)
