"""One database behind one door: opened, checked, and its faults put into words.

SQLite writes ahead and waits for the disk (WAL, synchronous FULL): what was
acknowledged survives the loss of power. Writers of one process queue here, for
SQLite wakes its own in no order. PostgreSQL keeps the time itself, for several
machines have several clocks.
"""

import contextlib
import os
import re
import sqlite3
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import sqlalchemy as sa
from sqlalchemy import event, exc
from sqlalchemy.engine import make_url

from jshell.errors import BadStore, BadValue, JshellError, StoreUnavailable, require_extra
from jshell.service import tables
from jshell.service.log import log
from jshell.service.statements import SERVER_CLOCK

PAGE = 16384  # bytes of a page of a new SQLite file: a large upload is written in a quarter of the pieces
SET_UP = (f"page_size = {PAGE}", "journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON")
PATIENCE = 10.0  # [s] that a writer waits for another one
MAGIC = b"SQLite format 3\0"
REMOTE = frozenset({"nfs", "nfs4", "cifs", "smb3", "smbfs", "afs", "ceph", "glusterfs", "lustre", "fuse.sshfs"})
BESIDE = ("-wal", "-shm", "-journal")  # what SQLite keeps beside a database, and takes for that of any of its name
DAMAGED = ("malformed", "not a database", "corrupt")


