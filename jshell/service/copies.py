"""Copies of SQLite's file: taken while others write, looked at before they are trusted, put back beside nothing.

What is new stands in a log beside the file, so that copying the two, one after the other, may lose what was kept in
between. SQLite's own backup reads both as of one moment.

Source     SQLite documentation: Online Backup API
"""

import contextlib
import hashlib
import json
import os
import secrets
import sqlite3
from pathlib import Path

from jshell.errors import BadStore, BadValue, StoreUnavailable
from jshell.service.database import left_behind, parsed, refuse_left_behind, shown, what_else
from jshell.service.tables import DONE, STATES, STEPS

PATIENCE = 60.0  # [s] that a copy waits for somebody who holds the database


def backup(url: str, copy: Path) -> dict[str, int]:
    """Copy a database while it is in use; what the copy holds, which was looked at.

    Args:
        url: Of the database.
        copy: A file that is not there yet.

    Raises:
        BadValue: No SQLite file, or a copy that is there already.
        BadStore: It is not sound, or not jshell's.
        StoreUnavailable: It cannot be read, or the copy not be written.
    """
    return _copied(_file(url, "pg_dump --format=custom --file=jobs.dump"), copy)


def restore(copy: Path, url: str) -> dict[str, int]:
    """Put a copy where there is no database yet.

    Raises:
        BadValue, BadStore, StoreUnavailable: As `backup`.
    """
    return _copied(copy, _file(url, "pg_restore --dbname=jshell jobs.dump"))


def check(copy: Path) -> dict[str, int]:
    """Look at a copy, every page and every upload; jobs by state, traces and results.

    Raises:
        BadStore: It is not sound, or not jshell's.
        StoreUnavailable: It cannot be read.
    """
    place = f"copy {str(copy)!r}"
    try:
        with contextlib.closing(_opened(copy, "ro")) as found:
            words = _fault(found)
            if words:
                raise sqlite3.DatabaseError(words)
            jobs = dict(found.execute("SELECT state, count(*) FROM jobs GROUP BY state"))
            counts = {
                name: found.execute(f"SELECT count(*) FROM {name}").fetchone()[0] for name in ("traces", "results")
            }
            return {state: jobs.get(state, 0) for state in STATES} | counts
    except sqlite3.DatabaseError as error:
        raise _in_words(place, error) from None


def _fault(copy: sqlite3.Connection) -> str:
    """What is wrong with a copy; empty where nothing is."""
    words = copy.execute("PRAGMA integrity_check(1)").fetchone()[0]
    if words != "ok":
        return words
    if words := what_else(copy):
        return words
    if not copy.execute("SELECT 1 FROM sqlite_master WHERE name = 'jobs'").fetchone():
        return "a database of something else"
    if copy.execute("SELECT max(number) FROM migrations").fetchone()[0] > len(STEPS):
        return "tables of a later jshell"
    if copy.execute("PRAGMA foreign_key_check").fetchone():
        return "rows whose others are missing"
    kept = copy.execute("SELECT sha256, content FROM traces LEFT JOIN contents ON trace = id")
    for sha, content in kept:
        if not isinstance(content, bytes) or hashlib.sha256(content).hexdigest() != sha:
            return "an upload that is not what it was"
    return _fault_of_jobs(copy)


def _fault_of_jobs(copy: sqlite3.Connection) -> str:
    """What the jobs name and the copy lacks, of which the tables know nothing; empty where nothing is."""
    known = {id for (id,) in copy.execute("SELECT id FROM traces")}
    made = {job for (job,) in copy.execute("SELECT DISTINCT job FROM results")}
    for id, state, *texts in copy.execute("SELECT id, state, traces, specification, coalesce(error, '{}') FROM jobs"):
        try:
            named, words, error = map(json.loads, texts)
            lost = not known.issuperset(named)
        except (ValueError, TypeError, RecursionError):
            return f"job {id} that cannot be read"
        if state not in STATES or not (isinstance(words, dict) and isinstance(error, dict)):
            return f"job {id} that cannot be read"
        if lost:
            return f"job {id} whose traces are missing"
        if state == DONE and id not in made:
            return f"job {id} that is done, without a result"
    return ""


def _copied(source: Path, target: Path) -> dict[str, int]:
    part = target.with_name(f"{target.name}.{secrets.token_hex(4)}.part")  # of this copy: another may be on its way
    try:
        _refuse_taken(target)
        with contextlib.closing(_opened(source, "rw")) as given, contextlib.closing(_opened(part, "rwc")) as made:
            given.backup(made)
            made.execute("PRAGMA journal_mode = DELETE").close()  # one file, without a log beside it
        counts = check(part)
        _refuse_taken(target)
        _place(part, target)
    except (sqlite3.DatabaseError, OSError) as error:
        raise _in_words(f"copy of {str(source)!r}", error) from None
    finally:
        part.unlink(missing_ok=True)
    return counts


def _refuse_taken(target: Path) -> None:
    """Refuse a name that is taken, or beside which a database that is gone has left its log.

    Raises:
        BadValue: It is.
    """
    if os.path.lexists(target):
        raise _taken(target)
    refuse_left_behind(left_behind(target))


def _place(part: Path, target: Path) -> None:
    """Give a file its name, unless somebody else has taken that meanwhile."""
    try:
        os.link(part, target)  # refused where the name is taken, which `rename` is not
    except FileExistsError:
        raise _taken(target) from None
    except OSError:  # a disk without links
        _refuse_taken(target)
        part.rename(target)


def _taken(target: Path) -> BadValue:
    return BadValue(
        f"file {str(target)!r}", found="a file", expected="none of this name",
        remedy="Name another one: nothing is written over.",
    )  # fmt: skip


def _opened(path: Path, mode: str) -> sqlite3.Connection:
    return sqlite3.connect(f"{path.absolute().as_uri()}?mode={mode}", uri=True, timeout=PATIENCE)


def _file(url: str, instead: str) -> Path:
    found = parsed(url)
    if found is None or found.get_backend_name() != "sqlite" or found.database in (None, "", ":memory:"):
        raise BadValue("db", found=shown(url), expected="sqlite:///FILE", remedy=f"For PostgreSQL use `{instead}`.")
    return Path(found.database)


def _in_words(place: str, error: Exception) -> BadStore | StoreUnavailable:
    # a statement that does not suit is the file's fault, not the disk's; what has no code cannot be read as a text
    unsuited = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) == sqlite3.SQLITE_ERROR
    if isinstance(error, OSError) or (isinstance(error, sqlite3.OperationalError) and not unsuited):
        remedy = "Check its name, its folder and the room on the disk."
        return StoreUnavailable(place, found=str(error), expected="files that can be read and written", remedy=remedy)
    return BadStore(place, found=str(error), expected="a sound copy", remedy="Take another copy.")
