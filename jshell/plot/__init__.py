"""Figures: shapes, records, frequencies and fits, in one clean style."""

# pyright: reportUnsupportedDunderAll=false

from jshell.plot import (
    branches,
    demo,
    film,
    fits,
    frequencies,
    response,
    sensitivity,
    shapes,
    space,
    traces,
)  # fmt: skip
from jshell.plot.branches import deflation, symmetry_map
from jshell.plot.demo import overview
from jshell.plot.film import animate, filmstrip, moments, snapshot
from jshell.plot.fits import profiles, trace_fit
from jshell.plot.frequencies import master_curve
from jshell.plot.inversions import inversion
from jshell.plot.recordings import outlines
from jshell.plot.shapes import mode_shape, rest_shape
from jshell.plot.space import in_space, rotating
from jshell.plot.style import new_figure, save, style, use_style
from jshell.plot.traces import channel, identified_modes
from jshell.renamed import renamed

__all__ = [
    "animate", "branches", "channel", "deflation", "demo", "film", "filmstrip", "fits", "frequencies",
    "identified_modes", "in_space", "inversion", "master_curve", "mode_shape", "moments", "new_figure", "outlines",
    "overview", "profiles", "response", "rest_shape", "rotating", "save", "sensitivity", "shapes", "snapshot", "space",
    "style", "symmetry_map", "trace_fit", "traces", "use_style",
]  # fmt: skip
__getattr__ = renamed(
    __name__,
    {"heard": "identified_modes", "paper": "jshell.paper:figures", "paper_numbers": "jshell.paper:printed"},
)
