"""How fast batches of fits are, against the tools one would use otherwise: one core, one run.

Prints tables in Markdown. Without arguments all of them, else those named:

    .venv/bin/python benchmarks/fits.py exact diffrax pairs bootstrap first bad_row

Rivals of whole fits find their start as we do, by a matrix pencil and linear algebra, in NumPy and of one order; both
are timed with it, and rest states are given to them free of charge. Where a start is given free the table says so.
They are timed on fewer traces, the number is in the table. Times are CPU seconds of this process: on a shared
machine the clock on the wall tells how busy the others are.
"""

import os
import subprocess
import sys
import time
import warnings
from collections.abc import Callable

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # NumPy reads it too, for the rivals

import jax
import jax.numpy as jnp
import lmfit
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import curve_fit, least_squares

from jshell import Reduced
from jshell.calibration import Recordings, bootstrap_frequencies, fit_batch
from jshell.calibration.records import Record
from jshell.calibration.starts import ModePair, _amplitudes, find_modes, strict_start
from jshell.oscillator import Coefficients, matrices, random_shell, random_trace, squared_frequencies
from jshell.oscillator.linear import uniform_propagator
from jshell.shell.elasticity import SPHERE_AREA
from jshell.shell.rest import RestState, buckled_state
from jshell.signals import extract_batch
from jshell.signals.pencil import poles

warnings.simplefilter("ignore")
SAMPLES, DURATION = 400, 40.0
TIMES = np.linspace(0.0, DURATION, SAMPLES)
FIELDS = ("thickness", "gas_pressure", "outer_pressure", "viscosity", "kappa", "poisson_ratio")


@jax.jit
@jax.vmap
def _motion(conditions, truth, initial):
    reduced = Reduced(*conditions)
    state = buckled_state(reduced)
    constants = Coefficients.with_decay_time(*truth, reduced.viscosity)
    path = uniform_propagator(matrices(constants, state, reduced), DURATION / (SAMPLES - 1), SAMPLES) @ initial
    return path[:, :2].T + jnp.stack([state.volume, jnp.asarray(SPHERE_AREA)])[:, None]


def recordings(count: int, noise: float, memory: float = 0.0) -> tuple[Recordings, np.ndarray]:
    """Random shells and their true α1, α2, k_VS, τ: 200 conditions, every motion and noise its own."""
    shells = [random_shell(seed) for seed in range(200)]
    random = np.random.default_rng(0)
    which = random.integers(0, len(shells), count)
    conditions = np.array([[float(getattr(s.conditions, name)) for name in FIELDS] for s in shells])[which]
    truth = np.array(
        [[float(getattr(s.coefficients, k)) for k in ("alpha1", "alpha2", "k_vs")] + [s.tau] for s in shells]
    )[which]
    initial = np.array([s.initial for s in shells])[which] * random.uniform(0.5, 1.5, (count, 4))
    values = np.concatenate(
        [np.asarray(_motion(*(x[i : i + 500] for x in (conditions, truth, initial)))) for i in range(0, count, 500)]
    )
    e = random.standard_normal(values.shape)
    for k in range(1, SAMPLES if memory else 0):
        e[:, :, k] = memory * e[:, :, k - 1] + np.sqrt(1 - memory**2) * e[:, :, k]
    values += noise * values.std(axis=2, keepdims=True) * e
    return Recordings(TIMES, values, Reduced(*conditions.T)), truth


def best(job: Callable[[], object], repeats: int = 3) -> tuple[float, object]:
    """Seconds of the fastest warm call, and its answer."""
    answer, times = job(), []
    for _ in range(repeats):
        began = time.process_time()
        answer = job()
        times.append(time.process_time() - began)
    return min(times), answer


