"""What height and width of a ring-down tell of a shell: one simulated record, one question after another.

A free shell of the source's size, d̂ 0.22, P̂₀ 0.9, P̂ext 1.7, η̂ 0.004, rings in three modes over five slow periods;
400 samples, noise of 1 % of each channel's largest excursion, seed 0. Each line is a question: what is asked, what is
recorded, how well each unknown is known (relative standard error; that of a weak spot absolute), and what stays open.
Where `one_mode` is said the record holds the slow mode alone.

    python benchmarks/known.py
"""

import json
import warnings
from typing import Any

import jax.numpy as jnp
import numpy as np
from inversion import record, ringing

import jshell as js

SHELL = (0.22, 0.9, 1.7, 0.004, 1.4, 0.5, 0.0, 0.0)
SCALE = ("youngs_modulus", "gas_pressure", "outer_pressure", "viscosity", "density")
BOTH = ("youngs_modulus", "gas_pressure")
ONE = {"free_rest": True, "channels": ("H",), "one_mode": True}
QUESTIONS = (
    (BOTH, {}),
    (BOTH, {"channels": ("W",)}),
    (BOTH, {"channels": ("H",)}),
    (BOTH, {"free_rest": True}),
    (("youngs_modulus", "thickness"), {}),
    (("youngs_modulus", "thickness"), {"free_rest": True}),
    (("youngs_modulus", "thickness", "gas_pressure"), {}),
    ((*BOTH, "outer_pressure"), {}),
    ((*BOTH, "poisson_ratio"), {}),
    ((*BOTH, "kappa"), {}),
    ((*BOTH, "weak_spot"), {}),
    (SCALE, {}),
    (("youngs_modulus", "thickness"), ONE),
    (("youngs_modulus", "gas_pressure"), ONE),
    (("youngs_modulus", "thickness", "gas_pressure"), ONE),
    (("youngs_modulus", "viscosity"), ONE),
    (("youngs_modulus", "thickness", "radius", "density"), {}),
)


def error(one) -> str:
    """Relative standard error; absolute of what may be zero."""
    return f"{one.stderr / (1.0 if one.name == 'weak_spot' else one.value):.1e}"


def main() -> None:
    found = ringing(jnp.array(SHELL))
    assert found is not None
    rates, shapes, rest = found
    alone = rates, shapes * np.array([[1.0], [0.0], [0.0]]), rest
    traces = [record(np.random.default_rng(0), np.array(SHELL), one, 0.0)[0] for one in (found, alone)]
    for unknown, options in QUESTIONS:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            asked: dict[str, Any] = {name: value for name, value in options.items() if name != "one_mode"}
            trace = traces["one_mode" in options]
            result = js.invert(trace, unknown=unknown, nuisance=False, exact=False, **asked)
        known = {n: None if result[n].undetermined else error(result[n]) for n in unknown}
        line = {"asked": known, **options, "outcome": result.outcome.word}
        print(json.dumps(line | {"open": result.free_directions}, ensure_ascii=False), flush=True)


if __name__ == "__main__":
    main()
