"""The store, the same on SQLite and PostgreSQL: accepted means kept, finished means once."""

import contextlib
import json
import sqlite3
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import sqlalchemy as sa

from jshell.errors import BadName, BadStore, BadValue, KeyConflict, NotFound, QueueFull
from jshell.service import tables
from jshell.service.store import JobFailure, Store
from jshell.service.uploads import Upload

WRONG = JobFailure("bad_value", "here", "1", "2", "Try 2.")


def asked(store: Store, number: int = 0, key: str | None = None):
    return store.submit("simulate", {"number": number}, [], key)


def at_once(count: int, call) -> list:
    """Results of a call made by many threads in the same moment."""
    gate = threading.Barrier(count)

    def one(number):
        gate.wait(30)
        return call(number)

    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(one, range(count)))


def test_an_upload_is_kept_once_by_content_and_suffix(store):
    first = store.add_trace("a.csv", b"t,V\n")
    assert store.add_trace("again.CSV", b"t,V\n") == first
    assert store.add_trace("a.json", b"t,V\n").id != first.id
    assert store.trace(first.id) == first
    assert store.trace_content(first.id) == b"t,V\n"
    assert (first.name, first.size) == ("a.csv", 4)
    with pytest.raises(NotFound, match="no such trace"):
        store.trace_content("nothing")


def test_files_that_come_with_a_job_are_kept_if_the_job_is(url):
    store = Store.open(url, queue=1)
    first, second = (Upload.of(f"{number}.csv", bytes([number])) for number in range(2))
    made = store.submit("batch", {}, [first], "key")
    assert made.job.traces == (first.id,)
    assert store.files([first.id]) == [("0.csv", b"\x00")]
    assert store.trace_content(first.id) == b"\x00"
    assert not store.submit("batch", {}, [Upload.of("again.csv", b"\x00")]).created
    store.cancel(made.job.id)
    store.add_trace("2.csv", b"\x02")
    renamed = Upload.of("other.csv", b"\x02")
    assert store.files([store.submit("batch", {}, [renamed]).job.traces[0]]) == [("2.csv", b"\x02")]  # its first name
    with pytest.raises(QueueFull):
        store.submit("batch", {}, [second])
    with pytest.raises(KeyConflict):
        store.submit("batch", {}, [second], "key")
    for call in (store.trace, store.trace_content):
        with pytest.raises(NotFound):
            call(second.id)
    store.close()
    again = Store.open(url)
    assert again.files([first.id]) == [("0.csv", b"\x00")]  # from the disk
    again.close()


def test_a_connection_in_use_while_the_store_closes_is_closed_when_it_comes_back(url):
    store = Store.open(url)
    with store.database.reading() as connection:
        held = connection.connection.driver_connection
        store.close()
        assert connection.execute(sa.select(1)).scalar() == 1  # what was begun may end
    with pytest.raises(Exception, match="closed"):
        held.execute("SELECT 1")


def test_lists_are_paged_from_the_newest(store):
    names = [store.add_trace(f"{number}.csv", bytes([number])).id for number in range(5)]
    assert [row.id for row in store.traces(limit=2)] == names[:2:-1]
    assert [row.id for row in store.traces(limit=9, before=names[2])] == names[1::-1]
    made = [asked(store, number).job.id for number in range(5)]
    assert [row.id for row in store.jobs(limit=2)] == made[:2:-1]
    assert [row.id for row in store.jobs(before=made[2])] == made[1::-1]
    assert store.jobs("done") == []
    for call in (lambda: store.jobs(before="nothing"), lambda: store.traces(before="nothing")):
        with pytest.raises(NotFound):
            call()
    with pytest.raises(BadName, match="queued, running, done"):
        store.jobs("lost")


