"""The door, on a stand-in that needs no compilation; the simulator itself in `test_simulator`."""

from dataclasses import replace

import numpy as np
import pytest

import jshell as js
from jshell.calibration import Prior
from jshell.errors import BadName, BadValue, Outcome, UnusableData
from jshell.inversion import fit
from jshell.inversion.model import Model
from jshell.inversion.search import SearchResult
from jshell.inversion.unknowns import ParameterSet

TRUTH = {"youngs_modulus": 0.5e6, "gas_pressure": 0.5e6 * 0.15}

pytestmark = pytest.mark.usefixtures("no_compilation")


def invert(trace, unknown, **options):
    return js.invert(trace, unknown=unknown, **{"exact": False, "nuisance": False} | options)


def test_modulus_and_gas_come_out_of_height_and_width(make_recording):
    found = invert(make_recording(), tuple(TRUTH))
    assert found.outcome == Outcome.OK
    assert found.warnings == ()
    for name, value in TRUTH.items():
        assert abs(found[name].value - value) < 3.5 * found[name].stderr
        assert found[name].stderr < 0.05 * value
    assert 0.8 < found.reduced_chi_square < 1.2
    assert "youngs_modulus" in found.report()
    assert "Pa" in repr(found)
    assert found.record()["units"] == {"youngs_modulus": "Pa", "gas_pressure": "Pa"}


def test_a_walls_own_loss_is_found_beside_its_modulus(make_recording):
    trace, truth = make_recording(retardation=0.03), {"youngs_modulus": TRUTH["youngs_modulus"]}
    truth["retardation"] = 0.03 * float(trace.scales.time)
    found = invert(trace, tuple(truth))
    assert found.outcome == Outcome.OK, found.report()
    assert found.warnings == ()
    for name, value in truth.items():
        assert abs(found[name].value - value) < 3.5 * found[name].stderr
        assert found[name].stderr < 0.1 * value
    # of a wall that is said to lose nothing the decays are wrong, and what is left is not white
    assert any(one.memory > 0.2 for one in invert(trace, ("youngs_modulus",)).noise)


def test_the_header_is_forgotten_where_it_is_asked(make_recording):
    trace = make_recording()
    # the same record with scales that another modulus would have: times and lengths are those of the laboratory
    factor = 4.0
    unit = js.shell.Scales(trace.scales.length, trace.scales.pressure * factor, trace.scales.density)
    c = trace.conditions.replace(
        gas_pressure=trace.conditions.gas_pressure / factor, outer_pressure=trace.conditions.outer_pressure / factor,
        viscosity=trace.conditions.viscosity / factor**0.5,
    )  # fmt: skip
    told = js.Trace(trace.times * factor**0.5, trace.channels, c, scales=unit, settings=trace.settings)
    one, other = invert(trace, tuple(TRUTH)), invert(told, tuple(TRUTH))
    assert told.scales.time * told.times[-1] == pytest.approx(trace.scales.time * trace.times[-1])
    for name in TRUTH:
        assert other[name].value == pytest.approx(one[name].value, rel=1e-5)


@pytest.mark.long
def test_intervals_hold_the_truth_with_and_without_memory(make_recording):
    held = []
    for seed in range(4):
        found = invert(make_recording(seed=seed, memory=0.9 * (seed % 2)), tuple(TRUTH))
        assert found.outcome == Outcome.OK
        assert all((one.memory > 0.5) == bool(seed % 2) for one in found.noise)
        held += [low <= TRUTH[n] <= high for n in TRUTH for low, high in [found.interval(n)]]
    assert np.mean(held) >= 6 / 8  # of 8 intervals of 95 % more than two fail once in two hundred times


def test_profiles_of_a_sharp_minimum_are_the_intervals_of_the_covariance(make_recording):
    found = invert(make_recording(), tuple(TRUTH))
    profiles = found.profile()
    for name in TRUTH:
        low, high = found.interval(name)
        assert profiles[name].low == pytest.approx(low, abs=0.05 * (high - low))
        assert profiles[name].high == pytest.approx(high, abs=0.05 * (high - low))
        assert profiles[name].stderr == pytest.approx(found[name].stderr)
        points = profiles.points[profiles.intervals.index(profiles[name])]
        assert points[:, 1].min() == 0
        assert points[points[:, 1].argmin(), 0] == pytest.approx(found[name].value)
        assert points[[0, -1], 1] == pytest.approx(profiles.growth, rel=0.05)  # the ends are found to 2 % of its root
    assert set(profiles.record()["intervals"]["youngs_modulus"]) == {"value", "low", "high", "reason"}


