"""Numbers with units on the command line, options that had another name, and what help says of flags."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from jshell.cli import main
from jshell.cli.amounts import read_amount

PLAIN = {"COLUMNS": "200", "NO_COLOR": "1"}


def asked(*words: str):
    return CliRunner().invoke(main.app, list(words), env=PLAIN)


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [("22.5mm", "length", 0.0225), ("126 nm", "length", 1.26e-7), ("4.95e-3", "length", 4.95e-3),
     ("1e2kPa", "pressure", 1e5), ("0.5MPa", "pressure", 5e5), (".5 bar", "pressure", 5e4), ("-20ms", "time", -0.02)],
)  # fmt: skip
def test_a_number_with_a_unit_is_read_in_si(text, dimension, value):
    assert read_amount(text, dimension) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("text", ["22.5 kPa", "22.5 yards", "mm", "", "1e", "nan"])
def test_another_unit_or_no_number_is_refused(text):
    with pytest.raises(ValueError, match="expected one"):
        read_amount(text, "length")


@pytest.mark.long
def test_the_same_shell_with_units_and_in_si():
    ending = ("--rho", "1260", "--volume", "0.7", "--elements", "16", "--json")
    units = asked(
        "rest", "--r0", "22.5mm", "--d", "4.95 mm", "--e", "0.5MPa", "--p0", "99kPa", "--pext", "176kPa", *ending
    )
    si = asked("rest", "--r0", "0.0225", "--d", "0.00495", "--e", "5e5", "--p0", "99e3", "--pext", "1.76e5", *ending)
    assert units.exit_code == si.exit_code == 0
    assert units.stdout == si.stdout


def test_a_wrong_unit_ends_with_2_and_says_which_are_known():
    answer = asked("rest", "--r0", "22.5kPa")
    assert answer.exit_code == 2
    for words in ("--r0", "22.5kPa", "m, cm, mm"):
        assert words in answer.stderr


def test_a_known_number_of_an_inversion_may_have_a_unit(tmp_path):
    (tmp_path / "T.csv").write_text("t [s],H [m]\n0,0.03\n0.001,0.031\n")
    answer = asked("invert", str(tmp_path / "T.csv"), "--unknown", "gas_pressure", "--known", "thickness=5kPa")
    assert answer.exit_code == 2
    assert "thickness=5mm" in answer.stderr


def test_a_former_name_of_an_option_answers_and_says_the_new_one():
    words = ("bifurcation", "--preset", "R", "--pext-hat", "1.62", "--highest", "0.001", "--lowest", "0.01")
    answer = asked(*words, "--pulsation=1.0")
    assert "--pulsation is now --omega" in answer.stderr
    assert "0 < lowest < highest" in answer.stderr  # read, and refused for another reason


@pytest.mark.parametrize("words", [[verb] for verb in main.VERBS] + [["campaign", "run"]])
def test_help_says_no_type_of_a_flag_and_no_former_name(words):
    shown = asked(*words, "--help").stdout
    assert "<bool>" not in shown
    assert not [former for former in main.FORMER if former in shown]


@pytest.mark.long
@pytest.mark.parametrize(
    ("pixel", "words"),
    [((), "width: mean 93."), (("--pixel", "0.517241mm"), "W: mean 48.")],  # 93.6 of them, 48.4 mm
)
def test_a_film_is_told_in_pixels_or_in_millimetres(pixel, words):
    films = Path(__file__).parents[2] / "data" / "films"
    answer = asked("film", str(films / "attached_R.tif"), "--grid", str(films / "grid.png"), *pixel)
    assert answer.exit_code == 0
    line = next(line for line in answer.stdout.splitlines() if line.startswith(words))
    assert line.count("mm" if pixel else " px") == (1 if pixel else 2)  # the error is in µm there
