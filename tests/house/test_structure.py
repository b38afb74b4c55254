"""One name, one thing; and functions that ask for no more than one can hold in mind."""

import ast
import tokenize
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import jshell

MANY = 8  # parameters, *args and **keywords counted as one each
ROOT = Path(jshell.__file__).parent


def modules() -> Iterator[tuple[str, ast.Module]]:
    """Every module of the package, by its path."""
    for path in sorted(ROOT.rglob("*.py")):
        yield str(path.relative_to(ROOT)), ast.parse(path.read_text(encoding="utf-8"))


def test_no_class_name_is_used_in_two_files():
    homes = defaultdict(set)
    for path, module in modules():
        for node in ast.walk(module):
            if isinstance(node, ast.ClassDef):
                homes[node.name].add(path)
    assert len(homes) > 100
    assert {name: sorted(paths) for name, paths in homes.items() if len(paths) > 1} == {}


def parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """How many things a function asks for."""
    given = function.args
    named = [*given.posonlyargs, *given.args, *given.kwonlyargs]
    return len(named) + (given.vararg is not None) + (given.kwarg is not None)


def takes_fit_options(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether its keywords are those of `FitOptions`, which it takes as one as well."""
    annotations = (one.annotation for one in (*function.args.args, *function.args.kwonlyargs) if one.arg == "options")
    said = any(note is not None and "FitOptions" in ast.unparse(note) for note in annotations)
    return said or any(ast.unparse(one) == "takes_fit_options" for one in function.decorator_list)


def test_fewer_than_eight_functions_ask_for_more_than_eight_things():
    found = {}
    for path, module in modules():
        for node in ast.walk(module):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and parameters(node) > MANY:
                found[f"{path}:{node.name}"] = takes_fit_options(node)
    assert found["calibration/trajectories.py:fit_trajectories"]
    assert len([place for place, aside in found.items() if not aside]) < 8, found


# what the field has words for: Problem, Term, SolverResult, Evaluation, barrier, …
FORMER = {
    "Asked", "Specification", "Solved", "Ending", "Joint", "Piece", "Remembering", "Found", "Raw", "Ready",
    "left_over", "sorted_out", "gathered", "hear", "spool", "bell", "rung", "reclaim", "give_back", "Handed",
    "bring_home", "ROOM", "HELD", "KEPT", "CARE", "ABREAST", "SPOOL", "lent", "grip", "Climb", "Rung",
    "thrust", "launch", "Swing", "Still", "Together", "natural", "Look",
}  # fmt: skip
ORDINARY = {
    "look", "stage", "go", "pulsation", "pulsations", "heard", "turning", "ending", "space", "told", "raw",
    "ready", "push", "pull",
}  # fmt: skip
ROOMS = {"calibration", "signals", "inversion"}  # where ordinary words as well had meanings of their own


def test_things_have_the_names_that_the_field_gives_them():
    found = []
    for path in sorted(ROOT.rglob("*.py")):
        room, former = path.relative_to(ROOT).parts[0], FORMER
        if room in ROOMS:
            former = FORMER | ORDINARY
        with path.open("rb") as file:
            words = {one.string for one in tokenize.tokenize(file.readline) if one.type == tokenize.NAME}
        found += [f"{path.relative_to(ROOT)}: {word}" for word in sorted(words & former)]
    assert found == []
