"""`tango run`: sends the program to the controller and records the readings."""

from __future__ import annotations

import json
import re
import sys
import time
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..files import blamed_on, read_cell
from ..files.checked import read_text
from ..files.targets import spared
from ..records import Cell, InputError, LinkError, Plan
from ._common import Output, cell_option, dialect
from ._plan import obstructed_option, warnings

if TYPE_CHECKING:
    from postprocessors._base import Post

    from ..link._measure import Program
    from ..link.session import Step

PAUSE = 0.3  # s between two looks at the journal of another program
PLAN = re.compile(r"\bPLAN ([0-9A-F]{12})\b")
PART = re.compile(r"\bPLAN [0-9A-F]{12} PART (\d+) OF (\d+)\b")


@click.command()
@cell_option
@click.option(
    "--program", "program_file", type=click.Path(path_type=Path), metavar="FILE", help="Send this program of 'tango plan'."
)
@click.option(
    "--split",
    "most",
    type=click.IntRange(1),
    metavar="N",
    help="Run several programs of at most N touches one after the other, as 'tango plan --split N' writes them.",
)
@click.option("--port", metavar="URL", help="Instead of controller.port, e.g. serial:///dev/ttyUSB0?baud=9600&flow=xonxoff.")
@click.option(
    "--readings", "readings_file", type=click.Path(path_type=Path), metavar="FILE", help="Default: readings.csv in the cell."
)
@click.option("--resume", is_flag=True, help="Continue the run that stopped: make the touches that have no reading.")
@click.option("--watch", "watching", is_flag=True, help="Follow a run that another program makes; nothing is sent.")
@click.option("--yes", is_flag=True, help="Do not ask before the machine moves.")
@click.option(
    "--timeout", type=click.FloatRange(0, min_open=True), metavar="SECONDS", help="Silence of the control that is allowed."
)
@obstructed_option
@click.option("--transcript", type=Output(stdout=True), metavar="FILE", help="Also write down every byte that goes over the line.")
@click.option(
    "--json",
    "json_file",
    type=Output(stdout=True),
    metavar="FILE",
    help="One JSON object a line while it runs, the last one the result; - for stdout.",
)
def command(
    folder: Path,
    program_file: Path | None,
    most: int | None,
    port: str | None,
    readings_file: Path | None,
    resume: bool,
    watching: bool,
    yes: bool,
    timeout: float | None,
    obstructed: str,
    transcript: str | None,
    json_file: str | None,
) -> None:
    """Drives the controller through the plan; every reading is on disk before the next one is made.

    The plan is made anew from the cell and its program is written into program/ as 'tango plan' does.
    """
    from ..link._measure import Wanted, follow, measure
    from ..plan import plan
    from .check import positioning_feed

    target = readings_file or folder / "readings.csv"
    if watching:
        with _Live(json_file) as live:
            complete = follow(target.with_suffix(".journal"), live, lambda: time.sleep(PAUSE))
            live.add("end", {"readings": str(target), "complete": complete})
            if not complete:
                raise LinkError(f"{target.with_suffix('.journal')}: the run has stopped before its end")
        return
    spared("--readings", target, folder, replaces="readings.csv")
    cell = read_cell(folder)
    if cell.controller is None:
        raise InputError(
            f"{folder / 'tango.yaml'}: no key 'controller'; state post and port there, e.g. {{post: fanuc, port: COM3}}"
        )
    address = port or cell.controller.port
    if address is None:
        raise InputError(
            f"{folder / 'tango.yaml'}: no controller.port; state it there or with --port; 'tango ports' lists what there is"
        )
    if resume and program_file is not None:
        raise InputError("--program and --resume: a run goes on with a program of the remaining touches; leave --program out")
    if most is not None and program_file is not None:
        raise InputError("--program and --split: the parts are written anew from the cell; leave --program out")
    made = plan(cell, obstructed)
    for text in warnings(made):
        click.echo(text, err=True)
    post = dialect(cell)
    someone = sys.stdin.isatty()

    def confirm(part: Plan, program: Program) -> None:
        if not yes and someone:
            _ask(part, address, positioning_feed(cell))

    with _Live(json_file) as live, _transcript(transcript) as heard:
        wanted = Wanted(address, post.link, cell.controller.post, target, resume, timeout, 600.0 if someone else 60.0, heard)
        origin = measure(cell, made, wanted, lambda part: _posted(cell, post, made, part, program_file, most), live, confirm)
        result = {"readings": str(target), **origin}
        if not live.add("end", result):
            bad = "".join(
                f", {origin[status]} {word}" for status, word in (("miss", "missed"), ("early", "early")) if origin[status]
            )
            doubted = f", {len(origin['refused'])} records not believed" if origin["refused"] else ""
            click.echo(f"{origin['touches']} touches{bad}{doubted} → {target}")


def _transcript(file: str | None) -> Any:
    """--transcript → context of the file, or of none; begun with the first byte, so that a refused run leaves the one before."""
    return nullcontext() if file is None else click.open_file(file, "w", encoding="utf-8", lazy=True)


