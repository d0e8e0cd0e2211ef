"""One run from plan to readings: which touches are still to be made, the conversation, and the files it leaves.

readings.csv, readings.json              a complete run
readings.partial.csv, …partial.json      what an unfinished run has so far
readings.journal                         every reading as it came; the only thing that `--resume` believes
"""

from __future__ import annotations

import contextlib
import json
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib import import_module
from itertools import groupby
from pathlib import Path
from typing import Any, TextIO
from urllib.parse import parse_qsl, urlsplit

import numpy as np

from .. import __version__, duration
from ..files import readings_text, write_text
from ..plan import plan as make_plan
from ..plan import plan_hash
from ..records import Array, Cell, Indexation, InputError, LinkError, Plan, Touch
from . import protocols
from ._address import Address, parse, spoken
from ._client import Job
from ._readings import missing, provenance, readings_of
from .journal import Journal, read_journal
from .session import Moved, Session, Step, step_of
from .transport import open_port

FLOOR, TIMES = 30.0, 3.0  # silence allowed before a touch: s, and multiples of its predicted time


@dataclass(frozen=True)
class Program:
    """What the post made of a plan."""

    text: str
    mark: str  # in its start record
    letters: tuple[str, ...]  # axis letters of its records
    plan: Plan
    file: str = ""  # that it was written to


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


