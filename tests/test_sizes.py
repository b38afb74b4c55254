"""Sizes that no machine holds are refused before memory is asked for."""

import pytest
from typer.testing import CliRunner

import jshell as js
from jshell.cli.main import app
from jshell.errors import BadValue

R = js.presets.R.conditions


@pytest.mark.parametrize(
    "options",
    [{"duration": 1e12}, {"every": 1e-12}, {"step": 1e-12}, {"duration": 1e9, "every": 1.0}, {"elements": 10**5}],
    ids=str,
)
def test_an_absurd_run_is_refused(options):
    with pytest.raises(BadValue, match="at most"):
        js.dynamics.simulate(R, **options)


def test_absurd_elements_are_refused_of_shapes_and_modes():
    with pytest.raises(BadValue, match="at most"):
        js.membrane.rest(R, elements=10**5)
    with pytest.raises(BadValue, match="at most"):
        js.dynamics.modes(R, elements=10**6)


@pytest.mark.parametrize(
    "words", [("--duration", "1e12"), ("--every", "1e-12"), ("--pulsation", "1e12"), ("--duration", "nan")], ids=str
)
def test_an_absurd_drive_is_refused(words):
    found = CliRunner().invoke(app, ["drive", "--preset", "R", *words])
    assert found.exit_code == 2
    assert "expected" in found.stderr


def test_samples_too_coarse_for_the_drive_are_refused_or_refined():
    shell = [
        "--r0",
        "2e-6",
        "--d",
        "2e-7",
        "--e",
        "2e6",
        "--p0",
        "1e5",
        "--pext",
        "2e5",
        "--eta",
        "1e-3",
        "--rho",
        "1000",
    ]
    coarse = CliRunner().invoke(app, ["drive", *shell, "--mhz", "30", "--every", "0.5", "--duration", "2"])
    assert coarse.exit_code == 2
    assert "two samples a period" in coarse.stderr
