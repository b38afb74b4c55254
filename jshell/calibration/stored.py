"""A fit in one file: data, what was asked, what was found; drawn again without fitting again."""

from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from jshell.calibration.estimate import Estimate, Start
from jshell.calibration.noise import Noise
from jshell.calibration.options import FitOptions
from jshell.calibration.report import FitResult
from jshell.errors import BadFile, Outcome
from jshell.io.records import number, numbers, plain, read_record, trace_of, trace_record, write_groups, write_record

KIND = "fit"
_ESTIMATE = {"value", "stderr", "start"}


def stored(result: FitResult) -> dict[str, Any]:
    """All of a result as a JSON object, to the bit."""
    return plain(
        {
            "title": result.title,
            "outcome": result.outcome.word,
            "versions": [list(pair) for pair in result.versions],
            "seed": None if result.specification is None else result.specification.seed,
            "specification": None if result.specification is None else result.specification.record(),
            "estimates": [asdict(one) for one in result.estimates],
            "derived": [asdict(one) for one in result.derived],
            "varied": list(result.varied),
            "covariance": np.asarray(result.covariance),
            "correlation": np.asarray(result.correlation),
            "chi_square": result.chi_square,
            "n_data": result.n_data,
            "n_varied": result.n_varied,
            "absolute": result.absolute,
            "free_directions": list(result.free_directions),
            "notes": list(result.notes),
            "warnings": list(result.warnings),
            "dipole": result.dipole,
            "starts": [asdict(one) | {"outcome": one.outcome.word} for one in result.starts],
            "noise": [asdict(one) for one in result.noise],
            "residual": np.asarray(result.residual),
            "data": {
                "traces": [trace_record(trace) for trace in result.traces],
                "table": {name: np.asarray(column) for name, column in result.table.items()},
            },
        }
    )


def save(result: FitResult, path: str | Path) -> Path:
    """Write a result; see `FitResult.save`."""
    return write_record(path, KIND, stored(result))


def load(path: str | Path) -> FitResult:
    """Read a result that `FitResult.save` wrote.

    It does all that the one that was saved can: report, draw, compare, and walk
    around its minimum (`profile`, `bootstrap`, `posterior`), which is built anew of
    its data and its options.

    Raises:
        BadFile: Not such a file; the message says in what.
    """
    found = read_record(path, KIND)
    try:
        return _result(found)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise BadFile(
            str(path), found=f"a field that is missing or of another kind ({error})", expected="a whole record",
            remedy="Save the result again.",
        ) from error  # fmt: skip


def _result(found: Mapping[str, Any]) -> FitResult:
    asked = found["specification"]
    varied = tuple(found["varied"])
    square = (len(varied), len(varied))
    return FitResult(
        title=found["title"],
        outcome=_outcome(found["outcome"]),
        estimates=tuple(_estimate(one) for one in found["estimates"]),
        derived=tuple(_estimate(one) for one in found["derived"]),
        covariance=numbers(found["covariance"]).reshape(square),
        correlation=numbers(found["correlation"]).reshape(square),
        varied=varied,
        residual=numbers(found["residual"]),
        chi_square=number(found["chi_square"]),
        n_data=int(found["n_data"]),
        n_varied=int(found["n_varied"]),
        absolute=bool(found["absolute"]),
        free_directions=tuple(found["free_directions"]),
        starts=tuple(_start(one) for one in found["starts"]),
        notes=tuple(found["notes"]),
        warnings=tuple(found["warnings"]),
        dipole=found["dipole"],
        noise=tuple(Noise(**{f.name: _like(f.type, one[f.name]) for f in fields(Noise)}) for one in found["noise"]),
        traces=tuple(trace_of(one) for one in found["data"]["traces"]),
        table={name: numbers(column) for name, column in found["data"]["table"].items()},
        specification=None if asked is None else FitOptions.from_record(asked),
        versions=tuple((str(name), str(version)) for name, version in found["versions"]),
    )


def _like(kind: Any, value: Any) -> Any:
    return str(value) if kind in (str, "str") else int(value) if kind in (int, "int") else number(value)


def _outcome(word: str) -> Outcome:
    return Outcome[word.upper()]


def _estimate(found: Mapping[str, Any]) -> Estimate:
    given: dict[str, Any] = {key: number(value) if key in _ESTIMATE else value for key, value in found.items()}
    return Estimate(**given)


def _start(found: Mapping[str, Any]) -> Start:
    values = tuple(number(x) for x in found["values"])
    return Start(values, number(found["cost"]), _outcome(found["outcome"]), int(found["steps"]), bool(found["agrees"]))


def export(result: FitResult, path: str | Path) -> Path:
    """Write a result as NetCDF groups: `parameters`, `derived`, `residual`, and `trace_1`, `trace_2`, …

    Raises:
        MissingExtra: Without the extra `io`.
    """

    def rows(estimates: tuple[Estimate, ...]) -> dict:
        return {
            "name": (("name",), [one.name for one in estimates]),
            "value": (("name",), [one.value for one in estimates]),
            "stderr": (("name",), [one.stderr for one in estimates]),
            "role": (("name",), [one.role for one in estimates]),
        }

    square = ("varied", "varied_")
    groups: dict[str, dict] = {
        "parameters": rows(result.estimates),
        "uncertainty": {
            "varied": (("varied",), list(result.varied)),
            "covariance": (square, np.asarray(result.covariance)),
            "correlation": (square, np.asarray(result.correlation)),
        },
        "residual": {"residual": (("data",), np.asarray(result.residual))},
    }
    if result.derived:
        groups["derived"] = rows(result.derived)
    for index, trace in enumerate(result.traces, 1):
        groups[f"trace_{index}"] = {
            "t": (("t",), np.asarray(trace.times)),
            **{name: (("t",), np.asarray(values)) for name, values in trace.channels.items()},
        }
    if result.table:
        groups["table"] = {name: (("row",), np.asarray(column)) for name, column in result.table.items()}
    return write_groups(path, groups, title=result.title, outcome=result.outcome.word)
