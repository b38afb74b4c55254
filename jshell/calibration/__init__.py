"""From frequencies and traces to the constants of the short model, with their uncertainty."""

# pyright: reportUnsupportedDunderAll=false

from typing import TYPE_CHECKING

from jshell.lazy import lazy
from jshell.renamed import renamed

if TYPE_CHECKING:
    from jshell.calibration import least_squares, losses, master_curve, trajectories, uncertainty
    from jshell.calibration.batch import fit_batch
    from jshell.calibration.batch_result import BatchResult
    from jshell.calibration.bootstrap import Bootstrap, bootstrap_frequencies
    from jshell.calibration.comparison import ModelComparison, compare
    from jshell.calibration.estimate import Estimate, ParameterTable, Start
    from jshell.calibration.inverse import fit_conditions
    from jshell.calibration.loaded import load
    from jshell.calibration.losses import trace_loss
    from jshell.calibration.master_curve import fit_frequencies
    from jshell.calibration.nonlinear import NonlinearFits, fit_nonlinear
    from jshell.calibration.options import FitOptions, Prior
    from jshell.calibration.recordings import Recordings
    from jshell.calibration.recordings_file import load_recordings, save_recordings
    from jshell.calibration.refits import Refits
    from jshell.calibration.report import FitResult, FitWarning
    from jshell.calibration.trajectories import fit_trajectories, prepare

__all__ = [
    "BatchResult", "Bootstrap", "Estimate", "FitOptions", "FitResult", "FitWarning", "ModelComparison", "NonlinearFits",
    "ParameterTable", "Prior", "Recordings", "Refits", "Start", "bootstrap_frequencies", "compare", "fit_batch",
    "fit_conditions", "fit_frequencies", "fit_nonlinear", "fit_trajectories", "least_squares", "load",
    "load_recordings", "losses", "master_curve", "prepare", "save_recordings", "trace_loss", "trajectories",
    "uncertainty",
]  # fmt: skip
_HOMES = {
    "BatchResult": "batch_result", "Bootstrap": "bootstrap", "ModelComparison": "comparison", "Estimate": "estimate",
    "FitOptions": "options", "FitResult": "report", "FitWarning": "report", "NonlinearFits": "nonlinear",
    "ParameterTable": "estimate", "Prior": "options", "Recordings": "recordings", "Refits": "refits",
    "Start": "estimate", "bootstrap_frequencies": "bootstrap", "compare": "comparison", "fit_batch": "batch",
    "fit_conditions": "inverse", "fit_frequencies": "master_curve", "fit_nonlinear": "nonlinear",
    "fit_trajectories": "trajectories", "least_squares": "", "load": "loaded", "load_recordings": "recordings_file",
    "losses": "", "master_curve": "", "prepare": "trajectories", "save_recordings": "recordings_file",
    "trace_loss": "losses", "trajectories": "", "uncertainty": "",
}  # fmt: skip
__getattr__, __dir__ = lazy(
    __name__, _HOMES, renamed(__name__, {"Comparison": "ModelComparison", "campaign": "jshell.paper:joint_fits"})
)
