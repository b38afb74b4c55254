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
        with pytest.raises(BadValue, match=f"lost.db{tail}.*move these away"):
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
    with pytest.raises(BadValue, match="Name another"):
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


@pytest.mark.parametrize("db", ["postgresql+psycopg://jshell@db/jshell", "jshell.db", "sqlite://"])
def test_what_is_no_file_is_copied_by_its_own_means(tmp_path, db):
    with pytest.raises(BadValue, match="pg_dump"):
        copies.backup(db, tmp_path / "copy")
    with pytest.raises(BadValue, match="pg_restore"):
        copies.restore(tmp_path / "copy", db)
