"""A batch in parts, so that one is fitted while the next is still on its way.

Every record is fitted by itself, but random starts of those that ended badly are
drawn one after another. So these go in once more, together: what comes out
equals one call to the bit.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Protocol

import numpy as np

from jshell.calibration import BatchResult, Recordings
from jshell.service.batches import CONDITIONS
from jshell.shell import Reduced

STEP = 1024  # records that the fit takes at once: a part is a multiple of them
BYTES = 2**24  # of a part at most, where that is a step or more


class Handed(Protocol):
    """A part that was handed in."""

    def result(self, seconds: float | int, /) -> BatchResult: ...

    def cancel(self) -> object: ...


def fitted(records: Recordings, submit: Callable[[Recordings], Handed], seconds: float | int) -> BatchResult:
    """Records fitted part by part.

    Args:
        records: All of them.
        submit: Hands a part in, and returns at once.
        seconds: Longest time to wait.

    Raises:
        JshellError: The error of a part; those still under way are then called off.
    """
    until = time.monotonic() + seconds
    handed: list[Handed] = []
    try:
        for part in split(records):
            handed.append(submit(part))
        found = joined([one.result(until - time.monotonic()) for one in handed])
    except BaseException:
        for one in handed:
            one.cancel()
        raise
    again = tried_again(found)
    if len(handed) == 1 or not again.size:
        return found
    return placed(found, again, submit(chosen(records, again)).result(until - time.monotonic()))


def split(records: Recordings) -> list[Recordings]:
    """Records in parts."""
    rows = np.shape(records.values)[0]
    each = max(1, BYTES // max(1, records.values.nbytes // max(1, rows)) // STEP) * STEP
    return [chosen(records, slice(at, at + each)) for at in range(0, rows, each)]


def chosen(records: Recordings, rows: slice | np.ndarray) -> Recordings:
    """Some of the records."""
    many = np.shape(records.values)[0]
    of = lambda values: None if values is None else np.asarray(values)[rows]  # noqa: E731
    conditions = (np.broadcast_to(np.asarray(getattr(records.conditions, name), float), (many,)) for name in CONDITIONS)
    times = np.asarray(records.times)
    return Recordings(
        times if times.ndim == 1 else times[rows],
        np.asarray(records.values)[rows],
        Reduced(*(values[rows] for values in conditions)),
        of(records.sigma),
        of(records.counts),
    )


def joined(found: Sequence[BatchResult]) -> BatchResult:
    """The results of parts as one."""
    begins = np.cumsum([0, *(len(part) for part in found)])
    directions = tuple(
        (int(begin) + row, words)
        for begin, part in zip(begins, found, strict=False)
        for row, words in part.free_directions
    )
    values = {name: np.concatenate([getattr(part, name) for part in found]) for name in _columns()}
    return replace(found[0], **values, free_directions=directions)


def tried_again(found: BatchResult) -> np.ndarray:
    """Rows that were given random starts."""
    return np.flatnonzero(found.tried > 1)


def placed(found: BatchResult, rows: np.ndarray, again: BatchResult) -> BatchResult:
    """A result with some of its rows replaced by another's."""
    values = {}
    for name in _columns():
        values[name] = getattr(found, name).copy()
        values[name][rows] = getattr(again, name)
    kept = [(row, words) for row, words in found.free_directions if row not in rows]
    directions = sorted([*kept, *((int(rows[row]), words) for row, words in again.free_directions)])
    return replace(found, **values, free_directions=tuple(directions))


def _columns() -> list[str]:
    return [field.name for field in fields(BatchResult) if field.name not in ("free_directions", "absolute")]
