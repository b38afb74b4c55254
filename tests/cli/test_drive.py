"""The verbs of the driven shell: drive, cycle, bifurcation, softening, sensitivity, design."""

import json
import math

import pytest
from scipy.io import loadmat
from typer.testing import CliRunner

from jshell import io
from jshell.cli.constants import BETA1, damped
from jshell.cli.decay import decay, line, written
from jshell.cli.main import app
from jshell.cli.output import judged
from jshell.cli.problem import ConditionOptions, conditions
from jshell.errors import BadValue, Outcome
from jshell.oscillator import fitted_decay_time

SHELL = ["--d-hat", "0.08", "--p0-hat", "0.9", "--pext-hat", "1.2", "--eta-hat", "0.02"]


def _asked(*words: str) -> tuple[int, dict]:
    found = CliRunner().invoke(app, [*words, "--json"])
    return found.exit_code, json.loads(found.stdout.splitlines()[-1])


def _refused(*words: str) -> str:
    found = CliRunner().invoke(app, list(words))
    assert found.exit_code == 2
    return found.stderr


@pytest.mark.long
def test_a_pulse_is_driven_drawn_and_exported(tmp_path):
    mat, png = tmp_path / "a.mat", tmp_path / "a.png"
    code, told = _asked("drive", *SHELL, "--forcing", "pulse", "--amplitude", "0.01", "--omega", "0.8",
                        "--duration", "50", "--every", "0.5", "--out", str(mat), "--plot", str(png))  # fmt: skip
    assert code == 0
    assert told["outcome"] == "ok"
    assert told["V_min_over_V0"] < told["V_rest_over_V0"] < told["V_max_over_V0"]
    assert told["energy_imbalance"] < 1e-6
    assert told["steps"]["accepted"] > 0
    assert told["pulsation"] == 0.8  # a key of JSON outlives the name of its option
    assert png.stat().st_size > 10_000
    held = loadmat(mat)
    assert held["V"].size == 101
    assert held["P_ext"].min() == pytest.approx(1.19, abs=1e-3)


@pytest.mark.long
def test_a_drive_of_r_rings_down_as_the_simulator_does_and_says_so(tmp_path):
    csv = tmp_path / "a.csv"
    asked = ("drive", "--preset", "R", "--forcing", "step", "--omega", "1", "--duration", "2", "--every", "0.5")
    code, told = _asked(*asked, "--out", str(csv))
    assert code == 0
    assert told["decay"]["origin"] == "law"
    assert told["decay"]["tau"] == pytest.approx(7.180, rel=0.1)  # the simulator's slow mode in the exact liquid
    assert told["decay"]["outside"] == []
    assert dict(io.read_trace(csv).settings)["decay"] == "law"
    code, told = _asked(*asked, "--beta1", f"{BETA1!r}")
    assert told["decay"]["origin"] == "given beta1"
    assert told["decay"]["tau"] == pytest.approx(85.0, rel=1e-12)  # ½ (α1/β1)/η̂ = ½ 0.68/0.004
    said = CliRunner().invoke(app, list(asked)).stdout
    assert "decay: τ = 7.55 from a law fitted to the simulator's modes" in said
    assert "the source's β1 = 5.29 (τ = 85); --beta1 or --tau choose" in said


