"""What shell is this? The simulator fitted to recordings."""

from jshell.inversion.fit import invert
from jshell.inversion.result import Inversion
from jshell.inversion.snap import Snap
from jshell.inversion.unknowns import Unknown

__all__ = ["Inversion", "Snap", "Unknown", "invert"]
