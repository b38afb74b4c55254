"""How fast errors fall: geometry, energy, added mass, modes with the elements; a trace with the step.

    .venv/bin/python benchmarks/convergence.py

Prints the error at each resolution and the observed order between neighbours, on even nodes so that the order is
that of the method and not of the grading.
"""

import importlib

import jax.numpy as jnp
import numpy as np

import jshell as js
from jshell.contour import area, meridian, volume
from jshell.flow import added_mass
from jshell.membrane import elastic_energy, rest, wall
from jshell.shell import presets

ELEMENTS = (12, 16, 24, 32)
FINEST = 64
STEPS = (1 / 20, 1 / 40, 1 / 80)
SHORTEST = 1 / 320
vibrations = importlib.import_module("jshell.dynamics.vibrations").vibrations
PROLATE = 0.2100150  # added-mass coefficient of a 2:1 prolate spheroid moving along its axis


def orders(sizes: list[float], errors: list[float]) -> str:
    """Observed orders between neighbours."""
    found = [np.log(errors[k] / errors[k + 1]) / np.log(sizes[k] / sizes[k + 1]) for k in range(len(sizes) - 1)]
    return ", ".join(f"{order:.1f}" for order in found)


def row(name: str, sizes: list[float], errors: list[float]) -> None:
    print(f"| {name} | {', '.join(f'{error:.1e}' for error in errors)} | {orders(sizes, errors)} |", flush=True)


def spheroid(elements: int):
    """A 2:1 prolate spheroid of volume 4π/3, and its mass in translation over that of its volume."""
    shape = meridian(elements)
    long, wide = 2 ** (2 / 3), 2 ** (-1 / 3)
    q = shape.sphere * jnp.where(jnp.arange(shape.sphere.size) < shape.x_size, long, wide)
    return shape, q, float(shape.shift @ added_mass(shape, q) @ shape.shift) / (4 * np.pi / 3)


def main() -> None:
    R = presets.R.conditions.as_arrays()
    spacing = [1 / n for n in ELEMENTS]
    shapes = {n: rest(R, elements=n, grading="uniform") for n in (*ELEMENTS, FINEST)}

    def energy(found):
        return float(elastic_energy(found.meridian, found.coordinates, wall(found.meridian, R, found.profile)))

    print(f"| even elements {ELEMENTS} against {FINEST} | relative errors | observed orders |")
    print("|---|---|---|")
    exact = 2 * np.pi * (2 ** (-2 / 3) + 2 ** (1 / 3) * np.arcsin(np.sqrt(3) / 2) / (np.sqrt(3) / 2))
    bodies = [spheroid(n) for n in ELEMENTS]
    row("area of a 2:1 spheroid", spacing, [abs(float(area(shape, q)) / exact - 1) for shape, q, _ in bodies])
    row("added mass of the same", spacing, [abs(mass / PROLATE - 1) for *_, mass in bodies])
    fine = shapes[FINEST]
    row(
        "volume of R at rest",
        spacing,
        [abs(float(volume(s.meridian, s.coordinates) / fine.volume) - 1) for s in (shapes[n] for n in ELEMENTS)],
    )
    row("elastic energy of R at rest", spacing, [abs(energy(shapes[n]) / energy(fine) - 1) for n in ELEMENTS])
    tones = {n: np.asarray(vibrations(shapes[n], R, 2, "ideal", "current").omega) for n in shapes}
    for k in range(2):
        row(f"mode {k + 1} of R", spacing, [abs(tones[n][k] / tones[FINEST][k] - 1) for n in ELEMENTS])

    found = js.dynamics.modes(R, elements=16, liquid="ideal")
    kick = js.dynamics.kick(found, 0.02, (1, 2))
    run = lambda h: np.asarray(  # noqa: E731
        js.dynamics.simulate(R, start=found.rest, velocity=kick, duration=10.0, step=h)["V"]
    )
    best = run(SHORTEST)
    errors = [float(np.abs(run(h) - best).max() / np.ptp(best)) for h in STEPS]
    print("\n| steps 1/20, 1/40, 1/80 against 1/320 | errors over the range of V | observed orders |")
    print("|---|---|---|")
    row("a kicked R with its Stokes layer, 10 units", list(STEPS), errors)


if __name__ == "__main__":
    main()
