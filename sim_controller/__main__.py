"""`python -m sim_controller`: a process that pretends to be the controller of a cell."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import click

from tango_cnc.files import read_cell, read_world
from tango_cnc.files.checked import read_text
from tango_cnc.records import InputError, TangoError

from . import of_cell, server, started
from .compensation import read
from .faults import KINDS, LINE_KINDS, FaultyLine, faults, line_faults
from .lines import Line, PacedLine, PtyLine, listen
from .probing import rig
from .session import Ledger, Session, Setup, families


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--cell", "folder", type=click.Path(path_type=Path), default=Path("."), metavar="DIR", help="Folder of the cell.")
@click.option("--world", "world_file", type=click.Path(path_type=Path), metavar="FILE", help="Default: world.yaml in the cell.")
@click.option("--tcp", metavar="HOST:PORT", help="Listen here, as a serial device server would; port 0 takes any free one.")
@click.option("--pty", is_flag=True, help="Open a pseudo-terminal, as a serial port.")
@click.option(
    "--start",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Run this program once, as soon as it is there, whoever waits for it or not; with --tcp or --pty: on its command. "
    "Default with --records, and where the control has its program by other ways (--protocol dprnt): each program of the cell, "
    "when a command of tango waits for its start.",
)
@click.option("--records", type=click.Path(path_type=Path), metavar="FILE", help="Where the records go, instead of a line.")
@click.option(
    "--language", metavar="NAME", help=f"What the control understands: {', '.join(families())}. Default: that of the post."
)
@click.option("--protocol", metavar="NAME", help=f"How it talks: {', '.join(server.talks())}. Default: as the port of the cell.")
@click.option(
    "--mode", type=click.Choice(["memory", "dnc"]), default="memory", show_default=True, help="Store, then run; or drip-feed."
)
@click.option(
    "--speed", type=click.FloatRange(0), default=math.inf, help="Simulated seconds per second; 0 and inf: as fast as it goes."
)
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="Parameters of the control, e.g. increment=0.0001.")
@click.option("--g54", metavar="X,Y,Z", help="Work offset, mm.")
@click.option(
    "--stored",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Programs or files that the control has; a line with the path of a file (TNC:\\TANGO.A, m880.m1s) begins it. What "
    "lies beside the program of --start, or of a cell, is there in any case.",
)
@click.option("--parity", is_flag=True, help="7 data bits, even parity; a character of wrong parity in a program is an alarm.")
@click.option("--tv-check", "counted", is_flag=True, help="A block of an odd number of characters is an alarm.")
@click.option("--baud", type=click.IntRange(110), help="Send no faster than this; default: as fast as it goes.")
@click.option("--buffer", type=click.IntRange(64), default=4096, show_default=True, help="Bytes taken in ahead of execution.")
@click.option("--seed", type=click.IntRange(0), help="Of noise and effects; default: the world's.")
@click.option("--fault", "fault_texts", multiple=True, metavar="NAME=N", help=f"{', '.join(KINDS)}: after N touches.")
@click.option("--line-fault", "line_texts", multiple=True, metavar="NAME=CHANCE", help=f"{', '.join(LINE_KINDS)}: of every byte.")
@click.option("--line-seed", type=click.IntRange(0), default=0, show_default=True, help="Of the faults of the line.")
@click.option("--ledger", type=click.Path(path_type=Path), metavar="FILE", help="What truly happened, as JSON lines.")
@click.option(
    "--compensation", type=click.Path(path_type=Path), metavar="DIR", help="What 'tango compensate' wrote is in the control."
)
@click.option("--stylus", type=int, default=1, show_default=True, help="Which stylus is in the spindle.")
@click.option(
    "--override",
    default="1",
    metavar="FACTOR[,…]",
    help="Feed override of the panel, 0.01 to 2: for each program in turn, the last one stays (1,0.1: turned after the first).",
)
@click.option("--dry-run", type=click.FloatRange(1, 100000), metavar="MM/MIN", help="Dry run: this feed in place of every F.")
@click.option("--skip-obeys", is_flag=True, help="Probing moves obey override and dry run; on most controls they do not.")
@click.option(
    "--deflected-goes-on", "goes_on", is_flag=True, help="A probing move that begins with the probe deflected is carried out."
)
@click.option("--once", is_flag=True, help="End after one program.")
def main(
    folder: Path,
    world_file: Path | None,
    tcp: str | None,
    pty: bool,
    start: Path | None,
    records: Path | None,
    language: str | None,
    protocol: str | None,
    mode: str,
    speed: float,
    settings: tuple[str, ...],
    g54: str | None,
    stored: Path | None,
    parity: bool,
    counted: bool,
    baud: int | None,
    buffer: int,
    seed: int | None,
    fault_texts: tuple[str, ...],
    line_texts: tuple[str, ...],
    line_seed: int,
    ledger: Path | None,
    compensation: Path | None,
    stylus: int,
    override: str,
    dry_run: float | None,
    skip_obeys: bool,
    goes_on: bool,
    once: bool,
) -> None:
    """Pretends to be the controller of a cell whose true machine is described by a world file.

    What is not stated is taken from the cell: the port, the language of its post, how its probe is wired. The first line on stdout
    is the port to connect to (socket://127.0.0.1:8193, /dev/pts/3, file:///tmp/TANGO.TXT).
    """
    cell = read_cell(folder)
    there = of_cell.place(cell, tcp, pty, records, protocol)
    if not 1 <= stylus <= max(len(cell.machine.styli), 1):
        raise InputError(f"--stylus: found {stylus}; allowed: 1 to {max(len(cell.machine.styli), 1)}")
    machine = cell.machine.with_stylus(stylus)
    # Probing programs run without tool centre point control: kinematics that need it do not act.
    control = read(compensation, machine, tcp=False) if compensation is not None else None
    truth = rig(machine, cell.artefact, read_world(world_file or folder / "world.yaml"), seed, control=control)
    family, chosen, library = of_cell.kind(cell, language, dict(_pair(text) for text in settings))
    if g54 is not None:
        chosen["g54"] = " ".join(f"{name}:{value}" for name, value in zip("XYZ", g54.split(","), strict=False))
    library = tuple(line for line in read_text(stored).splitlines() if line.strip() != "%") if stored else library
    panel = (_factors(override), dry_run, goes_on, skip_obeys)
    setup = Setup(family, chosen, mode == "dnc", speed or math.inf, faults(fault_texts), library, buffer, counted, *panel)
    talk = server.protocol(there.protocol)
    journal = Ledger(ledger)
    session = Session(truth, setup, journal.note)
    chances = line_faults(line_texts)

    def disturbed(line: Line) -> Line:
        paced = PacedLine(line, baud) if baud else line
        return FaultyLine(paced, chances, line_seed, journal.note) if chances else paced

    try:
        if start is not None:
            session.keep(start)
        elif talk.stored:
            session.resident = started.waited(folder, session)
        if there.records is not None:
            click.echo(there.records.absolute().as_uri())
            sys.stdout.flush()
            if start is not None:
                started.start(start, there.records, session)
            else:
                started.attend(folder, there.records, session, once)
        elif there.tcp is not None:
            listening = listen(there.tcp)
            host, port = listening.getsockname()[:2]
            click.echo(talk.tcp.format(f"{host}:{port}"))
            sys.stdout.flush()
            server.serve_tcp(listening, talk, session, parity=parity, once=once, disturbed=disturbed)
        else:
            line = PtyLine()
            session.serial = True
            click.echo(talk.pty.format(line.path))
            sys.stdout.flush()
            server.serve_pty(line, talk, session, parity=parity, once=once, disturbed=disturbed)
    finally:
        journal.close()


def _factors(text: str) -> tuple[float, ...]:
    """'1,0.1' → (1.0, 0.1). Raises InputError for what no panel can be turned to."""
    try:
        factors = tuple(float(part) for part in text.split(","))
    except ValueError:
        factors = ()
    if not factors or not all(0.01 <= factor <= 2 for factor in factors):
        raise InputError(f"--override: found {text!r}; allowed: factors from 0.01 to 2 with commas between them, e.g. 1,0.1")
    return factors


def _pair(text: str) -> tuple[str, str]:
    name, separator, value = text.partition("=")
    if not separator:
        raise InputError(f"--set: found {text!r}; allowed: NAME=VALUE, e.g. increment=0.0001")
    return name, value


def run(arguments: list[str] | None = None) -> int:
    """arguments of the command line → exit status; what is wrong goes to stderr as one sentence."""
    try:
        main.main(arguments, standalone_mode=False, prog_name="python -m sim_controller")
    except TangoError as error:
        click.echo(f"sim_controller: {error}", err=True)
        return error.exit_code
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except (KeyboardInterrupt, click.Abort):
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(run())
