"""Records that cannot be of their shell: slips of unit, of column, of holder; each refused with the slip named."""

import dataclasses

import numpy as np
import pytest

import jshell as js
from jshell.calibration import fit_batch, fit_trajectories
from jshell.calibration.nonlinear import fit_nonlinear
from jshell.errors import BadValue, NotOk, Outcome, UnusableData
from jshell.oscillator import SOURCE, random_shell, random_trace, simulate
from jshell.service.preview import preview
from jshell.shell import SPHERE_AREA, SPHERE_VOLUME

pytestmark = pytest.mark.filterwarnings("ignore::jshell.errors.RangeWarning", "ignore::UserWarning")


@pytest.fixture(scope="module")
def ring():
    return random_trace(random_shell(0), 0)


@pytest.fixture(scope="module")
def film():
    return js.io.read_trace(js.io.example("attached_R_HW.csv"))


def changed(trace, settings=None, conditions=None, times=None, **channels):
    """The trace with channels scaled, and other facts replaced."""
    scaled = {name: np.asarray(trace[name]) * channels.get(name, 1.0) for name in trace.channels}
    return dataclasses.replace(
        trace,
        times=np.asarray(trace.times) if times is None else times,
        channels=scaled,
        settings=trace.settings if settings is None else settings,
        conditions=trace.conditions if conditions is None else conditions,
    )


@pytest.mark.parametrize(
    ("factor", "hint"),
    [(2.19, "%"), (1e-5, "-100%"), (1 / SPHERE_VOLUME, "V/V0"), (8.0, "diameter"), (1 / 8, "radius for diameter")],
)
def test_a_volume_that_is_not_the_shells_is_refused(ring, factor, hint):
    with pytest.raises(UnusableData, match=hint):
        fit_trajectories(changed(ring, V=factor))


def test_an_area_over_the_spheres_is_refused(ring):
    with pytest.raises(UnusableData, match="'S'"):
        fit_trajectories(changed(ring, S=1 / SPHERE_AREA))


def test_a_record_shorter_than_a_motion_is_refused(ring):
    with pytest.raises(UnusableData, match="period"):
        fit_trajectories(changed(ring, times=np.asarray(ring.times) * 1e-3))


def test_exchanged_columns_and_wrong_lengths_are_refused(film):
    with pytest.raises(UnusableData, match="exchanged"):
        fit_trajectories(dataclasses.replace(film, channels={"H": film["W"], "W": film["H"]}), fix={"alpha2": 1.1})
    with pytest.raises(UnusableData, match="diameters"):
        fit_trajectories(changed(film, H=0.5, W=0.5), fix={"alpha2": 1.1})
    with pytest.raises(UnusableData, match="unit"):
        fit_trajectories(changed(film, H=22.5, W=22.5), fix={"alpha2": 1.1})


@pytest.mark.long
def test_an_excursion_says_nothing_of_a_level(film):
    still = {name: np.asarray(film[name]) - np.mean(film[name]) for name in "HW"}
    found = fit_trajectories(dataclasses.replace(film, channels=still), fix={"alpha2": 1.1})
    assert found.outcome == Outcome.OK


def test_a_run_that_made_no_numbers_says_why():
    sphere = js.Reduced(0.08, 0.9, 0.85, 0.004)
    trace = simulate(sphere, SOURCE, initial=(-0.1, 0.05, 0.0, 0.0), times=np.linspace(0.0, 40.0, 101))
    with pytest.raises(BadValue, match=r"no_buckled_state.*raise the outer pressure"):
        js.fit(trace)


@pytest.mark.parametrize("load", [{"gas_pressure": 1e-320}, {"gas_pressure": 1e-300}, {"outer_pressure": 1e308}])
@pytest.mark.parametrize("equilibrium", ["plateau", "trace"])
def test_a_load_that_leaves_nothing_of_the_shell_is_named(ring, load, equilibrium):
    crushed = changed(ring, conditions=ring.conditions.replace(**load))
    with pytest.raises(BadValue, match="the load crushes the shell"):
        fit_trajectories(crushed, equilibrium=equilibrium)
    assert any("the load crushes the shell" in note for note in preview([crushed], equilibrium=equilibrium).notes)


@pytest.mark.long
def test_a_fit_whose_numbers_are_not_finite_says_so(ring):
    with pytest.raises(NotOk, match="not_finite"):
        fit_trajectories(changed(ring, conditions=ring.conditions.replace(gas_pressure=1e300)), equilibrium="trace")


def test_a_gauge_pressure_is_named(ring):
    with pytest.raises(BadValue, match="gauge"):
        fit_trajectories(changed(ring, conditions=ring.conditions.replace(outer_pressure=0.5)))


@pytest.mark.long
def test_a_nonlinear_fit_of_another_shell_is_unusable(ring):
    assert fit_nonlinear([ring, changed(ring, V=2.19)]).outcome == (Outcome.OK, Outcome.UNUSABLE_DATA)


@pytest.mark.long
def test_a_row_of_a_batch_of_another_shell_is_unusable_and_hurts_no_other(ring):
    found = fit_batch([ring, changed(ring, V=2.19), changed(ring, V=1e-5), ring])
    assert [outcome.word for outcome in found.outcomes] == ["ok", "unusable_data", "unusable_data", "ok"]


HELD = (("attached", "0.33"),)


INVERTED = [{}, {"loss": "modal", "uncertain": {"youngs_modulus": None}}, {"uncertain": {"thickness": 0.1}}]


@pytest.mark.parametrize("options", INVERTED, ids=str)
def test_a_shell_on_a_pad_is_not_inverted_by_the_free_shells_model(ring, options):
    with pytest.raises(BadValue, match="pad of half-angle"):
        fit_trajectories(changed(ring, settings=HELD), **options)


@pytest.mark.parametrize("fit", [fit_batch, fit_nonlinear], ids=lambda f: f.__name__)
def test_nor_in_a_batch(ring, fit):
    with pytest.raises(BadValue, match=r"trace 2.*pad of half-angle"):
        fit([ring, changed(ring, settings=HELD)])


@pytest.mark.long
def test_its_frequencies_are_fitted_and_said_to_be_of_a_held_shell(film):
    assert film.attached == 0.33
    found = fit_trajectories(film, fix={"alpha2": 1.1})
    assert found.outcome == Outcome.OK
    assert any("not comparable" in text for text in found.warnings)
    with pytest.raises(BadValue, match="pad of half-angle"):
        fit_trajectories(film, fix={"alpha1": 3.6, "alpha2": 1.1, "k_vs": 0.23}, uncertain={"youngs_modulus": None})


def test_a_pad_that_is_no_angle_is_refused(ring):
    with pytest.raises(BadValue, match="half-angle"):
        fit_trajectories(changed(ring, settings=(("attached", "much"),)))


@pytest.mark.long
def test_simulated_records_carry_their_pad():
    made = js.dynamics.simulate(js.presets.R.conditions, duration=1.0, elements=16, attached=0.33)
    assert made.attached == 0.33
    assert js.dynamics.simulate(js.presets.R.conditions, duration=1.0, elements=16).attached == 0.0
