"""Every option with every loss, solver and door: a table in which each pair of choices occurs, and works.

Pairs that are refused are listed, with the words of the refusal; they are tested by themselves. All others occur
together in some row of the table, which must end with an answer, whatever else is chosen in that row.
"""

import itertools
import random
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from typer.testing import CliRunner

from jshell import io
from jshell.calibration import Prior, fit_batch, fit_trajectories
from jshell.calibration.option_texts import FORMS
from jshell.cli.main import app
from jshell.cli.options import flag
from jshell.errors import JshellError
from jshell.oscillator import random_shell, random_trace
from jshell.service import batches, tasks
from jshell.service.schemas import BatchOptions, FitRequest
from jshell.trace import Trace

Case = dict[str, Any]
Pair = frozenset[tuple[str, Any]]

# names of choices, and what they are; `None` leaves the option out
FITS: dict[str, tuple[str | None, ...]] = {
    "door": ("python", "terminal", "request"),
    "traces": ("one", "two"),
    "loss": (None, "strict", "modal"),
    "solver": (None, "diffrax"),
    "equilibrium": (None, "trace"),
    "fix": (None, "alpha2"),
    "bounds": (None, "alpha1"),
    "tie": (None, "k_vs"),
    "local": (None, "alpha1"),
    "uncertain": (None, "thickness"),
    "priors": (None, "alpha1"),
    "robust": (None, "huber", "cauchy"),
    "noise": (None, "white"),
    "channels": (None, "V S", "H W"),
    "start": (None, "late"),
    "stop": (None, "early"),
    "drop": (None, "span"),
    "missing": (None, "drop"),
    "beta2": (None, "free"),
    "dipole": (None, "printed"),
    "starts": (None, "1"),
}
BATCHES: dict[str, tuple[str | None, ...]] = {
    "door": ("python", "request"),
    "loss": (None, "strict", "modal"),
    "solver": (None, "diffrax"),
    "equilibrium": (None, "trace"),
    "fix": (None, "alpha2"),
    "bounds": (None, "alpha1"),
    "noise": (None, "white"),
    "channels": (None, "V S", "H W"),
    "starts": (None, "1"),
}
VALUES: dict[tuple[str, str], tuple[Any, str]] = {  # in Python, and in the terminal
    ("fix", "alpha2"): ({"alpha2": 1.4}, "alpha2=1.4"),
    ("bounds", "alpha1"): ({"alpha1": (0.2, 40.0)}, "alpha1=0.2:40"),
    ("tie", "k_vs"): ({"k_vs": "0.1*alpha1"}, "k_vs=0.1*alpha1"),
    ("local", "alpha1"): (("alpha1",), "alpha1"),
    ("uncertain", "thickness"): ({"thickness": 0.05}, "thickness=0.05"),
    ("priors", "alpha1"): ({"alpha1": Prior(4.0, 1.0)}, "alpha1=4:1"),
    ("channels", "V S"): (("V", "S"), ""),
    ("channels", "H W"): (("H", "W"), ""),
    ("start", "late"): (1.0, "1.0"),
    ("stop", "early"): (29.0, "29.0"),
    ("drop", "span"): (((5.0, 6.0),), "5:6"),
    ("starts", "1"): (1, "1"),
}
BOTH: dict[Pair, str] = {
    frozenset({("loss", "modal"), ("solver", "diffrax")}): "integrates nothing",
    frozenset({("loss", "strict"), ("channels", "H W")}): "own coordinates",
    frozenset({("solver", "diffrax"), ("channels", "H W")}): "integrates nothing",
    frozenset({("equilibrium", "trace"), ("channels", "H W")}): "no channel V",
}
FIT_REFUSED = BOTH | {  # where no loss is said, these records of four channels take the modal one
    frozenset({("loss", None), ("solver", "diffrax")}): "integrates nothing",
    frozenset({("loss", None), ("beta2", "free")}): "one decay time per trace",
    frozenset({("loss", "modal"), ("beta2", "free")}): "one decay time per trace",
    frozenset({("beta2", "free"), ("channels", "H W")}): "one decay time per trace",
}
BATCH_REFUSED = BOTH | {
    frozenset({("loss", "modal"), ("bounds", "alpha1")}): "leave the three open",
    frozenset({("bounds", "alpha1"), ("channels", "H W")}): "leave the three open",
}
SEEDS = (0, 1)