@pytest.mark.long
def test_the_posterior_is_as_wide_as_the_intervals_and_the_simulator_confirms_it(make_recording):
    found = invert(make_recording(), tuple(TRUTH))
    drawn = found.posterior(500, warmup=150, chains=1)
    assert drawn.sound
    assert drawn.departure < 1e-3
    for name in TRUTH:
        low, high = found.interval(name)
        # quantiles of some 400 independent draws scatter by 6 % of the width
        assert np.diff(drawn.interval(name)) == pytest.approx(high - low, rel=0.2)
        assert np.mean(drawn.interval(name)) == pytest.approx((low + high) / 2, abs=0.15 * (high - low))
    assert "simulator's own" in drawn.report()


@pytest.mark.long
def test_a_posterior_far_from_its_polynomials_is_not_sound(make_recording, monkeypatch):
    found = invert(make_recording(), tuple(TRUTH))
    monkeypatch.setattr("jshell.inversion.posterior.REACH", 1e-3)
    monkeypatch.setattr("jshell.inversion.posterior.AROUND", 1e-3)
    monkeypatch.setattr("jshell.inversion.posterior._slopes", lambda z: np.zeros((z.size, 10)))
    assert not found.posterior(50, warmup=50, chains=1).sound


def test_a_start_that_leads_nowhere_is_not_the_only_one(make_recording):
    found = invert(make_recording(), tuple(TRUTH), begin={"youngs_modulus": 5e4, "gas_pressure": 5e3})
    assert found.outcome == Outcome.OK
    assert len(found.starts) > 1
    assert abs(found["youngs_modulus"].value - 0.5e6) < 4 * found["youngs_modulus"].stderr


def test_a_start_without_a_shell_leaves_the_others_their_turn(make_recording, monkeypatch):
    begun, real = [], fit.minimise

    def minimise(model, u, weighings, **options):
        begun.append(u)
        if len(begun) == 1:
            return SearchResult(u, [], [], np.inf, Outcome.NO_BUCKLED_STATE, 0, u)
        return real(model, u, weighings, **options)

    listed = fit.starts
    monkeypatch.setattr(fit, "minimise", minimise)
    monkeypatch.setattr(fit, "starts", lambda *given: (listed(*given)[0], 1))  # one that is promising
    found = invert(make_recording(), tuple(TRUTH))
    assert found.outcome == Outcome.OK
    assert Outcome.NO_BUCKLED_STATE in [one.outcome for one in found.starts]
    assert abs(found["youngs_modulus"].value - 0.5e6) < 4 * found["youngs_modulus"].stderr


@pytest.mark.long
def test_behind_noise_that_remembers_another_minimum_is_looked_for(make_recording, monkeypatch):
    """The first start ends where what is left passes for noise; the shell is found by the second."""
    trace, real = make_recording(memory=0.9), fit.minimise
    found = invert(trace, tuple(TRUTH))
    assert found.solution is not None
    assert found.noise[0].memory > 0.5
    dear = replace(found.solution, u=found.solution.u + 0.3, cost=found.solution.cost + 100.0)

    def minimise(model, u, weighings, **options):
        return dear if np.allclose(u, dear.u) else real(model, u, weighings, **options)

    monkeypatch.setattr(fit, "minimise", minimise)
    monkeypatch.setattr(fit, "starts", lambda *_: (np.array([dear.u, found.solution.u]), 1))
    again = invert(trace, tuple(TRUTH))
    for name in TRUTH:
        assert again[name].value == pytest.approx(found[name].value, rel=1e-3)


