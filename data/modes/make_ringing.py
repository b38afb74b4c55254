"""Make ringing.csv: how buckled shells ring and rest, from which an inversion takes its starts.

Shells are drawn from a Sobol sequence (seed 0): d̂ 0.03 to 0.4 and P̂0 0.1 to 8 by their logarithms, the outer pressure
so that the shell rests between 0.45 and 0.95 of its volume by the plateau law, sqrt(η̂) up to 0.22, a pad of 0.12 to
0.6 rad where there is one; κ 1.4, ν 1/2, no weak spot. Rates by the liquid's second order.

    python data/modes/make_ringing.py
"""

from pathlib import Path

import jax.numpy as jnp
import numpy as np
from scipy.stats import qmc

from jshell.inversion.response import CHANNELS, DIRECTIONS, response_program, standing_program
from jshell.shell.rest import plateau_pressure

ELEMENTS = 24
SHELLS = {False: 256, True: 512}
MODES = 3
COLUMNS = (
    "d_hat",
    "P0_hat",
    "Pext_hat",
    "eta_hat",
    "pad",
    *(f"s{k}_{part}" for k in (1, 2, 3) for part in ("re", "im")),
    *CHANNELS[:4],
)


def main() -> None:
    lines = [
        "# how buckled shells ring and rest, by jshell.inversion.response: kappa 1.4, nu 0.5; pad 0 is a free shell",
        f"# elements: {ELEMENTS}; rates by the second order of the layer; made by make_ringing.py",
        ",".join(COLUMNS),
    ]
    for held, count in SHELLS.items():
        standing = standing_program(ELEMENTS, held)
        response = response_program(ELEMENTS, held, "second")
        for draw in qmc.Sobol(5, seed=0).random(count):
            d, p0 = np.exp(np.log([0.03, 0.1]) + draw[:2] * np.log([0.4 / 0.03, 80.0]))
            ratio, root, pad = 0.45 + 0.5 * draw[2], 0.005 + 0.215 * draw[3], (0.12 + 0.48 * draw[4]) * held
            outer = p0 * ratio**-1.4 + float(plateau_pressure(d))
            numbers = jnp.array([d, p0, outer, root**2, 1.4, 0.5, pad, 0.0])
            near = standing(numbers)
            found, _ = response(numbers, jnp.zeros((DIRECTIONS, 8)), near)
            if int(near.outcome) or np.any(np.asarray(found.outcome)[:MODES]):
                continue
            rates = np.asarray(found.rates)[:MODES]
            row = [
                d,
                p0,
                outer,
                root**2,
                pad,
                *np.stack([rates.real, rates.imag], 1).ravel(),
                *np.asarray(found.rest)[:4],
            ]
            lines.append(",".join(f"{x:.5g}" for x in row))
    (Path(__file__).parent / "ringing.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
