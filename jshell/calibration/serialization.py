"""A fit in one file: data, what was asked, what was found; drawn again without fitting again."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from jshell.calibration.estimate import Estimate
from jshell.calibration.result import Fit
from jshell.io.records import plain, trace_record, write_groups, write_record

KIND = "fit"


def serialized(result: Fit) -> dict[str, Any]:
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
            "minimum": list(result.minimum),
            "data": {
                "traces": [trace_record(trace) for trace in result.traces],
                "table": {name: np.asarray(column) for name, column in result.table.items()},
            },
        }
    )


def save(result: Fit, path: str | Path) -> Path:
    """Write a result; see `FitResult.save`."""
    return write_record(path, KIND, serialized(result))


def export(result: Fit, path: str | Path) -> Path:
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
