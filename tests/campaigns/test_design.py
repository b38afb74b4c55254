"""A design says which runs there are, the same ones wherever it is read."""

import numpy as np
import pytest

from jshell.campaigns import Design, Family, Run, design_text, read_design, write_design
from jshell.errors import BadFile, BadName, BadValue
from jshell.shell import Reduced
from jshell.shell.sphere import buckling_load

R = {"d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.6}


def test_one_at_a_time_keeps_the_other_parameters_at_their_base():
    family = Family("both", "modes", R, {"d_hat": (0.1, 0.2), "P0_hat": (0.5, 0.9, 1.8)})
    found = [(run.d_hat, run.P0_hat) for run in family.runs()]
    assert found == [(0.1, 0.9), (0.2, 0.9), (0.22, 0.5), (0.22, 0.9), (0.22, 1.8)]


def test_grid_is_all_combinations():
    family = Family("grid", "modes", R, {"d_hat": (0.1, 0.2), "P0_hat": (0.5, 0.9, 1.8)}, rule="grid")
    assert {(run.d_hat, run.P0_hat) for run in family.runs()} == {(d, P) for d in (0.1, 0.2) for P in (0.5, 0.9, 1.8)}


def test_latin_hypercube_has_one_sample_in_each_slice_of_each_parameter():
    family = Family(
        "latin", "modes", R, {"d_hat": (0.05, 0.3), "eta_hat": (1e-3, 1e-1)}, "latin", 20, 3, log=("eta_hat",)
    )
    runs = family.runs()
    thickness = np.array([run.d_hat for run in runs])
    viscosity = np.array([run.eta_hat for run in runs])
    assert sorted((thickness - 0.05) / 0.25 * 20 // 1) == list(range(20))
    assert sorted(np.log10(viscosity / 1e-3) / 2 * 20 // 1) == list(range(20))
    assert runs == family.runs()


def test_outer_pressure_is_a_number_an_excess_or_a_multiple_of_the_buckling_load():
    base = {"d_hat": 0.22, "P0_hat": 0.9}
    pressures = [Family("p", "modes", base | way).runs()[0].Pext_hat for way in ({"Pext_hat": 1.6}, {"excess": 0.7})]
    assert pressures == [1.6, 1.6]
    (run,) = Family("p", "modes", base | {"load": 1.02}).runs()
    # six decimals are kept, so that the last bit of a solver does not rename the run
    assert run.Pext_hat == pytest.approx(1.02 * float(buckling_load(Reduced(0.22, 0.9, 0.9))), abs=5e-7)
    with pytest.raises(BadValue, match="exactly one"):
        Family("p", "modes", base | {"excess": 0.7, "load": 1.02}).runs()


def test_run_in_two_families_is_one_run():
    first = Family("gas", "modes", R, {"P0_hat": (0.6, 0.9)})
    second = Family("wall", "modes", R, {"d_hat": (0.22, 0.3)})
    runs = Design("both", (first, second)).runs()
    assert len(runs) == 3
    assert runs[Run("modes", 0.22, 0.9, 1.6)] == ("gas", "wall")


def test_key_depends_on_the_numbers_alone():
    assert Run("modes", 0.22, 1, 1.6).key == Run("modes", 0.22, 1.0, 1.6).key
    assert Run("modes", 0.22, 1.0, 1.6).key != Run("modes", 0.22, 1.0, 1.6, attached=1e-9).key


def test_design_reads_back_from_its_file(tmp_path):
    odd = Family(
        "odd-1", "snap", {"d_hat": 0.1 + 0.2, "load": 1e-300, "follow": True, "elements": 32}, {"P0_hat": (1, 5e-324)},
        note='quotes " and “ ”, a \\ backslash, a tab\t, \x7f, ω₋, a line\nand 🫧',
    )  # fmt: skip
    latin = Family("l", "kick", {"load": 1.1}, {"d_hat": (0.1, 0.2)}, "latin", 7, 5, log=("d_hat",))
    design = Design("any “name” at all", (odd, latin))
    path = write_design(tmp_path / "design.toml", design)
    assert read_design(path) == design
    assert path.read_text(encoding="utf-8") == design_text(design)


@pytest.mark.parametrize(
    ("text", "error", "says"),
    [
        ("name = 3 4", BadFile, "no TOML"),
        ("name = 'empty'", BadFile, r"\[\[family\]\]"),
        ("[[family]]\nname = 'a'", BadFile, "no name or no kind"),
        ("[[family]]\nname = 'a'\nkind = 'snap'\ncolour = 1", BadFile, "'colour'"),
        ("[[family]]\nname = 'a'\nkind = 'snap'\nvary = { d_hat = 0.2 }", BadFile, "vary|d_hat"),
        ("[[family]]\nname = 'a'\nkind = 'pop'", BadName, "modes, snap"),
        ("[[family]]\nname = 'a'\nkind = 'snap'\nbase = { dhat = 0.2 }", BadName, "d_hat"),
        ("[[family]]\nname = 'a'\nkind = 'snap'\nbase = { d_hat = '0.2' }", BadFile, "a number"),
        ("[[family]]\nname = 'a'\nkind = 'snap'\nrule = 'latin'\nvary = { d_hat = [0.3, 0.1] }", BadValue, "lowest"),
    ],
)
def test_design_that_makes_no_sense_is_refused_with_its_place(tmp_path, text, error, says):
    path = tmp_path / "d.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(error, match=says):
        read_design(path)


@pytest.mark.parametrize("change", [{"d_hat": -1.0}, {"attached": True}])
def test_run_outside_its_meaning_is_refused(change):
    family = Family("one", "modes", R | change)
    with pytest.raises(BadValue, match=r"thickness|attached"):
        family.runs()
