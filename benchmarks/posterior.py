"""Whether the posterior of an inversion is calibrated, and as wide as the profile likelihood where it should be.

A free shell of R's size; E and P0 are drawn from their prior (normal times 1/value, since unknowns are sought by their
logarithms), the shell rings in two modes of random phases by the search's own simulator, H and W over four slow
periods, 200 samples, noise of 1 % of each channel's largest excursion, its size known. Of the posterior's draws,
thinned, the number that lie below the truth is uniform where the posterior is right (Talts et al. 2018). Profile and
posterior of a first shell, by many draws, are compared at 95 %.

    python benchmarks/posterior.py [--shells 200] [--first 0] [--compare]
"""

import argparse
import json
import time
import warnings

import jax.numpy as jnp
import numpy as np
import scipy.stats

import jshell as js
from jshell.calibration import Prior
from jshell.inversion.model import ELEMENTS
from jshell.inversion.response import DIRECTIONS, FIELDS, response_program, standing_program
from jshell.shell import Gas, Liquid, Load, Reduced, Shell, scales

RADIUS, THICKNESS, LIQUID, OUTER = 0.0225, 0.22 * 0.0225, Liquid(1260.0, 1.06), 187e3
PRIORS = {"youngs_modulus": Prior(0.5e6, 0.02e6), "gas_pressure": Prior(99e3, 3e3)}
SAMPLES, NOISE, SWING, PERIODS = 200, 0.01, 0.02, 4.0
RANKED, BINS = 99, 10  # draws that a rank is counted among; of ranks
WARMUP, DRAWS = 200, 400


def drawn(generator: np.random.Generator) -> dict[str, float]:
    """Modulus and gas pressure from the prior, by rejection."""
    found = {}
    for name, prior in PRIORS.items():
        least = prior.mean - 6 * prior.sigma
        while name not in found:
            value = generator.normal(prior.mean, prior.sigma)
            if generator.uniform() < least / value:
                found[name] = float(value)
    return found


def record(generator: np.random.Generator, truth: dict[str, float]) -> js.Trace | None:
    """H and W of its ring-down; None where there is no such shell."""
    shell = Shell(RADIUS, THICKNESS, truth["youngs_modulus"])
    c, unit = Reduced.from_si(shell, Gas(truth["gas_pressure"]), LIQUID, Load(OUTER)), scales(shell, LIQUID)
    numbers = jnp.array([c.thickness, c.gas_pressure, c.outer_pressure, c.viscosity, 1.4, 0.5, *np.zeros(3)], float)
    near = standing_program(ELEMENTS, False)(numbers)
    found = response_program(ELEMENTS, False)(numbers, jnp.zeros((DIRECTIONS, len(FIELDS))), near)[0]
    if int(near.outcome) or np.any(np.asarray(found.outcome)[:2]):
        return None
    rates, shapes, rest = (np.asarray(part) for part in found[:3])
    rates, shapes = rates[:2], shapes[:2, :2] / np.abs(shapes[:2, :2]).max(axis=1, keepdims=True)
    times = np.linspace(0, PERIODS * 2 * np.pi / rates[0].imag, SAMPLES)
    size = np.array([1.0, 0.5]) * np.exp(2j * np.pi * generator.uniform(size=2))
    moves = np.real((size[:, None] * shapes).T @ np.exp(np.outer(rates, times)))
    moves *= SWING / np.abs(moves).max()
    sigma = NOISE * np.abs(moves).max(axis=1)
    values = rest[:2, None] + moves + sigma[:, None] * generator.standard_normal(moves.shape)
    channels, errors = (dict(zip("HW", rows, strict=True)) for rows in (values, sigma[:, None] * np.ones(SAMPLES)))
    return js.Trace(times, channels, c, errors, scales=unit)


def inverted(seed: int) -> tuple[js.inversion.Inversion, dict[str, float]]:
    """A shell's inversion, and the truth."""
    generator = np.random.default_rng(seed)
    while (trace := record(generator, truth := drawn(generator))) is None:
        pass
    asked = {name: js.inversion.Unknown(prior=prior) for name, prior in PRIORS.items()}
    return js.invert(trace, unknown=asked, nuisance=False, exact=False), truth


def compared() -> dict:
    """Profile and posterior of one shell: both ends over the width of the profile's interval."""
    found, _ = inverted(0)
    profiles, draws = found.profile(), found.posterior(4000, warmup=1000, chains=2)
    line: dict = {"departure": round(draws.departure, 4)}
    for name in PRIORS:
        low, high = profiles[name].low, profiles[name].high
        line[name] = {
            "ends": [
                round(float((a - b) / (high - low)), 4) for a, b in zip(draws.interval(name), (low, high), strict=True)
            ],
            "width": round(float(np.diff(draws.interval(name))[0] / (high - low)), 4),
            "profile over covariance": round((high - low) / float(np.diff(found.interval(name))[0]), 4),
        }
    return line


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shells", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--compare", action="store_true", help="profile and posterior of one shell alone")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    if options.compare:
        print(json.dumps(compared()))
        return
    ranks: dict[str, list[int]] = {name: [] for name in PRIORS}
    begun = time.process_time()
    for seed in range(options.first, options.first + options.shells):
        clock = time.process_time()
        found, truth = inverted(seed)
        line: dict = {"seed": seed, "outcome": found.outcome.word}
        if found.outcome == js.Outcome.OK:
            draws = found.posterior(DRAWS, warmup=WARMUP, chains=1, seed=seed)
            for name, value in truth.items():
                some = draws.draws[0, :, draws.names.index(name)][np.linspace(0, DRAWS - 1, RANKED).astype(int)]
                ranks[name].append(int(np.sum(some < value)))
            line |= {"ranks": {name: of[-1] for name, of in ranks.items()}, "departure": round(draws.departure, 4)}
        print(json.dumps(line | {"cpu": round(time.process_time() - clock, 1)}), flush=True)
    told: dict = {"shells": options.shells, "ok": len(ranks["gas_pressure"]), "cpu": round(time.process_time() - begun)}
    for name, of in ranks.items():
        counts = np.histogram(of, BINS, (-0.5, RANKED + 0.5))[0]
        told[name] = {"counts": counts.tolist(), "p": round(float(scipy.stats.chisquare(counts).pvalue), 4)}
    print(json.dumps(told))


if __name__ == "__main__":
    main()
