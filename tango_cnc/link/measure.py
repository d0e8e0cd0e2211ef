"""One run from plan to readings: which touches are still to be made, the conversation, and the files it leaves.

readings.csv, readings.json              a complete run
readings.partial.csv, …partial.json      what an unfinished run has so far
readings.journal                         every reading as it came; the only thing that `--resume` believes
"""

from __future__ import annotations

import contextlib
import json
import math
import secrets
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TextIO

from .. import __version__
from ..duration import duration
from ..files import readings_text, write_text
from ..files.origin import origin_file, set_aside, write_origin
from ..gate import ALIVE_TIME
from ..plan import plan_hash
from ..program.record import Program, beside_of
from ..records import Cell, InputError, LacksSettingError, LinkError, NothingSentError, Plan
from . import protocols
from .address import Address, completed, linked, parse, spoken
from .client import Task
from .entries import End, Entry, ProgramSent, Reading
from .journal import Journal, look_at, read_journal
from .process import boot, endings
from .readings import missing, provenance, readings_of
from .rest import durations, repeatable, rest_of
from .secrets import shown
from .sensors import read_sensors
from .session import Moved, News, Session
from .transport import Transport, fits, foreseen, look_into, open_port, said_before
from .transport._refused import RefusedError
from .transport._sensors import Watch

QUIET = 5.0  # s beyond one and a half times the longest predicted time from touch to touch
FLOOR, TIMES = 30.0, 3.0  # silence allowed before a touch: s, and multiples of its predicted time


@dataclass(frozen=True)
class Wanted:
    """What the person at the machine asked for."""

    port: str
    protocol: str  # of the post; the port's URL may name another one with link=
    post: str
    readings: Path
    resume: bool = False
    timeout: float | None = None  # s of silence
    start_timeout: float = 600.0  # s until the start mark
    transcript: TextIO | None = None
    misses: int = 3  # touches in a row without contact after which driver or program stop
    counted: bool = True  # whether the program itself counts them
    then: str = ""  # what to do when it breaks off; '': go on with it
    how: str = "--resume"  # what 'tango run' has to state to go on: --resume, and what the plan depends on
    simulated: bool = False  # the control stands in for a machine that does not exist
    quiet: float = 0.0  # s of silence before the first byte: it may still execute the program of another run
    feed: float | None = None  # mm/min of protected moves in the programs of the post; None: they are rapid


