"""A service that is told to stop while its libraries are still being imported: it ends at once, and ends well.

The package's own first line imports this, before anything that takes time, and `jshell serve` or `python -m jshell
serve` is told from what Python was called with: no other program of that argument, and no process of the service's
own, is touched. Before that line lies what Python itself needs to begin, between 0.05 and 0.15 s on a busy machine with
two cores. A signal in it ends the process as the system does, with 143: nobody can listen before he is there.
"""

import os
import signal
import sys
from types import FrameType

SIGNALS = (signal.SIGTERM, signal.SIGINT)


def end_well() -> None:
    """Take a signal to stop as what it is, from now on; the server takes it over once it has begun."""
    if serves(sys.orig_argv, len(sys.argv)):
        for number in SIGNALS:
            signal.signal(number, _end)


def serves(called: list[str], words: int) -> bool:
    """Whether Python was called to serve.

    Args:
        called: All that it was called with.
        words: How many of these, the last ones, belong to the program: its name and its arguments.
    """
    name, *arguments = called[-words:] or [""]
    return os.path.splitext(os.path.basename(name))[0] == "jshell" and arguments[:1] == ["serve"]


def _end(number: int, frame: FrameType | None) -> None:
    os._exit(0)  # nothing was accepted yet


end_well()
