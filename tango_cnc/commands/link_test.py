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
    """Asks the control what it is, or listens where it cannot be asked: is the line alive, are its settings right?

    Nothing is sent that moves the machine. Exit status 1 when the control was not recognised or cannot be worked with as it is.
    """
    from ..link._heard import heard, noise
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
    hello = protocol.hello(parsed.options) if hasattr(protocol, "hello") else b""
    click.echo(f"{address} is open; {'asking for up to' if hello else 'listening for'} {seconds:g} s", err=True)

    def judged(data: bytes) -> tuple[bool, list[str]]:
        if not hasattr(protocol, "found"):
            return bool(data), heard(data, cell.machine.names)
        if hello and not data:
            return False, ["nothing was answered: is the control switched on, the port and its settings the right ones?"]
        fine, sentences = protocol.found(data, parsed.options)
        return fine, [*sentences, *([] if fine else noise(data))]

    try:
        data = listen(line, hello, seconds, time.monotonic, lambda got: bool(hello) and judged(got)[0])
    finally:
        line.close()
    shown = data.decode("latin-1").encode("unicode_escape").decode("ascii")
    fine, found = judged(data)
    result = {"format": "tango-link-test/1", "port": address, "recognised": fine, "bytes": len(data), "data": shown, "found": found}
    if not write_json(json_file, result):
        click.echo("\n".join([*([shown] if shown else []), *found]))
    return 0 if fine else 1
