"""Records through the snap, on a stand-in for the simulation; the simulation itself at the end, where it is slow."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import jshell as js
from jshell.errors import BadValue, Outcome
from jshell.inversion import motion
from jshell.inversion.response import FIELDS
from jshell.inversion.snap import SnapModel, protocol
from jshell.inversion.through import SPOT, Question, _kept, _whole
from jshell.inversion.unknowns import parameters
from jshell.shell import Liquid, Reduced, Shell, scales
from tests.inversion.snapping import snapping, use

D, GAS, OUTER, ETA, SPOT_DEPTH = 0.22, 0.9, 1.6, 0.004, 0.11
UNIT = scales(Shell(0.0225, D * 0.0225, 0.5e6), Liquid(1260.0))
TRUTH = {"youngs_modulus": 0.5e6, "outer_pressure": OUTER * UNIT.pressure, "weak_spot": SPOT_DEPTH}
OFF = {"youngs_modulus": 0.53e6, "outer_pressure": 1.01 * OUTER * UNIT.pressure}


@pytest.fixture(autouse=True)
def stand_in(request, monkeypatch):
    if "slow" not in request.keywords:
        use(monkeypatch.setattr)


def record(seed=0, *, noise=0.01, channels=("V",), settings=(("ramp", "25.0"),), mesh=0.0):
    """A record of the stand-in."""
    times = 0.1 * np.arange(421)
    numbers = np.array([D, GAS, OUTER, ETA, 1.4, 0.5, 0.0, SPOT_DEPTH, 0.0])
    pressure = GAS + (OUTER - GAS) * np.clip(times / 25.0, 0, 1)
    found = snapping(numbers, pressure, times, mesh)
    generator = np.random.default_rng(seed)
    rows = {name: found[:, motion.PLACES[name]] for name in (*channels, "P_ext")}
    for name in channels:
        rows[name] = rows[name] + noise * np.ptp(rows[name]) * generator.standard_normal(times.size)
    return js.Trace(times, rows, Reduced(D, GAS, OUTER, ETA), scales=UNIT, settings=settings)


def invert(trace, unknown=("youngs_modulus", "outer_pressure"), snap=None, **options):
    return js.invert(trace, unknown=unknown, level=snap or js.inversion.Snap(elements=16), **{"begin": OFF} | options)


def test_modulus_pressure_and_weak_spot_come_out_of_one_channel():
    found = invert(record())
    assert found.outcome == Outcome.OK, found.report()
    assert found.warnings == ()
    assert set(found.varied) == set(TRUTH)
    for name, value in TRUTH.items():
        assert abs(found[name].value - value) < 3 * found[name].stderr
        assert found[name].stderr < 0.05 * value
    assert 0.8 < found.reduced_chi_square < 1.2
    assert "through the snap" in found.report()
    assert any("finer mesh" in note and "moved by" in note for note in found.notes)
    assert found.curves()[0]["V"].shape == found.times()[0].shape


@pytest.mark.long
def test_slopes_are_central_differences_in_all_numbers():
    names = ("youngs_modulus", "thickness", "radius", "density", "gas_pressure", "outer_pressure", "viscosity", "kappa",
             "weak_spot", "retardation")  # fmt: skip
    trace = record(channels=("V", "H"), settings=(("ramp", "24.97"),))  # its end lies between samples
    question = Question([trace], [{}], dict.fromkeys(names), (), None, (None, None), None, False, True)
    one, _ = _whole(trace, 1, question)
    snap = js.inversion.Snap(elements=16)
    whole = parameters([one.known], dict.fromkeys(names), (), True)
    ways = (protocol(one, snap, True),)
    model = SnapModel((one,), whole, 16, snap=snap, protocols=ways, kept=_kept((one,), whole, ways, snap))
    values = {**one.known, "weak_spot": SPOT_DEPTH, "retardation": 0.01 * UNIT.time}
    u = whole.to_u(np.array([values[name] for name in names]))
    slopes = model._curve(0, u)["slopes"]
    for i, name in enumerate(names):
        step = 2e-6 * np.eye(u.size)[i]
        high, low = (model._curve(0, u + sign * step)["curve"] for sign in (1, -1))
        size = np.abs(slopes[i]).max()
        assert np.abs((high - low) / 4e-6 - slopes[i]).max() < 1e-6 * size, name
        assert size > 0


@pytest.mark.long
def test_a_measured_pressure_says_what_the_ramp_says():
    trace = record(settings=())
    asked = ("youngs_modulus",)
    measured = invert(trace, asked, begin={"youngs_modulus": 0.53e6})
    ramp = invert(trace, asked, js.inversion.Snap(elements=16, ramp=25.0 * UNIT.time, pressure=None),
                  begin={"youngs_modulus": 0.53e6})  # fmt: skip
    for name in ("youngs_modulus", "weak_spot"):
        assert ramp[name].value == pytest.approx(measured[name].value, rel=1e-6)


def test_what_is_not_said_of_the_pressure_is_refused():
    with pytest.raises(BadValue, match="how the pressure rose"):
        invert(record(settings=()))
    with pytest.raises(BadValue, match="measured pressure"):
        invert(record(), snap=js.inversion.Snap(pressure=([0.0, 1.0], [1e5, 2e5])))
    with pytest.raises(js.errors.BadName, match="level"):
        js.invert(record(), unknown=("youngs_modulus",), level="tracks")


class Killed(BaseException):
    """As sudden as a kill."""


@pytest.mark.long
def test_a_search_that_was_killed_goes_on_to_the_same_answer(tmp_path):
    whole = invert(record())

    def kill(number, share):
        if number == 4 and share > 0.5:
            raise Killed

    snap = js.inversion.Snap(elements=16, checkpoint=tmp_path, starts=2)
    with pytest.raises(Killed):
        invert(record(), snap=replace(snap, progress=kill))
    numbers = []
    again = invert(record(), snap=replace(snap, progress=lambda number, share: numbers.append(number)))
    assert max(numbers) >= 1
    for name in TRUTH:
        assert again[name].value == pytest.approx(whole[name].value, rel=1e-6)
    numbers.clear()
    spoiled = next(iter(tmp_path.rglob("*.npz")))
    spoiled.write_bytes(spoiled.read_bytes()[:100])
    repeated = invert(record(), snap=replace(snap, progress=lambda number, share: numbers.append(number)))
    assert len(numbers) <= 1  # all simulations are kept but the one that the disk has spoiled
    assert [one.value for one in repeated.estimates] == [one.value for one in again.estimates]


SCRIPT = """
import sys
import jshell as js
from tests.inversion import test_through as t
from tests.inversion.snapping import use
if __name__ == "__main__":
    use(setattr, pause=0.05)
    snap = js.inversion.Snap(elements=16, checkpoint=sys.argv[1], starts=3, engine="processes:2")
    print([one.value for one in t.invert(t.record(), snap=snap).estimates])