def measure(
    cell: Cell,
    plan: Plan,
    wanted: Wanted,
    post: Callable[[Plan], Sequence[Program]],
    watch: Callable[[News], None],
    confirm: Callable[[Plan, Program], None],
    most: int | None = None,
    keep: Callable[[Plan, Sequence[Program]], Sequence[Program]] = lambda part, programs: programs,
    ready: Callable[[Program, bool], None] = lambda program, brought: None,
) -> dict[str, Any]:
    """cell, its plan, what is wanted, how to post a plan → provenance of the readings that are on disk now.

    `most` touches are made, the next ones of the plan; the others can be made by resuming. `keep` writes the programs, and says
    where; before that the protocol has looked at each, and the sensors have been read.

    A plan that is posted as several programs is run one after the other, over the same port, into the same readings.
    `confirm` is asked before the first byte of each is sent; it raises what stops the run. `ready` is asked the same when a person
    who brings the program to the control (`brought`) has heard which file that is. Raises InputError before anything is
    opened, LinkError when the port does not open or the run does not end; then what is measured is in the partial files.
    """
    protocol, address = usable(wanted.port, wanted.protocol)  # a port that cannot be meant leaves no files either
    _replaceable(wanted.readings)
    file = wanted.readings.with_suffix(".journal")
    before, digest = _started(file, plan, wanted.post) if wanted.resume else ([], "")
    left = missing(before, plan)[:most]
    if not left:
        total = len(plan.touches)
        if most is None:
            watch(News(total, total, 0.0, None, "every touch has been measured: nothing was sent"))
        return _finish(before, digest, plan, wanted.readings, cell.folder)
    again = repeatable(before, plan)
    part = rest_of(cell, plan, again, left) if before or len(left) < len(plan.touches) else plan
    with _written("the program", "make room, or check the rights of the folder, and start again", NothingSentError):
        programs = post(part)
    quiet = silence_after(before, plan, wanted.timeout) or wanted.quiet
    tasks = [replace(task, run=plan) for task in _tasks(programs, again, left, wanted, quiet)]
    client, *_ = [
        protocol.Client(task, address.options) for task in tasks
    ]  # what it refuses leaves no files, and stops no run later
    for task in tasks:
        fits(address, task.program.encode())
    sensors = Watch(read_sensors(cell.folder))
    with _written("the program", "make room, or check the rights of the folder, and start again", NothingSentError):
        programs = keep(part, programs)

    def agreed(number: int) -> None:
        """Asks, and says then what is to be done at the control: who reads from top to bottom starts nothing before."""
        task, program = tasks[number - 1], programs[number - 1]
        said = [f"part {number} of {len(tasks)}: {len(task.numbers)} touches"] if len(tasks) > 1 else []
        said += [there] if number == 1 and (there := said_before(address)) else []
        _announced(watch, task, said)
        confirm(task.plan, program)
        said = [beside_of(program)] if number == 1 and program.beside else []
        said += [f"the control has to have {program.file} now: it is not sent"] if client.brought else []
        said += [client.before] if client.before else []
        _announced(watch, task, said)
        ready(program, client.brought)

    transport = _opened(address)  # before the question: a program that starts while a person answers belongs to this run
    try:
        agreed(1)
        if not tasks[0].quiet:
            _rested(address, transport)
        sensors.start()
        if not before:
            _set_aside(file)
        journal = Journal(file, resume=bool(before))
        try:
            try:
                for number, (program, task) in enumerate(zip(programs, tasks, strict=True), 1):
                    if number > 1:
                        client = protocol.Client(task, address.options)
                        agreed(number)
                    journal.add(_sent(plan, program, task, wanted, (number, len(tasks))))
                    with _signals() as stop:
                        session = Session(
                            task,
                            client,
                            journal,
                            watch,
                            clock=_clock,
                            transcript=wanted.transcript,
                            stop=stop,
                            boot=boot(),
                            hidden=address.hidden,
                            sensors=sensors.values,
                        )
                        session.run(transport)
            except LinkError as error:
                then = wanted.then or f"'tango run {wanted.how}' makes the missing touches"
                advice = "" if isinstance(error, Moved) else f"; {then}"
                raise type(error)(f"{error} {_keep(journal, plan, wanted.readings, cell.folder, advice)}".rstrip()) from None
            then = "the night takes them from there" if wanted.then else ""  # no run is resumed in its folder
            return _finish(journal.entries, journal.digest, plan, wanted.readings, cell.folder, then, sensors.strange())
        finally:
            journal.close()
    finally:
        sensors.close()
        transport.close()


def _announced(watch: Callable[[News], None], task: Task, said: Sequence[str]) -> None:
    """who watches, task that comes next, what has to be known of it → told, in one line."""
    if said:
        watch(News(0, len(task.numbers), 0.0, None, "; ".join(said)))


def _opened(address: Address) -> Transport:
    """address → open transport, of which nothing is asked yet. Raises NothingSentError where the port does not open."""
    with _nothing_sent():
        return open_port(address)


def _rested(address: Address, transport: Transport) -> None:
    """address, open transport → looked into, now that somebody has said that nothing moves. Raises NothingSentError."""
    with _nothing_sent():
        look_into(address, transport)


@contextlib.contextmanager
def _nothing_sent() -> Iterator[None]:
    """→ within it, a port that does not open is one over which nothing was sent."""
    try:
        yield
    except RefusedError:
        raise
    except LinkError as error:
        raise NothingSentError(
            f"{error} Nothing was sent: switch the control on, or correct the port (--port, or controller.port in tango.yaml), and "
            "start again"
        ) from None


@contextlib.contextmanager
def _written(what: str, then: str, kind: type[LinkError] = LinkError) -> Iterator[None]:
    """what is written, what to do when it cannot be, kind of error → within it, an error of the disk becomes one that says so."""
    try:
        yield
    except OSError as error:
        where = f" to {error.filename2 or error.filename}" if error.filename else ""
        raise kind(f"{what} cannot be written{where} ({error.strerror or error}): {then}") from None


def silence_after(before: Sequence[Entry], plan: Plan, timeout: float | None = None) -> float:
    """journal of an earlier run, its plan, --timeout → s of silence that prove that the control executes its program no more.

    Between two touches a control prints nothing. One that has said that its program came to its end needs no proof.
    """
    end = next((entry for entry in reversed(before) if isinstance(entry, End | ProgramSent)), None)
    if end is None or (isinstance(end, End) and end.stands):
        return 0.0
    return min(QUIET + 1.5 * max(durations(plan).values()), math.inf if timeout is None else timeout)


def _clock() -> float:
    """→ s that always pass, those for which this computer is suspended included where it counts them."""
    counting = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic() if counting is None else time.clock_gettime(counting)


