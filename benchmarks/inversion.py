"""Random shells, recorded with noise, and what an inversion says of them.

Every shell rings in the exact liquid, on another mesh than the inversion's, of 32 elements; a held one, whose modes
approach their limit with the first power of the element's length at the pad's edge, at that limit. Three modes of
random sizes and phases, H and W over three to six slow periods, 400 samples, noise of 1 % of each channel's largest
excursion, white or with memory. E, P0 and, where there is one, the pad are unknown. Seeds 0, 1, 2, …; a shell without
a buckled state, or whose modes do not oscillate, is drawn again.

Right: every unknown within five standard errors, or a tenth of itself where they are larger. Wrong: outcome ok, and an
unknown farther off than five standard errors.

    python benchmarks/inversion.py [--shells 200] [--first 0] [--memory 0.9] [--off 0.2]
"""

import argparse
import json
import time
import warnings

import jax.numpy as jnp
import numpy as np

import jshell as js
from jshell.inversion.response import (
    BLUNT,
    DIRECTIONS,
    FIELDS,
    SHARP,
    liquids_program,
    mesh,
    response_program,
    sharpening_program,
    standing_program,
)
from jshell.shell import Liquid, Reduced, Shell, scales
from jshell.shell.sphere import buckling_load

ELEMENTS, SAMPLES, NOISE, SWING = 32, 400, 0.01, 0.02
RADIUS, DENSITY, MODULUS = 0.0225, 1260.0, 0.5e6
OFF = 5.0  # standard errors beyond which an answer is wrong


def shell(generator: np.random.Generator) -> tuple[np.ndarray, tuple]:
    """The simulator's numbers of a random shell, and how it rings in the exact liquid."""
    while True:
        d, viscosity = np.exp(generator.uniform(np.log([0.06, 0.001]), np.log([0.3, 0.02])))
        gas, above = generator.uniform([0.5, 1.02], [2.0, 1.10])
        pad = generator.uniform(0.2, 0.45) * (generator.uniform() < 0.5)
        outer = above * float(buckling_load(Reduced(d, gas, 2.0)))
        numbers = jnp.array([d, gas, outer, viscosity, 1.4, 0.5, pad, 0.0, 0.0])
        if (found := ringing(numbers)) is not None:
            return np.asarray(numbers), found


def ringing(numbers) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Rates, shapes of size one and rest values of three modes; None where there are not as many."""
    held = bool(numbers[6] > 0)
    plain = standing_program(ELEMENTS, held)(numbers)
    if int(plain.outcome):
        return None
    second, exact = (three(one) for one in liquids_program(ELEMENTS, held)(numbers, plain))
    if second is None or exact is None or not held:
        return exact
    # the exact liquid's waves need elements of like lengths, the pad's edge needs small ones: a product of both
    edge, ends, lengths = mesh(ELEMENTS, held).edge or 0, [], []
    for ratio in (SHARP, BLUNT):
        near = sharpening_program(ELEMENTS)(plain, jnp.asarray(ratio))
        still = jnp.zeros((DIRECTIONS, len(FIELDS)))
        if (end := three(response_program(ELEMENTS, held)(numbers, still, near)[0])) is None:
            return None
        ends.append(end)
        lengths.append(float(near.nodes[edge] - near.nodes[edge - 1]))
    reach = lengths[0] / (lengths[1] - lengths[0])
    limit = [a + reach * (a - b) for a, b in zip(*ends, strict=True)]
    return limit[0] * exact[0] / second[0], limit[1] * exact[1] / second[1], limit[2]


def three(found) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Rates, shapes of size one and rest values of three modes of H and W."""
    if np.any(np.asarray(found.outcome)[:3]):
        return None
    shapes = np.asarray(found.shapes)[:3, :2]
    largest = np.argmax(np.abs(shapes), axis=1)
    return np.asarray(found.rates)[:3], shapes / shapes[range(3), largest][:, None], np.asarray(found.rest)[:2]


