"""What `extract` says of records that two decaying modes describe, nearly describe, or do not; and whether it is so.

Neighbours of six records by random numbers (seeds 0, 1, …; the kind is the seed's remainder): two good modes, a drift
beside them, a second kick, decays of their own, two modes close together, and no decay at all. A record is *right*
where all that is told lies within 4.5 standard errors of the truth, *flagged* where `sound` is false, else *silent*.
Silent ones are *hidden* where the best single mode differs from the noiseless record by less than any test of so many
numbers could see: χ² of 16, a third of what a random second mode would have to take away.

    python benchmarks/listening.py [first seed] [records]
"""

import sys
import time
from collections import Counter

import numpy as np
from scipy.optimize import least_squares

import jshell as js

KINDS = ("good", "drift", "kick", "decays", "close", "undamped")
FAR = 4.5  # standard errors
SEEN = 16.0  # χ²


Truth = tuple[float, float, float, float]


def record(seed: int) -> tuple[str, js.Trace, Truth, np.ndarray]:
    """Kind, record, its truth (two Ω and two decay rates), and what it is without noise, in units of that."""
    draw = np.random.default_rng([seed, 18])
    kind = KINDS[seed % len(KINDS)]
    span, step = draw.uniform(25.0, 80.0), draw.uniform(0.05, 0.2)
    t = np.arange(int(span / step)) * step
    slow, tau = draw.uniform(0.8, 1.5), draw.uniform(6.0, 25.0)
    ratio = 1 + draw.uniform(0.01, 0.06) if kind == "close" else draw.uniform(1.25, 1.95)
    level = 10 ** draw.uniform(-4, -1.7)
    size, turned = draw.uniform(0.2, 1.0), draw.uniform(0, 2 * np.pi, 4)
    rates = [1 / tau, 1 / tau]
    if kind == "decays":
        rates[1] *= draw.choice([draw.uniform(0.3, 0.8), draw.uniform(1.25, 5.0)])
    if kind == "undamped":
        rates = [0.0, 0.0]

    def ring(t: np.ndarray, phases: np.ndarray, size: float) -> np.ndarray:
        first, second = (np.exp(-s * t) for s in rates)
        return first * np.cos(slow * t + phases[0]) + size * second * np.cos(ratio * slow * t + phases[1])

    y = ring(t, turned[:2], size)
    if kind == "drift":
        amount = 10 ** draw.uniform(-2, 0.3) * draw.choice([-1, 1])
        y = y + amount * (np.exp(-t / draw.uniform(8, 40)) if draw.uniform() < 0.5 else t / span)
    if kind == "kick":
        at, again = draw.uniform(0.15, 0.85) * span, 10 ** draw.uniform(-1.3, 0)
        y = y + again * np.where(t >= at, ring(np.maximum(t - at, 0), turned[2:], size), 0.0)
    noisy = y + level * draw.standard_normal(t.size)
    return kind, js.Trace(t, {"p": noisy}), (slow, ratio * slow, rates[0], rates[1]), y / level


def judged(found: js.signals.Signature, truth: Truth) -> str:
    """`flagged`, `right` or `silent`, with what is off."""
    if not found.sound:
        return "flagged"
    if found.omega_plus is None or found.omega_minus is None or found.tau is None:
        return "silent: one mode"
    slow, fast, *rates = truth
    off = []
    for name, value in (("omega_minus", np.hypot(slow, rates[0])), ("omega_plus", np.hypot(fast, rates[1]))):
        if abs(getattr(found, name) - value) > FAR * found.stderr[name]:
            off.append(name)
    error = found.stderr["tau"] / found.tau**2
    if max(abs(1 / found.tau - rate) for rate in rates) > FAR * error:
        off.append("tau")
    return "silent: " + " ".join(off) if off else "right"


def unlike_one(t: np.ndarray, clean: np.ndarray, truth: Truth) -> float:
    """χ² by which the best single mode with an offset misses a record without noise."""

    def missed(unknowns: np.ndarray) -> np.ndarray:
        wave = np.exp((-unknowns[1] + 1j * unknowns[0]) * t)
        basis = np.stack([wave.real, wave.imag, np.ones_like(t)], axis=1)
        return clean - basis @ np.linalg.lstsq(basis, clean, rcond=None)[0]

    starts = [(turn, truth[2] * part) for turn in (truth[0], truth[1]) for part in (0.7, 1.0, 1.4)]
    return min(2 * float(least_squares(missed, start, x_scale=(0.01, 0.01)).cost) for start in starts)


def main() -> None:
    first, many = (int(x) for x in (sys.argv[1:] + ["0", "600"][len(sys.argv) - 1 :])[:2])
    told: Counter[tuple[str, str]] = Counter()
    began = time.process_time()
    for seed in range(first, first + many):
        kind, trace, truth, clean = record(seed)
        found = js.signals.extract(trace, start=0.0)
        word = judged(found, truth)
        t = np.asarray(trace.times)
        if word == "silent: one mode" and unlike_one(t, clean, truth) < SEEN:
            word = "hidden: one mode"
        told[kind, word.split(":")[0]] += 1
        if ":" in word:
            beats = (truth[1] - truth[0]) * t[-1] / (2 * np.pi)
            extracted = f"{found.verdict} {found.omega_minus} {found.omega_plus} {found.tau} {found.stderr}"
            print(
                f"seed {seed} ({kind}, {beats:.2f} beats), truth {np.round(truth, 5)}: {word}; {extracted}", flush=True
            )
    print("| records | right | flagged | hidden | silent |\n|---|---|---|---|---|")
    for kind in KINDS:
        print(
            f"| {kind} | "
            + " | ".join(str(told[kind, word]) for word in ("right", "flagged", "hidden", "silent"))
            + " |"
        )
    print(f"{many} records, {time.process_time() - began:.0f} s of processor time")


if __name__ == "__main__":
    main()
