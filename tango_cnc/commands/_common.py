"""Options that many commands share, and the writing of results."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..files import blamed_on, write_text
from ..records import Cell

if TYPE_CHECKING:
    from postprocessors._base import Post

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

cell_option: Decorator = click.option(
    "-C",
    "folder",
    type=click.Path(path_type=Path),
    default=Path("."),
    show_default="here",
    metavar="DIR",
    help="Folder of the cell.",
)
json_option: Decorator = click.option(
    "--json", "json_file", metavar="FILE", help="Also write the result as JSON; - writes it to stdout instead of the text."
)


def dialect(cell: Cell) -> Post:
    """cell with a controller → its post; one that is a file stands in the cell. Raises InputError when there is none."""
    from postprocessors import _base as posts

    assert cell.controller is not None
    name = cell.controller.post
    with blamed_on(cell.folder / "tango.yaml"):
        return posts.load(str(cell.folder / name) if posts.is_own(name) else name, "controller.post")


def write_json(target: str | None, data: dict[str, Any]) -> bool:
    """file or '-' or None, plain data → whether stdout is taken (so that no other text goes there)."""
    if target is None:
        return False
    text = json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    if target == "-":
        click.echo(text, nl=False)
        return True
    write_text(Path(target), text)
    return False


def table(rows: list[list[str]], align: str) -> str:
    """rows of cells, one of '<>' per column → text with aligned columns, two spaces apart."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(align))]
    return "\n".join("  ".join(f"{cell:{a}{w}}" for cell, a, w in zip(row, align, widths, strict=True)).rstrip() for row in rows)
