"""The kinds of jobs: known to the server and to its client, which needs no server."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class JobType:
    """What differs between the kinds of jobs, beside what they compute.

    Attributes:
        plural: As addresses name them.
        words: A job of this kind, in a sentence.
        files: Suffix of a result to its name in the store; table and report of a batch are made of its record.
    """

    plural: str
    words: str
    files: Mapping[str, str]


KINDS = {
    "fit": JobType("fits", "fit", {"json": "record.json", "csv": "table.csv", "nc": "record.nc", "txt": "report.txt"}),
    "batch": JobType("batches", "batch", {"npz": "record.npz", "csv": "table.csv", "txt": "report.txt"}),
    "simulate": JobType("simulations", "simulation", {"json": "trace.json", "csv": "trace.csv", "nc": "trace.nc"}),
    "modes": JobType("modes", "job for modes", {"json": "modes.json", "csv": "modes.csv"}),
    "look": JobType("looks", "look at a film", {"json": "look.json", "png": "frame.png"}),
    "film": JobType(
        "films", "film", {"json": "film.json", "csv": "trace.csv", "nc": "outlines.nc", "png": "overlay.png"}
    ),
    "invert": JobType("inversions", "inversion", {"json": "inversion.json", "csv": "table.csv", "txt": "report.txt"}),
}
PLURAL = {kind: one.plural for kind, one in KINDS.items()}
