"""What was asked of a fit, in plain values: enough to ask it again."""

import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib import metadata

from jshell.calibration.parameters import Prior


@dataclass(frozen=True)
class Specification:
    """The options of a fit; those of `fit_trajectories`, or of `fit_frequencies` where `kind` says so.

    Attributes:
        kind: `trajectories` or `frequencies`.
        tie: Arithmetic, or the name of the function that was given.
        Others: As the arguments of the two doors.
    """

    kind: str
    loss: str | None = None
    weighting: str | None = None
    solver: str = "exact"
    equilibrium: str = "plateau"
    fix: Mapping[str, float] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    tie: Mapping[str, str] = field(default_factory=dict)
    local: tuple[str, ...] = ()
    uncertain: Mapping[str, float | None] = field(default_factory=dict)
    priors: Mapping[str, Prior] = field(default_factory=dict)
    robust: str | None = None
    noise: str = "auto"
    channels: tuple[str, ...] | None = None
    start: float | None = None
    stop: float | None = None
    drop: tuple[tuple[float, float], ...] = ()
    missing: str = "refuse"
    beta2: str = "equal_decay"
    dipole: str = "corrected"
    starts: int = 3
    seed: int = 0

    def record(self) -> dict:
        """As a JSON object."""
        return asdict(self)

    @staticmethod
    def from_record(found: Mapping) -> "Specification":
        """Back from a JSON object."""
        pairs = {key: tuple(value) for key, value in found["bounds"].items()}
        given = dict(found) | {
            "bounds": pairs,
            "local": tuple(found["local"]),
            "priors": {key: Prior(**value) for key, value in found["priors"].items()},
            "channels": None if found["channels"] is None else tuple(found["channels"]),
            "drop": tuple(tuple(span) for span in found["drop"]),
        }
        return Specification(**given)


def tie_in_words(tie: Mapping | None) -> dict[str, str]:
    """Ties as text: arithmetic as it is, a function by its name."""
    return {
        name: given if isinstance(given, str) else f"function {getattr(given, '__name__', type(given).__name__)}"
        for name, given in (tie or {}).items()
    }


def versions() -> tuple[tuple[str, str], ...]:
    """Of jshell, of Python and of what the numbers of a fit come from."""
    import jshell

    others = tuple((name, metadata.version(name)) for name in ("jax", "numpy", "scipy"))
    return (("jshell", jshell.__version__), ("python", platform.python_version()), *others)
