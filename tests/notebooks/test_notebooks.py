"""The notebooks run, reduced, draw what they promise and end with a number; none stores its outputs."""

import contextlib
import importlib.util
import io
import json
import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "notebooks"
BOOKS = sorted(FOLDER.glob("*.ipynb"))
NINE = 9


def cells(book: Path) -> list[dict]:
    return json.loads(book.read_text(encoding="utf-8"))["cells"]


def code(book: Path) -> list[str]:
    return ["".join(cell["source"]) for cell in cells(book) if cell["cell_type"] == "code"]


def test_there_are_nine():
    assert len(BOOKS) == NINE


@pytest.mark.parametrize("book", BOOKS, ids=lambda book: book.stem)
def test_no_outputs_are_stored(book):
    assert all(not cell["outputs"] and cell["execution_count"] is None for cell in cells(book) if "outputs" in cell)


# what the laws say of themselves outside their range belongs to the story that a notebook tells
@pytest.mark.filterwarnings("default::jshell.errors.RangeWarning", "default::jshell.calibration.FitWarning")
@pytest.mark.parametrize("book", BOOKS, ids=lambda book: book.stem)
def test_every_cell_runs_reduced_and_the_last_prints_a_number(book, monkeypatch):
    matplotlib = pytest.importorskip("matplotlib")
    monkeypatch.setenv("JSHELL_QUICK", "1")
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    drawn = []
    monkeypatch.setattr(plt, "show", lambda: drawn.extend(plt.get_fignums()))
    monkeypatch.chdir(FOLDER)
    names: dict = {"__name__": "__main__"}
    printed: list[str] = []
    try:
        for number, source in enumerate(code(book), 1):
            words = io.StringIO()
            with contextlib.redirect_stdout(words):
                exec(compile(source, f"{book.name}, code cell {number}", "exec"), names)
            printed.append(words.getvalue())
    finally:
        plt.close("all")
    assert drawn, "no picture"
    assert re.search(r"\d\.\d|\d %", printed[-1]), "no number at the end"
    assert not re.search(r"\bnan\b", "".join(printed).lower())


@pytest.mark.slow
def test_the_notebooks_run_at_full_size_in_kernels_of_their_own(tmp_path):
    spec = importlib.util.spec_from_file_location("execute", FOLDER / "execute.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    for book in BOOKS:
        assert script.execute(book, tmp_path) >= 1, book.name
