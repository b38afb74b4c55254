"""What a verb prints: one JSON object, or a table; logs go to stderr, and the exit code tells the rest."""

import functools
import importlib
import json
import math
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from jshell import programs
from jshell.errors import BadName, BadValue, JshellError, Outcome

BAD_INPUT = 2
NOT_OK = 3
# Typer has had Click's errors under two roofs; what its own error derives from is under the right one.
UsageError: type[Exception] = typer.BadParameter.__bases__[0]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]


def clean(value: Any) -> Any:
    """A value as JSON knows it: arrays as lists, NaN and infinity as null."""
    if isinstance(value, dict):
        return {str(key): clean(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [clean(item) for item in value]
    if isinstance(value, Outcome):
        return value.word
    if isinstance(value, bool | str) or value is None:
        return value
    np = importlib.import_module("numpy")  # help need not wait for it
    if isinstance(value, np.bool_):
        return bool(value)
    numbers = np.asarray(value)
    if numbers.ndim:
        return [clean(item) for item in numbers]
    if np.issubdtype(numbers.dtype, np.integer):
        return int(numbers)
    number = float(numbers)
    return number if math.isfinite(number) else None


def print_json(record: dict[str, Any]) -> None:
    """Print one JSON object."""
    typer.echo(json.dumps(clean(record), ensure_ascii=False, allow_nan=False))


def table(rows: Iterable[tuple], header: tuple[str, ...]) -> str:
    """Columns aligned, numbers to five digits, missing ones as a dash."""
    lines = [header, *(tuple(cell(item) for item in row) for row in rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(header))]
    shown = ["  ".join(item.ljust(width) for item, width in zip(line, widths, strict=True)).rstrip() for line in lines]
    shown.insert(1, "  ".join("─" * width for width in widths))
    return "\n".join(shown)


def cell(item: Any) -> str:
    """One number or word of a table."""
    if item is None:
        return "–"
    if isinstance(item, str):
        return item
    number = float(item)
    return f"{number:.5g}" if math.isfinite(number) else "–"


def log(text: str) -> None:
    """A word to the person, on stderr."""
    typer.echo(text, err=True)


def judged(outcome: Outcome, *numbers: Any) -> Outcome:
    """The outcome, which is `not_finite` where it would be ok and one of the numbers is none."""
    np = importlib.import_module("numpy")
    if outcome == Outcome.OK and not all(np.all(np.isfinite(np.asarray(part, dtype=float))) for part in numbers):
        return Outcome.NOT_FINITE
    return outcome


def finish(outcome: Outcome, *, sound: bool = True, advice: str = "") -> None:
    """Exit 0 where the outcome is ok and the result sound, else 3 with the advice on stderr."""
    if outcome != Outcome.OK:
        log(f"{outcome.word}: {advice or outcome.advice}.")
    if outcome != Outcome.OK or not sound:
        raise typer.Exit(NOT_OK)


def speaking(verb: Callable[..., None]) -> Callable[..., None]:
    """Turn typed errors into exit code 2 with the message, and warnings into lines on stderr."""

    @functools.wraps(verb)
    def wrapped(*args, **given) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("always", UserWarning)
            warnings.filterwarnings("ignore", programs.UNREADABLE, UserWarning)
            warnings.showwarning = lambda message, *_, **__: log(f"warning: {message}")
            try:
                verb(*args, **given)
            except JshellError as error:
                if "--json" in sys.argv:
                    print_json({"error": error.record()})
                log(f"error: {error}")
                raise typer.Exit(BAD_INPUT) from None

    return wrapped


class Verbs(TyperGroup):
    """The verbs, with Typer's own refusals of a command line as JSON where JSON was asked for."""

    asked = False

    def make_context(self, info_name: str | None, args: list[str], *rest: Any, **given: Any) -> Any:
        self.asked = "--json" in args
        with self._usage_as_json():
            return super().make_context(info_name, args, *rest, **given)

    def invoke(self, ctx: Any) -> Any:
        with self._usage_as_json():
            return super().invoke(ctx)

    @contextmanager
    def _usage_as_json(self) -> Iterator[None]:
        """Print the problem on stdout; Typer goes on to print it for a person on stderr, and exits with 2."""
        try:
            yield
        except UsageError as error:
            if self.asked:
                print_json({"error": usage_problem(error).record()})
            raise


def usage_problem(error: Any) -> JshellError:
    """A command line that Typer refuses, as an error of jshell's."""
    command = error.ctx.command_path if error.ctx is not None else "jshell"
    usage = " ".join(error.ctx.get_usage().split()) if error.ctx is not None else "jshell --help"
    param = getattr(error, "param", None)
    place = getattr(error, "option_name", None) or (param.opts[0] if param is not None and param.opts else command)
    kind = BadName if param is None else BadValue
    return kind(place, found=error.format_message(), expected=usage, remedy=f"Try {command} --help.")
