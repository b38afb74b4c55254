"""Small fits whose numbers must not move: what is fitted, and how a result is written down.

`python tests/calibration/golden/make.py` writes the records anew; a change of
them belongs into the commit that says why.
"""

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from jshell.calibration import (
    FitResult,
    Prior,
    bootstrap_frequencies,
    fit_batch,
    fit_conditions,
    fit_frequencies,
    fit_nonlinear,
    fit_trajectories,
    long_records,
)
from jshell.oscillator import add_noise, drive, random_shell, random_trace
from jshell.trace import Trace

HERE = Path(__file__).parent
SAMPLES = 200


def record(seed: int = 3, samples: int = SAMPLES, **options: Any) -> Trace:
    """V and S of a random shell."""
    return random_trace(random_shell(seed), seed, samples=samples, **options)


def coloured(seed: int = 3) -> Trace:
    """The same with noise whose samples know of each other."""
    clean = record(seed, noise=0.0)
    random = np.random.default_rng(seed)
    channels = {}
    for name, values in clean.channels.items():
        e, fresh = np.zeros(SAMPLES), random.standard_normal(SAMPLES)
        for k in range(1, SAMPLES):
            e[k] = 0.8 * e[k - 1] + fresh[k]
        channels[name] = np.asarray(values) + 0.01 * np.std(np.asarray(values)) * e
    return Trace(np.asarray(clean.times), channels, clean.conditions)


def changed(trace: Trace, keep: np.ndarray | None = None, lost: tuple[int, ...] = (), **given: Any) -> Trace:
    """A trace of some of the samples, some of them missing, with σ where it is given."""
    keep = np.arange(np.size(trace.times)) if keep is None else keep
    channels = {name: np.array(values, dtype=float)[keep] for name, values in trace.channels.items()}
    for name in channels:
        channels[name][list(lost)] = np.nan
    return Trace(np.asarray(trace.times)[keep], channels, trace.conditions, **given)


def spoiled() -> Trace:
    """The record with some samples far off."""
    random = np.random.default_rng(0)
    trace = changed(record())
    trace.channels["V"][random.choice(SAMPLES, 10, replace=False)] += 0.5 * np.std(trace.channels["V"])
    return trace


def uneven() -> Trace:
    """The record with holes in its grid."""
    return changed(record(), keep=np.delete(np.arange(SAMPLES), [50, 51, 120, 160]))


def with_sigma() -> Trace:
    """The record with the size of its noise."""
    trace = record()
    return changed(
        trace, sigma={name: np.full(SAMPLES, 0.01 * np.std(values)) for name, values in trace.channels.items()}
    )


def four() -> Trace:
    """A record of V, S, H and W; H and W are made of V and S."""
    trace = record()
    V, S = (np.asarray(trace[name], dtype=float) for name in ("V", "S"))
    return Trace(
        np.asarray(trace.times), {"V": V, "S": S, "H": 0.3 * V + 0.02 * S, "W": 0.1 * V + 0.1 * S}, trace.conditions
    )


def pair() -> list[Trace]:
    """Two records of one shell."""
    shell = random_shell(3)
    return [random_trace(shell, seed, samples=SAMPLES) for seed in (3, 5)]


def shells() -> list[Trace]:
    """Records of two shells."""
    return [record(3), record(25)]


PLATEAU = {"equilibrium": "plateau"}
TRACE = {"equilibrium": "trace"}
MODAL = {"loss": "modal", "fix": {"alpha2": 1.1}}

