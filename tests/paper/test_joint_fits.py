"""A campaign's constants: found where they are known, by each reading of the frequencies."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jshell.errors import BadName, BadShape, BadValue, Outcome
from jshell.oscillator import Coefficients, squared_frequencies
from jshell.paper.joint_fits import ShellRuns, calibrate, calibrate_trajectories, deviations, read_runs
from jshell.shell import Reduced
from jshell.trace import Trace

TRUE = Coefficients(3.0, 0.8, 0.3)
COUNT = 10


def table() -> dict[str, np.ndarray]:
    """Ten shells that obey eq:defw exactly: extracted with `TRUE`, modes 10 % higher, mode 4 moving the volume."""
    V, P0 = np.linspace(2.5, 3.4, COUNT), np.linspace(0.2, 2.5, COUNT)
    P = P0 * (4 * np.pi / 3 / V) ** 1.4
    w = np.array([np.sqrt(squared_frequencies(v, p, 3.0, 0.8, 0.3)) for v, p in zip(V, P, strict=True)])
    columns = {
        "key": [f"run{k}" for k in range(COUNT)], "families": ["pressure both"] * 4 + ["pressure"] * (COUNT - 4),
        "kind": ["snap"] * 7 + ["kick"] * 3, "outcome": ["ok"] * COUNT,
        "d_hat": 0.1 + 0 * V, "P0_hat": P0, "Pext_hat": P + 0.1, "eta_hat": 0.004 + 0 * V, "V_e": V, "P_e": P,
        "S_e": 12.0 + 0 * V, "V_settled": 1.001 * V, "omega_minus": w[:, 0], "omega_plus": w[:, 1],
        "V_omega_minus": w[:, 1], "V_omega_plus": 2 * w[:, 1], "tau": 8.0 + 0 * V, "v_pole_ring": 0.1 + 0 * V,
    }  # fmt: skip
    for k in range(4):
        columns[f"modes_omega_{k + 1}"] = 1.1 * w[:, min(k, 1)] * (1 if k < 2 else k)
        columns[f"undamped_omega_{k + 1}"] = 1.2 * w[:, min(k, 1)] * (1 if k < 2 else k)
        columns[f"modes_tau_{k + 1}"] = 7.0 + 0 * V
        columns[f"undamped_dV_{k + 1}"] = np.full(COUNT, (0.5, 1.0, 0.1, 3.0)[k])
        columns[f"modes_dV_{k + 1}"], columns[f"modes_dS_{k + 1}"] = 1 + 0 * V, -2.0 + 0 * V
    return {name: np.array(values) for name, values in columns.items()}


@pytest.fixture(scope="module")
def runs() -> ShellRuns:
    return read_runs(table())


@pytest.fixture(scope="module")
def readings(runs):
    return {reading.key: reading for reading in calibrate(runs)}


@pytest.mark.long
@pytest.mark.parametrize("weighting", ["V_e omega", "V_e^2 omega^2"])
def test_constants_are_found_from_what_was_heard(readings, weighting):
    found = readings["heard"].fits[weighting]
    assert readings["heard"].shells == 7
    assert found.outcome == Outcome.OK
    for name in ("alpha1", "alpha2", "k_vs"):
        assert found[name].value == pytest.approx(float(getattr(TRUE, name)), rel=1e-6)  # exact data


@pytest.mark.long
def test_a_common_factor_of_the_frequencies_divides_the_masses_by_its_square(readings):
    """What a box that raises every frequency does to the constants: k_VS stays."""
    extracted, modes = (readings[key].fits["V_e omega"] for key in ("modes of heard", "undamped range"))
    for name in ("alpha1", "alpha2"):
        assert extracted[name].value == pytest.approx(float(getattr(TRUE, name)) / 1.1**2, rel=1e-6)
        assert modes[name].value == pytest.approx(float(getattr(TRUE, name)) / 1.2**2, rel=1e-6)
    assert modes["k_vs"].value == pytest.approx(0.3, rel=1e-6)


def test_the_main_volume_mode_is_the_one_with_the_largest_share(runs):
    np.testing.assert_allclose(runs.by_volume[:, 1], runs.layered[:, 3])
    np.testing.assert_allclose(runs.share.sum(axis=1), 1.0)
    np.testing.assert_allclose(runs.area_per_volume, -2.0)


def test_runs_that_did_not_end_well_at_their_rest_shape_are_not_heard():
    columns = table()
    columns["outcome"][0] = "mesh"
    columns["V_settled"] = np.where(np.arange(COUNT) == 1, 0.8, 1.0) * columns["V_settled"]
    columns["omega_minus"] = np.where(np.arange(COUNT) == 2, np.nan, columns["omega_minus"])
    columns["eta_hat"] = np.where(np.arange(COUNT) == 3, 0.13, columns["eta_hat"])
    runs = read_runs(columns)
    assert not np.isfinite(runs.extracted[:3]).all(axis=1).any()
    reading = next(one for one in calibrate(runs) if one.key == "heard")
    assert reading.names == ("run4", "run5", "run6")


def test_heard_frequencies_are_told_apart_by_the_modes():
    columns = table()
    # the pair extracted is modes 2 and 4; of three, the second and third are modes 1 and 2
    low, high = columns["omega_minus"], columns["omega_plus"]
    columns |= {"three_omega_1": 0.5 * low, "three_omega_2": low, "three_omega_3": high}
    columns |= {"omega_minus": high, "omega_plus": 3 * high}
    runs = read_runs(columns)
    np.testing.assert_allclose(runs.identified, np.stack([low, high], axis=1))
    lost = read_runs(columns | {"three_omega_2": 0.7 * low})
    assert np.isnan(lost.identified[:, 0]).all()
    np.testing.assert_allclose(runs.filled, columns["P0_hat"])


def test_families_and_deviations(runs):
    assert runs.within("both").sum() == 4
    assert runs.within("pressure").all()
    np.testing.assert_allclose(deviations(runs, TRUE, runs.extracted), 0.0, atol=1e-9)
    np.testing.assert_allclose(deviations(runs, TRUE, runs.layered[:, :2]), 0.1, atol=1e-9)
    unstable = deviations(runs, Coefficients(3.0, 0.8, 3.0), runs.extracted)
    assert np.isnan(unstable[:, 0]).all()


def test_bad_tables_are_refused(runs):
    columns = table()
    del columns["V_e"]
    with pytest.raises(BadName, match="no column V_e"):
        read_runs(columns)
    with pytest.raises(BadShape, match="one per run"):
        dataclasses.replace(runs, names=runs.names[:3])
    with pytest.raises(BadValue, match="too few"):
        calibrate(runs.where(np.arange(COUNT) < 2))


@pytest.mark.long
def test_trajectories_give_the_same_constants():
    traces, t = [], np.arange(0.0, 40.0, 0.1)
    for V, P0, phase in ((2.7, 0.5, 0.3), (3.0, 0.9, 1.0), (3.3, 1.8, 2.0)):
        P = P0 * (4 * np.pi / 3 / V) ** 1.4
        w = np.sqrt(np.asarray(squared_frequencies(jnp.asarray(V), jnp.asarray(P), 3.0, 0.8, 0.3)))
        W = np.sqrt(w**2 - 1 / 64)
        ring = np.exp(-t / 8) * (np.cos(W[0] * t + phase) + 0.5 * np.cos(W[1] * t))
        before = np.linspace(1.2, 0.9, 40)[:-1]  # a snap: the volume falls to its dip
        V_t = V * np.concatenate([before, 0.9 + 0 * np.arange(51), 1 + 0.02 * ring])
        V_t[39] -= 0.01
        traces.append(Trace(np.arange(V_t.size) * 0.1, {"V": V_t}, Reduced(0.1, P0, P + 0.05, 0.004)))
    found = calibrate_trajectories(traces)
    assert found.outcome == Outcome.OK
    for name in ("alpha1", "alpha2", "k_vs"):
        assert found[name].value == pytest.approx(float(getattr(TRUE, name)), rel=1e-3)
