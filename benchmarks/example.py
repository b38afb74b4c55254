"""What shell the shipped recording is of, beside what its maker knew; and how much each cause of a difference moves.

`attached_R_HW.csv` is another code's simulation of a shell of E 0.5 MPa and P0 99 kPa, held from 0.314 rad on, its
buckling pole thinned by 15 %. Its maker's Stokes layer is that of one frequency, 1.2 in time units. The recording is
read without E and P0; each line asks once more with one thing otherwise. What a cause moves is the difference of two:

    pad        the header's pad for the maker's
    spot       no weak spot for the maker's
    layer      the layer's first order for its second
    frequency  losses 1.75 times as large: of a layer of 1.2, the square root of 1.2 over the slow mode's 0.39
    loss       the viscosity sought beside
    swing      from 0.12 s on, where the swing is smaller
    mesh       28 elements for 20

    python benchmarks/example.py [lines …]
"""

import json
import sys
import time
import warnings
from typing import Any

import jshell as js
from jshell.inversion import response
from jshell.inversion.model import Model

ASKED = ("youngs_modulus", "gas_pressure")
MAKER = {"pad": 0.314, "weak_spot": 0.15}
PLAIN: dict[str, Any] = {"nuisance": False, "exact": False}
LINES: dict[str, dict[str, Any]] = {
    "answer": {},
    "header": PLAIN,
    "maker's pad and spot": PLAIN | {"known": MAKER},
    "exact liquid": {"nuisance": False, "known": MAKER},
    "pad": PLAIN | {"known": MAKER | {"pad": 0.33}},
    "spot": PLAIN | {"known": MAKER | {"weak_spot": 0.0}},
    "layer": PLAIN | {"known": MAKER, "liquid": "layer"},
    "frequency": PLAIN | {"known": MAKER, "losses": 1.75},
    "loss": PLAIN | {"known": MAKER, "more": ("viscosity",)},
    "swing": PLAIN | {"known": MAKER, "start": 0.12},
    "mesh": PLAIN | {"known": MAKER, "elements": 28},
}


def asked(
    liquid: str = "second", more: tuple[str, ...] = (), losses: float = 1.0, **how: Any
) -> js.inversion.Inversion:
    """The recording's inversion, by a liquid of the search, with losses times a factor."""
    if liquid != response.SEARCHED:
        response.SEARCHED = liquid
        response.response_program.cache_clear()
    usual = Model.picked

    def lossier(self, *given):
        modal, change, outcome = usual(self, *given)
        faded = lambda rates: losses * rates.real + 1j * rates.imag  # noqa: E731
        return modal._replace(rates=faded(modal.rates)), change._replace(rates=faded(change.rates)), outcome

    Model.picked = lossier
    try:
        return js.invert(js.io.read_trace(js.io.example("attached_R_HW.csv")), unknown=(*ASKED, *more), **how)
    finally:
        Model.picked = usual


def main() -> None:
    for name in sys.argv[1:] or LINES:
        clock = time.process_time()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = asked(**LINES[name])
        line: dict[str, Any] = {"line": name, "outcome": found.outcome.word}
        for one in found.estimates:
            low, high = found.interval(one.name)
            line[one.name] = {"value": float(f"{one.value:.5g}"), "stderr": float(f"{one.stderr:.2g}")}
            line[one.name]["95%"] = [float(f"{low:.4g}"), float(f"{high:.4g}")]
        if found.solution is not None and found.solution.projections:
            slow = found.model.modal(0, found.solution.u, found.solution.near[0])[0].rates[0] if found.model else 0j
            line |= {"slow tau [s]": round(-1 / slow.real, 5), "slow f [Hz]": round(slow.imag / 6.283185307, 3)}
        line |= {"x2": round(found.reduced_chi_square, 2), "cpu [s]": round(time.process_time() - clock, 1)}
        line |= {"warnings": [text.partition(":")[0] for text in found.warnings]}
        print(json.dumps(line), flush=True)


if __name__ == "__main__":
    main()
