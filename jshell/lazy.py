"""Doors that load what stands behind them when it is first asked for, so that help and short commands need not wait."""

import importlib
import sys
from collections.abc import Callable, Mapping
from typing import Any


def lazy(
    door: str, homes: Mapping[str, str], former: Callable[[str], Any] | None = None
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """A package's `__getattr__` and `__dir__`.

    Args:
        door: The package's name.
        homes: Name to the module below the package that has it; `module:name` where it has it under another name,
            nothing where the name is a module itself.
        former: `__getattr__` of names that the package had.
    """

    def __getattr__(name: str) -> Any:
        if name not in homes:
            if former is not None:
                return former(name)
            raise AttributeError(f"module {door!r} has no attribute {name!r}")
        home, _, known = homes[name].partition(":")
        module = importlib.import_module(f"{door}.{home or name}")
        if not home:
            return module
        found = getattr(module, known or name)
        setattr(sys.modules[door], name, found)
        return found

    def __dir__() -> list[str]:
        return sorted({*vars(sys.modules[door]), *homes})

    return __getattr__, __dir__
