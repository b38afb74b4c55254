"""How the terminal starts: help without JAX, and programs compiled once."""

import ast
import importlib
import inspect
import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

import jshell
from jshell import oscillator, programs
from jshell.cli import constants, destinations, main, traces
from jshell.dynamics import LONGEST_STEP
from jshell.plot.style import FORMATS

STARTING = 300  # seconds that a process may take on a busy machine; it needs two
RECORDING = Path(__file__).parents[2] / "data" / "examples" / "attached_R_HW.csv"
PLAIN = {"COLUMNS": "200", "NO_COLOR": "1"}
HELP = """
import sys
from typer.testing import CliRunner
from jshell.cli.main import VERBS, app
for words in [], *[[verb] for verb in VERBS]:
    answer = CliRunner().invoke(app, [*words, "--help"])
    assert answer.exit_code == 0, (words, answer.output)
    assert not {"jax", "scipy", "matplotlib"} & set(sys.modules), words
"""


def fresh(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """A process that has none of the tests' settings of JAX."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("JAX_", "TF_CPP", "XDG_", "JSHELL"))}
    return subprocess.run(
        [sys.executable, *words], env=kept | environment, capture_output=True, text=True, timeout=STARTING, check=False
    )


def test_no_help_waits_for_jax(tmp_path):
    done = fresh("-c", HELP, XDG_CACHE_HOME=str(tmp_path))
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", main.VERBS)
def test_the_list_of_verbs_says_what_each_says_of_itself(name):
    module = importlib.import_module(f"jshell.cli.{main.VERBS[name][0]}")
    verb = getattr(module, name, None)
    words = module.app.info.help if verb is None else inspect.getdoc(verb).split("\n\n")[0]
    assert main.VERBS[name][1] == words


def test_the_terminal_asks_of_a_room_only_what_is_at_its_door():
    """A module behind the door is there only where something else has loaded it: a fresh process fails."""
    asked = [
        (path.name, chain.value.attr, chain.attr)
        for path in Path(main.__file__).parent.glob("*.py")
        for chain in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(chain, ast.Attribute)
        and isinstance(chain.value, ast.Attribute)
        and isinstance(chain.value.value, ast.Name)
        and chain.value.value.id == "jshell"
    ]
    assert len(asked) > 20
    doors = {room: getattr(jshell, room) for _, room, _ in asked}
    assert not [one for one in asked if hasattr(doors[one[1]], "__path__") and one[2] not in doors[one[1]].__all__]


def test_defaults_that_help_shows_are_the_rooms_own():
    shown = (constants.ALPHA1, constants.ALPHA2, constants.K_VS, constants.BETA1)
    source = oscillator.SOURCE
    assert shown == (source.alpha1, source.alpha2, source.k_vs, source.beta1)
    assert traces.LONGEST_STEP == LONGEST_STEP
    assert destinations.PICTURES == FORMATS


@pytest.mark.parametrize("words", [("rest",), ("campaign", "run"), ("serve",)])
def test_help_keeps_units_in_brackets(words):
    shown = CliRunner().invoke(main.app, [*words, "--help"], env=PLAIN).stdout
    wanted = {"rest": ("Radius [m]", "[rad]", "[kg/m^3]", "[Pa s]"), "serve": ("[GiB]", "[MiB]")}
    for unit in wanted.get(words[0], ()):
        assert unit in shown


@pytest.mark.long
def test_a_second_process_compiles_nothing_and_says_nothing_of_it(tmp_path):
    words = ("-m", "jshell", "fit", str(RECORDING))
    first = fresh(*words, XDG_CACHE_HOME=str(tmp_path))
    made = sorted(path.name for path in (tmp_path / "jshell" / "programs").rglob("*-cache"))
    assert made, first.stderr
    second = fresh(*words, XDG_CACHE_HOME=str(tmp_path))
    spoiled = next((tmp_path / "jshell" / "programs").rglob("*-cache"))  # as a process leaves it that is killed
    spoiled.write_bytes(spoiled.read_bytes()[:100])
    third = fresh(*words, XDG_CACHE_HOME=str(tmp_path))
    assert sorted(path.name for path in (tmp_path / "jshell" / "programs").rglob("*-cache")) == made
    assert third.stdout == second.stdout == first.stdout
    for done in (first, second, third):
        assert done.returncode == 3  # the recording leaves one constant free
        told = [line.split(":")[0] for line in done.stderr.splitlines()]
        assert told == ["warning", "warning", "trace 1", "rank_deficient"]  # the third says which samples were read


WHERE = "import jshell, jax; print(jax.config.jax_compilation_cache_dir)"


@pytest.mark.long
def test_the_users_word_on_compiled_programs_is_heeded(tmp_path):
    room = tmp_path / "jshell" / "programs"
    for code in (WHERE, WHERE.replace("jshell, jax", "jax, jshell")):  # whichever is imported first
        assert Path(fresh("-c", code, XDG_CACHE_HOME=str(tmp_path)).stdout.strip()).parent == room
        off = fresh("-c", code, XDG_CACHE_HOME=str(tmp_path), JSHELL_PROGRAM_CACHE="off")
        assert off.stdout.strip() == "None", off.stderr
        own = fresh("-c", code, XDG_CACHE_HOME=str(tmp_path), JAX_COMPILATION_CACHE_DIR=str(tmp_path / "own"))
        assert own.stdout.strip() == str(tmp_path / "own"), own.stderr


def test_a_home_that_cannot_be_written_is_no_obstacle(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert programs.place() is None


def test_the_programs_unused_for_longest_go_first(tmp_path):
    for age, name in enumerate(("new", "old", "older", "oldest")):
        (tmp_path / name).write_bytes(bytes(100))
        os.utime(tmp_path / name, (1e9 - age, 1e9 - age))
    programs.trim(tmp_path, 400)
    assert len(list(tmp_path.iterdir())) == 4
    programs.trim(tmp_path, 399)  # down to half of it
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new"]
