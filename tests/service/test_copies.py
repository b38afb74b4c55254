"""Copies of a database: all of one moment, looked at, and never written over or mixed with another's."""

import contextlib
import os
import sqlite3

import pytest

from jshell.errors import BadStore, BadValue, StoreUnavailable
from jshell.service import copies
from jshell.service.store import Store


def test_a_copy_is_looked_at_and_put_beside_nothing(tmp_path):
    url, copy, other = f"sqlite:///{tmp_path / 'jobs.db'}", tmp_path / "copy", f"sqlite:///{tmp_path / 'other.db'}"
    store = Store.open(url)
    trace = store.add_trace("a.csv", b"content")
    job = store.submit("fit", {}, [trace.id]).job
    found = copies.backup(url, copy)
    assert (found["queued"], found["traces"], found["results"]) == (1, 1, 0)
    store.submit("simulate", {}, [])
    assert copies.check(copy) == copies.restore(copy, other) == found  # as of that moment
    for again in (lambda: copies.backup(url, copy), lambda: copies.restore(copy, other)):
        with pytest.raises(BadValue, match="nothing is written over"):
            again()
    restored = Store.open(other)
    assert [row.id for row in restored.jobs()] == [job.id]
    assert restored.trace_content(trace.id) == b"content"
    restored.close()
    store.close()
    assert sorted(one.name for one in tmp_path.iterdir()) == ["copy", "jobs.db", "other.db"]
    with contextlib.closing(sqlite3.connect(copy)) as connection, connection:
        connection.execute("UPDATE contents SET content = x'00'")
    with pytest.raises(BadStore, match="not what it was"):
        copies.check(copy)
    copy.write_bytes(copy.read_bytes()[:20000])
    with pytest.raises(BadStore, match="Take another"):
        copies.restore(copy, f"sqlite:///{tmp_path / 'third.db'}")
    assert not (tmp_path / "third.db").exists()
    with pytest.raises(StoreUnavailable, match="Check its name"):
        copies.check(tmp_path / "nothing")


@pytest.mark.parametrize("tail", ["-wal", "-shm", "-journal"])
def test_nothing_is_put_beside_what_another_database_has_left(tmp_path, tail):
    """SQLite reads a log into any database of its name: what was put back had become the one that was lost."""
    url, copy, target = f"sqlite:///{tmp_path / 'jobs.db'}", tmp_path / "copy", tmp_path / "lost.db"
    Store.open(url).close()
    copies.backup(url, copy)
    left = tmp_path / f"lost.db{tail}"
    left.write_bytes(b"of another one")
    for attempt in (lambda: copies.restore(copy, f"sqlite:///{target}"), lambda: copies.backup(url, target)):
        with pytest.raises(BadValue, match=f"lost.db{tail}.*Put these beside"):
            attempt()
    assert left.read_bytes() == b"of another one"
    assert sorted(one.name for one in tmp_path.iterdir()) == ["copy", "jobs.db", left.name]


@pytest.mark.parametrize("tail", ["", "-wal"])
def test_a_file_that_appears_while_a_copy_is_made_stays(tmp_path, monkeypatch, tail):
    url, target = f"sqlite:///{tmp_path / 'jobs.db'}", tmp_path / "copy"
    Store.open(url).close()
    look, other = copies.check, tmp_path / f"copy{tail}"

    def meanwhile(part):
        other.write_bytes(b"somebody else's")
        return look(part)

    monkeypatch.setattr(copies, "check", meanwhile)
    with pytest.raises(BadValue, match=r"(?i)name another"):
        copies.backup(url, target)
    assert other.read_bytes() == b"somebody else's"
    assert sorted(one.name for one in tmp_path.iterdir()) == [other.name, "jobs.db"]


