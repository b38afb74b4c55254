"""Conditions as files spell them: dimensionless, or in SI.

Symbols    d̂ thickness   P̂0 gas pressure   P̂ext outer pressure   η̂ viscosity
           R0 radius [m]   d thickness [m]   E Young's modulus [Pa]   ρ_f density [kg/m³]
Source     Mokbel et al. 2021, section "Description of relevant parameters"
"""

import json
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from jshell.errors import BadFile, BadName, BadUnits, BadValue, Outcome
from jshell.files import Source
from jshell.io.files import read_text, short
from jshell.io.sheets import NUMBER, Entry
from jshell.shell.parameters import Gas, Liquid, Load, Number, Reduced, Scales, Shell, scales

REDUCED_KEYS = ("d_hat", "P0_hat", "Pext_hat", "eta_hat")
SI_KEYS = ("R0_m", "d_m", "E_Pa", "P0_Pa", "Pext_Pa", "rho_f_kg_m3", "eta_f_Pa_s")
SHARED_KEYS = ("kappa", "nu")
CONDITION_KEYS = (*REDUCED_KEYS, *SI_KEYS, *SHARED_KEYS)
OPTIONAL_KEYS = ("eta_hat", *SHARED_KEYS)  # Reduced knows their defaults

# What the constructors call a number, and what files call it.
_KEY_OF_PLACE = {
    "radius [m]": "R0_m",
    "thickness [m]": "d_m",
    "youngs_modulus [Pa]": "E_Pa",
    "gas pressure [Pa]": "P0_Pa",
    "outer pressure [Pa]": "Pext_Pa",
    "density [kg/m^3]": "rho_f_kg_m3",
    "viscosity [Pa s]": "eta_f_Pa_s",
    "thickness (d_hat)": "d_hat",
    "gas_pressure (P0_hat)": "P0_hat",
    "outer_pressure (Pext_hat)": "Pext_hat",
    "viscosity (eta_hat)": "eta_hat",
    "kappa": "kappa",
    "poisson_ratio": "nu",
}
# The SI keys that make a dimensionless number.
_MADE_FROM = {
    "d_hat": "d_m and R0_m",
    "P0_hat": "P0_Pa, E_Pa, d_m and R0_m",
    "Pext_hat": "Pext_Pa, E_Pa, d_m and R0_m",
    "eta_hat": "eta_f_Pa_s and the others",
}

_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")


def read_conditions(path: Source) -> tuple[Reduced, Scales | None]:
    """The conditions in a JSON object with the keys of a trace's header.

    Args:
        path: A JSON file, `{"d_hat": 0.22, "P0_hat": 0.9, …}` or with SI keys; or its name with its bytes.

    Returns:
        The problem, and the SI values of its units where the file gives SI.

    Raises:
        BadFile: Not a JSON object, or conditions missing.
        BadName: A key twice, or in other letters.
        BadUnits: Keys of both families.
        BadValue: A number outside its meaning.
    """
    problem, units = conditions(read_entries(path), str(path))
    if problem is None:
        raise BadFile(
            str(path),
            found="no conditions",
            expected=f"the keys {_listed(REDUCED_KEYS)}, or {_listed(SI_KEYS)}",
            remedy="Add them.",
        )
    return problem, units


def read_entries(source: Source) -> tuple[Entry, ...]:
    """Keys and values of a JSON object, as header entries.

    Raises:
        BadFile: Not a JSON object.
    """
    return entries_of(parsed(str(source), read_text(source)), str(source))


