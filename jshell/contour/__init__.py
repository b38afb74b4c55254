"""The meridian curve: geometry only."""

from jshell.contour.curve import Curve, Meridian, meridian
from jshell.contour.measures import area, gap, height, poles, speed, volume, width
from jshell.contour.seeds import NO_WEAK_SPOT, WeakSpot, compressed_sphere, dimple, wall_profile

__all__ = [
    "NO_WEAK_SPOT", "Curve", "Meridian", "WeakSpot", "area", "compressed_sphere", "dimple", "gap", "height",
    "meridian", "poles", "speed", "volume", "wall_profile", "width",
]  # fmt: skip
