"""What a run is asked for besides its channels: sound, shapes in time, shapes of the modes, the liquid's motion.

Symbols    p pressure far away [E d/R0]   x, r meridian [R0]   θ material angle [rad]   ρ density of the liquid, 1
Valid for  an incompressible liquid: sound is heard at once, r/c later in a real one
Source     Lamb, Hydrodynamics, art. 56: far away a changing volume is a source of strength dV/dt
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jshell.contour import Meridian, regrade
from jshell.contour.splines import ParitySplines
from jshell.dynamics.simulate import Motion
from jshell.dynamics.vibrations import Modes
from jshell.errors import BadShape, BadValue
from jshell.flow.field import FluidField, field
from jshell.shell.parameters import Number, check
from jshell.trace import Trace

if TYPE_CHECKING:
    import xarray

ANGLES = 181  # material angles by default: every degree
LARGEST = 0.15  # largest displacement of a mode that is drawn, unless asked otherwise [R0]
SPLINE = 5  # degree of the spline that is differentiated

Angles = Float[Array, "angles"] | Float[np.ndarray, "angles"]


class Meridians(NamedTuple):
    """Meridians at common material angles: x and r, each (…, angles) [R0]."""

    x: Float[Array, "... angles"]
    r: Float[Array, "... angles"]


def far_pressure(trace: Trace, distance: Number) -> Float[np.ndarray, "times"]:
    """Pressure of the sound far from the shell, above the steady one: p = ρ V̈/(4π r).

    V̈ is the slope of a quintic spline through the channel `V_rate`: its error falls with the fifth power of the
    samples' spacing, one order slower within a few samples of both ends. A sudden step of the outer pressure
    jumps in V̈; the spline rings there.

    Args:
        trace: A run; any record with the channel `V_rate`, at least six samples of it.
        distance: r from the shell's centre, many radii [R0].

    Returns:
        (times,) pressure at the trace's times [E d/R0]; times `trace.scales.pressure` in Pa. A liquid that is
        compressible hears it r/c later.

    Raises:
        BadName: No channel `V_rate`.
        BadShape: Fewer than six samples.
        BadValue: A distance that is not above 1, inside the shell.

    Example:
        >>> import numpy as np
        >>> from jshell import Trace
        >>> from jshell.dynamics import far_pressure
        >>> t = np.linspace(0.0, 6.0, 61)
        >>> print(far_pressure(Trace(t, {"V_rate": np.sin(t)}), 10.0)[30].round(6))
        -0.007878
    """
    check("distance", distance, "a distance above 1 R0", lambda x: x > 1)
    times, rate = np.asarray(trace.times), np.asarray(trace["V_rate"])
    if times.ndim != 1 or times.size <= SPLINE:
        raise BadShape(
            "trace",
            found=f"times of shape {times.shape}",
            expected=f"one record of at least {SPLINE + 1} samples",
            remedy="Take one case at a time, or run longer.",
        )
    from scipy.interpolate import make_interp_spline  # here: it is slow to load, and few need it

    slope = make_interp_spline(times, rate, k=SPLINE).derivative()
    return slope(times) / (4 * np.pi * float(distance))


def meridian_at(motion: Motion, sample: int) -> Meridian:
    """The discretisation that the coordinates of one sample belong to; its nodes may have followed the rim."""
    shape, nodes = motion.setup.shape, motion.nodes[sample]
    return shape if bool(jnp.all(nodes == shape.nodes)) else _regrade(shape, nodes)


_regrade = eqx.filter_jit(regrade)


def liquid_at(motion: Motion, sample: int, x, r) -> FluidField:
    """The liquid around one sample of a run, at points; see `jshell.flow.field`.

    Args:
        motion: From `record`.
        sample: Which of its samples.
        x, r: Points, arrays of one shape [R0].
    """
    return field(meridian_at(motion, sample), motion.coordinates[sample], motion.velocity[sample], x, r)


def meridians(
    motion: Motion, angles: Angles | None = None, *, samples: Sequence[int] | None = None
) -> tuple[Meridians, Meridians]:
    """Shape and velocity of the wall at material angles.

    Args:
        motion: From `record`.
        angles: (angles,) material angles, 0 the buckling pole [rad]; every degree by default.
        samples: Which samples; all by default.

    Returns:
        x, r [R0] and their rates [R0/time unit], each (samples, angles).

    Raises:
        BadValue: Angles outside 0 to π.
    """
    chosen = slice(None) if samples is None else np.asarray(samples)
    shapes = (motion.nodes[chosen], motion.coordinates[chosen], motion.velocity[chosen])
    return _meridians(motion.setup.shape, *shapes, _checked(angles))


@eqx.filter_jit
def _meridians(shape: Meridian, nodes, coordinates, velocity, angles) -> tuple[Meridians, Meridians]:
    def one(sample):
        nodes, q, u = sample
        even, odd = _bases(nodes, shape.edge, angles)
        (qx, qr), (ux, ur) = shape.split(q), shape.split(u)
        return Meridians(even @ qx, odd @ qr), Meridians(even @ ux, odd @ ur)

    return jax.lax.map(one, (nodes, coordinates, velocity))


def to_xarray(motion: Motion, angles: Angles | None = None) -> "xarray.Dataset":
    """A run with its shapes as an xarray Dataset, without units.

    Args:
        motion: From `record`.
        angles: (angles,) material angles, 0 the buckling pole [rad]; every degree by default.

    Returns:
        The Dataset of `Trace.to_xarray`, conditions as attributes, and along `t` and `theta` the meridian `x`, `r`
        and its velocity `v_x`, `v_r`.

    Raises:
        BadValue: Angles outside 0 to π.
        MissingExtra: xarray is not installed.
    """
    angles = _checked(angles)
    shapes, rates = meridians(motion, angles)
    columns = {
        "x": (shapes.x, "position of the wall along the axis", "R₀"),
        "r": (shapes.r, "distance of the wall to the axis", "R₀"),
        "v_x": (rates.x, "velocity of the wall along the axis", "√(E d/ρ R₀)"),
        "v_r": (rates.r, "velocity of the wall away from the axis", "√(E d/ρ R₀)"),
    }
    made = {
        name: (("t", "theta"), np.asarray(values), {"units": "1", "long_name": words, "scale": scale})
        for name, (values, words, scale) in columns.items()
    }
    theta = ("theta", np.asarray(angles), {"units": "rad", "long_name": "material angle, 0 the buckling pole"})
    return motion.trace.to_xarray().assign_coords(theta=theta).assign(made)


def mode_shapes(
    modes: Modes,
    angles: Angles | None = None,
    *,
    phases: Float[Array, "phases"] | Float[np.ndarray, "phases"] | None = None,
    largest: Number = LARGEST,
) -> Meridians:
    """Meridians displaced along each mode.

    Args:
        modes: From `jshell.dynamics.modes`.
        angles: (angles,) material angles, 0 the buckling pole [rad]; every degree by default.
        phases: (phases,) moments of the swing, 0 where the volume is largest [rad]; 0 and π by default. Where
            there is loss the parts of the shell do not swing in step, and other phases show that.
        largest: The largest displacement of the wall in the whole swing [R0].

    Returns:
        x and r, (modes, phases, angles) [R0].

    Raises:
        BadValue: Angles outside 0 to π, a displacement not above 0, or a mode that is not ok.

    Example:
        >>> import jshell as js
        >>> found = js.dynamics.modes(js.presets.R.conditions, liquid="ideal")
        >>> js.dynamics.mode_shapes(found).x.shape
        (4, 2, 181)
    """
    check("largest", largest, "a displacement above 0", lambda x: x > 0)
    if bool(jnp.any(modes.outcome != 0)):
        raise BadValue(
            "modes", found="a mode that is not ok", expected="modes that converged", remedy="Read modes.outcome."
        )
    shape, q = modes.rest.meridian, modes.rest.coordinates
    angles = _checked(angles)
    phases = jnp.asarray([0.0, jnp.pi]) if phases is None else jnp.asarray(phases)
    return _swung(shape, q, modes.shapes, angles, phases, jnp.asarray(largest, dtype=float))


@eqx.filter_jit
def _swung(shape: Meridian, q, move, angles, phases, largest) -> Meridians:
    even, odd = _bases(shape.nodes, shape.edge, angles)
    move_x, move_r = move[:, : shape.x_size] @ even.T, move[:, shape.x_size :] @ odd.T
    # the largest of |Re(v e^iφ)| over the swing, at each angle: half axis of an ellipse in the plane (x, r)
    total, turned = jnp.abs(move_x) ** 2 + jnp.abs(move_r) ** 2, jnp.abs(move_x**2 + move_r**2)
    size = jnp.sqrt(jnp.max((total + turned) / 2, axis=1))
    swing = (largest / size)[:, None, None] * jnp.exp(1j * phases)[None, :, None]
    qx, qr = shape.split(q)
    x, r = (even @ qx)[None, None], (odd @ qr)[None, None]
    return Meridians(x + jnp.real(swing * move_x[:, None]), r + jnp.real(swing * move_r[:, None]))


def _bases(nodes, edge: int | None, angles) -> tuple[jax.Array, jax.Array]:
    """Values of the splines of x and of r at angles, (angles, ·) each."""
    even, odd = ParitySplines(nodes, "even", edge), ParitySplines(nodes, "odd", edge)
    return jnp.asarray(even(angles)), jnp.asarray(odd(angles))


def _checked(angles: Angles | None) -> Float[Array, "angles"]:
    if angles is None:
        return jnp.linspace(0.0, jnp.pi, ANGLES)
    angles = jnp.asarray(angles, dtype=float)
    check("angles", angles, "angles from 0 to π", lambda x: (x >= 0) & (x <= np.pi + 1e-12))
    return angles
