"""`tango init`: write a working example cell to start from."""

from __future__ import annotations

import shutil
from pathlib import Path

import click

import tango_cnc

from ..records import InputError
from ._handed import pasted

PLACE = "Begin 20"  # in the list of commands


def examples() -> dict[str, Path]:
    """→ folder of every example cell by name; in a checkout they stand beside the package, installed inside it."""
    package = Path(tango_cnc.__file__).parent
    root = next(folder for folder in (package / "examples", package.parent / "examples") if folder.is_dir())
    return {folder.name: folder for folder in sorted(root.iterdir()) if (folder / "tango.yaml").is_file()}


@click.command()
@click.argument("folder", type=click.Path(path_type=Path), metavar="DIR")
@click.option("--example", default="hu40t", show_default=True, help="Which cell to copy; see --list.")
@click.option(
    "--list",
    "listing",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    help="List the example cells.",
    callback=lambda c, p, v: _list(c, v),
)
def command(folder: Path, example: str) -> None:
    """Writes a working example cell into the new folder DIR."""
    write_example(folder, example)
    click.echo(f"{folder} holds the example cell {example!r}: {', '.join(sorted(f.name for f in folder.iterdir()))}")
    click.echo(f"Next: tango check -C {pasted(folder)}")


def _list(context: click.Context, wanted: bool) -> None:
    if wanted:
        width = max(map(len, examples()))
        for name, source in examples().items():
            title = next(
                (line[2:] for line in (source / "tango.yaml").read_text(encoding="utf-8").splitlines() if line.startswith("# ")), ""
            )
            click.echo(f"{name:{width}}  {title}".rstrip())
        context.exit()


def write_example(folder: Path, example: str) -> None:
    """new folder, name of an example → its files. Raises InputError for an unknown name or a folder that is in use."""
    known = examples()
    if example not in known:
        raise InputError(f"--example: found {example!r}; allowed: {', '.join(known)}")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: already there and not empty; give a new folder, nothing is ever overwritten")
    folder.mkdir(parents=True, exist_ok=True)
    for file in sorted(known[example].iterdir()):
        if file.is_file():
            shutil.copyfile(file, folder / file.name)
