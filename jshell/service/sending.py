"""What a client sends: options as JSON, traces as files, a batch as what can be taken apart."""

import dataclasses
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from jshell import io
from jshell.calibration import Recordings, recordings_file
from jshell.calibration.options import OPTIONS, FitOptions, check_names
from jshell.calibration.recordings import stacked
from jshell.errors import BadValue
from jshell.files import NamedBytes
from jshell.inversion.unknowns import as_unknown
from jshell.io import zip_files
from jshell.io.files import read_bytes
from jshell.service.chunks import Whole
from jshell.shell.parameters import Reduced
from jshell.trace import Trace

PIECE = 2**19  # bytes that are sent at once


def is_id(one: object) -> bool:
    """Whether this is the name of an upload."""
    return isinstance(one, str) and len(one) == 32 and all(letter in "0123456789abcdef" for letter in one)


def fit_options(given: Mapping[str, Any]) -> dict[str, Any]:
    """The options of a fit that are not usual, as JSON.

    Raises:
        BadName: A choice that does not exist, or no such option.
        BadValue: A tie that is a function.
    """
    profile = {"profile": True} if given.get("profile") else {}
    own = {name: value for name, value in given.items() if name != "profile" and value is not None}
    check_names(own, OPTIONS)
    options = FitOptions(**own)
    if not all(isinstance(text, str) for text in options.tie.values()):
        raise BadValue(
            "tie", found="a function", expected="arithmetic as text: jobs are data", remedy='Write "0.3*alpha1".'
        )
    record = options.record()
    return plain({name: record[name] for name in options.differing()}) | profile


def question(
    unknown: Iterable[str] | Mapping[str, Any], known: Mapping[str, float | int] | None, options: Mapping[str, Any]
) -> dict[str, Any]:
    """What is asked of an inversion, as JSON.

    Raises:
        BadValue: Something written for an unknown that it cannot be.
    """
    given = (
        unknown if isinstance(unknown, Mapping) else dict.fromkeys([unknown] if isinstance(unknown, str) else unknown)
    )
    asked = {name: as_unknown(name, written) for name, written in given.items()}
    found = dict(options) | {"unknown": list(asked), "known": {name: float(x) for name, x in (known or {}).items()}}
    found["bounds"] = {n: [one.low, one.high] for n, one in asked.items() if (one.low, one.high) != (None, None)}
    found["priors"] = {n: dataclasses.asdict(one.prior) for n, one in asked.items() if one.prior is not None}
    found["local"] = [*dict.fromkeys([*options.get("local", ()), *(n for n, one in asked.items() if one.local)])]
    return found


def plain(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options as JSON knows them: an infinite bound is open."""
    found = dict(options)
    if "bounds" in found:
        ends = lambda pair: [None if math.isinf(float(x)) else float(x) for x in pair]  # noqa: E731
        found["bounds"] = {name: ends(pair) for name, pair in found["bounds"].items()}
    return found


def numbers(conditions: Reduced) -> dict[str, float]:
    """Conditions as JSON has them, under the keys of files."""
    return {key: float(value) for key, value in conditions.as_dict().items()}


def written(trace: Trace, name: str = "trace.json") -> NamedBytes:
    """A trace as a file, in SI where it can be."""
    units = "si" if trace.scales is not None and trace.conditions is not None else "reduced"
    return io.encode_trace(name, trace, units)


def reading(said: Mapping[str, Any]) -> str:
    """What a file leaves open, as JSON; refused here where it is wrong.

    Raises:
        BadName, BadValue: As `jshell.io.Reading`.
    """
    given = io.Reading.from_record(said)
    record = dataclasses.asdict(given)
    usual = dataclasses.asdict(io.Reading())
    return json.dumps({name: value for name, value in record.items() if value != usual[name]})


def content(path: str | Path) -> tuple[str, bytes]:
    """Name and bytes of a file, as it is sent: without the folders it lies in.

    Raises:
        BadFile: No such file, or one that cannot be sent.
    """
    return Path(path).name, bytes(read_bytes(path).content)


def pieces(body: bytes) -> Iterator[memoryview]:
    """A body in pieces: of a whole, what is left would be copied after every piece that the line took."""
    view = memoryview(body)
    return (view[at : at + PIECE] for at in range(0, len(view), PIECE))


def whole(traces: Recordings | Sequence[Trace] | str | Path) -> Whole:
    """A batch as records, or as the files of an archive.

    Raises:
        BadFile: A file or an archive that cannot be read.
    """
    if isinstance(traces, Recordings):
        return traces
    if not isinstance(traces, str | Path):
        return stacked(list(traces))
    name, found = content(traces)
    if name.lower().endswith(".zip"):
        return zip_files.files(name, found)
    if name.lower().endswith(".npz") and recordings_file.count(found, name):
        return recordings_file.decode(found, name)
    return [(name, found)]
