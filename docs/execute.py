"""Execute the notebooks and the pages with code, two at a time, and keep what they show.

    python docs/execute.py [NAME ...]     by default every notebook and every page with code

What was executed lies in `.jupyter_cache`, where Sphinx finds it, and so do the tests of the notebooks: each is
executed once, until its code, jshell or the shipped data change. Ends with 1 where a cell raised.
"""

import hashlib
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import nbformat
from jupyter_cache import get_cache
from jupyter_cache.base import CacheBundleIn
from myst_nb.core.read import is_myst_markdown_notebook, read_myst_markdown_notebook
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

ROOT = Path(__file__).resolve().parents[1]
CACHE = ROOT / ".jupyter_cache"
LIMIT = 900  # seconds for one cell, on a machine that does other things as well
WORKERS = 2
LOG = re.compile(r"[EWIF]\d{4} \d\d:\d\d|.*TqdmWarning|  from .autonotebook")  # the compiler's, and of bars in Jupyter
WHERE = re.compile(r"\S+\.py:\d+: (?=\w*Warning: )")  # of this machine, in front of a warning
ESCAPE, BAR = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]"), "━━━"
# what takes longest begins first
LONGEST = (
    "08_from_camera",
    "03_buckle_a_shell",
    "gallery",
    "figures",
    "10_is_it_still_round",
    "guide_programmer",
    "guide_theorist",
)


def sources() -> list[Path]:
    """Every notebook, and every page that begins as one."""
    pages = [page for page in (ROOT / "docs").rglob("*.md") if is_myst_markdown_notebook(page.read_text("utf-8"))]
    return sorted((ROOT / "notebooks").glob("*.ipynb")) + sorted(pages)


def read(source: Path) -> nbformat.NotebookNode:
    """A notebook, or a page as one."""
    text = source.read_text(encoding="utf-8")
    if source.suffix == ".md":
        return read_myst_markdown_notebook(text, path=source)
    return nbformat.reads(text, as_version=4)


def digest() -> str:
    """Of all that decides what a cell shows, beside the cell: jshell, its data, the versions of other packages."""
    whole = hashlib.sha256()
    files = [*(ROOT / "jshell").rglob("*.py"), *(ROOT / "data").rglob("*.*"), ROOT / "constraints.txt"]
    for file in sorted(files):
        whole.update(str(file.relative_to(ROOT)).encode() + file.read_bytes())
    return whole.hexdigest()


def folder() -> Path:
    """Where the cache of this jshell lies; another jshell has another."""
    return CACHE / digest()[:12]


def kept():
    """The cache of this jshell."""
    here = folder()
    here.mkdir(parents=True, exist_ok=True)
    return get_cache(here)


def forget_others() -> None:
    """Remove what was kept of other states of jshell."""
    here = folder()
    for other in CACHE.glob("*"):
        if other != here:
            shutil.rmtree(other, ignore_errors=True) if other.is_dir() else other.unlink()


def run(source: Path) -> tuple[nbformat.NotebookNode, float]:
    """Execute in a kernel of its own, in an empty folder.

    Raises:
        CellExecutionError: A cell raised.
    """
    book, began = read(source), time.perf_counter()
    here = str(Path(sys.executable).parent)  # lines that begin with `!` find this jshell
    if here not in os.environ["PATH"].split(os.pathsep):
        os.environ["PATH"] = here + os.pathsep + os.environ["PATH"]
    os.environ["COLUMNS"] = "100"
    with tempfile.TemporaryDirectory() as folder:
        there = {"metadata": {"path": folder}}
        client = NotebookClient(book, timeout=LIMIT, kernel_name="python3", record_timing=False, resources=there)
        client.execute()
    _as_on_paper(book)
    return book, time.perf_counter() - began


def _as_on_paper(book: nbformat.NotebookNode) -> None:
    """Take off a terminal's colours, bars that move, and what no two machines share: places, the compiler's log."""
    for cell in book.cells:
        for output in cell.get("outputs", ()):
            if output.output_type == "stream":
                lines = ESCAPE.sub("", output.text).replace("\r\n", "\n").splitlines(True)
                kept = [line for line in lines if not LOG.match(line) and BAR not in line]
                if output.name == "stderr":  # a warning's words, without its place and the line it repeats
                    kept = [WHERE.sub("", line) for line in kept if not line.startswith("  ")]
                output.text = "".join(kept).lstrip("\n")
        if "outputs" in cell:
            cell.outputs = [one for one in cell.outputs if one.get("text", "something")]


def executed(source: Path) -> nbformat.NotebookNode:
    """A notebook or page with its outputs: those that are kept, else executed now and kept."""
    cache = kept()
    try:
        _, found = cache.merge_match_into_notebook(read(source))
    except KeyError:
        found, seconds = run(source)
        keep(cache, source, found, seconds)
    return found


def keep(cache, source: Path, book: nbformat.NotebookNode, seconds: float) -> None:
    bundle = CacheBundleIn(book, str(source), data={"execution_seconds": seconds})
    cache.cache_notebook_bundle(bundle, check_validity=False, overwrite=True)


def missing(cache, asked: Sequence[Path]) -> list[Path]:
    """What is not kept yet, longest first."""
    found = []
    for source in asked:
        try:
            cache.match_cache_notebook(read(source))
        except KeyError:
            found.append(source)
    return sorted(found, key=lambda one: LONGEST.index(one.stem) if one.stem in LONGEST else len(LONGEST))


def main(*names: str) -> int:
    forget_others()
    cache, failed = kept(), 0
    asked = [source for source in sources() if not names or source.stem in names]
    with ProcessPoolExecutor(WORKERS) as pool:
        work = {pool.submit(run, source): source for source in missing(cache, asked)}
        for done in as_completed(work):
            source = work[done]
            try:
                book, seconds = done.result()
            except CellExecutionError as error:
                failed += 1
                print(f"{source.relative_to(ROOT)}: {error}", file=sys.stderr, flush=True)
                continue
            keep(cache, source, book, seconds)
            print(f"{source.relative_to(ROOT)}: {seconds:.0f} s", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:]))
