"""What one more recording would tell, against having it; on a stand-in for the simulator."""

import json

import pytest
from typer.testing import CliRunner

import jshell as js
from jshell.cli.main import app
from jshell.errors import Outcome
from jshell.inversion.response import ECHO

ASKED = ("youngs_modulus", "gas_pressure")

pytestmark = pytest.mark.usefixtures("no_compilation")


def invert(traces):
    return js.invert(traces, unknown=ASKED, exact=False, nuisance=False)


@pytest.mark.long
@pytest.mark.parametrize("channels", [("V",), ("W", "S"), (ECHO,)])
def test_what_another_channel_would_tell_is_what_it_tells(make_recording, channels):
    first = make_recording()
    (foreseen,) = invert(first).next_recording([{"channels": channels}])
    with_it = invert([first, make_recording(channels=channels)])
    assert with_it.outcome == Outcome.OK
    for name in ASKED:
        # noise of 1 % is known to 4 % from 300 samples, and which channel it is largest in matters little
        assert foreseen.stderr[name] == pytest.approx(with_it[name].stderr / with_it[name].value, rel=0.1)


def test_the_usual_recordings_are_ranked(make_recording):
    found = invert(make_recording())
    prospects = found.next_recording()
    table = prospects.record()
    changes = [one["change"] for one in table["prospects"]]
    assert {} in changes
    assert {"channels": ECHO} in changes
    assert {"channels": "x_front"} in changes  # a pad holds the other pole
    assert sum("outer_pressure" in one for one in changes) == 3
    for one in table["prospects"]:
        for name in ASKED:
            assert 0 < one["stderr"][name] <= table["now"][name] * (1 + 1e-9)
    lines = prospects.report().splitlines()[2:]
    assert lines[0].split()[:3] == ["as", "it", "is"]
    size = [float(line.split()[-2]) for line in lines[1:]]
    assert size == sorted(size)
    assert len(size) == len(changes)
    with pytest.raises(js.JshellError, match="hydrophone"):
        found.next_recording([{"channels": ("H", ECHO)}])
    with pytest.raises(js.JshellError, match="channel"):
        found.next_recording([{"channels": "height"}])


@pytest.mark.long
def test_the_terminal_says_what_would_tell(make_recording, tmp_path):
    path = tmp_path / "ring.csv"
    js.io.write_trace(path, make_recording(), units="si")
    words = ["invert", str(path), "--unknown", ",".join(ASKED), "--no-exact", "--no-nuisance", "--next", "--json"]
    told = CliRunner().invoke(app, words)
    assert told.exit_code == 0, told.output
    assert {"channels": ECHO} in [one["change"] for one in json.loads(told.stdout)["next"]["prospects"]]
