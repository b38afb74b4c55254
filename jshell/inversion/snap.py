"""A record through the snap: how the pressure went, and what a whole simulation leaves of the record.

The simulation begins with the stress-free sphere, as the shell did. Its samples lie on a grid of its own time; a
cubic through them is read where the record has samples, so that the curve is a smooth function of all numbers, the
unit of time with them, and its derivative exact.

Symbols    T, L, Π units of time, length, pressure   p outer pressure   u what the solver sees of the unknowns
Valid for  axial symmetry; η̂ < 0.03
Source     `jshell.inversion.motion`
"""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from scipy.interpolate import CubicSpline

from jshell.calibration.noise import whiten
from jshell.contour import WeakSpot
from jshell.dynamics import Losses, simulate
from jshell.errors import BadValue, Outcome
from jshell.inversion import motion
from jshell.inversion.kept import Arrays, Kept
from jshell.inversion.model import Model, Weighing
from jshell.inversion.projection import Projection
from jshell.inversion.recording import POWER, Recording
from jshell.inversion.response import FIELDS, PAD_FIELD, SPOT_FIELD, SPOT_WIDTH, Standing, loss_of
from jshell.inversion.unknowns import Seen, plain
from jshell.pressure import Ramp, Recorded
from jshell.shell.parameters import Reduced

FINER = 4 / 3  # elements of the mesh that the answer is corrected to, over the search's
LONGEST = 600.0  # [time unit]: unknowns that ask for a longer run are no shell's
PRESSURE = {"youngs_modulus": 1.0, "thickness": 1.0, "radius": -1.0}  # powers in Π
NOWHERE = Standing(*map(jnp.asarray, ((), (), 0)))


@dataclass(frozen=True)
class Snap:
    """How a record through the snap was made, and how it is fitted.

    Args:
        ramp: Time that the outer pressure takes from the gas's to the final one, then held [s, or time unit]; 0 is a
            sudden step. By default what the record's settings say.
        pressure: The outer pressure as it was measured instead: times [s, or time unit] and values [Pa, or E d/R0]. By
            default the record's channel P_ext, where it has one and `outer_pressure` is not asked.
        origin: When the ramp begins, on the record's clock.
        elements: Of the meridian.
        step: Longest time step [time unit].
        starts: From how many starts the minimum is sought.
        engine: Where these searches run, as of `jshell.engines.open`.
        checkpoint: Folder in which every simulation is kept; the same call continues there.
        progress: Called after every simulation and within, with their number and the share of the present one.
    """

    ramp: float | int | None = None
    pressure: tuple[Any, Any] | None = None
    origin: float | int = 0.0
    elements: int = 24
    step: float = 1 / 40
    starts: int = 1
    engine: Executor | str = "inline"
    checkpoint: Path | str | None = None
    progress: Callable[[int, float], None] | None = None


@dataclass(frozen=True)
class Protocol:
    """The outer pressure of one recording: straight lines between knots, or from p₀ to p in a time.

    Attributes:
        times, values: (knots,) in the record's units, from the origin on; values None where the ends are unknowns.
    """

    times: np.ndarray
    values: np.ndarray | None


