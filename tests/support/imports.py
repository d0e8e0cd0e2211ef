"""What several tests share of architecture."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path


@cache
def modules(root: Path) -> dict[str, Path]:
    found = {}
    for package in ("tango_cnc", "postprocessors", "sim_controller"):
        for file in sorted((root / package).rglob("*.py")):
            parts = file.relative_to(root).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


@cache
def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))
