"""A service that is told to stop while its libraries are still being imported: it ends at once, and ends well."""

import os
import signal
import sys

if sys.argv[1:2] == ["serve"]:
    signal.signal(signal.SIGTERM, lambda *_: os._exit(0))
