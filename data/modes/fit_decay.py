"""Fit the law of `jshell.oscillator.decay` to decay_after_buckling.csv, and say how far off it is.

Least squares in ln τ of the slow mode, all shells and viscosities at which it
oscillates, equal weights; the short model's own plateau law gives V/V0 and P, as it
does where the law is used. A second, no longer than that.

    python data/modes/fit_decay.py
"""

import numpy as np
from scipy.optimize import least_squares

import jshell  # noqa: F401  (asks for float64)
from jshell.oscillator import simulated_decay
from jshell.oscillator.decay import Constants, decay_rate, plateau_rest
from jshell.shell import Reduced

# a thin layer's a and b of order 1, and a b that is largest in the middle of the volumes
START = Constants(a0=2.0, a1=0.0, a2=0.5, b0=2.0, b1=0.5, b2=0.3, b3=0.5)


def fit() -> tuple[Constants, np.ndarray, np.ndarray]:
    """The constants, then viscosity and relative error of τ of every mode that was fitted."""
    table = simulated_decay()
    rings = np.isfinite(table.tau[:, 0])
    shells = Reduced(*(part[rings] for part in (table.thickness, table.gas_pressure, table.outer_pressure)))
    viscosity, tau = table.viscosity[rings], table.tau[rings, 0]
    ratio, pressure = (np.asarray(part) for part in plateau_rest(shells))

    def off(numbers: np.ndarray) -> np.ndarray:
        rate = decay_rate(np.asarray(shells.thickness), ratio, pressure, viscosity, Constants(*numbers))
        return -np.log(np.asarray(rate)) - np.log(tau)

    found = least_squares(off, START, xtol=1e-12, ftol=1e-12)
    return Constants(*found.x.tolist()), viscosity, np.expm1(found.fun)


def main() -> None:
    constants, viscosity, error = fit()
    print("\n".join(f"{name} = {value:.5g}" for name, value in constants._asdict().items()))
    print("\nviscosity  modes  median |error|  nine tenths within  largest")
    for one in (*np.unique(viscosity), None):
        size = np.abs(error if one is None else error[viscosity == one])
        name = "all" if one is None else f"{one:g}"
        print(f"{name:9}  {size.size:5}  {np.median(size):14.1%}  {np.quantile(size, 0.9):18.1%}  {size.max():7.1%}")


if __name__ == "__main__":
    main()
