"""The simulator itself: its derivatives, and the shipped recording of another code."""

import jax.numpy as jnp
import numpy as np
import pytest

import jshell as js
from jshell.errors import Outcome
from jshell.inversion.model import ELEMENTS
from jshell.inversion.response import (
    BLUNT,
    DIRECTIONS,
    FIELDS,
    SHARP,
    mesh,
    response_program,
    sharpening_program,
    standing_program,
)

HELD = np.array([0.22, 0.9, 1.6, 0.004, 1.4, 0.5, 0.3, 0.05, 0.01])


@pytest.mark.slow
def test_changes_of_the_response_are_central_differences():
    near = sharpening_program(ELEMENTS)(standing_program(ELEMENTS, True)(jnp.asarray(HELD)), jnp.asarray(SHARP))
    program = response_program(ELEMENTS, True, True)
    ask = lambda x, tangents: program(jnp.asarray(x), jnp.asarray(tangents), near)  # noqa: E731
    against = lambda part: part.shapes / part.shapes[:, 2:3]  # noqa: E731  a mode's own size means nothing
    still = np.zeros((DIRECTIONS, len(FIELDS)))
    for first in range(0, len(FIELDS), DIRECTIONS):
        tangents = np.eye(first + DIRECTIONS, len(FIELDS))[first:]  # zeros beyond the last field
        value, change = ask(HELD, tangents)
        for row, tangent in enumerate(tangents[: len(FIELDS) - first]):
            step = 1e-5 * (0.1 if tangent[3] else 1.0)
            (high, _), (low, _) = (ask(HELD + sign * step * tangent, still) for sign in (1, -1))
            pairs = [(high.rates - low.rates, change.rates[row]), (high.rest - low.rest, change.rest[row])]
            moved = change.shapes[row] / value.shapes[:, 2:3]
            pairs.append((against(high) - against(low), moved - against(value) * moved[:, 2:3]))
            for difference, slope in pairs:
                size = np.abs(slope).max()
                assert np.abs(difference / (2 * step) - slope).max() <= 1e-6 * size + 1e-9, FIELDS[first + row]


@pytest.mark.slow
def test_a_held_shells_modes_at_their_limit_are_another_codes(R):
    """In a liquid of hardly any viscosity; elsewhere derived, see docs/validation.md."""
    pad, known, c = 0.3272492347489368, np.array([0.452900, 1.904918, 2.784431]), R
    numbers = jnp.array([c.thickness, c.gas_pressure, c.outer_pressure, 1e-12, c.kappa, c.poisson_ratio, pad, 0.0, 0.0])
    plain, still = standing_program(ELEMENTS, True)(numbers), jnp.zeros((DIRECTIONS, len(FIELDS)))
    edge, lengths, omega = mesh(ELEMENTS, True).edge, [], []
    for ratio in (SHARP, BLUNT):
        near = sharpening_program(ELEMENTS)(plain, jnp.asarray(ratio))
        omega.append(np.asarray(response_program(ELEMENTS, True)(numbers, still, near)[0].rates.imag)[:3])
        lengths.append(float(near.nodes[edge] - near.nodes[edge - 1]))
    np.testing.assert_allclose(omega[0], known, rtol=4e-4)
    np.testing.assert_allclose(omega[0] - omega[1], (known - omega[1]) * (1 - lengths[0] / lengths[1]), atol=3e-4)
    limit = omega[0] + lengths[0] / (lengths[1] - lengths[0]) * (omega[0] - omega[1])
    np.testing.assert_allclose(limit, known, rtol=1e-4)


@pytest.mark.slow
def test_the_shipped_recording_is_of_the_shell_it_was_made_with():
    found = js.invert(js.io.read_trace(js.io.example("attached_R_HW.csv")), unknown=("youngs_modulus", "gas_pressure"))
    assert found.outcome == Outcome.OK
    truth = {"youngs_modulus": 0.5e6, "gas_pressure": 99e3, "pad": 0.314, "weak_spot": 0.15}
    for name, value in truth.items():
        low, high = found.interval(name)
        assert low < value < high, (name, low, high)
    assert found["youngs_modulus"].value == pytest.approx(0.5e6, rel=0.05)
    assert found["gas_pressure"].value == pytest.approx(99e3, rel=0.02)
    assert any(text.startswith("misfit") for text in found.warnings)  # its swing is not small
