"""From frequencies and traces to the constants of the short model, with their uncertainty."""

from jshell.calibration import least_squares, losses, master_curve, trajectories, uncertainty
from jshell.calibration.losses import trace_loss
from jshell.calibration.master_curve import fit_frequencies
from jshell.calibration.report import Estimate, FitResult, FitWarning, Start
from jshell.calibration.trajectories import fit_trajectories, prepare

__all__ = [
    "Estimate", "FitResult", "FitWarning", "Start", "fit_frequencies", "fit_trajectories", "least_squares", "losses",
    "master_curve", "prepare", "trace_loss", "trajectories", "uncertainty",
]  # fmt: skip