def test_an_end_that_is_sought_on_may_cost_more_on_its_new_nodes(monkeypatch):
    model = Model((), ParameterSet((), np.empty(0), np.empty(0), (), True, ()))
    before = SearchResult(np.zeros(1), [], [], 752.072, Outcome.NOT_CONVERGED)
    for cost, taken in ((752.091, True), (753.0, True), (900.0, False)):
        after = SearchResult(np.zeros(1), [], [], cost, Outcome.OK)
        monkeypatch.setattr(fit, "minimise", lambda *_, after=after, **__: after)
        solutions = fit._brought_to_rest(model, [before], [])
        assert (solutions[0].outcome == Outcome.OK) == taken


@pytest.mark.long
def test_the_remedy_of_an_inversion_speaks_of_unknowns(make_recording):
    unknown, options = SETS["everything of one record"]
    found = invert(make_recording(), unknown, **options)
    with pytest.raises(js.NotOk, match="prior"):
        found.require_ok()
    assert "load" not in found.report()


@pytest.mark.long
def test_several_recordings_share_what_they_share(make_recording):
    traces = [make_recording(outer=outer, seed=k) for k, outer in enumerate((1.65, 1.8))]
    found = invert(traces, ("youngs_modulus", "outer_pressure"), local=("outer_pressure",))
    assert found.outcome == Outcome.OK
    assert found.varied == ("youngs_modulus", "outer_pressure[1]", "outer_pressure[2]")
    assert found["outer_pressure[2]"].value > found["outer_pressure[1]"].value
    alone = invert(traces[0], ("youngs_modulus", "outer_pressure"))
    assert found["youngs_modulus"].stderr < alone["youngs_modulus"].stderr


def test_without_units_the_numbers_are_those_of_the_simulator(make_recording):
    trace = make_recording()
    plain = js.Trace(trace.times, trace.channels, trace.conditions, settings=trace.settings)
    found = invert(plain, ("gas_pressure", "viscosity"))
    assert found.outcome == Outcome.OK
    assert found["gas_pressure"].value == pytest.approx(1.0, abs=4 * found["gas_pressure"].stderr)


SETS = {
    "modulus, radius and density without a length": (
        ("youngs_modulus", "radius", "thickness", "gas_pressure", "density"), {"free_rest": True}),
    "modulus and thickness and gas of one frequency": (
        ("youngs_modulus", "thickness", "gas_pressure"), {"free_rest": True, "channels": ("H",), "size": (1, 0, 0)}),
    "density and viscosity together with the modulus": (
        ("density", "viscosity", "youngs_modulus", "outer_pressure", "gas_pressure"), {}),
    "density, modulus and both pressures": (
        ("density", "youngs_modulus", "gas_pressure", "outer_pressure", "viscosity"), {"channels": ("H",)}),
    "both pressures and the modulus of one frequency": (
        ("gas_pressure", "outer_pressure", "youngs_modulus"),
        {"free_rest": True, "channels": ("H",), "size": (1, 0, 0)}),
    "modulus and weak spot of one frequency": (
        ("youngs_modulus", "weak_spot", "poisson_ratio"), {"free_rest": True, "channels": ("H",), "size": (1, 0, 0)}),
    "density and radius without a length": (
        ("density", "radius", "youngs_modulus"), {"free_rest": True, "channels": ("W",), "size": (1, 0, 0)}),
    "pad and modulus and gas of one frequency": (
        ("youngs_modulus", "pad", "gas_pressure"), {"free_rest": True, "channels": ("W",), "size": (1, 0, 0)}),
    "exponent and gas and modulus of one frequency": (
        ("kappa", "gas_pressure", "youngs_modulus"), {"free_rest": True, "channels": ("H",), "size": (1, 0, 0)}),
    "everything of one record": (
        ("radius", "thickness", "youngs_modulus", "gas_pressure", "outer_pressure", "density", "viscosity"), {}),
}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("name", SETS)
def test_what_cannot_be_known_is_said_with_its_direction(name, make_recording):
    unknown, options = SETS[name]
    made = {k: v for k, v in options.items() if k in ("channels", "size")}
    found = invert(make_recording(**made), unknown, free_rest=options.get("free_rest", False))
    assert found.outcome == Outcome.RANK_DEFICIENT, found.report()
    assert found.free_directions
    assert any(one.undetermined for one in found.estimates)
    for text in found.free_directions:
        assert "would s" in text  # what would settle or separate it
    with pytest.raises(js.NotOk):
        found.require_ok()


