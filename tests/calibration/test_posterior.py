"""The sampler alone, on densities that are known."""

import jax.numpy as jnp
import numpy as np
import pytest

from jshell.calibration.posterior import SamplerSettings, drawn


def test_other_data_are_drawn_by_the_program_of_the_first():
    pytest.importorskip("numpyro", reason="no NumPyro: pip install jshell[bayes]")
    traced = []

    def energy(z, data):
        traced.append(z)
        return 0.5 * jnp.sum(((z - data) / jnp.array([1.0, 0.2])) ** 2)

    settings = SamplerSettings(draws=1000, warmup=300, chains=2, seed=0)
    first = drawn(energy, 2, settings, jnp.zeros(2))
    often = len(traced)
    other = drawn(energy, 2, settings, jnp.ones(2))
    assert len(traced) == often
    for found, mean in ((first, 0.0), (other, 1.0)):
        assert found.z.shape == (2, 1000, 2)
        assert not found.diverging.any()
        # some 1 000 independent draws: means to 3 %, widths to 2 % of a standard deviation, times four
        assert found.z.mean(axis=(0, 1)) == pytest.approx(mean, abs=0.13)
        assert found.z.std(axis=(0, 1)) == pytest.approx([1.0, 0.2], rel=0.1)
        assert not np.array_equal(found.z[0], found.z[1])
