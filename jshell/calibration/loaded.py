"""A fit read from its file."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from jshell.calibration.estimate import Estimate, Start
from jshell.calibration.noise import Noise
from jshell.calibration.options import FitOptions
from jshell.calibration.report import FitResult
from jshell.calibration.serialization import KIND
from jshell.errors import BadFile, Outcome
from jshell.files import Source
from jshell.io.records import number, numbers, read_record, text, texts, trace_of

_NUMBERS = {"value", "stderr", "start"}


def load(path: Source) -> FitResult:
    """Read a result that `FitResult.save` wrote, from its file or from a name with the file's bytes.

    It does all that the one that was saved can: report, draw, compare, and walk
    around its minimum (`profile`, `bootstrap`, `posterior`), which is built anew of
    its data and its options.

    Raises:
        BadFile: Not such a file; the message says in what.
    """
    found = read_record(path, KIND)
    try:
        return _result(found)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        raise BadFile(
            str(path), found=f"a field that is missing or of another kind ({error})", expected="a whole record",
            remedy="Save the result again.",
        ) from error  # fmt: skip


def _result(found: Mapping[str, Any]) -> FitResult:
    asked = found["specification"]
    varied = texts(found["varied"])
    square = (len(varied), len(varied))
    return FitResult(
        title=text(found["title"]),
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
        free_directions=texts(found["free_directions"]),
        starts=tuple(_start(one) for one in found["starts"]),
        notes=texts(found["notes"]),
        warnings=texts(found["warnings"]),
        dipole=text(found["dipole"]),
        noise=tuple(Noise(**{f.name: _like(f.type, one[f.name]) for f in fields(Noise)}) for one in found["noise"]),
        traces=tuple(trace_of(one) for one in found["data"]["traces"]),
        table={name: numbers(column) for name, column in found["data"]["table"].items()},
        specification=None if asked is None else FitOptions.from_record(asked),
        minimum=tuple(number(x) for x in found.get("minimum", ())),
        versions=tuple((str(name), str(version)) for name, version in found["versions"]),
    )


def _like(kind: Any, value: Any) -> Any:
    return str(value) if kind in (str, "str") else int(value) if kind in (int, "int") else number(value)


def _outcome(word: str) -> Outcome:
    return Outcome[word.upper()]


def _estimate(found: Mapping[str, Any]) -> Estimate:
    given: dict[str, Any] = {key: (number if key in _NUMBERS else text)(value) for key, value in found.items()}
    return Estimate(**given)


def _start(found: Mapping[str, Any]) -> Start:
    values = tuple(number(x) for x in found["values"])
    return Start(values, number(found["cost"]), _outcome(found["outcome"]), int(found["steps"]), bool(found["agrees"]))
