"""What commissioning.yaml of a cell proves today, for the commands that rest on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..commission import Experiment, experiments, keys
from ..files.commissioning import Proof, latest, read_commissioning
from ..link._secrets import shown
from ..records import Cell
from . import _trusted

if TYPE_CHECKING:
    from postprocessors._base import Post


def keys_of(cell: Cell, post: Post) -> dict[str, str]:
    """cell with a controller, its post → {belief: key of what it depends on}. Raises InputError for unknown options."""
    from postprocessors import _base as posts

    assert cell.controller is not None
    name = cell.controller.post
    code = _trusted.digest(cell.folder / name) if posts.is_own(name) else ""
    return keys(cell.machine, name, code, posts.settings(post, cell.controller.options), shown(cell.controller.port or ""))


def proven(cell: Cell, post: Post) -> dict[str, Proof]:
    """cell with a controller, its post → {belief: its latest proof that still holds, PASS or FAIL}."""
    return latest(read_commissioning(cell.folder), keys_of(cell, post))


def unproven(found: dict[str, Proof]) -> list[Experiment]:
    """what is proven → the experiments of beliefs without PASS, the most dangerous first."""
    return [e for e in experiments() if e.belief not in found or found[e.belief].verdict != "PASS"]
