"""How values show themselves at the prompt: short, with numbers and units.

What is traced or batched has no number to show; its shape stands instead, so
that a value can be printed anywhere.
"""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from jshell.errors import Outcome

TIME = "√(ρ_f R0³/(E d))"  # units of the inside, as the prompt writes them
PRESSURE = "E d/R0"
FREQUENCY = "√(E d/(ρ_f R0³))"
MANY = 6  # numbers of a list that are shown
UNREADABLE = (TypeError, ValueError, RuntimeError)  # a tracer, a placeholder of JAX's, an array given away


def number(value: Any, unit: str = "") -> str:
    """A number, or a few of one list, to five digits with the unit; a shape where there are no such numbers.

    Args:
        value: A number, or an array, traced or not; None is a dash.
        unit: Its unit, without brackets.

    Example:
        >>> from jshell.display import number
        >>> number(0.123456, "E d/R0")
        '0.12346 [E d/R0]'
    """
    if value is None:
        return "–"
    try:
        found = np.asarray(value, dtype=float)
    except UNREADABLE:
        found = None
    if found is None or found.ndim > 1:
        shape = tuple(getattr(value, "shape", ()))
        text = f"shape {shape}" if shape else "traced"
    else:
        listed = [f"{one:.5g}" for one in found.ravel()[:MANY]]
        text = ", ".join(listed) + (" …" if found.size > MANY else "")
    return f"{text} [{unit}]" if unit else text


def ended(outcome: Any) -> str:
    """An outcome in its own word; how many ended in which way in a batch."""
    try:
        codes = np.asarray(outcome).ravel().tolist()
    except UNREADABLE:
        return "outcome traced"
    words = [Outcome(int(code)).word for code in codes]
    kinds = list(dict.fromkeys(words))
    return kinds[0] if len(kinds) == 1 else ", ".join(f"{words.count(word)} {word}" for word in kinds)


def readable(show: Callable[[Any], str]) -> Callable[[Any], str]:
    """A `__repr__` that never fails: JAX and Equinox fill a structure with what has no such fields, and print it."""

    @functools.wraps(show)
    def wrapped(self: Any) -> str:
        try:
            return show(self)
        except (*UNREADABLE, AttributeError):
            return f"{type(self).__name__}(…)"

    return wrapped


def shown(value: object, *parts: str) -> str:
    """A value's kind and what it holds, empty parts left out."""
    return f"{type(value).__name__}({', '.join(part for part in parts if part)})"
