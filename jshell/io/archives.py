"""Columns in NumPy's `.npz`, without pickles.

What an array claims to hold is compared with what the archive holds of it
before memory is asked for: a small file that unfolds into gigabytes is refused.
"""

import io as streams
import warnings
import zipfile
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from jshell.errors import BadFile
from jshell.files import NamedBytes
from jshell.io import zip_files
from jshell.io.arrays import SETTINGS, check_array, refuse_names, settings_text, sheet_of
from jshell.io.choices import Reading
from jshell.io.files import SPOILED, check_size, spoiled
from jshell.io.headers import CONDITION_KEYS
from jshell.io.sheets import Sheet, title

WORDS = "NumPy archive"


def read(file: NamedBytes, choices: Reading, required: Sequence[str] = ()) -> Sheet:
    """Columns of an `.npz` archive.

    Raises:
        BadFile: No archive of plain arrays, one array with several columns, or too large.
    """
    try:
        archive = zipfile.ZipFile(streams.BytesIO(file.content))
    except SPOILED as error:
        raise spoiled(file.name, WORDS, error) from None
    with archive:
        members = archive.infolist()
        names = [member.filename for member in members]
        check_size(file.name, sum(member.file_size for member in members))
        twice = next((name for name, count in Counter(names).items() if count > 1), None)
        if twice is not None:
            raise BadFile(
                f"{file.name}, array `{twice}`",
                found="the name twice",
                expected="every name once",
                remedy="Write it again.",
            )
        return sheet_of(file.name, list(_arrays(file.name, archive, members)), choices, required)


def _arrays(source: str, archive: zipfile.ZipFile, members: list[zipfile.ZipInfo]) -> Iterator[tuple[str, np.ndarray]]:
    for member in members:
        name = member.filename.removesuffix(".npy")
        if name == member.filename:
            raise BadFile(
                f"{source}, member `{name}`",
                found="a file that is no array",
                expected="files `name.npy`",
                remedy="Write the archive with `numpy.savez`; export a spreadsheet as CSV in UTF-8.",
            )
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                shape, dtype, _ = zip_files.head(archive, member)
        except SPOILED as error:
            raise spoiled(source, f"{WORDS} (array `{name}`)", error) from None
        place = f"{source}, array `{name}`"
        check_array(place, shape, "O" if dtype.hasobject else dtype.kind, dtype.itemsize)
        try:
            yield name, zip_files.array(archive, member)
        except SPOILED as error:
            raise spoiled(source, f"{WORDS} (array `{name}`)", error) from None


def encode(sheet: Sheet) -> bytes:
    """Columns, conditions and settings as plain arrays, bit for bit.

    Raises:
        BadName: A column named like a condition.
    """
    arrays = {}
    kept = [item for item in sheet.entries if item.key in CONDITION_KEYS]
    arrays |= {item.key: np.asarray(float(item.value)) for item in kept}
    arrays |= {item.key: np.asarray(item.value) for item in sheet.entries if item.key == "outcome"}
    rest = [item for item in sheet.entries if item.key not in (*CONDITION_KEYS, "outcome")]
    if rest:
        arrays[SETTINGS] = np.asarray(settings_text(rest))
    taken = (*CONDITION_KEYS, "outcome", SETTINGS, "units")
    refuse_names(sheet, [name for name in sheet.names if name in taken], "a name other than " + ", ".join(taken))
    spelled = map(title, sheet.names, sheet.units)
    arrays |= dict(zip(spelled, sheet.columns, strict=True))
    made = streams.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for name, values in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, values, allow_pickle=False)
    return made.getvalue()
