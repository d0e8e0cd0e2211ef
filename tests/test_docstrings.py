"""A docstring begins with the contract: `(m, 3) mm → (m,) mm, positive = gap`, or a sentence for what returns nothing."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.imports import modules, statements, tree

Definition = ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef
# Here everything that is public turns numbers into numbers: without shapes and units nobody can call it.
NUMERIC = (
    "tango_cnc.kinematics",
    "tango_cnc.touches",
    "tango_cnc.terms",
    "tango_cnc.model",
    "tango_cnc.identify",
    "tango_cnc.estimate",
    "tango_cnc.noise",
    "tango_cnc.check",
    "tango_cnc.plan",
    "tango_cnc.duration",
    "tango_cnc.files",
    "tango_cnc.verify",
    "tango_cnc.uncertainty",
    "tango_cnc.diagnose",
    "sim_controller.world",
    "sim_controller.transforms",
    "sim_controller.surfaces",
    "sim_controller.simulate",
    "sim_controller.effects",
)


def public(body: list[ast.stmt], prefix: str = "") -> Iterator[tuple[str, Definition]]:
    for node in body:
        if isinstance(node, Definition) and not node.name.startswith("_"):
            yield prefix + node.name, node
            if isinstance(node, ast.ClassDef):
                yield from public(node.body, f"{node.name}.")


def complaint(module: str, name: str, node: Definition) -> str | None:
    doc = ast.get_docstring(node)
    if not doc:
        return f"{module}.{name} has no docstring"
    first = doc.split("\n\n")[0].replace("\n", " ")
    if "→" in first:
        return None
    if not first.rstrip().endswith((".", ":", "?")):
        return f"{module}.{name}: neither an arrow nor a sentence: {first!r}"
    returns = isinstance(node, ast.FunctionDef) and not (isinstance(node.returns, ast.Constant) and node.returns.value is None)
    if returns and module.startswith(NUMERIC):
        return f"{module}.{name} returns something and its first line has no arrow: {first!r}"
    return None


def test_every_public_name_says_what_it_takes_and_gives(root: Path) -> None:
    found = []
    for module, file in modules(root).items():
        parsed = tree(file)
        if not ast.get_docstring(parsed) and parsed.body:
            found.append(f"{module}: the file does not say what it is for")
        found += [text for name, node in public(parsed.body) if (text := complaint(module, name, node))]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "source",
    [
        "def gap(x):\n    return x",
        "def gap(x):\n    'Gap of a touch.'\n    return x",
        "class Gap:\n    'the gap'",
    ],
)
def test_the_check_can_refuse(source: str) -> None:
    (name, node), *_ = public(ast.parse(source).body)
    assert complaint("tango_cnc.model", name, node)


LONGEST = 100  # lines of a function, its docstring too


def test_no_function_is_longer_than_a_reader_holds(root: Path) -> None:
    """Which step does what is said by names, not by places in a long one."""
    found = {
        f"{file.relative_to(root)}:{node.lineno} {node.name}": length
        for file in modules(root).values()
        for node in statements(tree(file))
        if isinstance(node, ast.FunctionDef) and (length := (node.end_lineno or 0) - node.lineno + 1) > LONGEST
    }
    assert not found, f"more than {LONGEST} lines: cut into steps with names: {found}"
