"""Files that were uploaded: kept once, by their content."""

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from jshell.errors import NotFound
from jshell.service.database import Database
from jshell.service.tables import contents, traces

TOGETHER = 500  # names in one query
NAMES = 100_000  # of uploads that are known to exist
RECENT = 64 * 2**20  # bytes of the latest uploads that stay in memory


@dataclass(frozen=True)
class TraceRow:
    """What is known of an uploaded file.

    Attributes:
        id: Its name; follows from content and suffix.
        name: As the file was called when it first came.
        sha256: Of its bytes.
        size: Bytes.
        created: When it came [s since 1970].
    """

    id: str
    name: str
    sha256: str
    size: int
    created: float


@dataclass(frozen=True)
class Upload:
    """A file that is to be kept.

    Attributes:
        name: As its owner calls it.
        content: Its bytes.
        sha256: Of these.
        id: Follows from content and suffix.
    """

    name: str
    content: bytes
    sha256: str
    id: str

    @staticmethod
    def of(name: str, content: bytes) -> "Upload":
        """A file by its name and bytes; the suffix tells the format: the same bytes may mean something else."""
        digest = hashlib.sha256(content).hexdigest()
        key = hashlib.sha256(f"{PurePath(name).suffix.lower()}\0{digest}".encode()).hexdigest()
        return Upload(name, content, digest, key[:32])


class Recent:
    """The latest uploads, still in memory when a worker of this process asks for them; names of those that exist."""

    def __init__(self) -> None:
        self._kept: OrderedDict[str, tuple[str, bytes]] = OrderedDict()
        self._bytes = 0
        self._known: set[str] = set()
        self._turn = threading.Lock()

    def keep(self, given: Upload, name: str) -> None:
        """A file that is on the disk, by the name it has there; the oldest give way."""
        with self._turn:
            if given.id in self._kept or len(given.content) > RECENT:
                return
            self._kept[given.id] = (name, given.content)
            self._bytes += len(given.content)
            while self._bytes > RECENT:
                self._bytes -= len(self._kept.popitem(last=False)[1][1])

    def all(self, wanted: Sequence[str]) -> list[tuple[str, bytes]] | None:
        """Name and bytes of files, where every one of them is here."""
        with self._turn:
            found = [self._kept.get(trace) for trace in wanted]
        return None if None in found else [one for one in found if one is not None]

    def require(self, connection: sa.Connection, wanted: Sequence[str]) -> None:
        """Refuse names of files that were never uploaded; one that was found once is there for ever.

        Raises:
            NotFound: The first of them.
        """
        asked = [trace for trace in wanted if trace not in self._known]
        found: set[str] = set()
        for at in range(0, len(asked), TOGETHER):
            part = asked[at : at + TOGETHER]
            found |= set(connection.execute(sa.select(traces.c.id).where(traces.c.id.in_(part))).scalars())
        for trace in asked:
            if trace not in found:
                raise unknown(trace)
        with self._turn:
            if len(self._known) > NAMES:
                self._known.clear()
            self._known |= found


def add(database: Database, given: Upload) -> TraceRow:
    """Keep a file; the same bytes under the same suffix are kept once."""
    asked = sa.select(traces).where(traces.c.id == given.id)
    with database.reading() as connection:
        row = connection.execute(asked).one_or_none()
    if row is None:
        with database.writing() as connection:
            keep(database, connection, given)
            row = connection.execute(asked).one()
    return _row(row)


def keep(database: Database, connection: sa.Connection, given: Upload) -> str:
    """Keep a file within the caller's transaction; the name under which it is kept, its first."""
    dialect = sqlite if database.sqlite else postgresql
    size, now = len(given.content), database.clock
    insert = dialect.insert(traces).values(id=given.id, name=given.name, sha256=given.sha256, size=size, created=now)
    insert = insert.on_conflict_do_nothing(index_elements=[traces.c.id]).returning(traces.c.id)
    if connection.execute(insert).scalar() is not None:
        connection.execute(contents.insert().values(trace=given.id, content=given.content))
        return given.name
    return connection.execute(sa.select(traces.c.name).where(traces.c.id == given.id)).scalar_one()


def one(database: Database, trace: str) -> TraceRow:
    """What is known of a file.

    Raises:
        NotFound: No such file.
    """
    with database.reading() as connection:
        row = connection.execute(sa.select(traces).where(traces.c.id == trace)).one_or_none()
    if row is None:
        raise unknown(trace)
    return _row(row)


def content(database: Database, trace: str) -> bytes:
    """The bytes of a file.

    Raises:
        NotFound: No such file.
    """
    return files(database, [trace])[0][1]


def files(database: Database, wanted: Sequence[str]) -> list[tuple[str, bytes]]:
    """Name and bytes of many files, in their order.

    Raises:
        NotFound: No such file.
    """
    asked = sa.select(traces.c.id, traces.c.name, contents.c.content).join(contents, contents.c.trace == traces.c.id)
    found: dict[str, tuple[str, bytes]] = {}
    with database.reading() as connection:
        for at in range(0, len(wanted), TOGETHER):
            for row in connection.execute(asked.where(traces.c.id.in_(wanted[at : at + TOGETHER]))):
                found[row.id] = (row.name, bytes(row.content))
    for name in wanted:
        if name not in found:
            raise unknown(name)
    return [found[name] for name in wanted]


def some(database: Database, limit: int, before: str | None) -> list[TraceRow]:
    """Files, the newest first; those before one.

    Raises:
        NotFound: No such file to be before.
    """
    asked = sa.select(traces).order_by(traces.c.number.desc()).limit(limit)
    with database.reading() as connection:
        if before is not None:
            number = connection.execute(sa.select(traces.c.number).where(traces.c.id == before)).scalar()
            if number is None:
                raise unknown(before)
            asked = asked.where(traces.c.number < number)
        return [_row(row) for row in connection.execute(asked)]


def unknown(trace: str) -> NotFound:
    return NotFound(
        f"trace {trace!r}", found="no such trace", expected="the id of an upload", remedy="Upload the trace first."
    )


def _row(row: Any) -> TraceRow:
    return TraceRow(row.id, row.name, row.sha256, row.size, row.created)
