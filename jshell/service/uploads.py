"""Files that were uploaded: kept once, by their content."""

import hashlib
import time
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


class Uploads:
    """The files in a database.

    Args:
        database: Where.
    """

    def __init__(self, database: Database) -> None:
        self.database = database

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

    def _require(self, connection: sa.Connection, wanted: Sequence[str]) -> None:
        """Refuse names of files that were never uploaded.

        Raises:
            NotFound: The first of them.
        """
        found: set[str] = set()
        for at in range(0, len(wanted), TOGETHER):
            part = wanted[at : at + TOGETHER]
            found |= set(connection.execute(sa.select(traces.c.id).where(traces.c.id.in_(part))).scalars())
        for trace in wanted:
            if trace not in found:
                raise unknown(trace)

    def _keep(self, connection: sa.Connection, given: Upload) -> None:
        """Keep a file within the caller's transaction, unless it is there."""
        values = {"id": given.id, "name": given.name, "sha256": given.sha256, "size": len(given.content)}
        if self._made(connection, traces, values) is not None:
            connection.execute(contents.insert().values(trace=given.id, content=given.content))

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