def _posted(cell: Cell, post: Post, whole: Plan, part: Plan, program_file: Path | None, most: int | None) -> list[Program]:
    """cell, its post and plan, the part of it that is run now, a file or touches a program → what is sent, and is in program/."""
    from postprocessors import _base as posts

    from ..files.plan import Content, plan_lines, write_together
    from ..link._measure import Program
    from ..plan import plan_hash
    from .plan import REST, programs, proven, stale

    assert cell.controller is not None
    letters = post.record_letters(part.machine)
    if program_file is not None:
        text = read_text(program_file)
        try:
            mark = posts.mark_of(text)
        except InputError as error:
            raise InputError(f"{program_file}: {error}; nothing was sent") from None
        found = PLAN.search(text)
        if found is None or found[1] != plan_hash(whole):
            other = found[1] if found else "none"
            raise InputError(
                f"{program_file}: found plan {other}; the cell makes plan {plan_hash(whole)}. "
                "The files of the cell have changed since, or --obstructed is another: write the program again with 'tango plan'"
            )
        if several := PART.search(text):
            raise InputError(
                f"{program_file}: found part {several[1]} of {several[2]}; a part alone is no whole plan: "
                "'tango run --split N' with the N of 'tango plan' runs all parts in their order"
            )
        try:
            options = cell.controller.options
            beside = posts.companions(post, whole, options)
            doubts = proven(post.title, lambda: iter(text.splitlines()), whole, posts.settings(post, options), beside)
        except InputError as error:
            raise InputError(f"{program_file}: {error}: nothing was sent. Write it again with 'tango plan'") from None
        for doubt in doubts:
            click.echo(f"{program_file}: {doubt}", err=True)
        return [Program(text, mark, letters, whole, str(program_file))]
    with blamed_on(cell.folder / "tango.yaml"):
        written = programs(post, part, cell.controller.options, most)
    target = cell.folder / "program" / ("" if part is whole else REST)
    files: dict[Path, Content] = {target / w.name: w.lines for w in written}
    files |= {target / name: partial(iter, lines) for name, lines in posts.companions(post, part, cell.controller.options).items()}
    write_together({**files, target / "plan.csv": lambda: plan_lines(part)})
    for sentence in stale(target, set(files), plan_hash(part)):
        click.echo(sentence, err=True)
    return [Program("".join(line + "\n" for line in w.lines()), w.mark, letters, w.plan, str(target / w.name)) for w in written]


def _ask(part: Plan, address: str, feed: float | None) -> None:
    """Raises click.Abort unless the person at the machine agrees."""
    from ..duration import duration, spoken

    time = spoken(sum(duration(part, feed).values()))
    click.echo(
        f"{part.machine.name} on {address} will make {len(part.touches)} touches in about {time}. "
        "Probe in the spindle, switched on, clear of the table; hand on feed hold.",
        err=True,
    )
    click.confirm("Start?", default=False, abort=True, err=True)


class _Live:
    """Steps → progress on stderr, and one JSON object a line for other programs."""

    def __init__(self, file: str | None) -> None:
        self._bar, self._stdout = _Bar(), file == "-"
        # begun with the first step, so that a refused run leaves the file as it was
        self._out = None if file is None or self._stdout else click.open_file(file, "w", encoding="utf-8", lazy=True)

    def __enter__(self) -> _Live:
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.close()
        if self._out is not None:
            self._out.close()

    def __call__(self, step: Step) -> None:
        """what happened → shown."""
        self._bar(step)
        values = {
            "done": step.done,
            "total": step.total,
            "time_s": round(step.time, 3),
            "touch": step.touch,
            "facet": step.facet,
            "status": step.status,
            "deviation_um": step.deviation,
            "drift_um": step.drift,
            "remark": step.remark,
        }
        self.add("touch" if step.touch else "state", {name: value for name, value in values.items() if value is not None})

    def add(self, event: str, values: dict[str, Any]) -> bool:
        """what it is, plain data → one line; whether stdout is taken (so that no other text goes there)."""
        line = json.dumps({"event": event, **values}, ensure_ascii=False, allow_nan=False)
        if self._stdout:
            click.echo(line)
        elif self._out is not None:
            self._out.write(line + "\n")
            self._out.flush()
        return self._stdout


class _Bar:
    """Progress on stderr: a line that is written over on a terminal, one line in ten percent elsewhere."""

    def __init__(self) -> None:
        self._terminal = sys.stderr.isatty()
        self._open = False
        self._shown = -1

    def __call__(self, step: Step) -> None:
        if step.remark:
            self.close()
            click.echo(step.remark, err=True)
        left = step.time / step.done * (step.total - step.done) if step.done else 0.0
        width = 24
        filled = width * step.done // max(step.total, 1)
        last = "" if step.deviation is None else f"  last {step.deviation:+.1f} µm"
        if step.drift is not None:
            last += f"  facet {step.facet} moved {step.drift:+.1f} µm"
        text = f"[{'#' * filled}{'.' * (width - filled)}] {step.done}/{step.total}  {_clock(left)} left{last}"
        if self._terminal:
            click.echo(f"\r{text:<78}", err=True, nl=False)
            self._open = True
        elif (tenths := 10 * step.done // max(step.total, 1)) != self._shown:  # less: the next part of a run has begun
            self._shown = tenths
            click.echo(text, err=True)

    def close(self) -> None:
        """Ends the line that is written over."""
        if self._open:
            click.echo(err=True)
            self._open = False


def _clock(seconds: float) -> str:
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"
