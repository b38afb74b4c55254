"""Notebooks and guides run as they stand, draw what they promise and end with a number; none stores its outputs.

What `make docs` has executed is not executed again, and what is executed here serves the pages. Guides and pages are
as dear as all numbered notebooks several times over: `make docs` executes them, and `make slow` asks for them.
"""

import importlib.util
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
PAGES = sorted(
    page for page in (ROOT / "docs").rglob("*.md") if page.read_text("utf-8").startswith("---\nfile_format: mystnb\n")
)
PICTURES = 60
GUIDES = {"camera", "ultrasound", "soft_robot", "theorist", "programmer"}


def script(name="execute"):
    """A script of the documentation as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_there_is_a_guide_for_every_user():
    assert {book.stem.removeprefix("guide_") for book in BOOKS if book.stem.startswith("guide_")} == GUIDES
    assert len(BOOKS) >= 10 + len(GUIDES)


@pytest.mark.parametrize("book", BOOKS, ids=lambda book: book.stem)
def test_no_outputs_are_stored(book):
    cells = json.loads(book.read_text(encoding="utf-8"))["cells"]
    assert all(not cell["outputs"] and cell["execution_count"] is None for cell in cells if "outputs" in cell)


def told_apart(source):
    """A source that only `make docs` and `make slow` execute is marked."""
    dear = source.suffix == ".md" or source.stem.startswith(("guide_", "10_"))
    return pytest.param(source, id=source.stem, marks=[pytest.mark.slow] if dear else [])


@pytest.mark.parametrize("book", [told_apart(one) for one in BOOKS])
def test_every_cell_runs_and_the_last_prints_a_number(book):
    pytest.importorskip("nbclient", reason="pip install 'jshell[docs]'")
    book = script().executed(book)
    cells = [cell for cell in book.cells if cell.cell_type == "code"]
    assert pictures(book), "no picture"
    printed = ["".join(one.get("text", "") for one in cell.outputs if one.get("name") == "stdout") for cell in cells]
    assert re.search(r"\d\.\d|\d %", printed[-1]), "no number at the end"
    assert not re.search(r"\bnan\b", "".join(printed).lower())


def pictures(book) -> int:
    shown = [output for cell in book.cells for output in cell.get("outputs", ())]
    return sum(bool({"image/png", "image/gif"} & set(one.get("data", ()))) for one in shown)


@pytest.mark.parametrize("page", [told_apart(one) for one in PAGES])
def test_every_page_with_code_runs_and_draws(page):
    pytest.importorskip("nbclient", reason="pip install 'jshell[docs]'")
    assert pictures(script().executed(page))


def test_every_how_to_is_executed():
    assert {page.stem for page in (ROOT / "docs" / "howto").glob("*.md")} - {"index"} <= {page.stem for page in PAGES}


def test_the_documentation_shows_what_it_speaks_of():
    """Every picture stands beside what draws it: in the cell above it, or by name on its page."""
    listed = script("pictures").listed()
    assert len(listed) >= PICTURES
    for page, line in listed:
        text = (ROOT / page).read_text(encoding="utf-8")
        assert json.dumps(line)[1:-1] in text or line in text, (page, line)


def test_what_was_executed_is_kept_until_code_changes(tmp_path, monkeypatch):
    execute = script()
    monkeypatch.setattr(execute, "CACHE", tmp_path / "cache")
    monkeypatch.setattr(execute, "digest", lambda: "one")
    page = tmp_path / "page.md"
    page.write_text(
        "---\nfile_format: mystnb\nkernelspec:\n  name: python3\n---\n\n```{code-cell}\nprint(6 * 7)\n```\n"
    )
    assert execute.executed(page).cells[0].outputs[0].text == "42\n"
    monkeypatch.setattr(execute, "run", lambda source: pytest.fail("executed twice"))
    assert execute.executed(page).cells[0].outputs[0].text == "42\n"
    assert execute.missing(execute.kept(), [page]) == []
    monkeypatch.setattr(execute, "digest", lambda: "another")
    assert execute.missing(execute.kept(), [page]) == [page]
