"""The terminal: JSON on stdout, words on stderr, and the exit codes a script relies on."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from jshell.cli.main import app
from jshell.oscillator import Coefficients, frequencies
from jshell.shell import Reduced

DATA = Path(__file__).parents[1] / "data" / "reference"
RECORDING = Path(__file__).parents[2] / "data" / "examples" / "attached_R_HW.csv"
CONDITIONS = "# d_hat: 0.22\n# P0_hat: 0.9\n# Pext_hat: 1.6\n# eta_hat: 0.004\n"
runner = CliRunner()


def run(*words: str, code: int = 0) -> str:
    result = runner.invoke(app, [str(word) for word in words])
    assert result.exit_code == code, (result.output, result.exception)
    return result.stdout


def answer(monkeypatch, *words, code: int = 0) -> dict:
    monkeypatch.setattr("sys.argv", ["jshell", *(str(word) for word in words), "--json"])
    out = run(*words, "--json", code=code)
    assert "NaN" not in out
    assert "Infinity" not in out
    return json.loads(out)


def test_rest_answers_one_json_object(monkeypatch):
    found = answer(monkeypatch, "rest", "--preset", "R", "--elements", "24")
    assert found["outcome"] == "ok"
    # two independent codes: 0.6992, 0.9484, 1.4853
    assert [found[key] for key in ("V_over_V0", "S_over_S0", "P")] == pytest.approx([0.6992, 0.9484, 1.4853], rel=2e-4)


def test_a_preset_can_be_overridden(monkeypatch):
    found = answer(monkeypatch, "rest", "--preset", "R", "--pext-hat", "1.62", "--elements", "24")
    assert found["conditions"]["Pext_hat"] == 1.62
    assert found["conditions"]["eta_hat"] == 0.004


def test_si_conditions_are_made_dimensionless(monkeypatch):
    si = [
        "--r0",
        "22.5e-3",
        "--d",
        "5e-3",
        "--e",
        "0.5e6",
        "--p0",
        "1e5",
        "--pext",
        "1.77e5",
        "--rho",
        "1260",
        "--eta",
        "1",
    ]
    by_hand = answer(monkeypatch, "frequencies", *si)
    by_name = answer(monkeypatch, "frequencies", "--preset", "R-macro")
    assert by_hand["conditions"] == pytest.approx(by_name["conditions"])
    assert by_hand["conditions"]["Pext_hat"] == pytest.approx(1.593)


def test_a_load_too_low_for_a_dimple_is_an_outcome(monkeypatch):
    found = answer(monkeypatch, "rest", "--preset", "R", "--pext-hat", "1.0", "--elements", "24", code=3)
    assert found["outcome"] == "no_buckled_state"
    assert found["V_over_V0"] is None


@pytest.mark.long
def test_modes_are_ascending_and_have_no_decay_without_loss(monkeypatch):
    words = ("modes", "--preset", "R", "--elements", "24")
    free = answer(monkeypatch, *words, "--liquid", "ideal")["modes"]
    assert [mode["omega"] for mode in free] == pytest.approx([1.190, 1.981, 2.931, 4.269], rel=1e-3)
    assert [mode["tau"] for mode in free] == [None] * 4
    lossy = answer(monkeypatch, *words, "--liquid", "ideal", "--retardation", "0.02")["modes"]
    # the dense solver's of tests/dynamics/test_modes.py
    assert [mode["tau"] for mode in lossy[:2]] == pytest.approx([40.61, 17.00], rel=2e-3)
    damped = answer(monkeypatch, *words)["modes"]
    for mode in damped:
        assert mode["omega"] == pytest.approx(np.hypot(mode["Omega"], 1 / mode["tau"]))
        assert mode["dV"] >= 0


def test_modes_refuse_to_guess_a_viscosity(monkeypatch):
    found = answer(monkeypatch, "modes", "--d-hat", "0.2", "--p0-hat", "0.9", "--pext-hat", "1.6", code=2)
    assert found["error"]["place"] == "--eta-hat"


@pytest.mark.long
def test_simulate_writes_a_file_that_analyse_reads(monkeypatch, tmp_path):
    out = tmp_path / "T.csv"
    words = ("simulate", "--preset", "R", "--out", out, "--elements", "12", "--duration", "4", "--every", "0.1")
    found = answer(monkeypatch, *words, "--step", "0.1", "--stokes-frequency", "1.2")
    assert found["outcome"] == "ok"
    header = out.read_text().splitlines()
    assert {"# d_hat: 0.22", "# elements: 12", "# ramp: 4.0"} & set(header) >= {"# d_hat: 0.22", "# elements: 12"}
    assert next(line for line in header if not line.startswith("#")).startswith("t,V,S,H,W,")
    # a ramp that has not buckled the shell holds no ring-down: said, not guessed
    heard = answer(monkeypatch, "analyse", out, code=3)
    assert heard["outcome"] == "unusable_data"
    assert heard["omega_minus"] is None


def test_analyse_hears_the_reference_trace(monkeypatch):
    found = answer(monkeypatch, "analyse", DATA / "trace_R.csv", code=3)  # 3: two modes are not enough
    assert found["verdict"] == "more than two"
    assert found["omega_minus"] == pytest.approx(1.07, abs=0.05)
    assert found["omega_plus"] == pytest.approx(1.75, abs=0.08)
    assert 5 < found["tau"] < 10


def test_analyse_hears_the_attached_trace_on_its_height(monkeypatch):
    found = answer(monkeypatch, "analyse", DATA / "trace_R_attached.csv", "--channel", "H", code=3)
    assert found["omega_minus"] == pytest.approx(0.40, abs=0.02)
    assert found["omega_plus"] == pytest.approx(1.63, abs=0.06)
    assert found["amplitude_ratio"]["H"] < 0.05
    assert found["verdict"] in ("more than two", "misfit")  # a simulation has more modes than two, and hardly any noise


def test_analyse_answers_a_camera_recording_in_hertz(monkeypatch):
    found = answer(monkeypatch, "analyse", RECORDING, code=3)  # 3: its modes decay apart
    assert found["verdict"] == "misfit"
    # 0.40 and 1.63 at 66.1 Hz a unit
    assert found["f_minus_Hz"] == pytest.approx(26.4, abs=1.3)
    assert found["f_plus_Hz"] == pytest.approx(107.7, abs=4.0)


def table(path: Path, loads: tuple[float, ...]) -> Path:
    rows = ["d_hat,P0_hat,Pext_hat,omega_minus,omega_plus"]
    for load in loads:
        found = frequencies(Reduced(0.08, 0.9, load), Coefficients(3.0, 0.9, 0.2))
        rows.append(f"0.08,0.9,{load},{float(found.omega_minus)!r},{float(found.omega_plus)!r}")
    path.write_text("\n".join(rows) + "\n")
    return path


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:at this load the sphere:jshell.errors.RangeWarning")
def test_fit_of_a_table_finds_the_constants_that_made_it(monkeypatch, tmp_path):
    found = answer(monkeypatch, "fit", "--table", table(tmp_path / "f.csv", (1.1, 1.2, 1.4)))
    assert found["outcome"] == "ok"
    assert found["params"] == pytest.approx({"alpha1": 3.0, "alpha2": 0.9, "kVS": 0.2}, rel=1e-6)


def test_fit_of_one_shape_is_refused_as_rank_deficient(monkeypatch, tmp_path):
    found = answer(monkeypatch, "fit", "--table", table(tmp_path / "f.csv", (1.2,)), code=3)
    assert found["outcome"] == "rank_deficient"
    assert all(error is None for error in found["stderr"].values())


def test_fit_of_a_trace_draws_a_picture(monkeypatch, tmp_path):
    picture = tmp_path / "fit.png"
    words = ("fit", DATA / "trace_R_attached.csv", "--channel", "H", "--fix", "alpha2=1.1", "--plot", picture)
    found = answer(monkeypatch, *words, code=3)  # 3: a third mode is left in the residual
    assert found["params"]["alpha2"] == 1.1
    assert any("misfit" in text for text in found["warnings"])
    assert picture.stat().st_size > 5000


REFUSED = {
    "NaN": (CONDITIONS + "t,V,S\n0,2.9,12\n1,nan,12\n2,2.9,12\n", "row 7, column `V`"),
    "empty": ("", "bad.csv"),
    "no time": (CONDITIONS + "x,V,S\n0,2.9,12\n1,2.9,12\n", "row 5"),
    "one row": (CONDITIONS + "t,V,S\n0,2.9,12\n", "bad.csv"),
    "too large": (CONDITIONS + "t,V,S\n0,5.9,15.9\n1,5.9,15.9\n", "column `V`"),
    "unknown unit": (CONDITIONS + "t [s],V [furlong],S [m^2]\n0,2.9,12\n1,2.9,12\n", "bad.csv, row 5"),
    "units without SI": (CONDITIONS + "t [s],V [m^3],S [m^2]\n0,2.9,12\n1,2.9,12\n", "bad.csv"),
    "constant": (CONDITIONS + "t,V,S\n" + "".join(f"{k / 10},2.9,11.9\n" for k in range(200)), "channel 'V'"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_traces_are_refused_with_place_and_remedy(case, monkeypatch, tmp_path):
    text, place = REFUSED[case]
    (tmp_path / "bad.csv").write_text(text)
    found = answer(monkeypatch, "fit", tmp_path / "bad.csv", code=2)["error"]
    assert place in found["place"]
    assert found["found"]
    assert found["expected"]
    assert found["remedy"].endswith((".", "'"))


@pytest.mark.parametrize(
    ("words", "place"),
    [
        (("rest", "--d-hat", "-0.1", "--p0-hat", "1", "--pext-hat", "1"), "d_hat"),
        (("rest", "--preset", "Q"), "preset"),
        (("rest", "--preset", "R", "--d", "0.1"), "conditions"),
        (("rest",), "conditions"),
        (("rest", "--preset", "R", "--branch", "up"), "branch"),
        (("rest", "--preset", "R", "--elements", "3"), "elements"),
        (("fit",), "fit"),
        (("fit", "x.csv", "--fix", "gamma=1"), "--fix"),
        (("simulate", "--preset", "R", "--out", "x.csv", "--units", "si"), "--units"),
        (("simulate", "--preset", "R", "--out", "x.csv", "--weak-spot", "thin"), "--weak-spot"),
    ],
)
def test_bad_options_exit_with_two(words, place, monkeypatch):
    assert place in answer(monkeypatch, *words, code=2)["error"]["place"]


@pytest.mark.parametrize(
    ("words", "place", "found"),
    [
        (("rest", "--presett", "R"), "--presett", "No such option"),
        (("rest", "--preset"), "--preset", "requires an argument"),
        (("rest", "--elements", "many"), "--elements", "valid integer"),
        (("resst",), "jshell", "No such command 'resst'"),
        (("--colour", "rest"), "--colour", "No such option"),
        (("rest", "R"), "jshell rest", "unexpected extra argument"),
        (("analyse",), "file", "Missing argument"),
    ],
)
def test_a_command_line_that_cannot_be_read_is_answered_in_json_when_json_was_asked_for(words, place, found):
    asked = [words[0], "--json", *words[1:]] if words[0].islower() and words[0].isalpha() else [*words, "--json"]
    result = runner.invoke(app, asked, prog_name="jshell")
    problem = json.loads(result.stdout)["error"]
    assert result.exit_code == 2
    assert problem["place"] == place
    assert found in problem["found"]
    assert all(problem.values())
    assert result.stderr
    plain = runner.invoke(app, words, prog_name="jshell")
    assert (plain.exit_code, plain.stdout) == (2, "")


def test_version_is_told():
    assert run("--version").startswith("jshell ")


def test_a_crushed_sphere_does_not_take_the_buckled_answer_with_it(monkeypatch):
    found = answer(monkeypatch, "frequencies", "--preset", "R", "--pext-hat", "50")
    assert found["omega_sphere"] is None
    assert found["omega_minus"] > 0


@pytest.mark.parametrize("option", ["--out", "--plot"])
def test_a_path_that_cannot_be_written_is_refused_before_the_work(option, monkeypatch):
    verb = ("simulate", "--preset", "R") if option == "--out" else ("fit", DATA / "trace_R.csv")
    found = answer(monkeypatch, *verb, option, "/no/such/folder/x.png", code=2)["error"]
    assert found["place"] == option


@pytest.mark.filterwarnings("ignore:at this load the sphere:jshell.errors.RangeWarning")
def test_a_table_with_a_negative_frequency_is_refused(monkeypatch, tmp_path):
    path = table(tmp_path / "f.csv", (1.1, 1.2, 1.4))
    path.write_text(path.read_text().replace("1.2,", "1.2,-", 1))
    found = answer(monkeypatch, "fit", "--table", path, code=2)["error"]
    assert "row 2" in found["place"]
    assert "omega_minus" in found["place"]


@pytest.mark.long
def test_modes_that_a_thick_liquid_stops_have_a_decay_and_no_frequency(monkeypatch):
    found = answer(monkeypatch, "modes", "--preset", "R", "--elements", "24", "--eta-hat", "1.3", code=3)
    assert found["outcome"] == "overdamped"
    first = found["modes"][0]
    assert (first["mode"], first["outcome"], first["omega"]) == (1, "overdamped", None)
    assert first["tau"] > 10


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_saved_fit_is_shown_again_without_fitting(monkeypatch, tmp_path):
    rows = table(tmp_path / "f.csv", (1.1, 1.2, 1.4))
    words = ("fit", "--table", rows, "--bounds", "alpha1=0.5:9", "--save", tmp_path / "fit.json")
    found = answer(monkeypatch, *words)
    again = answer(monkeypatch, "show", tmp_path / "fit.json", "--plot", tmp_path / "fit.png")
    assert again == found
    assert (tmp_path / "fit.png").stat().st_size > 5000
    assert answer(monkeypatch, "show", rows, code=2)["error"]["code"] == "bad_file"
    for option in ("--bounds", "--window", "--drop"):
        place = answer(monkeypatch, "fit", "x.csv", option, "a=b:c", code=2)["error"]["place"]
        assert place == option
