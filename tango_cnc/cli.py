"""`tango COMMAND`: reads files, makes one call, writes files. Each command is one file in `commands/`, named after it."""

from __future__ import annotations

import errno
import importlib
import os
import pkgutil
import re
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

# The matrices are small: threads of the linear algebra gain nothing and, on a busy machine, wait for each other for minutes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from . import __version__, commands, lean
from .commands._numbers import advice
from .commands._signs import written
from .nearest import printable
from .records import TangoError

MESSAGE = 10_000  # characters at most
UNWRITTEN = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS)  # what a write meets, without the name of the file

FOR = re.compile(r'"""`tango [a-z0-9-]+`: (.+?)\.?(?:"""|\n)')  # first line of a command's file: what the command is for
PLACE = re.compile(r'^PLACE = "(\w+) (\d+)"', re.MULTILINE)


class _Commands(click.Group):
    """A group whose commands are the files of `commands/`, imported only when they are called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [m.name.replace("_", "-") for m in pkgutil.iter_modules(commands.__path__) if not m.name.startswith("_")]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The list of `tango --help`: by group, in working order, what each command is for; no command is imported for it."""
        rows: dict[str, list[tuple[int, str, str]]] = {}
        for name in self.list_commands(ctx):
            text = Path(commands.__path__[0], f"{name.replace('-', '_')}.py").read_text(encoding="utf-8")
            what, place = FOR.match(text), PLACE.search(text)
            group, rank = (place[1], int(place[2])) if place else (commands.GROUPS[-1], 99)
            rows.setdefault(group, []).append((rank, name, what[1] if what else ""))
        for group in commands.GROUPS:
            if listed := sorted(rows.get(group, [])):
                with formatter.section(group):
                    formatter.write_dl([(name, what) for _, name, what in listed])

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in self.list_commands(ctx):
            return None
        module = importlib.import_module(f"{commands.__name__}.{cmd_name.replace('-', '_')}")
        command: click.Command = module.command
        return command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> tuple[str | None, click.Command | None, list[str]]:
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            from .nearest import suggestion

            raise click.UsageError(error.message + suggestion(args[0], self.list_commands(ctx)), ctx) from None


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="tango")
def tango() -> None:
    """Calibrates five-axis machine tools by touching their own table with their own probe.

    A cell is a folder with a machine, an artefact and a strategy; every command takes it with -C (default: here).
    Exit status: 0 done, 1 done but a limit or verdict failed, 2 wrong input, 3 controller or link fault.
    """


def guarded(call: Callable[..., Any], *args: Any, **kwargs: Any) -> int:
    """callable → exit status; what the person has to know goes to stderr as one sentence, never as a traceback."""
    try:
        result = call(*args, **kwargs)
    except TangoError as error:
        _say(f"tango: {printable(str(error), MESSAGE)}")
        _advise(advice(str(error), "tango"))
        return error.exit_code
    except click.ClickException as error:
        error.show()
        if isinstance(error, click.UsageError):
            typed = error.ctx.command_path if error.ctx else "tango"
            _advise(_folder(error) or advice(error.message, typed))
        return error.exit_code
    except (KeyboardInterrupt, click.Abort):
        _say("tango: stopped by the user")
        return 130
    except BrokenPipeError:
        return 0
    except OSError as error:
        if error.filename is None and error.errno not in UNWRITTEN:
            raise
        if error.filename is None:
            _say(f"tango: {error.strerror}: not everything could be written; make room on the disk, or write elsewhere, and repeat")
            return 2
        where = error.filename2 or error.filename
        _say(f"tango: {where}: {error.strerror}; check the path, its permissions and the room on the disk")
        return 2
    return result if isinstance(result, int) else 0


def _folder(error: click.UsageError) -> str:
    """what click says of a command line → where the folder of the cell or the port goes, if it is that; else nothing."""
    if error.ctx is None or not any("-C" in option.opts for option in error.ctx.command.params):
        return ""
    extra = re.search(r"unexpected extra arguments? \((.+)\)$", error.message)
    if not extra and getattr(error, "option_name", "") not in ("-c", "--cell", "--folder", "--dir"):
        return ""
    if extra and "://" in extra[1] and any("--port" in option.opts for option in error.ctx.command.params):
        return f"The port goes behind --port: {error.ctx.command_path} --port {extra[1].split()[0]}"
    folder = extra[1] if extra and Path(extra[1]).is_dir() else extra[1].split()[0] if extra else "DIR"  # one may have a blank
    return f"The folder of the cell goes behind -C: {error.ctx.command_path} -C {shlex.quote(folder)}"


def _advise(sentence: str) -> None:
    """sentence, '' for none → said."""
    if sentence:
        _say(sentence)


def _say(sentence: str) -> None:
    """A terminal that was closed shows nothing any more; the exit status stays what it is, also when Python ends and flushes."""
    try:
        click.echo(sentence, err=True)
    except OSError:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for handle in (1, 2):
            os.dup2(nowhere, handle)


def main() -> None:
    """The entry point of the command `tango`."""
    _streams()
    lean.put_off("numpy", lean.UNUSED)
    lean.leave_notes_out()
    sys.exit(guarded(tango.main, standalone_mode=False))


def _streams() -> None:
    """A program started without stdin, stdout or stderr would open its files in their places, and messages would go into them.

    What an output cannot show is replaced there.
    """
    for handle in (0, 1, 2):
        try:
            os.fstat(handle)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    for stream in (sys.stdout, sys.stderr):
        written(stream)
