"""What the simulator says of a recording at some values of the unknowns.

Symbols    u what the solver sees of the unknowns   s rates   φ changes of the channels along the modes
"""

from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np

from jshell.errors import Outcome
from jshell.inversion.projection import Modal, Projection, project
from jshell.inversion.recording import POWER, Recording
from jshell.inversion.response import (
    CHANNELS,
    DIRECTIONS,
    FIELDS,
    SHARP,
    ModalResponse,
    Standing,
    liquids_program,
    mesh,
    response_program,
    sharpening_program,
    standing_program,
)
from jshell.inversion.unknowns import ParameterSet, Seen

ELEMENTS = 20


@dataclass
class Offset:
    """A better simulator: the exact liquid, and a pad's edge without a smallest element.

    Attributes:
        rates, shapes: (modes,), (modes, channels) over those of the search.
        rest: (channels,) added to the rest values.
        doubt: (modes,), (modes, channels), (channels,) what may be wrong of the three, in their own units.
    """

    rates: np.ndarray
    shapes: np.ndarray
    rest: np.ndarray
    doubt: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None

    def applied(self, modal: Modal) -> Modal:
        """Modes as the better simulator has them."""
        return Modal(modal.rates * self.rates, modal.shapes * self.shapes, modal.rest + self.rest)


@dataclass
class Weighing:
    """How the residual of one recording is weighed.

    Attributes:
        modes: Which of the simulator's modes the recording is described by.
        sigma: (channels,) standard errors.
        memory: (channels, times) φ of the noise over the step to each sample.
        offset: What a better simulator says over what this one does, or None.
        free_rest: Rest values are no data.
    """

    modes: tuple[int, ...]
    sigma: np.ndarray
    memory: np.ndarray
    offset: "Offset | None" = None
    free_rest: bool = False


