"""Figures: shapes, records, frequencies and fits, in one clean style."""

# pyright: reportUnsupportedDunderAll=false

from typing import Any

from jshell.plot import (
    branches,
    demo,
    film,
    fits,
    frequencies,
    response,
    sensitivity,
    shapes,
    traces,
)  # fmt: skip
from jshell.plot.branches import deflation
from jshell.plot.demo import overview
from jshell.plot.film import animate, filmstrip, moments, snapshot
from jshell.plot.fits import profiles, trace_fit
from jshell.plot.frequencies import master_curve
from jshell.plot.shapes import mode_shape, rest_shape
from jshell.plot.style import new_figure, save, style
from jshell.plot.traces import channel, heard

__all__ = [
    "animate", "branches", "channel", "deflation", "demo", "film", "filmstrip", "fits", "frequencies", "heard",
    "master_curve", "mode_shape", "moments", "new_figure", "overview", "paper", "paper_numbers", "profiles", "response",
    "rest_shape", "save", "sensitivity", "shapes", "snapshot", "style", "trace_fit", "traces",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """The figures of the source, under the names of the release before."""
    found = {"paper": "figures", "paper_numbers": "printed"}.get(name)
    if found is None:
        raise AttributeError(name)
    import importlib
    import warnings

    warnings.warn(f"`jshell.plot.{name}` is `jshell.paper.{found}` now", DeprecationWarning, stacklevel=2)
    return importlib.import_module(f"jshell.paper.{found}")