@dataclass
class SnapModel(Model):
    """The whole simulation for a set of recordings.

    Attributes:
        snap: How they were made.
        protocols: Of every recording.
        kept: Simulations that are done.
        offsets: Per recording, (channels, times) that a finer mesh adds.
    """

    snap: Snap = field(default_factory=Snap)
    protocols: tuple[Protocol, ...] = ()
    kept: Kept = field(default_factory=lambda: Kept(None, ()))
    offsets: list[np.ndarray] = field(default_factory=list)

    @property
    def described(self) -> str:
        """By what the recordings are described."""
        return "through the snap, simulated whole"

    def describes(self, weighing: Weighing) -> str:
        """By how much of it one of them is."""
        return "through the snap"

    def standing(self, u: np.ndarray) -> list[Standing]:
        """Nothing: a simulation begins with the sphere."""
        return [NOWHERE] * len(self.recordings)

    def project(self, k: int, u: np.ndarray, near: Standing, weighing: Weighing) -> tuple[Projection, Outcome]:
        """What the simulation leaves of recording k; `near` says nothing here."""
        one = self.recordings[k]
        found = self.kept(("search", k, u), lambda: self._curve(k, u))
        outcome = Outcome(int(found["outcome"]))
        channels = len(one.channels)
        if outcome != Outcome.OK:
            nothing = np.full((one.values.size, u.size), np.nan)
            return Projection(nothing[:, 0], nothing, nothing, nothing[:, :0], np.empty(0), one.values), outcome
        fresh = lambda rows: _fresh(rows / weighing.sigma[:, None], weighing.memory)  # noqa: E731
        curve = found["curve"] + (self.offsets[k] if self.offsets else 0.0)
        r, held = fresh((one.values - curve)[None])[0], -fresh(found["slopes"]).T
        J, basis = held, np.empty((r.size, 0))
        if weighing.free_rest:
            still = np.broadcast_to(np.eye(channels)[:, :, None], (channels, *one.values.shape))
            basis = fresh(still).T
            q = np.linalg.qr(basis)[0]
            curve = curve + (np.linalg.lstsq(basis, r, rcond=None)[0])[:, None]
            r, J = r - q @ (q.T @ r), held - q @ (q.T @ held)
        return Projection(r, J, held, basis, np.empty(0), curve), outcome

    def finer(self, k: int, u: np.ndarray) -> np.ndarray | None:
        """(channels, times) what a finer mesh and shorter steps add to recording k; None where they end early."""
        rough = self.kept(("search", k, u), lambda: self._curve(k, u))
        fine = self.kept(("finer", k, u), lambda: self._fine(k, u))
        if int(rough["outcome"]) or int(fine["outcome"]):
            return None
        return fine["curve"] - rough["curve"]

    def modal(self, *_: Any, **__: Any) -> Any:
        """There are no modes here.

        Raises:
            BadValue: Always.
        """
        raise BadValue(
            "next_recording", found="a record through the snap", expected="the modal level",
            remedy='Ask the result of js.invert(..., level="modal").',
        )  # fmt: skip

    def _length(self, k: int, seen: Seen) -> float:
        return (float(self.recordings[k].times[-1]) - float(self.snap.origin)) / seen.time

    def _curve(self, k: int, u: np.ndarray) -> Arrays:
        """The curve of recording k in its units, its slopes with u, and how the run ended."""
        one = self.recordings[k]
        seen, mine = self.seen(k, u)
        slopes = [seen.slope(plain(self.parameters.names[i])) for i in mine]
        curve, changes = np.zeros(one.values.shape), np.zeros((u.size, *one.values.shape))
        length = self._length(k, seen)
        outcome = Outcome.OK if length < LONGEST else Outcome.NOT_CONVERGED
        for at in range(0, max(len(mine), 1) if outcome == Outcome.OK else 0, motion.DIRECTIONS):
            part = range(at, min(at + motion.DIRECTIONS, len(mine)))
            tangents = np.zeros((motion.DIRECTIONS, len(FIELDS)))
            for row, i in enumerate(part):
                tangents[row] = slopes[i][0]
            self.calls += 1
            done = motion.run(
                seen.numbers, tangents, self._load(k, seen, [mine[i] for i in part]), length, self.elements,
                motion.steps_per_sample(self.snap.step), self._report(),
            )  # fmt: skip
            outcome = done.outcome
            if outcome != Outcome.OK:
                break
            curve, rate = self._read(k, seen, done.channels)
            moved = (one.times - self.snap.origin) * rate
            for row, i in enumerate(part):
                own, _ = self._read(k, seen, done.changes[row])
                powers = np.array([POWER[name] for name in one.channels])[:, None]
                changes[mine[i]] = own - moved * slopes[i][1] + curve * powers * slopes[i][2]
        return {"curve": curve, "slopes": changes, "outcome": np.asarray(int(outcome))}

    def _read(self, k: int, seen: Seen, channels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(channels, times) samples of a run where the record has its own, and their rate, in the record's units."""
        one = self.recordings[k]
        at = (one.times - self.snap.origin) / seen.time
        before, at = at < 0, np.maximum(at, 0.0)  # nothing moves before the pressure does
        pick = [motion.PLACES[name] for name in one.channels]
        spline = CubicSpline(motion.EVERY * np.arange(len(channels)), channels[:, pick])
        scale = np.array([seen.length ** POWER[name] for name in one.channels])
        return (spline(at) * scale).T, (np.where(before[:, None], 0.0, spline(at, 1)) * scale / seen.time).T

    def _load(self, k: int, seen: Seen, mine: list[int]) -> motion.OuterPressure:
        """The outer pressure in the simulator's units, and its change with each of some unknowns."""
        times, values, ends = self._knots(k, seen)
        unit = _pressure_unit(seen)
        names = [plain(self.parameters.names[i]) for i in mine]
        value = lambda t: np.interp(t * seen.time, times, values) / unit  # noqa: E731

        def change(t: np.ndarray) -> np.ndarray:
            now = value(t)
            out = np.zeros((motion.DIRECTIONS, *np.shape(t)))
            for row, name in enumerate(names):
                _, time, _ = seen.slope(name)
                out[row] = _steepness(t * seen.time, times, values) * t * seen.time * time / unit
                out[row] -= now * PRESSURE.get(name, 0.0) * self.parameters.si
                if name in ends:
                    out[row] += np.interp(t * seen.time, times, ends[name]) / unit
            return out

        return motion.OuterPressure(value, change)

    def _knots(self, k: int, seen: Seen) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
        """Times and pressures in the record's units, and what the logarithm of each end changes of them."""
        protocol = self.protocols[k]
        if protocol.values is not None:
            return protocol.times, protocol.values, {}
        first, last = seen.values["gas_pressure"], seen.values["outer_pressure"]
        if protocol.times.size == 1:
            return protocol.times, np.array([last]), {"outer_pressure": np.array([last])}
        ends = {"gas_pressure": np.array([first, 0.0]), "outer_pressure": np.array([0.0, last])}
        return protocol.times, np.array([first, last]), ends

    def _fine(self, k: int, u: np.ndarray) -> Arrays:
        """The curve of recording k on the finer mesh."""
        seen, _ = self.seen(k, u)
        times, values, _ = self._knots(k, seen)
        hat, pressure = times / seen.time, values / _pressure_unit(seen)
        if hat.size == 2 and hat[0] == 0:
            law: Any = Ramp(start=pressure[0], stop=pressure[1], duration=hat[1])
        else:
            law = Recorded(hat, pressure)
        numbers = [float(x) for x in seen.numbers]
        length = self._length(k, seen) + motion.SPARE * motion.EVERY
        found = simulate(
            Reduced(*numbers[:PAD_FIELD]), duration=length, every=motion.EVERY, pressure=law,
            elements=round(FINER * self.elements), attached=numbers[PAD_FIELD],
            weak_spot=WeakSpot(numbers[SPOT_FIELD], SPOT_WIDTH), step=self.snap.step / FINER,
            losses=Losses(wall=loss_of(jnp.asarray(seen.numbers), seen.lossy)),
        )  # fmt: skip
        channels = np.stack([np.asarray(found[name]) for name in motion.CHANNELS], axis=1)
        if int(found.outcome):
            return {"curve": np.zeros(0), "outcome": np.asarray(int(found.outcome))}
        return {"curve": self._read(k, seen, channels)[0], "outcome": np.asarray(0)}

    def _report(self) -> motion.Report | None:
        tell, calls = self.snap.progress, self.calls
        return None if tell is None else lambda share: tell(calls, share)


def _pressure_unit(seen: Seen) -> float:
    """Π in the record's units; 1 without units."""
    return seen.values["gas_pressure"] / float(seen.numbers[FIELDS.index("gas_pressure")])


def protocol(one: Recording, snap: Snap, asked: bool) -> Protocol:
    """How the outer pressure of a recording went.

    Args:
        one: The recording.
        snap: What is said of it.
        asked: The final outer pressure is an unknown.

    Raises:
        BadValue: Nothing is known of it, or what is given is none.
    """
    given = snap.pressure
    scales = one.trace.scales if one.si else None
    if given is None and not asked and "P_ext" in one.trace.channels:
        unit = (1.0, 1.0) if scales is None else (float(scales.time), float(scales.pressure))
        given = (np.asarray(one.trace.times) * unit[0], np.asarray(one.trace["P_ext"]) * unit[1])
    if given is not None:
        if asked:
            raise BadValue(
                "outer_pressure", found="a measured pressure, and the same among the unknowns", expected="one of them",
                remedy="Leave outer_pressure out of the unknowns, or give `ramp`.",
            )  # fmt: skip
        times, values = (np.asarray(part, dtype=float) for part in given)
        Recorded(times, values)  # refuses what is no record
        return Protocol(times - float(snap.origin), values)
    ramp = _ramp(one) if snap.ramp is None else float(snap.ramp)
    if not (np.isfinite(ramp) and ramp >= 0):
        raise BadValue(
            "ramp", found="nothing said of how the pressure rose" if snap.ramp is None else repr(snap.ramp),
            expected="the time of the ramp [s, or time unit], 0 for a sudden step, or the pressure as measured",
            remedy="Write level=js.inversion.Snap(ramp=0.06).",
        )  # fmt: skip
    return Protocol(np.array([0.0, ramp]) if ramp > 0 else np.zeros(1), None)


def _ramp(one: Recording) -> float:
    """The ramp that a record's settings tell; NaN where they do not."""
    try:
        words = float(dict(one.trace.settings).get("ramp", "nan"))
    except ValueError:
        return float("nan")
    return words * (float(one.trace.scales.time) if one.si and one.trace.scales is not None else 1.0)


def _steepness(t: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Slope of the straight lines between knots; 0 beyond them."""
    if times.size < 2:
        return np.zeros(np.shape(t))
    slopes = np.concatenate([[0.0], np.diff(values) / np.diff(times), [0.0]])
    return slopes[np.searchsorted(times, t, side="right")]


def _fresh(rows: np.ndarray, memory: np.ndarray) -> np.ndarray:
    """(…, channels, times) with the memory of the noise taken out, as (…, channels · times)."""
    if memory.any():
        rows = np.stack([whiten(rows[:, c].T, memory[c]).T for c in range(rows.shape[1])], axis=1)
    return rows.reshape(rows.shape[0], -1)
