"""What a measurement is: times, named channels, and the conditions they were taken under.

The simulator and the oscillator return one, the extraction of modes and the fits take
one, files hold one. Inside, all numbers are dimensionless; `scales` says what
the units were when the trace came from a laboratory.
"""

import math
import os
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import numpy as np

from jshell.display import TIME, ended, number, readable, shown
from jshell.errors import BadName, BadShape, BadValue, Outcome, choose, require_extra
from jshell.quantities import QUANTITIES
from jshell.shell.parameters import Reduced, Scales

if TYPE_CHECKING:
    import xarray

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

    Raises:
        BadShape: A channel that has not one value per time.
        BadValue: Times, a channel or errors that are no real numbers.
    """

    times: Values
    channels: dict[str, Values]
    conditions: Reduced | None = None
    sigma: dict[str, Values] = eqx.field(default_factory=dict)
    outcome: Values | int = int(Outcome.OK)
    settings: tuple[tuple[str, str], ...] = eqx.field(default=(), static=True)
    scales: Scales | None = eqx.field(default=None, static=True)

    def __check_init__(self) -> None:
        sigmas = {f"sigma[{name!r}]": values for name, values in self.sigma.items()}
        columns = {f"channel {name!r}": values for name, values in self.channels.items()}
        for place, values in ({"times": self.times} | columns | sigmas).items():
            # of complex numbers a fit would read the real part, of texts and objects now this and now that
            if (kind := getattr(values, "dtype", np.dtype(float))).kind not in "iufb":
                raise BadValue(
                    place, found=f"values of type {kind}", expected="real numbers",
                    remedy="Give np.asarray(values, dtype=float), or the real part of complex ones.",
                )  # fmt: skip
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

    @readable
    def __repr__(self) -> str:
        shape = tuple(getattr(self.times, "shape", ()))
        size = f"{shape[0]} samples" if len(shape) == 1 else f"times of shape {shape}"
        unit = "s" if self.scales is not None and self.conditions is None else TIME
        span = f"t {number(self.times[0])} … {number(self.times[-1])} [{unit}]" if len(shape) == 1 and shape[0] else ""
        return shown(
            self,
            size,
            span,
            "channels " + " ".join(self.channels),
            "sigma of " + " ".join(self.sigma) if self.sigma else "",
            "" if self.conditions is None else f"conditions {self.conditions!r}",
            ended(self.outcome),
        )

    def __getitem__(self, name: str) -> Values:
        return self.channels[choose("channel", name, self.channels, remedy="Choose a channel that the trace has.")]

    @property
    def attached(self) -> float:
        """Half-angle of the pad that held the shell [rad], from the settings; 0 is a free shell, or none is told.

        Raises:
            BadValue: The setting is no angle.

        Example:
            >>> import numpy as np
            >>> from jshell import Trace
            >>> Trace(np.arange(3.0), {"H": np.ones(3)}, settings=(("attached", "0.33"),)).attached
            0.33
        """
        text = dict(self.settings).get("attached", "0")
        try:
            angle = float(text)
        except ValueError:
            angle = math.nan
        if not 0 <= angle <= math.pi:
            raise BadValue(
                "attached",
                found=repr(text),
                expected="the half-angle of the pad [rad], 0 for a free shell",
                remedy="Write `# attached: 0.33`.",
            )
        return angle

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

    def to_xarray(self) -> "xarray.Dataset":
        """The trace as an xarray Dataset, dimensionless as it is here.

        Returns:
            Channels, and `sigma_…` beside them, along `t`; in a batch along `case` and `sample`, with `t` a
            coordinate. Conditions, outcome and settings are attributes; what differs between the cases of a
            batch is a coordinate along `case`. `Dataset.to_netcdf(…, engine="h5netcdf")` makes of one trace a
            file that `jshell.io.read_trace` reads.

        Raises:
            BadName: A channel called `t`, or in a batch like another coordinate.
            BadShape: A batch of more than one level.
            MissingExtra: xarray is not installed.

        Example:
            >>> import numpy as np
            >>> from jshell import Trace
            >>> float(Trace(np.arange(3.0), {"V": np.array([3.0, 3.1, 3.2])}).to_xarray()["V"].sel(t=1.0))
            3.1
        """
        xarray = require_extra("xarray", "io", "Trace.to_xarray")
        times = np.asarray(self.times)
        if times.ndim not in (1, 2):
            raise BadShape(
                "trace",
                found=f"times of shape {times.shape}",
                expected="(times,) or (cases, times)",
                remedy="Take one level of the batch at a time.",
            )
        dims = ("t",) if times.ndim == 1 else ("case", "sample")
        named = {**self.channels, **{f"sigma_{name}": values for name, values in self.sigma.items()}}
        channels = {name: (dims, np.asarray(values), _described(name)) for name, values in named.items()}
        coords: dict[str, Any] = {"t": (dims, times, _described("t"))}
        attributes: dict[str, Any] = {}
        for key, value in self._facts().items():
            if np.ndim(value) == 0:
                attributes[key] = value
            else:
                coords[key] = (("case",), np.asarray(value))
        taken = {*dims, *coords}
        for name in named:
            if name in taken:
                raise BadName(
                    f"channel {name!r}",
                    found="the name of a dimension or coordinate of the Dataset",
                    expected="a name other than " + ", ".join(sorted(taken)),
                    remedy="Rename the channel.",
                )
        if self.settings:
            attributes["settings"] = "\n".join(f"{key}: {value}" for key, value in self.settings)
        return xarray.Dataset(channels, coords, attributes)

    @staticmethod
    def from_pandas(
        frame: Any, *, conditions: Reduced | None = None, scales: Scales | None = None, **said: Any
    ) -> "Trace":
        """The trace that a DataFrame holds, by the rules of files.

        Args:
            frame: Columns of numbers; the time is a column, or the index where that has a name, dates or spans of time.
                Units stand behind the names, `H [mm]`, in `frame.attrs["units"]`, or are said.
            conditions: The problem, where known.
            scales: SI values of its units, as of `jshell.shell.scales`; columns with units need them.
            **said: What the table leaves open, as of `jshell.io.read_trace`: `columns`, `units`, `rate`, …

        Raises:
            JshellError: As `jshell.io.read_trace`.

        Warns:
            GuessWarning: What the table leaves open, and what it was taken for.

        Example:
            >>> import pandas, jshell as js
            >>> frame = pandas.DataFrame({"t [ms]": [0.0, 1.0, 2.0], "CH1 [V]": [0.1, 0.3, 0.2]})
            >>> js.Trace.from_pandas(frame).times
            array([0.   , 0.001, 0.002])
        """
        from jshell.io.frames import from_pandas  # the rules of files live above; the door is here

        return from_pandas(frame, conditions, scales, said)

    @staticmethod
    def from_xarray(
        data: Any, *, conditions: Reduced | None = None, scales: Scales | None = None, **said: Any
    ) -> "Trace":
        """The trace that an xarray Dataset holds, by the rules of files; what `to_xarray` made comes back.

        Args:
            data: Variables along one dimension, with `units` among their attributes.
            conditions: The problem; by default that of the attributes, where they have one.
            scales: SI values of its units; variables with units need them.
            **said: As of `from_pandas`.

        Raises:
            BadShape: A variable of several dimensions.
            JshellError: As `jshell.io.read_trace`.

        Warns:
            GuessWarning: What the Dataset leaves open, and what it was taken for.
        """
        from jshell.io.frames import from_xarray  # the rules of files live above; the door is here

        return from_xarray(data, conditions, scales, said)

    def _facts(self) -> dict[str, Any]:
        """Conditions and outcome by the keys that files have for them; arrays where a batch differs."""
        facts: dict[str, Any] = {}
        if self.conditions is not None:
            for key, value in self.conditions.as_dict().items():
                number = np.asarray(value, dtype=float)
                facts[key] = float(number) if number.ndim == 0 else number
        words = np.vectorize(lambda code: Outcome(int(code)).word, otypes=[str])(np.asarray(self.outcome))
        facts["outcome"] = str(words) if words.ndim == 0 else words
        return facts


def traces_of(given: Any) -> list[Trace]:
    """One trace, or several, as a list.

    Raises:
        BadValue: None, or something that is no trace, such as the path of a file.
    """
    path = str | os.PathLike
    listed: list[Any] = list(given) if isinstance(given, Iterable) and not isinstance(given, Trace | path) else [given]
    for place, one in enumerate(listed, 1):
        if not isinstance(one, Trace):
            named = isinstance(one, path)
            raise BadValue(
                f"trace {place}",
                found=f"the path {str(one)!r}" if named else f"{type(one).__name__}",
                expected="a Trace",
                remedy=f"Read it: jshell.io.read_trace({str(one)!r})."
                if named
                else "Build one: jshell.Trace(t, {'V': V}).",
            )
    if not listed:
        raise BadValue("traces", found="none", expected="at least one trace", remedy="Give a trace.")
    return listed


def _described(name: str) -> dict[str, str]:
    """What a reader of a Dataset sees of a column: words, symbol and scale of the registry."""
    row = QUANTITIES.get(name.removeprefix("sigma_"))
    if row is None:
        return {"units": "1"}
    words = row.words if row.key == name else f"standard error of the {row.words}"
    return {"units": "1", "long_name": words, "symbol": row.symbol, "scale": row.scale}
