"""What the pages show runs; what is public is on a page; what a page names exists."""

import importlib
import inspect
import json
import pkgutil
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

import jshell
from jshell import errors
from jshell.cli.main import app
from jshell.errors import JshellError, Outcome

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted((*DOCS.glob("*.md"), *DOCS.glob("howto/*.md"), *DOCS.glob("api/*.md")))
README = DOCS.parent / "README.md"
FENCE = re.compile(r"^```(python|sh|\{code-cell\} python)\n(.*?)^```$", re.S | re.M)
ELSEWHERE = ("serve", "submit", "campaign", "figures", "demo")  # wait for a server, or have tests of their own
PYTHON = re.compile(r"^(<!-- slow -->\n)?```python\n(.*?)^```$", re.S | re.M)
EXECUTED = re.compile(r"^```\{code-cell\} python\n(.*?)^```$", re.S | re.M)  # by the build of the pages
SHELL = re.compile(r"^```sh\n(.*?)^```$", re.S | re.M)
ROOMS = [room.name for room in pkgutil.iter_modules(jshell.__path__) if room.ispkg and room.name != "cli"]
FILES = [f"jshell.{file.stem}" for file in sorted(Path(jshell.__path__[0]).glob("[a-z]*.py"))]


def blocks(page: Path) -> list[tuple[bool, str]]:
    """Whether a block takes many seconds, and the block."""
    return [(bool(mark), block) for mark, block in PYTHON.findall(page.read_text(encoding="utf-8"))]


def name_of(page: Path) -> str:
    return str(page.relative_to(DOCS.parent))


def as_notebook(page: Path) -> bool:
    """Whether the page is executed when the pages are built."""
    return page.read_text(encoding="utf-8").startswith("---\nfile_format: mystnb\n")


WITH_PYTHON = [page for page in PAGES if blocks(page) and not as_notebook(page)]
WHOLE = [page for page in (README, *PAGES) if FENCE.search(page.read_text(encoding="utf-8"))]


@pytest.mark.filterwarnings("default::jshell.errors.RangeWarning", "default::jshell.calibration.FitWarning")
@pytest.mark.parametrize("page", WITH_PYTHON, ids=name_of)
def test_python_blocks_run_as_they_stand(page, tmp_path, monkeypatch):
    """One after another in one namespace; those marked `<!-- slow -->` run with the whole page."""
    monkeypatch.chdir(tmp_path)
    names: dict = {"__name__": "__main__"}
    for number, (long, block) in enumerate(blocks(page), 1):
        if not long:
            exec(compile(block, f"{name_of(page)}, block {number}", "exec"), names)


def lines_of(block: str) -> list[str]:
    """The lines of a terminal block that call jshell, comments taken off."""
    return [line.partition("  #")[0].strip() for line in block.splitlines() if line.startswith("jshell ")]


