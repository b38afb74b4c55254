"""A mode that rises above the noise is fitted, however much louder the other one is."""

import numpy as np
import pytest

from jshell import Reduced, Trace
from jshell.calibration import fit_trajectories
from jshell.oscillator import Coefficients, simulate

CONDITIONS = Reduced(0.08, 0.9, 1.2, 0.004)
TRUTH = Coefficients.with_decay_time(3.0, 0.85, 0.2, tau=12.0, viscosity=0.004)
TIMES = np.linspace(0, 40, 401)
SLOW, FAST = np.array([0.1, -0.4472113]), np.array([1.0, 0.73432])  # V and S of the two modes


@pytest.mark.parametrize(("share", "noise", "seed"), [(1e-4, 1e-5, 0), (1e-4, 1e-6, 1), (1e-3, 1e-4, 2)])
def test_the_quiet_mode_is_heard(share, noise, seed):
    run = simulate(CONDITIONS, TRUTH, initial=(*(SLOW + share * FAST), 0.0, 0.0), times=TIMES)
    random = np.random.default_rng(seed)
    V, S = (np.asarray(run[name]) + noise * random.standard_normal(TIMES.size) for name in "VS")
    found = fit_trajectories(Trace(TIMES, {"V": V, "S": S}, CONDITIONS))
    assert found.outcome.word == "ok"
    for name, wanted in (("alpha1", 3.0), ("alpha2", 0.85), ("k_vs", 0.2)):
        assert abs(found[name].value - wanted) < 4.5 * found[name].stderr
        assert found[name].stderr < 0.1 * wanted
