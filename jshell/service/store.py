"""The jobs: what was asked, who works on it, what came out.

At least once executed, exactly once recorded. A job that was accepted is on
the disk. Whoever works on it holds a lease and says so again and again; one
that falls silent loses the job to another. What it delivers late is refused,
for a job is finished by owner and attempt, and only once. No clock that
somebody may set decides anything: jobs go by the number that the database gave
them, silence is what an observer sees on its own steady clock.
"""

import dataclasses
import json
import secrets
from collections.abc import Mapping, Sequence
from typing import Any

import sqlalchemy as sa

from jshell.errors import BadStore, BadValue, NotFound, StoreUnavailable, choose
from jshell.service import statements
from jshell.service.database import Database
from jshell.service.kinds import KINDS
from jshell.service.notifier import Notifier
from jshell.service.rows import (
    DIED,
    JobFailure,
    JobRow,
    Submission,
    content_of,
    given_up_after,
    job_of,
    key_conflict,
    queue_full,
    unknown_job,
)
from jshell.service.silence import Silence
from jshell.service.tables import CANCELLED, DONE, FAILED, QUEUED, RUNNING, STATES, heartbeats, jobs, keys, results
from jshell.service.uploads import Upload, Uploads

LAST = 2  # deaths of its worker after which a job lets all the others go first
SILENCE = 15.0  # [s] without a heartbeat after which a job is given to another