# name: traces, options; those of FAST run with every test
FITS: dict[str, tuple[Callable[[], Any], dict[str, Any]]] = {
    "strict_plain": (record, {}),
    "strict_sigma": (with_sigma, {}),
    "strict_pair": (pair, {}),
    "strict_fixed_bounded": (record, {"fix": {"alpha2": 1.0}, "bounds": {"alpha1": (0.5, 20.0), "k_vs": (-1.0, 1.0)}}),
    "strict_at_bound": (record, {"bounds": {"alpha1": (0.1, 1.0)}}),
    "strict_beta2_free": (record, {"beta2": "free"}),
    "strict_printed": (record, {"dipole": "printed"}),
    "strict_white": (record, {"noise": "white"}),
    "strict_trace": (record, TRACE),
    "strict_diffrax": (record, {"solver": "diffrax", "starts": 0}),
    "strict_tie": (record, {"tie": {"alpha2": "0.2*alpha1"}}),
    "strict_tie_chain": (record, {"tie": {"alpha2": "0.2*alpha1", "beta1": "2*alpha2"}}),
    "strict_local": (pair, {"local": ("beta1",)}),
    "strict_local_two": (shells, {"local": ("alpha1", "beta1"), **TRACE}),
    "strict_local_tie": (pair, {"local": ("beta1",), "tie": {"beta1[2]": "beta1[1]"}}),
    "strict_robust_huber": (spoiled, {"robust": "huber"}),
    "strict_robust_cauchy": (spoiled, {"robust": "cauchy"}),
    "strict_uncertain": (record, {"uncertain": {"gas_pressure": 0.02}, **TRACE}),
    "strict_uncertain_two": (record, {"uncertain": {"thickness": 0.02, "viscosity": 0.1}}),
    "strict_prior": (record, {"priors": {"beta1": Prior(1.0, 0.2)}}),
    "strict_noise": (coloured, {}),
    "strict_noise_white": (coloured, {"noise": "white"}),
    "strict_noise_local": (lambda: [coloured(), record()], {"local": ("beta1",)}),
    "strict_uneven": (uneven, {}),
    "strict_missing": (lambda: changed(record(), lost=(3, 4, 77)), {"missing": "drop"}),
    "strict_window": (record, {"start": 4.0, "stop": 30.0, "drop": [(10.0, 11.0)]}),
    "strict_odd": (lambda: record(samples=301), {}),
    "modal_plain": (record, {"loss": "modal"}),
    "modal_fixed": (record, MODAL),
    "modal_one_channel": (record, {"channels": ("V",), "fix": {"k_vs": 0.2}}),
    "modal_four": (four, {"fix": {"alpha2": 1.1}}),
    "modal_sigma": (with_sigma, MODAL),
    "modal_shells": (shells, {"loss": "modal", **TRACE}),
    "modal_bounds": (record, MODAL | {"bounds": {"k_vs": (0.05, 0.4), "alpha1": (0.5, 20.0)}}),
    "modal_local": (shells, {"loss": "modal", "fix": {"alpha2": 1.1}, "local": ("alpha1",), **TRACE}),
    "modal_local_k_vs": (shells, {"loss": "modal", "fix": {"alpha2": 1.1}, "local": ("k_vs",), **TRACE}),
    "modal_robust_huber": (spoiled, MODAL | {"robust": "huber"}),
    "modal_robust_cauchy": (spoiled, MODAL | {"robust": "cauchy"}),
    "modal_uncertain": (record, MODAL | {"uncertain": {"gas_pressure": 0.02}}),
    "modal_prior": (record, {"loss": "modal", "priors": {"k_vs": Prior(0.2, 0.05)}}),
    "modal_noise": (coloured, MODAL),
    "modal_uneven": (uneven, MODAL),
    "modal_missing": (lambda: changed(record(), lost=(3, 4, 77)), MODAL | {"missing": "drop"}),
}
FAST = (
    "strict_plain", "strict_tie", "strict_noise", "strict_missing", "strict_robust_huber", "modal_fixed", "modal_noise",
    "modal_local_k_vs",
)  # fmt: skip
# saved by the first version; never written anew
SAVED = ("strict_tie", "strict_local", "strict_noise", "modal_four", "modal_uncertain", "strict_robust_huber")
TABLE = {
    "V_e": np.array([2.4, 2.7, 3.0, 2.9, 3.1]),
    "P_e": np.array([0.3, 0.6, 1.1, 2.0, 1.4]),
    "omega_minus": np.array([0.71, 0.86, np.nan, 1.21, 0.92]),
    "omega_plus": np.array([1.52, 1.44, 1.49, 1.71, 1.55]),
}


def fit(name: str) -> FitResult:
    """One of `FITS`."""
    build, options = FITS[name]
    return quietly(lambda: fit_trajectories(build(), **options))


