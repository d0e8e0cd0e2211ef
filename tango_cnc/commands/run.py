"""`tango run`: drive the controller and record the readings."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..files import blamed_on, of_stylus, read_cell
from ..files.normals import refuse_inward
from ..files.targets import spared
from ..records import Cell, InputError, LinkError, Plan
from ._common import Output, cell_option, dialect
from ._night_gate import proves
from ._plan import obstructed_option, warnings
from ._stylus import folder_of, left, stylus_option
from ._stylus import of_stylus as cell_of_stylus
from ._until import run_until, wanted_by

if TYPE_CHECKING:
    from postprocessors._base import Post

    from ..link.session import Step
    from ..program import Program

PLACE = "Measure 30"  # in the list of commands

DANGEROUS = 2  # beliefs up to this danger are named before a run: what they lead to breaks something, or a whole night is lost
PAUSE = 0.3  # s between two looks at the journal of another program


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
    help="Run several programs of at most N touches one after the other, as 'tango plan --split N' writes them. "
    "Default: as few programs as fit controller.memory.",
)
@click.option("--port", metavar="URL", help="Instead of controller.port, e.g. serial:///dev/ttyUSB0?baud=9600&flow=xonxoff.")
@click.option(
    "--readings", "readings_file", type=click.Path(path_type=Path), metavar="FILE", help="Default: readings.csv in the cell."
)
@click.option("--resume", is_flag=True, help="Continue the run that stopped: make the touches that have no reading.")
@click.option(
    "--until",
    metavar="GOAL",
    help="End when this is reached: locations, volume=5 (µm rms where parts are made) or limits such as EX0C=1,EA0C=5 "
    "(µm, µrad, µm/m). Touches are appended where the strategy alone does not reach it.",
)
@click.option("--watch", "watching", is_flag=True, help="Follow a run that another program makes; nothing is sent.")
@click.option("--yes", is_flag=True, help="Do not ask before the machine moves.")
@click.option(
    "--timeout", type=click.FloatRange(0, min_open=True), metavar="SECONDS", help="Silence of the control that is allowed."
)
@obstructed_option
@stylus_option
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
    until: str | None,
    watching: bool,
    yes: bool,
    timeout: float | None,
    obstructed: str | None,
    stylus: int | None,
    transcript: str | None,
    json_file: str | None,
) -> None:
    """Drives the controller through the plan; every reading is on disk before the next one is made.

    The plan is made anew from the cell and its program is written into program/ as 'tango plan' does.
    """
    from ..link._measure import Wanted, follow, measure
    from ..link._secrets import shown
    from ..link.lock import holding
    from ..plan import plan
    from .check import positioning_feed

    target = readings_file or of_stylus(folder / "readings.csv", stylus or 1)
    if watching:
        with _Live(json_file) as live:
            complete = follow(target.with_suffix(".journal"), live, lambda: time.sleep(PAUSE))
            live.add("end", {"readings": str(target), "complete": complete})
            if not complete:
                raise LinkError(f"{target.with_suffix('.journal')}: the run has stopped before its end")
        return
    spared("--readings", target, folder, replaces="readings.csv")
    whole = read_cell(folder)
    refuse_inward(whole)
    cell = cell_of_stylus(whole, stylus)
    target = readings_file or of_stylus(folder / "readings.csv", cell.machine.stylus)
    if cell.controller is None:
        raise InputError(
            f"{folder / 'tango.yaml'}: no key 'controller'; state post and port there, e.g. {{post: fanuc, port: COM3}}"
        )
    controller = cell.controller
    address = port or controller.port
    if address is None:
        raise InputError(
            f"{folder / 'tango.yaml'}: no controller.port; state it there or with --port; 'tango ports' lists what there is"
        )
    if resume and program_file is not None:
        raise InputError("--program and --resume: a run goes on with a program of the remaining touches; leave --program out")
    if most is not None and program_file is not None:
        raise InputError("--program and --split: the parts are written anew from the cell; leave --program out")
    if until is not None and (program_file is not None or obstructed is not None):
        raise InputError("--until: found --program or --obstructed too; allowed: --until alone, which plans what it needs")
    if until is not None and len({i.stylus for i in whole.strategy.indexations}) > 1:
        raise InputError("--until: found a strategy with several styli; allowed: a strategy with one")
    goal = None if until is None else wanted_by(cell, until)
    if goal is not None:
        cell = goal.cell
    made = plan(cell, obstructed) if goal is None else goal.plan
    for text in warnings(made):
        click.echo(text, err=True)
    post = dialect(cell)
    if not resume and _gate(cell, post) == "facet" and not (said := proves(cell, made)).passed:
        raise InputError(f"{folder / 'tango.yaml'}: gate: found facet: {said.found}; {said.do}. Nothing was sent")
    someone = sys.stdin is not None and sys.stdin.isatty()

    def confirm(part: Plan, program: Program) -> None:
        if not yes and someone:
            _ask(program.plan, shown(address), positioning_feed(cell), _unproven(cell, post), _gate(cell, post))

    elsewhere = holding(target.parent, "tango run") if target.parent.is_dir() else nullcontext()
    with holding(folder, "tango run"), elsewhere, _Live(json_file) as live, _transcript(transcript) as heard:
        wanted = Wanted(address, post.link, controller.post, target, resume, timeout, 600.0 if someone else 60.0, heard)

        def run(own: Wanted, count: int | None = None) -> dict[str, Any]:
            return measure(cell, made, own, lambda part: _posted(cell, post, made, part, program_file, most), live, confirm, count)

        origin = run(wanted) if goal is None else run_until(cell, goal, wanted, run, _said)
        result = {"readings": str(target), **origin}
        if not live.add("end", result):
            bad = "".join(
                f", {origin[status]} {word}" for status, word in (("miss", "missed"), ("early", "early")) if origin[status]
            )
            doubted = f", {len(origin['refused'])} records not believed" if origin["refused"] else ""
            _said(f"{origin['touches'] - len(origin['missing'])} touches{bad}{doubted} → {target}", err=False)
    for text in left(whole, cell, "tango run"):
        _said(text)


def _said(text: str, err: bool = True, nl: bool = True) -> bool:
    """text → on the screen, where there is one: a window that was closed ends no run. → whether it got there."""
    try:
        click.echo(text, err=err, nl=nl)
    except (OSError, ValueError):  # ValueError: the stream is closed
        _to_nowhere(2 if err else 1)
        return False
    return True


def _to_nowhere(handle: int) -> None:
    """What is still to be written to a broken stream, at the end of the program too, goes nowhere."""
    with suppress(OSError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, handle)
        os.close(nowhere)


@contextmanager
def _transcript(file: str | None) -> Iterator[Any]:
    """--transcript → what it is written to, or None; begun with the first byte, so that a refused run leaves the one before.

    Its end may be written when it is closed: what fails then is said, and changes nothing of the run.
    """
    out = None if file is None else click.open_file(file, "w", encoding="utf-8", lazy=True)
    try:
        yield out
    finally:
        if out is not None and file != "-":
            try:
                out.close()
            except (OSError, ValueError) as error:
                _said(f"--transcript: {file} is not complete: {error}")


def _posted(cell: Cell, post: Post, whole: Plan, part: Plan, program_file: Path | None, most: int | None) -> list[Program]:
    """cell, its post and plan, the part of it that is run now, a file or touches a program → what is sent, and is in program/."""
    from postprocessors import _base as posts

    from ..files.plan import Content, plan_lines, write_together
    from ..plan import plan_hash
    from ..program import REST, from_file, programs, stale

    assert cell.controller is not None
    options = cell.controller.options
    if program_file is not None:
        program = from_file(program_file, post, whole, options)
        for doubt in program.unread:
            click.echo(f"{program_file}: {doubt}", err=True)
        return [program]
    with blamed_on(cell.folder / "tango.yaml"):
        written = programs(post, part, options, most)
    target = folder_of(cell.folder / "program", cell) / ("" if part is whole else REST)
    files: dict[Path, Content] = {target / p.name: p.lines for p in written}
    files |= {target / name: partial(iter, lines) for name, lines in posts.companions(post, part, options).items()}
    write_together({**files, target / "plan.csv": lambda: plan_lines(part)})
    for sentence in stale(target, set(files), plan_hash(part)):
        click.echo(sentence, err=True)
    return [replace(p, file=str(target / p.name)) for p in written]


def _in_spindle(part: Plan) -> str:
    machine = part.machine
    return f"Probe with stylus {machine.stylus} ({machine.probe.length:g} mm)" if machine.styli else "Probe"


def _unproven(cell: Cell, post: Post) -> list[str]:
    """cell, its post → beliefs that can break something and that nothing in its commissioning.yaml proves today, in sentences."""
    from ._proofs import proven, unproven

    found = proven(cell, post)
    open_ones = [e for e in unproven(found) if e.danger <= DANGEROUS]
    return [f"{e.says}{'. It is NOT so: ' + found[e.belief].found if e.belief in found else ''}" for e in open_ones]


def _gate(cell: Cell, post: Post) -> str:
    """cell, its post → what proves the probe alive in its programs."""
    from postprocessors import _base as posts

    assert cell.controller is not None
    with blamed_on(cell.folder / "tango.yaml"):
        return str(posts.settings(post, cell.controller.options).get("gate", "none"))


def _ask(part: Plan, address: str, feed: float | None, unproven: list[str], which: str) -> None:
    """Raises click.Abort unless the person at the machine agrees, also to what nobody has proven of this control."""
    from ..duration import duration, proof, spoken

    for text in unproven:
        click.echo(f"not proven on this control: {text}", err=True)
    if unproven:
        click.echo("'tango commission' tries it high above the table, in minutes.", err=True)

    time = spoken(sum(duration(part, feed).values()) + proof(part, which, feed))
    click.echo(
        f"{part.machine.name} on {address} will make {len(part.touches)} touches in about {time}. "
        f"{_in_spindle(part)} in the spindle, switched on, clear of the table; hand on feed hold.",
        err=True,
    )
    click.confirm("Start?", default=False, abort=True, err=True)


class _Live:
    """Steps → progress on stderr, and one JSON object a line for other programs."""

    def __init__(self, file: str | None) -> None:
        self._bar, self._stdout, self._lost = _Bar(), file == "-", False
        # begun with the first step, so that a refused run leaves the file as it was
        self._out = None if file is None or self._stdout else click.open_file(file, "w", encoding="utf-8", lazy=True)

    def __enter__(self) -> _Live:
        return self

    def __exit__(self, *error: object) -> None:
        self._bar.close()
        if self._out is not None:
            with suppress(OSError, ValueError):
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
            if not self._lost and not _said(line, err=False):
                self._lose("the reader of stdout has gone")
        elif self._out is not None and not self._lost:
            try:
                self._out.write(line + "\n")
                self._out.flush()
            except (OSError, ValueError) as error:
                self._lose(str(error))
        return self._stdout

    def _lose(self, why: str) -> None:
        """Says once that nothing more goes to --json."""
        self._lost = True
        self._bar.close()
        _said(f"--json ends here: {why}; the run goes on")


class _Bar:
    """Progress on stderr: a line that is written over on a terminal, one line in ten percent elsewhere."""

    def __init__(self) -> None:
        self._terminal = sys.stderr is not None and sys.stderr.isatty()
        self._open = False
        self._shown = -1

    def __call__(self, step: Step) -> None:
        if step.remark:
            self.close()
            _said(step.remark)
        left = step.time / step.done * (step.total - step.done) if step.done else 0.0
        width = 24
        filled = width * step.done // max(step.total, 1)
        last = "" if step.deviation is None else f"  last {step.deviation:+.1f} µm"
        if step.drift is not None:
            last += f"  facet {step.facet} moved {step.drift:+.1f} µm"
        text = f"[{'#' * filled}{'.' * (width - filled)}] {step.done}/{step.total}  {_clock(left)} left{last}"
        if self._terminal:
            _said(f"\r{text:<78}", nl=False)
            self._open = True
        elif (tenths := 10 * step.done // max(step.total, 1)) != self._shown:  # less: the next part of a run has begun
            self._shown = tenths
            _said(text)

    def close(self) -> None:
        """Ends the line that is written over."""
        if self._open:
            _said("")
            self._open = False


def _clock(seconds: float) -> str:
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"
