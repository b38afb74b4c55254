"""Simulations that are done: in memory, and in files that appear whole, so that a search may be killed at any time.

A search is a function of its simulations and nothing else. Repeated with those that are kept it takes the same steps
to the same answer, and only what was not done yet is simulated; several searches may share one folder.

Source     as `jshell.campaigns.store`: NumPy's .npz without pickles, POSIX rename
"""

import io
import os
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jshell.dynamics.checkpoint import fingerprint
from jshell.errors import BadFile

Arrays = Mapping[str, np.ndarray]
SPOILED = (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile)


class Kept:
    """The simulations of one problem.

    Args:
        folder: Where they are kept, or None.
        made_of: Everything that the problem consists of, arrays, numbers and names; each problem has files of its own.

    Raises:
        BadFile: No folder can be made there.
    """

    def __init__(self, folder: Path | str | None, made_of: Any) -> None:
        self._known: dict[str, Arrays] = {}
        self.folder = None if folder is None else Path(folder) / fingerprint(made_of)[:16]
        if self.folder is not None:
            try:
                self.folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise BadFile(
                    str(folder), found=error.strerror or "an error", expected="a folder", remedy="Name another place."
                ) from None

    def __call__(self, what: Any, compute: Callable[[], Arrays]) -> Arrays:
        """What was computed under a name of arrays and numbers, computed now where it was not."""
        key = fingerprint(what)[:32]
        if key not in self._known:
            self._known[key] = self._stored(key) or self._written(key, compute())
        return self._known[key]

    def _stored(self, key: str) -> Arrays | None:
        if self.folder is None or not (path := self.folder / f"{key}.npz").exists():
            return None
        try:
            with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as stored:
                return {name: stored[name] for name in stored.files}
        except SPOILED:
            return None  # a disk's fault: it is simulated again

    def _written(self, key: str, arrays: Arrays) -> Arrays:
        if self.folder is not None:
            fresh = self.folder / f"{key}.{os.getpid()}.new"
            with fresh.open("wb") as stream:
                np.savez(stream, allow_pickle=False, **arrays)
                stream.flush()
                os.fsync(stream.fileno())
            fresh.replace(self.folder / f"{key}.npz")
        return arrays