class Database:
    """A database that is up to date.

    Args:
        url: `sqlite:///file.db`, or `postgresql+psycopg://…`.

    Raises:
        BadValue: Another kind of address, or SQLite on a network file system.
        BadStore: Damaged, not jshell's, or of a later jshell; the file was not touched.
        StoreUnavailable: Not to be reached, read-only, full or locked.
    """

    def __init__(self, url: str) -> None:
        found = parsed(url)
        kind = "" if found is None else found.get_backend_name()
        if found is None or kind not in ("sqlite", "postgresql"):
            raise _no_address(shown(url))
        self.url = found
        self.sqlite = kind == "sqlite"
        self.place = f"database {self.url.render_as_string(hide_password=True)!r}"
        self._turn, self._closed = threading.Lock(), False
        with self._driver_agrees():
            self._engine = self._open_file(self.url) if self.sqlite else self._reach(self.url)
        event.listen(self._engine, "checkin", self._returned)
        try:
            with self._driver_agrees(), self._in_words(), self._engine.connect():
                pass
            with self.writing() as connection:
                if not self.sqlite:  # two servers that start at once: one of them makes the tables
                    connection.execute(sa.select(sa.func.pg_advisory_xact_lock(tables.APPLICATION)))
                last = tables.migrate(connection, time.time())
            if last > len(tables.STEPS):
                raise BadStore(
                    self.place,
                    found=f"step {last} of the tables",
                    expected=f"at most {len(tables.STEPS)}",
                    remedy="A later jshell has written here: start that one.",
                )
        except BaseException:
            self.close()
            raise
        self.place = "database"  # where it lies is for its keeper only, who has started it

    @contextlib.contextmanager
    def _driver_agrees(self) -> Iterator[None]:
        """Only the driver knows what may stand behind a question mark, and says so when it connects.

        Raises:
            BadValue: It refuses the address.
        """
        try:
            yield
        except JshellError:
            raise
        except (exc.ArgumentError, exc.ProgrammingError, TypeError, ValueError) as error:
            raise _no_address(f"{self.place} ({str(error).splitlines()[0]})") from None

    def close(self) -> None:
        """Let go of every connection; one still in use is closed when its user returns it."""
        self._closed = True
        self._engine.dispose()

    def _returned(self, _, record: sa.pool.ConnectionPoolEntry) -> None:
        """A pool that was disposed of would keep what comes back to it open until it is collected."""
        if self._closed:
            record.invalidate()

    @property
    def clock(self) -> sa.ColumnElement[float]:
        """The time now [s since 1970], as the database is to use it."""
        if self.sqlite:
            return sa.literal(time.time(), sa.Double())
        return SERVER_CLOCK

    @contextlib.contextmanager
    def reading(self) -> Iterator[sa.Connection]:
        """A transaction that only looks."""
        with self._in_words(), self._engine.connect() as connection:
            yield connection

    @contextlib.contextmanager
    def writing(self) -> Iterator[sa.Connection]:
        """A transaction: all of it is kept on the disk when the block ends, or none."""
        if not self.sqlite:
            with self._in_words(), self._engine.begin() as connection:
                yield connection
            return
        if not self._turn.acquire(timeout=PATIENCE):
            raise self._unavailable("other writers that do not end")
        try:
            with self._in_words(), self._engine.connect() as connection:
                connection = connection.execution_options(jshell_writes=True)
                with connection.begin():
                    yield connection
        finally:
            self._turn.release()

    def _open_file(self, url: sa.URL) -> sa.Engine:
        name = url.database
        if not name or name == ":memory:":
            raise BadValue(
                "db", found="no file", expected="a file, in which jobs survive", remedy="Write sqlite:///jshell.db"
            )
        path = Path(name)
        _refuse_network(path)
        left = left_behind(path)  # before the file is looked for: another server that makes it begins with the file
        try:
            there, has_folder = path.exists(), path.parent.is_dir()
        except OSError as error:  # a folder on the way may not be entered
            raise self._unavailable(error.strerror or str(error)) from None
        if there:
            self._look_inside(path)
        elif not has_folder:
            raise self._unavailable(f"no folder {str(path.parent)!r}")
        else:
            refuse_left_behind(left)
        engine = sa.create_engine(
            url, pool_size=8, max_overflow=56, connect_args={"timeout": PATIENCE, "check_same_thread": False}
        )

        @event.listens_for(engine, "connect")
        def set_up(connection: sqlite3.Connection, _) -> None:
            connection.isolation_level = None  # transactions begin where the listener below says
            for pragma in SET_UP:
                _set(connection, pragma)

        @event.listens_for(engine, "begin")
        def begin(connection: sa.Connection) -> None:
            writes = connection.get_execution_options().get("jshell_writes", False)
            connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")

        return engine

    def _look_inside(self, path: Path) -> None:
        """Refuse a file that is not ours or is damaged, before anything is written to it."""
        try:
            with path.open("rb") as file:
                head = file.read(100)
        except OSError as error:
            raise self._unavailable(error.strerror or str(error)) from None
        if not head:
            return  # made by `touch`, or by a server that was killed at once
        remedy = "Name another file for the jobs; this one was not touched."
        if not head.startswith(MAGIC):
            raise BadStore(self.place, found="a file that is no database", expected="jshell's jobs", remedy=remedy)
        spoiled = "Keep a copy of it, put back a backup, or name a new file; this one was not touched."
        log = Path(f"{path}-wal")
        # where nobody has it open, it is looked at as if it could not change: nothing is written beside it
        for mode in ("mode=ro",) if log.exists() else ("immutable=1", "mode=ro"):
            try:
                found, strange = _state(path, mode)
            except sqlite3.OperationalError as error:
                raise self._unavailable(str(error)) from None
            except sqlite3.DatabaseError as error:
                found, strange = str(error), ""
            if found == "ok" or not log.exists():  # else somebody has opened it meanwhile: look again
                break
        if found != "ok":
            raise BadStore(self.place, found=found, expected="a sound database", remedy=spoiled)
        if strange:
            raise BadStore(self.place, found=strange, expected="jshell's jobs", remedy=remedy)

    def _reach(self, url: sa.URL) -> sa.Engine:
        require_extra(url.get_dialect().driver, "service", "db")
        return sa.create_engine(
            url, pool_size=8, max_overflow=56, pool_pre_ping=True, connect_args={"connect_timeout": int(PATIENCE)}
        )

    @contextlib.contextmanager
    def _in_words(self) -> Iterator[None]:
        try:
            yield
        except (exc.IntegrityError, exc.ProgrammingError, exc.DataError, exc.NotSupportedError):
            raise  # our own mistakes, not the database's state
        except exc.DBAPIError as error:
            words = str(error.orig).strip().splitlines()[0] if str(error.orig).strip() else type(error.orig).__name__
            if any(mark in words for mark in DAMAGED):
                raise BadStore(
                    self.place,
                    found=words,
                    expected="a sound database",
                    remedy="Stop the service, keep a copy of the file, and put back a backup.",
                ) from error
            raise self._unavailable(words) from error
        except exc.TimeoutError as error:
            raise self._unavailable("every connection in use") from error

    def _unavailable(self, words: str) -> StoreUnavailable:
        if self.place == "database":
            log.warning("the database: %s", words)
            # paths and names in quotation marks are nobody's business; "disk I/O error" is no path
            words = re.sub(r"(?<![\w.])(?!I/O\b)[\w.]*/\S+|\"[^\"]*\"", "…", words)
        remedy = "Check that it can be reached and written, then try again; nothing that was accepted is lost."
        for mark, advice in _ADVICE if self.sqlite else _ADVICE_OF_SERVERS:
            if mark in words:
                remedy = f"{advice} Nothing that was accepted is lost."
        return StoreUnavailable(self.place, found=words, expected="a database that can be written", remedy=remedy)


