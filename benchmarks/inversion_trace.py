"""Records through the snap, made on a finer mesh with shorter steps, and what the trace level says of them.

R under a slow ramp, with a weak spot that no default knows; V or H, 451 samples to 45 time units, white noise of 1 % of
the channel's largest excursion. E, outer pressure and weak spot are unknown; the search begins at the modal level's
answer of the ring-down. A first record warms the programs up; times are processor seconds of one core.

    python benchmarks/inversion_trace.py [--records 3] [--channel V] [--elements 24] [--finer 40]
"""

import argparse
import json
import time

import numpy as np

import jshell as js
from jshell.contour import WeakSpot
from jshell.shell import Liquid, Reduced, Shell, scales

NOISE, SPOT, LENGTH, EVERY, RAMP = 0.01, 0.11, 45.0, 0.1, 25.0
CONDITIONS = Reduced(0.22, 0.9, 1.6, 0.004)
UNIT = scales(Shell(0.0225, 0.22 * 0.0225, 0.5e6), Liquid(1260.0))
TRUTH = {"youngs_modulus": 0.5e6, "outer_pressure": 1.6 * UNIT.pressure, "weak_spot": SPOT}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--records", type=int, default=3)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--channel", default="V", choices=("V", "H"))
    parser.add_argument("--elements", type=int, default=24)
    parser.add_argument("--finer", type=int, default=40, help="elements of the records")
    options = parser.parse_args()
    made = js.dynamics.simulate(
        CONDITIONS, duration=LENGTH, every=EVERY, ramp=RAMP, elements=options.finer, weak_spot=WeakSpot(SPOT)
    )
    clean = np.asarray(made[options.channel])
    for seed in range(options.first, options.first + options.records):
        noise = NOISE * np.ptp(clean) * np.random.default_rng(seed).standard_normal(clean.size)
        channels = {options.channel: clean + noise}
        trace = js.Trace(made.times, channels, CONDITIONS, scales=UNIT, settings=(("ramp", repr(RAMP)),))
        clock, cpu = time.perf_counter(), time.process_time()
        found = js.invert(
            trace, unknown=("youngs_modulus", "outer_pressure"), level=js.inversion.Snap(elements=options.elements)
        )
        line = {"seed": seed, "channel": options.channel, "outcome": found.outcome.word}
        line |= {"cpu": round(time.process_time() - cpu, 1), "s": round(time.perf_counter() - clock, 1)}
        line |= {"simulations": found.model.calls, "x2": round(found.reduced_chi_square, 3)}
        for name, value in TRUTH.items():
            one = found[name]
            line[name] = {
                "sigmas": round((one.value - value) / one.stderr, 2),
                "off": round(one.value / value - 1, 5),
                "error": round(one.stderr / value, 5),
            }
        print(json.dumps(line | {"warnings": len(found.warnings), "begun": found.notes[1]}), flush=True)


if __name__ == "__main__":
    main()
