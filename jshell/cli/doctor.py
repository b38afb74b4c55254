"""`jshell doctor`: is this installation sound, and what could it do better?"""

import importlib
import os
import platform
import re
import sys
import tempfile
import warnings
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import typer

import jshell
from jshell import __version__, programs
from jshell.cli.output import Json, finish, log, print_json, speaking, table
from jshell.errors import JshellError, Outcome, RangeWarning

STANDS_ON = ("jax", "jaxlib", "numpy", "scipy", "equinox", "diffrax", "optimistix", "lineax", "jaxtyping", "typer")
COLLECTIONS = ("all", "dev")  # extras that only name other extras
ROWS, WIDTHS = 20_000, (3, 5, 6, 7)  # where a compiler was seen to return wrong numbers (jax issue 39103)
ROUNDING = 1e-9  # of a sum of 20 000 terms of size one: 1e-12 in float64, errors of the wrong compiler are above 1
SLOW_MODE = 0.988525  # ω− of the configuration R with the source's constants, by two independent codes
_CACHE_REMEDY = (
    f"unset {programs.SWITCH} (off keeps nothing), or set {programs.FOLDER} to a folder: "
    "first calls then take a third of the time."
)
NAME = re.compile(r"^([A-Za-z0-9._-]+).*?extra == ['\"]([A-Za-z0-9._-]+)['\"]", re.S)


@dataclass(frozen=True)
class Finding:
    """One thing looked at.

    Attributes:
        what: Its name.
        found: What was found, in words.
        sound: Whether numbers can be trusted as far as this goes.
        remedy: What to do where it is not, or could be better.
    """

    what: str
    found: str
    sound: bool = True
    remedy: str = ""


@speaking
def doctor(as_json: Json = False) -> None:
    """Look at the installation: versions, devices, float64, the compiler, the cache, extras, shipped data.

    Ends with 3 where numbers could not be trusted.
    """
    versions = {"jshell": __version__, "python": platform.python_version()}
    versions |= {name: found for name in STANDS_ON if (found := _version(name)) is not None}
    devices = _devices()
    findings = [devices]
    if devices.sound:
        findings += [_precision(), _compiler(), _number()]
    findings += [_cache(), _data()]
    extras = _extras()
    sound = all(finding.sound for finding in findings)
    if as_json:
        print_json(
            {
                "sound": sound,
                "versions": versions,
                "machine": {"system": platform.platform(), "cores": _cores(), "executable": sys.executable},
                "findings": [asdict(finding) for finding in findings],
                "extras": {name: {"installed": not missing, "missing": missing} for name, missing in extras.items()},
            }
        )
    else:
        _print(versions, findings, extras)
    if not sound:
        log("not sound: do not trust numbers of this installation before the remedies above are followed.")
    finish(Outcome.OK, sound=sound)


def _print(versions: dict[str, str], findings: list[Finding], extras: dict[str, list[str]]) -> None:
    typer.echo(" · ".join(f"{name} {version}" for name, version in versions.items()))
    typer.echo(f"{platform.platform()}, {_cores()} cores\n")
    rows = [("ok" if one.sound else "WRONG", one.what, one.found) for one in findings]
    typer.echo(table(rows, ("", "looked at", "found")))
    for one in findings:
        if one.remedy:
            typer.echo(f"\n{one.what}: {one.remedy}")
    shown = [
        (name, "installed" if not missing else "missing " + ", ".join(missing)) for name, missing in extras.items()
    ]
    typer.echo("\n" + table(shown, ("extra", "pip install 'jshell[extra]'")))


def _jax() -> Any:
    """JAX, loaded when it is looked at: help need not wait for it."""
    return importlib.import_module("jax")


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _devices() -> Finding:
    """What JAX computes on."""
    try:
        found = _jax().devices()
    except (RuntimeError, AssertionError) as error:  # a platform was asked for that is not there
        asked = os.environ.get("JAX_PLATFORMS", "")
        return Finding(
            "devices",
            (str(error) or "none").splitlines()[0],
            False,
            f"JAX_PLATFORMS is {asked!r}: unset it, or install the jax of that platform.",
        )
    return Finding("devices", ", ".join(f"{device.platform}:{device.id} ({device.device_kind})" for device in found))


