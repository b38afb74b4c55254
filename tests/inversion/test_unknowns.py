"""Numbers of the laboratory and numbers of the simulator."""

import numpy as np
import pytest

from jshell.calibration import Prior
from jshell.errors import BadName, BadValue
from jshell.inversion import Unknown
from jshell.inversion.unknowns import SI, Seen, parameters
from jshell.shell import Gas, Liquid, Load, Reduced, Shell, scales

VALUES = {
    "radius": 0.0225, "thickness": 0.005, "youngs_modulus": 0.5e6, "gas_pressure": 99e3, "outer_pressure": 178e3,
    "density": 1260.0, "viscosity": 1.06, "kappa": 1.3, "poisson_ratio": 0.45, "pad": 0.33, "weak_spot": 0.1,
    "retardation": 2e-6,
}  # fmt: skip


def test_numbers_without_units_are_those_of_reduced():
    shell, liquid = Shell(0.0225, 0.005, 0.5e6, 0.45), Liquid(1260.0, 1.06)
    told = Reduced.from_si(shell, Gas(99e3, 1.3), liquid, Load(178e3))
    seen = Seen(VALUES, True)
    retardation = 2e-6 / scales(shell, liquid).time
    dimensional = [told.thickness, told.gas_pressure, told.outer_pressure, told.viscosity]
    expected = [*dimensional, 1.3, 0.45, 0.33, 0.1, retardation]
    np.testing.assert_allclose(seen.numbers, [float(x) for x in expected], rtol=1e-13)
    np.testing.assert_allclose(seen.time, scales(shell, liquid).time, rtol=1e-13)


@pytest.mark.parametrize("name", SI)
def test_slopes_are_central_differences(name):
    positive, step = SI[name].positive, 1e-6
    at = lambda sign: Seen(  # noqa: E731
        VALUES | {name: VALUES[name] * np.exp(sign * step) if positive else VALUES[name] + sign * step}, True
    )
    low, high = at(-1), at(1)
    change, time, length = Seen(VALUES, True).slope(name)
    np.testing.assert_allclose(change, (high.numbers - low.numbers) / (2 * step), rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(time, np.log(high.time / low.time) / (2 * step), atol=1e-9)
    np.testing.assert_allclose(length, np.log(high.length / low.length) / (2 * step), atol=1e-9)


def test_a_local_unknown_belongs_to_its_recording():
    known = {n: v for n, v in VALUES.items() if n not in ("outer_pressure", "youngs_modulus")}
    whole = parameters([known, known], ("youngs_modulus", "outer_pressure"), ("outer_pressure",), True)
    assert whole.names == ("youngs_modulus", "outer_pressure[1]", "outer_pressure[2]")
    numbers, mine = whole.of(1, np.array([1e6, 1e5, 2e5]))
    assert mine == [0, 2]
    assert numbers["outer_pressure"] == 2e5


def test_what_the_solver_sees_leads_back():
    known = {n: v for n, v in VALUES.items() if n not in ("pad", "thickness")}
    whole = parameters([known], {"pad": Unknown(0.2, 0.5), "thickness": Prior(5e-3, 1e-4)}, (), True)
    values = np.array([0.3, 4.9e-3])
    np.testing.assert_allclose(whole.to_values(whole.to_u(values)), values, rtol=1e-14)
    assert (whole.low[0], whole.high[0]) == (0.2, 0.5)


@pytest.mark.parametrize(
    ("unknown", "error"),
    [((), BadValue), (("alpha1",), BadName), ({"pad": (0.4, 0.2)}, BadValue), ({"pad": "a"}, BadValue),
     ({"pad": Prior(0.9, 0.1)}, BadValue)],
)  # fmt: skip
def test_wrong_questions_are_refused(unknown, error):
    with pytest.raises(error):
        parameters([VALUES], unknown, (), True)


def test_a_number_that_is_neither_known_nor_asked_is_named():
    known = {n: v for n, v in VALUES.items() if n not in ("radius", "youngs_modulus")}
    with pytest.raises(BadValue, match="radius"):
        parameters([known], ("youngs_modulus",), (), True)


@pytest.mark.parametrize(
    ("known", "words"),
    [
        ({"thickness": 5.0}, "at most 0.5 of the radius. Write lengths in m"),
        ({"thickness": -0.005}, "a number above 0"),
        ({"kappa": float("nan")}, "from 1 to 2"),
        ({"poisson_ratio": 0.6}, "from -1 to 0.5"),
        ({"density": 0.0}, "density: found 0"),
        ({"viscosity": -1.0}, "viscosity: found -1"),
    ],
)
def test_what_no_shell_can_have_is_refused(known, words):
    numbers = {
        "radius": 0.02, "thickness": 0.003, "gas_pressure": 1e5, "outer_pressure": 1.5e5, "density": 1e3,
        "viscosity": 1.0,
    }  # fmt: skip
    parameters([numbers], ("youngs_modulus",), (), True)
    with pytest.raises(BadValue, match=words):
        parameters([numbers | known], ("youngs_modulus",), (), True)
    with pytest.raises(BadName, match=r"Write youngs_modulus\.$"):
        parameters([numbers], ("E",), (), True)