@contextlib.contextmanager
def _signals() -> Iterator[Callable[[], int]]:
    """→ how often somebody has asked for an end (Ctrl-C, or the system): noticed between two bytes, never in half an entry."""
    asked: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield lambda: 0
        return
    ends = [signal.SIGINT, *endings()]
    before = {number: signal.signal(number, lambda received, frame: asked.append(received)) for number in ends}
    try:
        yield lambda: len(asked)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _started(file: Path, plan: Plan, post: str) -> tuple[list[Entry], str]:
    """journal of a run, plan and post of today → its entries, its hash. Raises InputError for none, or another's."""
    entries, _ = read_journal(file)
    sent = next((entry for entry in entries if isinstance(entry, ProgramSent)), None)
    if sent is None:
        raise InputError(f"{file}: no run was started; leave --resume out")
    if sent.plan_hash != plan_hash(plan):
        state = "" if sent.how == "--resume" else f": 'tango run {sent.how}' goes on with it"
        raise InputError(
            f"{file}: found a run of plan {sent.plan_hash}; the cell now makes plan {plan_hash(plan)}. "
            "Readings of two plans do not go together: restore the files of the cell and state the same --obstructed and --until"
            f"{state}, or run the whole plan without --resume"
        )
    other = {entry.controller.get("post", post) for entry in entries if isinstance(entry, ProgramSent)} - {post}
    if other:
        raise InputError(
            f"{file}: found a run with post {', '.join(sorted(other))}; the cell now states {post}. Another post "
            "has other frames and another rounding: state the post as it was, or run the whole plan without --resume"
        )
    _fit(file, entries, plan)
    return entries, look_at(file).lines[-1].digest


def _fit(file: Path, entries: Sequence[Entry], plan: Plan) -> None:
    """Raises InputError for readings that are none of this plan, although its hash is the same: the journal was changed."""
    touches = {touch.number: touch for touch in plan.touches}
    for number, entry in enumerate(entries, 1):
        if not isinstance(entry, Reading):
            continue
        touch = touches.get(entry.touch)
        if touch is None or touch.facet != entry.facet or len(entry.position) != len(plan.machine.names):
            raise InputError(
                f"{file}:{number}: a reading of touch {entry.touch}, facet {entry.facet!r}, which the plan does not have"
            )


def protocol_of(port: str, default: str) -> tuple[protocols.Module, Address]:
    """port's URL, protocol of the post → (module of the protocol, address). Raises InputError for what the URL cannot mean."""
    named, wanted = spoken(port), linked(port)
    if named is not None and wanted not in (None, named):
        scheme = port.partition("://")[0]
        raise InputError(f"port {shown(port)!r}: link: found {wanted!r}; allowed: {named}, which {scheme}:// speaks, or no link=")
    name = named or wanted or default
    if name not in protocols.names():
        raise InputError(f"port {shown(port)!r}: link: found {name!r}; allowed: {', '.join(protocols.names())}")
    module = protocols.load(name)
    return module, parse(port, {**module.OPTIONS, "link": tuple(protocols.names())})


def usable(port: str, default: str) -> tuple[protocols.Module, Address]:
    """port's URL, protocol of the post → as `protocol_of`, and what its URL names has been looked at, too: nothing is opened.

    Raises InputError for what no run can use.
    """
    module, address = protocol_of(port, default)
    foreseen(address)
    module.Client.named(address.options)
    return module, address


def fitting(port: str, default: str, plan: Plan) -> None:
    """port's URL, protocol of the post, plan of a run → nothing.

    Raises InputError for what the URL cannot mean, LacksSettingError with the whole URL where the plan needs more of it.
    """
    module, address = protocol_of(port, default)
    try:
        module.Client.fits(plan, address.options)
    except LacksSettingError as error:
        url = completed(shown(port), error.setting)
        raise LacksSettingError(f"port {shown(port)!r}: {error}: {url}", error.setting) from None


def _tasks(programs: Sequence[Program], again: tuple[int, ...], left: tuple[int, ...], wanted: Wanted, quiet: float) -> list[Task]:
    """programs of one plan, numbers in the run of its touches: repeated ones, then those left → a task for each program."""
    numbers, tasks, done = (*again, *left), [], 0
    for program in programs:
        ahead = done + len(program.plan.touches)
        tasks.append(_task(program, numbers[done:ahead], max(len(again) - done, 0), wanted, quiet if done == 0 else 0.0))
        done = ahead
    return tasks


