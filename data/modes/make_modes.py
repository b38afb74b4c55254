"""Make modes_after_buckling.csv: the simulator's vibrations of shells that have just buckled.

The shell buckles at the classical load; the table holds the undamped modes of
the dimpled rest shape there and at some loads beyond, so that they can be
drawn beside those of the two-variable model without solving anything. Pulsations
in sqrt(E d/(ρ_f R0³)), slow ones first; share is dV²/Σ dV² over the listed modes: how
much of a sudden pressure's work on the volume each mode takes.

    python data/modes/make_modes.py
"""

from pathlib import Path

import numpy as np

import jshell as js
from jshell.shell.sphere import buckling_load

HERE = Path(__file__).parent
THICKNESS = {0.02: 48, 0.05: 32, 0.1: 32, 0.2: 32, 0.3: 32}  # and the elements that settle four modes to 1e-4
GAS = (0.4, 0.9, 2.5)
BEYOND = (1.0, 1.1, 1.25)  # outer pressure over the buckling load
COUNT = 4


def main() -> None:
    rows = []
    for thickness, elements in THICKNESS.items():
        for gas in GAS:
            load = float(buckling_load(js.Reduced(thickness, gas, gas)))
            for factor in BEYOND:
                shell = js.Reduced(thickness, gas, factor * load)
                found = js.dynamics.modes(shell, count=COUNT, liquid="ideal", elements=elements)
                sound = int(found.rest.outcome) == 0 and not np.any(np.asarray(found.outcome))
                if not sound:
                    print(f"left out: {thickness}, {gas}, {factor}: {js.Outcome(int(found.rest.outcome)).word}")
                    continue
                share = np.asarray(found.dV) ** 2 / np.sum(np.asarray(found.dV) ** 2)
                state = (thickness, gas, factor * load, factor, float(found.rest.volume_ratio))
                rows.append((*state, *np.asarray(found.omega), *share))
    names = ["d_hat", "P0_hat", "Pext_hat", "load_ratio", "V_over_V0"]
    names += [f"{word}{k + 1}" for word in ("omega", "share") for k in range(COUNT)]
    head = [
        "# undamped modes of just-buckled shells by jshell.dynamics.modes: no weak spot, free, area current, nu 0.5",
        f"# elements: {', '.join(f'{n} at d_hat {d:g}' for d, n in THICKNESS.items())}",
        ",".join(names),
    ]
    lines = [",".join(f"{value:.6g}" for value in row) for row in rows]
    target = HERE / "modes_after_buckling.csv"
    target.write_text("\n".join(head + lines) + "\n", encoding="utf-8")
    print(f"{len(rows)} shells: {target.name}")


if __name__ == "__main__":
    main()