def measure(
    cell: Cell,
    plan: Plan,
    wanted: Wanted,
    post: Callable[[Plan], Sequence[Program]],
    watch: Callable[[Step], None],
    confirm: Callable[[Plan, Program], None],
) -> dict[str, Any]:
    """cell, its plan, what is wanted, how to post a plan → provenance of the readings that are on disk now.

    A plan that is posted as several programs is run one after the other, over the same port, into the same readings.
    `confirm` is asked before the first byte of each is sent; it raises what stops the run. Raises InputError before anything is
    opened, LinkError when the port does not open or the run does not end; then what is measured is in the partial files.
    """
    protocol, address = protocol_of(wanted.port, wanted.protocol)  # a port that cannot be meant leaves no files either
    file = wanted.readings.with_suffix(".journal")
    before = _started(file, plan) if wanted.resume else []
    left = missing(before, plan)
    if not left:
        total = len(plan.touches)
        watch(Step(total, total, 0.0, None, "every touch has been measured: nothing was sent"))
        return _finish(before, plan, wanted.readings)
    again = repeatable(before, plan)
    part = rest_of(cell, plan, again, left) if before else plan
    programs = post(part)
    jobs = _jobs(programs, again, left, wanted)
    client = protocol.Client(jobs[0], address.options)

    def announced(number: int) -> None:
        count, file = len(jobs[number - 1].numbers), programs[number - 1].file
        said = [f"part {number} of {len(jobs)}: {count} touches"] if len(jobs) > 1 else []
        said += [f"the control has to have {file} now: it is not sent"] if getattr(client, "brought", False) else []
        if said:
            watch(Step(0, count, 0.0, None, "; ".join(said)))

    announced(1)
    confirm(jobs[0].plan, programs[0])
    transport = open_port(address)
    try:
        if not before:
            _set_aside(file)
        journal = Journal(file, resume=bool(before))
        try:
            try:
                for number, (program, job) in enumerate(zip(programs, jobs, strict=True), 1):
                    if number > 1:
                        client = protocol.Client(job, address.options)
                        announced(number)
                        confirm(job.plan, program)
                    journal.add("segment", **_segment(plan, program, job, wanted), part=[number, len(jobs)])
                    with _signals() as stop:
                        Session(job, client, journal, watch, clock=_clock, transcript=wanted.transcript, stop=stop).run(transport)
            except LinkError as error:
                advice = "" if isinstance(error, Moved) else "; 'tango run --resume' makes the missing touches"
                raise LinkError(f"{error} {_keep(journal.entries, plan, wanted.readings, advice)}".rstrip()) from None
            return _finish(journal.entries, plan, wanted.readings)
        finally:
            journal.close()
    finally:
        transport.close()


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
    before = {
        number: signal.signal(number, lambda received, frame: asked.append(received)) for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield lambda: len(asked)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def follow(file: Path, watch: Callable[[Step], None], pause: Callable[[], None]) -> bool:
    """journal of a run that another program makes → whether it came to its end; every reading goes to `watch` as it is written.

    Raises InputError when there is no run.
    """
    if not file.exists():
        raise InputError(f"{file}: no such file; there is no run to follow")
    shown = done = total = 0
    ended: bool | None = None
    part = [1, 1]
    while ended is None:
        entries, _ = read_journal(file)
        for entry in entries[shown:]:
            if entry["kind"] == "segment":
                total, ended, part = max(total, done + len(entry["touches"])), None, entry.get("part", [1, 1])
            elif entry["kind"] == "reading":
                done += 1
                watch(step_of(entry, done, total))
            elif entry["kind"] == "refused":
                watch(Step(done, total, entry["time_s"], None, f"not believed: {entry['record']!r}: {entry['why']}"))
            elif entry["kind"] == "end":
                more = entry["complete"] and part[0] < part[1]
                ended = None if more else bool(entry["complete"])
                what = f"part {part[0]} of {part[1]}" if part[1] > 1 else "the run"
                watch(Step(done, total, 0.0, None, f"{what} has ended: {entry['why']}"))
        shown = len(entries)
        if ended is None:
            pause()
    return ended


def repeatable(entries: Sequence[Mapping[str, Any]], plan: Plan) -> tuple[int, ...]:
    """entries of a journal, its plan → up to three touches that look as differently as they can.

    They are of the indexation where the run stopped; where that has fewer than three readings, of those before it as well.
    """
    touches = {touch.number: touch for touch in plan.touches}
    good = [touches[entry["touch"]] for entry in entries if entry["kind"] == "reading" and entry["status"] == "ok"][::-1]
    last = good[min(3, len(good)) - 1].indexation if good else 0
    there = [touch for i, touch in enumerate(good) if i < 3 or touch.indexation == last]
    away = np.array([np.subtract(touch.standoff, touch.contact) for touch in there])
    chosen = [0] if there else []
    while len(chosen) < min(3, len(there)):
        likeness = np.abs(away @ away[chosen].T).max(axis=1)
        likeness[chosen] = np.inf
        chosen.append(int(np.argmin(likeness)))
    return tuple(sorted(there[i].number for i in chosen))


def rest_of(cell: Cell, plan: Plan, again: tuple[int, ...], left: tuple[int, ...]) -> Plan:
    """cell, its plan, touch numbers → plan of the touches `again`, then of those `left`, numbered from 1."""
    touches = {touch.number: touch for touch in plan.touches}
    wanted = [touches[number] for number in (*again, *left)]
    indexations = []
    for numbers in (again, left):
        for index, same in groupby(numbers, key=lambda number: touches[number].indexation):
            position = cell.strategy.indexations[index].position
            indexations.append(Indexation(position, tuple(touches[number].facet for number in same)))
    rest = make_plan(replace(cell, strategy=replace(cell.strategy, indexations=tuple(indexations))), "warn")
    as_before = len(rest.touches) == len(wanted) and np.allclose(_contacts(rest.touches), _contacts(wanted), rtol=0, atol=1e-6)
    if not as_before or [touch.facet for touch in rest.touches] != [touch.facet for touch in wanted]:
        raise InputError("the remaining touches cannot be planned as they were; run the whole plan again without --resume")
    return rest


def _contacts(touches: Sequence[Touch]) -> Array:
    return np.array([touch.contact for touch in touches])


def durations(plan: Plan) -> dict[int, float]:
    """plan → {touch number: predicted s from the touch before it, or from the start, to this one}."""
    result: dict[int, float] = {}
    spent = 0.0
    for move, seconds in zip(plan.moves, duration.of_moves(plan), strict=True):
        spent += seconds
        if move.kind == "probe":
            result[move.touch] = spent
            spent = 0.0
    return result


def _started(file: Path, plan: Plan) -> list[dict[str, Any]]:
    """journal of a run, the plan of today → its entries. Raises InputError when there is none or the plan is another."""
    entries, _ = read_journal(file)
    segment = next((entry for entry in entries if entry["kind"] == "segment"), None)
    if segment is None:
        raise InputError(f"{file}: no run was started; leave --resume out")
    if segment["plan_hash"] != plan_hash(plan):
        raise InputError(
            f"{file}: found a run of plan {segment['plan_hash']}; the cell now makes plan {plan_hash(plan)}. "
            "Readings of two plans do not go together: restore the files of the cell and state the same --obstructed, "
            "or run the whole plan without --resume"
        )
    return entries


def protocol_of(port: str, default: str) -> tuple[Any, Address]:
    """port's URL, protocol of the post → (module of the protocol, address). Raises InputError for what the URL cannot mean."""
    query = dict(parse_qsl(urlsplit(port).query)) if "://" in port else {}
    name = spoken(port) or query.get("link", default)
    if name not in protocols():
        raise InputError(f"port {port!r}: link: found {name!r}; allowed: {', '.join(protocols())}")
    module = import_module(f"{__package__}.{name}")
    return module, parse(port, {**module.OPTIONS, "link": tuple(protocols())})


def _jobs(programs: Sequence[Program], again: tuple[int, ...], left: tuple[int, ...], wanted: Wanted) -> list[Job]:
    """programs of one plan, numbers in the run of its touches: repeated ones, then those left → a job for each program."""
    numbers, jobs, done = (*again, *left), [], 0
    for program in programs:
        ahead = done + len(program.plan.touches)
        jobs.append(_job(program, numbers[done:ahead], max(len(again) - done, 0), wanted))
        done = ahead
    return jobs


def _job(program: Program, original: tuple[int, ...], again: int, wanted: Wanted) -> Job:
    part = program.plan
    seconds = durations(part)
    patience = [FLOOR + TIMES * seconds[touch.number] for touch in part.touches]
    patience.append(FLOOR + TIMES * max(seconds.values()))  # the parting retract
    if wanted.timeout is not None:
        patience = [wanted.timeout] * len(patience)
    start = wanted.start_timeout if wanted.timeout is None else wanted.timeout
    return Job(part, program.text, program.mark, program.letters, tuple(patience), original, min(again, len(original)), start)


def _segment(plan: Plan, program: Program, job: Job, wanted: Wanted) -> dict[str, Any]:
    return {
        "utc": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "tool_version": __version__,
        "machine": plan.machine.name,
        "controller": {"post": wanted.post, "port": wanted.port},
        "plan_hash": plan_hash(plan),
        "program_hash": program.mark,
        "touches": list(job.original[job.again :]),
    }


def _set_aside(file: Path) -> None:
    """Keeps the journal of an earlier run under the time of its last entry; nothing that was measured is ever deleted."""
    if file.exists():
        stamp = datetime.fromtimestamp(file.stat().st_mtime, UTC).strftime("%Y%m%dT%H%M%S%f")
        file.rename(file.with_name(f"{file.stem}.{stamp}.journal"))


def _partial(file: Path) -> Path:
    return file.with_name(f"{file.stem}.partial.csv")


def _keep(entries: list[dict[str, Any]], plan: Plan, file: Path, advice: str) -> str:
    """Writes the partial files; → a sentence that says where and what to do."""
    readings = readings_of(entries, plan)
    if readings is None:
        return ""
    _write(_partial(file), readings_text(readings), provenance(entries, plan))
    return f"What was measured is in {_partial(file)}{advice}."


def _finish(entries: list[dict[str, Any]], plan: Plan, file: Path) -> dict[str, Any]:
    readings = readings_of(entries, plan)
    assert readings is not None  # nothing is missing, and a plan has touches
    origin = provenance(entries, plan)
    _write(file, readings_text(readings), origin)
    for old in (_partial(file), _partial(file).with_suffix(".json")):
        old.unlink(missing_ok=True)
    return origin


def _write(file: Path, text: str, origin: dict[str, Any]) -> None:
    write_text(file, text)
    write_text(file.with_suffix(".json"), json.dumps(origin, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
