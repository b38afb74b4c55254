"""One look for all figures: colours, sizes, fonts, and how a figure is made and kept.

Matplotlib is loaded by the first call that draws. Figures are made without
`pyplot`, so that no window system is asked for and no figure is left open; the
settings hold while a function draws and are put back after it.

Source     Okabe & Ito 2008 for the colours, told apart by colour-blind eyes
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jshell.errors import BadName, require_extra

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
else:
    Axes = Figure = Any  # the names of the annotations; the classes themselves would load matplotlib

BLACK, GREY, PALE = "#000000", "#7F7F7F", "#D9D9D9"
ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE = "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7"
PALETTE = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)
SLOW, FAST = BLUE, VERMILION
CHANNEL = {"V": GREEN, "S": PURPLE, "H": ORANGE, "W": SKY}

ONE = (4.2, 3.0)  # a single panel [inch]
SQUARE = (3.4, 3.4)
PAGE = (11.0, 7.0)
DPI = 160
FORMATS = (".png", ".pdf", ".svg")

SETTINGS: dict[str, Any] = {
    "font.family": "DejaVu Sans",  # comes with matplotlib and has every symbol of the registry
    "font.size": 8.5,
    "axes.labelsize": 8.5,
    "axes.titlesize": 9.0,
    "axes.titlepad": 6.0,
    "axes.linewidth": 0.7,
    "axes.edgecolor": "#333333",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.unicode_minus": True,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.direction": "out",
    "ytick.direction": "out",
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.5,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "legend.borderaxespad": 0.3,
    "figure.dpi": DPI,
    "savefig.dpi": DPI,
    "pdf.fonttype": 42,  # letters stay letters
    "svg.fonttype": "path",
    "svg.hashsalt": "jshell",  # the same figure is the same file
}


def matplotlib() -> Any:
    """The matplotlib package, loaded now.

    Raises:
        MissingExtra: It is not installed.
    """
    return require_extra("matplotlib", "plot", "jshell.plot")


@contextmanager
def style() -> Iterator[None]:
    """The look of this room while the block lasts; the user's own settings come back after it.

    Example:
        >>> import matplotlib, jshell.plot
        >>> with jshell.plot.style():
        ...     print(matplotlib.rcParams["axes.spines.top"])
        False
        >>> print(matplotlib.rcParams["axes.spines.top"])
        True
    """
    with matplotlib().rc_context(SETTINGS):
        yield


def use_style() -> None:
    """The look of this room for all that the session draws from here on: for the first cell of a notebook."""
    matplotlib().rcParams.update(SETTINGS)


def new_figure(size: tuple[float, float] = ONE) -> Figure:
    """An empty figure that belongs to no window; as the last value of a notebook's cell it shows itself."""
    matplotlib()
    return _kind_of_figure()(figsize=size, layout="constrained")


@cache
def _kind_of_figure() -> Any:
    from matplotlib.figure import Figure

    class Picture(Figure):
        """A figure that notebooks can show without `pyplot`."""

        def _repr_png_(self) -> bytes:
            written = BytesIO()
            with style():
                self.savefig(written, format="png", dpi=DPI)
            return written.getvalue()

    return Picture


def axes_or_new(ax: Axes | None, size: tuple[float, float] = ONE) -> Axes:
    """The axes given, or those of a new figure; call inside `style()`."""
    return new_figure(size).add_subplot() if ax is None else ax


def save(figure: Figure, path: str | Path) -> Path:
    """Write a figure; the ending of the name chooses png, pdf or svg.

    Raises:
        BadName: Another ending.
    """
    target = Path(path)
    if target.suffix.lower() not in FORMATS:
        raise BadName(
            f"figure {target.name!r}",
            found=f"ending {target.suffix!r}",
            expected=" or ".join(FORMATS),
            remedy="Choose one of them.",
        )
    undated = {".png": {}, ".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
    with style():
        figure.savefig(target, dpi=DPI, metadata=undated[target.suffix.lower()])
    return target
