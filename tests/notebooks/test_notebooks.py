"""Notebooks and guides run as they stand, draw what they promise and end with a number; none stores its outputs.

What `make docs` has executed is not executed again, and what is executed here serves the pages.
"""

import importlib.util
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
GUIDES = {"camera", "ultrasound", "soft_robot", "theorist", "programmer"}


def script():
    """`docs/execute.py` as a module."""
    spec = importlib.util.spec_from_file_location("execute", ROOT / "docs" / "execute.py")
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


@pytest.mark.parametrize("book", BOOKS, ids=lambda book: book.stem)
def test_every_cell_runs_and_the_last_prints_a_number(book):
    pytest.importorskip("nbclient", reason="pip install 'jshell[docs]'")
    cells = [cell for cell in script().executed(book).cells if cell.cell_type == "code"]
    shown = [output for cell in cells for output in cell.outputs]
    assert [one for one in shown if {"image/png", "image/gif"} & set(one.get("data", ()))], "no picture"
    printed = ["".join(one.get("text", "") for one in cell.outputs if one.get("name") == "stdout") for cell in cells]
    assert re.search(r"\d\.\d|\d %", printed[-1]), "no number at the end"
    assert not re.search(r"\bnan\b", "".join(printed).lower())


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
