"""A stand-in for the simulator that needs no compilation: the stored table, interpolated.

It rings and rests as shells do, to a percent; how much each channel moves along a mode is made up, smoothly.
"""

import numpy as np
import pytest

import jshell as js
from jshell.inversion import model
from jshell.inversion.response import CHANNELS, ModalResponse, Standing
from jshell.inversion.starts import table
from jshell.shell import Liquid, Reduced, Shell, scales

STEP = 1e-5


def stand_in(numbers: np.ndarray) -> ModalResponse:
    """Three modes of H, W, V, S, both poles, the echo and three widths, of shells (shells, fields) side by side."""
    d, gas, outer, viscosity, kappa, nu, pad, spot, retardation = (part[:, None] for part in numbers.T)
    there = table(bool(pad[0, 0] > 0))
    log_omega, log_rate, rest, _ = there(there.place(*(numbers[:, k] for k in (0, 1, 2, 3, 6))))
    stiff = (kappa / 1.4) ** 0.2 * (nu / 0.5) ** 0.1 * (1 - 0.3 * spot)
    rates = (-np.exp(log_rate) + 1j * np.exp(log_omega)) * stiff
    rates = rates - 0.5 * retardation * rates.imag**2
    k, c = np.arange(1, 4)[:, None], np.arange(1, 11)
    d, gas, outer, viscosity, pad = (part[:, :, None] for part in (d, gas, outer, viscosity, pad))
    shapes = np.cos(k * c + d * k + 0.2 * gas * c) + 0.1j * np.sin(c + 5 * np.sqrt(viscosity) + outer * k + pad)
    shapes[..., 6] = rates**2 * shapes[..., 2] / (4 * np.pi)
    poles_and_silence = np.broadcast_to([-0.2, -1.0, 0.0], (len(numbers), 3))
    across = rest[:, 1:2] * np.array([0.8, 1.0, 0.9]) * (1 - 0.02 * spot)
    values = np.concatenate([rest * (1 - 0.02 * spot), poles_and_silence, across], axis=1)
    return ModalResponse(rates, shapes, values, np.zeros((len(numbers), 3)))


def _standing(numbers):
    return Standing(np.zeros(1), np.zeros(1), np.asarray(0))


def _response(numbers, tangents, near):
    numbers, tangents = np.asarray(numbers), np.asarray(tangents)
    size = np.abs(tangents).max(axis=1, keepdims=True)
    steps = tangents * STEP / np.where(size > 0, size, 1.0)
    around = stand_in(np.concatenate([numbers[None], numbers + steps, numbers - steps]))
    value, changes, count = [], [], len(tangents)
    for part in around:
        factor = (size / (2 * STEP)).reshape(-1, *(1,) * (part.ndim - 1))
        value.append(part[0])
        changes.append((part[1 : count + 1] - part[count + 1 :]) * factor)
    return ModalResponse(*value), ModalResponse(*changes)


@pytest.fixture
def no_compilation(monkeypatch):
    monkeypatch.setattr(model, "standing_program", lambda *_: _standing)
    monkeypatch.setattr(model, "sharpening_program", lambda *_: lambda near, _: near)
    monkeypatch.setattr(model, "response_program", lambda *_: _response)
    monkeypatch.setattr("jshell.inversion.fit.MODES", 3)


@pytest.fixture
def make_recording():
    """A ring-down of the stand-in, in a laboratory's units."""

    def make(thickness=0.15, gas=1.0, outer=1.7, viscosity=0.004, pad=0.3, *, retardation=0.0, noise=0.01, memory=0.0,
             seed=0, channels=("H", "W"), periods=5.0, size=(1.0, 0.4, 0.0), swing=0.02):  # fmt: skip
        found = ModalResponse(
            *(p[0] for p in stand_in(np.array([[thickness, gas, outer, viscosity, 1.4, 0.5, pad, 0.0, retardation]])))
        )
        pick = [CHANNELS.index(name) for name in channels]
        generator = np.random.default_rng(seed)
        times = np.linspace(0, periods * 2 * np.pi / found.rates[0].imag, 300)
        amplitudes = np.array(size) * np.exp(2j * np.pi * generator.uniform(size=3))
        waves = np.exp(np.outer(found.rates, times))
        moves = np.real((amplitudes[:, None] * found.shapes[:, pick]).T @ waves)
        moves *= swing / np.abs(moves).max()
        fresh = generator.standard_normal(moves.shape)
        for k in range(1, times.size):
            fresh[:, k] = memory * fresh[:, k - 1] + np.sqrt(1 - memory**2) * fresh[:, k]
        values = found.rest[pick][:, None] + moves + noise * np.abs(moves).max(axis=1, keepdims=True) * fresh
        unit = scales(Shell(0.02, thickness * 0.02, 0.5e6), Liquid(1200.0))
        settings = (("attached", repr(pad)),) if pad else ()
        return js.Trace(
            times, dict(zip(channels, values, strict=True)), Reduced(thickness, gas, outer, viscosity), scales=unit,
            settings=settings,
        )  # fmt: skip

    return make