def test_a_job_from_acceptance_to_result(store):
    trace = store.add_trace("a.csv", b"content")
    made = store.submit("fit", {"seed": 1, "fix": {"alpha1": 3.6}}, [trace.id])
    assert made.created
    assert made.job.state == "queued"
    leased = store.lease("me", 15)
    assert leased.id == made.job.id
    assert (leased.state, leased.attempt, leased.owner) == ("running", 1, "me")
    assert leased.specification == {"seed": 1, "fix": {"alpha1": 3.6}}
    assert leased.traces == (trace.id,)
    assert store.lease("you", 15) is None
    assert store.heartbeat(leased.id, "me", 1)
    assert store.job(leased.id).progress == 0.0
    assert store.finish(leased.id, "me", 1, {"record.json": b"{}", "table.csv": b"\x00\xff"})
    ended = store.job(leased.id)
    assert (ended.state, ended.progress, ended.error) == ("done", 1.0, None)
    assert ended.created <= ended.started <= ended.finished
    assert store.result(leased.id, "table.csv") == b"\x00\xff"
    assert store.result_names(leased.id) == ("record.json", "table.csv")
    assert store.counts() == {"queued": 0, "running": 0, "done": 1, "failed": 0, "cancelled": 0}
    assert store.healthy()
    with pytest.raises(NotFound, match=r"record\.json, table\.csv"):
        store.result(leased.id, "other")
    with pytest.raises(NotFound, match="no such job"):
        store.result("nothing", "record.json")


def test_what_cannot_be_asked_is_refused(store):
    with pytest.raises(BadName, match="fit, batch, simulate"):
        store.submit("exec", {}, [])
    with pytest.raises(BadValue, match="JSON"):
        store.submit("fit", {"x": float("nan")}, [])
    with pytest.raises(BadValue, match="JSON"):
        store.submit("fit", {"x": object()}, [])
    with pytest.raises(NotFound, match="'missing'"):
        store.submit("fit", {}, ["missing"])
    with pytest.raises(NotFound):
        store.cancel("nothing")
    assert store.jobs() == []


def test_a_key_stands_for_one_request(store):
    first = asked(store, 1, "k")
    again = asked(store, 1, "k")
    assert again.job == first.job
    assert not again.created
    with pytest.raises(KeyConflict, match="other than the one"):
        asked(store, 2, "k")
    assert len(store.jobs()) == 1
    leased = store.lease("me", 15)
    store.finish(leased.id, "me", 1, WRONG)
    assert asked(store, 1, "k").job.state == "failed"  # the same request has the same answer


def test_the_same_content_is_the_same_job_unless_it_failed(store):
    first = asked(store).job
    assert asked(store).job.id == first.id
    assert asked(store, key="named").job.id == first.id
    store.lease("me", 15)
    store.finish(first.id, "me", 1, {})
    assert not asked(store).created  # done
    other = asked(store, 1).job
    store.cancel(other.id)
    second = asked(store, 1)
    assert second.created
    assert second.job.id != other.id
    leased = store.lease("me", 15)
    store.finish(leased.id, "me", 1, WRONG)
    assert store.job(leased.id).error == WRONG
    assert asked(store, 1).created


@pytest.mark.parametrize("key", ["k", None])
def test_fifty_submissions_at_once_make_one_job(url, key):
    servers = [Store.open(url) for _ in range(2)]
    found = at_once(50, lambda number: asked(servers[number % 2], 7, key))
    assert len({one.job.id for one in found}) == 1
    assert sum(one.created for one in found) == 1
    assert len(servers[0].jobs()) == 1
    for server in servers:
        server.close()


def test_fifty_keys_for_other_requests_conflict_at_once(url):
    servers = [Store.open(url) for _ in range(2)]

    def one(number):
        try:
            return asked(servers[number % 2], number % 5, "k").job.id
        except KeyConflict:
            return None

    found = at_once(50, one)
    assert len({name for name in found if name}) == 1
    assert found.count(None) == 40
    for server in servers:
        server.close()


def test_a_full_queue_refuses(url):
    store = Store.open(url, queue=3)
    for number in range(3):
        asked(store, number)
    with pytest.raises(QueueFull, match="3 waiting"):
        asked(store, 3)
    assert asked(store, 2).job.state == "queued"  # nothing new
    store.lease("me", 15)
    assert asked(store, 3).created
    store.close()


def test_every_job_is_leased_once(url):
    servers = [Store.open(url) for _ in range(2)]
    made = {asked(servers[0], number).job.id for number in range(60)}

    def take(number):
        found = []
        while (job := servers[number % 2].lease(f"w{number}", 60)) is not None:
            found.append(job.id)
        return found

    found = [name for names in at_once(8, take) for name in names]
    assert len(found) == 60
    assert set(found) == made
    for server in servers:
        server.close()


def test_the_oldest_goes_first(store):
    made = [asked(store, number).job.id for number in range(3)]
    assert [store.lease("me", 15).id for _ in range(3)] == made


