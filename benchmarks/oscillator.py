"""The short model against SciPy in one run: nonlinear fits, a bifurcation diagram, a Jacobian, a Sobol study.

Prints a table in Markdown. Rivals run at the tolerance that the answer needs, on as many cases as fit into a
few minutes, and are scaled to the whole job. One core:

    taskset -c 0 .venv/bin/python benchmarks/oscillator.py
"""

import os
import sys
import time
import warnings
from collections.abc import Callable

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # NumPy reads it too, for the rivals


import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

import jshell as js
from jshell.calibration.nonlinear import fit_nonlinear
from jshell.oscillator import Coefficients, add_noise, bifurcation, drive, ensemble, matrices, random_shell
from jshell.oscillator.linear import propagator, state_matrix
from jshell.shell.rest import RestState, buckled_state

FITS, RIVAL_FITS = 100, 6
LANES, PERIODS, RIVAL_LANES = 1000, 200, 4
SOBOL, RIVAL_SOBOL = 18432, 20
TIMES = np.linspace(0.0, 40.0, 400)


def seconds(job: Callable[[], object], repeats: int = 3) -> float:
    """Best of some warm calls."""
    jax.block_until_ready(job())
    best = np.inf
    for _ in range(repeats):
        began = time.perf_counter()
        jax.block_until_ready(job())
        best = min(best, time.perf_counter() - began)
    return best


def right_hand_side(shell, state, constants, amplitude=0.0, pulsation=1.0) -> Callable:
    """The nonlinear equation written out in floats, as a careful user of SciPy would."""
    from math import pi, sin

    a1, a2, k, b1 = constants
    V_e, P_e = float(state.volume), float(state.pressure)
    eta, kappa, S_e = float(shell.viscosity), float(shell.kappa), 4 * pi
    K_A = 0.5 / (1 - float(shell.poisson_ratio))
    b2 = 2 * a2 * b1 / (9 * a1)
    A_VS, A_SS = k / V_e, K_A / S_e

    def rate(t, y):
        V, S, v, s = y
        h2 = S * S - 4 * pi * pi
        G = V * V * S * S / (pi * pi * h2)
        G_V, G_S = 2 * G / V, 2 * V * V * S / (pi * pi * h2) * (1 - S * S / h2)
        push = P_e * (V_e / V) ** kappa - P_e - amplitude * sin(pulsation * t)
        F_V = push - A_VS * (S - S_e) + a2 / (12 * pi) * G_V * s * s - eta * b1 / pi * v
        F_S = -A_VS * (V - V_e) - A_SS * (S - S_e) + a2 / (12 * pi) * G_S * s * s - 3 * eta * b2 / pi * G * s
        F_S -= a2 / (6 * pi) * (G_V * v + G_S * s) * s
        return [v, s, 4 * pi * F_V / a1, 6 * pi * F_S / (a2 * G)]

    return rate