class Rival:
    """One record as SciPy or lmfit would fit it: α1, α2, k_VS, τ in logarithms, initial state, rest values."""

    def __init__(self, records: Recordings, found, row: int):
        self.V_e, P_e = found.rest[row]
        self.gas, self.wall = float(np.asarray(records.conditions.kappa)[row]) * P_e / self.V_e, 1 / (4 * np.pi)
        self.y = np.asarray(records.values[row])
        self.weight = 1 / np.sqrt(np.mean(np.diff(self.y, 6, axis=1) ** 2, axis=1) / 924)[:, None]
        conditions = Reduced(0.1, 1.0, 1.0, 1.0, float(np.asarray(records.conditions.kappa)[row]))
        self.record = Record(TIMES, self.y, self.y, conditions, RestState(self.V_e, P_e), ("V", "S"), True)
        modes, (a1, a2, k, _) = self.hear()
        tau = modes.tau
        at = modes.amplitudes.real.sum(axis=1)
        rate = (modes.amplitudes * modes.poles).real.sum(axis=1)
        self.start = np.array([np.log(a1), np.log(a2), k, np.log(tau), *at, *rate, *modes.offsets])

    def hear(self) -> tuple[ModePair, np.ndarray]:
        """Modes and constants as a start from nothing: a pencil of one order in NumPy, then linear algebra."""
        even = (self.y - self.y.mean(axis=1, keepdims=True)) / self.y.std(axis=1, keepdims=True)
        s = poles(even[:, ::2].T, 2 * TIMES[1], [4])[0]
        s = s[(s.imag > 0) & (s.real < 0)]
        if s.size != 2:
            modes = find_modes(TIMES, self.y)  # several orders, where four poles do not hold two modes
        else:
            s = s[np.argsort(np.abs(s))]
            amplitudes, offsets, left = _amplitudes(TIMES, self.y, s)
            modes = ModePair(s, amplitudes, offsets, float(np.sqrt(np.mean(left.var(axis=1) / self.y.var(axis=1)))))
        return modes, strict_start([self.record], [modes], {})

    def constants(self, p):
        m1, m2 = np.exp(p[0]) / (4 * np.pi), 2 * np.exp(p[1]) * self.V_e**2 / (9 * np.pi**3)
        return m1, m2, p[2] / self.V_e, np.exp(-p[3])

    def exact(self, p) -> np.ndarray:
        """Residual with the closed form of the motion."""
        m1, m2, c, rate = self.constants(p)
        root = np.sqrt([m1, m2])
        D = np.array([[self.gas / m1, c / np.sqrt(m1 * m2)], [c / np.sqrt(m1 * m2), self.wall / m2]])
        w2, vectors = np.linalg.eigh(D)
        turn = np.sqrt(np.maximum(w2 - rate**2, 1e-8))
        q, v = vectors.T @ (root * p[4:6]), vectors.T @ (root * p[6:8])
        angle = np.outer(turn, TIMES)
        modes = np.exp(-rate * TIMES) * (q[:, None] * np.cos(angle) + ((v + rate * q) / turn)[:, None] * np.sin(angle))
        return (self.weight * ((vectors @ modes) / root[:, None] + p[8:10, None] - self.y)).ravel()

    def integrated(self, p) -> np.ndarray:
        """Residual with an ODE solver."""
        m1, m2, c, rate = self.constants(p)
        A = np.zeros((4, 4))
        A[:2, 2:] = np.eye(2)
        A[2, :2], A[3, :2] = np.array([self.gas, c]) / -m1, np.array([c, self.wall]) / -m2
        A[2, 2] = A[3, 3] = -2 * rate
        path = solve_ivp(lambda t, y: A @ y, (0, DURATION), p[4:8], "DOP853", TIMES, rtol=1e-7, atol=1e-9)
        return (self.weight * (path.y[:2] + p[8:10, None] - self.y)).ravel()


def against(records, found, rows: int, fit, *, free: bool = False) -> tuple[float, float]:
    """Seconds per record of a rival, its own start included unless it is free, and the share that ended where we did.

    That is within a hundredth of a standard error of our constants.
    """
    ready = [Rival(records, found, row) for row in range(rows)] if free else []
    began = time.process_time()
    ends = [fit(ready[row] if free else Rival(records, found, row)) for row in range(rows)]
    spent = (time.process_time() - began) / rows
    ours = np.stack([np.log(found["alpha1"]), np.log(found["alpha2"]), found["k_vs"], np.log(found["tau"])], axis=1)
    errors = found.stderr[:rows, :4] / np.where([True, True, False, True], found.values[:rows, :4], 1.0)
    return spent, float(np.mean(np.all(np.abs(np.array(ends) - ours[:rows]) < 0.01 * errors, axis=1)))


