"""Every figure of the source, drawn from a campaign of our own.

A figure is a name, the label of the source's, and a function from the material
to a picture. The material is the campaign and what is computed beside it:
rest shapes, modes, one run with its shapes.

Source     Mokbel et al. 2021, all figures
"""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np

from jshell import comparators, dynamics, membrane
from jshell.errors import BadName, BadValue, Outcome, RangeWarning
from jshell.paper import damping as _damping
from jshell.paper import frequencies as _frequencies
from jshell.paper import records as _records
from jshell.paper import shapes as _shapes
from jshell.paper import softening as _softening
from jshell.paper import trends as _trends
from jshell.paper.joint_fits import JointFit, ShellRuns, calibrate, read_runs
from jshell.plot.film import moments
from jshell.plot.style import Figure
from jshell.shell import Reduced, presets
from jshell.shell.elasticity import SPHERE_VOLUME
from jshell.shell.rest import sphere_state
from jshell.signals import Signature, extract
from jshell.trace import Trace

PAD = 0.3272  # half-angle of the pad that holds the attached shell [rad]
SNAP_LOAD = 1.62  # outer pressure of the run that is drawn in pictures: the weak spot buckles R there for certain
PRESSURES = (0.5, 1.5)  # beside R in fig:oscill; the nearest of the campaign are taken
TOGETHER = ("V", "H", "W")
LIQUIDS = (0.0006, 0.013, 0.13, 0.6)  # viscosities of the kicks drawn: thicker ones move less than stored digits show


@runtime_checkable
class Campaign(Protocol):
    """What the figures read of a campaign: a catalogue of `jshell.campaigns`, or anything that looks like one."""

    @property
    def columns(self) -> tuple[str, ...]: ...

    def __getitem__(self, name: Any, /) -> Any: ...

    def __iter__(self) -> Iterator[Any]: ...


class Material:
    """A campaign and what is computed beside it, each when it is first asked for.

    Args:
        campaign: A catalogue, as `jshell.campaigns.catalog()` gives it, or a function that loads one when a figure
            first needs it.
        elements: Spline elements of what is computed here.
        checkpoint: File that keeps the run with shapes between two calls; None keeps none.
    """

    def __init__(
        self, campaign: Campaign | Callable[[], Campaign], *, elements: int = 24, checkpoint: str | None = None
    ) -> None:
        self._given, self.elements, self.checkpoint = campaign, elements, checkpoint

    @cached_property
    def campaign(self) -> Campaign:
        return self._given if isinstance(self._given, Campaign) else self._given()

    @cached_property
    def table(self) -> dict[str, np.ndarray]:
        return {name: self.campaign[name] for name in self.campaign.columns}

    @cached_property
    def runs(self) -> ShellRuns:
        return read_runs(self.table)

    @cached_property
    def readings(self) -> tuple[JointFit, ...]:
        return calibrate(self.runs)

    @cached_property
    def motion(self) -> dynamics.Motion:
        """R through its snap, with its shapes."""
        case = presets.R.conditions.replace(outer_pressure=SNAP_LOAD)
        return dynamics.record(case, duration=60.0, elements=self.elements, checkpoint=self.checkpoint)

    def trace(self, *families: str, near: float | None = None) -> Trace:
        """The record of a run that ended well in the first of the families that has one.

        Args:
            families: In order of preference.
            near: P̂0 wanted; the nearest is taken. None takes the first.

        Raises:
            BadValue: None of them has one.
        """
        results, gas = list(self.campaign), self.runs.gas_pressure
        fine = np.isfinite(self.runs.extracted).all(axis=1)
        for family in families:
            rows = np.flatnonzero(self.runs.within(family) & fine)
            if rows.size:
                best = rows[0] if near is None else rows[np.argmin(np.abs(np.log(gas[rows] / near)))]
                return results[int(best)].trace
        raise BadValue(
            "campaign", found="no run that ended well in " + " or ".join(families), expected="one at least",
            remedy="Run the shipped design to its end.",
        )  # fmt: skip