def fits() -> list[tuple]:
    """100 nonlinear fits of V and S, 4 constants and 4 initial values each."""
    traces, truth = [], []
    for seed in range(FITS):
        s = random_shell(seed)
        c = s.coefficients
        run = drive(s.conditions, c, times=TIMES, initial=tuple(s.initial), equilibrium=s.state, solver="rk4",
                    step=0.01, budget=False)  # fmt: skip
        clean = js.Trace(TIMES, {"V": np.asarray(run.motion.V), "S": np.asarray(run.motion.S)}, s.conditions)
        traces.append(add_noise(clean, 0.01, seed))
        truth.append((s, [c.alpha1, c.alpha2, c.k_vs, c.beta1]))

    def by_scipy(number: int) -> np.ndarray:
        trace, (s, constants) = traces[number], truth[number]
        V, S = (np.asarray(trace[name]) for name in ("V", "S"))
        spread = [0.01 * V.std(), 0.01 * S.std()]

        def residual(u):
            rate = right_hand_side(s.conditions, s.state, (np.exp(u[0]), np.exp(u[1]), u[2], np.exp(u[3])))
            y0 = [float(s.state.volume) + u[4], 4 * np.pi + u[5], u[6], u[7]]
            found = solve_ivp(rate, (0, TIMES[-1]), y0, method="LSODA", t_eval=TIMES, rtol=1e-6, atol=1e-8).y
            return np.concatenate([(found[0] - V) / spread[0], (found[1] - S) / spread[1]])

        # a start as near as the matrix pencil's, at no cost to the rival
        near = np.array([*np.log(constants[:2]), constants[2], np.log(constants[3]), *s.initial])
        return least_squares(residual, near * 1.02, x_scale="jac", diff_step=1e-5).x

    began = time.perf_counter()
    for number in range(RIVAL_FITS):
        by_scipy(number)
    rival = (time.perf_counter() - began) / RIVAL_FITS * FITS
    rows = []
    for solver in ("diffrax", "rk4"):
        mine = seconds(lambda solver=solver: fit_nonlinear(traces, solver=solver).constants, 1)
        found = fit_nonlinear(traces, solver=solver)
        far = np.abs(found.constants - np.array([c for _, c in truth])) / found.stderr
        ok = sum(outcome == js.Outcome.OK for outcome in found.outcome)
        rows.append((f"100 nonlinear fits, {solver}", mine, rival, f"{ok} ok, worst {np.nanmax(far):.2f} σ"))
    return rows


def diagram() -> tuple:
    """1 000 amplitudes × 200 periods."""
    shell = js.Reduced(0.08, 0.9, 1.2, 0.02)
    c = Coefficients(3.6, 1.1, 0.23, 5.3)
    amplitudes, w = np.linspace(0.001, 0.03, LANES), 0.8
    mine = seconds(lambda: bifurcation(shell, c, amplitudes, w, periods=PERIODS).volume)
    found = bifurcation(shell, c, amplitudes, w, periods=PERIODS)
    state = buckled_state(shell)
    gap, began = 0.0, time.perf_counter()
    chosen = np.linspace(0, LANES - 1, RIVAL_LANES).astype(int)
    strobes = 2 * np.pi / w * np.arange(PERIODS + 1)
    for k in chosen:
        rate = right_hand_side(shell, state, (3.6, 1.1, 0.23, 5.3), amplitudes[k], w)
        y = solve_ivp(rate, (0, strobes[-1]), [float(state.volume), 4 * np.pi, 0.0, 0.0], method="DOP853",
                      t_eval=strobes, rtol=1e-6, atol=1e-8).y  # fmt: skip
        gap = max(gap, float(np.max(np.abs(y[0, -50:] - float(state.volume) - np.asarray(found.volume)[:, k]))))
    rival = (time.perf_counter() - began) / RIVAL_LANES * LANES
    return "bifurcation diagram, 1 000 × 200 periods", mine, rival, f"strobes {gap:.1e} apart (SciPy rtol 1e-6)"


def _linear_trace(shell, state, x: np.ndarray) -> np.ndarray:
    A = np.asarray(state_matrix(matrices(Coefficients(*x[:4]), state, shell)))
    found = solve_ivp(lambda t, y: A @ y, (0, TIMES[-1]), x[4:], method="DOP853", t_eval=TIMES, rtol=1e-10, atol=1e-12)
    return found.y[:2].T


