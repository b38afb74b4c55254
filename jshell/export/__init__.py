"""The buckled shell's law for codes that know one radius: a table of pressure, mass and damping, and their input."""

from jshell.export.bubbles import write_apecss, write_jbubble
from jshell.export.law import Branch, RadialLaw, radial_law
from jshell.export.motion import Run, run
from jshell.export.tables import read_law, write_law

__all__ = ["Branch", "RadialLaw", "Run", "radial_law", "read_law", "run", "write_apecss", "write_jbubble", "write_law"]
