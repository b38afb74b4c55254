"""What a fit leaves of a channel: noise, or motion.

The cosine transform takes noise apart into coefficients that know nothing of each
other, whatever its memory, and has no jump where the record ends. Noise of memory φ
from sample to sample fills it by a known law; motion that the fit left - a line, a
drift, a decaying wave, a second kick - stands above that law in a few neighbours.
The law is fitted to the many, so that the few cannot bend it; no second measurement
of the noise is asked for, and uneven samples are as good as even ones.

Symbols    φ memory of AR(1) noise, e_k = φ e_(k-1) + fresh   S_k = s²/(1 - 2φ cos w_k + φ²), w_k = π k/samples
Source     Whittle 1953 (likelihood of a spectrum); Ahmed, Natarajan & Rao 1974 (cosine transform);
           Huber 1964 (bounded loss)
"""

from dataclasses import dataclass

import numpy as np
import scipy.special
from jaxtyping import Float

MEMORIES = np.concatenate([np.arange(-0.4, 0.9, 0.1), [0.9, 0.93, 0.95, 0.97, 0.98, 0.99, 0.995, 0.998]])
BOUND = 9.0  # of a squared coefficient over its law: what is beyond counts no more
MEDIAN = 0.454936  # of the square of a normal number
CHANCE = 1e-4  # of calling noise a motion, over the whole spectrum
ENOUGH = 16384  # coefficients that the memory is read from; of more, every second, third, …
CORRELATED = 4.0  # standard errors from which φ is told from 0


@dataclass(frozen=True)
class Residual:
    """What is left of one channel.

    Attributes:
        power: (samples - 1,) squared coefficients of its cosine transform, the mean left out.
        law: (samples - 1,) what noise has there on average.
        memory: φ; 0 where the noise passes as white.
        level: Standard deviation of the noise.
        chance: Probability that noise stands as far above its law anywhere.
        cost: Minus twice the log likelihood of the law, bounded.
    """

    power: np.ndarray
    law: np.ndarray
    memory: float
    level: float
    chance: float
    cost: float

    @property
    def moves(self) -> bool:
        """Whether motion is left."""
        return self.chance < CHANCE

    def chi_square(self, left: np.ndarray) -> float:
        """Of another residual of the same channel, weighed by this noise."""
        return float(np.sum(cosine_power(left) / self.law))

    def louder(self, turn: np.ndarray) -> np.ndarray:
        """Noise near an angle per sample over the mean of it: what white noise's errors must be multiplied by."""
        at = np.clip((np.asarray(turn) / np.pi * self.law.size).astype(int), 0, self.law.size - 1)
        return np.sqrt(self.law[at] / self.law.mean())


def cosine_power(left: Float[np.ndarray, "times"]) -> Float[np.ndarray, "coefficients"]:
    """Squares of the orthonormal cosine transform, but for the mean's."""
    size = left.size
    whole = np.fft.rfft(np.concatenate([left, left[::-1]]))[1:size]
    turned = whole * np.exp(-0.5j * np.pi * np.arange(1, size) / size)
    return turned.real**2 / (2 * size)


def examine(left: Float[np.ndarray, "times"], lost: int = 0) -> Residual:
    """The noise of what is left, and whether there is more.

    Args:
        left: Residual, in order of time.
        lost: Numbers that were fitted, whose directions are gone from it.
    """
    power = cosine_power(left)
    size = power.size
    turn = np.cos(np.pi * np.arange(1, size + 1) / (size + 1))
    lost = min(lost, size // 2)
    every = max(1, size // ENOUGH)
    few = power[::every], turn[::every], lost // every
    best, costs = (np.inf, 0.0), {}
    for memory in MEMORIES:
        costs[memory] = _cost(few[0], memory, *few[1:])[0]
    around = min(costs, key=lambda memory: costs[memory])
    place = int(np.flatnonzero(around == MEMORIES)[0])
    low, high = MEMORIES[max(place - 1, 0)], MEMORIES[min(place + 1, MEMORIES.size - 1)]
    for memory in (0.0, *np.linspace(low, high, 9)):
        cost = _cost(few[0], memory, *few[1:])[0]
        # a memory must earn its place: twice the log likelihood falls by a unit for nothing
        cost += CORRELATED**2 * (memory != 0.0)
        if cost < best[0]:
            best = (cost, float(memory))
    memory = best[1]
    cost, law = _cost(power, memory, turn, lost)
    level = float(np.sqrt(law.mean()))
    return Residual(power, law, memory, level, _chance(power / law), cost)


def _cost(power: np.ndarray, memory: float, turn: np.ndarray, lost: int) -> tuple[float, np.ndarray]:
    """Bounded minus twice log likelihood of a memory, and its law."""
    shape = 1 / (1 - 2 * memory * turn + memory**2)
    ratio = power / shape
    half = lost + (ratio.size - lost) // 2  # the fitted directions hold nothing: the median is that of the others
    scale = np.partition(ratio, half)[half] / MEDIAN + 1e-300
    kept = ratio < BOUND * scale
    # the mean of what is kept is steadier than a median; of a normal number's square 0.969 lie below the bound
    scale = max(float(ratio[kept].sum()) / max(int(kept.sum()) - lost, 1) / 0.9706, 1e-300)
    law = scale * shape
    return float(np.sum(np.log(law)) + np.sum(np.minimum(power / law, BOUND))), law


def _chance(ratio: np.ndarray) -> float:
    """Chance of the least likely stretch of neighbours, over all stretches."""
    total = np.concatenate([[0.0], np.cumsum(ratio)])
    least, tried, length = 1.0, 0, 1
    while length <= max(ratio.size // 4, 1):
        sums = total[length:] - total[:-length]
        most = float(sums.max())
        # the law's own scale is known from all coefficients only: an F ratio
        tail = scipy.special.fdtrc(length, max(ratio.size - length, 1), most / length)
        least = min(least, float(tail) * sums.size / length)
        tried += 1
        length *= 2
    return min(1.0, least * tried * 2)  # stretches of one length overlap: twice as many count as are apart