def setup(material: Material) -> Figure:
    """fig:exptyp."""
    trace = material.trace("R-attached", "attached", near=0.9)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RangeWarning)
        rest = membrane.rest(presets.R.conditions, elements=material.elements, attached=PAD, throw=True)
    unit = presets.R_MACRO.unit
    assert unit is not None
    return _shapes.setup(rest, trace, _extracted(trace, ("H", "W")), unit)


def snapshots(material: Material) -> Figure:
    """fig:simulationResults."""
    return _shapes.snapshots(material.motion)


def relaxation(material: Material) -> Figure:
    """fig:oscill."""
    reference = material.motion.trace
    low, high = (material.trace("pressure", near=P0) for P0 in PRESSURES)
    several = (low, reference, high)
    extracted = {name: _extracted(reference, (name,)) for name in ("V", "S")}
    return _records.relaxation(several, reference, extracted, moments(material.motion))


def control(material: Material) -> Figure:
    """fig:resul."""
    return _frequencies.control(material.runs, "thickness", "viscosity", "excess", "shape")


def coordinates(material: Material) -> Figure:
    """fig:schememodel."""
    found = dynamics.modes(presets.R.conditions, count=2, liquid="ideal", elements=material.elements, throw=True)
    return _shapes.coordinates(found)


def master(material: Material) -> Figure:
    """fig:w."""
    return _frequencies.master(material.readings, material.runs)


def every_run(material: Material) -> Figure:
    """eq:defw with the source's constants, run by run."""
    return _frequencies.every_run(material.runs)


def constants(material: Material) -> Figure:
    """The joint fit of section "Oscillation frequencies", by every reading."""
    return _frequencies.constants(material.readings)


def softening(material: Material) -> Figure:
    """fig:soft."""
    return _softening.softening()


def damping(material: Material) -> Figure:
    """fig:tau."""
    return _damping.damping(material.runs)


def trends(material: Material) -> Figure:
    """sec:simulresul: thick liquids stop the ringing, the area hardly changes."""
    runs, results = material.runs, list(material.campaign)
    rows = np.flatnonzero(runs.within("viscosity-kick"))
    if rows.size == 0:
        raise BadValue(
            "campaign", found="no family viscosity-kick", expected="kicks in liquids of several viscosities",
            remedy="Run the shipped design to its end.",
        )  # fmt: skip
    nearest = {int(rows[np.argmin(np.abs(np.log(runs.viscosity[rows] / eta)))]) for eta in LIQUIDS}
    return _trends.trends(runs, {k: results[k].trace for k in nearest})


def attached(material: Material) -> Figure:
    """fig:detail-attached."""
    free = material.trace("R-free", "pressure", near=0.9)
    held = material.trace("R-attached", "attached", near=0.9)
    return _records.attached((free, _extracted(free, TOGETHER)), (held, _extracted(held, TOGETHER)))


def meridian(material: Material) -> Figure:
    """fig:axisymmetric."""
    return _shapes.meridian_stretches(membrane.rest(presets.R.conditions, elements=material.elements, throw=True))


def spheres(material: Material) -> Figure:
    """eq:oscillSph."""
    return _damping.spheres(read_spheres(material.table))


def read_spheres(table: dict[str, np.ndarray]) -> _damping.Spheres:
    """The spherical runs of a campaign's table.

    A step so large that the wall bears more than its buckling threshold on the way leaves the spherical shape and
    ends its run; such a row is the radial equation's, in which it cannot.

    Raises:
        BadValue: There are none.
    """
    rows = np.isin(table["kind"], ("step", "swell"))
    if not rows.any():
        raise BadValue(
            "campaign", found="no breathing sphere", expected="runs of the kinds step and swell",
            remedy="Run the shipped design to its end.",
        )  # fmt: skip
    pick = lambda name: np.asarray(table[name], dtype=float)[rows]  # noqa: E731
    extracted, small = pick("one_omega"), np.asarray(table["kind"])[rows] == "swell"
    radial = ~np.isfinite(extracted) | (np.asarray(table["outcome"])[rows] != "ok")
    cases = np.stack([pick(name) for name in ("d_hat", "P0_hat", "Pext_hat", "eta_hat")], axis=1)
    for k in np.flatnonzero(radial):
        extracted[k] = _radial_frequency(Reduced(*(float(value) for value in cases[k])))
    step = np.round(cases[:, 2] - cases[:, 1], 6)
    return _damping.Spheres(cases[:, 1], step, pick("V_e"), extracted, pick("omega_sphere"), small, radial)


