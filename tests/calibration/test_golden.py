"""Fits that must go on giving the numbers that they gave, and files that must go on being read."""

import importlib.util
import json
import math
import sys
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest

import jshell as js
from jshell import programs
from jshell.io.records import plain

GOLDEN = Path(__file__).parent / "golden"
spec = importlib.util.spec_from_file_location("golden_cases", GOLDEN / "cases.py")
assert spec is not None
assert spec.loader is not None
cases = importlib.util.module_from_spec(spec)
sys.modules["golden_cases"] = cases
spec.loader.exec_module(cases)
QUICK = (*cases.FAST, *cases.FAST_OTHERS)
AT_ONCE = ("strict_plain", "strict_missing", "frequencies_bounds")
MARK = {name: pytest.mark.long if name in QUICK else pytest.mark.slow for name in (*cases.FITS, *cases.OTHERS)}
NAMES = [name if name in AT_ONCE else pytest.param(name, marks=mark) for name, mark in MARK.items()]


def differences(old: Any, new: Any, place: str = "") -> list[str]:
    """Where two records differ; numbers by more than 1e-12, which the order of a sum may cost."""
    if isinstance(old, dict) and isinstance(new, dict):
        found = [f"{place}: keys {sorted(set(old) ^ set(new))}"] if set(old) != set(new) else []
        return found + [
            line for key in old.keys() & new.keys() for line in differences(old[key], new[key], f"{place}/{key}")
        ]
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        return [
            line for i, pair in enumerate(zip(old, new, strict=True)) for line in differences(*pair, f"{place}/{i}")
        ]
    if isinstance(old, float) and isinstance(new, float):
        return [] if math.isclose(old, new, rel_tol=1e-12, abs_tol=1e-12) else [f"{place}: {old!r}, now {new!r}"]
    return [] if old == new else [f"{place}: {old!r}, now {new!r}"]


# another kind of processor rounds otherwise, and a search may end a step earlier
HERE_AS_THERE = programs.processor() == (GOLDEN / "processor.txt").read_text(encoding="utf-8").strip()


@pytest.mark.skipif(not HERE_AS_THERE, reason="the records were made on another kind of processor")
@pytest.mark.parametrize("name", NAMES)
def test_a_fit_gives_the_numbers_that_it_gave(name):
    old = json.loads((GOLDEN / "records" / f"{name}.json").read_text(encoding="utf-8"))
    new = json.loads(json.dumps(plain(cases.golden(name))))
    assert differences(old, new) == []


@pytest.mark.parametrize("name", cases.SAVED)
def test_a_file_that_was_saved_is_read(name):
    read = js.load(GOLDEN / "saved" / f"{name}.json")
    old = json.loads((GOLDEN / "saved" / f"{name}.record.json").read_text(encoding="utf-8"))  # of the day it was saved
    new = json.loads(json.dumps(plain(cases.written(read))))
    assert differences(old, new) == []


# strict_tie was saved when a motion that the model lacks was still taken for noise: it minimised something else
@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in cases.SAVED if name != "strict_tie"])
def test_a_read_fit_minimises_what_the_fresh_one_did(name):
    """Ties, local constants, autocorrelated noise, uncertain conditions, robust weights: all of the problem is back."""
    fresh, read = cases.fit(name).objective(), js.load(GOLDEN / "saved" / f"{name}.json").objective()
    assert read.names == fresh.names
    assert (read.count, read.linear, read.priors, read.loss) == (fresh.count, fresh.linear, fresh.priors, fresh.loss)
    # the weights of a robust loss settle to 1e-9 of the unknowns, and follow the residual
    rtol = 1e-5 if fresh.loss else 1e-9
    for old, new in zip(jax.tree.leaves(fresh.args), jax.tree.leaves(read.args), strict=True):
        np.testing.assert_allclose(np.asarray(new), np.asarray(old), rtol=rtol, atol=1e-12)
    chi_square = [float(np.sum(one.linearised[0] ** 2)) for one in (fresh, read)]
    assert chi_square[1] == pytest.approx(chi_square[0], rel=rtol)
