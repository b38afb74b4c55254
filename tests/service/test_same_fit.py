"""One file, fitted by the library, in the terminal and by the service: the same choices, numbers and words."""

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from starlette.datastructures import ImmutableMultiDict
from typer.testing import CliRunner

import jshell as js
from jshell.calibration.options import OPTIONS, choices_of, default_of, words_of
from jshell.calibration.profile import Interval, Profile
from jshell.cli.main import app
from jshell.cli.options import flag
from jshell.oscillator import random_shell, random_trace
from jshell.service import client, sending, tasks
from jshell.service.encoding import as_json
from jshell.service.jobs import specification
from jshell.service.schemas import FitRequest
from jshell.service.web import forms
from jshell.trace import Trace

ID = "0123456789abcdef0123456789abcdef"
MODAL = {"fix": {"alpha2": 1.1}}


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """V, S, H and W of a random shell; H and W are made of V and S."""
    trace = random_trace(random_shell(3), 3, samples=200)
    V, S = (np.asarray(trace[name], dtype=float) for name in ("V", "S"))
    channels = {"V": V, "S": S, "H": 0.3 * V + 0.02 * S, "W": 0.1 * V + 0.1 * S}
    path = tmp_path_factory.mktemp("recording") / "T.csv"
    js.io.write_trace(path, Trace(np.asarray(trace.times), channels, trace.conditions))
    return path


def case(options: dict[str, Any], words: str, fields: dict[str, str], *, slow: bool = False) -> Any:
    """Options, the terminal's words for them, and the page's fields."""
    return pytest.param(options, words.split(), fields, id=words or "nothing", marks=[pytest.mark.slow] * slow)


HELD, FIXED = "--fix alpha2=1.1", {"role.alpha2": "fixed", "value.alpha2": "1.1"}
CASES = [
    case({}, "", {}),
    case({"loss": "strict"}, "--loss strict", {"loss": "strict"}),
    case({"channels": ["V", "S"]}, "--channel V --channel S", {"channel": "V,S"}, slow=True),
    case(MODAL | {"loss": "modal"}, f"--loss modal {HELD}", {"loss": "modal", **FIXED}, slow=True),
    case(MODAL | {"channels": ["H", "W"]}, f"--channel H --channel W {HELD}", {"channel": "H,W", **FIXED}, slow=True),
    case(MODAL | {"channels": ["V"], "robust": "huber"}, f"--channel V --robust huber {HELD}",
         {"channel": "V", "robust": "huber", **FIXED}, slow=True),
    case({"loss": "strict", "tie": {"alpha2": "0.2*alpha1"}, "noise": "white"},
         "--loss strict --tie alpha2=0.2*alpha1 --noise white",
         {"loss": "strict", "role.alpha2": "tied", "tie.alpha2": "0.2*alpha1", "noise": "white"}),
    case({"loss": "strict", "bounds": {"k_vs": (-1.0, 1.0), "alpha1": (0.5, float("inf"))}, "beta2": "free"},
         "--loss strict --bounds kVS=-1:1 --bounds alpha1=0.5: --beta2 free",
         {"loss": "strict", "low.k_vs": "-1", "high.k_vs": "1", "low.alpha1": "0.5", "beta2": "free"}, slow=True),
    case({"loss": "strict", "uncertain": {"gas_pressure": 0.02}, "equilibrium": "trace"},
         "--loss strict --uncertain gas_pressure=0.02 --equilibrium trace",
         {"loss": "strict", "known.gas_pressure": "prior", "relative.gas_pressure": "2", "equilibrium": "trace"},
         slow=True),
    case({"loss": "strict", "priors": {"beta1": js.calibration.Prior(1.0, 0.2)}, "dipole": "printed"},
         "--loss strict --prior beta1=1:0.2 --dipole printed",
         {"loss": "strict", "priors": "beta1=1:0.2", "dipole": "printed"}, slow=True),
    case({"loss": "strict", "start": 4.0, "stop": 30.0, "drop": [(10.0, 11.0), (20.0, 21.5)]},
         "--loss strict --window 4:30 --drop 10:11 --drop 20:21.5",
         {"loss": "strict", "start": "4", "stop": "30", "drop": "10:11, 20:21.5"}),
    case(MODAL | {"starts": 1, "seed": 7, "missing": "drop"}, f"--starts 1 --seed 7 --missing drop {HELD}",
         {"starts": "1", "seed": "7", "missing": "drop", **FIXED}, slow=True),
]  # fmt: skip


def unmarked(cases: list) -> list:
    """The same, none of them slow."""
    return [pytest.param(*one.values, id=one.id) for one in cases]