def lmfitted(rival: Rival, residual) -> np.ndarray:
    parameters = lmfit.Parameters()
    for i, value in enumerate(rival.start):
        parameters.add(f"p{i}", value=value)
    fit = lmfit.minimize(lambda q: residual(np.array([q[f"p{i}"].value for i in range(10)])), parameters)
    return np.array([fit.params[f"p{i}"].value for i in range(4)])


def table(title: str, rows: list[tuple]) -> None:
    print(f"\n### {title}\n\n| tool | traces | per second | ours is faster by | right |\n|---|---|---|---|---|")
    ours = rows[0][2]
    for tool, count, spent, right in rows:
        print(f"| {tool} | {count} | {1 / spent:.4g} | {spent / ours:.4g} | {right} |", flush=True)


def right_share(found, truth: np.ndarray) -> str:
    """Share of rows that are ok with every constant within five standard errors of the truth."""
    z = np.abs(found.values[:, :4] - truth) / found.stderr[:, :4]
    good = found.ok & np.all(z < 5, axis=1)
    claimed = int(np.sum(found.ok & ~good))
    return f"{100 * good.mean():.2f}% (ok {100 * found.ok.mean():.2f}%, ok and wrong {claimed})"


def exact() -> None:
    """10 000 fits of V and S, exact motion."""
    records, truth = recordings(10_000, 0.01)
    spent, found = best(lambda: fit_batch(records))
    rows = [("fit_batch, start included", 10_000, spent / 10_000, right_share(found, truth))]
    lm = lambda rival: least_squares(rival.exact, rival.start, method="lm").x[:4]  # noqa: E731
    each, agree = against(records, found, 60, lm)
    rows.append(("SciPy least_squares, exact motion, NumPy pencil", 60, each, f"{100 * agree:.0f}% as ours"))
    each, agree = against(records, found, 60, lm, free=True)
    rows.append(("the same, start given free", 60, each, f"{100 * agree:.0f}% as ours"))
    each, agree = against(records, found, 30, lambda rival: lmfitted(rival, rival.exact))
    rows.append(("lmfit, exact motion, NumPy pencil", 30, each, f"{100 * agree:.0f}% as ours"))
    each, agree = against(records, found, 5, lambda rival: lmfitted(rival, rival.integrated))
    rows.append(("lmfit, solve_ivp DOP853, NumPy pencil", 5, each, f"{100 * agree:.0f}% as ours"))
    table("V and S, 400 samples, 1% noise, exact model", rows)


def autocorrelated_one(rival: Rival) -> np.ndarray:
    """As a careful user of SciPy: fitted as white, φ of each channel read off what is left, fitted again whitened."""
    white = least_squares(rival.exact, rival.start, method="lm").x
    left = rival.exact(white).reshape(2, -1)
    phi = np.sum(left[:, 1:] * left[:, :-1], axis=1, keepdims=True) / np.sum(left**2, axis=1, keepdims=True)

    def whitened(p):
        r = rival.exact(p).reshape(2, -1)
        return np.hstack([r[:, :1], (r[:, 1:] - phi * r[:, :-1]) / np.sqrt(1 - phi**2)]).ravel()

    return least_squares(whitened, white, method="lm").x[:4]


def autocorrelated() -> None:
    """The same with noise e_k = φ e_{k-1} + fresh: each φ is estimated, by all but the last rival."""
    for memory in (0.5, 0.9):
        records, truth = recordings(2_000, 0.01, memory)
        spent, found = best(lambda records=records: fit_batch(records))
        rows = [("fit_batch, start and φ included", 2_000, spent / 2_000, right_share(found, truth))]
        each, _ = against(records, found, 60, autocorrelated_one)
        rows.append(("SciPy least_squares twice, exact motion, φ by lag-1", 60, each, "–"))
        lm = lambda rival: least_squares(rival.exact, rival.start, method="lm").x[:4]  # noqa: E731
        each, _ = against(records, found, 60, lm)
        rows.append(("SciPy least_squares, exact motion, white noise (too narrow errors)", 60, each, "–"))
        table(f"V and S, 400 samples, 1% noise with φ = {memory:g}", rows)


def diffrax() -> None:
    """1 000 fits through diffrax."""
    records, truth = recordings(1_000, 0.01)
    spent, found = best(lambda: fit_batch(records, solver="diffrax"), 1)
    rows = [("fit_batch, diffrax", 1_000, spent / 1_000, right_share(found, truth))]
    lm = lambda rival: least_squares(rival.integrated, rival.start, method="lm").x[:4]  # noqa: E731
    each, agree = against(records, found, 6, lm)
    rows.append(("SciPy solve_ivp DOP853 + least_squares", 6, each, f"{100 * agree:.0f}% as ours"))
    table("V and S, 400 samples, 1% noise, integrated in time", rows)


