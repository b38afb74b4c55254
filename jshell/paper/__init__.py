"""The source, made again: its figures from our own simulations, its printed numbers, its joint fits."""

from jshell.paper import damping, figures, frequencies, joint_fits, printed, records, shapes, softening, trends

__all__ = [
    "damping", "figures", "frequencies", "joint_fits", "printed", "records", "shapes", "softening", "trends",
]  # fmt: skip