class Store(Uploads):
    """Traces, jobs and results in a database.

    Args:
        database: Where.
        queue: Jobs that may wait.
        attempts: Deaths of its worker in the middle of it after which a job is given up.
    """

    def __init__(self, database: Database, *, queue: int = 1000, attempts: int = 3) -> None:
        super().__init__(database)
        self.queue, self.attempts = queue, attempts
        self.notifier = Notifier()  # notified where this process accepts a job or takes one back
        self._silence = Silence()

    @staticmethod
    def open(url: str, *, queue: int = 1000, attempts: int = 3) -> "Store":
        """The store at an address, made or brought up to date.

        Raises:
            BadValue, BadStore, StoreUnavailable: As `Database`.
        """
        return Store(Database(url), queue=queue, attempts=attempts)

    def close(self) -> None:
        """Let go of the database."""
        self.database.close()

    def submit(
        self, kind: str, specification: Mapping[str, Any], traces: Sequence[str | Upload], key: str | None = None
    ) -> Submission:
        """Accept a job: when this returns, it is on the disk.

        What waits, runs or is done with the same content is that job; what failed or was cancelled is tried anew. Under
        a key the same request has the same answer, unless it was given up because its workers died: that is tried anew.

        Args:
            kind: One of `KINDS`.
            specification: What is asked, as JSON.
            traces: Identifiers of uploads; or files, which are kept if the job is.
            key: The caller's own name of this request: sent again, it is the same job.

        Raises:
            BadName, BadValue, NotFound: No such kind; a specification that is no JSON; no such trace.
            KeyConflict: The key stands for another request.
            QueueFull: More jobs wait than may.
            StoreUnavailable: Nothing was accepted.
        """
        choose("kind", kind, KINDS)
        try:
            text = json.dumps(specification, sort_keys=True, ensure_ascii=False, allow_nan=False)
        except (TypeError, ValueError) as error:
            raise BadValue(
                "specification", found=str(error), expected="a JSON object", remedy="Use numbers, texts and lists."
            ) from None
        given = [one for one in traces if isinstance(one, Upload)]
        ids = [one.id if isinstance(one, Upload) else one for one in traces]
        content = content_of(kind, text, ids)
        request = (kind, text, json.dumps(ids))
        with self.database.writing() as connection:
            if (same := self._same(connection, key, content, request)) is not None:
                return same
            self._require(connection, [one for one in traces if isinstance(one, str)])
            waiting = connection.execute(statements.WAITING).scalar_one()
            if waiting < self.queue:
                for one in given:
                    self._keep(connection, one)
                row, made = self._insert(connection, kind, text, ids, content)
            else:
                row, made = connection.execute(statements.LIVE_JOB, {"content": content}).one_or_none(), False
                if row is None:
                    raise queue_full(waiting, self.queue)
            if key is not None:
                values = {"key": key, "content": content, "job": row.id}
                if self._made(connection, keys, values) is None:
                    self._same(connection, key, content, request)  # another server was faster with this key
        if made:
            self.notifier.notify()
        return Submission(job_of(row), made)

    def job(self, job: str) -> JobRow:
        """A job as it stands.

        Raises:
            NotFound: No such job.
        """
        with self.database.reading() as connection:
            row = connection.execute(statements.JOB, {"job": job}).one_or_none()
        if row is None:
            raise unknown_job(job)
        return job_of(row)

    def jobs(
        self, state: str | None = None, limit: int = 50, before: str | None = None, kind: str | None = None
    ) -> list[JobRow]:
        """Jobs, the newest first; those of a state, those before one, those of a kind.

        Raises:
            BadName: No such state.
            NotFound: No such job to be before.
        """
        if state is not None:
            choose("state", state, STATES)
        asked = sa.select(jobs).order_by(jobs.c.number.desc()).limit(limit)
        with self.database.reading() as connection:
            if before is not None:
                number = connection.execute(sa.select(jobs.c.number).where(jobs.c.id == before)).scalar()
                if number is None:
                    raise unknown_job(before)
                asked = asked.where(jobs.c.number < number)
            if state is not None:
                asked = asked.where(jobs.c.state == state)
            if kind is not None:
                asked = asked.where(jobs.c.kind == kind)
            return [job_of(row) for row in connection.execute(asked)]

    def result(self, job: str, name: str) -> bytes:
        """A file that a job made.

        Raises:
            NotFound: No such job, or it has no such result.
        """
        with self.database.reading() as connection:
            found = connection.execute(
                sa.select(results.c.content).where(results.c.job == job, results.c.name == name)
            ).scalar()
        if found is None:
            names = self.result_names(job)
            raise NotFound(
                f"job {job!r}, result {name!r}",
                found=f"state {self.job(job).state!r}, " + (f"results {', '.join(names)}" if names else "no result"),
                expected="a job that is done and made this",
                remedy="Wait until the job is done, and choose a name that it has.",
            )
        return bytes(found)

    def result_names(self, job: str) -> tuple[str, ...]:
        """Names of what a job made."""
        asked = sa.select(results.c.name).where(results.c.job == job).order_by(results.c.name)
        with self.database.reading() as connection:
            return tuple(connection.execute(asked).scalars())

    def cancel(self, job: str) -> JobRow:
        """Give a job up; one that is over stays as it is.

        Raises:
            NotFound: No such job.
        """
        change = jobs.update().where(jobs.c.id == job, jobs.c.state.in_((QUEUED, RUNNING)))
        with self.database.writing() as connection:
            connection.execute(change.values(state=CANCELLED, finished=self.database.clock, lease=None))
        return self.job(job)

    def counts(self) -> dict[str, int]:
        """Jobs in each state."""
        asked = sa.select(jobs.c.state, sa.func.count()).group_by(jobs.c.state)
        with self.database.reading() as connection:
            found = {row[0]: int(row[1]) for row in connection.execute(asked)}
        return {state: found.get(state, 0) for state in STATES}

    def healthy(self) -> bool:
        """Whether the database takes a write; false where it does not answer or is full."""
        try:
            with self.database.writing() as connection:
                connection.execute(heartbeats.update().values(beat=self.database.clock))
        except (StoreUnavailable, BadStore):
            return False
        return True

    def lease(self, owner: str, seconds: float | int) -> JobRow | None:
        """Take the job that waits and came first; None where none does. What has killed two workers goes last.

        Args:
            owner: Who takes it.
            seconds: Time in which the owner means to speak again.
        """
        now = self.database.clock
        oldest = sa.select(jobs.c.number).where(jobs.c.state == QUEUED)
        oldest = oldest.order_by(jobs.c.number).limit(1).with_for_update(skip_locked=True)
        first = sa.func.coalesce(oldest.where(jobs.c.deaths < LAST).scalar_subquery(), oldest.scalar_subquery())
        change = jobs.update().where(jobs.c.number == first, jobs.c.state == QUEUED)
        change = change.values(
            state=RUNNING,
            owner=owner,
            attempt=jobs.c.attempt + 1,
            started=sa.func.coalesce(jobs.c.started, now),
            lease=now + seconds,
        )
        with self.database.writing() as connection:
            row = connection.execute(change.returning(*jobs.c)).one_or_none()
        return None if row is None else job_of(row)

    def heartbeat(self, job: str, owner: str, attempt: int, *, seconds: float | int = 15.0) -> bool:
        """Say that a job is still worked on; false where it was cancelled, or given to another."""
        change = statements.held(job, owner, attempt).values(lease=self.database.clock + seconds)
        with self.database.writing() as connection:
            return connection.execute(change).rowcount == 1

    def finish(self, job: str, owner: str, attempt: int, outcome: Mapping[str, bytes] | JobFailure) -> bool:
        """Record what a job made, or why it failed; once, and only by who holds it.

        Returns:
            False where it is no longer the owner's; nothing was recorded then.
        """
        failed = isinstance(outcome, JobFailure)
        change = statements.held(job, owner, attempt).values(
            state=FAILED if failed else DONE,
            finished=self.database.clock,
            lease=None,
            progress=0.0 if failed else 1.0,
            error=json.dumps(dataclasses.asdict(outcome)) if failed else None,
        )
        with self.database.writing() as connection:
            if connection.execute(change).rowcount != 1:
                return False
            if not failed and outcome:
                rows = [{"job": job, "name": name, "content": content} for name, content in outcome.items()]
                connection.execute(results.insert(), rows)
        return True

    def release(self, job: str, owner: str, attempt: int, *, died: bool = False) -> bool:
        """Let another one have a job.

        Args:
            job, owner, attempt: As leased.
            died: Whether its worker died of it: after `attempts` deaths the job has failed.

        Returns:
            Whether it was still the owner's.
        """
        with self.database.writing() as connection:
            return self._requeue(connection, statements.held(job, owner, attempt), died) == 1

    def reap_expired(self, seconds: float | int = SILENCE) -> int:
        """Take jobs from owners that have said nothing new for so long, as this process saw it; how many.

        To be called again and again. Silence is no fault of the job: the owner's machine may have been restarted.
        """
        asked, found = sa.select(jobs.c.id, jobs.c.attempt, jobs.c.lease).where(jobs.c.state == RUNNING), 0
        with self.database.reading() as connection:
            leases = [(row.id, row.attempt, row.lease) for row in connection.execute(asked)]
        for job, attempt, lease in self._silence.of(leases, seconds):
            held = jobs.update().where(jobs.c.id == job, jobs.c.attempt == attempt, jobs.c.state == RUNNING)
            with self.database.writing() as connection:
                found += self._requeue(connection, held.where(jobs.c.lease == lease), False)
        if found:
            self.notifier.notify()
        return found

    def _requeue(self, connection: sa.Connection, chosen: sa.Update, died: bool) -> int:
        deaths = jobs.c.deaths + int(died)
        given_up = deaths >= self.attempts if died else sa.false()
        error = json.dumps(dataclasses.asdict(given_up_after(self.attempts)))
        change = chosen.values(
            state=sa.case((given_up, FAILED), else_=QUEUED),
            deaths=deaths,
            owner=sa.case((given_up, jobs.c.owner), else_=sa.null()),
            finished=sa.case((given_up, self.database.clock), else_=sa.null()),
            error=sa.case((given_up, error), else_=sa.null()),
            lease=None,
        )
        return connection.execute(change).rowcount

    def _insert(self, connection: sa.Connection, kind: str, text: str, traces: Sequence[str], content: str):
        """A new job; or the one that another server made of the same content in this very moment."""
        values = {
            "id": secrets.token_hex(12),
            "kind": kind,
            "specification": text,
            "traces": json.dumps(list(traces)),
            "content": content,
            "state": QUEUED,
        }
        while True:
            row = self._made(connection, jobs, values)
            if row is not None:
                return row, True
            row = connection.execute(statements.LIVE_JOB, {"content": content}).one_or_none()
            if row is not None:  # None where that one has failed meanwhile
                return row, False

    def _same(
        self, connection: sa.Connection, key: str | None, content: str, request: tuple[str, str, str]
    ) -> Submission | None:
        """The answer that a key has already; None where it has none, or its job was given up: the key is free again.

        Raises:
            KeyConflict: The key stands for another request.
        """
        known = None if key is None else connection.execute(statements.KEY, {"key": key}).one_or_none()
        if known is None:
            return None
        row = connection.execute(statements.JOB, {"job": known.job}).one()
        # the content holds the version: a request that an earlier jshell took under this key is still the same one
        if known.content != content and (row.kind, row.specification, row.traces) != request:
            raise key_conflict(known.key)
        job = job_of(row)
        if job.error is None or job.error.code != DIED:
            return Submission(job, False)
        connection.execute(keys.delete().where(keys.c.key == key, keys.c.job == job.id))
        return None
