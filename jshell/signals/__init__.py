"""From a trace to two frequencies, a decay time and a verdict."""

from jshell.renamed import renamed
from jshell.signals.damped_pair import DampedModes, fit
from jshell.signals.pair_batch import Pairs, extract_batch
from jshell.signals.pencil import rates
from jshell.signals.signature import MEASURED, Signature, extract
from jshell.signals.snap import dip, ring_down_start

__all__ = [
    "MEASURED", "DampedModes", "Pairs", "Signature", "dip", "extract", "extract_batch", "fit", "rates",
    "ring_down_start",
]  # fmt: skip

__getattr__ = renamed(__name__, {"verdict": "jshell.signals.model_selection:by_share"})
