"""What made a result: the versions of jshell, of Python and of what the numbers of a fit come from."""

import platform
from importlib import metadata


def versions() -> tuple[tuple[str, str], ...]:
    """Names and versions."""
    import jshell

    others = tuple((name, metadata.version(name)) for name in ("jax", "numpy", "scipy"))
    return (("jshell", jshell.__version__), ("python", platform.python_version()), *others)
