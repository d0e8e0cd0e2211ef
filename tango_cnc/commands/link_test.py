"""`tango link-test`: ask the control what it is; nothing moves."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..files import read_cell
from ..files.checked import read_text
from ..records import InputError
from ._common import address_of, cell_option, dialect, json_option, write_json

if TYPE_CHECKING:
    from ..link.transport import Transport

PLACE = "Measure 20"  # in the list of commands

SHOWN = 300  # characters of what came that are shown


@click.command()
@cell_option
@click.option("--port", metavar="URL", help="Instead of controller.port.")
@click.option("--seconds", type=click.FloatRange(0.1, 3600), default=10.0, show_default=True, help="How long to listen.")
@click.option(
    "--program",
    "program_file",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Compare what the control punches out now with this program of 'tango plan'.",
)
@json_option
def command(folder: Path, port: str | None, seconds: float, program_file: Path | None, json_file: str | None) -> int:
    """Asks the control what it is, or listens where it cannot be asked: is the line alive, are its settings right?

    Nothing is sent that moves the machine. Exit status 1 when the control was not recognised or cannot be worked with as it is.
    """
    from ..link._punched import compared
    from ..link.heard import heard, noise
    from ..link.measure import protocol_of
    from ..link.session import listen
    from ..link.transport import open_port

    cell = read_cell(folder)
    link = dialect(cell).link if cell.controller else "dnc"
    address = address_of(cell, port, link)
    protocol, parsed = protocol_of(address, link)
    program = None if program_file is None else read_text(program_file)
    client = protocol.Client
    if program is not None and not client.punches:
        raise InputError("--program: found a link over which no program is sent; allowed: dnc, whose controls punch programs out")
    address = parsed.url
    line = open_port(parsed, rests=True)
    hello = client.hello(parsed.options)
    doing = f"{'asking for up to' if hello else 'listening for'} {seconds:g} s"
    click.echo(f"{address} is open; {doing if program is None else 'let the control punch the program out now'}", err=True)

    def judged(data: bytes) -> tuple[bool, list[str]]:
        if program is not None:
            return compared(program, data)
        if hello and not data:
            return False, ["nothing was answered: is the control switched on, the port and its settings the right ones?"]
        said = client.told(data, parsed.options)
        if said is None:
            plain = bytes(byte & 0x7F for byte in data) if parsed.options.get("bits") == "7" else data
            return bool(data) and not noise(plain), heard(plain, cell.machine.names)
        fine, sentences = said
        return fine, [*sentences, *([] if fine else noise(data))]

    try:
        if program is None:
            data = listen(line, hello, seconds, time.monotonic, lambda got: bool(hello) and judged(got)[0])
        else:
            data = _tape(line, seconds)
    finally:
        line.close()
    shown = data.decode("latin-1").encode("unicode_escape").decode("ascii") if program is None else ""
    fine, found = judged(data)
    result = {"format": "tango-link-test/1", "port": address, "recognised": fine, "bytes": len(data), "data": shown, "found": found}
    if not write_json(json_file, result):
        more = " … (--json has all)" if len(shown) > SHOWN else ""
        click.echo("\n".join([*found, *([f"what came, {len(data)} bytes: {shown[:SHOWN]}{more}"] if shown else [])]))
    return 0 if fine else 1


def _tape(line: Transport, seconds: float) -> bytes:
    """open line, s of silence that end it → a tape from its leader to its closing %."""
    from ..link._punched import PERCENT, complete
    from ..link.session import listen

    pieces: list[bytes] = []
    while piece := listen(line, b"", seconds, time.monotonic, bool):
        pieces.append(piece)
        if any(mark in piece for mark in PERCENT) and complete(b"".join(pieces)):
            break
    return b"".join(pieces)
