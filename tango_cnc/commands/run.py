"""`tango run`: drive the controller and record the readings."""

from __future__ import annotations

import shlex
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..files import blamed_on, of_stylus, read_cell
from ..files.checked import broken_off
from ..files.normals import refuse_inward
from ..files.targets import spared
from ..records import Cell, InputError, LinkError, Plan
from ._beside import alone
from ._common import Output, address_of, ahead, attended, cell_option, controller_of, start_patience, writing
from ._handed import Kept, hands, printed, whole
from ._links import say_doubt
from ._live import LateFile, Live
from ._plan import obstructed_option, warnings
from ._progress import said
from ._start import ask, counts, gate_of, misses_of, obeys, refuse_fatal, tries_of, unattended, unproven_of
from ._stylus import folder_of, left, stylus_option
from ._stylus import of_stylus as cell_of_stylus
from ._until import run_until, wanted_by

if TYPE_CHECKING:
    from postprocessors import Post

    from ..design.until import Until
    from ..link.measure import Wanted
    from ..program import Program

PLACE = "Measure 50"  # in the list of commands

KEPT = Kept(("port", "most", "timeout", "simulated", "obstructed", "stylus", "until", "readings_file"))
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
@alone("-C", "--readings", "--stylus", "--json")(
    "--watch", "watching", is_flag=True, help="Follow a run that another program makes; nothing is sent."
)
@click.option("--simulated", is_flag=True, help="The control is a simulated one: readings, pages and reports then say so.")
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
@hands(KEPT)
def command(
    folder: Path,
    program_file: Path | None,
    most: int | None,
    port: str | None,
    readings_file: Path | None,
    resume: bool,
    until: str | None,
    watching: bool,
    simulated: bool,
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
    from ..link.aside import set_aside
    from ..link.measure import fitting
    from ..plan import plan

    set_aside()
    target = readings_file or of_stylus(folder / "readings.csv", stylus or 1)
    if watching:
        _watched(target, json_file)
        return
    spared("--readings", target, folder, replaces="readings.csv")
    whole_cell = read_cell(folder)
    refuse_inward(whole_cell)
    cell = cell_of_stylus(whole_cell, stylus)
    target = readings_file or of_stylus(folder / "readings.csv", cell.machine.stylus)
    controller_of(cell)
    post = writing(cell)
    address = address_of(cell, port, post.link)
    _checked(whole_cell, resume, program_file, most, until, obstructed)
    goal = None if until is None else wanted_by(cell, until)
    if goal is not None:
        cell = goal.cell
    made = plan(cell, obstructed) if goal is None else goal.plan
    fitting(address, post.link, made)
    say_doubt(post, address)
    for text in warnings(made):
        printed(text, err=True)
    if gate_of(cell, post) == "facet":
        made = _proving(cell, folder, made, post, resume)
    someone = attended()
    if yes or not someone:
        unattended(cell, post, simulated)
    else:
        refuse_fatal(cell, post, simulated=simulated)
    how = resuming(until, obstructed, stylus, readings_file)
    job = _Job(cell, post, made, address, target, program_file, most, resume, timeout, simulated, how, someone, yes)
    _driven(job, folder, goal, transcript, json_file)
    others = left(whole_cell, cell, "tango run")
    for text in others:
        said(whole(text, KEPT))
    if json_file != "-" and readings_file is None and not others:
        ahead(folder, "estimate")


@dataclass(frozen=True)
class _Job:
    """A plan on its way to the control."""

    cell: Cell
    post: Post
    made: Plan
    address: str
    target: Path  # readings
    program_file: Path | None  # --program
    most: int | None  # --split
    resume: bool
    timeout: float | None
    simulated: bool
    how: str  # what 'tango run' has to state to go on
    someone: bool  # is there, and can say yes
    yes: bool  # --yes: has said it

    def posted(self, part: Plan) -> list[Program]:
        """part of the plan → its programs."""
        return written_for(self.cell, self.post, self.made, part, self.program_file, self.most)

    def kept(self, part: Plan, programs: Sequence[Program]) -> list[Program]:
        """part of the plan, its programs → the same, in program/."""
        return keep(self.cell, self.post, self.made, part, programs)

    def confirm(self, part: Plan, program: Program) -> None:
        """part of the plan, its program → somebody has said yes. Raises what ends the run otherwise."""
        from ..link.secrets import shown
        from .check import positioning_feed

        if self.someone and not self.yes:
            cell, post = self.cell, self.post
            doubts, gate, own = unproven_of(cell, post), gate_of(cell, post), obeys(cell, post)
            ask(program.plan, shown(self.address), positioning_feed(cell), doubts, gate, own, tries_of(cell, post))


def _watched(target: Path, json_file: str | None) -> None:
    """readings, --json → what another 'tango run' writes is shown until it ends. Raises LinkError where it stops before."""
    from ..link.follow import follow

    journal = target.with_suffix(".journal")
    with Live(json_file) as live:
        complete = follow(journal, live, lambda: time.sleep(PAUSE))
        live.add("end", {"readings": str(target), "complete": complete})
        if not complete:
            raise LinkError(f"{journal}: the run has stopped before its end")


def _checked(
    whole: Cell, resume: bool, program_file: Path | None, most: int | None, until: str | None, obstructed: str | None
) -> None:
    """cell, --resume, --program, --split, --until, --obstructed → nothing. Raises InputError for those that do not go together."""
    if resume and program_file is not None:
        raise InputError("--program and --resume: a run goes on with a program of the remaining touches; leave --program out")
    if most is not None and program_file is not None:
        raise InputError("--program and --split: the parts are written anew from the cell; leave --program out")
    if until is not None and (program_file is not None or obstructed is not None):
        raise InputError("--until: found --program or --obstructed too; allowed: --until alone, which plans what it needs")
    if until is not None and len({i.stylus for i in whole.strategy.indexations}) > 1:
        raise InputError("--until: found a strategy with several styli; allowed: a strategy with one")


def _proving(cell: Cell, folder: Path, made: Plan, post: Post, resume: bool) -> Plan:
    """cell, its folder, plan, post, --resume → the plan with the facet that proves the probe. Raises InputError where none does."""
    from ._night_gate import as_found, proves  # with the nights comes their database

    made = as_found(cell, made, post)
    if not resume and not (alive := proves(cell, made)).passed:
        raise InputError(f"{folder / 'tango.yaml'}: gate: found facet: {alive.found}; {alive.do}. Nothing was sent")
    return made


def _driven(job: _Job, folder: Path, goal: Until | None, transcript: str | None, json_file: str | None) -> None:
    """job, folder of the cell, what --until wants, --transcript, --json → the plan is driven, its readings are on disk, what has
    come is said.
    """
    from ..link.lock import holding
    from ..link.measure import Wanted, measure
    from .check import positioning_feed

    target = job.target
    journal = target.with_suffix(".journal")
    elsewhere = holding(target.parent, "tango run") if target.parent.is_dir() else nullcontext()
    with holding(folder, "tango run"), elsewhere, Live(json_file) as live, _transcript(transcript) as heard:
        if not job.resume and journal.exists() and not target.exists():  # while another run is at work, nobody gets here
            kept = f"{journal.name} is of a run that was broken off. It is kept under its date, and this run begins anew"
            said(f"{kept}; {whole(broken_off(journal), KEPT)}")
        wanted = Wanted(
            job.address,
            job.post.link,
            controller_of(job.cell).post,
            target,
            job.resume,
            job.timeout,
            start_patience(job.someone),
            heard,
            misses=misses_of(job.cell, job.post),
            counted=counts(job.post),
            simulated=job.simulated,
            how=job.how,
            feed=positioning_feed(job.cell),
        )

        def run(own: Wanted, count: int | None = None) -> dict[str, Any]:
            return measure(job.cell, job.made, own, job.posted, live, job.confirm, count, job.kept)

        origin = run(wanted) if goal is None else run_until(job.cell, goal, wanted, run, lambda text: said(whole(text)))
        if not live.add("end", {"readings": str(target), **origin}):
            said(_summary(origin, target), err=False)


def _summary(origin: Mapping[str, Any], target: Path) -> str:
    """what a run has measured, its file → the last line of the run: '390 touches, 3 missed → readings.csv'."""
    words = (("miss", "missed"), ("early", "early"))
    bad = "".join(f", {origin[status]} {word}" for status, word in words if origin[status])
    doubted = f", {len(origin['refused'])} records not believed" if origin["refused"] else ""
    return f"{origin['touches'] - len(origin['missing'])} touches{bad}{doubted} → {target}"


def resuming(until: str | None, obstructed: str | None, stylus: int | None, readings: Path | None) -> str:
    """--until, --obstructed, --stylus, --readings of a run → what 'tango run' has to state to go on with it."""
    stated = {"--until": until, "--obstructed": obstructed, "--stylus": stylus, "--readings": readings}
    return " ".join(["--resume", *(f"{name} {shlex.quote(str(value))}" for name, value in stated.items() if value is not None)])


@contextmanager
def _transcript(file: str | None) -> Iterator[Any]:
    """--transcript → what it is written to, or None; begun with the first byte.

    Its end may be written when it is closed: what fails then is said, and changes nothing of the run.
    """
    out: Any = None if file is None else click.open_file(file, "w") if file == "-" else LateFile(file)
    try:
        yield out
    finally:
        if out is not None and file != "-":
            try:
                out.close()
            except (OSError, ValueError) as error:
                said(f"--transcript: {file} is not complete: {error}")


def written_for(cell: Cell, post: Post, whole: Plan, part: Plan, file: Path | None, most: int | None) -> list[Program]:
    """cell, its post and plan, the part of it that is run now, a file or touches a program → what is sent; nothing is on disk yet.

    Raises InputError for a file that is not a program of this plan, and for what the post cannot write.
    """
    from ..program import from_file, programs

    assert cell.controller is not None
    options = cell.controller.options
    if file is not None:
        program = from_file(file, post, whole, options)
        for doubt in program.unread:
            click.echo(f"{file}: {doubt}", err=True)
        return [program]
    with blamed_on(cell.folder / "tango.yaml"):
        return programs(post, part, options, most)


def keep(cell: Cell, post: Post, whole: Plan, part: Plan, programs: Sequence[Program]) -> list[Program]:
    """cell, its post and plan, the part of it that is run now, its programs → the same, in program/; one of a file stays there.

    Raises OSError when they cannot be written.
    """
    import postprocessors as posts

    from ..files.plan import Content, plan_lines, write_together
    from ..plan import plan_hash
    from ..program import REST, stale

    assert cell.controller is not None
    if all(program.file for program in programs):
        return list(programs)
    target = folder_of(cell.folder / "program", cell) / ("" if part is whole else REST)
    files: dict[Path, Content] = {target / p.name: p.lines for p in programs}
    companions = posts.companions(post, part, cell.controller.options)
    files |= {target / name: partial(iter, lines) for name, lines in companions.items()}
    write_together({**files, target / "plan.csv": lambda: plan_lines(part)})
    for sentence in stale(target, set(files), plan_hash(part)):
        click.echo(sentence, err=True)
    return [replace(p, file=str(target / p.name)) for p in programs]
