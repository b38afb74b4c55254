"""Build the wheel and the source archive, install the wheel in clean environments, and try it there.

    python .ci/release.py [PYTHON ...]

Every interpreter of 3.11 or newer that is found on this machine (on the PATH, among pyenv's) is used, or those
that are given. Ends with 1 unless all of them pass. What was built is left in `dist/`.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DIST = ROOT / "dist"
OLDEST = (3, 11)
NEWEST_LOOKED_FOR = 20
LIMIT = 1800  # seconds for one step: an install downloads some hundred megabytes
FIRST_FIT = """
import jshell as js
shell = js.oscillator.random_shell(0)
fit = js.calibration.fit_trajectories(js.oscillator.random_trace(shell, 0))
true, found = float(shell.coefficients.alpha1), fit["alpha1"]
assert fit.outcome.word == "ok", fit.outcome
assert abs(found.value - true) < 4 * found.stderr, (found.value, true)
print(f"alpha1 {found.value:.4f} +- {found.stderr:.4f}, true {true:.4f}")
"""


@dataclass(frozen=True)
class Trial:
    """What became of the wheel under one interpreter."""

    version: str
    step: str
    words: str

    @property
    def passed(self) -> bool:
        return self.step == "passed"


def run(*words: str | Path, cwd: Path, **given) -> subprocess.CompletedProcess[str]:
    """A command, outside of the checkout so that the installed package is what is imported."""
    bare = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "JAX_", "VIRTUAL_ENV"))}
    return subprocess.run(
        [str(word) for word in words], cwd=cwd, env=bare, capture_output=True, text=True, timeout=LIMIT, **given
    )


def interpreters() -> list[Path]:
    """Every Python that is new enough, one of each minor version."""
    names = [shutil.which(f"python3.{minor}") for minor in range(OLDEST[1], NEWEST_LOOKED_FOR)]
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    found: dict[str, Path] = {}
    for path in (Path(sys.executable), *(Path(name) for name in names if name), *sorted(pyenv.glob("3.*/bin/python"))):
        asked = run(path, "-c", "import sys, venv, ensurepip; print('%d.%d' % sys.version_info[:2])", cwd=ROOT)
        version = asked.stdout.strip()
        if asked.returncode == 0 and tuple(map(int, version.split("."))) >= OLDEST:
            found.setdefault(version, path)
    return list(found.values())


def build(work: Path) -> Path:
    """Wheel and source archive in `dist/`; the wheel."""
    shutil.rmtree(DIST, ignore_errors=True)
    tools = environment(Path(sys.executable), work / "tools")
    run(tools, "-m", "pip", "install", "--quiet", "build", cwd=work, check=True)
    done = run(tools, "-m", "build", "--outdir", DIST, ROOT, cwd=work)
    if done.returncode:
        raise SystemExit(f"the build failed:\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}")
    return next(DIST.glob("*.whl"))


def environment(python: Path, folder: Path) -> Path:
    """A new, empty environment; its interpreter."""
    run(python, "-m", "venv", folder, cwd=folder.parent, check=True)
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def trial(python: Path, wheel: Path, work: Path) -> Trial:
    """Install the wheel under one interpreter and try it."""
    version = run(python, "-c", "import platform; print(platform.python_version())", cwd=work).stdout.strip()
    inside = environment(python, work / f"python{version}")
    jshell = inside.with_name("jshell")
    steps = (
        ("install", (inside, "-m", "pip", "install", "--quiet", wheel)),
        ("jshell --version", (jshell, "--version")),
        ("jshell doctor", (jshell, "doctor", "--json")),
        ("a first fit", (inside, "-c", FIRST_FIT)),
        (
            "example data",
            (inside, "-c", "import jshell as js; print(js.io.read_trace(js.io.example('attached_R_HW.csv')))"),
        ),
        ("jshell rest", (jshell, "rest", "--preset", "R", "--json")),
    )
    said = {}
    for name, words in steps:
        done = run(*words, cwd=work)
        if done.returncode:
            return Trial(version, name, (done.stdout + done.stderr)[-2000:])
        said[name] = done.stdout.strip()
    looked = json.loads(said["jshell doctor"])
    places = run(inside, "-c", "import jshell; print(jshell.__file__)", cwd=work).stdout.strip()
    if not places.startswith(str(work)):
        return Trial(version, "import", f"imported from {places}, not from the wheel")
    words = f"jax {looked['versions']['jax']}, numpy {looked['versions']['numpy']}; {said['a first fit']}"
    return Trial(version, "passed", words)


def main(*given: str) -> int:
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder).resolve()
        wheel = build(work)
        sizes = ", ".join(f"{path.name} {path.stat().st_size / 1e6:.1f} MB" for path in sorted(DIST.iterdir()))
        print(sizes, flush=True)
        trials = []
        for python in [Path(path) for path in given] or interpreters():
            trials.append(trial(python, wheel, work))
            print(f"Python {trials[-1].version}: {trials[-1].step}: {trials[-1].words}", flush=True)
    return 0 if trials and all(one.passed for one in trials) else 1


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:]))
