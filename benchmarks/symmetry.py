"""Where dimples stop being round, over thickness: the table and the map of docs/symmetry.md.

python benchmarks/symmetry.py [map.png]        about an hour of one core, most of it compilation
"""

import sys

import jshell as js
from jshell import plot

THICKNESSES = (0.04, 0.035, 0.03, 0.025, 0.02, 0.015, 0.01)
ELEMENTS = 32


def loss(thickness: float, poisson_ratio: float = 0.5) -> js.membrane.SymmetryLoss:
    """First loss of symmetry of a shell as it deflates."""
    c = js.Reduced(thickness, 0.9, 1.6, 0.0, 1.4, poisson_ratio)
    return js.membrane.symmetry_loss(js.membrane.deflation_branch(c, elements=ELEMENTS), c)


def main() -> None:
    losses = []
    for thickness in THICKNESSES:
        found = loss(thickness)
        losses.append(found)
        ratio = float("nan") if found.volume_ratio is None else found.volume_ratio
        share = thickness / (1 - ratio) ** 0.5
        print(f"d_hat {thickness:g}: V/V0 {ratio:.4f}, m = {found.order}, d_hat/sqrt(1 - V/V0) {share:.4f}", flush=True)
    if len(sys.argv) > 1:
        plot.save(plot.symmetry_map(THICKNESSES, losses).figure, sys.argv[1])


if __name__ == "__main__":
    main()
