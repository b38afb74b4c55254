"""Whether a campaign run again gives the same, and if not, what moved.

Source     a record is compared bit for bit; a number that moved is told with how far
"""

from dataclasses import asdict, dataclass

import numpy as np

from jshell.campaigns.catalog import Catalog
from jshell.campaigns.perform import Result

ABSOLUTE = 1e-12  # relative changes are told against at least this


@dataclass(frozen=True)
class Moved:
    """A number, word or record that differs between two campaigns.

    Attributes:
        key, family: Of the run.
        column: What differs; a channel of the record as `record V`.
        before, after: The two, as text.
        relative: Largest relative change; infinite where a word, a length or the existence changed.
    """

    key: str
    family: str
    column: str
    before: str
    after: str
    relative: float


@dataclass(frozen=True)
class Comparison:
    """Two campaigns, run by run.

    Attributes:
        same: How many runs agree to the last bit, records and all.
        moved: What differs in the others.
        only_before, only_after: Keys of runs that only one of them has finished.
        versions: What was made with other versions, as `jax 0.10.0 -> 0.10.1`.
    """

    same: int
    moved: tuple[Moved, ...]
    only_before: tuple[str, ...]
    only_after: tuple[str, ...]
    versions: tuple[str, ...]

    @property
    def identical(self) -> bool:
        """Whether nothing moved and nothing is missing."""
        return not (self.moved or self.only_before or self.only_after)

    def worst(self) -> tuple[Moved, ...]:
        """The largest move of each column, largest first."""
        largest: dict[str, Moved] = {}
        for move in self.moved:
            if move.column not in largest or move.relative > largest[move.column].relative:
                largest[move.column] = move
        return tuple(sorted(largest.values(), key=lambda move: -move.relative))


def compare(before: Catalog, after: Catalog) -> Comparison:
    """Two catalogues of one design, or of designs that share runs.

    Example:
        >>> from jshell import campaigns
        >>> shipped = campaigns.catalog()
        >>> campaigns.compare(shipped, shipped).identical
        True
    """
    old = {result.run.key: (result, names) for result, names in zip(before.results, before.families, strict=True)}
    new = {result.run.key: result for result in after.results}
    moved: list[Moved] = []
    changes: dict[str, None] = {}
    same = 0
    for key, (result, names) in old.items():
        if key not in new:
            continue
        differing = _differences(result, new[key], names[0] if names else "")
        same += not differing
        moved += differing
        then, now = asdict(result.versions), asdict(new[key].versions)
        changes |= {f"{name} {then[name]} -> {now[name]}": None for name in then if then[name] != now[name]}
    return Comparison(
        same,
        tuple(moved),
        tuple(key for key in old if key not in new),
        tuple(key for key in new if key not in old),
        tuple(changes),
    )


def _differences(old: Result, new: Result, family: str) -> list[Moved]:
    key = old.run.key
    found = []
    then, now = old.findings.cells(), new.findings.cells()
    for name in then:
        a, b = then[name], now[name]
        if a == b:
            continue
        numbers = isinstance(a, int | float) and isinstance(b, int | float)
        relative = abs(a - b) / max(abs(a), abs(b), ABSOLUTE) if numbers else float("inf")
        found.append(Moved(key, family, name, str(a), str(b), relative))
    records = {"t": (old.times, new.times)}
    records |= {name: (old.channels.get(name), new.channels.get(name)) for name in {**old.channels, **new.channels}}
    for name, (a, b) in records.items():
        if a is None or b is None or a.shape != b.shape:
            lengths = ["none" if part is None else f"{part.size} samples" for part in (a, b)]
            found.append(Moved(key, family, f"record {name}", lengths[0], lengths[1], float("inf")))
        elif not np.array_equal(a, b):
            apart = np.abs(np.asarray(a, dtype=float) - np.asarray(b, dtype=float))
            where, size = int(np.argmax(apart)), float(np.max(np.abs(a)))
            found.append(Moved(key, family, f"record {name}", repr(float(a[where])), repr(float(b[where])),
                               float(apart[where]) / max(size, ABSOLUTE)))  # fmt: skip
    return found