def bad_row() -> None:
    """What one record that fails costs the others."""
    records, _ = recordings(10_000, 0.01)
    values = np.array(records.values)
    values[5_000] = np.random.default_rng(1).standard_normal(values[5_000].shape) + values[5_000].mean(
        axis=1, keepdims=True
    )
    spoiled = Recordings(records.times, values, records.conditions)
    clean_time, clean = best(lambda: fit_batch(records))
    bad_time, bad = best(lambda: fit_batch(spoiled))
    same = np.arange(10_000) != 5_000
    bits = all(
        np.array_equal(getattr(clean, name)[same], getattr(bad, name)[same], equal_nan=True)
        for name in ("values", "stderr", "outcome", "chi_square", "state")
    )
    print(
        "\n### One record of noise among 10 000\n\n"
        "| others bit-identical | cost | its outcome | ok |\n|---|---|---|---|"
    )
    print(f"| {bits} | {bad_time / clean_time:.3f} × | {bad.outcomes[5_000].word} | {bad.ok[5_000]} |")


def pairs() -> None:
    """10 000 records of two damped sinusoids."""
    random, count = np.random.default_rng(0), 10_000
    t = 0.1 * np.arange(SAMPLES)
    Omega = np.stack([random.uniform(0.6, 1.3, count), random.uniform(1.5, 3.0, count)], axis=1)
    tau, phase = random.uniform(5, 20, count), random.uniform(0, 2 * np.pi, (count, 2))
    amplitude = random.uniform(0.3, 1.0, (count, 2))
    waves = amplitude[:, :, None] * np.cos(Omega[:, :, None] * t + phase[:, :, None])
    values = 3 + np.exp(-t / tau[:, None]) * waves.sum(axis=1)
    values += 0.01 * values.std(axis=1, keepdims=True) * random.standard_normal(values.shape)
    spent, extracted = best(lambda: extract_batch(0.1, values))
    true = np.column_stack([np.hypot(Omega, 1 / tau[:, None]), tau])
    close = np.abs(np.column_stack([extracted.omega, extracted.tau]) - true) < 5 * extracted.stderr
    rows = [("extract_batch, pencil included", count, spent / count, f"{100 * np.mean(close.all(axis=1)):.2f}%")]

    def model(t, offset, W1, W2, rate, c1, s1, c2, s2):
        decay = np.exp(-rate * t)
        first = c1 * np.cos(W1 * t) + s1 * np.sin(W1 * t)
        return offset + decay * (first + c2 * np.cos(W2 * t) + s2 * np.sin(W2 * t))

    def start(row):  # the pencil's, found beforehand
        modes = find_modes(t, values[row][None])
        c, s = modes.amplitudes[0].real, -modes.amplitudes[0].imag
        return np.array([modes.offsets[0], *modes.poles.imag, 1 / modes.tau, c[0], s[0], c[1], s[1]])

    def rival(tool: str, number: int, fit) -> None:
        begun = [start(row) for row in range(number)]
        began = time.process_time()
        ends = np.array([fit(values[row], begun[row]) for row in range(number)])
        each = (time.process_time() - began) / number
        ours = np.sqrt(extracted.omega[:number] ** 2 - 1 / extracted.tau[:number, None] ** 2)
        same = np.all(np.abs(np.sort(ends[:, 1:3], axis=1) - ours) < 0.01 * extracted.stderr[:number, :2], axis=1)
        rows.append((tool, number, each, f"{100 * np.mean(same):.0f}% as ours"))

    rival("curve_fit, start given", 200, lambda y, p: curve_fit(model, t, y, p)[0])
    rival("lmfit, start given", 60, lambda y, p: _lmfit_model(model, t, y, p))
    table("Two damped sinusoids, 400 samples, 1% noise", rows)


def _lmfit_model(model, t, y, p) -> np.ndarray:
    tool = lmfit.Model(model)
    fit = tool.fit(y, t=t, **dict(zip(tool.param_names, p, strict=True)))
    return np.array([fit.params[name].value for name in tool.param_names])


