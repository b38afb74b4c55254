"""What a job does: JSON and named bytes in, named bytes out.

Plain functions that a process anywhere can import; nothing of the database,
nothing of HTTP. A job is data only: what it asks for is looked up here by name.
"""

import dataclasses
import functools
import json
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from inspect import signature
from typing import Any

import numpy as np

from jshell import calibration, dynamics, io, oscillator
from jshell.calibration.options import OPTIONS, FitOptions, check_names
from jshell.calibration.serialization import serialized
from jshell.errors import BadValue, JshellError, LimitReached, choose
from jshell.files import NamedBytes
from jshell.io.files import bytes_written
from jshell.io.records import encode_record
from jshell.io.zip_files import Content
from jshell.oscillator import Coefficients
from jshell.service import batches, films, inversions
from jshell.service.encoding import as_csv, as_json
from jshell.service.log import trace_of
from jshell.service.shape import rounded
from jshell.service.shared_file import FileRef
from jshell.shell import Reduced
from jshell.trace import Trace

FIT_MORE = ("conditions", "profile", "netcdf")  # of a job beside the options of the fit
BATCH = tuple(name for name in signature(calibration.fit_batch).parameters if name not in ("traces", "progress"))
SIMULATOR = (
    "duration", "every", "ramp", "elements", "attached", "shell_density", "step", "follow", "tolerance", "netcdf",
)  # fmt: skip
MODES = ("liquid", "count", "elements", "attached", "azimuth")
OSCILLATOR = ("duration", "every", "coefficients", "initial", "netcdf")
Files = Sequence[tuple[str, Content]]
FRAMES, ANGLES = 160, 61  # of a film, of an outline in it
_USUAL = {"d_hat": 0.22, "P0_hat": 0.9, "Pext_hat": 1.6, "eta_hat": 0.004}


@dataclass(frozen=True)
class TaskResult:
    """How a job ended: files by name, or an error; with a traceback for the log where jshell itself is at fault."""

    files: Mapping[str, bytes]
    error: Mapping[str, str] | None = None
    fault: str | None = None


_TOO_LARGE = LimitReached(
    "memory of a job", found="none left", expected="enough for the job", remedy="Fit fewer or shorter records at once."
)


def ready(warm: bool = False, nice: int | None = None) -> int:
    """The process that answers, once everything is imported and, where asked for, the usual programs are compiled.

    Args:
        warm: Whether to compile.
        nice: Step back behind others by this much; None leaves the process as it is.
    """
    if nice is not None and hasattr(os, "setpriority"):
        os.setpriority(os.PRIO_PROCESS, 0, nice)
    if warm:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            _warm()
    return os.getpid()


def run(kind: str, specification: Mapping[str, Any], files: Sequence[tuple[str, bytes | FileRef]] = ()) -> TaskResult:
    """Do a job.

    Args:
        kind: `fit`, `batch`, `simulate`, `modes`, `look` (at a film), `film` or `invert`.
        specification: What is asked.
        files: Name and bytes of each trace, or a reference to them in a file of this machine.
    """
    try:
        given = [NamedBytes(name, found.view() if isinstance(found, FileRef) else found) for name, found in files]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a result carries its own warnings
            return TaskResult(_TASKS[kind](specification, given))
    except JshellError as error:
        return TaskResult({}, error.record())
    except MemoryError:
        return TaskResult({}, _TOO_LARGE.record())
    except Exception as error:  # the outer edge of the worker
        return TaskResult({}, None, f"{error!r}\n{trace_of(error)}")


def fit(specification: Mapping[str, Any], files: Files) -> dict[str, bytes]:
    """Fit traces that share their constants.

    Returns:
        `record.json`, which `jshell.load` reads; `table.csv` of parameters; `report.txt`; unless `netcdf` is
        false, `record.nc`; with `profile` asked for, `profile.json`.

    Raises:
        JshellError: As `jshell.calibration.fit_trajectories` and `jshell.io.read_trace`.
    """
    check_names(specification, (*OPTIONS, *FIT_MORE))
    options = FitOptions.from_record({name: value for name, value in specification.items() if name in OPTIONS})
    given = specification.get("conditions")
    meta = None if given is None else NamedBytes("conditions.json", json.dumps(given).encode())
    traces = [io.read_trace(NamedBytes(*file), meta=meta) for file in files]
    found = calibration.fit_trajectories(traces, options=options)
    made = {
        "record.json": encode_record("fit", serialized(found)),
        "report.txt": found.report().encode(),
        "table.csv": _parameters(found),
    }
    if specification.get("profile"):
        made["profile.json"] = as_json(found.profile().record())
    if specification.get("netcdf", True):
        made["record.nc"] = bytes_written("record.nc", found.to_netcdf)
    return made


def batch(specification: Mapping[str, Any], files: Files) -> dict[str, bytes]:
    """Fit each of many traces by itself.

    Returns:
        `record.npz`, which `jshell.service.batches.unpack_result` reads: table and report are made of it when they are
        asked for.

    Raises:
        JshellError: As `jshell.calibration.fit_batch`.
    """
    check_names(specification, BATCH)
    bounds = FitOptions.from_record({"bounds": specification.get("bounds")}).bounds
    asked = {**specification, "bounds": bounds}
    usual = {"modal": (), "strict": ("V", "S")}.get(asked.get("loss") or "")
    records = batches.read(files, asked.get("channels") or usual)
    found = batches.fitted(records, asked)
    return {"record.npz": batches.pack_result(found, records.names)}


