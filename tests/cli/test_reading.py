"""`jshell read`, and what a file leaves open as options of the verbs that read one."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from jshell.cli.main import app

HERE = Path(__file__).parents[1] / "data" / "instruments"


def _run(monkeypatch, *words, code=0):
    words = [str(word) for word in words]
    monkeypatch.setattr(sys, "argv", ["jshell", *words])
    done = CliRunner().invoke(app, words)
    assert done.exit_code == code, done.output
    return done


def test_read_tells_columns_units_steps_gaps_and_guesses(monkeypatch, tmp_path):
    (tmp_path / "a.csv").write_text("Time (ms),H (mm),who\n0,3,me\n1,3.1,me\n2,3.2,me\n7,3.3,me\n")
    found = json.loads(_run(monkeypatch, "read", tmp_path / "a.csv", "--json").stdout)
    assert [(one["place"], one["name"], one["unit"]) for one in found["columns"]] == [(1, "Time", "ms"), (2, "H", "mm")]
    assert found["read"] == [{"name": "t", "unit": "ms"}, {"name": "H", "unit": "mm"}]
    assert found["steps"] == {"smallest": 1.0, "median": 1.0, "largest": 5.0}
    assert found["gaps"] == ["row 5"]
    assert found["passed"] == ["column `who` of words"]
    assert found["taken"][0] == "column `Time` taken for `t`"
    shown = _run(monkeypatch, "read", tmp_path / "a.csv", "--plot", tmp_path / "a.png").output
    for words in ("read as: t [ms], H [mm]", "gaps: 1, before row 5", "passed over: column `who` of words"):
        assert words in shown
    assert (tmp_path / "a.png").stat().st_size > 3000


def test_what_cannot_be_read_is_shown_as_far_as_it_is_seen(monkeypatch):
    done = _run(monkeypatch, "read", HERE / "imagej.csv", code=2)
    assert "Height" in done.output
    assert "--rate 1000 --time-from Slice" in done.output
    found = json.loads(_run(monkeypatch, "read", HERE / "imagej.csv", "--json", code=2).stdout)
    assert found["error"]["code"] == "bad_name"


def test_analyse_takes_what_a_file_leaves_open(monkeypatch, tmp_path):
    times = np.arange(400) / 1000
    ring = np.exp(-times / 0.1) * np.cos(2 * np.pi * 40 * times) + 1e-3 * np.random.default_rng(0).normal(size=400)
    (tmp_path / "a.csv").write_text("frame;x\n" + "".join(f"{k};{x:.6f}\n" for k, x in enumerate(ring)))
    _run(monkeypatch, "analyse", tmp_path / "a.csv", code=2)
    words = ("analyse", tmp_path / "a.csv", "--rate", 1000, "--from", 0, "--json")
    found = json.loads(_run(monkeypatch, *words).stdout)
    assert found["f_minus_Hz"] == pytest.approx(np.hypot(40, 1 / (2 * np.pi * 0.1)), rel=1e-3)
    assert found["tau_s"] == pytest.approx(0.1, rel=0.02)
    _run(monkeypatch, *words, "--columns", "y=x", "--units", "y=mm", "--rows", "2:300", "--missing", "drop")
    _run(monkeypatch, *words, "--columns", "nonsense", code=2)


def test_a_film_is_measured_and_analysed_in_one_command(monkeypatch, tmp_path):
    pytest.importorskip("skimage", reason="no scikit-image: pip install jshell[camera]")
    from PIL import Image
    from scipy.ndimage import gaussian_filter

    rows, columns = (np.mgrid[:768, :768] + 0.5) / 8 - 0.5  # eight to a pixel: an edge in whole pixels rings otherwise
    rng = np.random.default_rng(0)
    (tmp_path / "film").mkdir()
    for k in range(40):
        x = 4 * np.exp(-k / 40) * np.cos(2 * np.pi * 90 * k / 1000)
        inside = np.hypot((columns - 48) / 30, (rows - 48) / (27 + x)) < 1
        seen = inside.reshape(96, 8, 96, 8).mean(axis=(1, 3))
        grey = 0.85 - 0.7 * gaussian_filter(seen, 1.2) + 0.005 * rng.normal(size=seen.shape)
        Image.fromarray((255 * grey).astype(np.uint8)).save(tmp_path / "film" / f"{k}.png")
    words = (
        "film",
        tmp_path / "film",
        "--rate",
        1000,
        "--pixel",
        1e-4,
        "--out",
        tmp_path / "a.csv",
        "--analyse",
        "--json",
    )
    done = _run(monkeypatch, *words, "--overlay", tmp_path / "strip.png", "--from", 0)
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["frames"] == 40
    assert found["signature"]["f_minus_Hz"] == pytest.approx(90, rel=0.01)
    assert (tmp_path / "strip.png").stat().st_size > 3000
    again = json.loads(_run(monkeypatch, "analyse", tmp_path / "a.csv", "--from", 0, "--json").stdout)
    assert again["f_minus_Hz"] == pytest.approx(found["signature"]["f_minus_Hz"], rel=1e-6)
