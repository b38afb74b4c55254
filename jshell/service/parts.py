"""A batch in parts, so that one is fitted while the next is still on its way.

Every record is fitted by itself, but random starts of those that ended badly are
drawn one after another. So these go in once more, together: what comes out of
arrays equals one call to the bit; of files of several lengths, to rounding.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Protocol

import numpy as np

from jshell.calibration import BatchResult, Recordings
from jshell.service import archives
from jshell.service.batches import CONDITIONS, pack
from jshell.shell import Reduced

STEP = 1024  # records that the fit takes at once: a part is a multiple of them
STEPS = 4  # of a part at most: short records, too, are fitted while others are on their way
BYTES = 20 * 2**20  # of a part at most, where that is a step or more; a body without a form holds as much
File = tuple[str, bytes]
Whole = Recordings | list[File]


class Handed(Protocol):
    """A part that was handed in."""

    def result(self, seconds: float | int, /) -> BatchResult: ...

    def cancel(self) -> object: ...


def fitted(whole: Whole, submit: Callable[[File], Handed], seconds: float | int) -> BatchResult:
    """A batch fitted part by part.

    Args:
        whole: Records, or files of traces.
        submit: Hands a part in, as a file, and returns at once.
        seconds: Longest time to wait.

    Raises:
        JshellError: The error of a part; those still under way are then called off.
    """
    until = time.monotonic() + seconds
    handed: list[Handed] = []
    try:
        for part in split(whole):
            handed.append(submit(packed(part)))
        found = joined([one.result(until - time.monotonic()) for one in handed])
    except BaseException:
        for one in handed:
            one.cancel()
        raise
    again = tried_again(found)
    if len(handed) == 1 or not again.size:
        return found
    return placed(found, again, submit(packed(chosen(whole, again))).result(until - time.monotonic()))


def split(whole: Whole) -> list[Whole]:
    """A batch in parts."""
    many = count(whole)
    size = whole.values.nbytes if isinstance(whole, Recordings) else sum(len(content) for _, content in whole)
    steps, most = -(-many // STEP), BYTES // max(1, size // max(1, many)) // STEP
    if steps < 2:
        return [whole]
    ends = np.minimum(np.cumsum(_sizes(steps, min(max(1, most), STEPS))) * STEP, many)
    return [chosen(whole, np.arange(at, end)) for at, end in zip([0, *ends], ends, strict=False)]


def _sizes(steps: int, most: int) -> list[int]:
    """Steps of every part: small ones first, so that the fits begin soon, and last, so that no worker is left behind.

    Source     Polychronopoulos and Kuck 1987, doi:10.1109/TC.1987.5009495 (half of what is left: guided)
    """
    sizes = [1]
    while left := steps - sum(sizes):
        sizes.append(min(most, left if left <= 2 else min(2 * sizes[-1], -(-left // 2))))
    return sizes


def count(whole: Whole) -> int:
    """Traces of a batch."""
    return np.shape(whole.values)[0] if isinstance(whole, Recordings) else len(whole)


def packed(part: Whole) -> File:
    """A part as the file that is handed in."""
    if isinstance(part, Recordings):
        return "batch.npz", pack(part)
    return part[0] if len(part) == 1 else ("traces.zip", archives.pack_files(part))


def chosen(whole: Whole, rows: np.ndarray) -> Whole:
    """Some of a batch."""
    if not isinstance(whole, Recordings):
        return [whole[row] for row in rows]
    at = slice(rows[0], rows[-1] + 1) if np.array_equal(rows, np.arange(rows[0], rows[-1] + 1)) else rows
    many = count(whole)
    of = lambda values: None if values is None else np.asarray(values)[at]  # noqa: E731
    conditions = (np.broadcast_to(np.asarray(getattr(whole.conditions, name), float), (many,)) for name in CONDITIONS)
    times = np.asarray(whole.times)
    return Recordings(
        times if times.ndim == 1 else times[at],
        np.asarray(whole.values)[at],
        Reduced(*(values[at] for values in conditions)),
        of(whole.sigma),
        of(whole.counts),
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
