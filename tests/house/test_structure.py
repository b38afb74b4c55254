"""One name, one thing; and functions that ask for no more than one can hold in mind."""

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import jshell

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