def pairs_of(case: Case) -> set[Pair]:
    return {frozenset(two) for two in itertools.combinations(case.items(), 2)}


def table(factors: dict[str, tuple], refused: dict[Pair, str]) -> list[Case]:
    """Rows in which every allowed pair of choices occurs: greedily, the best of some drawn at random."""
    draw, rows = random.Random(0), []
    everything = {
        frozenset({(a, x), (b, y)})
        for a, b in itertools.combinations(factors, 2)
        for x in factors[a]
        for y in factors[b]
    }
    left = everything - set(refused)
    while left:
        ordered = sorted(left, key=lambda pair: str(sorted(map(str, pair))))
        candidates = [row for _ in range(12) if (row := _row(factors, left, refused, draw.choice(ordered), draw))]
        best = max(candidates, key=lambda row: len(pairs_of(row) & left))
        rows.append(best)
        left -= pairs_of(best)
    return rows


def _row(
    factors: dict[str, tuple], left: set[Pair], refused: dict[Pair, str], first: Pair, draw: random.Random
) -> Case | None:
    row: Case = dict(sorted(first, key=str))
    for name in draw.sample(list(factors), len(factors)):
        if name in row:
            continue
        free = [x for x in factors[name] if not any(frozenset({(name, x), one}) in refused for one in row.items())]
        if not free:
            return None
        gain = lambda x, name=name: sum(frozenset({(name, x), one}) in left for one in row.items())  # noqa: E731
        most = max(map(gain, free))
        row[name] = draw.choice([x for x in free if gain(x) == most])
    return {name: row[name] for name in factors}


def words(case: Case) -> str:
    return " ".join(f"{name}={choice}" for name, choice in case.items() if choice is not None)


@pytest.fixture(scope="module")
def records(tmp_path_factory) -> list[tuple[Trace, Any]]:
    """Two short records of two shells with the same constants, and files of them."""
    folder, found = tmp_path_factory.mktemp("pairs"), []
    for seed in SEEDS:
        whole = random_trace(random_shell(seed), seed)
        V, S = (np.asarray(whole[name])[:300:2] for name in ("V", "S"))
        channels = {"V": V, "S": S, "H": 1.2 + 0.3 * (V - V.mean()) + 0.1 * (S - S.mean())}
        channels["W"] = 2.1 - 0.05 * (V - V.mean()) + 0.2 * (S - S.mean())
        trace = Trace(np.asarray(whole.times)[:300:2], channels, whole.conditions)
        io.write_trace(folder / f"{seed}.csv", trace)
        found.append((trace, folder / f"{seed}.csv"))
    return found


def python_options(case: Case) -> dict[str, Any]:
    given = {name: VALUES.get((name, x), (x, ""))[0] for name, x in case.items() if x is not None}
    return {"starts": 0} | {name: value for name, value in given.items() if name not in ("door", "traces")}


def wire_options(case: Case) -> dict[str, Any]:
    plain = lambda x: {"mean": x.mean, "sigma": x.sigma} if isinstance(x, Prior) else x  # noqa: E731
    return {
        name: {k: plain(x) for k, x in value.items()} if isinstance(value, dict) else value
        for name, value in python_options(case).items()
    }


def terminal_words(case: Case) -> Iterator[str]:
    yield from ("--starts", case.get("starts") or "0")
    for name, choice in case.items():
        if choice is None or name in ("door", "traces", "starts"):
            continue
        texts = choice.split() if name == "channels" else [VALUES.get((name, choice), ("", choice))[1]]
        assert name in FORMS or len(texts) == 1
        for text in texts:
            yield from (flag(name), text)


