"""Where dimples stop being round, over thickness: the tables and the map of docs/symmetry.md; what it costs.

python benchmarks/symmetry.py map [map.png]    about an hour of one core, most of it compilation
python benchmarks/symmetry.py agents           Table 1's contrast agents along their path
python benchmarks/symmetry.py elements         the lowest eigenvalue against elements
python benchmarks/symmetry.py sway             a shell on a holder, m = 1, against elements
python benchmarks/symmetry.py rates            frequencies and growth rates against elements, other walls and volumes
python benchmarks/symmetry.py cost             processor time of one core, warm
"""

import sys
import time
import warnings
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

import jshell as js
from jshell import plot
from jshell.contour import NO_WEAK_SPOT, WeakSpot
from jshell.dynamics.azimuthal import order_vibrations, orders_about
from jshell.dynamics.vibrations import vibrations
from jshell.errors import Outcome

THICKNESSES = (0.04, 0.035, 0.03, 0.025, 0.02, 0.015, 0.01)
ELEMENTS = 32


def loss(thickness: float, poisson_ratio: float = 0.5) -> js.membrane.SymmetryLoss:
    """First loss of symmetry of a shell as it deflates."""
    c = js.Reduced(thickness, 0.9, 1.6, 0.0, 1.4, poisson_ratio)
    return js.membrane.symmetry_loss(js.membrane.deflation_branch(c, elements=ELEMENTS), c)


def cpu(work: Callable[[int], object], turns: int = 1) -> float:
    """Processor time of a second and later calls, on average [s]; numbers differ from call to call."""
    jax.block_until_ready(work(0))
    began = time.process_time()
    for k in range(turns):
        jax.block_until_ready(work(k + 1))
    return (time.process_time() - began) / turns


def cost() -> None:
    """The three lines of docs/validation.md."""
    ratios = np.linspace(0.6, 0.85, 20)
    shell = js.Reduced(0.1, 0.9, 1.6, 0.004)
    at = lambda k: js.membrane.rest(shell, volume_ratio=ratios[k])  # noqa: E731
    shapes = [at(k) for k in range(4)]
    eight, twelve = range(1, 9), range(1, 13)
    print(f"rest shape: {cpu(lambda k: at(k).volume, 3):.3f} s")
    seen = cpu(lambda k: js.membrane.stability(shapes[k], orders=eight).eigenvalues, 3)
    print(f"lowest eigenvalue of 8 orders at one shape, with its two looks: {seen:.3f} s", flush=True)
    for liquid in ("ideal", "second"):
        ring = cpu(lambda k: order_vibrations(shapes[k], jnp.arange(1, 5), 4, 2, liquid).omega, 3)  # noqa: B023
        print(f"modes of 4 orders, liquid {liquid}: {ring:.3f} s", flush=True)
    js.membrane.stability(shapes[0], orders=twelve)
    began = time.process_time()
    for k in range(ratios.size):
        js.membrane.stability(at(k), orders=twelve)
    print(f"20 rest shapes, found and looked at in 12 orders: {time.process_time() - began:.1f} s", flush=True)


AGENTS = (0.005, 0.004, 0.003, 0.0025, 0.002, 0.001, 0.0004)
COMPUTED = 0.002  # d̂ down to which there are rest shapes


def agents() -> None:
    """Where thin contrast agents stop being round as they deflate: computed down to 0.002, by the law below."""
    for thickness in AGENTS:
        by_law = 1 - (thickness / 0.05) ** 2
        sphere = js.membrane.buckling_eigenvalue(thickness, elements=64) if thickness >= COMPUTED else None
        buckles = 1 - thickness if sphere is None else float(sphere.volume_ratio)
        told = f"d_hat {thickness:g}: law V/V0 {by_law:.6f}; a perfect sphere buckles at {buckles:.5f}"
        if thickness >= COMPUTED:
            found, finer = (js.membrane.critical_volume(thickness, elements=count) for count in (64, 96))
            ratios = [float("nan") if part.volume_ratio is None else part.volume_ratio for part in (found, finer)]
            told += f"; computed {ratios[0]:.6f} ({ratios[1]:.6f} on 96 elements), m = {found.order}"
        print(told, flush=True)


