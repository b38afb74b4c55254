"""A browser that has shown the token: known by a name of its own, for a week or until it leaves.

The database holds only a hash of the name, so that several servers know it, and a copy of the file lets nobody in.
"""

import hashlib
import secrets
import time

import sqlalchemy as sa

from jshell.service.database import Database
from jshell.service.tables import sessions

SECONDS = 7 * 86400  # of a session
GUESSES = 10  # wrong tokens of an address in a minute
ADDRESSES = 10_000  # whose guesses are remembered


def begin(database: Database) -> str:
    """A new session; its name, for the browser's cookie."""
    name = secrets.token_urlsafe(32)
    with database.writing() as connection:
        connection.execute(sessions.delete().where(sessions.c.ends < database.clock))
        connection.execute(sessions.insert().values(id=_hash(name), ends=database.clock + SECONDS))
    return name


def is_known(database: Database, name: str) -> bool:
    """Whether a session of this name has begun and not ended."""
    with database.reading() as connection:
        asked = sa.select(sessions.c.id).where(sessions.c.id == _hash(name), sessions.c.ends > database.clock)
        return connection.execute(asked).scalar() is not None


def end(database: Database, name: str) -> None:
    """End a session, everywhere."""
    with database.writing() as connection:
        connection.execute(sessions.delete().where(sessions.c.id == _hash(name)))


def _hash(name: str) -> str:
    return hashlib.sha256(name.encode(errors="replace")).hexdigest()


class Guesses:
    """Wrong tokens by address: so many a minute, then nobody there is asked for another."""

    def __init__(self) -> None:
        self._wrong: dict[str, list[float]] = {}

    def may(self, address: str) -> bool:
        """Whether a token of this address is looked at."""
        now = time.monotonic()
        if len(self._wrong) > ADDRESSES:
            self._wrong.clear()
        self._wrong[address] = recent = [one for one in self._wrong.get(address, ()) if now - one < 60]
        return len(recent) < GUESSES

    def was_wrong(self, address: str) -> None:
        """Remember a wrong one."""
        self._wrong.setdefault(address, []).append(time.monotonic())
