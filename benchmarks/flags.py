"""What fits are warned of: problems that data do not determine, models that do not describe them, and false alarms.

Random shells (`random_shell`, seeds 0, 1, …), V and S, 400 samples over 40 time units, noise 1 % of each channel's
scatter. A fit is *flagged* when its outcome is not ok, or a warning begins with `misfit` or says that the record
rests where its conditions do not have it, or when the record is refused.

    python benchmarks/flags.py [good ones] [bad ones of each kind]
"""

import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import equinox as eqx
import numpy as np

import jshell as js
from jshell.calibration import FitResult, fit_trajectories
from jshell.oscillator import Coefficients, add_noise, matrices, random_shell, random_trace, simulate
from jshell.oscillator.linear import state_matrix
from jshell.shell.elasticity import SPHERE_VOLUME
from jshell.shell.rest import buckled_state

TIMES = np.linspace(0.0, 40.0, 400)
REFERENCE = Path(__file__).resolve().parents[1] / "tests" / "data" / "reference"


def flagged(found: FitResult) -> str:
    """Why a fit is flagged; empty where it is not."""
    words = [] if found.outcome == js.Outcome.OK else [found.outcome.word]
    if any(text.startswith("misfit") for text in found.warnings):
        words.append("misfit")
    if any("from the plateau law's" in text for text in found.warnings):
        words.append("rests elsewhere")
    return " + ".join(words)


def volume_alone(seed: int) -> FitResult:
    """V at one pressure: two frequencies for three constants."""
    return fit_trajectories(random_trace(random_shell(seed), seed), channels=("V",))


def one_mode(which: int) -> Callable[[int], FitResult]:
    """V and S of a motion that holds one mode only."""

    def fit(seed: int) -> FitResult:
        shell = random_shell(seed)
        A = np.asarray(state_matrix(matrices(shell.coefficients, shell.state, shell.conditions)))
        values, vectors = np.linalg.eig(A)
        oscillating = np.flatnonzero(np.imag(values) > 0)
        mode = vectors[:, oscillating[np.argsort(np.abs(values[oscillating]))][which]]
        start = 0.05 * np.real(mode / mode[0])
        clean = simulate(shell.conditions, shell.coefficients, initial=start, times=TIMES, equilibrium=shell.state)
        return fit_trajectories(add_noise(clean, 0.01, seed))

    return fit


def too_short(seed: int) -> FitResult:
    """A seventh of a slow period; one that is shorter than any motion is refused."""
    shell = random_shell(seed)
    omega = float(js.oscillator.frequencies(shell.conditions, shell.coefficients).omega_minus)
    return fit_trajectories(random_trace(shell, seed, duration=2 * np.pi / omega / 7, samples=400))


def two_decays(factor: float) -> Callable[[int], FitResult]:
    """beta2 away from equal decay, fitted as if there were one decay."""

    def fit(seed: int) -> FitResult:
        shell = random_shell(seed)
        c = shell.coefficients
        true = Coefficients(c.alpha1, c.alpha2, c.k_vs, c.beta1, factor * c.area_damping)
        clean = simulate(shell.conditions, true, initial=shell.initial, times=TIMES, equilibrium=shell.state)
        return fit_trajectories(add_noise(clean, 0.01, seed))

    return fit


def wrong_condition(name: str, factor: float) -> Callable[[int], FitResult]:
    """A condition written down wrongly."""

    def fit(seed: int) -> FitResult:
        shell = random_shell(seed)
        trace = random_trace(shell, seed)
        wrong = eqx.tree_at(lambda c: getattr(c, name), trace.conditions, factor * getattr(trace.conditions, name))
        equilibrium = "plateau" if float(buckled_state(wrong).volume) < SPHERE_VOLUME else "trace"
        return fit_trajectories(js.Trace(trace.times, trace.channels, wrong), equilibrium=equilibrium)

    return fit


def before_the_snap(seed: int) -> FitResult:
    """The reference trace of R read from a time before its snap ends: 0.8, 1.6, … 16 before the dip."""
    trace = js.io.read_trace(REFERENCE / "trace_R.csv")
    dip = js.signals.dip(trace)
    return fit_trajectories(trace, "modal", channels=("V",), fix={"alpha2": 1.1}, start=dip - 0.8 * (seed % 20 + 1))


def good(seed: int) -> FitResult:
    """A problem that data determine and the model describes."""
    return fit_trajectories(random_trace(random_shell(seed), seed))


KINDS: dict[str, tuple[str, Callable[[int], FitResult]]] = {
    "V only, one pressure": ("undetermined", volume_alone),
    "slow mode only": ("undetermined", one_mode(0)),
    "fast mode only": ("undetermined", one_mode(1)),
    "a seventh of a period": ("undetermined", too_short),
    "two decays, β2 × 2": ("misfit", two_decays(2.0)),
    "two decays, β2 × 0.5": ("misfit", two_decays(0.5)),
    "P0 10 % too high": ("misfit", wrong_condition("gas_pressure", 1.1)),
    "P_ext 5 % too high": ("misfit", wrong_condition("outer_pressure", 1.05)),
    "read from before the snap": ("misfit", before_the_snap),
}


def ends(fit: Callable[[int], FitResult], count: int) -> Iterator[tuple[int, str, FitResult | None]]:
    """Seed, why it is flagged, and the fit; None of a record that is refused."""
    for seed in range(count):
        try:
            found = fit(seed)
        except js.errors.UnusableData:
            yield seed, "refused", None
        else:
            yield seed, flagged(found), found


def main() -> None:
    warnings.simplefilter("ignore")
    many, bad = (int(sys.argv[1]) if len(sys.argv) > 1 else 1000), (int(sys.argv[2]) if len(sys.argv) > 2 else 20)
    print("| records | fits | flagged | as | s |\n|---|---|---|---|---|")
    for name, (_, fit) in KINDS.items():
        began = time.perf_counter()
        told = list(ends(fit, bad))
        missed = [seed for seed, text, _ in told if not text]
        blind = [seed for seed, text, found in told if found and "rank_deficient" in text and not found.free_directions]
        words = ", ".join(f"{k} {v}" for k, v in Counter(text or "nothing" for _, text, _ in told).items())
        tail = f"; not seeds {missed}" if missed else ""
        tail += f"; no direction named for seeds {blind}" if blind else ""
        seconds = time.perf_counter() - began
        print(f"| {name} | {bad} | {bad - len(missed)} | {words}{tail} | {seconds:.0f} |", flush=True)
    began = time.perf_counter()
    false = {seed: text for seed, text, _ in ends(good, many) if text}
    print(f"| good ones | {many} | {len(false)} | {false} | {time.perf_counter() - began:.0f} |", flush=True)


if __name__ == "__main__":
    main()
