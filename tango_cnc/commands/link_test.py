"""`tango link-test`: opens the port, sends nothing that moves anything, and says what comes."""

from __future__ import annotations

import time
from pathlib import Path

import click

from ..files import read_cell
from ..records import InputError
from ._common import cell_option, json_option, write_json
from .run import dialect


@click.command()
@cell_option
@click.option("--port", metavar="URL", help="Instead of controller.port.")
@click.option("--seconds", type=click.FloatRange(0.1, 3600), default=10.0, show_default=True, help="How long to listen.")
@json_option
def command(folder: Path, port: str | None, seconds: float, json_file: str | None) -> int:
    """Listens to the control: is the line alive, are its settings right, is what it prints a record?

    Nothing is sent that moves the machine. Exit status 1 when nothing came.
    """
    from ..link._heard import heard
    from ..link._measure import protocol_of
    from ..link.session import listen
    from ..link.transport import open_port

    cell = read_cell(folder)
    address = port or (cell.controller.port if cell.controller else None)
    if address is None:
        raise InputError(
            f"{folder / 'tango.yaml'}: no controller.port; state it there or with --port; 'tango ports' lists what there is"
        )
    protocol, parsed = protocol_of(address, dialect(cell).link if cell.controller else "dnc")
    line = open_port(parsed)
    click.echo(f"{address} is open; listening for {seconds:g} s", err=True)
    try:
        data = listen(line, protocol.HELLO, seconds, time.monotonic)
    finally:
        line.close()
    shown = data.decode("latin-1").encode("unicode_escape").decode("ascii")
    found = heard(data, cell.machine.names)
    if not write_json(
        json_file, {"format": "tango-link-test/1", "port": address, "bytes": len(data), "data": shown, "found": found}
    ):
        click.echo("\n".join([*([shown] if shown else []), *found]))
    return 0 if data else 1
