"""Options that many commands share, and the writing of results."""

from __future__ import annotations

import json
import math
import sys
import textwrap
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unicodedata import combining, east_asian_width

import click

from ..files import blamed_on, write_text
from ..files.targets import same, spared, writable
from ..records import Cell, Controller, InputError
from ..texts.number import unsigned_zero
from . import _trusted
from ._handed import handed, pasted, spelt

if TYPE_CHECKING:
    from postprocessors import Post

LEAST = 24  # columns that the last column of a table needs beside the others
Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


class Output(click.Path):
    """A file that a command writes: seen to be writable as the command line is read, before anything is computed.

    `stdout`: - is allowed, and the value stays a text. `replaces`: a file of the cell that it may be.
    """

    def __init__(self, *, stdout: bool = False, replaces: str | None = None) -> None:
        super().__init__(path_type=None if stdout else Path)
        self.stdout, self.replaces = stdout, replaces

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """text → file. Raises InputError for what cannot be written."""
        if self.stdout and value == "-":
            return value
        what = spelt(param) if param is not None else "output"
        if not str(value):
            raise InputError(f"{what}: found ''; allowed: the name of a file")
        if ctx is None or not ctx.resilient_parsing:
            writable(what, Path(value))
        return super().convert(value, param, ctx)


def _each(value: Any) -> tuple[Any, ...]:
    """value of an option → it, or each of those of an option that may be given several times."""
    return value if isinstance(value, tuple) else (value,)


def _keeping(call: Callable[..., Any]) -> Callable[..., Any]:
    """function of a command → the same; it is not called where an output is a file that the command reads, or another output."""

    @wraps(call)
    def kept(**given: Any) -> Any:
        options = click.get_current_context().command.params
        for option in options:
            value = given.get(option.name) if option.name is not None else None
            if isinstance(value, float) and not math.isfinite(value):
                raise InputError(f"{spelt(option)}: found {value}; allowed: a finite number")
        files = [
            (spelt(o), o.type, Path(path))
            for o in options
            if isinstance(o.type, click.Path) and o.name is not None
            for path in _each(given.get(o.name))
            if path not in (None, "-")
        ]
        for what, kind, file in files:
            if not isinstance(kind, Output):
                continue
            for other, _, path in files:
                if other != what and same(file, path):
                    raise InputError(f"{what}: found {file}, which {other} names too; allowed: a file of its own for each")
            spared(what, file, given["folder"], replaces=kind.replaces)
        with handed():
            return call(**given)

    return kept


def cell_option(call: Callable[..., Any]) -> Callable[..., Any]:
    """function of a command → the same with -C; what its outputs would do to the files of the cell is looked at first."""
    option = click.option(
        "-C",
        "folder",
        type=click.Path(path_type=Path),
        default=Path("."),
        show_default="here",
        metavar="DIR",
        help="Folder of the cell.",
    )
    return option(_keeping(call))


json_option: Decorator = click.option(
    "--json",
    "json_file",
    type=Output(stdout=True),
    metavar="FILE",
    help="Also write the result as JSON; - writes it to stdout instead of the text.",
)


def ahead(folder: Path, *commands: str, first: str = "") -> None:
    """cell, commands, what has to be done before them → says on stderr what comes next, as it is typed."""
    where = "" if folder == Path() else f" -C {pasted(folder)}"
    click.echo(
        f"Next: {f'{first}, then ' if first else ''}{', then '.join(f'tango {command}{where}' for command in commands)}", err=True
    )


def folders_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """command → the same with -C, several times: folders of cells."""
    return click.option(
        "-C",
        "folders",
        type=click.Path(path_type=Path),
        multiple=True,
        metavar="DIR",
        help="Folder of a cell, or a folder of cells; may be given several times [default: here].",
    )(command)


def cells_in(folder: Path) -> list[Path]:
    """folder → itself when it is a cell, else the cells in it."""
    if (folder / "tango.yaml").is_file():
        return [folder]
    return sorted(sub for sub in folder.glob("*") if (sub / "tango.yaml").is_file()) if folder.is_dir() else []


def dialect(cell: Cell) -> Post:
    """cell with a controller → its post; one that is a file stands in the cell. Raises InputError when there is none."""
    import postprocessors as posts

    assert cell.controller is not None
    name = cell.controller.post
    if posts.is_own(name):
        _trusted.needed(cell.folder / name)
    with blamed_on(cell.folder / "tango.yaml"):
        return posts.load(str(cell.folder / name) if posts.is_own(name) else name, "controller.post")


def writing(cell: Cell) -> Post:
    """cell with a controller → its post, for a command that writes a program.

    Raises InputError where there is none, or the profile does not say what nobody else can.
    """
    from postprocessors import answered

    assert cell.controller is not None
    post = dialect(cell)
    with blamed_on(cell.folder / "tango.yaml"):
        answered(post.options, cell.controller.options)
    return post


def controller_of(cell: Cell) -> Controller:
    """cell → what it states of its control. Raises InputError when that is nothing."""
    if cell.controller is None:
        raise InputError(
            f"{cell.folder / 'tango.yaml'}: no key 'controller'; state post and port there, e.g. {{post: fanuc, port: COM3}}"
        )
    return cell.controller