"""


@pytest.mark.slow
def test_a_multistart_whose_process_is_killed_goes_on_to_the_same_answer(tmp_path):
    script = tmp_path / "run.py"
    script.write_text(SCRIPT)
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    command = [sys.executable, str(script)]
    ask = lambda folder: [*command, str(tmp_path / folder)]  # noqa: E731
    whole = subprocess.run(ask("whole"), env=environment, capture_output=True, text=True, check=True).stdout
    for files in (1, 5, 8):
        child = subprocess.Popen(ask(f"killed{files}"), env=environment, start_new_session=True)
        while child.poll() is None and len(list((tmp_path / f"killed{files}").rglob("*.npz"))) < files:
            time.sleep(0.01)
        os.killpg(child.pid, signal.SIGKILL)
        child.wait()
        again = subprocess.run(ask(f"killed{files}"), env=environment, capture_output=True, text=True, check=True)
        assert again.stdout == whole


@pytest.mark.slow
@pytest.mark.parametrize("pad", [0.0, 0.3])
def test_changes_of_a_run_are_central_differences(pad):
    numbers = np.array([0.22, 0.9, 1.65, 0.004, 1.4, 0.5, pad, 0.11, 0.01])  # no part of the wall touches another

    def load(numbers, tangents):
        rise = lambda t: np.clip(t / 5.0, 0, 1)  # noqa: E731
        return motion.OuterPressure(
            lambda t: numbers[1] + (numbers[2] - numbers[1]) * rise(t),
            lambda t: np.stack([d[1] + (d[2] - d[1]) * rise(t) for d in tangents]),
        )

    ask = lambda x, tangents: motion.run(x, tangents, load(x, tangents), 15.0, 12, 3)  # noqa: E731
    still = np.zeros((motion.DIRECTIONS, len(FIELDS)))
    for first in range(0, len(FIELDS), motion.DIRECTIONS):
        tangents = np.eye(first + motion.DIRECTIONS, len(FIELDS))[first:]  # zeros beyond the last field
        found = ask(numbers, tangents)
        assert found.outcome == Outcome.OK
        for row, tangent in enumerate(tangents[: len(FIELDS) - first]):
            if tangent[6] and not pad:
                continue
            step = 1e-6 * (0.1 if tangent[3] else 1.0)
            high, low = (ask(numbers + sign * step * tangent, still) for sign in (1, -1))
            for name in ("V", "H", "S", "W"):
                c = motion.PLACES[name]
                slope = found.changes[row][:, c]
                error = np.abs((high.channels[:, c] - low.channels[:, c]) / (2 * step) - slope).max()
                assert error < 1e-6 * np.abs(slope).max(), (FIELDS[first + row], name)


@pytest.mark.slow
def test_a_simulation_on_a_finer_mesh_is_read_right():
    made = js.dynamics.simulate(
        Reduced(D, GAS, OUTER, ETA), elements=24, every=0.1, duration=45.0,
        weak_spot=js.contour.WeakSpot(SPOT_DEPTH),
    )  # fmt: skip
    volume = np.asarray(made["V"])
    noisy = volume + 0.01 * np.ptp(volume) * np.random.default_rng(0).standard_normal(volume.size)
    trace = js.Trace(made.times, {"V": noisy}, made.conditions, scales=UNIT, settings=(("ramp", "25.0"),))
    found = js.invert(trace, unknown=("youngs_modulus", "outer_pressure"), level=js.inversion.Snap(elements=16))
    assert found.outcome == Outcome.OK, found.report()
    for name, value in TRUTH.items():
        assert abs(found[name].value - value) < 3 * found[name].stderr
    assert found["youngs_modulus"].value == pytest.approx(0.5e6, rel=0.01)
    assert SPOT.nuisance
