"""The doctor sees what would spoil numbers, and says what to do."""

import json
import os
import subprocess
import sys
from types import SimpleNamespace

import jax
import pytest
from typer.testing import CliRunner

from jshell.cli import doctor as room
from jshell.cli.main import app
from jshell.errors import BadName

RUNNER = CliRunner()
STARTING = 120  # seconds for a process that imports jax on a busy machine


def examined(code: int = 0) -> dict:
    result = RUNNER.invoke(app, ["doctor", "--json"])
    assert result.exit_code == code, (result.output, result.exception)
    return json.loads(result.stdout)


def finding(report: dict, what: str) -> dict:
    return next(one for one in report["findings"] if one["what"] == what)


def test_a_sound_installation_is_said_to_be():
    report = examined()
    assert report["sound"]
    assert report["versions"]["jax"] == jax.__version__
    assert finding(report, "precision")["found"] == "float64"
    assert "217 samples" in finding(report, "shipped data")["found"]  # rows of the shipped recording


def test_people_get_a_table():
    result = RUNNER.invoke(app, ["doctor"])
    assert result.exit_code == 0
    for words in ("float64", "compilation cache", "pip install 'jshell[extra]'", "interop"):
        assert words in result.stdout


@pytest.mark.parametrize("wrong", [lambda total: total + 1.0, lambda total: total * float("nan")])
def test_a_compiler_that_returns_wrong_numbers_is_found(monkeypatch, wrong):
    broken = SimpleNamespace(jit=lambda f: lambda *given: wrong(f(*given)), vmap=jax.vmap, numpy=jax.numpy)
    monkeypatch.setattr(room, "_jax", lambda: broken)
    found = room._compiler()
    assert not found.sound
    assert "0.10.2" in found.remedy


@pytest.mark.long
@pytest.mark.parametrize(
    ("variable", "value", "what"), [("JAX_ENABLE_X64", "0", "precision"), ("JAX_PLATFORMS", "cuda", "devices")]
)
def test_a_setting_that_spoils_numbers_ends_with_three(variable, value, what):
    given = {**os.environ, variable: value}
    words = [sys.executable, "-m", "jshell", "doctor", "--json"]
    done = subprocess.run(words, env=given, capture_output=True, text=True, timeout=STARTING, check=False)
    assert done.returncode == 3, done.stderr
    seen = finding(json.loads(done.stdout), what)
    assert not seen["sound"]
    assert variable in seen["remedy"]


def test_a_cache_that_cannot_be_written_is_said_and_spoils_nothing(monkeypatch, tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    for place, words in ((file, "cannot be written"), (tmp_path / "new", "0 files"), (None, "none")):
        jax = SimpleNamespace(config=SimpleNamespace(jax_compilation_cache_dir=place))
        monkeypatch.setattr(room, "_jax", lambda jax=jax: jax)
        found = room._cache()
        assert found.sound
        assert words in found.found
        assert bool(found.remedy) == (words != "0 files")


def test_a_package_without_its_data_is_not_sound(monkeypatch):
    def lost(name: str):
        raise BadName(name, found="no such file", expected="a file", remedy="")

    monkeypatch.setattr(room.jshell.io, "example", lost)
    assert not examined(code=3)["sound"]


def test_extras_name_what_is_missing(monkeypatch):
    asked = ["numpy>=2", "nonesuch[x]>=1 ; extra == 'io'", 'pytest; extra == "io"', "jshell[io]; extra == 'all'"]
    known = SimpleNamespace(get_all=lambda name: ["io", "all"])
    monkeypatch.setattr(room.metadata, "requires", lambda name: asked)
    monkeypatch.setattr(room.metadata, "metadata", lambda name: known)
    assert room._extras() == {"io": ["nonesuch"]}
