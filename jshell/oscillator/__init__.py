"""The short model: a buckled shell as two coupled oscillators, volume and area."""

from jshell.oscillator import coefficients, ensemble, lagrangian, linear, regimes, sampler, spectrum
from jshell.oscillator.coefficients import SOURCE, Coefficients, decay_time
from jshell.oscillator.decay import Decay, decay_by_law, fitted_decay_time, ringing
from jshell.oscillator.drag import Drag, Reynolds, StokesLayer, drag_coefficient, reynolds_decay_time
from jshell.oscillator.drive import Response, drive
from jshell.oscillator.linear import damped_modes, matrices, squared_frequencies, stability_margin
from jshell.oscillator.regimes import Trajectory, simulate_regimes, thresholds
from jshell.oscillator.response import Bifurcation, ResponseCurve, bifurcation, response_curve
from jshell.oscillator.sampler import RandomShell, add_noise, random_shell, random_trace
from jshell.oscillator.simulate import Frequencies, frequencies, simulate
from jshell.oscillator.simulated import SimulatedDecay, SimulatedModes, simulated_decay, simulated_modes
from jshell.oscillator.softening import Crossing, Drop, crossing, softening
from jshell.oscillator.spectrum import Spectrum, harmonics
from jshell.pressure import Pulse, RaisedCosine, Ramp, Recorded, Step, Sum, Tone, Zero
from jshell.renamed import renamed

__all__ = [
    "SOURCE", "Bifurcation", "Coefficients", "Crossing", "Decay", "Drag", "Drop", "Frequencies", "Pulse",
    "RaisedCosine", "Ramp", "RandomShell", "Recorded", "Response", "ResponseCurve", "Reynolds", "SimulatedDecay",
    "SimulatedModes", "Spectrum", "Step", "StokesLayer", "Sum", "Tone", "Trajectory", "Zero", "add_noise",
    "bifurcation", "coefficients", "crossing", "damped_modes", "decay_by_law", "decay_time", "drag_coefficient",
    "drive", "ensemble", "fitted_decay_time", "frequencies", "harmonics", "lagrangian", "linear", "matrices",
    "random_shell", "random_trace", "regimes", "response_curve", "reynolds_decay_time", "ringing", "sampler",
    "simulate", "simulate_regimes", "simulated_decay", "simulated_modes", "softening", "spectrum",
    "squared_frequencies", "stability_margin", "thresholds",
]  # fmt: skip
__getattr__ = renamed(
    __name__,
    {
        "Passage": "Trajectory",
        "Still": "jshell.pressure:Zero",
        "Swing": "jshell.pressure:RaisedCosine",
        "Together": "jshell.pressure:Sum",
        "follow": "simulate_regimes",
    },
)
