"""What the pressure far away does, for both models: steps, ramps, tones, bursts, records.

A pressure is a function of time. The simulator takes the outer pressure itself,
the short model what is *added* to the steady outer pressure of the conditions;
a tone or a burst may be added in both. Any callable will do; those here know
their convention and can be made from kilopascals and megahertz.

Symbols    p pressure [E d/R0]   t time [sqrt(ρ_f R0³/(E d))]   ω angular frequency [1/time]
Valid for  a shell small against the wavelength: the pressure is the same all around it
Source     peak negative pressure and number of cycles as in diagnostic ultrasound; a slow ramp from P0, then hold:
           Mokbel et al. 2021, numerical method
"""

import warnings
from collections.abc import Callable
from functools import lru_cache
from typing import Any, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from jshell.errors import BadShape, BadValue, choose
from jshell.renamed import renamed_arguments, renamed_attribute
from jshell.shell.parameters import Number, Scales, check

Pressure: TypeAlias = Callable[[Any], jax.Array]
Moment: TypeAlias = Number | int
WINDOWS = ("hann", "flat")


class Zero(eqx.Module):
    """Nothing added: the outer pressure stays what the conditions say."""

    def __call__(self, t: Moment) -> jax.Array:
        return jnp.zeros_like(jnp.asarray(t, dtype=float))


class Hold(eqx.Module):
    """A constant pressure [E d/R0]."""

    pressure: Number

    def __call__(self, t: Moment) -> jax.Array:
        return jnp.asarray(self.pressure + 0.0 * t)


class Step(eqx.Module):
    """Pressure added at once, at `start`."""

    amplitude: Number
    start: Number = 0.0

    def __call__(self, t: Moment) -> jax.Array:
        return jnp.asarray(self.amplitude * jnp.asarray(t >= self.start))


class Ramp(eqx.Module):
    """A straight ramp from one pressure to another, then hold; a sudden step where the duration is zero.

    By keyword only: the two models once gave their arguments different orders.

    Args:
        stop: Pressure after it [E d/R0].
        start: Pressure before it; nothing added.
        duration: Time it takes [time unit].
        begin: When it begins [time unit].

    Raises:
        BadValue: A duration below 0, or arguments without names.

    Example:
        >>> from jshell.pressure import Ramp
        >>> ramp = Ramp(start=0.9, stop=1.6, duration=25.0)
        >>> print(f"{float(ramp(12.5)):.2f}")
        1.25
    """

    start: Number
    stop: Number
    duration: Number
    begin: Number

    def __init__(
        self,
        *positional: Number | int,
        stop: Number | None = None,
        start: Number = 0.0,
        duration: Number = 25.0,
        begin: Number = 0.0,
        amplitude: Number | None = None,
    ) -> None:
        if positional:
            raise BadValue(
                "Ramp",
                found=f"{len(positional)} arguments without names",
                expected="Ramp(start=…, stop=…, duration=…, begin=…)",
                remedy="The simulator's Ramp(a, b, c) is start, stop, duration; the short model's is stop, duration, "
                "begin.",
            )
        if amplitude is not None:
            warnings.warn("Ramp(amplitude=, start=) is now Ramp(stop=, begin=)", DeprecationWarning, stacklevel=2)
            stop, start, begin = amplitude, 0.0, start
        if stop is None:
            raise BadValue("Ramp", found="no stop", expected="a pressure to end at", remedy="Give stop=….")
        check("duration", duration, "a time of at least 0", lambda x: x >= 0)
        self.start, self.stop, self.duration, self.begin = start, stop, duration, begin

    def __call__(self, t: Moment) -> jax.Array:
        lasts = jnp.asarray(self.duration) > 0
        safe = jnp.where(lasts, self.duration, 1.0)
        if isinstance(self.begin, float) and self.begin == 0:  # from the start on: a program without the comparison
            done = jnp.where(lasts, jnp.clip(t / safe, 0.0, 1.0), 1.0)
        else:
            done = jnp.where(lasts, jnp.clip((t - self.begin) / safe, 0.0, 1.0), jnp.where(t >= self.begin, 1.0, 0.0))
        return jnp.asarray(self.start + (self.stop - self.start) * done)


class Tone(eqx.Module):
    """p = amplitude · sin(ω t + phase), for ever; over `rise` periods it grows from nothing, smoothly."""

    amplitude: Number
    angular_frequency: Number
    phase: Number = 0.0
    rise: Number = 0.0

    pulsation = renamed_attribute("pulsation", "angular_frequency")

    def __check_init__(self) -> None:
        check("angular_frequency", self.angular_frequency, "a number above 0", lambda x: x > 0)
        check("rise", self.rise, "a number of periods, 0 or more", lambda x: x >= 0)

    def __call__(self, t: Moment) -> jax.Array:
        wave = jnp.sin(self.angular_frequency * t + self.phase)
        periods = self.angular_frequency * t / (2 * jnp.pi)
        risen = jnp.clip(periods / jnp.where(jnp.asarray(self.rise) > 0, self.rise, 1.0), 0.0, 1.0)
        swell = jnp.where(jnp.asarray(self.rise) > 0, jnp.sin(jnp.pi / 2 * risen) ** 2, 1.0)
        return jnp.asarray(self.amplitude * wave * swell)

    @staticmethod
    def from_si(amplitude: float, frequency: float, unit: Scales) -> "Tone":
        """A tone of an amplitude [Pa] and a frequency [Hz]."""
        return Tone(amplitude / unit.pressure, 2 * np.pi * frequency * unit.time)


Tone.__init__ = renamed_arguments(pulsation="angular_frequency")(Tone.__init__)


