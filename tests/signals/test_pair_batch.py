"""Two sinusoids in many records at once: against the single fit and the truth."""

import numpy as np
import pytest

from jshell.errors import BadShape, BadValue, Outcome
from jshell.signals import extract, extract_batch
from jshell.trace import Trace

T = 0.1 * np.arange(400)


def _records(count):
    random = np.random.default_rng(0)
    Omega = np.stack([random.uniform(0.6, 1.3, count), random.uniform(1.5, 3.0, count)], axis=1)
    tau, phase = random.uniform(5, 20, count), random.uniform(0, 2 * np.pi, (count, 2))
    waves = random.uniform(0.3, 1.0, (count, 2, 1)) * np.cos(Omega[:, :, None] * T + phase[:, :, None])
    values = 3 + np.exp(-T / tau[:, None]) * waves.sum(axis=1)
    values += 0.01 * values.std(axis=1, keepdims=True) * random.standard_normal(values.shape)
    return values, np.hypot(Omega, 1 / tau[:, None]), tau


@pytest.mark.long
def test_rows_agree_with_the_single_extraction_and_the_truth():
    values, omega, tau = _records(20)
    values[7] = 1.0
    values[9, 50] = np.nan
    identified = extract_batch(0.1, values)
    good = identified.outcome == Outcome.OK
    assert list(np.flatnonzero(~good)) == [7, 9]
    assert np.isnan(identified.omega[7]).all()
    assert np.all(np.abs(identified.omega - omega)[good] < 4.5 * identified.stderr[good, :2])
    assert np.all(np.abs(identified.tau - tau)[good] < 4.5 * identified.stderr[good, 2])
    for row in (0, 3):
        one = extract(Trace(T, {"V": values[row]}), start=0)
        assert identified.omega[row, 0] == pytest.approx(one.omega_minus, rel=1e-6)
        assert identified.tau[row] == pytest.approx(one.tau, rel=1e-5)
        assert identified.amplitude[row, 1] == pytest.approx(one.amplitudes["V"][1], rel=1e-5)
        assert identified.phase[row, 0] == pytest.approx(one.phases["V"][0], abs=1e-5)
        assert identified.stderr[row, 0] == pytest.approx(one.stderr["omega_minus"], rel=1e-2)


@pytest.mark.long
def test_lengths_may_differ_and_padding_is_not_read():
    values, omega, _ = _records(20)
    values[1, 300:] = np.nan
    values[2] += 0.1 * values[2].std() * np.cos(4.7 * T)  # a wave that neither mode describes
    counts = np.where(np.arange(20) == 1, 300, 400)
    identified = extract_batch(0.1, values, counts)
    assert np.all(identified.outcome == Outcome.OK)
    assert list(np.flatnonzero(~identified.described)) == [2]
    assert np.all(np.abs(identified.omega[1] - omega[1]) < 4.5 * identified.stderr[1, :2])


def test_impossible_records_are_refused():
    with pytest.raises(BadShape, match="values"):
        extract_batch(0.1, np.zeros(50))
    with pytest.raises(BadValue, match="step"):
        extract_batch(0.0, np.zeros((2, 50)))
