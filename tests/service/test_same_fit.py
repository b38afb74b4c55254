"""One file, fitted by the library, in the terminal and by the service: the same numbers in the same words."""

import json
import warnings
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import jshell as js
from jshell.cli.main import app
from jshell.oscillator import random_shell, random_trace
from jshell.service import tasks
from jshell.trace import Trace


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """V, S, H and W of a random shell; H and W are made of V and S."""
    trace = random_trace(random_shell(3), 3, samples=200)
    V, S = (np.asarray(trace[name], dtype=float) for name in ("V", "S"))
    channels = {"V": V, "S": S, "H": 0.3 * V + 0.02 * S, "W": 0.1 * V + 0.1 * S}
    path = tmp_path_factory.mktemp("recording") / "T.csv"
    js.io.write_trace(path, Trace(np.asarray(trace.times), channels, trace.conditions))
    return path


CASES = [
    ({}, []),
    ({"loss": "strict"}, ["--loss", "strict"]),
    ({"channels": ["V", "S"]}, ["--channel", "V", "--channel", "S"]),
]


@pytest.mark.parametrize(("options", "words"), CASES, ids=lambda x: " ".join(map(str, x)) or "nothing")
def test_library_terminal_and_service_fit_alike(options, words, recording, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = js.calibration.fit_trajectories(js.io.read_trace(recording), **options)
        shown = CliRunner().invoke(app, ["fit", str(recording), *words, "--save", str(tmp_path / "fit.json"), "--json"])
    assert shown.exit_code in (0, 3), shown.output
    answer = tasks.run("fit", {**options, "netcdf": False}, [(recording.name, recording.read_bytes())])
    assert answer.error is None
    (tmp_path / "served.json").write_bytes(answer.files["record.json"])
    assert js.load(tmp_path / "fit.json") == found
    assert js.load(tmp_path / "served.json") == found
    assert json.loads(shown.stdout)["warnings"] == list(found.warnings)
    assert answer.files["report.txt"].decode() == found.report()
