"""The service's log: what others have sent stands in it as text, never as lines of its own or orders to a terminal."""

import logging
import traceback

LAST = 6  # calls of a traceback that are kept, the innermost


def plain(text: str) -> str:
    """Text without control characters; further lines are indented, so that none looks like a record."""
    return "".join(
        one if one.isprintable() else "\n    " if one == "\n" else one.encode("unicode_escape").decode() for one in text
    )


def trace_of(error: BaseException) -> str:
    """The innermost calls of an error and its words, for one record."""
    return "".join(traceback.format_exception(error, limit=-LAST, chain=False))


def _made_plain(record: logging.LogRecord) -> bool:
    record.msg, record.args = plain(record.getMessage()), ()
    return True


log = logging.getLogger("jshell.service")
log.addFilter(_made_plain)
