"""What can go wrong, in words a user can act on.

Two kinds. An *error* is a request that cannot be carried out: it says where,
what was found, what was expected and what to try. An *outcome* is how a
computation ended: anything but `ok` means that its numbers are not an answer.
"""

import enum
import importlib
from collections.abc import Collection
from typing import Any


class Outcome(enum.IntEnum):
    """How a computation ended; the same words in Python, JSON and HTTP.

    Integers, so that an outcome can leave a compiled program; `word` is the
    spelling everywhere else.
    """

    OK = 0
    NOT_CONVERGED = 1
    CONTACT = 2
    MESH = 3
    NO_BUCKLED_STATE = 4
    OUT_OF_RANGE = 5
    RANK_DEFICIENT = 6
    AT_BOUND = 7
    STALLED = 8
    UNUSABLE_DATA = 9
    NOT_FINITE = 10
    OVERDAMPED = 11

    @property
    def word(self) -> str:
        return self.name.lower()

    @property
    def advice(self) -> str:
        """What happened and what to try, in one sentence."""
        return _ADVICE[self]


_ADVICE = {
    Outcome.OK: "the computation converged",
    Outcome.NOT_CONVERGED: "the solver did not converge: try a load nearer to one that works, or other starts",
    Outcome.CONTACT: "the wall touches itself: lower the outer pressure or raise the gas pressure",
    Outcome.MESH: "the mesh was spoiled or the motion ran away: try more elements or a smaller step",
    Outcome.NO_BUCKLED_STATE: "no buckled state at this load, the shell is a sphere: raise the outer pressure",
    Outcome.OUT_OF_RANGE: "the parameters lie outside the range the method was built for",
    Outcome.RANK_DEFICIENT: "the data leave parameters free: add a second pressure or shape, or fix one",
    Outcome.AT_BOUND: "a parameter ended on its bound: widen the bound or question the model",
    Outcome.STALLED: "the solver stopped making progress before it converged: try other starts",
    Outcome.UNUSABLE_DATA: "the data cannot carry this analysis: use a longer or cleaner record",
    Outcome.NOT_FINITE: "a number was not finite: check the conditions; in a fit no start led to two oscillating modes",
    Outcome.OVERDAMPED: "nothing oscillates in so viscous a liquid: only the decay time means anything",
}


class JshellError(Exception):
    """A request that cannot be carried out.

    Attributes:
        code: Stable identifier, e.g. `bad_value`.
        place: Where: an argument, or file, row and column.
        found: What was found there.
        expected: What would have been accepted.
        remedy: What to try.
    """

    code = "error"

    def __init__(self, place: str, *, found: str, expected: str, remedy: str) -> None:
        self.place = place
        self.found = found
        self.expected = expected
        self.remedy = remedy
        super().__init__(f"{place}: found {found}; expected {expected}. {remedy}")

    def record(self) -> dict[str, str]:
        """The error as a JSON object."""
        return {
            "code": self.code,
            "place": self.place,
            "found": self.found,
            "expected": self.expected,
            "remedy": self.remedy,
        }


class BadValue(JshellError, ValueError):
    """A number outside its meaning: negative thickness, NaN pressure."""

    code = "bad_value"


class BadShape(JshellError, ValueError):
    """An array of the wrong shape."""

    code = "bad_shape"


class BadName(JshellError, ValueError):
    """A preset, channel or option that does not exist."""

    code = "bad_name"


class BadFile(JshellError, ValueError):
    """A file that cannot be read as what it claims to be."""

    code = "bad_file"


class BadUnits(JshellError, ValueError):
    """Units that are unknown, missing or mixed."""

    code = "bad_units"


class MissingExtra(JshellError, ImportError):
    """An optional dependency that is not installed."""

    code = "missing_extra"


class UnusableData(JshellError, ValueError):
    """A record that cannot be of the shell it is said to be of, or that says nothing of it."""

    code = "unusable_data"


class NotOk(JshellError, RuntimeError):
    """A computation that ended with an outcome other than ok, when the caller asked for an exception."""

    code = "not_ok"

    def __init__(self, place: str, outcome: Outcome, advice: str = "") -> None:
        self.outcome = outcome
        remedy = f"{advice or outcome.advice}."
        super().__init__(place, found=f"outcome {outcome.word}", expected="outcome ok", remedy=remedy)


class WorkerLost(JshellError, RuntimeError):
    """A task whose process or machine died under it; the others were not touched."""

    code = "worker_lost"


class NotFound(JshellError, LookupError):
    """Nothing stored under that name."""

    code = "not_found"


class KeyConflict(JshellError, ValueError):
    """An idempotency key that was used before, with another request."""

    code = "key_conflict"


class QueueFull(JshellError, RuntimeError):
    """More work is waiting than the service was set to hold."""

    code = "queue_full"


class LimitReached(JshellError, RuntimeError):
    """A job that took more time or memory than the service allows."""

    code = "limit_reached"


class StoreUnavailable(JshellError, OSError):
    """The database cannot be read or written now; what it holds is untouched."""

    code = "store_unavailable"


class BadStore(JshellError, ValueError):
    """A database that is damaged, or not one of jshell's."""

    code = "bad_store"


def choose(
    name: str,
    value: Any,
    allowed: Collection[Any],
    *,
    noun: str = "",
    expected: str = "",
    remedy: str = "Choose one.",
) -> Any:
    """The value of an option, which must be one of those that there are.

    Args:
        name: What the option is called, such as `liquid`; its place may stand before it, with a comma.
        value: What was asked for.
        allowed: What there is.
        noun: What the values are, where the option's name does not say it.
        expected: What there is in words, where a list of it does not say all.
        remedy: What to try.

    Raises:
        BadName: Another value.

    Example:
        >>> from jshell.errors import choose
        >>> choose("units", "si", ("reduced", "si"))
        'si'
    """
    if value in allowed:
        return value
    known = "one of " + ", ".join(str(one) for one in allowed)
    if name.startswith("--"):  # of the terminal: the option alone is the place
        raise BadName(name, found=repr(value), expected=expected or known, remedy=remedy)
    noun = noun or name.rpartition(", ")[2]
    raise BadName(f"{name} {value!r}", found=f"no such {noun}", expected=expected or known, remedy=remedy)


def require_extra(module: str, extra: str, place: str = "") -> Any:
    """A module of an optional package, imported now.

    Args:
        module: Its name, such as `xarray`.
        extra: The extra of jshell that brings it.
        place: What needs it; by default the module's name.

    Raises:
        MissingExtra: It is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        raise MissingExtra(
            place or module,
            found=f"no {module}",
            expected=f"the extra `{extra}`",
            remedy=f"Install it: pip install 'jshell[{extra}]'.",
        ) from None


class RangeWarning(UserWarning):
    """A result outside the range in which its law was checked; published numbers may still be made with it."""


class GuessWarning(UserWarning):
    """What a file leaves open, and what it was taken for; `jshell.io.Reading` settles it."""
