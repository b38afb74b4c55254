"""What drives a run from the terminal, and what takes its energy: options arrive where Python's do."""

import json

import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from jshell import dynamics, presets
from jshell.cli.driving import forcing, losses, outer_pressure
from jshell.cli.main import app
from jshell.cli.problem import Case
from jshell.contour import meridian
from jshell.dynamics import Losses
from jshell.dynamics.run import Setup
from jshell.errors import BadFile, BadName, BadUnits, BadValue, GuessWarning, JshellError
from jshell.io import read_trace
from jshell.membrane import WallLoss
from jshell.oscillator import Pulse, Reynolds, Sum, Tone
from jshell.shell import SPHERE_VOLUME
from jshell.trace import Trace

runner = CliRunner()
SHORT = ("simulate", "--preset", "R", "--elements", "12", "--duration", "1", "--every", "0.1", "--step", "0.1")


def answer(monkeypatch, *words, code=0) -> dict:
    words = [str(word) for word in (*words, "--json")]
    monkeypatch.setattr("sys.argv", ["jshell", *words])
    result = runner.invoke(app, words)
    assert result.exit_code == code, (result.output, result.exception)
    return json.loads(result.stdout)


WORDS = ("--tone", 0.02, 3.0, "--burst", 0.05, 9.0, 1, "--burst-start", 0.2, "--shell-density", 0.8)
LOST = ("--wall-dilatation", 0.01, "--reynolds")


@pytest.mark.long
def test_options_arrive_as_pythons_arguments(monkeypatch, tmp_path):
    seen: dict = {}

    def noted(conditions, **options):
        seen.update(options, conditions=conditions)
        shape, t = meridian(12), jnp.linspace(0.0, 1.0, 11)
        size = 1 - 0.01 * t
        numbers = {"V": SPHERE_VOLUME * size**3, "S": 4 * jnp.pi * size**2, "H": 2 * size, "W": 2 * size}
        numbers |= {"x_front": size, "x_back": -size, "V_rate": -0.04 * jnp.pi * size**2}
        q, u = size[:, None] * shape.sphere[None], jnp.tile(-0.01 * shape.sphere, (11, 1))
        setup = Setup(shape, jnp.ones(shape.angles.size), None, conditions, Losses(), jnp.asarray(0.0), "current")
        return dynamics.Motion(Trace(t, numbers, conditions), q, u, jnp.tile(shape.nodes, (11, 1)), setup)

    monkeypatch.setattr(dynamics, "record", noted)
    out, film, gif = tmp_path / "T.csv", tmp_path / "film.png", tmp_path / "film.gif"
    words = (*SHORT, "--out", out, *WORDS, *LOST, "--follow", "--checkpoint", tmp_path / "run.npz")
    found = answer(monkeypatch, *words, "--film", film, "--gif", gif)
    assert (found["outcome"], found["film"], found["gif"]) == ("ok", str(film), str(gif))
    assert seen["forcing"] == Sum((Tone(0.02, 3.0), Pulse(0.05, 9.0, 1, start=0.2)))
    assert seen["losses"].wall == WallLoss(dilatation=0.01)
    assert (seen["losses"].stokes, seen["losses"].order, seen["losses"].bulk) == ("memory", 2, False)
    assert (seen["shell_density"], seen["follow"], seen["checkpoint"]) == (0.8, True, tmp_path / "run.npz")
    assert (seen["pressure"], seen["progress"]) == (None, None)
    assert read_trace(out)["V_rate"][0] == pytest.approx(-0.04 * np.pi)
    assert film.stat().st_size > 10_000
    with Image.open(gif) as pictures:
        assert pictures.n_frames > 1


@pytest.mark.slow
def test_a_run_from_the_terminal_is_the_run_of_python(monkeypatch, tmp_path):
    pressure = tmp_path / "P.csv"
    pressure.write_text("t,P_ext\n0,0.9\n0.5,1.0\n2,1.1\n")
    out = tmp_path / "T.nc"
    words = (*SHORT, "--out", out, "--pressure-file", pressure, *WORDS, *LOST, "--checkpoint", tmp_path / "run.npz")
    assert answer(monkeypatch, *words)["outcome"] == "ok"

    ours = dynamics.simulate(
        presets.R.conditions,
        duration=1.0,
        every=0.1,
        step=0.1,
        elements=12,
        pressure=(jnp.array([0.0, 0.5, 2.0]), jnp.array([0.9, 1.0, 1.1])),
        forcing=Sum((Tone(0.02, 3.0), Pulse(0.05, 9.0, 1, start=0.2))),
        shell_density=0.8,
        losses=Losses(wall=WallLoss(dilatation=0.01), drag=Reynolds()),
        checkpoint=tmp_path / "run.npz",  # only the same run may read it
    )
    written = read_trace(out)
    t = np.asarray(written.times)
    for name in ours.channels:
        np.testing.assert_array_equal(written[name], ours[name])
    added = Tone(0.02, 3.0)(t) + Pulse(0.05, 9.0, 1, start=0.2)(t)
    np.testing.assert_allclose(written["P_ext"], np.interp(t, [0, 0.5, 2], [0.9, 1.0, 1.1]) + added, rtol=1e-12)
    assert written["loss_bulk"][-1] > 0
    assert written["loss_wall"][-1] > 0


