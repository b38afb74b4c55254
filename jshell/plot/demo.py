"""The whole story on one page: shape, modes, snap, ring-down, master curve, recording."""

from collections.abc import Mapping

import numpy as np

from jshell.calibration.report import FitResult
from jshell.dynamics.vibrations import Modes
from jshell.membrane import RestShape
from jshell.plot.frequencies import master_curve
from jshell.plot.shapes import mode_shape, rest_shape
from jshell.plot.style import PAGE, Figure, new_figure, style
from jshell.plot.traces import SPHERE, channel, identified_modes
from jshell.signals import Signature
from jshell.trace import Trace

WIDTHS = (1.0, 1.0, 1.0, 1.25)  # of the upper row
HEIGHTS = (0.88, 1.0)  # low enough that the shapes, of equal scales, fill their row


def overview(
    rest: RestShape,
    modes: Modes,
    trace: Trace,
    signature: Signature,
    table: Mapping[str, object],
    table_fit: FitResult | None,
    recording: Trace,
    recording_signature: Signature,
) -> Figure:
    """One page of a shell: (a) at rest, (b) its two modes, (c) its snap, (d) the modes after it,
    (e) the frequencies of many shells, (f) a recording.

    Args:
        rest: Shape at rest.
        modes: Its vibrations, two at least.
        trace: A simulation with V and S, snap included.
        signature: Its modes.
        table: Frequencies of many shells, as `jshell.calibration.fit_frequencies` takes them.
        table_fit: Its result, where there is one.
        recording: What a camera saw: H at least. Drawn in SI where it knows its scales.
        recording_signature: Its modes.
    """
    with style():
        figure = new_figure(PAGE)
        above, below = np.asarray(figure.subfigures(2, 1, height_ratios=HEIGHTS))
        panel = above.subplot_mosaic([["a", "b", "B", "c"]], width_ratios=WIDTHS)
        panel |= below.subplot_mosaic([["d", "e", "f"]])
        rest_shape(rest, panel["a"])
        for key, k in (("b", 0), ("B", 1)):
            mode_shape(modes, k, panel[key])
        panel["B"].set_ylabel("")
        panel["B"].tick_params(labelleft=False)

        channel(trace, "V", panel["c"], window=signature.window)
        channel(trace, "S", panel["c"], mark_dip=False)
        panel["c"].set_ylabel(", ".join(SPHERE[name][1] for name in ("V", "S")))
        handles, words = panel["c"].get_legend_handles_labels()
        named = dict(zip(words, handles, strict=True))
        order = [SPHERE["V"][1], SPHERE["S"][1], "dip", "window"]
        order = [word for word in order if word in named]
        panel["c"].legend([named[word] for word in order], order, loc="center right")
        identified_modes(trace, signature, ax=panel["d"])
        master_curve(table, table_fit, panel["e"])
        identified_modes(recording, recording_signature, "H", panel["f"], laboratory=recording.scales is not None)

        titles = {
            "a": "shape at rest",
            "b": "slow mode",
            "B": "fast mode",
            "c": "snap",
            "d": "ring-down",
            "e": "frequencies of many shells",
            "f": "recording",
        }
        for key, words in titles.items():
            letter = "" if key == "B" else rf"$\bf{{({key})}}$  "
            panel[key].set_title(f"{letter}{words}", loc="left")
    return figure
