"""What several tests share of architecture."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
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


LINE = re.compile(r"^[ ]*(?:import [^\n]*|from \S+ import (?:\([^)]*\)|[^\n]*))", re.MULTILINE)


@cache
def import_statements(file: Path) -> tuple[ast.Import | ast.ImportFrom, ...]:
    """Every import statement of a file, by its line: the formatter gives each its own, and a tree takes twenty times as long.

    A line of a docstring that is an import statement counts as one; `col_offset` is where the statement stands.
    """
    found = []
    for match in LINE.finditer(file.read_text(encoding="utf-8")):
        try:
            (node,) = ast.parse(match[0].lstrip()).body
        except SyntaxError:  # a line of prose
            continue
        if isinstance(node, ast.Import | ast.ImportFrom):
            node.col_offset = len(match[0]) - len(match[0].lstrip())
            found.append(node)
    return tuple(found)


def statements(node: ast.AST) -> Iterator[ast.stmt]:
    """Every statement within a module, wherever it stands; expressions, which are most of a tree and hold none, are not walked."""
    for field in ("body", "orelse", "finalbody", "handlers", "cases"):
        inner = getattr(node, field, ())
        for one in inner if isinstance(inner, list) else ():
            if isinstance(one, ast.stmt):
                yield one
            yield from statements(one)