def test_who_lost_the_lease_records_nothing(store):
    job = asked(store).job
    store.lease("slow", 15)
    assert silent(store)
    assert store.reap_expired(0.1) == 0
    assert not store.heartbeat(job.id, "slow", 1)
    assert not store.finish(job.id, "slow", 1, {"a": b"late"})
    again = store.lease("slow", 15)  # the same owner: its second attempt is not its first
    assert again.attempt == 2
    assert not store.finish(job.id, "slow", 1, {"a": b"late"})
    assert not store.release(job.id, "slow", 1)
    assert store.finish(job.id, "slow", 2, {"a": b"right"})
    assert not store.finish(job.id, "slow", 2, {"a": b"twice"})
    assert store.result(job.id, "a") == b"right"


def silent(store: Store) -> bool:
    """Whether an observer takes a job from an owner that says nothing."""
    return any(time.sleep(0.04) or store.reap_expired(0.1) for _ in range(8))


def test_a_heartbeat_keeps_the_lease(store, monkeypatch):
    """However the clock is set, and however long it was when it was taken."""
    clock = type(store.database).clock
    job = asked(store).job
    store.lease("me", 0.01)
    for hours in (0, 1, -1, 0, 1, 0):
        moved = property(lambda self, hours=hours: clock.__get__(self) + 3600.0 * hours)
        monkeypatch.setattr(type(store.database), "clock", moved)
        assert store.heartbeat(job.id, "me", 1, seconds=15)
        time.sleep(0.04)
        assert store.reap_expired(0.1) == 0
    assert silent(store)


def test_an_observer_that_was_frozen_itself_begins_anew(store):
    asked(store)
    store.lease("me", 15)
    for _ in range(4):
        assert store.reap_expired(0.05) == 0
        time.sleep(0.1)
    assert silent(store)


def test_no_clock_makes_a_job_wait_or_go_first(store, monkeypatch):
    made = []
    for number, hours in enumerate((1, -1, 0, 2)):
        monkeypatch.setattr(time, "time", lambda hours=hours: 1.8e9 + 3600 * hours + 0.25)
        made.append(asked(store, number).job.id)
    monkeypatch.setattr(time, "time", lambda: 1.8e9 - 7200.5)
    assert [store.lease("me", 15).id for _ in made] == made
    for name in reversed(made):
        assert store.release(name, "me", 1)
    assert [store.lease("me", 15).id for _ in made] == made


def test_a_restart_is_never_the_jobs_fault(store):
    job = asked(store).job
    for attempt in range(1, 6):
        assert store.lease(f"server {attempt}", 15).attempt == attempt
        assert silent(store)
    assert (store.job(job.id).state, store.job(job.id).error) == ("queued", None)


def test_three_deaths_end_a_job_which_may_be_sent_again_under_its_key(store):
    job = asked(store, key="k").job
    for attempt in (1, 2, 3):
        assert store.lease("me", 15).attempt == attempt
        assert store.release(job.id, "me", attempt, died=True)
    ended = store.job(job.id)
    assert (ended.state, ended.error.code) == ("failed", "worker_died")
    assert "worker died" in ended.error.cause
    assert store.lease("me", 15) is None
    again = asked(store, key="k")
    assert again.created
    assert again.job.id != job.id
    assert asked(store, key="k").job == again.job
    with pytest.raises(KeyConflict):
        asked(store, 1, key="k")


def test_what_was_given_back_alive_does_not_count_as_a_death(store):
    job = asked(store).job
    for attempt in range(1, 6):
        assert store.lease("me", 15).attempt == attempt
        assert store.release(job.id, "me", attempt)
    assert store.job(job.id).state == "queued"


def test_what_has_killed_two_workers_lets_the_others_go_first(store):
    job, other = asked(store, 0).job, asked(store, 1).job
    for attempt in (1, 2):
        assert store.lease("me", 15).id == job.id
        store.release(job.id, "me", attempt, died=True)
    assert store.lease("me", 15).id == other.id
    assert store.lease("me", 15).id == job.id
    assert store.lease("me", 15) is None


