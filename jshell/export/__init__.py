"""The buckled shell's law for codes that know one radius: a table of pressure, mass and damping, and their input."""

from jshell.export.bubbles import write_apecss, write_jbubble
from jshell.export.law import LawBranch, RadialLaw, radial_law
from jshell.export.motion import RadialMotion, run
from jshell.export.tables import read_law, write_law
from jshell.renamed import renamed

__all__ = [
    "LawBranch", "RadialLaw", "RadialMotion", "radial_law", "read_law", "run", "write_apecss", "write_jbubble",
    "write_law",
]  # fmt: skip

__getattr__ = renamed(__name__, {"Branch": "LawBranch", "Run": "RadialMotion"})
