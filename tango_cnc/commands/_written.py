"""A program that a cell needs besides its measurement, written into a folder of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..files import blamed_on
from ..records import Cell, Plan

if TYPE_CHECKING:
    from postprocessors._base import Post

    from ..program import Program


def written(cell: Cell, target: Path, post: Post, made: Plan, options: Mapping[str, Any]) -> list[Program]:
    """cell, folder, its post, plan, options → the programs of the plan, read back, and what travels with them, in that folder.

    Raises InputError for what the post or the read-back refuses; then nothing is written.
    """
    from postprocessors import _base as posts

    from ..files.plan import Content, plan_lines, write_together
    from ..program import programs

    with blamed_on(cell.folder / "tango.yaml"):
        found = programs(post, made, options)
    files: dict[Path, Content] = {target / p.name: p.lines for p in found}
    files |= {target / name: partial(iter, lines) for name, lines in posts.companions(post, made, options).items()}
    write_together({**files, target / "plan.csv": lambda: plan_lines(made)})
    return [replace(p, file=str(target / p.name)) for p in found]
