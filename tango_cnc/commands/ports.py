"""`tango ports`: list the serial ports of this computer."""

from __future__ import annotations

import click

from ._common import json_option, table, write_json

PLACE = "Measure 10"  # in the list of commands


@click.command()
@json_option
def command(json_file: str | None) -> None:
    """Lists the serial ports that 'controller: port:' or 'tango run --port' may name."""
    from ..link.transport import ports

    found = ports()
    if write_json(json_file, {"format": "tango-ports/1", "ports": [{"device": d, "description": text} for d, text in found]}):
        return
    if found:
        click.echo(table([list(port) for port in found], "<<"))
    else:
        click.echo("no serial ports; a control on the network is reached with socket://host:port")