def parsed(source: str, text: str) -> tuple[tuple[str, Any], ...]:
    """The pairs of a JSON object, repeated keys included; objects inside are tuples of pairs, too.

    Raises:
        BadFile: Not a JSON object.
    """
    try:
        pairs = json.loads(text, object_pairs_hook=tuple)
        if _SURROGATE.search(text):  # half a letter by its code: no file could be written with it
            json.dumps(pairs, ensure_ascii=False).encode()
    except json.JSONDecodeError as error:
        raise BadFile(
            f"{source}, row {error.lineno}, position {error.colno}",
            found=error.msg,
            expected="a JSON object",
            remedy="Check commas, quotes and braces there.",
        ) from None
    except (ValueError, RecursionError) as error:
        raise BadFile(source, found=str(error), expected="a JSON object", remedy="Simplify the file.") from None
    if not isinstance(pairs, tuple):
        raise BadFile(
            source,
            found=f"a JSON {type(pairs).__name__}",
            expected="a JSON object",
            remedy='Write `{"d_hat": 0.22, …}`.',
        )
    return pairs


def entries_of(pairs: Sequence[tuple[str, Any]], source: str) -> tuple[Entry, ...]:
    """The pairs of a JSON object as header entries."""
    return tuple(Entry(key, _text(value), f"{source}, key `{key}`") for key, value in pairs)


def conditions(entries: Sequence[Entry], source: str) -> tuple[Reduced | None, Scales | None]:
    """The problem that header entries describe, None where they hold no conditions.

    Args:
        entries: The file's entries; those that are not conditions are passed over.
        source: The file, for messages.

    Raises:
        BadFile: Part of the conditions is missing.
        BadName: A key twice, or in other letters.
        BadUnits: Keys of both families.
        BadValue: A number outside its meaning.
    """
    given = condition_entries(entries)
    if not given:
        return None, None
    reduced = [key for key in given if key in REDUCED_KEYS]
    si = [key for key in given if key in SI_KEYS]
    if reduced and si:
        raise BadUnits(
            given[si[0]].place,
            found=f"SI keys ({', '.join(si)}) beside dimensionless ones ({', '.join(reduced)})",
            expected="one family of conditions",
            remedy="Remove the keys of one family.",
        )
    wanted = SI_KEYS if si else REDUCED_KEYS
    missing = [key for key in wanted if key not in given and key not in OPTIONAL_KEYS]
    if missing:
        instead = "" if reduced or si else f", or {_listed(SI_KEYS)}"
        raise BadFile(
            source,
            found=f"conditions without {', '.join(missing)}",
            expected=f"{_listed(wanted)}{instead}",
            remedy="Add the missing keys, or remove the conditions.",
        )
    number = {key: _number(entry) for key, entry in given.items()}
    try:
        return _si_problem(number) if si else (Reduced.from_dict(number), None)
    except BadValue as error:
        raise _placed(error, given, source) from None
    except ArithmeticError:
        raise BadValue(
            source,
            found="SI conditions whose units of length, time or pressure overflow",
            expected="numbers of the laboratory",
            remedy="Check powers of ten.",
        ) from None


def condition_entries(entries: Sequence[Entry]) -> dict[str, Entry]:
    """The entries that are conditions, by key.

    Raises:
        BadName: A key twice, or in other letters than the registry's.
        BadValue: A value that is not a number.
    """
    spelling = {key.lower(): key for key in CONDITION_KEYS}
    given: dict[str, Entry] = {}
    for entry in entries:
        key = spelling.get(entry.key.lower())
        if key is None:
            continue
        if entry.key != key:
            raise BadName(entry.place, found=f"the key {entry.key}", expected=key, remedy=f"Write it `{key}`.")
        _add_once(given, entry)
        _number(entry)
    return given


def outcome(entries: Sequence[Entry]) -> int:
    """How the run ended that made the file; `ok` where it does not say."""
    given: dict[str, Entry] = {}
    for entry in entries:
        if entry.key == "outcome":
            _add_once(given, entry)
    if not given:
        return int(Outcome.OK)
    entry = given["outcome"]
    words = {member.word: int(member) for member in Outcome}
    if entry.value not in words:
        raise BadName(
            entry.place,
            found=f"the outcome {short(entry.value)}",
            expected="one of " + ", ".join(words),
            remedy="Correct the word, or remove the line.",
        )
    return words[entry.value]


def settings(entries: Sequence[Entry]) -> tuple[tuple[str, str], ...]:
    """What the entries say beside conditions and outcome, in order."""
    known = (*CONDITION_KEYS, "outcome")
    return tuple((entry.key, entry.value) for entry in entries if entry.key not in known)


