"""The tables that hold traces, jobs and their results, and the steps that lead to them.

Every change of a table is a numbered step; a database tells which it has seen.
A step that was ever released is never edited: the next one is added.
"""

import json
from collections.abc import Callable

import sqlalchemy as sa

metadata = sa.MetaData()
QUEUED, RUNNING, DONE, FAILED, CANCELLED = STATES = ("queued", "running", "done", "failed", "cancelled")
APPLICATION = 0x6A736868  # "jshh": SQLite's mark of whose file it is

_NUMBER = sa.BigInteger().with_variant(sa.Integer(), "sqlite")  # SQLite counts up only where it says INTEGER
_BYTES = sa.LargeBinary()
_TIME = sa.Double()  # seconds since 1970

migrations = sa.Table(
    "migrations",
    metadata,
    sa.Column("number", sa.Integer, primary_key=True),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("applied", _TIME, nullable=False),
)

traces = sa.Table(
    "traces",
    metadata,
    sa.Column("number", _NUMBER, primary_key=True, autoincrement=True),
    sa.Column("id", sa.Text, nullable=False, unique=True),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("sha256", sa.Text, nullable=False),
    sa.Column("size", sa.BigInteger, nullable=False),
    sa.Column("created", _TIME, nullable=False),
    sqlite_autoincrement=True,
)

contents = sa.Table(  # apart from `traces`, so that a list of names reads no megabytes
    "contents",
    metadata,
    sa.Column("trace", sa.Text, sa.ForeignKey("traces.id"), primary_key=True),
    sa.Column("content", _BYTES, nullable=False),
)

jobs = sa.Table(
    "jobs",
    metadata,
    sa.Column("number", _NUMBER, primary_key=True, autoincrement=True),
    sa.Column("id", sa.Text, nullable=False, unique=True),
    sa.Column("kind", sa.Text, nullable=False),
    sa.Column("specification", sa.Text, nullable=False),
    sa.Column("traces", sa.Text, nullable=False),
    sa.Column("content", sa.Text, nullable=False),
    sa.Column("state", sa.Text, nullable=False),
    sa.Column("attempt", sa.Integer, nullable=False, server_default="0"),
    sa.Column("deaths", sa.Integer, nullable=False, server_default="0"),
    sa.Column("owner", sa.Text),
    sa.Column("created", _TIME, nullable=False),
    sa.Column("started", _TIME),
    sa.Column("finished", _TIME),
    sa.Column("lease", _TIME),  # until when its owner means to speak again; that it changes is the heartbeat
    sa.Column("progress", sa.Double, nullable=False, server_default="0"),
    sa.Column("error", sa.Text),
    sqlite_autoincrement=True,
)
# in words, not in parameters: PostgreSQL compares this text with the index to know which conflict is meant
LIVE = sa.text(f"state IN ('{QUEUED}', '{RUNNING}', '{DONE}')")
sa.Index("jobs_by_state", jobs.c.state, jobs.c.number)
sa.Index("jobs_once", jobs.c.content, unique=True, sqlite_where=LIVE, postgresql_where=LIVE)

keys = sa.Table(
    "keys",
    metadata,
    sa.Column("key", sa.Text, primary_key=True),
    sa.Column("content", sa.Text, nullable=False),
    sa.Column("job", sa.Text, sa.ForeignKey("jobs.id"), nullable=False),
    sa.Column("created", _TIME, nullable=False),
)

results = sa.Table(
    "results",
    metadata,
    sa.Column("job", sa.Text, sa.ForeignKey("jobs.id"), primary_key=True),
    sa.Column("name", sa.Text, primary_key=True),
    sa.Column("content", _BYTES, nullable=False),
)

sessions = sa.Table(
    "sessions",
    metadata,
    sa.Column("id", sa.Text, primary_key=True),
    sa.Column("ends", _TIME, nullable=False),
)

heartbeats = sa.Table(  # one row, written to learn whether anything can be written
    "pulse",
    metadata,
    sa.Column("number", sa.Integer, primary_key=True),
    sa.Column("beat", _TIME, nullable=False),
)


def _first(connection: sa.Connection) -> None:
    metadata.create_all(connection)
    connection.execute(heartbeats.insert().values(number=1, beat=0.0))


def _errors_apart(connection: sa.Connection) -> None:
    """What was found and what was expected stood in one sentence, `cause`."""
    for number, text in connection.execute(sa.select(jobs.c.number, jobs.c.error).where(jobs.c.error.is_not(None))):
        error = json.loads(text)
        cause = error.pop("cause")
        found, apart, expected = cause.partition("; expected ")
        if apart and found.startswith("found "):
            error |= {"found": found.removeprefix("found "), "expected": expected}
        else:
            error |= {"found": cause, "expected": ""}
        connection.execute(jobs.update().where(jobs.c.number == number).values(error=json.dumps(error)))


def _no_time_to_be_ready(connection: sa.Connection) -> None:
    """A job waited until the clock said `ready`: an hour too long where the clock was set back."""
    if any(column["name"] == "ready" for column in sa.inspect(connection).get_columns("jobs")):
        connection.execute(sa.text("ALTER TABLE jobs DROP COLUMN ready"))


def _sessions(connection: sa.Connection) -> None:
    sessions.create(connection, checkfirst=True)


STEPS: tuple[tuple[str, Callable[[sa.Connection], None]], ...] = (
    ("traces, jobs, keys and results", _first),
    ("what was found and what was expected in an error", _errors_apart),
    ("the order of jobs is that of their numbers", _no_time_to_be_ready),
    ("browsers that have shown the token", _sessions),
)


def migrate(connection: sa.Connection, now: float) -> int:
    """Bring a database up to date, within the caller's transaction.

    Returns:
        The number of the last step; above `len(STEPS)` where a later jshell has written here.
    """
    migrations.create(connection, checkfirst=True)
    seen = connection.execute(sa.select(sa.func.max(migrations.c.number))).scalar() or 0
    for number, (name, step) in enumerate(STEPS, 1):
        if number > seen:
            step(connection)
            connection.execute(migrations.insert().values(number=number, name=name, applied=now))
    return max(seen, len(STEPS))