@pytest.mark.long
@pytest.mark.parametrize(("options", "words", "fields"), CASES)
def test_library_terminal_and_service_fit_alike(options, words, fields, recording, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = js.calibration.fit_trajectories(js.io.read_trace(recording), **options)
        shown = CliRunner().invoke(app, ["fit", str(recording), *words, "--save", str(tmp_path / "fit.json"), "--json"])
    assert shown.exit_code in (0, 3), shown.output
    asked = sending.fit_options(options)
    answer = tasks.run("fit", {**asked, "netcdf": False}, [(recording.name, recording.read_bytes())])
    assert answer.error is None
    (tmp_path / "served.json").write_bytes(answer.files["record.json"])
    assert js.load(tmp_path / "fit.json") == found
    assert js.load(tmp_path / "served.json") == found
    assert json.loads(shown.stdout)["warnings"] == list(found.warnings)
    assert answer.files["report.txt"].decode() == found.report()


@pytest.mark.parametrize(("options", "words", "fields"), unmarked(CASES))
def test_every_way_in_asks_for_the_same(options, words, fields, monkeypatch):
    """Python, the client's JSON through the request's checks, the terminal's line and the page's form."""
    wanted = js.calibration.FitOptions(**options)
    told = FitRequest.model_validate({"traces": [ID], **sending.fit_options(options)})
    assert js.calibration.FitOptions.from_record(specification(told)) == wanted

    seen: dict = {}
    monkeypatch.setattr(js.calibration, "fit_trajectories", lambda traces, options: seen.update(options=options))
    monkeypatch.setattr(js.io, "read_trace", lambda file, meta, **reading: file)
    CliRunner().invoke(app, ["fit", "T.csv", *words])
    assert seen["options"] == wanted

    pairs = [("trace", ID), *[("channel", one) for one in fields.get("channel", "").split(",") if one]]
    pairs += [(name, text) for name, text in fields.items() if name != "channel"]
    posted = forms.read(ImmutableMultiDict(pairs)).request()
    assert js.calibration.FitOptions.from_record(specification(posted)) == wanted


def test_every_way_in_says_the_same_words():
    group: Any = typer.main.get_command(app)
    verbs = {verb: group.resolve_command(typer.Context(group), [verb])[1] for verb in ("fit", "submit")}
    described = FitRequest.model_json_schema()["properties"]
    for name in OPTIONS:
        told = words_of(name)
        assert described[name]["description"].lower() == f"{told}.".lower()
        for verb in ("fit", "submit"):
            (option,) = [one for one in verbs[verb].params if flag(name) in one.opts]
            assert f"{told}.".lower() in option.help.lower()
            if default_of(name) not in (None, (), {}):
                assert option.default == default_of(name)
        if choices_of(name):
            shown = dict(forms.choice(name).values)
            assert [key or None for key in shown] == sorted(choices_of(name), key=lambda key: key != default_of(name))
            assert all(words in shown[key or ""] for key, words in choices_of(name).items())


PROFILE = Profile(
    (
        Interval("alpha1", 1.0 / 3.0, 0.3, 0.41, "", 0.02),
        Interval("k_vs", -0.2, np.nan, 0.1, "below: it reaches its bound at Δχ²/s² = 1.2", 0.1),
    ),
    0.95,
    "Δχ²/s² = 3.86, F with 1 and 396 degrees of freedom, s² = 0.01 from the residual",
    3.86,
    (np.zeros((3, 2)), np.zeros((3, 2))),
)


@pytest.mark.parametrize("form", [[], ["--json"]])
def test_submit_shows_a_profile_in_the_words_of_fit(form, recording, monkeypatch):
    """A fit and its profile by hand: a search for them compiles for long."""
    none, read = np.zeros((0, 0)), (js.io.read_trace(recording),)
    found = js.FitResult("by hand", js.Outcome.OK, (), (), none, none, (), np.zeros(8), 0.0, 8, 3, False, traces=read)
    served = json.loads(as_json(PROFILE.record()))
    monkeypatch.setattr(js.FitResult, "profile", lambda self: PROFILE)
    monkeypatch.setattr(js.calibration, "fit_trajectories", lambda traces, options: found)
    job = client.Job(client.Client(), "1", "fit", "done", 1.0, {})
    monkeypatch.setattr(client.Client, "submit", lambda self, files, **options: job)
    monkeypatch.setattr(client.Client, "result", lambda self, job: found)
    monkeypatch.setattr(client.Client, "profile", lambda self, job: served)
    shown = [CliRunner().invoke(app, [verb, str(recording), "--profile", *form]) for verb in ("fit", "submit")]
    assert shown[0].exit_code == shown[1].exit_code == 0, shown[1].output
    assert shown[0].stdout == shown[1].stdout
    assert "k_vs" in shown[0].stdout
