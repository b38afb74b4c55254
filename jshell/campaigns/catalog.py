"""What has run: a row per run, its record beside it, and tables for others.

Example
    >>> from jshell import campaigns
    >>> found = campaigns.catalog()
    >>> thin = found.where(family="thickness")
    >>> bool(thin["d_hat"].min() < 0.05)
    True

Source     CSV for people, xarray for programs
"""

import csv
import dataclasses
import io
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jshell.campaigns.perform import Result
from jshell.campaigns.planned import Run
from jshell.campaigns.store import RunStore
from jshell.campaigns.writing import read_design
from jshell.errors import BadFile, Outcome, choose, require_extra
from jshell.membrane import thinnest_round
from jshell.membrane.round import law_holds

if TYPE_CHECKING:
    import xarray

SHIPPED = "campaign"
WHEN_ASKED = {"symmetry_asked": False, "azimuth": 0, "growth": None}  # columns that stand where some run has more
WHEN_ASKED |= dict.fromkeys(f"azimuth_{number}_{m}" for number in ("omega", "tau") for m in range(1, 5))


@dataclass(frozen=True)
class Catalog:
    """The finished runs of a campaign, in the order of its design.

    `catalog["omega_minus"]` is a column: numbers, NaN where a run has none, or words. `len`, iteration and
    indexing by a whole number give single results.

    Attributes:
        name: Of the design.
        results: The finished runs.
        families: Those each belongs to.
        missing: Runs of the design that are not finished.
        orphan_files: Files in the folder that belong to no run of the design.
    """

    name: str
    results: tuple[Result, ...]
    families: tuple[tuple[str, ...], ...]
    missing: tuple[Run, ...] = ()
    orphan_files: int = 0

    @property
    def strangers(self) -> int:
        """Deprecated name of `orphan_files`."""
        warnings.warn("Catalog.strangers is now Catalog.orphan_files.", DeprecationWarning, stacklevel=2)
        return self.orphan_files

    def __len__(self) -> int:
        return len(self.results)

    def __iter__(self) -> Iterator[Result]:
        return iter(self.results)

    def rows(self) -> list[dict[str, Any]]:
        """A dictionary per run: key, families, the fields of `Run`, of `Findings` and of `Versions`."""
        found = []
        for result, families in zip(self.results, self.families, strict=True):
            made_with = {f"{name}_version": text for name, text in dataclasses.asdict(result.versions).items()}
            facts = {"key": result.run.key, "families": " ".join(families), **dataclasses.asdict(result.run)}
            facts["symmetry_asked"] = facts.pop("symmetry")
            found.append({**facts, **result.findings.cells(), "symmetry": symmetry(result), **made_with})
        # what no run was asked for is no column
        unasked = {name for name, none in WHEN_ASKED.items() if all(row[name] == none for row in found)}
        return [{name: value for name, value in row.items() if name not in unasked} for row in found]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.rows()[0]) if self.results else ()

    def __getitem__(self, name: str | int) -> Any:
        if isinstance(name, int | np.integer):
            return self.results[int(name)]
        rows = self.rows()
        if rows:
            choose("column", name, rows[0])
        values = [row[name] for row in rows]
        if any(isinstance(value, str) for value in values):
            return np.array(values)
        return np.array([np.nan if value is None else float(value) for value in values])

    def where(self, *, family: str | None = None, **equal: Any) -> "Catalog":
        """The runs of a family, and those whose columns equal values: `where(kind="snap", outcome="ok", attached=0)`.

        Raises:
            BadName: No such family or column.
        """
        known = dict.fromkeys(name for names in self.families for name in names)
        if family is not None:
            choose("family", family, known)
        keep = np.array([family is None or family in names for names in self.families], dtype=bool)
        for name, value in equal.items():
            column = self[name]
            keep &= (column == value) if column.dtype.kind in "US" else np.isclose(column, float(value), rtol=1e-9)
        return self._only(keep)

    def _only(self, keep: np.ndarray) -> "Catalog":
        pick = lambda items: tuple(item for item, kept in zip(items, keep, strict=True) if kept)  # noqa: E731
        return dataclasses.replace(self, results=pick(self.results), families=pick(self.families))

    def sorted_by(self, name: str) -> "Catalog":
        """The same runs by a rising column."""
        order = np.argsort(self[name], kind="stable")
        return dataclasses.replace(
            self,
            results=tuple(self.results[k] for k in order),
            families=tuple(self.families[k] for k in order),
        )

    def outcomes(self) -> dict[str, int]:
        """Outcome to how many runs ended so, the most frequent first."""
        return dict(Counter(result.findings.outcome for result in self.results).most_common())

    def to_csv(self) -> str:
        """The table as text; numbers read back to the bit, an empty cell is none."""
        rows = self.rows()
        buffer = io.StringIO()
        if rows:
            writer = csv.DictWriter(buffer, fieldnames=list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows({name: _cell(value) for name, value in row.items()} for row in rows)
        return buffer.getvalue()

    def to_xarray(self, *, records: bool = False) -> "xarray.Dataset":
        """The table as a Dataset along `run`; with `records` their channels along `sample` too, NaN past the end.

        Raises:
            MissingExtra: Without the extra `io`.
        """
        xarray = require_extra("xarray", "io", "Catalog.to_xarray")
        table = {name: (("run",), self[name]) for name in self.columns if name != "key"}
        data = xarray.Dataset(table, {"key": (("run",), self["key"])} if self.results else {}, {"name": self.name})
        if not records:
            return data
        longest = max((result.times.size for result in self.results), default=0)
        names = dict.fromkeys(name for result in self.results for name in result.channels)
        fill = lambda part: np.pad(part.astype(float), (0, longest - part.size), constant_values=np.nan)  # noqa: E731
        none = np.full(longest, np.nan)
        parts = {"t": np.array([fill(result.times) for result in self.results])}
        for name in names:
            rows = [fill(result.channels[name]) if name in result.channels else none for result in self.results]
            parts[f"record_{name}"] = np.array(rows)
        return data.assign({name: (("run", "sample"), values) for name, values in parts.items()})


def symmetry(result: Result) -> str:
    """Whether the dimple of a run is round, as computed or else by the law for even walls; empty if there is none."""
    run, found = result.run, result.findings
    if found.symmetry or found.V_e_over_V0 is None:
        return found.symmetry
    word = "round" if run.d_hat >= thinnest_round(found.V_e_over_V0, run.nu) else "not round"
    return f"{word} (law{'' if law_holds(run.d_hat, found.V_e_over_V0) else ', beyond its range'})"


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return repr(float(value)) if isinstance(value, float) else str(value)


def shipped() -> Path:
    """The folder of the campaign that comes with jshell: of a checkout, or of the installed package."""
    checkout = Path(__file__).resolve().parents[2] / "data" / SHIPPED
    return checkout if checkout.is_dir() else Path(str(resources.files("jshell") / "examples" / SHIPPED))


def catalog(folder: str | Path | None = None) -> Catalog:
    """What has run in a campaign's folder; in the shipped one unless a folder is named.

    Raises:
        BadFile: No campaign there, or a damaged file.

    Example:
        >>> from jshell import campaigns
        >>> len(campaigns.catalog()) >= 60
        True
    """
    store = RunStore(shipped() if folder is None else Path(folder))
    if not store.design.exists():
        raise BadFile(
            str(store.folder),
            found="no design.toml",
            expected="the folder of a campaign",
            remedy="`jshell campaign run DESIGN.toml --out FOLDER` makes one.",
        )
    design = read_design(store.design)
    planned = design.runs()
    done = {run: families for run, families in planned.items() if store.has(run)}
    return Catalog(
        design.name,
        tuple(store.load(run) for run in done),
        tuple(done.values()),
        tuple(run for run in planned if run not in done),
        store.orphan_files(iter(planned)),
    )


def failures(found: Catalog) -> Catalog:
    """The runs whose outcome is not ok."""
    return found._only(np.array([r.findings.outcome != Outcome.OK.word for r in found], dtype=bool))
