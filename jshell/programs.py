"""Compiled programs, kept between processes in the user's cache folder.

Most of the time of a short command is compiling. JAX can keep what it has
compiled; importing jshell asks it to, in `jshell/programs` of the cache folder
that the system gives a user, unless the user has chosen a folder through JAX's
own variable `JAX_COMPILATION_CACHE_DIR`, or none: `JSHELL_PROGRAM_CACHE=off`.

A program holds instructions of the processor that it was compiled for, and a
home may be shared by several machines, so each kind of processor has a folder
of its own. For that reason XLA may be kept from a warning: it notes two wishes
of its compiler (`prefer-no-gather`, `prefer-no-scatter`) among the features of
the processor, finds no processor that has them, and says of every program out
of any folder that it may crash here. In a folder that the user has chosen the
warning may be right, and stays.

Source     XLA: cpu_aot_loader.cc (openxla/xla issue 44565); JAX: `jax_logging_level`
"""

import contextlib
import hashlib
import os
import platform
import sys
import warnings
from pathlib import Path

SWITCH = "JSHELL_PROGRAM_CACHE"
OFF = ("off", "0", "no", "false")
FOLDER = "JAX_COMPILATION_CACHE_DIR"  # JAX's variables: each is `jax_…` in its settings
LEAST_TIME = "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"
LOGGING = "jax_logging_level"
ENVIRONMENT = "TF_CPP_MIN_LOG_LEVEL"  # XLA's own way to be told; JAX sets 1 where nobody has
SILENT = "CRITICAL"
UNREADABLE = "Error (reading|writing) persistent compilation cache"  # JAX's warning
LIMIT = 1 << 30  # bytes that a folder may hold; a fit needs 0.3 MB, all of the tests 60 MB


def keep() -> None:
    """Ask JAX to keep its programs, unless the user has decided; of use before JAX compiles its first."""
    if FOLDER in os.environ or os.environ.get(SWITCH, "").strip().lower() in OFF:
        return
    jax = sys.modules.get("jax")
    if jax is not None and jax.config.jax_compilation_cache_dir is not None:
        return
    folder = place()
    if folder is None:
        return
    trim(folder, LIMIT)
    # a process that was killed leaves half a program, which JAX compiles again and tells of: nobody can act on that
    warnings.filterwarnings("ignore", UNREADABLE, UserWarning)
    if jax is None:
        os.environ[FOLDER] = str(folder)
        os.environ.setdefault(LEAST_TIME, "0")
        os.environ.setdefault(ENVIRONMENT, "3")
    else:
        jax.config.update(FOLDER.lower(), str(folder))
        jax.config.update(LEAST_TIME.lower(), 0.0)
        jax.config.update(LOGGING, quiet(getattr(jax.config, LOGGING)))


def place() -> Path | None:
    """The folder of this user on this kind of processor, made where it is not there; None where none can be."""
    try:
        folder = _caches() / "jshell" / "programs" / processor()
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # no home, or one that cannot be written
        return None
    return folder if os.access(folder, os.W_OK) else None


def trim(folder: Path, limit: int) -> None:
    """Delete the programs that have not been used for longest, down to half the limit, where it is passed.

    Args:
        folder: Where they are.
        limit: What they may take [bytes].
    """
    with contextlib.suppress(OSError):  # another process may trim, too
        files = [(entry.stat(), entry.path) for entry in os.scandir(folder) if entry.is_file()]
        size = sum(stat.st_size for stat, _ in files)
        if size <= limit:
            return
        for stat, path in sorted(files, key=lambda file: max(file[0].st_atime, file[0].st_mtime)):
            os.unlink(path)
            size -= stat.st_size
            if size <= limit // 2:
                return


def quiet(chosen: str | None) -> str | None:
    """The level of JAX's log where programs come out of a cache of our own.

    Args:
        chosen: The user's, which stays.
    """
    undecided = chosen in (None, "", "NOTSET") and os.environ.get(ENVIRONMENT, "1") == "1"
    return SILENT if undecided else chosen


def _caches() -> Path:
    """Where this system keeps what can be made again."""
    if given := os.environ.get("XDG_CACHE_HOME"):
        return Path(given)
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    if sys.platform == "win32" and (given := os.environ.get("LOCALAPPDATA")):
        return Path(given)
    return Path.home() / ".cache"


def processor() -> str:
    """A name for this kind of processor: its features where the system tells them, else the machine's own name."""
    processors = Path("/proc/cpuinfo")
    lines = processors.read_text(encoding="utf-8", errors="replace").splitlines() if processors.exists() else []
    features = next((line for line in lines if line.lower().startswith(("flags", "features"))), platform.node())
    return f"{platform.machine() or 'any'}-{hashlib.sha256(features.encode()).hexdigest()[:8]}"
