"""The options of a fit as the terminal's options: one for each choice of `FitOptions`, in its words."""

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
import typer

from jshell.calibration.option_texts import FORMS, read_span, read_texts
from jshell.calibration.options import OPTIONS, FitOptions, default_of, words_of

FLAGS = {"channels": "--channel", "priors": "--prior", "start": "--from", "stop": "--to"}
_TYPES = {"start": float | None, "stop": float | None, "starts": int, "seed": int}
_WINDOW = "FROM:TO, both ends of the time that is read in one."


def flag(name: str) -> str:
    """How the terminal calls an option."""
    return FLAGS.get(name, f"--{name}")


def takes_fit_options(verb: Callable[..., None]) -> Callable[..., None]:
    """Give a verb an option for every choice of a fit; they reach it as its argument `options`."""
    own = inspect.signature(verb)
    added = [_parameter(name) for name in OPTIONS]
    window = Annotated[str | None, typer.Option("--window", help=_WINDOW)]
    added.append(inspect.Parameter("window", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=window))
    kept = [one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in own.parameters.values()]
    at = [one.name for one in kept].index("options")
    together = [*kept[:at], *added, *kept[at + 1 :]]

    @functools.wraps(verb)
    def wrapped(**given: Any) -> None:
        options = _read({one.name: given.pop(one.name) for one in added})
        verb(**given, options=options)

    wrapped.__signature__ = own.replace(parameters=together)  # pyright: ignore[reportAttributeAccessIssue]
    wrapped.__annotations__ = {one.name: one.annotation for one in together} | {"return": None}
    return wrapped


def _parameter(name: str) -> inspect.Parameter:
    words = words_of(name)
    words = words[0].upper() + words[1:]
    if name in FORMS:
        kind, default = list[str] | None, None
        words = f"{FORMS[name]}; may be repeated. {words}"
    else:
        default = default_of(name)
        kind = _TYPES.get(name, str | None if default is None else str)
    annotation = Annotated[kind, typer.Option(flag(name), help=f"{words}.")]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _read(given: dict[str, Any]) -> FitOptions:
    """The options that a line asks for.

    Raises:
        BadName, BadValue: A choice that does not exist; text of another form.
    """
    window = given.pop("window")
    found = {
        name: read_texts(name, value or [], flag(name)) if name in FORMS else value for name, value in given.items()
    }
    if window is not None:
        low, high = read_span(window, "--window")
        found["start"] = low if np.isfinite(low) else found["start"]
        found["stop"] = high if np.isfinite(high) else found["stop"]
    return FitOptions(**found)
