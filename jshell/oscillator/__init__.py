"""The short model: a buckled shell as two coupled oscillators, volume and area."""

from jshell.oscillator import coefficients, lagrangian, linear, sampler
from jshell.oscillator.coefficients import SOURCE, Coefficients, decay_time
from jshell.oscillator.linear import damped_modes, matrices, squared_frequencies, stability_margin
from jshell.oscillator.sampler import RandomShell, add_noise, random_shell, random_trace
from jshell.oscillator.simulate import Frequencies, frequencies, simulate

__all__ = [
    "SOURCE", "Coefficients", "Frequencies", "RandomShell", "add_noise", "coefficients", "damped_modes", "decay_time",
    "frequencies", "lagrangian", "linear", "matrices", "random_shell", "random_trace", "sampler", "simulate",
    "squared_frequencies", "stability_margin",
]  # fmt: skip
