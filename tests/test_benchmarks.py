"""Benchmarks are run by hand, now and then: what they take from the program is there under that name."""

from __future__ import annotations

import ast
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
OURS = ("tango_cnc", "sim_controller", "postprocessors")


def taken(file: Path) -> set[tuple[str, str]]:
    """benchmark → modules of the program and the names that it takes from them."""
    found = [n for n in ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if isinstance(n, ast.ImportFrom) and n.module]
    return {(str(n.module), each.name) for n in found if str(n.module).partition(".")[0] in OURS for each in n.names}


def there(module: str, name: str) -> bool:
    if hasattr(importlib.import_module(module), name):
        return True
    try:
        importlib.import_module(f"{module}.{name}")
    except ModuleNotFoundError:
        return False
    return True


@pytest.mark.parametrize("file", sorted((ROOT / "benchmarks").glob("*.py")), ids=lambda file: file.stem)
def test_what_a_benchmark_takes_from_the_program_is_there(file: Path) -> None:
    missing = [f"{module}: {name}" for module, name in sorted(taken(file)) if not there(module, name)]
    assert not missing, f"benchmarks/{file.name}: {', '.join(missing)}"
