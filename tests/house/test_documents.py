"""What the documents show runs, and says what they say."""

import doctest
import importlib
import pkgutil
import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

import jshell
from jshell.cli.main import app, load
from jshell.cli.output import UsageError

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
MODULES = [module.name for module in pkgutil.walk_packages(jshell.__path__, "jshell.") if "__main__" not in module.name]
WITH_EXAMPLES = [name for name in MODULES if ">>>" in (importlib.import_module(name).__loader__.get_source(name) or "")]


@pytest.mark.long
@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples_in_docstrings_print_what_they_say(name):
    module = importlib.import_module(name)
    names = vars(module) | {"jnp": importlib.import_module("jax.numpy"), "np": importlib.import_module("numpy")}
    finder = doctest.DocTestFinder(exclude_empty=True)
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    for test in finder.find(module, name, globs=names):
        runner.run(test)
    assert runner.summarize(verbose=False).failed == 0


@pytest.mark.long
def test_the_readmes_python_example_finds_the_modes_of_the_snap():
    block = re.search(r"```python\n(.*?)```", README, re.S)
    assert block is not None
    names: dict = {}
    exec(block.group(1), names)
    assert names["found"].omega_minus == pytest.approx(1.07, abs=0.05)  # an independent code


def test_the_readmes_terminal_lines_name_verbs_and_options_that_exist():
    lines = re.findall(r"^jshell (.+?)(?:\s+#.*)?$", README, re.M)
    assert len(lines) >= 8
    for line in lines:
        verb, *words = shlex.split(line)
        shown = CliRunner().invoke(app, [verb, "--help"], env={"COLUMNS": "200", "NO_COLOR": "1"})
        assert shown.exit_code == 0, verb
        for option in (word for word in words if word.startswith("--")):
            assert option in shown.stdout, (verb, option)


def test_every_terminal_line_of_the_pages_is_one_that_the_terminal_takes():
    """Read by the verb's own parser, which refuses options that do not exist and misses those that are required."""
    lines = {
        (page.name, line)
        for page in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
        for block in re.findall(r"^```sh\n(.*?)^```$", page.read_text(encoding="utf-8"), re.S | re.M)
        for line in re.findall(r"^jshell (.+?)(?:\s+#.*)?$", block.replace("\\\n", " "), re.M)
    }
    assert len(lines) > 50
    for page, line in sorted(lines):
        verb, *words = shlex.split(line)
        if "--help" in words:
            continue
        command = load(verb)
        if verb == "campaign":
            command = command.commands[words.pop(0)]
        command.make_context(f"{verb} in {page}", words)  # raises what the terminal would refuse


def test_a_line_without_what_its_verb_requires_is_refused():
    for line in ("bifurcation --preset R", "drive --preset R --pulsation 1"):
        verb, *words = line.split()
        with pytest.raises(UsageError):
            load(verb).make_context(verb, words)


def test_the_readme_shows_the_two_commands():
    assert "make demo" in README
    assert "make test" in README
    steps = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    for target in ("make test", "make test-long", "make test-apart"):  # nothing is left to nobody
        assert any(step.split("#")[0].strip() == target for step in steps), target


def test_links_in_the_documents_lead_somewhere():
    for document in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        for link in re.findall(r"\]\(([^)#]+)\)", document.read_text(encoding="utf-8")):
            assert (document.parent / link).exists(), (document.name, link)
