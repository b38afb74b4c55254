"""The folder of a campaign: its design, a file per finished run, and the catalogue.

A file appears whole or not at all, so that a campaign may be killed at any
time: what is there is finished, and everything else is made from it. Files hold
no dates, so that the same run gives the same bytes.

Source     NumPy's .npz without pickles; POSIX rename
"""

import dataclasses
import io
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jshell.campaigns.findings import Findings
from jshell.campaigns.perform import Result, Versions
from jshell.campaigns.planned import Run
from jshell.errors import BadFile
from jshell.io.files import SPOILED

SCHEMA = 1
DESIGN, CATALOGUE, RUNS = "design.toml", "catalog.csv", "runs"
UNFINISHED = ".new"


@dataclass(frozen=True)
class RunStore:
    """A campaign's folder.

    Raises:
        BadFile: It is no folder, or none can be made there.
    """

    folder: Path

    @property
    def design(self) -> Path:
        return self.folder / DESIGN

    @property
    def catalogue(self) -> Path:
        return self.folder / CATALOGUE

    def begin(self) -> None:
        """Make the folder; drop what a killed campaign was writing."""
        try:
            (self.folder / RUNS).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BadFile(
                str(self.folder), found=error.strerror or "an error", expected="a folder", remedy="Name another place."
            ) from None
        for left in (*self.folder.glob(f"*{UNFINISHED}"), *(self.folder / RUNS).glob(f"*{UNFINISHED}")):
            left.unlink()

    def path(self, run: Run) -> Path:
        return self.folder / RUNS / f"{run.key}.npz"

    def has(self, run: Run) -> bool:
        return self.path(run).exists()

    def orphan_files(self, runs: Iterator[Run]) -> int:
        """How many files belong to none of the runs."""
        known = {run.key for run in runs}
        return sum(path.stem not in known for path in (self.folder / RUNS).glob("*.npz"))

    def save(self, result: Result) -> None:
        """Keep a finished run; the file is on the disk, whole, when this returns."""
        facts = {
            "schema": SCHEMA,
            "run": result.run.facts(),
            "findings": result.findings.facts(),
            "versions": dataclasses.asdict(result.versions),
        }
        text = json.dumps(facts, ensure_ascii=False, allow_nan=False, sort_keys=True)
        arrays = {"t": result.times, **result.channels, "facts": np.asarray(text)}
        target = self.path(result.run)
        fresh = target.with_name(target.name + UNFINISHED)
        with fresh.open("wb") as stream:
            np.savez_compressed(stream, allow_pickle=False, **arrays)
            stream.flush()
            os.fsync(stream.fileno())
        fresh.replace(target)

    def load(self, run: Run) -> Result:
        """A finished run.

        Raises:
            BadFile: It is not there, was damaged, is another run, or was written by a later jshell.
        """
        path = self.path(run)
        try:
            with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
            facts = json.loads(str(arrays.pop("facts")))
            times = arrays.pop("t")
            found: dict[str, Any] = facts["findings"]
            found = {name: tuple(value) if isinstance(value, list) else value for name, value in found.items()}
            if facts["schema"] != SCHEMA:
                raise ValueError(f"schema {facts['schema']}")
            if Run(**facts["run"]) != run:
                raise ValueError("another run")
            return Result(run, Findings(**found), Versions(**facts["versions"]), times, arrays)
        except SPOILED as fault:
            raise BadFile(
                str(path),
                found=f"no readable run ({fault})",
                expected=f"a run of a campaign, schema {SCHEMA}",
                remedy="Delete the file and run the campaign again.",
            ) from None

    def write(self, path: Path, text: str) -> None:
        """Replace a text file in one step."""
        fresh = path.with_name(path.name + UNFINISHED)
        fresh.write_text(text, encoding="utf-8")
        fresh.replace(path)
