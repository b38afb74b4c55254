"""Make modes_after_buckling.csv and decay_after_buckling.csv: how the simulator's just-buckled shells vibrate.

The shell buckles at the classical load; the tables hold the modes of the
dimpled rest shape there and at some loads beyond, so that they can be drawn
beside those of the two-variable model, and tell it how fast a shell rings
down, without solving anything.

The first table has a row a shell: the four slowest modes. omega is undamped, tau is
in the exact viscous liquid at η̂ = 0.004, and share is dV²/Σ dV² over the listed
modes: how much of a sudden pressure's work on the volume each mode takes. The second
has a row a shell and viscosity, and thicknesses between: |s| and tau of the two slowest
in the exact liquid. Pulsations in sqrt(E d/(ρ_f R0³)), times in its inverse; nan is a
mode that no longer oscillates. About a quarter of an hour on one core.

    python data/modes/make_modes.py
"""

from pathlib import Path

import numpy as np

import jshell as js
from jshell.shell.sphere import buckling_load

HERE = Path(__file__).parent
THICKNESS = {0.02: 48, 0.05: 32, 0.1: 32, 0.2: 32, 0.3: 32}  # and the elements that settle four modes to 1e-4
BETWEEN = {0.035: 48, 0.07: 32, 0.15: 32, 0.25: 32, 0.275: 32}  # of the second table alone: the slow mode bends there
GAS = (0.4, 0.9, 2.5)
BEYOND = (1.0, 1.1, 1.25)  # outer pressure over the buckling load
COUNT = 4
LISTED = 0.004  # the viscosity of R, whose decay stands in the first table
VISCOSITIES = (0.0006, LISTED, 0.013, 0.05, 0.13)
SLOWEST = 2  # modes whose decay stands in the second


def main() -> None:
    rows, decays = [], []
    for thickness, elements in sorted((THICKNESS | BETWEEN).items()):
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
                state = (thickness, gas, factor * load, factor)
                tau = {}
                for viscosity in VISCOSITIES:
                    count = COUNT if viscosity == LISTED else SLOWEST
                    omega, tau[viscosity] = damped(state[:3], viscosity, count, elements)
                    decays.append((*state, viscosity, *omega[:SLOWEST], *tau[viscosity][:SLOWEST]))
                if thickness in THICKNESS:
                    volume = float(found.rest.volume_ratio)
                    rows.append((*state, volume, *np.asarray(found.omega), *share, *tau[LISTED]))
    shells = ["d_hat", "P0_hat", "Pext_hat", "load_ratio"]
    of = "of just-buckled shells by jshell.dynamics.modes: no weak spot, free, area current, nu 0.5"
    names = [*shells, "V_over_V0"]
    names += [f"{word}{k + 1}" for word in ("omega", "share", "tau") for k in range(COUNT)]
    listed = f"undamped modes, with tau in the exact viscous liquid at eta_hat {LISTED:g}, {of}"
    write("modes_after_buckling.csv", [listed, meshes(THICKNESS)], names, rows)
    names = [*shells, "eta_hat", *(f"{word}{k + 1}" for word in ("omega", "tau") for k in range(SLOWEST))]
    exact = f"modes in the exact viscous liquid {of}"
    write("decay_after_buckling.csv", [exact, meshes(THICKNESS | BETWEEN)], names, decays)


def meshes(elements: dict[float, int]) -> str:
    """How finely each thickness was computed."""
    return f"elements: {', '.join(f'{n} at d_hat {d:g}' for d, n in sorted(elements.items()))}"


def damped(
    shell: tuple[float, float, float], viscosity: float, count: int, elements: int
) -> tuple[np.ndarray, np.ndarray]:
    """|s| and decay time of the slowest modes in a viscous liquid; nan where nothing oscillates."""
    found = js.dynamics.modes(js.Reduced(*shell, viscosity), count=count, elements=elements)
    outcome = np.asarray(found.outcome)
    for k in np.flatnonzero((outcome != js.Outcome.OK) & (outcome != js.Outcome.OVERDAMPED)):
        print(f"no mode {k + 1}: {shell}, eta_hat {viscosity:g}: {js.Outcome(int(outcome[k])).word}")
    oscillates = outcome == js.Outcome.OK
    return tuple(np.where(oscillates, np.asarray(part), np.nan) for part in (found.omega, found.tau))


def write(name: str, head: list[str], names: list[str], rows: list[tuple]) -> None:
    """One table, six digits a number."""
    lines = [*(f"# {line}" for line in head), ",".join(names)]
    lines += [",".join(f"{value:.6g}" for value in row) for row in rows]
    (HERE / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{len(rows)} rows: {name}")


if __name__ == "__main__":
    main()