def long_fit(loss: str) -> FitResult:
    """A fit by blocks, of a record that counts as long."""
    kept = long_records.LONG, long_records.BLOCK, long_records.THINNED
    long_records.LONG, long_records.BLOCK, long_records.THINNED = 100, 200, 100
    try:
        fixed = {"alpha2": 1.1} if loss == "modal" else None
        return quietly(lambda: fit_trajectories(record(4, samples=500), loss, fix=fixed))
    finally:
        long_records.LONG, long_records.BLOCK, long_records.THINNED = kept


def _driven(seed: int) -> Trace:
    s = random_shell(seed)
    times = np.linspace(0.0, 30.0, 200)
    run = drive(s.conditions, s.coefficients, times=times, initial=tuple(s.initial), equilibrium=s.state, budget=False)
    return add_noise(Trace(times, {"V": run.motion.V, "S": run.motion.S}, s.conditions), 0.01, seed)


def _batch(**options: Any) -> dict:
    kind = options.pop("kind", "even")
    traces = [record(seed, samples=150) for seed in range(4)]
    if kind == "mixed":
        traces[1] = changed(traces[1], lost=(5, 6))
        traces[2] = changed(traces[2], keep=np.delete(np.arange(150), [30, 80]))
        random = np.random.default_rng(1)
        noise = {name: random.standard_normal(150) for name in ("V", "S")}
        traces.append(Trace(np.asarray(traces[0].times), noise, traces[0].conditions))
    found = quietly(lambda: fit_batch(traces, **options))
    return {name: values.tolist() for name, values in found.columns().items()} | {
        "covariance": found.covariance,
        "start": found.start,
        "free": [list(one) for one in found.free_directions],
    }


def _frequencies(**options: Any) -> dict:
    return written(quietly(lambda: fit_frequencies(TABLE, **options)))


def _bootstrapped() -> dict:
    found = quietly(lambda: bootstrap_frequencies(TABLE, resamples=100, seed=1))
    return {"values": found.values, "outcome": found.outcome}


def _nonlinear() -> dict:
    found = quietly(lambda: fit_nonlinear([_driven(seed) for seed in range(2)]))
    return {
        "constants": found.constants,
        "stderr": found.stderr,
        "chi_square": found.chi_square,
        "outcome": [one.word for one in found.outcome],
    }


def _around(what: str) -> dict:
    found = fit("strict_plain")
    if what == "profile":
        return found.profile(("alpha1", "k_vs")).record()
    return found.bootstrap(32, seed=1).record()


def _conditions() -> dict:
    shell = random_shell(3)
    return written(quietly(lambda: fit_conditions(record(), shell.coefficients, ("gas_pressure",))))


OTHERS: dict[str, Callable[[], dict]] = {
    "long_strict": lambda: written(long_fit("strict")),
    "long_modal": lambda: written(long_fit("modal")),
    "conditions": _conditions,
    "frequencies": _frequencies,
    "frequencies_squared": lambda: _frequencies(weighting="V_e^2 omega^2", fix={"alpha2": 1.1}),
    "frequencies_bounds": lambda: _frequencies(bounds={"k_vs": (0.05, 0.5)}),
    "bootstrap_frequencies": _bootstrapped,
    "batch_even": _batch,
    "batch_mixed_retried": lambda: _batch(kind="mixed", starts=2),
    "batch_bounds": lambda: _batch(bounds={"k_vs": (-0.1, 0.3)}, equilibrium="trace"),
    "nonlinear": _nonlinear,
    "profile": lambda: _around("profile"),
    "bootstrap": lambda: _around("bootstrap"),
}
FAST_OTHERS = ("frequencies", "frequencies_bounds", "profile")


def quietly(run: Callable[[], Any]) -> Any:
    """A result without what is said beside it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return run()


def written(found: FitResult) -> dict:
    """All of a fit that must stay."""
    return found.record() | {
        "residual": np.asarray(found.residual)[:: max(1, found.residual.size // 20)],
        "channels": list(found.specification.channels or ()) if found.specification is not None else [],
        "loss": None if found.specification is None else found.specification.loss,
    }


def golden(name: str) -> dict:
    """The record of one case, computed now."""
    return written(fit(name)) if name in FITS else OTHERS[name]()