def bootstrap() -> None:
    """10 000 resamples of a master curve of 17 shells."""
    random, shells = np.random.default_rng(0), 17
    V, P = random.uniform(2, 3.6, shells), random.uniform(0.5, 3, shells)
    omega = np.array(
        [np.sqrt(np.asarray(squared_frequencies(v, p, 3.6, 1.1, 0.23))) for v, p in zip(V, P, strict=True)]
    )
    omega *= 1 + 0.03 * random.standard_normal((shells, 2))
    columns = {"V_e": V, "P_e": P, "omega_minus": omega[:, 0], "omega_plus": omega[:, 1]}
    spent, found = best(lambda: bootstrap_frequencies(columns, resamples=10_000))
    drawn = np.random.default_rng(0).integers(0, shells, (10_000, shells))

    def model(x, alpha1, alpha2, k2):
        V, P = x
        a, b = 4 * np.pi * 1.4 * P / (alpha1 * V), 9 * np.pi**2 / (8 * alpha2 * V**2)
        c = 18 * np.pi**4 * k2 / (alpha1 * alpha2 * V**4)
        fast = (a + b) / 2 + np.sqrt(((a - b) / 2) ** 2 + c)
        return np.concatenate([V * np.sqrt(np.maximum((a * b - c) / fast, 1e-9)), V * np.sqrt(fast)])

    first = [found.whole["alpha1"].value, found.whole["alpha2"].value, found.whole["k_vs"].value ** 2]
    number = 500
    began = time.process_time()
    ends = np.array(
        [
            curve_fit(model, (V[d], P[d]), np.concatenate([V[d] * omega[d, 0], V[d] * omega[d, 1]]), first)[0]
            for d in drawn[:number]
        ]
    )
    each = (time.process_time() - began) / number
    same = np.mean(np.all(np.abs(ends[:, :2] / found.values[:number, :2] - 1) < 1e-4, axis=1))
    ended = np.mean(np.isfinite(found.values[:, 0]))
    rows = [("bootstrap_frequencies", 10_000, spent / 10_000, f"{100 * ended:.2f}% ended")]
    rows.append(("curve_fit, start given", number, each, f"{100 * same:.0f}% as ours"))
    table("Master curve of 17 shells, bootstrap", rows)


FIRST = """
import time; began = time.perf_counter()
import warnings, numpy as np
warnings.simplefilter("ignore")
import jshell
from jshell.trace import Trace
data = np.load({path!r})
trace = Trace(data["t"], {{"V": data["V"], "S": data["S"]}}, jshell.Reduced(*data["c"]))
found = jshell.calibration.fit_trajectories(trace)
spent = time.perf_counter() - began
peak = next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM"))  # kB
print(spent, time.process_time(), peak / 1e6, found.outcome.word)
"""


def first() -> None:
    """The first fit of one trace in a fresh process, imports included."""
    from tempfile import TemporaryDirectory

    shell = random_shell(3)
    trace = random_trace(shell, 3)
    print("\n### First fit of one trace, fresh process\n")
    print("| cache | wall [s] | CPU [s] | memory [GB] | outcome |\n|---|---|---|---|---|")
    with TemporaryDirectory() as folder:
        path = f"{folder}/trace.npz"
        numbers = [float(getattr(shell.conditions, name)) for name in FIELDS]
        np.savez(path, t=trace.times, V=trace["V"], S=trace["S"], c=numbers)
        setting = {"JAX_COMPILATION_CACHE_DIR": f"{folder}/cache", "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}
        for name in ("empty", "filled"):
            environment = {**os.environ, **setting, "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1"}
            command = [sys.executable, "-c", FIRST.format(path=path)]
            out = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.split()
            print(
                f"| {name} | {float(out[0]):.2f} | {float(out[1]):.2f} | {float(out[2]):.2f} | {out[3]} |", flush=True
            )


JOBS = {
    "exact": exact,
    "autocorrelated": autocorrelated,
    "diffrax": diffrax,
    "pairs": pairs,
    "bootstrap": bootstrap,
    "first": first,
    "bad_row": bad_row,
}


def main() -> None:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    chosen = sys.argv[1:] or list(JOBS)
    print(f"cores: {len(os.sched_getaffinity(0))}")
    for name in chosen:
        JOBS[name]()


if __name__ == "__main__":
    main()