def test_losses_are_those_asked_for():
    assert losses(None, None, False, None, None, False) == Losses()
    assert losses(None, 1.2, False, None, None, False) == Losses("frequency", frequency=1.2)
    found = losses("none", None, True, None, 0.05, True)
    assert (found.stokes, found.bulk) == ("none", True)
    assert found.wall == WallLoss(retardation=0.05)
    assert isinstance(found.drag, Reynolds)
    for wrong in (("memory", 1.2), ("frequency", None)):
        with pytest.raises(BadValue, match="--stokes-frequency"):
            losses(*wrong, False, None, None, False)
    assert losses(None, None, False, None, None, False, order=1) == Losses(order=1)
    with pytest.raises(BadValue, match="bulk"):  # on a wall that sticks it is one of four terms of its order
        losses(None, None, True, None, None, False)
    with pytest.raises(BadName, match="--stokes"):
        losses("slip", None, False, None, None, False)


def test_forcing_is_what_was_asked_for():
    assert forcing(None, None, 0.0) is None
    assert forcing((0.1, 2.0), None, 0.0) == Tone(0.1, 2.0)
    assert forcing(None, (0.1, 2.0, 3), 5.0) == Pulse(0.1, 2.0, 3, start=5.0)


def test_a_pressure_in_si_is_read_by_the_conditions_of_the_command_line(tmp_path):
    macro = presets.preset("R-macro")
    path = tmp_path / "P.csv"
    path.write_text("t [ms],P_ext [kPa]\n0,100\n10,177\n")
    times, values = outer_pressure(path, Case(macro.conditions, macro.unit, True))
    # R0 22.5 mm, d 5 mm, E 0.5 MPa, 1260 kg/m³: E d/R0 is 111.1 kPa, one unit of time 2.396 ms
    np.testing.assert_allclose(times, [0, 10 / 2.396], rtol=1e-3)
    np.testing.assert_allclose(values, [100 / 111.11, 177 / 111.11], rtol=1e-4)
    with pytest.raises(BadUnits):
        outer_pressure(path, Case(presets.R.conditions, None, True))
    path.write_text("t,pressure\n0,1\n1,1\n")
    with pytest.raises(BadFile, match="P_ext"):
        outer_pressure(path, Case(presets.R.conditions, None, True))


@pytest.mark.parametrize(
    ("words", "place"),
    [
        (("--stokes", "slip"), "--stokes"),
        (("--film", "x.bmp"), "--film"),
        (("--gif", "x.png"), "--gif"),
        (("--gif", "/no/such/folder/x.gif"), "--gif"),
        (("--checkpoint", "/no/such/folder/x.npz"), "--checkpoint"),
        (("--tone", "0.1", "-2"), "angular_frequency"),
    ],
)
def test_an_option_without_meaning_is_refused_before_the_work(words, place, monkeypatch, tmp_path):
    found = answer(monkeypatch, *SHORT, "--out", tmp_path / "T.csv", *words, code=2)["error"]
    assert found["place"] == place


def test_a_pressure_file_is_read_as_its_owner_says(monkeypatch, tmp_path):
    file = tmp_path / "P.csv"
    file.write_text("0;101,3\n1;120,5\n2;178,2\n")
    shell = presets.preset("R-macro")  # in SI
    problem = Case(shell.conditions, shell.unit, True)
    with pytest.raises(JshellError):
        outer_pressure(file, problem)
    said = {"columns": "P_ext=2", "units": "P_ext=kPa", "rate": 500.0}
    with pytest.warns(GuessWarning, match="column 2 read as `P_ext`"):
        times, pressure = outer_pressure(file, problem, said)
    np.testing.assert_allclose(np.asarray(times) * shell.unit.time, [0, 0.002, 0.004])
    np.testing.assert_allclose(np.asarray(pressure) * shell.unit.pressure, [101_300, 120_500, 178_200])
    words = (*SHORT, "--out", tmp_path / "a.csv", "--pressure-file", file, "--pressure-columns", "t=1,P_ext=7")
    wrong = answer_of_error(monkeypatch, *words)
    assert "P_ext=7: found no such column" in wrong


def answer_of_error(monkeypatch, *words) -> str:
    monkeypatch.setattr("sys.argv", ["jshell", *map(str, words)])
    result = runner.invoke(app, [str(word) for word in words])
    assert result.exit_code != 0, result.output
    return result.output + str(result.exception)