def test_a_cancelled_job_accepts_no_result(store):
    waiting, running = asked(store, 0).job, asked(store, 1).job
    store.lease("me", 15)
    leased = store.lease("me", 15)
    assert leased.id == running.id
    assert store.cancel(running.id).state == "cancelled"
    assert not store.heartbeat(running.id, "me", 1)
    assert not store.finish(running.id, "me", 1, {"a": b"late"})
    assert store.result_names(running.id) == ()
    assert store.finish(waiting.id, "me", 1, {})
    assert store.cancel(waiting.id).state == "done"  # what is over stays as it is
    queued = asked(store, 2).job
    assert store.cancel(queued.id).finished is not None
    assert store.lease("me", 15) is None


def test_a_database_is_brought_up_to_date_once_and_a_later_one_refused(url):
    opened = at_once(4, lambda _: Store.open(url))
    with opened[0].database.reading() as connection:
        rows = connection.execute(sa.select(tables.migrations)).all()
    assert [row.number for row in rows] == list(range(1, len(tables.STEPS) + 1))
    with opened[0].database.writing() as connection:
        connection.execute(tables.migrations.insert().values(number=99, name="later", applied=0.0))
    for one in opened:
        one.close()
    with pytest.raises(BadStore, match="later jshell"):
        Store.open(url)


def test_a_database_of_an_earlier_jshell_goes_on_where_it_stood(tmp_path):
    """Written by the version of two steps: a job of every state, one of them running."""
    path = tmp_path / "jobs.db"
    with contextlib.closing(sqlite3.connect(path)) as connection:
        connection.executescript((Path(__file__).parent / "data" / "jobs_of_two_steps.sql").read_text())
    store = Store.open(f"sqlite:///{path}")
    rows = store.jobs()
    assert [row.state for row in rows] == ["queued", "running", "cancelled", "failed", "failed", "done"]
    assert store.result(rows[-1].id, "record.json") == b"{}"
    assert store.trace_content(rows[-1].traces[0]) == b"t,V\n0,1\n1,2\n"
    assert not asked(store, 1, "key 1").created
    assert asked(store, 2, "key 2").created  # it was given up
    assert store.lease("me", 15).id == rows[0].id
    store.close()


def test_a_job_that_had_a_time_to_be_ready_at_is_one_without(url):
    """As tables of two steps have it, on both."""
    store = Store.open(url)
    asked(store)
    with store.database.writing() as connection:
        connection.execute(sa.text("ALTER TABLE jobs ADD COLUMN ready FLOAT NOT NULL DEFAULT 9e9"))
        connection.execute(tables.migrations.delete().where(tables.migrations.c.number > 2))
    store.close()
    store = Store.open(url)
    assert store.lease("me", 15).specification == {"number": 0}
    assert asked(store, 1).created
    store.close()


def test_errors_of_the_first_tables_come_apart(url):
    """What was found and expected stood in one sentence."""
    store = Store.open(url)
    rows = [asked(store, number).job for number in range(3)]
    causes = ("found 1; expected 2", "worker died: 3 times in the middle of this job", None)
    with store.database.writing() as connection:
        for row, cause in zip(rows, causes, strict=True):
            words = (
                None if cause is None else {"code": "bad_value", "place": "here", "cause": cause, "remedy": "Try 2."}
            )
            error = None if words is None else json.dumps(words)
            connection.execute(tables.jobs.update().where(tables.jobs.c.id == row.id).values(error=error))
        connection.execute(tables.migrations.delete().where(tables.migrations.c.number >= 2))
    store.close()
    store = Store.open(url)
    found = [store.job(row.id).error for row in rows]
    store.close()
    assert found[0] == WRONG
    assert (found[1].found, found[1].expected) == (causes[1], "")
    assert [None if error is None else error.cause for error in found] == list(causes)


@pytest.mark.parametrize("url", ["mysql://x/y", "nonsense", "sqlite://", "sqlite:///:memory:"])
def test_an_address_that_keeps_nothing_is_refused(url):
    with pytest.raises(BadValue, match=r"sqlite:///"):
        Store.open(url)


def test_what_is_begun_anew_has_no_progress_and_can_be_called_off(store):
    job = asked(store).job
    store.lease("before the restart", 15)
    assert store.heartbeat(job.id, "before the restart", 1)
    assert silent(store)
    row = store.job(job.id)
    assert (row.state, row.progress, row.attempt, row.owner) == ("queued", 0.0, 1, None)
    assert store.cancel(job.id).state == "cancelled"
    assert store.lease("after", 15) is None
