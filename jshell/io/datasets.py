"""Data that come with jshell: small files to try things on."""

from importlib import resources
from pathlib import Path

from jshell.errors import choose

EXAMPLES = ("attached_R_HW.csv",)


def example(name: str) -> Path:
    """A data file that comes with jshell, from a checkout or from the installed package.

    Args:
        name: `attached_R_HW.csv`: height and width of an attached shell in ms and mm, as a camera would record
            them while it buckles and rings (an independent simulation, sampled at 1 kHz, with noise).

    Raises:
        BadName: No such file.

    Example:
        >>> from jshell.io import example, read_trace
        >>> list(read_trace(example("attached_R_HW.csv")).channels)
        ['H', 'W']
    """
    choose("example", name, EXAMPLES)
    checkout = Path(__file__).resolve().parents[2] / "data" / "examples" / name
    return checkout if checkout.exists() else Path(str(resources.files("jshell") / "examples" / name))