def record(generator: np.random.Generator, numbers: np.ndarray, found, memory: float) -> tuple[js.Trace, dict]:
    """H and W of its ring-down in a laboratory's units, and the truth."""
    rates, shapes, rest = found
    times = np.linspace(0, generator.uniform(3, 6) * 2 * np.pi / rates[0].imag, SAMPLES)
    size = np.array([1.0, 0.5, 0.2]) * generator.uniform(0.3, 1.0, 3) * np.exp(2j * np.pi * generator.uniform(size=3))
    moves = np.real((size[:, None] * shapes).T @ np.exp(np.outer(rates, times)))
    moves *= SWING / np.abs(moves).max()
    noise = generator.standard_normal(moves.shape)
    for k in range(1, SAMPLES):
        noise[:, k] = memory * noise[:, k - 1] + np.sqrt(1 - memory**2) * noise[:, k]
    values = rest[:, None] + moves + NOISE * np.abs(moves).max(axis=1, keepdims=True) * noise
    conditions = Reduced(*(float(x) for x in numbers[:4]))
    unit = scales(Shell(RADIUS, float(numbers[0]) * RADIUS, MODULUS), Liquid(DENSITY))
    settings = (("attached", repr(float(numbers[6]))),) if numbers[6] else ()
    truth = {"youngs_modulus": MODULUS, "gas_pressure": float(numbers[1]) * unit.pressure}
    if numbers[6]:
        truth["pad"] = float(numbers[6])
    return js.Trace(times, {"H": values[0], "W": values[1]}, conditions, scales=unit, settings=settings), truth


def judged(result, truth: dict) -> dict:
    """One shell's line."""
    off, inside = {}, {}
    for name, value in truth.items():
        one = result[name]
        low, high = result.interval(name)
        off[name], inside[name] = (one.value - value) / one.stderr, bool(low <= value <= high)
    return {"off": {n: round(float(x), 2) for n, x in off.items()}, "inside": inside}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shells", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--memory", type=float, default=0.0)
    parser.add_argument(
        "--off", type=float, default=0.0, help="begin this share off the truth, not at the door's starts"
    )
    options = parser.parse_args()
    lines = []
    for seed in range(options.first, options.first + options.shells):
        generator = np.random.default_rng(seed)
        numbers, found = shell(generator)
        trace, truth = record(generator, numbers, found, options.memory)
        signs = 1 + options.off * np.sign(np.random.default_rng(seed + 10**6).uniform(-1, 1, 3))
        begin = {n: v * f for (n, v), f in zip(truth.items(), signs, strict=False)} if options.off else None
        clock, cpu = time.perf_counter(), time.process_time()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                result = js.invert(trace, unknown=tuple(truth), begin=begin, nuisance=False)
            except js.JshellError as error:
                print(json.dumps({"seed": seed, "refused": str(error)}), flush=True)
                lines.append({"outcome": "refused"})
                continue
        line = {"seed": seed, "outcome": result.outcome.word, "s": round(time.perf_counter() - clock, 1)}
        line |= {"cpu": round(time.process_time() - cpu, 1), **judged(result, truth)}
        line |= {"x2": round(result.reduced_chi_square, 3), "starts": [s.outcome.word for s in result.starts]}
        line |= {"numbers": [round(float(x), 4) for x in numbers], "warnings": len(result.warnings)}
        print(json.dumps(line), flush=True)
        lines.append(line)
    print(json.dumps(summary(lines)))


def summary(lines: list[dict]) -> dict:
    """Shares over all shells."""
    ok = [line for line in lines if line["outcome"] == "ok"]
    wrong = [line for line in ok if any(not abs(x) < OFF for x in line["off"].values())]
    inside = [held for line in ok for held in line["inside"].values()]
    return {
        "shells": len(lines),
        "ok": len(ok),
        "right": len(ok) - len(wrong),
        "wrong": len(wrong),
        "intervals": len(inside),
        "inside": round(float(np.mean(inside)), 4) if inside else None,
        "cpu": round(float(np.median([line["cpu"] for line in ok])), 2) if ok else None,
    }


if __name__ == "__main__":
    main()
