"""The pictures that are kept in `docs/images`: those of the README, which is read where nothing is executed.

python docs/pictures.py        a minute. `make demo` draws `demo.png`, benchmarks/symmetry.py `symmetry_map.png`
python docs/pictures.py list   every picture of the documentation, with its page and the line that draws it
"""

import json
import re
import sys
from pathlib import Path

import numpy as np

import jshell as js
from jshell import plot

DOCS = Path(__file__).parent
IMAGES = DOCS / "images"
# the last line of a cell that shows a picture, and a picture from a file
DRAWN = re.compile(
    r"(figure|plt\.show\(\)|^Image\(.*|\.draw\(material\)|^(js\.)?plot\.(response\.answer|filmstrip)\(.*)$"
)
KEPT = re.compile(r"!\[[^]]*\]\((?:docs/)?(images/[^)]+)\)")
# what draws a file, as its page says
COMMANDS = {"demo.png": "make demo", "symmetry_map.png": "benchmarks/symmetry.py"}
OTHERS = "docs/pictures.py"


def snap() -> None:
    """A shell that snaps, with the liquid's motion, in one row."""
    motion = js.dynamics.record(js.Reduced(0.22, 0.9, 1.62, 0.004), elements=24, duration=50.0, throw=True)
    moments = plot.moments(motion)
    chosen = [moments[k] for k in (0, 2, 3, 4)]
    plot.save(plot.filmstrip(motion, chosen, contours=False), IMAGES / "snap.png")


def fit() -> None:
    """A record with noise, the fit over it, and what the fit leaves."""
    shell = js.Reduced(0.08, 0.9, 1.2, 0.004)
    truth = js.Coefficients.with_decay_time(3.0, 0.85, 0.2, tau=12.0, viscosity=0.004)
    clean = js.oscillator.simulate(shell, truth, initial=(-0.1, 0.05, 0.0, 0.0), times=np.linspace(0, 40, 401))
    record = js.oscillator.add_noise(clean, 0.05, seed=0)
    plot.save(plot.trace_fit(js.fit(record)).flat[0].figure, IMAGES / "fit.png")


def mode() -> None:
    """A shell in three dimensions, moving along a vibration of order 2, seen from all sides."""
    found = js.dynamics.azimuthal_modes(js.presets.R.conditions, 2, elements=16, liquid="ideal")
    plot.rotating(found.rest, 2, found.shapes[0, 0], IMAGES / "mode.gif")


def cells(source: Path) -> list[str]:
    """What a page or notebook executes, block by block."""
    text = source.read_text(encoding="utf-8")
    if source.suffix == ".md":
        return re.findall(r"^```\{code-cell\} python\n(.*?)^```$", text, re.S | re.M)
    return ["".join(cell["source"]) for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]


def listed() -> list[tuple[str, str]]:
    """Every picture: the page that shows it, and the line there that draws it."""
    found = []
    pages = (
        DOCS.parent / "README.md",
        *sorted(DOCS.rglob("*.md")),
        *sorted((DOCS.parent / "notebooks").glob("*.ipynb")),
    )
    for page in pages:
        name = str(page.relative_to(DOCS.parent))
        if page.suffix == ".md":
            for kept in KEPT.findall(page.read_text(encoding="utf-8")):
                found.append((name, COMMANDS.get(Path(kept).name, OTHERS)))
        for cell in cells(page):
            last = cell.strip().splitlines()[-1]
            if DRAWN.search(last):
                found.append((name, last.strip()))
    return found


if __name__ == "__main__":
    if sys.argv[1:] == ["list"]:
        print("\n".join(f"{number:3d}  {page}  {line}" for number, (page, line) in enumerate(listed(), 1)))
    else:
        for draw in (snap, fit, mode):
            draw()
