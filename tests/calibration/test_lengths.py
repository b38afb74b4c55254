"""Records of any length share programs, and nothing of a fit changes with it."""

import warnings

import numpy as np
import pytest

from jshell import calibration
from jshell.calibration import lengths
from jshell.oscillator import random_shell, random_trace
from jshell.trace import Trace


@pytest.mark.parametrize(("count", "common"), [(16, 256), (256, 256), (257, 512), (400, 512), (513, 1024)])
def test_lengths_are_powers_of_two(count, common):
    assert lengths.common_length(count) == common


@pytest.mark.long
@pytest.mark.parametrize("loss", ["strict", "modal"])
@pytest.mark.parametrize("even", [True, False])
def test_a_fit_does_not_depend_on_the_length_it_is_brought_to(monkeypatch, loss, even):
    trace = random_trace(random_shell(3), 3)
    keep = np.delete(np.arange(300), [] if even else [50, 51, 120, 240])
    trace = Trace(
        np.asarray(trace.times)[keep], {n: np.asarray(v)[keep] for n, v in trace.channels.items()}, trace.conditions
    )
    options = {"fix": {"alpha2": 1.1}, "noise": "white"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # both say the same of this record
        found = calibration.fit_trajectories(trace, loss, **options)
        monkeypatch.setattr(lengths, "common_length", lambda count: count)
        plain = calibration.fit_trajectories(trace, loss, **options)
    assert found.outcome == plain.outcome
    assert found.n_data == plain.n_data
    assert found.residual.shape == plain.residual.shape
    for one, other in zip((*found.estimates, *found.derived), (*plain.estimates, *plain.derived), strict=True):
        assert one.name == other.name
        # both stop within the solver's tolerance of the same minimum, a small part of the error
        assert one.value == pytest.approx(
            other.value, rel=1e-7, abs=1e-4 * (other.stderr if other.stderr > 0 else 1e-9)
        )
        assert one.stderr == pytest.approx(other.stderr, rel=1e-6, nan_ok=True)
    np.testing.assert_allclose(found.residual, plain.residual, atol=1e-6)