def fit(case: Case, records) -> str:
    """The row by its door: how it ended, or the words of a refusal."""
    used = records[: 2 if case.get("traces") == "two" else 1]
    if case.get("door", "python") == "python":
        try:
            found = fit_trajectories([trace for trace, _ in used], **python_options(case))
        except JshellError as error:
            return f"refused: {error}"
        assert found.report()
        return found.outcome.word
    if case["door"] == "terminal":
        result = CliRunner().invoke(app, ["fit", *(str(path) for _, path in used), *terminal_words(case)])
        assert result.exit_code in (0, 2, 3), (result.output, result.exception)
        assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
        return f"refused: {result.output}" if result.exit_code == 2 else result.output
    try:
        asked = FitRequest(traces=["0" * 8], **wire_options(case)).model_dump(exclude={"traces"})
    except ValidationError as error:
        return f"refused: {error}"
    return _answer(tasks.run("fit", asked | {"netcdf": False}, [(path.name, path.read_bytes()) for _, path in used]))


def batch(case: Case, records) -> str:
    if case.get("door", "python") == "python":
        try:
            found = fit_batch([trace for trace, _ in records], **python_options(case))
        except JshellError as error:
            return f"refused: {error}"
        return " ".join(one.word for one in found.outcomes)
    try:
        asked = BatchOptions(**wire_options(case)).model_dump()
    except ValidationError as error:
        return f"refused: {error}"
    answer = tasks.run("batch", asked, [(path.name, path.read_bytes()) for _, path in records])
    if answer.error is None and answer.fault is None:
        return " ".join(one.word for one in batches.unpack_result(answer.files["record.npz"]).outcomes)
    return _answer(answer)


def _answer(answer: tasks.TaskResult) -> str:
    assert answer.fault is None, answer.fault
    return "done" if answer.error is None else f"refused: {answer.error}"


FIT_ROWS, BATCH_ROWS = table(FITS, FIT_REFUSED), table(BATCHES, BATCH_REFUSED)


def test_the_table_holds_every_pair_that_is_not_refused():
    for factors, rows, refused in ((FITS, FIT_ROWS, FIT_REFUSED), (BATCHES, BATCH_ROWS, BATCH_REFUSED)):
        seen = set().union(*map(pairs_of, rows))
        assert not seen & set(refused)
        for a, b in itertools.combinations(factors, 2):
            for x, y in itertools.product(factors[a], factors[b]):
                assert frozenset({(a, x), (b, y)}) in seen | set(refused)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jshell.calibration.FitWarning", "ignore::jshell.errors.RangeWarning")
@pytest.mark.parametrize("case", FIT_ROWS, ids=words)
def test_every_pair_of_options_of_a_fit_works(case, records):
    assert not fit(case, records).startswith("refused")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jshell.calibration.FitWarning", "ignore::jshell.errors.RangeWarning")
@pytest.mark.parametrize("case", BATCH_ROWS, ids=words)
def test_every_pair_of_options_of_a_batch_works(case, records):
    assert not batch(case, records).startswith("refused")


@pytest.mark.parametrize("pair", FIT_REFUSED, ids=lambda pair: words(dict(sorted(pair))))
@pytest.mark.parametrize("door", FITS["door"])
def test_other_pairs_of_a_fit_are_refused_with_a_reason(pair, door, records):
    told = fit({"door": door} | dict(pair), records)
    assert told.startswith("refused")
    assert FIT_REFUSED[pair] in " ".join(told.split())


@pytest.mark.parametrize("pair", BATCH_REFUSED, ids=lambda pair: words(dict(sorted(pair))))
@pytest.mark.parametrize("door", BATCHES["door"])
def test_other_pairs_of_a_batch_are_refused_with_a_reason(pair, door, records):
    told = batch({"door": door} | dict(pair), records)
    assert told.startswith("refused")
    assert BATCH_REFUSED[pair] in " ".join(told.split())
