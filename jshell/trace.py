"""What a measurement is: times, named channels, and the conditions they were taken under.

The simulator and the oscillator return one, the listener and the fits take
one, files hold one. Inside, all numbers are dimensionless; `scales` says what
the units were when the trace came from a laboratory.
"""

import equinox as eqx
import jax
import numpy as np

from jshell.errors import BadName, BadShape, Outcome
from jshell.shell.parameters import Reduced, Scales

Values = jax.Array | np.ndarray


class Trace(eqx.Module):
    """A record in time.

    Args:
        times: (times,) increasing [sqrt(ρ_f R0³/(E d))], or seconds where `scales` and conditions are absent.
        channels: Name to (times,) values; names of the registry (`V`, `S`, `H`, `W`, …) or the user's own.
        conditions: The problem, where known.
        sigma: Name to absolute standard error per sample, where known.
        outcome: How the run that made it ended; an integer of `Outcome`.
        settings: What else a reader needs to make it again, as text pairs.
        scales: SI values of the units, where the record came from a laboratory.
    """

    times: Values
    channels: dict[str, Values]
    conditions: Reduced | None = None
    sigma: dict[str, Values] = eqx.field(default_factory=dict)
    outcome: Values | int = int(Outcome.OK)
    settings: tuple[tuple[str, str], ...] = eqx.field(default=(), static=True)
    scales: Scales | None = eqx.field(default=None, static=True)

    def __check_init__(self) -> None:
        shape = getattr(self.times, "shape", None)
        for name, values in self.channels.items():
            found = getattr(values, "shape", None)
            if found is not None and shape is not None and found != shape:
                raise BadShape(
                    f"channel {name!r}",
                    found=f"shape {found}",
                    expected=f"shape {shape}, one value per time",
                    remedy="Cut or resample the channel.",
                )

    def __getitem__(self, name: str) -> Values:
        if name not in self.channels:
            raise BadName(
                f"channel {name!r}",
                found="no such channel",
                expected="one of " + ", ".join(self.channels),
                remedy="Choose a channel that the trace has.",
            )
        return self.channels[name]

    def between(self, start: float | int | None, stop: float | int | None) -> "Trace":
        """The part of the trace with start <= t <= stop, in the trace's own time unit."""
        times = np.asarray(self.times)
        low = -np.inf if start is None else start
        high = np.inf if stop is None else stop
        keep = (times >= low) & (times <= high)
        pick = lambda values: np.asarray(values)[..., keep]  # noqa: E731
        return Trace(
            pick(times),
            {name: pick(values) for name, values in self.channels.items()},
            self.conditions,
            {name: pick(values) for name, values in self.sigma.items()},
            self.outcome,
            self.settings,
            self.scales,
        )
