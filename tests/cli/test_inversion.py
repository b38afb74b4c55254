"""Options of `jshell invert` arrive where Python's do."""

import pytest
from typer.testing import CliRunner

import jshell
from jshell.cli.main import app
from jshell.errors import BadValue
from jshell.io import example


@pytest.fixture
def asked(monkeypatch):
    """Calls `jshell invert` and tells what Python was asked."""
    seen: dict = {}

    def noted(traces, said, unknown, **options):
        seen.update(options, unknown=unknown, known=said, traces=traces)
        raise BadValue("a test", found="a question", expected="no answer", remedy="None.")

    monkeypatch.setattr(jshell, "invert", noted)

    def ask(*words):
        result = CliRunner().invoke(app, ["invert", str(example("attached_R_HW.csv")), *map(str, words)])
        assert "a question" in result.stderr, result.output
        return seen

    return ask


def test_a_snap_is_said_as_in_python(asked, tmp_path):
    words = ("--ramp", 0.2, "--origin", 0.01, "--starts", 3, "--engine", "processes:2", "--checkpoint", tmp_path)
    seen = asked("--unknown", "youngs_modulus", "--level", "trace", "--elements", 16, *words)
    how = seen["level"]
    assert (how.ramp, how.origin, how.starts, how.engine, how.elements) == (0.2, 0.01, 3, "processes:2", 16)
    assert how.checkpoint == tmp_path
    assert callable(how.progress)


def test_what_is_not_said_is_pythons_default(asked):
    assert (
        asked("--unknown", "youngs_modulus", "--level", "trace")["level"].elements == jshell.inversion.Snap().elements
    )
    seen = asked("--unknown", "youngs_modulus,gas_pressure", "--known", "pad=0.3")
    assert seen["level"] == "modal"
    assert list(seen["unknown"]) == ["youngs_modulus", "gas_pressure"]
    assert seen["known"] == {"pad": 0.3}
