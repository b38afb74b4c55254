"""What others build upon only gains: public names, and the API as it describes itself."""

import importlib
import importlib.util
import json
from pathlib import Path
from typing import Any

import pytest

LOCKS = Path(__file__).parent / "locks"
spec = importlib.util.spec_from_file_location("locks_make", LOCKS / "make.py")
assert spec is not None
assert spec.loader is not None
make = importlib.util.module_from_spec(spec)
spec.loader.exec_module(make)


def losses(old: Any, new: Any, place: str = "") -> list[str]:
    """What an older page has and a newer one lacks or says otherwise; `required` may not even gain."""
    if isinstance(old, dict) and isinstance(new, dict):
        gone = [f"{place}/{key}: gone" for key in old if key not in new]
        return gone + [line for key in old if key in new for line in losses(old[key], new[key], f"{place}/{key}")]
    if isinstance(old, list) and isinstance(new, list) and not place.endswith("/required"):
        return [f"{place}: {one!r} gone" for one in old if not any(losses(one, other, place) == [] for other in new)]
    if isinstance(old, list) and isinstance(new, list):
        return [] if sorted(old) == sorted(new) else [f"{place}: {old}, now {new}"]
    return [] if old == new else [f"{place}: {old!r}, now {new!r}"]


def test_a_public_name_that_goes_answers_for_one_release():
    old, new = json.loads((LOCKS / "names.json").read_text(encoding="utf-8")), make.names()
    for room, found in old.items():
        for name in set(found) - set(new.get(room, ())):
            with pytest.warns(DeprecationWarning, match=f"{room}.{name} is now "):
                getattr(importlib.import_module(room), name)


def test_the_api_only_gains():
    assert losses(json.loads((LOCKS / "openapi.json").read_text(encoding="utf-8")), make.openapi()) == []