def _task(program: Program, original: tuple[int, ...], again: int, wanted: Wanted, quiet: float) -> Task:
    part = program.plan
    seconds = durations(part)
    patience = [FLOOR + TIMES * seconds[touch.number] for touch in part.touches]
    patience[0] += 2 * ALIVE_TIME  # of the move that proves the probe alive
    patience.append(FLOOR + TIMES * max(seconds.values()))  # the parting retract
    if wanted.timeout is not None:
        patience = [wanted.timeout] * len(patience)
    start = wanted.start_timeout if wanted.timeout is None else wanted.timeout
    due = tuple(QUIET + 1.5 * seconds[touch.number] for touch in part.touches)
    return Task(
        part,
        program.text,
        program.mark,
        program.letters,
        tuple(patience),
        original,
        min(again, len(original)),
        start,
        summed=program.summed,
        nonce=secrets.randbelow(0x7FFFFFFE) + 1,
        quiet=quiet,
        misses=wanted.misses,
        counted=wanted.counted,
        due=due,
    )


def _sent(plan: Plan, program: Program, task: Task, wanted: Wanted, part: tuple[int, int]) -> ProgramSent:
    return ProgramSent(
        utc=datetime.now(UTC).isoformat(timespec="milliseconds"),
        tool_version=__version__,
        machine=plan.machine.name,
        controller={"post": wanted.post, "port": shown(wanted.port), **({"simulated": "yes"} if wanted.simulated else {})},
        plan_hash=plan_hash(plan),
        program_hash=program.mark,
        touches=task.original[task.again :],
        part=part,
        how=wanted.how,
        expected_s=round(sum(duration(program.plan, wanted.feed).values()), 1),
    )


def _set_aside(file: Path) -> None:
    """Keeps the journal of an earlier run under the time of its last entry; nothing that was measured is ever deleted."""
    with _written("the journal of the run before", "nothing was started"):
        if not file.exists():
            return
        stamp = datetime.fromtimestamp(file.stat().st_mtime, UTC).strftime("%Y%m%dT%H%M%S%f")
        other = file.with_name(f"{file.stem}.{stamp}.journal")
        if other.exists():  # a rename would replace it
            raise LinkError(f"{other} is there already; move it away. Nothing was started")
        file.rename(other)


def _replaceable(readings: Path) -> None:
    """readings of a run → nothing. Raises InputError where a file that it writes at its end is a folder, a device or a pipe.

    After the last touch it would be too late: reading a pipe waits for ever, and a device may have no end.
    """
    whole = (readings, _partial(readings))
    for file in (file for one in whole for file in (one, one.with_suffix(".json"), origin_file(one))):
        if file.exists() and not file.is_file():
            raise InputError(
                f"{file}: found a folder, a device or a pipe, where a run writes its readings; allowed: a file, or nothing. "
                "Move it away. Nothing was started"
            )


def _partial(file: Path) -> Path:
    return file.with_name(f"{file.stem}.partial.csv")


def _keep(journal: Journal, plan: Plan, file: Path, folder: Path, advice: str) -> str:
    """Writes the partial files; → a sentence that says where and what to do."""
    readings = readings_of(journal.entries, plan)
    if readings is None:
        return ""
    try:
        origin = provenance(journal.entries, plan, journal.digest)
        _write(_partial(file), readings_text(readings), origin)
        write_origin(_partial(file), folder, "measured", run=origin)
    except OSError as error:
        return (
            f"What was measured is in {journal.file}; {_partial(file)} could not be written ({error.strerror}): make room{advice}."
        )
    return f"What was measured is in {_partial(file)}{advice}."


def _finish(
    entries: Sequence[Entry],
    digest: str,
    plan: Plan,
    file: Path,
    folder: Path,
    then: str = "",
    strange: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    readings = readings_of(entries, plan)
    assert readings is not None  # nothing is missing, and a plan has touches
    origin = provenance(entries, plan, digest) | ({"no_temperature": dict(strange)} if strange else {})
    journal = file.with_suffix(".journal")
    how = next((entry.how for entry in entries if isinstance(entry, ProgramSent)), "--resume")
    with _written(f"every touch is in {journal}, but the readings", then or f"make room, then 'tango run {how}' writes them"):
        text = readings_text(readings)
        same = file.is_file() and file.read_text(encoding="utf-8") == text  # of this run, which was finished before
        kept = None if same else set_aside(file)
        _write(file, text, origin)
        write_origin(file, folder, "measured", kept, origin)
    for old in (_partial(file), _partial(file).with_suffix(".json"), origin_file(_partial(file))):
        with contextlib.suppress(OSError):  # what is in it is in the readings too
            old.unlink(missing_ok=True)
    return origin


def _write(file: Path, text: str, origin: dict[str, Any]) -> None:
    write_text(file, text)
    write_text(file.with_suffix(".json"), json.dumps(origin, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