def address_of(cell: Cell, port: str | None, link: str) -> str:
    """cell, --port, protocol of the post → the port of its control, before any work is done for it.

    Raises InputError when neither states one, and for one that no run can use.
    """
    from ..link.measure import usable

    address = port if port is not None else cell.controller.port if cell.controller else None
    if address is None:
        raise InputError(
            f"{cell.folder / 'tango.yaml'}: no controller.port; state it there or with --port; 'tango ports' lists what there is"
        )
    usable(address, link)
    return address


def attended() -> bool:
    """→ whether somebody sits at this terminal, who can be asked."""
    return sys.stdin is not None and sys.stdin.isatty()


def start_patience(someone: bool) -> float:
    """whether somebody is there → s until the control has to have started."""
    return 600.0 if someone else 60.0


def write_json(target: str | None, data: dict[str, Any]) -> bool:
    """file or '-' or None, plain data → whether stdout is taken (so that no other text goes there)."""
    if target is None:
        return False
    if target == "-":
        click.echo(json_text(data))
        return True
    write_text(Path(target), json_text(data) + "\n")
    return False


def json_text(data: dict[str, Any]) -> str:
    """plain data → JSON as files and stdout have it, without the last end of line."""
    return json.dumps(_unsigned(data), indent=1, ensure_ascii=False, allow_nan=False)


def _unsigned(data: Any) -> Any:
    """plain data → the same; nothing has no sign."""
    if isinstance(data, dict):
        return {key: _unsigned(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_unsigned(value) for value in data]
    return 0.0 if isinstance(data, float) and data == 0 else data


def table(rows: list[list[str]], align: str, columns: int | None = None) -> str:
    """rows of cells, one of '<>' per column → text with aligned columns, two spaces apart.

    `columns`: of a terminal; the last column is wrapped in it, or stands below its row where fewer than `LEAST` are left. Where the
    others have no room either, each row is a block: its first cell, then the others with the name of their column, a line each.
    """
    rows = [[unsigned_zero(cell) for cell in row] for row in rows]
    if columns is not None:
        return _within(rows, align, columns)
    widths = [max(wide(row[i]) for row in rows) for i in range(len(align))]
    return "\n".join("  ".join(_padded(cell, a, w) for cell, a, w in zip(row, align, widths, strict=True)).rstrip() for row in rows)


def wide(text: str) -> int:
    """text → columns that it takes on a terminal: a Chinese or Japanese letter takes two, a mark above a letter none."""
    return sum(0 if combining(c) else 2 if east_asian_width(c) in "WF" else 1 for c in text)


def _padded(text: str, align: str, columns: int) -> str:
    blanks = " " * (columns - wide(text))
    return text + blanks if align == "<" else blanks + text


def fitted(text: str) -> str:
    """text of lines → the same; on a terminal a line that is wider goes on below itself, and no word is cut."""
    columns = on_terminal()
    if columns is None:
        return text
    lines = []
    for line in text.splitlines():
        indent = " " * (len(line) - len(line.lstrip()))
        whole = textwrap.TextWrapper(columns, indent, f"{indent}  ", break_long_words=False, break_on_hyphens=False)
        lines += whole.wrap(line.strip()) if wide(line) > columns else [line]
    return "\n".join(lines)


def _within(rows: list[list[str]], align: str, columns: int) -> str:
    before = table([row[:-1] for row in rows], align[:-1]).splitlines()
    used = max(map(wide, before)) + 2
    if used - 2 > columns:
        return "\n".join(line for row in rows[1:] for line in _block(rows[0], row, columns))
    below = columns - used < LEAST
    lines: list[str] = []
    for text, row in zip(before, rows, strict=True):
        if below:
            last = textwrap.wrap(row[-1], columns, initial_indent="    ", subsequent_indent="    ") if row is not rows[0] else []
            lines += [*textwrap.wrap(text, columns, drop_whitespace=False), *last]
            continue
        last = textwrap.wrap(row[-1], columns - used) or [""]
        lines += [f"{_padded(text, '<', used)}{last[0]}".rstrip(), *(" " * used + line for line in last[1:])]
    return "\n".join(lines)


def _block(heads: list[str], row: list[str], columns: int) -> list[str]:
    """names of the columns, cells, columns of the terminal → lines that fit; what is empty is left out, no word is cut."""
    lines = textwrap.wrap(row[0], columns, subsequent_indent="  ")
    for head, cell in zip(heads[1:], row[1:], strict=True):
        text = f"{head}: {cell.strip()}" if head else cell.strip()
        if cell.strip():
            lines += textwrap.wrap(text, columns, initial_indent="  ", subsequent_indent="    ")
    return lines


def on_terminal() -> int | None:
    """→ columns of the terminal that stdout is; None for a file or a pipe, whose lines stay whole."""
    from ..report.characters import width

    return width() if sys.stdout.isatty() else None


def asks_for_a_finger(options: Mapping[str, Any]) -> dict[str, Any]:
    """`controller` keys → those of a program that a person starts: no facet proves the probe where the table is not known yet."""
    return {**options, "gate": "finger"} if options.get("gate") == "facet" else dict(options)