class RaisedCosine(eqx.Module):
    """A raised cosine: from `low` to `high` and back once a period."""

    low: Number
    high: Number
    period: Number

    def __check_init__(self) -> None:
        check("period", self.period, "a time above 0", lambda x: x > 0)

    def __call__(self, t: Moment) -> jax.Array:
        risen = jnp.sin(jnp.pi * t / self.period) ** 2
        return jnp.asarray(self.low + (self.high - self.low) * risen)


class Pulse(eqx.Module):
    """A burst of a whole number of cycles, named by its peak negative pressure.

    It begins with the rarefaction, p = -A w(t) sin(ω t); A is such that the
    lowest pressure is -`peak_negative` exactly, window included.

    Args:
        peak_negative: Size of the lowest pressure, a positive number [E d/R0].
        angular_frequency: Of the carrier [1/time].
        cycles: How many.
        start: When it begins.
        window: `hann`, or `flat` (a plain burst).

    Example:
        >>> import numpy as np
        >>> from jshell.pressure import Pulse
        >>> pulse = Pulse(0.3, 2.0, 4)
        >>> print(f"{float(np.min(pulse(np.linspace(0, 13, 20001)))):.6f}")
        -0.300000
    """

    peak_negative: Number
    angular_frequency: Number
    cycles: int = eqx.field(static=True, default=3)
    start: Number = 0.0
    window: str = eqx.field(static=True, default="hann")

    pulsation = renamed_attribute("pulsation", "angular_frequency")

    def __check_init__(self) -> None:
        choose("window", self.window, WINDOWS)
        check("angular_frequency", self.angular_frequency, "a number above 0", lambda x: x > 0)
        check("peak_negative", self.peak_negative, "a size, 0 or more", lambda x: x >= 0)
        if self.cycles < 1:
            raise BadValue("cycles", found=f"{self.cycles}", expected="1 or more", remedy="Count whole cycles.")

    def __call__(self, t: Moment) -> jax.Array:
        phase = jnp.asarray(self.angular_frequency * (t - self.start) / (2 * jnp.pi))  # in cycles
        inside = (phase > 0) & (phase < self.cycles)
        shape = jnp.sin(2 * jnp.pi * phase)
        if self.window == "hann":
            shape = shape * jnp.sin(jnp.pi * phase / self.cycles) ** 2
        return jnp.asarray(-self.peak_negative / _crest(self.cycles, self.window) * jnp.where(inside, shape, 0.0))

    @property
    def duration(self) -> Number:
        """How long it lasts."""
        return 2 * np.pi * self.cycles / self.angular_frequency

    @staticmethod
    def from_si(
        peak_negative: float, frequency: float, cycles: int, unit: Scales, *, start: float = 0.0, window: str = "hann"
    ) -> "Pulse":
        """A pulse of a peak negative pressure [Pa], a centre frequency [Hz] and cycles, beginning at a time [s]."""
        angular_frequency = 2 * np.pi * frequency * unit.time
        return Pulse(peak_negative / unit.pressure, angular_frequency, cycles, start / unit.time, window)


Pulse.__init__ = renamed_arguments(pulsation="angular_frequency")(Pulse.__init__)


@lru_cache(maxsize=64)
def _crest(cycles: int, window: str) -> float:
    """Highest value of the unit pulse's shape, to rounding: the highest sample, refined by a parabola."""
    phase = np.linspace(0.0, cycles, 20000 * cycles + 1)
    shape = np.sin(2 * np.pi * phase) * (np.sin(np.pi * phase / cycles) ** 2 if window == "hann" else 1.0)
    k = int(np.argmax(shape))
    left, top, right = shape[k - 1 : k + 2]
    bend = left - 2 * top + right
    return float(top - (right - left) ** 2 / (8 * bend)) if bend < 0 else float(top)


class Recorded(eqx.Module):
    """A pressure given at times, straight lines between; before and after it holds its end values.

    Args:
        times: (samples,) increasing.
        values: (samples,) pressure [E d/R0].

    Raises:
        BadShape, BadValue: Lengths that differ, times that do not increase, numbers that are not finite.
    """

    times: jax.Array | np.ndarray
    values: jax.Array | np.ndarray

    def __check_init__(self) -> None:
        shapes = np.shape(self.times), np.shape(self.values)
        if shapes[0] != shapes[1] or len(shapes[0]) != 1 or shapes[0][0] < 1:
            raise BadShape(
                "pressure",
                found=f"times {shapes[0]}, values {shapes[1]}",
                expected="two lists of one length",
                remedy="Give one pressure per time.",
            )
        check("pressure", self.values, "finite pressures", lambda x: np.isfinite(x))
        if not isinstance(self.times, Tracer) and not np.all(np.diff(np.asarray(self.times)) > 0):
            raise BadValue(
                "pressure",
                found="times that do not increase",
                expected="increasing times",
                remedy="Sort the record and drop its gaps.",
            )

    def __call__(self, t: Moment) -> jax.Array:
        return jnp.interp(t, jnp.asarray(self.times), jnp.asarray(self.values))


class Sum(eqx.Module):
    """Several pressures at once; a tone upon a ramp, say."""

    parts: tuple[Pressure, ...]

    def __call__(self, t: Moment) -> jax.Array:
        total = self.parts[0](t)
        for part in self.parts[1:]:
            total = total + part(t)
        return jnp.asarray(total)


def forced(steady: Pressure, forcing: Pressure) -> Sum:
    """A steady pressure and what is added to it; the former class `Forced` of `jshell.dynamics`."""
    return Sum((steady, forcing))
