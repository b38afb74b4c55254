"""Figures: shapes, records, frequencies and fits, in one clean style."""

from jshell.plot import demo, fits, frequencies, shapes, traces
from jshell.plot.demo import overview
from jshell.plot.fits import trace_fit
from jshell.plot.frequencies import master_curve
from jshell.plot.shapes import mode_shape, rest_shape
from jshell.plot.style import new_figure, save, style
from jshell.plot.traces import channel, heard

__all__ = [
    "channel", "demo", "fits", "frequencies", "heard", "master_curve", "mode_shape", "new_figure", "overview",
    "rest_shape", "save", "shapes", "style", "trace_fit", "traces",
]  # fmt: skip
