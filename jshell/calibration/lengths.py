"""Records brought to few lengths, so that records of any length share few compiled programs.

A record is continued by samples of weight 0 up to the next power of two; they
add rows of zeros to a residual, and nothing to a minimum. What comes back is
cut to the record's own length.
"""

import dataclasses

import equinox as eqx
import numpy as np

from jshell.calibration.losses import TraceModel
from jshell.calibration.records import Record

SHORTEST = 256


def common_length(count: int) -> int:
    """The length that records of a count share: a power of two."""
    return max(SHORTEST, 1 << (count - 1).bit_length())


def lengthened(model: TraceModel) -> TraceModel:
    """The same problem with records of common lengths; as it is where an adaptive solver would have to run on."""
    if model.solver != "exact":
        return model
    return eqx.tree_at(lambda p: p.records, model, tuple(_lengthened(one) for one in model.records))


def own_rows(model: TraceModel) -> list[np.ndarray]:
    """Per block of linear parameters, marks on the rows of `lengthened` that are the problem's own."""
    found = []
    for short, long in zip(model.records, lengthened(model).records, strict=True):
        mark = np.arange(long.elapsed.size) < short.elapsed.size
        channels = len(short.channels)
        found += [np.tile(mark, channels)] if model.loss == "strict" else [mark] * channels
    return found


def without_data(model: TraceModel) -> TraceModel:
    """The same problem with records of no sample, for what depends on their conditions alone."""
    blank = np.zeros(0)
    records = tuple(dataclasses.replace(one, elapsed=blank, data=blank, weight=blank) for one in model.records)
    return eqx.tree_at(lambda p: p.records, model, records)


def _lengthened(record: Record) -> Record:
    elapsed, data, weight = (np.asarray(x, dtype=float) for x in (record.elapsed, record.data, record.weight))
    count = elapsed.size
    spare = common_length(count) - count
    if not spare or count < 2:
        return record
    # an even grid goes on as it is; an uneven one stands still
    step = (elapsed[-1] - elapsed[0]) / (count - 1) if record.uniform else 0.0
    more = elapsed[-1] + step * np.arange(1, spare + 1)
    wide = ((0, 0), (0, spare))
    return dataclasses.replace(
        record, elapsed=np.append(elapsed, more), data=np.pad(data, wide), weight=np.pad(weight, wide)
    )