def test_the_decay_is_what_was_asked_for_else_the_laws():
    R, own = conditions(ConditionOptions(preset="R")), damped()
    constants, law, found = decay(R, own, None)
    assert (law, found.origin, line(found)[-25:]) == ("viscous", "law", "; --beta1 or --tau choose")
    # what runs is what is said: τ = α1/(2 β1 η̂)
    assert 3.6 / (2 * float(constants.beta1) * 0.004) == pytest.approx(found.tau, rel=1e-14)
    assert found.tau == pytest.approx(float(fitted_decay_time(R.conditions)), rel=1e-14)

    given = damped(beta1=2.0)
    constants, law, found = decay(R, given, None)
    assert (law, found.origin, found.tau) == ("viscous", "given beta1", pytest.approx(3.6 / (2 * 2 * 0.004)))
    assert constants == given.constants
    assert dict(written(found)) == {"decay": "given beta1", "tau": "225"}
    assert line(decay(R, damped(beta1=0.0), None)[2]) == "decay: τ = ∞ by the given β1"
    for drag in (None, "equal_decay"):
        _, law, found = decay(R, own, 5.0, drag)
        assert (law, found.origin, found.tau, line(found)) == (
            "equal_decay",
            "given tau",
            5.0,
            "decay: τ = 5, as given",
        )
    _, law, found = decay(R, own, None, "reynolds")
    assert (law, found.origin, math.isnan(found.tau)) == ("reynolds", "reynolds", True)
    _, law, found = decay(R, own, None, "none")
    assert (law, found.origin, found.record()["tau"]) == ("none", "none", math.inf)
    # the modes that the law was fitted to have a Stokes layer: beside another the source's viscous limit stays
    constants, law, found = decay(R, own, None, layer=True)
    assert (found.origin, float(constants.beta1), found.tau) == ("source beta1", BETA1, pytest.approx(85.0))


def test_two_decays_at_once_are_refused():
    R = conditions(ConditionOptions(preset="R"))
    for constants, drag, other in ((damped(beta1=2.0), None, "--beta1"), (damped(), "reynolds", "--drag reynolds")):
        with pytest.raises(BadValue, match=other):
            decay(R, constants, 5.0, drag)
    bare = conditions(ConditionOptions(d_hat=0.08, p0_hat=0.9, pext_hat=1.2))
    with pytest.raises(BadValue, match="--eta-hat"):
        decay(bare, damped(), None)
    assert decay(bare, damped(), 5.0)[2].tau == 5.0


@pytest.mark.slow
def test_a_drive_that_unbuckles_exits_with_3():
    code, told = _asked("drive", *SHELL, "--forcing", "step", "--amplitude", "-0.4", "--omega", "1",
                        "--duration", "50", "--every", "0.5")  # fmt: skip
    assert code == 3
    assert told["outcome"] == "no_buckled_state"
    assert told["ended_at"] > 0


def test_kilopascals_need_si_conditions():
    assert "--kpa" in _refused("drive", *SHELL, "--kpa", "50")


@pytest.mark.long
def test_sensitivity_and_design_speak(tmp_path):
    code, told = _asked("sensitivity", *SHELL, "--of", "omega_plus", "--plot", str(tmp_path / "e.png"))
    assert code == 0
    assert told["inputs"]["alpha1"]["elasticity"] < 0
    assert len(told["one_shell_leaves_free"]) == 1
    # what eq:taureal depends on is asked of the source's β1: 3.6/(2 · 5.29 · 0.02)
    code, told = _asked("sensitivity", *SHELL, "--of", "tau")
    assert told["value"] == pytest.approx(17.0)
    code, told = _asked("sensitivity", *SHELL, "--range", "alpha1=3,4", "--range", "alpha2=1,1.2", "--rows", "64")
    assert code == 0
    assert told["missing"] == 0
    code, told = _asked("design", "--omega-minus", "0.8", "--omega-plus", "1.6")
    assert code == 0
    assert told["shells"][0]["d_hat"] > 0
    assert "--range" in _refused("sensitivity", *SHELL, "--range", "alpha1=three,4")


@pytest.mark.slow
def test_a_cycle_buckles_and_unbuckles_and_is_drawn(tmp_path):
    png = tmp_path / "h.png"
    code, told = _asked("cycle", *SHELL, "--low", "0.8", "--high", "1.3", "--period", "60", "--cycles", "1",
                        "--samples", "50", "--tau", "4", "--plot", str(png))  # fmt: skip
    assert code == 0
    assert [switch["buckles"] for switch in told["switches"]] == [True, False]
    at = told["thresholds"]
    assert 0.8 < at["unbuckling_pressure"] < at["buckling_pressure"] < 1.3
    assert told["decay"]["origin"] == "given tau"
    assert png.stat().st_size > 5_000
    assert "--low" in _refused("cycle", *SHELL, "--low", "2", "--high", "1")