@dataclass
class Model:
    """The simulator for a set of recordings.

    Attributes:
        recordings: What was recorded.
        parameters: What is asked.
        elements: Of the meridian.
        calls: How often the simulator was asked.
    """

    recordings: tuple[Recording, ...]
    parameters: ParameterSet
    elements: int = ELEMENTS
    calls: int = field(default=0)

    @property
    def title(self) -> str:
        """What was asked of what, for a report."""
        count = len(self.recordings)
        return f"shell of {count} recording{'s' if count > 1 else ''}, {self.described}"

    def known_notes(self, k: int, weighing: Weighing) -> str:
        """What of recording k was looked at, and by what it is described."""
        one, unit = self.recordings[k], "s" if self.parameters.si else "time units"
        samples = (
            f"{one.times.size} samples of {', '.join(one.channels)} from {one.times[0]:.4g} to {one.times[-1]:.4g}"
        )
        return f"recording {one.number}: {samples} {unit}, {self.describes(weighing)}"

    @property
    def described(self) -> str:
        """By what the recordings are described."""
        return "modes of the simulator"

    def describes(self, weighing: Weighing) -> str:
        """By how much of it one of them is."""
        free = ", rest values free" if weighing.free_rest else ""
        return f"{len(weighing.modes)} of the simulator's modes{free}"

    def seen(self, k: int, u: np.ndarray) -> tuple[Seen, list[int]]:
        """The numbers of recording k at u, and which unknowns are among them."""
        values, mine = self.parameters.of(k, self.parameters.to_values(u))
        return Seen(values, self.parameters.si), mine

    def standing(self, u: np.ndarray) -> list[Standing]:
        """The shell of every recording at rest, on nodes of its own."""
        return [self.sharpened(k, u, self.plain(k, u)) for k in range(len(self.recordings))]

    def plain(self, k: int, u: np.ndarray) -> Standing:
        """The shell of recording k at rest, on nodes that do not crowd at a pad's edge."""
        seen, _ = self.seen(k, u)
        self.calls += 1
        return standing_program(self.elements, seen.held)(jnp.asarray(seen.numbers))

    def sharpened(self, k: int, u: np.ndarray, near: Standing, ratio: float = SHARP) -> Standing:
        """The same on nodes that do, neighbours of a ratio; of a free shell as it is."""
        if not self.seen(k, u)[0].held:
            return near
        return sharpening_program(self.elements)(near, jnp.asarray(ratio))

    def edge(self, k: int, u: np.ndarray) -> int | None:
        """The node at the edge of the pad of recording k; None of a free shell."""
        return mesh(self.elements, self.seen(k, u)[0].held).edge

    def modal(self, k: int, u: np.ndarray, near: Standing) -> tuple[Modal, Modal, np.ndarray]:
        """All modes of recording k in the record's units, their derivatives by u, and how finding each ended."""
        seen, mine = self.seen(k, u)
        slopes = [seen.slope(self.parameters.names[i].partition("[")[0]) for i in mine]
        program = response_program(self.elements, seen.held, seen.lossy)
        changes = []
        for at in range(0, max(len(mine), 1), DIRECTIONS):
            tangents = np.zeros((DIRECTIONS, len(FIELDS)))
            for row, (direction, _, _) in enumerate(slopes[at : at + DIRECTIONS]):
                tangents[row] = direction
            self.calls += 1
            found, change = program(jnp.asarray(seen.numbers), jnp.asarray(tangents), near)
            changes.append(change)
        value = self._in_units(k, seen, found)
        return value, self._slopes(k, seen, value, changes, slopes, mine), np.asarray(found.outcome).astype(int)

    def liquids(self, k: int, u: np.ndarray, near: Standing) -> tuple[Modal, Modal, np.ndarray]:
        """All modes of recording k in the liquid of second order and in the exact one, and how finding each ended."""
        seen, _ = self.seen(k, u)
        self.calls += 1
        both = liquids_program(self.elements, seen.held, seen.lossy)(jnp.asarray(seen.numbers), near)
        second, exact = (self._in_units(k, seen, one) for one in both)
        return second, exact, np.max([np.asarray(one.outcome).astype(int) for one in both], axis=0)

    def _in_units(self, k: int, seen: Seen, found: ModalResponse) -> Modal:
        pick, scale = self._channels(k, seen)
        rates, shapes, rest = (np.asarray(part) for part in found[:3])
        return Modal(rates / seen.time, shapes[:, pick] * scale, rest[pick] * scale)

    def _channels(self, k: int, seen: Seen) -> tuple[list[int], np.ndarray]:
        names = self.recordings[k].channels
        return [CHANNELS.index(name) for name in names], np.array([seen.length ** POWER[name] for name in names])

    def _slopes(self, k, seen: Seen, value: Modal, changes, slopes, mine) -> Modal:
        size, names = len(self.parameters.names), self.recordings[k].channels
        pick, scale = self._channels(k, seen)
        powers = np.array([POWER[name] for name in names])
        out = Modal(
            np.zeros((size, *value.rates.shape), complex),
            np.zeros((size, *value.shapes.shape), complex),
            np.zeros((size, *value.rest.shape)),
        )
        for row, (i, (_, time, length)) in enumerate(zip(mine, slopes, strict=True)):
            part = [np.asarray(x)[row % DIRECTIONS] for x in changes[row // DIRECTIONS][:3]]
            out.rates[i] = part[0] / seen.time - value.rates * time
            out.shapes[i] = part[1][:, pick] * scale + value.shapes * powers * length
            out.rest[i] = part[2][pick] * scale + value.rest * powers * length
        return out

    def picked(self, k: int, u: np.ndarray, near: Standing, weighing: Weighing) -> tuple[Modal, Modal, Outcome]:
        """The modes that recording k is described by, as the better simulator has them, and their derivatives by u."""
        modal, change, outcomes = self.modal(k, u, near)
        chosen = list(weighing.modes)
        outcome = Outcome(int(np.max(outcomes[chosen])))
        if weighing.offset is not None:
            offset = weighing.offset
            change = change._replace(rates=change.rates * offset.rates, shapes=change.shapes * offset.shapes)
            modal = offset.applied(modal)
        picked = Modal(modal.rates[chosen], modal.shapes[chosen], modal.rest)
        if outcome == Outcome.OK and (not np.all(np.isfinite(picked.rates)) or np.any(np.real(picked.rates) > 0)):
            outcome = Outcome.NOT_FINITE
        return picked, Modal(change.rates[:, chosen], change.shapes[:, chosen], change.rest), outcome

    def project(self, k: int, u: np.ndarray, near: Standing, weighing: Weighing) -> tuple[Projection, Outcome]:
        """What the simulator leaves of recording k."""
        one = self.recordings[k]
        modal, slopes, outcome = self.picked(k, u, near, weighing)
        if outcome != Outcome.OK:
            nothing = np.full((one.values.size, u.size), np.nan)
            return Projection(nothing[:, 0], nothing, nothing, nothing, modal.rates, one.values), outcome
        elapsed, weight = one.times - one.times[0], 1 / weighing.sigma
        return project(elapsed, one.values, weight, weighing.memory, modal, slopes, weighing.free_rest), outcome
