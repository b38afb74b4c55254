"""An engine by its name."""

import os
import re
from concurrent.futures import Executor

from jshell.engines.cluster import Cluster
from jshell.engines.inline import Inline
from jshell.engines.processes import Processes
from jshell.errors import BadName


def open(name: str = "inline") -> Executor:
    """Where work runs, as a standard `Executor` and context manager.

    Args:
        name: `inline` for this process; `processes` for one spawned process per available core, `processes:N` for N;
            `tcp://host:port` for an existing Dask cluster (extra `distributed`).

    Returns:
        The engine. Functions and arguments given to it must be importable and picklable. A task whose process or
        worker died ends with `jshell.errors.WorkerLost`; the others go on.

    Raises:
        BadName: No such engine.
        BadValue: Fewer than one process, or no scheduler at the address.
        MissingExtra: A cluster without the extra `distributed`.

    Example:
        >>> from jshell import engines
        >>> with engines.open("inline") as engine:
        ...     list(engine.map(abs, [-1, 2]))
        [1, 2]
    """
    if name == "inline":
        return Inline()
    if name.startswith("tcp://") or name.startswith("tls://"):
        return Cluster(name)
    found = re.fullmatch(r"processes(?::(\d+))?", name)
    if found is None:
        raise BadName(
            f"engine {name!r}",
            found="no such engine",
            expected="inline, processes, processes:N or tcp://host:port",
            remedy="Use processes:2 for two processes.",
        )
    return Processes(int(found[1]) if found[1] else _cores())


def _cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
