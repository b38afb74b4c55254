"""The shell itself, by the simulator, as fast as a slider moves: rest shape and slowest modes.

One compiled program serves every request: numbers of elements and of modes are
fixed, and all that a request brings is numbers. Requests wait for each other,
for they share the cores with everything else that the service does; of those
that wait too long none is begun. The first one compiles: they wait for that.

Symbols    x along the axis, r from it [R0]   ω = |s|   Ω damped frequency   τ decay time
Valid for  the liquid of `answer`: a Stokes layer to second order; `exact` any viscosity
"""

import threading
import warnings
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jshell.dynamics.azimuthal import orders_about
from jshell.dynamics.modes import modes
from jshell.dynamics.vibrations import Modes
from jshell.errors import Outcome
from jshell.membrane import RestShape, stability
from jshell.service.problems import Refused
from jshell.service.replies import finite
from jshell.shell.parameters import Reduced

ELEMENTS, COUNT = 24, 4  # ω to 1e-6
ORDERS, THINNEST = range(1, 17), 0.016  # of `stability`: what a shell of that thickness can lose its symmetry by
AROUND = (1, 2, 3)  # orders whose slowest vibration is told
EVERY = 2  # Gauss points of an outline that are drawn
DIGITS = 4  # behind the point, of an outline in R0
PATIENCE, LONG_PATIENCE = 5.0, 20.0  # seconds that a request waits for its turn
COMPILING = 90.0  # seconds that it waits while the first one compiles
WAITING = 12  # requests of a kind at once: more would hold the threads that answer everything else


class Turns:
    """Work that is done one after the other, by whoever asks for it.

    Attributes:
        patience: Seconds that a request waits for its turn, once a first one is done.
        places: For requests that wait, and the one that is worked on.
    """

    def __init__(self, patience: float):
        self.patience, self.places = patience, threading.BoundedSemaphore(WAITING)
        self._turn, self._compiled = threading.Lock(), False

    def take(self, work: Callable[[], Any]) -> Any:
        """The work's result.

        Raises:
            Refused: Too many wait, or for too long.
        """
        if not self.places.acquire(blocking=False):
            raise self._busy()
        try:
            if not self._turn.acquire(timeout=self.patience if self._compiled else max(COMPILING, self.patience)):
                raise self._busy()
            try:
                found = work()
                self._compiled = True
                return found
            finally:
                self._turn.release()
        finally:
            self.places.release()

    @staticmethod
    def _busy() -> Refused:
        return Refused(
            "the simulator", found="busy with other shells", expected="a turn within some seconds",
            remedy="Move the slider again.", code="too_many", after=5,
        )  # fmt: skip


_SHAPES, _EXACT = Turns(PATIENCE), Turns(LONG_PATIENCE)


class Drawing(eqx.Module):
    """Rest shape, modes and what is drawn of them; (points,) and (modes, points)."""

    found: Modes
    x: jax.Array
    r: jax.Array
    dx: jax.Array
    dr: jax.Array


@eqx.filter_jit
def _all(conditions: Reduced, liquid: str, count: int) -> Drawing:
    found = modes(conditions, liquid=liquid, count=count, elements=ELEMENTS)
    x, r = half(found.rest, found.rest.coordinates)
    dx, dr = jax.vmap(lambda v: half(found.rest, v))(found.shapes)
    size = jnp.max(jnp.hypot(jnp.abs(dx), jnp.abs(dr)), axis=1, keepdims=True)
    return Drawing(found, x, r, dx / size, dr / size)


def half(state: RestShape, q: jax.Array) -> tuple[jax.Array, jax.Array]:
    """x and r from pole to pole; of complex coordinates as well."""
    one = lambda q: (state.meridian.at_points(q), state.meridian.at_nodes(q)[0])  # noqa: E731
    if not jnp.iscomplexobj(q):
        curve, x = one(q)
        ends = jnp.concatenate([x[:1], curve.x[::EVERY], x[-1:]])
        return ends, jnp.concatenate([jnp.zeros(1), curve.r[::EVERY], jnp.zeros(1)])
    real, imag = half(state, jnp.real(q)), half(state, jnp.imag(q))
    return real[0] + 1j * imag[0], real[1] + 1j * imag[1]


def found_of(conditions: Reduced, liquid: str = "second", count: int = COUNT) -> Drawing:
    """Rest shape and modes, in turn with other requests.

    Raises:
        Refused: Too many wait.
    """
    return _SHAPES.take(lambda: jax.block_until_ready(_all(conditions.as_arrays(), liquid, count)))


def answer(conditions: Reduced) -> dict[str, Any]:
    """What the page draws and says of a shell."""
    drawn = found_of(conditions)
    found, rest = drawn.found, drawn.found.rest
    outcome = Outcome(int(rest.outcome))
    said = {name: finite(float(getattr(rest, name))) for name in ("volume_ratio", "pressure", "gap", "stability")}
    rows = []
    for k, row in enumerate(found.table()):
        ways = (drawn.dx[k].real, drawn.dr[k].real, drawn.dx[k].imag, drawn.dr[k].imag)
        rows.append(vars(row) | {"way": [rounded(way) for way in ways]})
    return said | {
        "outcome": outcome.word.replace("_", " "),
        "advice": outcome.advice,
        "thickness": float(conditions.thickness),
        "x": rounded(drawn.x),
        "r": rounded(drawn.r),
        "modes": rows,
    }


def exact(conditions: Reduced) -> dict[str, Any]:
    """Two modes in the exact liquid, whether the shape is round, and the slowest vibration of each order around it.

    Those are in a layer to second order; the exact liquid is known for m = 0 only.
    """

    def both() -> dict[str, Any]:
        drawn = jax.block_until_ready(_all(conditions.as_arrays(), "exact", 2))
        rest, verdict, around = drawn.found.rest, None, ()
        if int(rest.outcome) == Outcome.OK and float(conditions.thickness) >= THINNEST:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                verdict = stability(rest, orders=ORDERS, elements=2 * ELEMENTS).verdict
                around = orders_about(rest, AROUND, 1).table()
        rows = [vars(row) for row in drawn.found.table()]
        return {"modes": rows, "verdict": verdict, "around": [vars(row) for row in around]}

    return _EXACT.take(both)


def rounded(values: Any) -> list[float | None]:
    """An outline's numbers; what is no number is null."""
    return finite(np.round(np.asarray(values, dtype=float), DIGITS).tolist())
