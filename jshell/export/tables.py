"""The law as a table for any program: CSV with its numbers above, read back as it was written."""

import csv
from pathlib import Path

import numpy as np

from jshell.errors import BadFile
from jshell.export.law import LawBranch, RadialLaw
from jshell.io.files import read_text, write_bytes

COLUMNS = ("V [m^3]", "R [m]", "P [Pa]", "P_gas [Pa]", "M [kg/m^4]", "C [Pa s/m^3]", "buckled")
NUMBERS = {
    "rest_volume": "m^3, of the buckled shell",
    "rest_pressure": "Pa, outer",
    "buckling_volume": "m^3: smaller, the sphere buckles",
    "unbuckling_volume": "m^3: larger, the dimple is gone",
    "density": "kg/m^3, of the liquid",
    "viscosity": "Pa s, of the liquid",
    "kappa": "polytropic exponent of the gas",
    "stiffening": "of the slow mode over the static law",
}
WORDS = (
    "a buckled shell as one equation for its volume: M dV'/dt + M' V'^2/2 + C V' = P(V) - P_ext(t), with V' = dV/dt",
    "P: what gas and wall bear; R: of a sphere of this volume; buckled: 1 the buckled branch, 0 the sphere",
)


def write_law(path: str | Path, law: RadialLaw) -> None:
    """Write a law as CSV: first the buckled branch, then the sphere, each by ascending volume.

    Args:
        path: The file.
        law: From `radial_law`.

    Raises:
        BadFile: Nothing can be written there.
    """
    lines = [f"# {text}" for text in WORDS]
    lines += [f"# {name}: {getattr(law, name)!r} ({unit})" for name, unit in NUMBERS.items()]
    lines.append(f"# along: {law.along}")
    lines.append(",".join(COLUMNS))
    for flag, branch in ((1, law.buckled), (0, law.sphere)):
        rows = np.stack(
            [branch.volume, branch.radius, branch.pressure, branch.gas, branch.mass, branch.damping], axis=1
        )
        lines += [",".join(f"{number:.15g}" for number in row) + f",{flag}" for row in rows]
    write_bytes(path, ("\n".join(lines) + "\n").encode())


def read_law(path: str | Path) -> RadialLaw:
    """A law from the CSV that `write_law` wrote.

    Args:
        path: The file.

    Raises:
        BadFile: Missing, or not as `write_law` writes it.
    """
    lines = read_text(path).splitlines()
    numbers: dict[str, str] = {}
    table, along = [], "mode"
    for line in lines:
        if line.startswith("#"):
            name, _, rest = line[1:].partition(":")
            if name.strip() in NUMBERS:
                numbers[name.strip()] = rest.split("(")[0]
            along = rest.strip() if name.strip() == "along" else along
        else:
            table.append(line)
    try:
        names, *rows = csv.reader(table)
        values = np.array(rows, float).T
        found = {name: float(numbers[name]) for name in NUMBERS}
        if tuple(names) != COLUMNS or not np.all(np.isfinite(values)):
            raise ValueError("other columns, or numbers that are none")
        volume, _, *parts, flag = values
        branches = [LawBranch(volume[flag == k], *(part[flag == k] for part in parts)) for k in (1, 0)]
        if any(len(one.volume) < 2 or not np.all(np.diff(one.volume) > 0) for one in branches):
            raise ValueError("volumes that do not ascend")
    except (ValueError, KeyError) as error:
        raise BadFile(
            str(path), found=f"no law: {error}", expected="what write_law writes", remedy="Export the law again."
        ) from None
    return RadialLaw(branches[0], branches[1], **found, along=along)
