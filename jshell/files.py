"""A file that need not lie on a disk: its name and its bytes.

An upload, a member of an archive and a file of a folder are read alike. Its
suffix says of which format the bytes are, and errors call the file by its name.
"""

from pathlib import Path, PurePath
from typing import NamedTuple


class NamedBytes(NamedTuple):
    """A name with bytes; a pair, so that it goes through pipes and databases as one.

    Attributes:
        name: As its owner calls the file; only a name: nothing of that name is opened.
        content: What the file holds.

    Example:
        >>> from jshell.files import NamedBytes
        >>> from jshell.io import read_table
        >>> read_table(NamedBytes("ring.csv", b"t,V\\n0,3.5\\n1,3.6\\n"))["V"]
        array([3.5, 3.6])
    """

    name: str
    content: bytes | memoryview

    @property
    def suffix(self) -> str:
        """The suffix of the name in small letters, such as `.csv`."""
        return PurePath(self.name).suffix.lower()

    def __str__(self) -> str:
        return self.name

    def __repr__(self) -> str:
        return f"NamedBytes({self.name!r}, {len(self.content)} bytes)"


Source = str | Path | NamedBytes  # what a reader takes