def test_a_prior_settles_what_the_record_leaves_open(make_recording):
    trace = make_recording(channels=("H",), size=(1, 0, 0))
    asked = {"youngs_modulus": None, "viscosity": None, "thickness": Prior(0.15 * 0.02, 0.02 * 0.15 * 0.02)}
    found = invert(trace, asked)
    assert found.outcome == Outcome.OK, found.report()
    assert found["thickness"].stderr < 0.025 * 0.003


def test_a_record_without_an_oscillation_is_refused(make_recording):
    trace = make_recording()
    still = js.Trace(trace.times, {"H": np.full(trace.times.size, 1.4)}, trace.conditions, scales=trace.scales)
    with pytest.raises(UnusableData):
        invert(still, ("youngs_modulus",))
    with pytest.raises(UnusableData, match="samples"):
        invert(trace, ("youngs_modulus",), stop=trace.times[10] * trace.scales.time)


@pytest.mark.long
def test_what_no_laboratory_knows_is_sought_beside_what_is_asked(make_recording):
    found = invert(make_recording(), tuple(TRUTH), nuisance=True)
    assert found.outcome == Outcome.OK, found.report()
    assert set(found.varied) == {*TRUTH, "pad", "weak_spot"}
    sure = invert(make_recording(), tuple(TRUTH))
    assert all(found[name].stderr > sure[name].stderr for name in TRUTH)
    assert set(invert(make_recording(), tuple(TRUTH), known={"pad": 0.3}, nuisance=True).varied) == {
        *TRUTH,
        "weak_spot",
    }


def test_a_longer_record_and_another_pressure_would_tell_more(make_recording):
    found = invert(make_recording(), tuple(TRUTH))
    pressure = 1.7 * 0.5e6 * 0.15
    same, more, other = found.next_recording([{}, {"samples": 1200}, {"outer_pressure": 1.1 * pressure}])
    for name in TRUTH:
        now = found[name].stderr / found[name].value
        assert same.stderr[name] == pytest.approx(now / 2**0.5, rel=0.1)  # the same again halves the variance
        assert more.stderr[name] == pytest.approx(now / 5**0.5, rel=0.1)  # four times as many samples beside the first
        assert 0 < other.stderr[name] < now
    with pytest.raises(js.JshellError, match="unknown"):
        found.next_recording([{"gas_pressure": 1e5}])


def test_a_question_that_contradicts_itself_is_refused(make_recording):
    trace = make_recording()
    with pytest.raises(BadValue, match="both known and asked"):
        invert(trace, tuple(TRUTH), known={"gas_pressure": 1e5})
    with pytest.raises(BadValue, match="3 values; expected one, or one for each of 2"):
        invert([trace, trace], ("youngs_modulus",), known={"outer_pressure": [1e5, 1e5, 1e5]})
    with pytest.raises(BadName, match="gas"):
        invert(trace, ("youngs_modulus",), begin={"gas": 1e5})
    with pytest.raises(UnusableData, match=r"0 samples in the window, of 300 from 0 to \d"):
        invert(trace, ("youngs_modulus",), start=1e3)
    with pytest.raises(BadName, match="expected one of H, W"):
        invert(trace, ("youngs_modulus",), channels=("V",))


@pytest.mark.parametrize("factor", [0.1, 10.0, 1e3])
def test_a_record_of_another_size_is_not_of_this_shell(make_recording, factor):
    trace = make_recording()
    radius, thickness = factor * float(trace.scales.length), factor * float(trace.scales.length) * 0.22
    with pytest.raises((UnusableData, BadValue), match=r"units of R0|radius \[m\]"):
        invert(trace, ("youngs_modulus",), known={"radius": radius, "thickness": thickness})
    with pytest.raises(BadValue, match="Was it in kPa"):
        invert(trace, ("youngs_modulus",), known={"outer_pressure": 176.0})


def test_a_start_may_leave_out_what_nobody_asked(make_recording):
    found = invert(make_recording(), tuple(TRUTH), begin={"youngs_modulus": 0.45e6})
    assert found.outcome == Outcome.OK
    assert abs(found["gas_pressure"].value - TRUTH["gas_pressure"]) < 3.5 * found["gas_pressure"].stderr
