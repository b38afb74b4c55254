"""The modal loss and any channel in batches: rows are the single fits of the same records."""

import numpy as np
import pytest

from jshell.calibration import Recordings, fit_batch, fit_trajectories
from jshell.errors import BadName, BadValue
from jshell.oscillator import random_shell, random_trace
from jshell.trace import Trace
from tests.calibration.test_noise import autocorrelated

pytestmark = pytest.mark.filterwarnings("ignore::jshell.calibration.FitWarning", "ignore::jshell.errors.RangeWarning")
MEASURES = {"H": (1.2, 0.3, 0.1), "W": (2.1, -0.05, 0.2), "V": (0.0, 1.0, 0.0), "S": (0.0, 0.0, 1.0)}
SIGMAS = 1e-5  # of a standard error: a single search stops where a step promises 1e-12 of χ², 3e-5 before that step
STARTED = 1e-2  # where V rests is read at the start, and two pencils' poles differ: 2e-7 of V, of whose errors 1e-4
ABOUT = 2e-3  # of φ that is searched to 3e-5 here and to 1e-4 there


def measured(seed: int, memory: float = 0.0, extra: float = 0.0, names=("H", "W"), keep=slice(None)) -> Trace:
    """Channels that follow V and S each in its own way, with noise and, where asked for, a motion of neither mode."""
    clean = random_trace(random_shell(seed), seed, noise=0.0)
    V, S = (np.asarray(clean[name]) for name in ("V", "S"))
    channels = {}
    for k, name in enumerate(names):
        level, of_V, of_S = MEASURES[name]
        y = level + of_V * (V - (V.mean() if level else 0)) + of_S * (S - (S.mean() if level else 0))
        y = y + extra * y.std() * np.cos(3.1 * np.asarray(clean.times))
        channels[name] = (y + 0.01 * y.std() * autocorrelated(memory, 10 * seed + k))[keep]
    return Trace(np.asarray(clean.times)[keep], channels, clean.conditions)


def agree(found, row: int, trace: Trace, sigmas: float | None = None, **options) -> None:
    sigmas = sigmas or (ABOUT if found.memory[row].any() else SIGMAS)
    single = fit_trajectories(trace, "modal", starts=0, **options)
    assert found.outcomes[row] == single.outcome
    assert found.misfit[row] == any(text.startswith("misfit") for text in single.warnings)
    assert found.memory[row] == pytest.approx([one.memory for one in single.noise], abs=1e-3)
    derived = {one.name: one for one in single.derived}
    for m, name in enumerate(("omega_minus", "omega_plus")):
        one = derived[name]
        assert abs(found.omega[row, m] - one.value) < sigmas * one.stderr
        assert found.omega_stderr[row, m] == pytest.approx(one.stderr, rel=sigmas)
    for name in ("alpha1", "alpha2", "k_vs", "tau"):
        one = single[name]
        if one.role == "fixed":
            assert found.error_of(name)[row] == 0
            continue
        assert np.isnan(found[name][row]) == one.undetermined
        if not one.undetermined:
            assert abs(found[name][row] - one.value) < sigmas * one.stderr
            assert found.error_of(name)[row] == pytest.approx(one.stderr, rel=sigmas)


@pytest.mark.long
def test_rows_of_height_and_width_are_single_modal_fits():
    traces = [measured(0), measured(1)]
    found = fit_batch(traces, "modal")
    agree(found, 0, traces[0])
    assert found.state_names[:2] == ("H_slow_cos", "H_slow_sin")
    assert found.free_directions[0][1].startswith("alpha1, alpha2, k_vs")
    assert fit_batch(traces).loss == "modal"  # neither has V and S

    held = fit_batch(traces[:1], "modal", fix={"alpha2": 1.2})
    agree(held, 0, traces[0], fix={"alpha2": 1.2})
    assert held.ok[0]


@pytest.mark.slow
def test_noise_that_remembers_and_misfits_are_those_of_single_fits():
    traces = [measured(0), measured(0, 0.9), measured(0, extra=0.05)]
    found = fit_batch(traces, "modal")
    for row, trace in enumerate(traces):
        agree(found, row, trace)
    assert list(found.memory.max(axis=1) > 0.3)[:2] == [False, True]
    assert list(found.misfit) == [False, False, True]


@pytest.mark.slow
def test_rows_of_all_measures_and_uneven_ones_are_single_modal_fits():
    names, keep = ("V", "S", "H", "W"), np.arange(400) % 37 != 30
    traces = [measured(1, names=names), measured(1, 0.8, names=names), measured(1, names=names, keep=keep)]
    held = float(random_shell(1).coefficients.alpha2)
    for options in ({}, {"equilibrium": "trace", "fix": {"alpha2": held}}):
        found = fit_batch(traces, "modal", **options)
        for row, trace in enumerate(traces):
            agree(found, row, trace, sigmas=STARTED if options else None, **options)
    plain = fit_batch(traces)
    assert plain.loss == "strict"
    assert plain.channels == ("V", "S")


def test_what_the_modal_loss_has_not_is_refused():
    trace = measured(0)
    with pytest.raises(BadName, match="integrates nothing"):
        fit_batch([trace], "modal", solver="diffrax")
    with pytest.raises(BadName, match="own coordinates"):
        fit_batch([trace], "strict", channels=("H", "W"))
    with pytest.raises(BadName, match="no channel V"):
        fit_batch([trace], "modal", equilibrium="trace")
    with pytest.raises(BadValue, match="leave the three open"):
        fit_batch([trace], "modal", bounds={"alpha1": (1.0, 3.0)})
    records = Recordings(trace.times, np.stack([[trace["H"]]]), trace.conditions, channels=("H",))
    with pytest.raises(BadName, match="no such channel"):
        fit_batch(records, "modal", channels=("V",))
