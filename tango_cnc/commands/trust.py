"""`tango trust`: lets a post of your own, which is a program, run on this computer."""

from __future__ import annotations

from pathlib import Path

import click

from ..records import InputError
from . import _trusted

PLACE = "Begin 40"  # in the list of commands


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
def command(file: Path) -> None:
    """Trusts FILE, a post of your own (.py), as it is now; once it is changed, it has to be trusted again.

    The hash is kept in your configuration folder, not in the cell.
    """
    if not file.is_file() or file.suffix != ".py":
        raise InputError(f"found {file}, which is no file or does not end in .py; allowed: a post of your own")
    _trusted.trust(file)
    click.echo(f"{file} (SHA-256 {_trusted.digest(file)[:12]}…) is trusted; the list is {_trusted.kept()}")
