"""Random buckled shells whose constants are known: what a fit is examined on.

Symbols    d̂, P̂0, P̂ext, η̂ as in `Reduced`   τ decay time [sqrt(ρ_f R0³/(E d))]
Valid for  d̂ 0.05-0.3, P̂0 0.4-3, η̂ 0.001-0.01; loads just above the buckling threshold
Source     ranges chosen within Table 1 of Mokbel et al. 2021
"""

from typing import NamedTuple

import jax
import numpy as np

from jshell.errors import BadValue
from jshell.oscillator.coefficients import Coefficients
from jshell.oscillator.linear import stability_margin
from jshell.oscillator.simulate import is_buckled, simulate
from jshell.shell.parameters import Reduced
from jshell.shell.rest import RestState, buckled_state
from jshell.shell.sphere import buckling_load
from jshell.trace import Trace

SMALLEST_MARGIN = 1.3


class RandomShell(NamedTuple):
    """A shell at a load, its true constants, its rest state and how it was set in motion."""

    conditions: Reduced
    coefficients: Coefficients
    state: RestState
    initial: np.ndarray
    tau: float


def random_shell(seed: int, *, smallest_margin: float = SMALLEST_MARGIN) -> RandomShell:
    """A buckled shell of random thickness, gas, liquid, constants and motion.

    The load is 1 to 5 % above the buckling threshold. Draws that are nearer
    than `smallest_margin` to the limit of stability are drawn again.

    Args:
        seed: Whole number; the same seed gives the same shell.
        smallest_margin: Least stability margin [-].
    """
    random = np.random.default_rng(seed)
    for _ in range(1000):
        d, P0, eta = random.uniform(0.05, 0.3), random.uniform(0.4, 3.0), random.uniform(0.001, 0.01)
        excess = random.uniform(1.01, 1.05)
        alpha1, alpha2 = random.uniform(2.0, 5.0), random.uniform(0.6, 1.6)
        k_vs = random.uniform(0.1, 0.35) * random.choice([-1.0, 1.0])
        tau = random.uniform(5.0, 30.0)
        initial = random.standard_normal(4)

        load, _ = _rest(Reduced(d, P0, P0, eta))
        conditions = Reduced(d, P0, excess * float(load), eta)
        coefficients = Coefficients.with_decay_time(alpha1, alpha2, k_vs, tau, eta)
        _, state = _rest(conditions)
        if is_buckled(state) and stability_margin(state, coefficients, conditions) >= smallest_margin:
            scale = np.array([0.03, 0.03, 0.05, 0.05]) * float(state.volume)
            return RandomShell(conditions, coefficients, state, scale * initial, tau)
    raise BadValue(
        "smallest_margin",
        found=f"no shell in 1000 draws at {smallest_margin:g}",
        expected=f"about {SMALLEST_MARGIN:g}",
        remedy="Ask for a smaller margin.",
    )


@jax.jit
def _rest(conditions: Reduced) -> tuple[jax.Array, RestState]:
    """Buckling load, and the buckled state at the load of `conditions`; compiled, so that it does not warn."""
    return buckling_load(conditions), buckled_state(conditions)


def random_trace(
    shell: RandomShell, seed: int, *, duration: float = 40.0, samples: int = 400, noise: float = 0.01
) -> Trace:
    """The exact motion of a random shell with noise added.

    Args:
        shell: From `random_shell`.
        seed: Of the noise.
        duration: Length of the record [sqrt(ρ_f R0³/(E d))].
        samples: Number of samples.
        noise: Standard deviation of the noise, over the rms of each channel's motion [-].
    """
    times = np.linspace(0.0, duration, samples)
    clean = simulate(shell.conditions, shell.coefficients, initial=shell.initial, times=times, equilibrium=shell.state)
    return add_noise(clean, noise, seed)


def add_noise(trace: Trace, noise: float, seed: int) -> Trace:
    """The trace with white noise, `noise` times the standard deviation of each channel."""
    random = np.random.default_rng([seed, 1])
    channels = {}
    for name, values in trace.channels.items():
        clean = np.asarray(values)
        channels[name] = clean + noise * clean.std() * random.standard_normal(clean.shape)
    return Trace(np.asarray(trace.times), channels, trace.conditions, outcome=trace.outcome, settings=trace.settings)
