"""Former names, which answer for one release with a warning that says the new one."""

import functools
import importlib
import warnings
from collections.abc import Callable, Mapping
from typing import Any


def renamed(module: str, names: Mapping[str, str]) -> Callable[[str], Any]:
    """A module's `__getattr__` for names that it had.

    Args:
        module: The module.
        names: Former name to `package.module:name`, or a name of the same module.
    """

    def __getattr__(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        home, _, new = names[name].rpartition(":")
        warnings.warn(f"{module}.{name} is now {home or module}.{new}", DeprecationWarning, stacklevel=2)
        return getattr(importlib.import_module(home or module), new)

    return __getattr__


def renamed_arguments(**names: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """A decorator for a function whose keywords had other names.

    Args:
        names: Former keyword to the new one.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def wrapped(*args: Any, **given: Any) -> Any:
            for former, new in names.items():
                if former in given:
                    text = f"the argument {former} of {function.__qualname__} is now {new}"
                    warnings.warn(text, DeprecationWarning, stacklevel=2)
                    given[new] = given.pop(former)
            return function(*args, **given)

        return wrapped

    return decorate


def renamed_attribute(former: str, new: str) -> property:
    """A property under a former name of an attribute.

    Args:
        former: The name it had.
        new: The name it has.
    """

    def look(self: Any) -> Any:
        text = f"{type(self).__name__}.{former} is now {type(self).__name__}.{new}"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return getattr(self, new)

    return property(look)
