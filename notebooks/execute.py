"""Execute the notebooks, each in a kernel of its own, and keep what they show.

    python notebooks/execute.py [OUT [NAME ...]]     by default all of them, into out/notebooks

Writes `NAME.ipynb` with outputs and `NAME-1.png`, … for every picture. With `JSHELL_QUICK` in the environment
they run reduced.
"""

import base64
import sys
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient

HERE = Path(__file__).parent
LIMIT = 600  # seconds for one cell


def execute(source: Path, out: Path) -> int:
    """Run one notebook and write it with its outputs; how many pictures it drew."""
    book = nbformat.read(source, as_version=4)
    NotebookClient(book, timeout=LIMIT, kernel_name="python3", resources={"metadata": {"path": str(HERE)}}).execute()
    nbformat.write(book, out / source.name)
    shown = [output["data"] for cell in book.cells for output in cell.get("outputs", ()) if "data" in output]
    pictures = [data["image/png"] for data in shown if "image/png" in data]
    for number, picture in enumerate(pictures, 1):
        (out / f"{source.stem}-{number}.png").write_bytes(base64.b64decode(picture))
    return len(pictures)


def main(out: str = "out/notebooks", *names: str) -> None:
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    for source in sorted(HERE.glob("*.ipynb")):
        if names and source.stem not in names:
            continue
        began = time.perf_counter()
        pictures = execute(source, folder)
        print(f"{source.stem}: {pictures} pictures, {time.perf_counter() - began:.0f} s", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