def simulate(specification: Mapping[str, Any], files: Files = ()) -> dict[str, bytes]:
    """Run a model.

    Returns:
        `trace.json`, `trace.csv` and, unless `netcdf` is false, `trace.nc`; `jshell.io.read_trace` reads them. Of the
        simulator without a tolerance `film.json`, its shapes in time.

    Raises:
        JshellError: As `jshell.dynamics.simulate` and `jshell.oscillator.simulate`.
    """
    trace, film = motion(specification)
    names = ("trace.json", "trace.csv", *(("trace.nc",) if specification.get("netcdf", True) else ()))
    made = {name: bytes(io.encode_trace(name, trace).content) for name in names}
    return made if film is None else made | {"film.json": as_json(film)}


def film_of(motion: dynamics.Motion) -> dict[str, Any]:
    """A run as frames: times, and x and r of the meridian from pole to pole in each."""
    samples = np.unique(np.linspace(0, len(motion.trace.times) - 1, FRAMES).astype(int))
    shapes, _ = dynamics.meridians(motion, np.linspace(0.0, np.pi, ANGLES), samples=samples.tolist())
    numbers = {"t": motion.trace.times, "V": motion.trace["V"], "P_ext": motion.trace["P_ext"]}
    return {name: rounded(np.asarray(values)[samples]) for name, values in numbers.items()} | {
        "thickness": float(motion.setup.conditions.thickness),
        "x": [rounded(row) for row in shapes.x],
        "r": [rounded(row) for row in shapes.r],
    }


def motion(specification: Mapping[str, Any]) -> tuple[Trace, dict[str, Any] | None]:
    """The trace of a model, and its film where there is one.

    `model` is `simulator` (shell and liquid), or `oscillator` (the short model).

    Raises:
        BadName: No such model, or an option that it does not have.
    """
    asked = dict(specification)
    model = asked.pop("model", "simulator")
    given = asked.pop("conditions", None)
    asked.pop("netcdf", None)
    choose("model", model, ("simulator", "oscillator"), expected="simulator or oscillator")
    check_names(asked, SIMULATOR if model == "simulator" else OSCILLATOR)
    conditions = _conditions(given)
    if model == "simulator":
        if asked.get("tolerance") is not None:
            return dynamics.simulate(conditions, **asked), None
        asked.pop("tolerance", None)
        run = dynamics.record(conditions, **asked)
        return run.trace, film_of(run)
    duration, every = float(asked.get("duration", 70.0)), float(asked.get("every", 0.05))
    if not (0 < every <= duration and np.isfinite(duration)):
        raise BadValue(
            "duration, every", found=f"{duration:g}, {every:g}", expected="0 < every <= duration", remedy="Check them."
        )
    coefficients = Coefficients(**asked["coefficients"]) if asked.get("coefficients") else oscillator.SOURCE
    initial = np.asarray(asked.get("initial", (0.02, 0.0, 0.0, 0.0)), dtype=float)
    times = every * np.arange(int(duration / every + 1e-9) + 1)
    return oscillator.simulate(conditions, coefficients, initial=initial, times=times), None


def modes(specification: Mapping[str, Any], files: Files = ()) -> dict[str, bytes]:
    """Find the small vibrations of a shell about its rest shape.

    Returns:
        `modes.json`, rows of `jshell.dynamics.Mode`, or of `OrderMode` where orders around the axis are asked for;
        `modes.csv`, the same.

    Raises:
        JshellError: As `jshell.dynamics.modes`.
    """
    asked = dict(specification)
    conditions = _conditions(asked.pop("conditions", None))
    check_names(asked, MODES)
    rows = [dataclasses.asdict(row) for row in dynamics.modes(conditions, **asked).table()]
    return {"modes.json": as_json(rows), "modes.csv": as_csv([rows[0], *(row.values() for row in rows)])}


def _conditions(given: Any) -> Reduced:
    """The shell that a specification names."""
    return io.read_conditions(NamedBytes("conditions", json.dumps(given).encode()))[0]


_TASKS: Mapping[str, Callable[[Mapping[str, Any], Files], dict[str, bytes]]] = {
    "fit": fit,
    "batch": batch,
    "simulate": simulate,
    "modes": modes,
    "look": films.look,
    "film": films.film,
    "invert": inversions.invert,
}


@functools.cache
def _warm() -> None:
    """Compile what a usual fit needs, once a process: two channels, up to 512 samples."""
    trace, _ = motion({"model": "oscillator", "conditions": _USUAL, "duration": 40.0, "every": 0.1})
    calibration.fit_trajectories(trace, "strict")


def _parameters(found: calibration.FitResult) -> bytes:
    rows: list[Sequence[Any]] = [("name", "value", "stderr", "role", "reason")]
    for one in (*found.estimates, *found.derived):
        stderr = float(one.stderr) if np.isfinite(one.stderr) else ""
        rows.append((one.name, "" if one.undetermined else float(one.value), stderr, one.role, one.reason or ""))
    return as_csv(rows)