def test_two_copies_of_one_name_do_not_mix(tmp_path, monkeypatch):
    url, target = f"sqlite:///{tmp_path / 'jobs.db'}", tmp_path / "copy"
    Store.open(url).close()
    look, link = copies.check, os.link
    monkeypatch.setattr(
        copies, "check", lambda part: look(part) and (monkeypatch.undo(), copies.backup(url, target))[1]
    )
    with pytest.raises(BadValue, match="nothing is written over"):
        copies.backup(url, target)
    assert sum(copies.check(target).values()) == 0
    target.unlink()
    late = lambda part, target: (target.touch(), link(part, target))  # noqa: E731
    monkeypatch.setattr(os, "link", late)  # between the last look and the name
    with pytest.raises(BadValue, match="nothing is written over"):
        copies.backup(url, target)
    target.unlink()

    def none(*_):
        raise PermissionError("Operation not permitted")

    monkeypatch.setattr(os, "link", none)  # a disk that has no links
    assert copies.backup(url, target) == look(target)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["copy", "jobs.db"]


SPOILED = {
    "DELETE FROM contents; DELETE FROM traces": "job .* whose traces are missing",
    "UPDATE jobs SET state = 'done'": "job .* done, without a result",
    "UPDATE jobs SET state = 'gone'": "job .* cannot be read",
    "UPDATE jobs SET traces = '[[1]]'": "job .* cannot be read",
    "UPDATE jobs SET specification = '{'": "job .* cannot be read",
    "UPDATE jobs SET error = '5'": "job .* cannot be read",
    "UPDATE contents SET content = 'text'": "not what it was",
    "UPDATE traces SET name = CAST(x'ff' AS TEXT); UPDATE jobs SET id = CAST(x'ff' AS TEXT)": "sound copy",
    "UPDATE migrations SET number = number + 1000": "a later jshell",
    "DROP TABLE pulse": "something else",
}
FOREIGN = {
    "no steps": "migrations (number, name, applied); CREATE TABLE jobs (state)",
    "steps in words": "migrations (number, name, applied); INSERT INTO migrations VALUES ('first', 'a', 0)",
    "other columns": "migrations (id, applied)",
    "nothing of ours": "thesis (page)",
}


@pytest.mark.parametrize(("change", "words"), SPOILED.items(), ids=range(len(SPOILED)))
def test_a_copy_that_lacks_what_its_jobs_name_is_not_sound(tmp_path, change, words):
    path = tmp_path / "jobs.db"
    with contextlib.closing(Store.open(f"sqlite:///{path}")) as store:
        store.submit("fit", {}, [store.add_trace("a.csv", b"content").id])
    copies.check(path)
    with contextlib.closing(sqlite3.connect(path)) as connection, connection:
        connection.executescript(change)
    with pytest.raises(BadStore, match=words):
        copies.check(path)


@pytest.mark.parametrize("made", FOREIGN.values(), ids=FOREIGN)
def test_a_file_of_another_program_is_told_as_that(tmp_path, made):
    path = tmp_path / "other.db"
    with contextlib.closing(sqlite3.connect(path)) as connection, connection:
        connection.executescript(f"CREATE TABLE {made}")
    for look in (copies.check, lambda path: Store.open(f"sqlite:///{path}")):
        with pytest.raises(BadStore, match=r"something else \(tables"):
            look(path)


ODD = ["://", "foo://bar:baz/", "foo://u:secret@h/", "sqlite+aiosqlite:///x.db", "postgresql+none://h/db"]
REFUSED = ["sqlite:///x.db?timeout=soon", "postgresql+psycopg:///db?host=/none&mood=good"]


@pytest.mark.parametrize("db", ODD + REFUSED)
def test_an_address_that_is_none_is_refused_in_words(tmp_path, monkeypatch, db):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadValue, match="sqlite:///") as found:
        Store.open(db)
    assert "secret" not in str(found.value)
    assert not list(tmp_path.iterdir())
    if db in ODD:
        for attempt in (lambda: copies.backup(db, tmp_path / "copy"), lambda: copies.restore(tmp_path / "copy", db)):
            with pytest.raises(BadValue, match="sqlite:///FILE"):
                attempt()


@pytest.mark.parametrize("db", ["postgresql+psycopg://jshell@db/jshell", "jshell.db", "sqlite://"])
def test_what_is_no_file_is_copied_by_its_own_means(tmp_path, db):
    with pytest.raises(BadValue, match="pg_dump"):
        copies.backup(db, tmp_path / "copy")
    with pytest.raises(BadValue, match="pg_restore"):
        copies.restore(tmp_path / "copy", db)