def refuse_equals_signs(comments: Sequence[Entry]) -> None:
    """Refuse `# d_hat = 0.22`, which would pass for a comment and lose the condition."""
    for comment in comments:
        key = comment.value.partition("=")[0].strip()
        if "=" in comment.value and key in CONDITION_KEYS:
            raise BadFile(
                comment.place,
                found=f"`{key} =`",
                expected=f"`# {key}: value`",
                remedy="Write a colon for the equals sign.",
            )


def reduced_pairs(problem: Reduced) -> list[tuple[str, str]]:
    """Keys and values of a problem without units."""
    numbers = problem.as_dict()
    return _written(tuple(numbers), tuple(numbers.values()))


def si_pairs(problem: Reduced, unit: Scales) -> list[tuple[str, str]]:
    """Keys and values of the SI problem at given scales."""
    shell, gas, liquid, load = problem.to_si(unit)
    numbers = (shell.radius, shell.thickness, shell.youngs_modulus, gas.pressure, load.pressure)
    numbers = (*numbers, liquid.density, liquid.viscosity, gas.kappa, shell.poisson_ratio)
    return _written((*SI_KEYS, *SHARED_KEYS), numbers)


def _written(keys: Sequence[str], numbers: Sequence[Number]) -> list[tuple[str, str]]:
    return [(key, repr(float(number))) for key, number in zip(keys, numbers, strict=True)]


def _si_problem(number: dict[str, float]) -> tuple[Reduced, Scales]:
    ratio = {"poisson_ratio": number["nu"]} if "nu" in number else {}
    exponent = {"kappa": number["kappa"]} if "kappa" in number else {}
    shell = Shell(number["R0_m"], number["d_m"], number["E_Pa"], **ratio)
    gas = Gas(number["P0_Pa"], **exponent)
    liquid = Liquid(number["rho_f_kg_m3"], number["eta_f_Pa_s"])
    load = Load(number["Pext_Pa"])
    unit = scales(shell, liquid)
    sizes = [unit.of(dimension) for dimension in ("volume", "time", "speed", "volume rate", "pressure", "energy")]
    if not all(np.isfinite(size) and size > 0 for size in sizes):
        raise OverflowError
    return Reduced.from_si(shell, gas, liquid, load), unit


def _number(entry: Entry) -> float:
    value = float(entry.value) if NUMBER.fullmatch(entry.value) else np.nan
    if not np.isfinite(value):
        comma = NUMBER.fullmatch(entry.value.replace(",", ".")) is not None
        alone = "Write the number alone, such as 0.22 or 2.2e-1, without a unit."
        raise BadValue(
            entry.place,
            found=short(entry.value),
            expected="a finite number",
            remedy="Write a decimal point: headers have no decimal commas." if comma else alone,
        )
    return value


def _placed(error: BadValue, given: dict[str, Entry], source: str) -> BadValue:
    """The same refusal, with file and key."""
    key = _KEY_OF_PLACE.get(error.place, error.place)
    if key in given:
        return BadValue(given[key].place, found=error.found, expected=error.expected, remedy=error.remedy)
    made_from = _MADE_FROM.get(key, "the conditions")
    return BadValue(
        source,
        found=f"{key} = {error.found}, made from {made_from}",
        expected=error.expected,
        remedy=error.remedy,
    )


def _add_once(given: dict[str, Entry], entry: Entry) -> None:
    if entry.key in given:
        raise BadName(
            entry.place,
            found=f"`{entry.key}` a second time, first at {given[entry.key].place}",
            expected="every key once",
            remedy="Remove one of them.",
        )
    given[entry.key] = entry


def _text(value) -> str:
    """A JSON value as a header would hold it."""
    if isinstance(value, str):
        return value
    return json.dumps(value) if isinstance(value, list | tuple | bool) or value is None else repr(value)


def _listed(keys: Sequence[str]) -> str:
    return ", ".join(keys)