@pytest.mark.slow
@pytest.mark.filterwarnings("default::UserWarning")
@pytest.mark.parametrize("page", WHOLE, ids=name_of)
def test_whole_pages_run_python_and_terminal_in_their_order(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").symlink_to(DOCS.parent / "data")
    if page == README:
        assert CliRunner().invoke(app, ["demo", "--out", "out/demo"]).exit_code == 0
    names: dict = {"__name__": "__main__"}
    for kind, block in FENCE.findall(page.read_text(encoding="utf-8")):
        if kind != "sh":
            exec(compile(block, f"{name_of(page)}: {block[:40]}", "exec"), names)
        for line in lines_of(block) if kind == "sh" else ():
            verb = shlex.split(line)[1]
            if verb not in ELSEWHERE:
                answer = CliRunner().invoke(app, shlex.split(line)[1:])
                assert answer.exit_code in (0, 3), (line, answer.output, answer.exception)


def test_terminal_lines_name_verbs_and_options_that_exist():
    found = [block for page in PAGES for block in SHELL.findall(page.read_text(encoding="utf-8"))]
    lines = [line for block in found for line in lines_of(block)]
    assert len(lines) >= 12
    shown: dict[tuple[str, ...], str] = {}

    def help_of(*verbs: str) -> str:
        if verbs not in shown:
            answer = CliRunner().invoke(app, [*verbs, "--help"], env={"COLUMNS": "200", "NO_COLOR": "1"})
            assert answer.exit_code == 0, verbs
            shown[verbs] = answer.stdout
        return shown[verbs]

    for line in lines:
        verb, *words = shlex.split(line)[1:]
        text = help_of(verb, words[0]) if "COMMAND" in help_of(verb) else help_of(verb)
        for option in (word for word in words if word.startswith("--")):
            assert re.search(rf"{re.escape(option)}\b", text), line


def documented_in(page: Path) -> tuple[set[str], set[str]]:
    """What a page documents by name, and the modules whose members it lists."""
    found = re.findall(r"^\.\. auto(\w+):: (\S+)\n((?:   .*\n)*)", page.read_text(encoding="utf-8"), re.M)
    whole = {path for kind, path, options in found if kind == "module" and ":members:\n" in options}
    left_out = {
        f"{path}.{name}"
        for _, path, options in found
        for line in re.findall(r":exclude-members: (.*)", options)
        for name in line.split(", ")
    }
    named = {path for _, path, _ in found}
    for path in whole:
        named |= {f"{path}.{name}" for name in public(importlib.import_module(path))} - left_out
    return named, whole


def public(module: object) -> list[str]:
    """Functions and classes that a module makes."""
    made = {name: x for name, x in vars(module).items() if callable(x) and not name.startswith("_")}
    return [name for name, x in made.items() if getattr(x, "__module__", "") == vars(module)["__name__"]]


@pytest.mark.parametrize("room", ["", *ROOMS])
def test_every_public_name_is_on_a_page_of_the_api(room):
    package = importlib.import_module(f"jshell.{room}".rstrip("."))
    names = list(getattr(package, "__all__", ()))
    if not room:
        written = (DOCS / "api" / "index.md").read_text(encoding="utf-8")
        missing = [name for name in names if f"`{name}`" not in written]
    elif names:
        documented, _ = documented_in(DOCS / "api" / f"{room}.md")
        of_room = {name: getattr(package, name) for name in names}
        full = {n: x.__name__ if inspect.ismodule(x) else f"jshell.{room}.{n}" for n, x in of_room.items()}
        missing = [name for name in names if full[name] not in documented]
        # and what the room's public modules make, unless the room's own door leads to it
        for module in filter(inspect.ismodule, of_room.values()):
            inside = [n for n in public(module) if not any(getattr(module, n) is x for x in of_room.values())]
            missing += [f"{module.__name__}.{n}" for n in inside if f"{module.__name__}.{n}" not in documented]
    else:
        missing = []
    assert not missing, f"add to docs/api/{room or 'index'}.md: {missing}"


@pytest.mark.parametrize("module", FILES)
def test_every_file_that_all_rooms_share_is_on_its_page(module):
    documented, _ = documented_in(DOCS / "api" / "common.md")
    missing = [name for name in public(importlib.import_module(module)) if f"{module}.{name}" not in documented]
    assert not missing, f"add to docs/api/common.md: {missing}"


def test_what_the_pages_and_notebooks_import_is_public():
    """A reader may rely on what is shown to him: a room, a name of its `__all__`, or of one of its public modules."""
    shown = [block for page in (README, *PAGES) for _, block in blocks(page)]
    shown += [block for page in PAGES for block in EXECUTED.findall(page.read_text(encoding="utf-8"))]
    for book in sorted((DOCS.parent / "notebooks").glob("*.ipynb")):
        shown += ["".join(cell["source"]) for cell in json.loads(book.read_text(encoding="utf-8"))["cells"]]
    found = re.findall(r"^from (jshell[\w.]*) import (.+)$", "\n".join(shown), re.M)
    assert len(found) >= 20
    for path, names in found:
        _, _, inner = path.partition(".")
        room, _, rest = inner.partition(".")
        if rest:
            assert rest in importlib.import_module(f"jshell.{room}").__all__, path
        module = importlib.import_module(path)
        offered = set(getattr(module, "__all__", public(module))) | set(ROOMS if path == "jshell" else ())
        assert {name.strip() for name in names.split(",")} <= offered, (path, names)


@pytest.mark.parametrize("page", sorted(DOCS.glob("api/*.md")), ids=name_of)
def test_what_the_api_pages_document_exists(page):
    for path in re.findall(r"^\.\. auto(?:class|function|data):: (\S+)$", page.read_text(encoding="utf-8"), re.M):
        module, _, name = path.rpartition(".")
        assert hasattr(importlib.import_module(module), name), path


def test_every_outcome_and_every_error_has_its_row():
    page = (DOCS / "howto" / "outcomes.md").read_text(encoding="utf-8")
    rows = set(re.findall(r"^\| `(\w+)` \|", page, re.M))
    known = [kind for kind in vars(errors).values() if inspect.isclass(kind) and issubclass(kind, JshellError)]
    wanted = {outcome.word for outcome in Outcome} | {kind.code for kind in known if kind is not JshellError}
    assert wanted <= rows, wanted - rows


def test_links_lead_somewhere():
    for page in PAGES:
        for link in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / link).exists(), (name_of(page), link)


def test_links_of_notebooks_lead_somewhere():
    for path in (DOCS.parent / "notebooks").glob("*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        text = "".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
        for link in re.findall(r"\]\((?!https?:)([^)#]+)\)", text):
            assert (path.parent / link).exists(), (path.name, link)


def test_pages_are_in_a_table_of_contents():
    listed = {DOCS / "index.md"}
    for page in PAGES:
        for block in re.findall(r"^```\{toctree\}\n(.*?)^```$", page.read_text(encoding="utf-8"), re.S | re.M):
            entries = [line.strip() for line in block.splitlines() if line.strip() and not line.startswith(":")]
            listed |= {page.parent / f"{entry}.md" for entry in entries}
    assert set(PAGES) <= listed, set(PAGES) - listed


@pytest.mark.slow
def test_the_pages_build_without_a_warning(tmp_path):
    pytest.importorskip("sphinx", reason="no Sphinx: pip install 'jshell[docs]'")
    words = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", str(DOCS), str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "api" / "calibration.html").exists()
