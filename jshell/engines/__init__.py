"""Where work runs: this process, a pool of processes, or an existing cluster, behind the standard `Executor`."""

from jshell.engines.choice import open
from jshell.engines.cluster import Cluster
from jshell.engines.inline import Inline
from jshell.engines.processes import Processes

__all__ = ["Cluster", "Inline", "Processes", "open"]
