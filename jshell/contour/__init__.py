"""The meridian curve: geometry only."""

from jshell.contour.azimuthal import Azimuthal, SplineBasis, azimuthal
from jshell.contour.curve import Curve, Meridian
from jshell.contour.grading import rim_breaks
from jshell.contour.measures import area, clearance, gap, height, poles, speed, volume, width
from jshell.contour.mesh import (
    breakpoints,
    carry,
    halved,
    meridian,
    regrade,
    resampled,
    transfer,
    with_pad,
    with_small_edge,
)
from jshell.contour.seeds import NO_WEAK_SPOT, WeakSpot, compressed_sphere, dimple, dimple_breaks, thinned, wall_profile
from jshell.renamed import renamed

__all__ = [
    "NO_WEAK_SPOT", "Azimuthal", "Curve", "Meridian", "SplineBasis", "WeakSpot", "area", "azimuthal", "breakpoints",
    "carry", "clearance", "compressed_sphere", "dimple", "dimple_breaks", "gap", "halved", "height", "meridian",
    "poles", "regrade", "resampled", "rim_breaks", "speed", "thinned", "transfer", "volume", "wall_profile", "width",
    "with_pad", "with_small_edge",
]  # fmt: skip

__getattr__ = renamed(__name__, {"Family": "SplineBasis"})