def _nothing(t: Any) -> Any:
    """No forcing; one function, so that all spheres share one compiled program."""
    return 0.0 * t


def _radial_frequency(conditions: Reduced) -> float:
    """The frequency of the intact sphere after the outer pressure has stepped from the gas pressure to its own."""
    rest = float(np.cbrt(float(sphere_state(conditions.as_arrays()).volume) / SPHERE_VOLUME))
    times = np.arange(0.0, 20.0, 0.05)
    run = comparators.sphere_run(conditions, _nothing, times=times, initial=(1.0 - rest, 0.0))
    extracted = extract(run.trace(), "V", start=0.0)
    return float(extracted.fits[0].omega[0]) if extracted.fits else float("nan")


@dataclass(frozen=True)
class PaperFigure:
    """A figure of the source.

    Attributes:
        name: Ours, by which it is asked for.
        label: The source's.
        words: What it shows.
        draw: From the material to the picture.
    """

    name: str
    label: str
    words: str
    draw: Callable[[Material], Figure]


FIGURES = (
    PaperFigure("setup", "fig:exptyp", "attached shell, H and W with their damped pair", setup),
    PaperFigure("snapshots", "fig:simulationResults", "the snap in pictures, with its flow", snapshots),
    PaperFigure("relaxation", "fig:oscill", "V and S for three gas pressures, with fits", relaxation),
    PaperFigure("control", "fig:resul", "slow angular frequency against d̂, η̂, pressure", control),
    PaperFigure("coordinates", "fig:schememodel", "the two slowest motions and their flow", coordinates),
    PaperFigure("master", "fig:w", "all angular frequencies on one curve", master),
    PaperFigure("every_run", "eq:defw", "every run over the source's curve", every_run),
    PaperFigure("constants", "subsec:agree", "the constants by every reading", constants),
    PaperFigure("softening", "fig:soft", "angular frequencies through buckling", softening),
    PaperFigure("damping", "fig:tau", "decay time against Reynolds number", damping),
    PaperFigure("trends", "sec:simulresul", "ringing in thick liquids, area at rest", trends),
    PaperFigure("attached", "fig:detail-attached", "attached against free, amplitude ratios", attached),
    PaperFigure("meridian", "fig:axisymmetric", "meridian and principal stretches", meridian),
    PaperFigure("spheres", "eq:oscillSph", "the breathing sphere against eq:wsphere", spheres),
)


def figure(name: str) -> PaperFigure:
    """A figure by its name or the source's label.

    Raises:
        BadName: No such figure.

    Example:
        >>> from jshell.paper import figures
        >>> print(figures.figure("fig:w").name)
        master
    """
    for one in FIGURES:
        if name in (one.name, one.label):
            return one
    raise BadName(
        f"figure {name!r}",
        found="no such figure",
        expected="one of " + ", ".join(one.name for one in FIGURES),
        remedy="`jshell figures` lists them.",
    )


def _extracted(trace: Trace, channels: tuple[str, ...]) -> Signature:
    extracted = extract(trace, channels)
    if extracted.outcome != Outcome.OK:
        raise BadValue(
            f"record of {', '.join(channels)}", found=extracted.reason, expected="a ring-down above its noise",
            remedy="Choose another run.",
        )  # fmt: skip
    return extracted
