"""Data that come with jshell: small files to try things on."""

from importlib import resources
from pathlib import Path

from jshell.errors import choose

EXAMPLES = {
    "attached_R_HW.csv": "examples",
    "attached_R.tif": "films",
    "attached_R_drawn.csv": "films",
    "grid.png": "films",
}


def example(name: str) -> Path:
    """A data file that comes with jshell, from a checkout or from the installed package.

    Args:
        name: `attached_R_HW.csv`: height and width of an attached shell in ms and mm, as a camera would record
            them while it buckles and rings (an independent simulation, sampled at 1 kHz, with noise).
            `attached_R.tif`: a film of such a shell on a rod while it rings, 120 frames; `grid.png`: dots through the
            same lens; `attached_R_drawn.csv`: height and width as they were drawn.

    Raises:
        BadName: No such file.

    Example:
        >>> from jshell.io import example, read_trace
        >>> list(read_trace(example("attached_R_HW.csv")).channels)
        ['H', 'W']
    """
    choose("example", name, tuple(EXAMPLES))
    checkout = Path(__file__).resolve().parents[2] / "data" / EXAMPLES[name] / name
    return checkout if checkout.exists() else Path(str(resources.files("jshell") / "examples" / name))
