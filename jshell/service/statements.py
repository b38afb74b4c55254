"""What submissions and owners say to the database; built once where building costs more than saying."""

import functools

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from jshell.service.tables import LIVE, QUEUED, RUNNING, jobs, keys

KEY = sa.select(keys).where(keys.c.key == sa.bindparam("key"))
JOB = sa.select(jobs).where(jobs.c.id == sa.bindparam("job"))
LIVE_JOB = sa.select(jobs).where(jobs.c.content == sa.bindparam("content"), LIVE)  # there is one at most
WAITING = sa.select(sa.func.count()).select_from(jobs).where(jobs.c.state == QUEUED)
SERVER_CLOCK = sa.cast(sa.func.extract("epoch", sa.func.clock_timestamp()), sa.Double())  # PostgreSQL's own


@functools.cache
def new_job(in_file: bool) -> sa.Insert:
    """A job, unless one of the same content is live; SQLite is given `created`, PostgreSQL looks itself."""
    insert = (sqlite if in_file else postgresql).insert(jobs)
    insert = insert.on_conflict_do_nothing(index_elements=[jobs.c.content], index_where=LIVE).returning(*jobs.c)
    return insert if in_file else insert.values(created=SERVER_CLOCK)


@functools.cache
def new_key(in_file: bool) -> sa.Insert:
    """A key, unless it is known; SQLite is given `created`, PostgreSQL looks itself."""
    insert = (sqlite if in_file else postgresql).insert(keys)
    insert = insert.on_conflict_do_nothing(index_elements=[keys.c.key]).returning(keys.c.key)
    return insert if in_file else insert.values(created=SERVER_CLOCK)


def held(job: str, owner: str, attempt: int) -> sa.Update:
    """A change of a job that an owner still has in this attempt: what comes late finds no row."""
    return jobs.update().where(
        jobs.c.id == job, jobs.c.state == RUNNING, jobs.c.owner == owner, jobs.c.attempt == attempt
    )
