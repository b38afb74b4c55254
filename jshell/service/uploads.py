"""Files that were uploaded: kept once, by their content."""

import hashlib
import threading
import time
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import sqlalchemy as sa

from jshell.errors import NotFound
from jshell.service import statements
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


class Uploads:
    """The files in a database.

    Args:
        database: Where.
    """

    def __init__(self, database: Database) -> None:
        self.database, self._recent = database, Recent()

    def add_trace(self, name: str, content: bytes) -> TraceRow:
        """Keep an uploaded file; the same bytes under the same suffix are kept once.

        Raises:
            StoreUnavailable: Nothing was kept.
        """
        given = Upload.of(name, content)
        asked = sa.select(traces).where(traces.c.id == given.id)
        with self.database.reading() as connection:
            row = connection.execute(asked).one_or_none()
        if row is None:
            with self.database.writing() as connection:
                self._keep(connection, given)
                row = connection.execute(asked).one()
        self._recent.keep(given, row.name)
        return _row(row)

    def trace(self, trace: str) -> TraceRow:
        """What is known of an upload.

        Raises:
            NotFound: No such trace.
        """
        with self.database.reading() as connection:
            row = connection.execute(sa.select(traces).where(traces.c.id == trace)).one_or_none()
        if row is None:
            raise unknown(trace)
        return _row(row)

    def trace_content(self, trace: str) -> bytes:
        """The bytes of an upload.

        Raises:
            NotFound: No such trace.
        """
        return self.files([trace])[0][1]

    def files(self, wanted: Sequence[str]) -> list[tuple[str, bytes]]:
        """Name and bytes of many uploads, in their order.

        Raises:
            NotFound: No such trace.
        """
        recent = self._recent.all(wanted)
        if recent is not None:
            return recent
        asked = sa.select(traces.c.id, traces.c.name, contents.c.content).join(
            contents, contents.c.trace == traces.c.id
        )
        found: dict[str, tuple[str, bytes]] = {}
        with self.database.reading() as connection:
            for at in range(0, len(wanted), TOGETHER):
                for row in connection.execute(asked.where(traces.c.id.in_(wanted[at : at + TOGETHER]))):
                    found[row.id] = (row.name, bytes(row.content))
        for name in wanted:
            if name not in found:
                raise unknown(name)
        return [found[name] for name in wanted]

    def traces(self, limit: int = 50, before: str | None = None) -> list[TraceRow]:
        """Uploads, the newest first; those before one.

        Raises:
            NotFound: No such trace to be before.
        """
        asked = sa.select(traces).order_by(traces.c.number.desc()).limit(limit)
        with self.database.reading() as connection:
            if before is not None:
                number = connection.execute(sa.select(traces.c.number).where(traces.c.id == before)).scalar()
                if number is None:
                    raise unknown(before)
                asked = asked.where(traces.c.number < number)
            return [_row(row) for row in connection.execute(asked)]

    def _keep(self, connection: sa.Connection, given: Upload) -> str:
        """Keep a file within the caller's transaction; the name under which it is kept, its first."""
        values = {"id": given.id, "name": given.name, "sha256": given.sha256, "size": len(given.content)}
        if self._made(connection, traces, values) is not None:
            connection.execute(contents.insert().values(trace=given.id, content=given.content))
            return given.name
        return connection.execute(sa.select(traces.c.name).where(traces.c.id == given.id)).scalar_one()

    def _made(self, connection: sa.Connection, table: sa.Table, values: Mapping[str, Any]) -> Any:
        """The row that was inserted now, or None where there is one already."""
        in_file = self.database.sqlite
        clock = {"created": time.time()} if in_file else {}
        return connection.execute(statements.new(table, in_file), {**values, **clock}).one_or_none()


def unknown(trace: str) -> NotFound:
    return NotFound(
        f"trace {trace!r}", found="no such trace", expected="the id of an upload", remedy="Upload the trace first."
    )


def _row(row: Any) -> TraceRow:
    return TraceRow(row.id, row.name, row.sha256, row.size, row.created)