def jacobian() -> tuple:
    """Derivatives of a 400-sample trace by 8 unknowns."""
    s = random_shell(0)
    c, step = s.coefficients, TIMES[1]
    x = np.array([c.alpha1, c.alpha2, c.k_vs, c.beta1, *s.initial])
    state = RestState(*(jnp.asarray(part) for part in s.state))
    constants = Coefficients(*(jnp.asarray(part) for part in x[:4]))
    args = (s.conditions.as_arrays(), constants, state, jnp.asarray(x[4:]), jnp.asarray(step), 400)
    mine = seconds(lambda: ensemble.trace_jacobian(*args)[1], 200)
    value, _ = ensemble.trace_jacobian(*args)
    began = time.perf_counter()
    base = _linear_trace(s.conditions, state, x)
    for k in range(8):
        h = 1e-5 * max(abs(x[k]), 0.1)
        up, down = (_linear_trace(s.conditions, state, x + sign * h * (np.arange(8) == k)) for sign in (1, -1))
        (up - down) / (2 * h)
    rival = time.perf_counter() - began

    # another way to the same derivatives: one matrix exponential per sample, differentiated
    def each_by_itself(x):
        system = matrices(Coefficients(x[0], x[1], x[2], x[3]), state, s.conditions)
        return propagator(system, jnp.asarray(TIMES))[:, :2] @ x[4:]

    exact = jax.jit(jax.jacfwd(each_by_itself))(jnp.asarray(x))
    gap = float(np.max(np.abs(np.asarray(ensemble.trace_jacobian(*args)[1]) - np.asarray(exact))))
    tight = float(np.max(np.abs(np.asarray(value) - base)))
    return "Jacobian of a 400-sample trace, 8 unknowns", mine, rival, f"error {gap:.1e}; trace {tight:.1e} from SciPy"


def study() -> tuple:
    """18 432 traces of a Sobol plan: 7 inputs, 2 048 rows, of the largest volume of a ring-down."""
    ranges = np.array([[0.05, 0.1], [0.8, 1.0], [1.15, 1.25], [3.0, 4.0], [0.9, 1.3], [0.15, 0.3], [3.0, 6.0]])
    rows = SOBOL // (len(ranges) + 2)
    draws = np.random.default_rng(0).uniform(*ranges.T, (SOBOL, len(ranges)))
    assert rows * (len(ranges) + 2) == SOBOL
    X = [jnp.asarray(column) for column in draws.T]

    @jax.jit
    def states(d, P0, P):
        return buckled_state(js.Reduced(d, P0, P, 0.02))

    def many():
        shells = js.Reduced(X[0], X[1], X[2], jnp.asarray(0.02), jnp.asarray(1.4), jnp.asarray(0.5))
        state = states(*X[:3])
        initial = jnp.zeros((4, SOBOL)).at[0].set(0.05)
        return ensemble.traces(shells, Coefficients(*X[3:7]), state, initial, jnp.asarray(TIMES[1]), 400).volume

    mine = seconds(many)
    found = np.asarray(many())
    gap, began = 0.0, time.perf_counter()
    state = states(*X[:3])
    for k in range(RIVAL_SOBOL):
        one = RestState(state.volume[k], state.pressure[k])
        shell = js.Reduced(draws[k, 0], draws[k, 1], draws[k, 2], 0.02)
        y = _linear_trace(shell, one, np.array([*draws[k, 3:7], 0.05, 0.0, 0.0, 0.0]))
        gap = max(gap, float(np.max(np.abs(y[:, 0] - found[:, k]))))
    rival = (time.perf_counter() - began) / RIVAL_SOBOL * SOBOL
    return "Sobol study, 18 432 traces of 400 samples", mine, rival, f"error {gap:.1e}"


def main() -> None:
    warnings.simplefilter("ignore", js.RangeWarning)
    print(f"cores: {len(os.sched_getaffinity(0))}; SciPy's figures are scaled from a part of the job\n")
    print("| job | jshell, warm [s] | SciPy [s] | ratio | check |")
    print("|---|---|---|---|---|")
    jobs = {"jacobian": jacobian, "study": study, "diagram": diagram, "fits": fits}
    for name in sys.argv[1:] or jobs:
        found = jobs[name]()
        for name, mine, rival, note in found if isinstance(found, list) else [found]:
            print(f"| {name} | {mine:.3g} | {rival:.3g} | {rival / mine:,.0f} | {note} |", flush=True)


if __name__ == "__main__":
    main()
