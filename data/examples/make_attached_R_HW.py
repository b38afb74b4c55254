"""Make attached_R_HW.csv: the attached shell of configuration R as a camera would record it.

An independent reference trace, sampled at 1 kHz, in millimetres, to four
decimals, contours tracked to a fraction of a pixel: Gaussian noise of 0.3 % of
each channel's standard deviation over the record, seed 0. (Noise of 0.3 % of
each value would bury the fast mode: no unbiased estimate of ω+ from it could
be better than ± 0.04.)

    python data/examples/make_attached_R_HW.py
"""

from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
REFERENCE = HERE.parents[1] / "tests" / "data" / "reference" / "trace_R_attached.csv"
NOISE = 0.003  # of each channel's standard deviation over the record
SAMPLING = 1e-3  # [s]
CONDITIONS = {
    "R0_m": 0.0225,
    "d_m": 0.00495,
    "E_Pa": 0.5e6,
    "P0_Pa": 0.099e6,
    "Pext_Pa": 0.1782e6,
    "rho_f_kg_m3": 1260.0,
    "eta_f_Pa_s": 1.06,
    "kappa": 1.4,
    "nu": 0.5,
    "attached": 0.33,  # half-angle of the pad [rad]
}


def main() -> None:
    lines = [line for line in REFERENCE.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    names = lines[0].split(",")
    table = np.loadtxt(lines[1:], delimiter=",")
    radius = CONDITIONS["R0_m"]
    unit = radius**1.5 * np.sqrt(CONDITIONS["rho_f_kg_m3"] / (CONDITIONS["E_Pa"] * CONDITIONS["d_m"]))  # [s]

    times = np.arange(0.0, table[-1, 0] * unit, SAMPLING)
    noise = np.random.default_rng(0)
    columns = [1e3 * times]
    for name in ("H", "W"):
        exact = np.interp(times / unit, table[:, 0], table[:, names.index(name)])
        columns.append(1e3 * radius * (exact + NOISE * exact.std() * noise.standard_normal(times.size)))

    with (HERE / "attached_R_HW.csv").open("w", encoding="utf-8") as file:
        file.write("# made by make_attached_R_HW.py: noise of 0.3 % of each channel's standard deviation, seed 0\n")
        file.writelines(f"# {key}: {value!r}\n" for key, value in CONDITIONS.items())
        file.write("t [ms],H [mm],W [mm]\n")
        file.writelines(f"{t:.4f},{h:.4f},{w:.4f}\n" for t, h, w in zip(*columns, strict=True))


if __name__ == "__main__":
    main()