def elements() -> None:
    """The lowest eigenvalue against elements, and what is taken automatically."""
    warnings.simplefilter("ignore", js.errors.RangeWarning)
    shells = {d: js.Reduced(d, 0.9, 1.6, 0.0) for d in (0.02, 0.03)}
    orders = range(1, 13)
    for grading, counts in (("rim", (16, 24, 32, 48, 72)), ("uniform", (24, 40, 56, 80, 112))):
        for count in counts:
            for thickness, c in shells.items():
                shape = js.membrane.rest(c, volume_ratio=0.7, elements=count, grading=grading)
                found = js.membrane.stability(shape, orders=orders, elements=count)
                told = f"{found.eigenvalue:.6f} at m = {int(found.order)}, {Outcome(int(shape.outcome)).word}"
                print(f"d_hat {thickness:g}, {grading} {count}: {told}", flush=True)
    for thickness, c in shells.items():
        print(f"d_hat {thickness:g}: {js.membrane.stability(js.membrane.rest(c, volume_ratio=0.7))!r}", flush=True)


def swaying() -> None:
    """R on a holder, m = 1, with and without a weak spot, against elements."""
    for count in (24, 32, 48, 64):
        for spot in (NO_WEAK_SPOT, WeakSpot()):
            for liquid in ("ideal", "second"):
                found = js.dynamics.azimuthal_modes(
                    js.presets.R.conditions, 1, attached=0.3272, weak_spot=spot, liquid=liquid, count=2, elements=count
                )
                rates = ", ".join(f"{complex(s):.6f}" for s in found.rate[0])
                print(f"{count} elements, depth {spot.depth:g}, {liquid}: s = {rates}", flush=True)


def rates() -> None:
    """Undamped frequencies of the orders 0 to 3, and growth rates, against elements; other walls and volumes."""
    warnings.simplefilter("ignore", js.errors.RangeWarning)
    ring = lambda *case: print(*case, told(*case, orders=(0, 1, 2, 3)), flush=True)  # noqa: E731
    for count, grading in ((24, "rim"), (32, "rim"), (48, "rim"), (72, "rim"), (48, "uniform"), (72, "uniform")):
        ring(0.1, 0.7, 0.5, "current", count, grading)
    for thickness, ratio, nu, area in (
        (0.1, 0.85, 0.5, "current"), (0.05, 0.7, 0.5, "current"), (0.2, 0.5, 0.5, "current"),
        (0.1, 0.7, 0.3, "current"), (0.1, 0.7, 0.5, "koiter"), (0.1, 0.7, 0.5, "reference"),
    ):  # fmt: skip
        for count in (32, 48):
            ring(thickness, ratio, nu, area, count, "rim")
    for thickness, ratio, nu, area in (
        (0.025, 0.7, 0.5, "current"), (0.02, 0.7, 0.5, "current"), (0.03, 0.5, 0.5, "current"),
        (0.015, 0.85, 0.5, "current"), (0.025, 0.7, 0.3, "current"), (0.025, 0.7, 0.5, "koiter"),
        (0.025, 0.7, 0.5, "reference"),
    ):  # fmt: skip
        for count in (32, 48, 72):
            print(thickness, ratio, nu, area, count, told(thickness, ratio, nu, area, count, "rim"), flush=True)


def told(thickness, ratio, nu, area, count, grading, orders=(4, 5, 6, 7)) -> str:
    """The slowest undamped vibrations of each order at a volume, or their rates where they grow."""
    shell = js.Reduced(thickness, 0.9, 1.6, 0.0, 1.4, nu)
    state = js.membrane.rest(shell, volume_ratio=ratio, elements=count, area=area, grading=grading)
    beyond = [m for m in orders if m]
    found = orders_about(state, beyond, 2, "ideal")
    lines = []
    if 0 in orders:
        held = js.Reduced(thickness, 0.9, state.outer_pressure, 0.0, 1.4, nu).as_arrays()
        axial = vibrations(state, held, 2, "ideal", area)
        lines.append("m = 0: " + ", ".join(f"{omega:.6f}" for omega in axial.omega))
    for m, row in zip(beyond, np.asarray(found.rate), strict=True):
        parts = [f"grows {s.real:.5f}" if s.real > 1e-9 else f"{abs(s):.6f}" for s in row]
        lines.append(f"m = {m}: " + ", ".join(parts))
    return "; ".join(lines)


def first_losses(path: str | None) -> None:
    """Table and map over thickness."""
    losses = []
    for thickness in THICKNESSES:
        found = loss(thickness)
        losses.append(found)
        ratio = float("nan") if found.volume_ratio is None else found.volume_ratio
        share = thickness / (1 - ratio) ** 0.5
        print(f"d_hat {thickness:g}: V/V0 {ratio:.4f}, m = {found.order}, d_hat/sqrt(1 - V/V0) {share:.4f}", flush=True)
    if path is not None:
        plot.save(plot.symmetry_map(THICKNESSES, losses).figure, path)


if __name__ == "__main__":
    what, *rest = sys.argv[1:] or ["map"]
    if what == "map":
        first_losses(rest[0] if rest else None)
    else:
        {"agents": agents, "elements": elements, "sway": swaying, "rates": rates, "cost": cost}[what]()
