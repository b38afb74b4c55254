"""The catalogue says what has run, and what moved when it is run again."""

import csv
import dataclasses
import json
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

from jshell import campaigns
from jshell.campaigns.catalog import symmetry
from jshell.campaigns.store import RUNS, RunStore
from jshell.cli.main import app
from jshell.errors import BadFile, BadName, BadValue


def asked(*words: str) -> tuple[int, str]:
    found = CliRunner().invoke(app, ["campaign", *words])
    return found.exit_code, found.stdout


@pytest.mark.long
def test_numbers_of_the_table_read_back_to_the_bit(undisturbed):
    found = campaigns.catalog(undisturbed)
    with (undisturbed / "catalog.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert tuple(rows[0]) == found.columns
    for name in ("modes_omega_1", "V_e", "d_hat"):
        read = [float(row[name]) if row[name] else np.nan for row in rows]
        np.testing.assert_array_equal(read, found[name])


@pytest.mark.long
def test_rows_are_found_by_family_and_by_value(undisturbed):
    found = campaigns.catalog(undisturbed)
    assert len(found.where(family="gas")) == 3
    assert found.where(family="gas", P0_hat=0.9, outcome="ok")["P0_hat"].tolist() == [0.9]
    assert found.sorted_by("P0_hat")["P0_hat"].tolist() == sorted(found["P0_hat"])
    with pytest.raises(BadName, match="gas, none"):
        found.where(family="glass")
    with pytest.raises(BadName, match="omega_minus"):
        found["omega"]


def test_dataset_holds_the_table_and_the_records(shipped):
    pytest.importorskip("xarray", reason="no xarray: pip install jshell[io]")
    two = shipped.where(family="R-free").to_xarray(records=True)
    assert two["d_hat"].values.tolist() == [0.22]
    record = shipped.where(family="R-free")[0].trace
    np.testing.assert_array_equal(two["record_V"].values[0], np.asarray(record["V"], dtype=float))


@pytest.mark.long
def test_damaged_file_is_named(undisturbed, small, tmp_path):
    store = RunStore(tmp_path)
    store.begin()
    campaigns.write_design(store.design, small)
    first, second = list(small.runs())[:2]
    store.path(first).write_bytes((undisturbed / "runs" / f"{first.key}.npz").read_bytes()[:-40])
    with pytest.raises(BadFile, match=first.key):
        campaigns.catalog(tmp_path)
    store.path(first).write_bytes((undisturbed / "runs" / f"{second.key}.npz").read_bytes())
    with pytest.raises(BadFile, match="another run"):
        campaigns.catalog(tmp_path)


def test_folder_without_a_campaign_is_refused(tmp_path):
    with pytest.raises(BadFile, match=r"no design\.toml"):
        campaigns.catalog(tmp_path)


@pytest.mark.long
def test_comparison_says_what_moved_and_how_far(undisturbed):
    before = campaigns.catalog(undisturbed)
    assert campaigns.compare(before, before).identical
    first, *others = before.results
    moved = dataclasses.replace(first.findings, V_e=first.findings.V_e * (1 + 1e-9), verdict="one")
    newer = dataclasses.replace(first.versions, jax="99.0")
    other = dataclasses.replace(first, findings=moved, versions=newer)
    after = dataclasses.replace(before, results=(other, *others[:-1]), families=before.families[:-1])
    found = campaigns.compare(before, after)
    assert not found.identical
    assert found.same == 2
    assert found.only_before == (before.results[-1].run.key,)
    assert [(move.column, move.key) for move in found.worst()] == [
        ("verdict", first.run.key),
        ("V_e", first.run.key),
    ]
    assert found.worst()[1].relative == pytest.approx(1e-9, rel=1e-5)
    assert found.versions == (f"jax {first.versions.jax} -> 99.0",)


@pytest.mark.long
def test_files_of_no_run_are_counted_and_the_old_name_says_the_new_one(undisturbed, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(undisturbed, folder)
    (folder / RUNS / "other.npz").write_bytes(b"")
    found = campaigns.catalog(folder)
    assert found.orphan_files == 1
    with pytest.warns(DeprecationWarning, match="orphan_files"):
        assert found.strangers == 1


def test_terminal_tells_the_shipped_campaign(shipped):
    code, text = asked("status", "--json")
    told = json.loads(text)
    assert code == 0
    assert told["finished"] == len(shipped) >= 60
    assert told["missing"] == told["strangers"] == 0
    code, text = asked("status")
    assert "thickness" in text


@pytest.mark.long
def test_terminal_runs_checks_and_exports(undisturbed, small, tmp_path):
    design, out = campaigns.write_design(tmp_path / "design.toml", small), tmp_path / "out"
    code, text = asked("run", str(design), "--out", str(out), "--json")
    assert (code, json.loads(text)["outcomes"]) == (0, {"ok": 3, "no_buckled_state": 1})
    code, text = asked("check", str(out), "--against", str(undisturbed))
    assert (code, text.split()[0]) == (0, "4")
    code, text = asked("export", str(tmp_path / "table.csv"), str(out))
    assert code == 0
    assert (tmp_path / "table.csv").read_bytes() == (undisturbed / "catalog.csv").read_bytes()
    assert asked("export", str(tmp_path / "table.txt"), str(out))[0] == 2
    assert asked("check", str(out))[0] == 3  # another campaign than the shipped one


def test_shipped_table_is_that_of_the_shipped_files(shipped):
    assert (campaigns.shipped() / "catalog.csv").read_text(encoding="utf-8") == shipped.to_csv()


@pytest.mark.long
def test_a_dimple_is_said_to_be_round_by_the_law(undisturbed):
    found = campaigns.catalog(undisturbed)
    assert found.where(family="gas")["symmetry"].tolist() == ["round (law)"] * 3
    assert found.where(family="none")["symmetry"].tolist() == [""]  # nothing has buckled
    assert "azimuth" not in found.columns  # nobody has asked
    result = found.where(family="gas")[0]
    thin = dataclasses.replace(result, run=dataclasses.replace(result.run, d_hat=0.01))
    assert symmetry(thin) == "not round (law)"
    near = dataclasses.replace(thin, findings=dataclasses.replace(result.findings, V_e_over_V0=0.99))
    assert symmetry(near) == "round (law, beyond its range)"


def test_runs_that_ask_for_nothing_new_keep_their_names():
    plain = campaigns.Run("modes", 0.22, 0.9, 1.6)
    assert {"symmetry", "azimuth"}.isdisjoint(plain.facts())
    assert dataclasses.replace(plain, symmetry=True).key != plain.key != dataclasses.replace(plain, azimuth=2).key
    for azimuth in (5, -1):
        with pytest.raises(BadValue, match="azimuth"):
            dataclasses.replace(plain, azimuth=azimuth)


@pytest.mark.slow
def test_symmetry_and_vibrations_around_the_axis_are_columns_where_asked(tmp_path):
    base = {"d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.6, "weak_depth": 0.0, "symmetry": True, "azimuth": 2}
    campaigns.run(campaigns.Design("asked", (campaigns.Family("R", "modes", base),)), tmp_path)
    found = campaigns.catalog(tmp_path)
    assert found["symmetry"].tolist() == ["round"]
    assert found["growth"].tolist() == [0.0]
    # as `jshell modes --preset R --azimuth 1,2` says
    np.testing.assert_allclose([found["azimuth_omega_1"][0], found["azimuth_tau_2"][0]], [1.22903, 6.18796], rtol=1e-5)
    assert "azimuth_omega_3" not in found.columns
