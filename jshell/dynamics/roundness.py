"""Whether a rest shape is round, and how fast it leaves its symmetry if it is not.

Symbols    m order around the axis   growth rate s > 0 of a motion e^{st} cos mφ [1/time]
Valid for  as `jshell.membrane.stability`; growth while the motion is small
Source     `jshell.dynamics.azimuthal`
"""

from typing import NamedTuple

import numpy as np

from jshell.dynamics.azimuthal import check_order_liquid, orders_about
from jshell.errors import Outcome
from jshell.membrane import RestShape, Stability, stability


class Roundness(NamedTuple):
    """Whether a rest shape is round, and what it does if it is not.

    Attributes:
        stability: Eigenvalues against motions out of round.
        growth: Fastest rate among the orders whose eigenvalue is negative, in the shell's own liquid; 0 where none is
            [1/time].
        order: m of that motion, or of the softest one where the shape is round.
    """

    stability: Stability
    growth: float
    order: int

    @property
    def verdict(self) -> str:
        """`round`, `not round` with the fastest order and the rate at which it grows, or `unknown`."""
        if int(self.stability.outcome) != Outcome.OK or self.growth == 0.0:
            return self.stability.verdict
        return f"not round: m = {self.order}, grows at rate {self.growth:.3g}"


def roundness(state: RestShape, *, liquid: str = "second") -> Roundness:
    """Whether a rest shape is round, and how fast it leaves its symmetry if it is not.

    Args:
        state: From `jshell.membrane.rest`, not batched.
        liquid: As in `azimuthal_modes`.
    """
    check_order_liquid(liquid)
    found = stability(state)
    unstable = np.asarray(found.orders)[np.asarray(found.eigenvalues) < 0]
    if int(found.outcome) != Outcome.OK or unstable.size == 0:
        return Roundness(found, 0.0, int(found.order))
    rates = np.real(np.asarray(orders_about(found.rest, unstable.tolist(), 1, liquid).rate))
    fastest = int(np.nanargmax(rates[:, 0]))
    return Roundness(found, float(rates[fastest, 0]), int(unstable[fastest]))
