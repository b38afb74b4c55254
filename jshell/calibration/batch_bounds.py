"""What a batch may change: bounds of its unknowns, and which of them are fixed.

Symbols    u = (log α1, log α2, k_VS or its square, log σ) unknowns   σ = 1/τ
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from jshell.calibration.parameters import check_value
from jshell.errors import BadValue, choose

NAMES = ("alpha1", "alpha2", "k_vs", "tau")
WIDEST = ((0.02, 500.0), (0.02, 500.0), (-np.inf, np.inf), (1e-3, 1e4))


class Box(NamedTuple):
    """Bounds of the unknowns.

    Attributes:
        low, high: (4,) of the unknowns; alike where they are fixed.
        fixed: (4,) which constants the caller fixed.
        held: Whether all three constants of the frequencies are free in a modal fit: k_VS is then held at 0, since
            one record's two frequencies leave the three open.
        negative: Whether a modal fit reports k_VS negative, as it was given.
    """

    low: np.ndarray
    high: np.ndarray
    fixed: np.ndarray
    held: bool = False
    negative: bool = False

    @property
    def free(self) -> np.ndarray:
        """(4,) unknowns that the search moves."""
        return ~self.fixed & ~np.array([False, False, self.held, False])

    def lanes(self, size: int) -> tuple[np.ndarray, np.ndarray]:
        """Both bounds for records side by side, (4, size) each."""
        return np.repeat(self.low[:, None], size, 1), np.repeat(self.high[:, None], size, 1)


def box_of(loss: str, fix: Mapping[str, float], bounds: Mapping[str, tuple[float, float]]) -> Box:
    """The bounds of a batch.

    Raises:
        BadName: A constant that a batch does not have.
        BadValue: An impossible bound or value; nothing free.
    """
    for name in (*fix, *bounds):
        remedy = "Use tau = alpha1/(2 beta1 viscosity) for beta1, or fit_trajectories."
        choose("parameter", name, NAMES, noun="parameter of a batch fit", remedy=remedy)
    low, high, fixed = np.zeros(4), np.zeros(4), np.zeros(4, bool)
    for i, name in enumerate(NAMES):
        least, most = (fix[name], fix[name]) if name in fix else bounds.get(name, WIDEST[i])
        positive = name != "k_vs"
        if name in fix:
            check_value(f"fix[{name!r}]", name, fix[name], positive=positive)
        elif not least < most or (positive and not most > WIDEST[i][0]):
            raise BadValue(
                f"bounds or fix of {name!r}",
                found=f"({least:g}, {most:g})",
                expected="lowest < highest, and room above 0 for a positive parameter"
                + (f", for {name} above {WIDEST[i][0]:g}" if positive else ""),
                remedy="Check the order.",
            )
        if positive:
            least, most = np.log(max(least, WIDEST[i][0])) if name not in fix else np.log(least), np.log(most)
        low[i], high[i] = (-most, -least) if name == "tau" else (least, most)
        fixed[i] = name in fix
    if fixed.all():
        raise BadValue("fix", found="every parameter fixed", expected="a free one", remedy="Free a parameter.")
    return Box(low, high, fixed) if loss == "strict" else _of_square(Box(low, high, fixed), bounds)


def _of_square(box: Box, bounds: Mapping[str, tuple[float, float]]) -> Box:
    """The bounds of a modal fit, which knows the square of k_VS."""
    least, most = box.low[2], box.high[2]
    held = not box.fixed[:3].any()
    bounded = [name for name in NAMES[:3] if name in bounds]
    if held and bounded:
        raise BadValue(
            f"bounds of {bounded[0]!r}",
            found="alpha1, alpha2 and k_vs all free",
            expected="one of them fixed: two frequencies of one record leave the three open, whatever their bounds",
            remedy='Give fix={"alpha2": …}, or leave the bounds out: omega_minus, omega_plus and tau need none.',
        )
    low, high = box.low.copy(), box.high.copy()
    if held:
        low[2] = high[2] = 0.0
        low[:2], high[:2] = -np.inf, np.inf
    else:
        # an interval that holds 0 holds the square 0
        low[2], high[2] = 0.0 if least <= 0 <= most else min(least**2, most**2), max(least**2, most**2)
    return Box(low, high, box.fixed, held, most <= 0 and least < 0)