_ADVICE = (
    ("disk is full", "Free some space on its disk, then try again."),
    ("disk I/O", "Free some space on its disk, or check the disk, then try again."),
    ("readonly", "Make the file and its folder writable for this user, or name another file."),
    ("read-only", "Make the file and its folder writable for this user, or name another file."),
    ("unable to open", "Make the folder writable for this user, or name another file."),
    ("locked", "Another program holds it: end that program, then try again."),
)
_ADVICE_OF_SERVERS = (
    ("No space left", "Free some space on its disk, then try again."),
    ("read-only", "It only reads, as one that stands by for another does: name the one that writes."),
)


def parsed(url: str) -> sa.URL | None:
    """The address of a database that there is a driver for; None where it is none."""
    try:
        found = make_url(url)
        return None if found.get_dialect().is_async else found
    except (exc.ArgumentError, ValueError):  # a port that is no number
        return None


def shown(url: str) -> str:
    """An address as a message may repeat it."""
    return repr(re.sub(r"(?<=:)[^:@/]+(?=@)", "***", url))


def _no_address(found: str) -> BadValue:
    return BadValue(
        "db", found=found, expected="sqlite:///file.db or postgresql+psycopg://user@host/database",
        remedy="Write sqlite:///jshell.db for a file in this folder.",
    )  # fmt: skip


def what_else(connection: sqlite3.Connection) -> str:
    """What a file is if it is not jshell's; empty where it is, or where nothing is in it yet.

    A name alone says little: another program's table may be called `jobs`, or `migrations`.
    """
    names = {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if not names:
        return ""
    other = f"a database of something else (tables {', '.join(sorted(names)[:5])})"
    columns = lambda name: {row[1] for row in connection.execute(f"PRAGMA table_info({name})")}  # noqa: E731
    if not _columns(tables.migrations) <= columns("migrations"):
        return other
    last = connection.execute("SELECT max(number) FROM migrations").fetchone()[0]
    if last is None:  # another server has begun it just now
        return "" if names == {"migrations"} else other
    if not isinstance(last, int) or last < 1:
        return other
    if last > len(tables.STEPS):
        return ""  # a later jshell's, which is told elsewhere
    made = [one for one in tables.metadata.sorted_tables if one is not tables.sessions or last == len(tables.STEPS)]
    return "" if all(_columns(one) <= columns(one.name) for one in made) else other


def _columns(table: sa.Table) -> set[str]:
    return {column.name for column in table.columns}


def _set(connection: sqlite3.Connection, pragma: str) -> None:
    """One setting, waited for: of two that begin a write-ahead log at once, SQLite refuses one without waiting."""
    until = time.monotonic() + PATIENCE
    while True:
        try:
            return connection.execute(f"PRAGMA {pragma}").close()
        except sqlite3.OperationalError as error:
            if "locked" not in str(error) or time.monotonic() > until:
                raise
            time.sleep(0.01)


def _state(path: Path, mode: str) -> tuple[str, str]:
    """`ok` or what is wrong with a file, and what else it is if it is not jshell's."""
    with contextlib.closing(sqlite3.connect(f"{path.absolute().as_uri()}?{mode}", uri=True)) as connection:
        connection.execute(f"PRAGMA busy_timeout = {int(1000 * PATIENCE)}").close()
        strange = what_else(connection)
        return connection.execute("PRAGMA quick_check(1)").fetchone()[0], strange


def left_behind(path: Path) -> list[Path]:
    """What a database of this name has left beside it."""
    return [beside for beside in (path.with_name(path.name + tail) for tail in BESIDE) if os.path.lexists(beside)]


def refuse_left_behind(left: Sequence[Path]) -> None:
    """Refuse to make a database where another one has left its log, which may hold jobs that the file lacks.

    Raises:
        BadValue: It has.
    """
    if left:
        raise BadValue(
            f"file {str(left[0]).rpartition('-')[0]!r}",
            found=f"what another database has left beside it ({', '.join(path.name for path in left)})",
            expected="nothing of this name",
            remedy="Put these beside the file that they belong to, or name another one: SQLite would read them into "
            "the new file, or remove them, and they may hold jobs of the former one.",
        )


def _refuse_network(path: Path) -> None:
    """SQLite's locks do not hold on network file systems.

    Raises:
        BadValue: The file lies on one.
    """
    table = Path("/proc/mounts")
    if not table.exists():
        return
    place, best = path.absolute(), ("", "")
    for line in table.read_text(errors="replace").splitlines():
        point, kind = line.split(" ")[1:3]
        if place.is_relative_to(point) and len(point) >= len(best[0]):
            best = (point, kind)
    if best[1] in REMOTE:
        raise BadValue(
            "db",
            found=f"a file on a network file system ({best[1]})",
            expected="SQLite on a disk of this machine",
            remedy="Name a local file, or use PostgreSQL.",
        )
