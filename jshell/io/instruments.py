"""What instruments write beside their numbers in ways of their own, so that no header rule could find it.

Most files need nothing of this page: their names, units and steps stand where
`titles` and `notes` look. Here are those that write the step among the names
(Rigol), the header beside the numbers (Tektronix), or frames without a name
(DeepLabCut, ImageJ).

Source     files as their makers' manuals print them
"""

import re
from dataclasses import dataclass

from jshell.files import NamedBytes
from jshell.io.layout import EMPTY, NUMBERS, WORDS, Layout, lines, split
from jshell.io.notes import even_of
from jshell.io.sheets import Even
from jshell.io.titles import Titles, parted

_MAKERS = (  # what stands in the first lines, and whose file it is then
    (r"LECROY", "LeCroy"),
    (r"LabVIEW Measurement", "LabVIEW"),
    (r"Digilent", "Digilent WaveForms"),
    (r"Model,(MSO|DPO|MDO|TBS|TDS|MDO)", "Tektronix"),
    (r"x-axis,", "Keysight"),
    (r"scorer,", "DeepLabCut"),
)
_TWICE = re.compile(r"(t0|tInc)\s*=\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*s?")
_BESIDE = ("record length", "sample interval", "trigger point")  # keys of a Tektronix header beside its numbers


@dataclass(frozen=True)
class Known:
    """A file whose maker is known.

    Attributes:
        maker: Whose it is.
        titles: Names and units, where the maker writes them in a way of its own.
        even: Times, where the maker writes step and start in a way of its own.
    """

    maker: str
    titles: Titles | None = None
    even: Even | None = None

    @property
    def in_seconds(self) -> bool:
        """Whether this maker's times are in seconds where no unit stands."""
        return self.maker in ("LeCroy", "LabVIEW", "Tektronix", "Keysight")


def recognise(file: NamedBytes, layout: Layout) -> Known | None:
    """Whose file it is; None where no maker is seen."""
    above = [(number, split(line, layout.mark)) for number, line in layout.above]
    for way in (_rigol, _rigol_line, _tektronix, _frames):
        found = way(file, layout, above)
        if found is not None:
            return found
    head = "\n".join(line for _, line in layout.above)[:400]
    return next((Known(maker) for pattern, maker in _MAKERS if re.search(pattern, head)), None)


Above = list[tuple[int, list[str]]]


def _rigol(file: NamedBytes, layout: Layout, above: Above) -> Known | None:
    """`X,CH1,Start,Increment` over `Sequence,Volt,0,1e-6`: the rows count samples."""
    if len(above) < 2:
        return None
    (number, names), (_, below) = above[-2], above[-1]
    names = names[: len(names) - names[::-1].index(next((name for name in names[::-1] if name), ""))]
    words = [name.lower() for name in names]
    if not {"start", "increment"} <= set(words) or len(below) < len(names) or below[0].lower() != "sequence":
        return None
    header = {key: (below[words.index(key)], f"row {number + 1}") for key in ("start", "increment")}
    size = len(layout.kinds)
    own = [name if name.lower() not in header else "" for name in names] + [""] * size
    units = [None if not name or k == 0 else cell for k, (name, cell) in enumerate(zip(own, below, strict=False))]
    titles = Titles(("sequence", *own[1:size]), tuple([*units, *[None] * size][:size]), number, number)
    return Known("Rigol", titles, even_of(header))


def _rigol_line(file: NamedBytes, layout: Layout, above: Above) -> Known | None:
    """`CH1V,CH2V,t0 = -5e-4, tInc = 1e-7,`: names, start and step in one line."""
    if not above:
        return None
    number, cells = above[-1]
    header = {m[1].lower(): (m[2], f"row {number}") for cell in cells if (m := _TWICE.fullmatch(cell))}
    if "tinc" not in header:
        return None
    size = len(layout.kinds)
    names = [cell for cell in cells if cell and not _TWICE.fullmatch(cell)]
    pairs = [(name[:-1], "V") if re.fullmatch(r"CH\d+V|D\d+V", name) else parted(name) for name in names]
    pairs += [("", None)] * size
    names, units = tuple(one[0] for one in pairs[:size]), tuple(one[1] for one in pairs[:size])
    return Known("Rigol", Titles(names, units, number, number), even_of(header))


def _tektronix(file: NamedBytes, layout: Layout, above: Above) -> Known | None:
    """A header in the first columns beside time and signal in later ones."""
    here = [k for k, kind in enumerate(layout.kinds) if kind == NUMBERS]
    if above or len(here) != 2 or here[0] < 2 or any(layout.kinds[k] not in (EMPTY, WORDS) for k in range(here[0])):
        return None
    header = {}
    for number, line in enumerate(lines(file), 1):
        cells = split(line, layout.mark)
        if number > 60 or len(cells) < 2:
            break
        if cells[0]:
            header[cells[0].lower().rstrip(":")] = cells[1]
    if not any(key in header for key in _BESIDE):
        return None
    names = [""] * len(layout.kinds)
    units: list[str | None] = [None] * len(layout.kinds)
    names[here[0]], units[here[0]] = "t", header.get("horizontal units") or "s"
    names[here[1]], units[here[1]] = header.get("source") or "CH1", header.get("vertical units") or None
    return Known("Tektronix", Titles(tuple(names), tuple(units), None, None))


def _frames(file: NamedBytes, layout: Layout, above: Above) -> Known | None:
    """DeepLabCut: `scorer`, `bodyparts`, `coords` over a column of frames."""
    first = [cells[0].lower() for _, cells in above if cells]
    if first[-3:] != ["scorer", "bodyparts", "coords"]:
        return None
    rows = [cells for _, cells in above[-2:]]
    names = [" ".join(parts) for parts in zip(*rows, strict=False)]
    names[0] = "frame"
    size = len(layout.kinds)
    units = [None if k == 0 or name.endswith("likelihood") else "px" for k, name in enumerate(names)]
    return Known("DeepLabCut", Titles(tuple(names[:size]), tuple(units[:size]), above[-1][0], above[-3][0]))