def _precision() -> Finding:
    """Whether numbers are float64."""
    kind = _jax().numpy.zeros(1).dtype.name
    if kind == "float64":
        return Finding("precision", kind)
    return Finding(
        "precision",
        kind,
        False,
        "a buckled shell's slow mode is a small difference of large stiffnesses: "
        f"unset JAX_ENABLE_X64 (it is {os.environ.get('JAX_ENABLE_X64', 'not set')!r}).",
    )


def _compiler() -> Finding:
    """Whether compiled products equal NumPy's; jax 0.10.2 on CPU returns wrong ones, silently."""
    jax = _jax()
    jnp = jax.numpy
    apart = []
    for width in WIDTHS:
        random = np.random.default_rng(width)
        batch, shared = random.standard_normal((ROWS, width)), random.standard_normal((width, width))
        total = jax.jit(lambda rows, matrix: jnp.sum(jax.vmap(lambda row: matrix @ row)(rows), axis=0))
        found = np.asarray(total(jnp.asarray(batch), jnp.asarray(shared)), dtype=float)
        apart.append(np.abs(found - np.sum(batch @ shared.T, axis=0)).max())
    worst = float(np.max(apart))
    allowed = ROUNDING if jnp.zeros(1).dtype == jnp.float64 else 1.0
    words = f"compiled sums are within {worst:.0e} of NumPy's"
    if worst <= allowed:  # a NaN is not
        return Finding("compiler", words)
    return Finding("compiler", words, False, "this jax returns wrong numbers: pip install 'jax>=0.10,!=0.10.2'.")


def _number() -> Finding:
    """One number of the physics that is known."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RangeWarning)  # the known number was made with the law outside its range, too
        found = float(jshell.oscillator.frequencies(jshell.presets.R.conditions, jshell.oscillator.SOURCE).omega_minus)
    words = f"ω₋ of R is {found:.6f}, known to be {SLOW_MODE}"
    if abs(found - SLOW_MODE) <= 2e-6:  # the known value has six decimals
        return Finding("a known number", words)
    return Finding("a known number", words, False, "install jshell and jax anew, and report this.")


def _cache() -> Finding:
    """Where compiled programs are kept between processes."""
    given = getattr(_jax().config, "jax_compilation_cache_dir", None)
    if not given:
        return Finding(
            "compilation cache",
            "none: every process compiles anew",
            remedy=_CACHE_REMEDY,
        )
    if "://" in str(given):
        return Finding("compilation cache", str(given))
    folder = Path(given)
    if not _writable(folder):
        return Finding(
            "compilation cache",
            f"{folder} cannot be written: every process compiles anew",
            remedy="set JAX_COMPILATION_CACHE_DIR to a folder that you may write.",
        )
    files = [path for path in folder.rglob("*") if path.is_file()] if folder.is_dir() else []
    size = sum(path.stat().st_size for path in files)
    ours = f" ({programs.SWITCH}=off keeps none)" if folder.parent.name == "programs" else ""
    return Finding("compilation cache", f"{folder}: {len(files)} files, {size / 1e6:.0f} MB{ours}")


def _writable(folder: Path) -> bool:
    """Whether something can be written there, or where it would be made; tried, since permissions do not tell."""
    above = next((path for path in (folder, *folder.absolute().parents) if path.exists()), folder)
    try:
        with tempfile.TemporaryDirectory(dir=above):
            return True
    except OSError:
        return False


def _data() -> Finding:
    """Whether the data that come with jshell can be read."""
    try:
        samples = len(jshell.io.read_trace(jshell.io.example("attached_R_HW.csv")).times)
        shells = len(jshell.oscillator.simulated_modes())
    except (JshellError, OSError) as error:
        return Finding("shipped data", str(error), False, "the package is incomplete: install it anew.")
    return Finding("shipped data", f"a recording of {samples} samples, modes of {shells} shells")


def _extras() -> dict[str, list[str]]:
    """What each extra of the package still lacks."""
    try:
        asked: list[str] = metadata.requires("jshell") or []
        names = metadata.metadata("jshell").get_all("Provides-Extra") or []
    except metadata.PackageNotFoundError:
        return {}
    found: dict[str, list[str]] = {str(name): [] for name in names if name not in COLLECTIONS}
    for line in asked:
        match: Any = NAME.match(line)
        if match and match[2] in found and match[1] != "jshell" and _version(match[1]) is None:
            found[match[2]].append(match[1])
    return found