@pytest.mark.long
def test_a_bifurcation_counts_what_ends_and_is_drawn(tmp_path):
    png = tmp_path / "b.png"
    code, told = _asked("bifurcation", *SHELL, "--lowest", "0.001", "--highest", "2", "--lanes", "3", "--omega",
                        "1.1", "--periods", "30", "--keep", "10", "--plot", str(png))  # fmt: skip
    assert code == 0
    assert told["lanes"]["outcome"][0] == "ok"
    assert told["lanes"]["outcome"][2] == "no_buckled_state"
    assert told["lanes"]["volume_over_V0"][2][0] is None
    assert told["decay"]["origin"] == "law"
    assert png.stat().st_size > 5_000
    assert "--lanes" in _refused("bifurcation", *SHELL, "--highest", "0.1", "--lanes", "1")


@pytest.mark.long
def test_softening_stands_beside_the_simulator(tmp_path):
    png = tmp_path / "s.png"
    code, told = _asked("softening", "--points", "20", "--plot", str(png))
    assert code == 0
    assert told["slow"] == pytest.approx(4.53, abs=0.005)
    assert told["simulated"][0]["omega"][0] == pytest.approx(0.595, abs=1e-3)
    assert png.stat().st_size > 5_000
    assert "--d-hat" in _refused("softening", "--d-hat", "-1")


def test_the_next_experiment_is_ranked_and_drawn(tmp_path):
    png = tmp_path / "n.png"
    code, told = _asked("sensitivity", *SHELL, "--next", "0.08,0.9,1.2", "--next", "0.2,0.4,1.2", "--plot", str(png))
    assert code == 0
    # the shell that was measured already tells nothing new
    assert told["gain"][1] > told["gain"][0]
    assert told["best"]["d_hat"] == 0.2
    assert png.stat().st_size > 5_000
    assert "--next" in _refused("sensitivity", *SHELL, "--next", "0.1,0.9")


@pytest.mark.parametrize("at", [0, 30])
def test_a_number_that_is_none_is_an_outcome_and_never_in_a_file_under_ok(tmp_path, monkeypatch, at):
    import numpy as np

    from jshell.dynamics import simulate
    from jshell.trace import Trace

    def broken(conditions, **asked):
        values = np.linspace(3.0, 2.5, 40)
        values[at] = np.nan
        return Trace(0.5 * np.arange(40.0), {"V": values, "S": np.full(40, 12.5)}, conditions)

    monkeypatch.setattr("jshell.dynamics.simulate", broken)
    assert simulate is not broken
    path = tmp_path / "a.csv"
    code, told = _asked("simulate", *SHELL, "--duration", "20", "--out", str(path))
    assert (code, told["outcome"]) == (3, "not_finite")
    assert path.exists() == (at > 0)
    if at:
        kept = io.read_trace(path)
        assert (int(kept.outcome), len(kept.times)) == (Outcome.NOT_FINITE, at)
    assert judged(Outcome.CONTACT, np.nan) == Outcome.CONTACT
    assert judged(Outcome.OK, np.ones(2), 1.0) == Outcome.OK
    assert "fit" in Outcome.NOT_FINITE.advice


@pytest.mark.slow
def test_a_thick_layer_is_said_beside_what_the_exact_liquid_does():
    asked = [*SHELL[:-1], "0.1", "--layer", "1", "--amplitude", "0.005", "--duration", "20", "--every", "0.5"]
    told = CliRunner().invoke(app, ["drive", *asked]).stderr
    assert "R0 thick" in told
    assert "the exact liquid says: omega" in told
