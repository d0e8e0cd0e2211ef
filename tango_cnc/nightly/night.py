"""One night from lock to message. Whatever fails on the way, it ends with a record and with words for somebody.

    lock → what was left behind → preflight → measure → analyse → verdict → keep → tell

Nothing moves before every point of the preflight has passed. The history has the night before anybody gets a message.
"""

from __future__ import annotations

import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ..files.nightly import Nightly
from ..files.origin import cell_texts
from ..history import FORMAT, Knowledge
from ..history.former import formers
from ..history.records import stamp_of
from ..records import InputError, LinkError, NothingSentError, TangoError
from ..report.age import measured_on, nights_old
from ..report.texts import texts, texts_of
from ..report.tonight import is_unsure
from ..texts import say
from .broken import stopped, unexplained
from .dates import dated, night_of
from .edited import asked, edited
from .last_known import as_known_last
from .left_behind import MISSED, UNKEPT, packed, put_on_record, with_left
from .mail import message
from .ports import Busy, Delivery, Disk, Mail, Ports, PreflightPoint
from .suspects import to_check
from .words import headline

REACHED = "# has reached "  # below a message that waits for others
EXIT = {"good": 0, "changed": 1, "out_of_limits": 1, "doubtful": 1, "not_measured": 3}


def exit_of(record: Mapping[str, Any]) -> int:
    """record of a night → exit status: 0 only where its page says a plain Yes, so 1 of a limit that it may be beyond, too."""
    return 1 if is_unsure(record) else EXIT[record["verdict"]]


def day_of(moment: datetime) -> float:
    """moment → days since 1970-01-01 UTC."""
    return moment.timestamp() / 86_400


def night(machine: str, cell: str, settings: Nightly, world: Ports) -> dict[str, Any]:
    """machine, folder of its cell, settings, the world → record of the night (tango-night/1), kept and told.

    Raises nothing that a night can meet: what fails is in the record.
    """
    begun = world.clock.now()
    stamp = begun.astimezone(UTC).strftime("%Y-%m-%dT%H%M%SZ")
    base: dict[str, Any] = {
        **{"format": FORMAT, "machine": machine, "cell": cell, "night": night_of(begun)},
        **{"start_utc": stamp_of(begun), "kind": "none", "status": "failed", "why": "", "verdict": "not_measured"},
        **{"preflight": [], "touches": 0, "planned": 0, "machine_time_s": 0.0, "alarms": [], "limits": []},
        "owner": settings.owner or None,
        **({"deputy": settings.deputy} if settings.deputy else {}),
        **({"limits_for": settings.limits_for} if settings.limits_for else {}),
        "artefacts": {"folder": f"nights/{stamp}"},
    }
    left = [*world.noticed]
    # The history is asked once before the machine moves and once after it: minutes may lie between, and answers of somebody.
    before, after = (replace(world, past=world.past.of_now()) for _ in range(2))
    locked = False
    try:
        with world.lock:
            locked = True
            left += put_on_record(machine, cell, before, settings.every_days, begun)
            base |= known_before(machine, before, cell)
            base |= dated(base, before.past, machine, begun, settings.every_days)
            world.disk.begin(stamp, base["start_utc"])
            found, knowledge, files, readings = _measured(settings, before, after, day_of(begun))
            record = asked(base | found | _edited(machine, cell, after, stamp, found))
            return _kept(record, knowledge, files, readings, settings, world, stamp, left)
    except Busy as error:
        record, stamp = _refused(base, error, world, stamp)
        record = record | _of_nights_before(record, settings, world, begun, stamp, locked)
        return _kept(record, None, {}, None, settings, world, stamp, left)
    except Exception as error:  # whatever it is: no night ends without a message
        record = base | {"why": sentence(error)}
        record = _of_nights_before(record, settings, world, begun, stamp, locked) | record
        return _kept(record, None, {}, None, settings, world, stamp, left)


def _edited(machine: str, cell: str, world: Ports, stamp: str, found: Mapping[str, Any]) -> dict[str, Any]:
    """→ files of the cell that were changed since the last night that measured; {} of a night whose run came to nothing.

    What refuses a night may be what was changed: a probe that is longer in the file, and a facet that is not where it was.
    """
    refused = any(not p["passed"] for p in found["preflight"])
    if not found.get("touches") and not refused:
        return {}
    try:
        now = cell_texts(Path(cell)) if refused else None
        return edited(world.past, world.disk, machine, stamp, found.get("terms"), now)
    except (TangoError, OSError):  # what is wrong with the history is reported with what could not be kept
        return {}


def _refused(base: dict[str, Any], error: Busy, world: Ports, stamp: str) -> tuple[dict[str, Any], str]:
    """what is known, who has the folder, the world, stamp → record of a night that was not begun, and a stamp of its own.

    Two timers may begin in the same second: under the stamp of the night at work this one would take away its mark and its files.
    """
    own = f"{stamp}-refused-{world.clock.now():%f}"
    record = base | {
        "status": "refused",
        "why": say("night.night.at_work_this_folder", by=error.by),
        "artefacts": {"folder": f"nights/{own}"},
    }
    return record, own


def _of_nights_before(
    record: dict[str, Any], settings: Nightly, world: Ports, begun: datetime, stamp: str, locked: bool
) -> dict[str, Any]:
    """record of a night that was refused or came to nothing, settings, the world, when it began, its stamp, whether it has the lock
    → what is known of the nights before, those that are not on record yet with them.

    The message names a history that cannot be read with what could not be kept.
    """
    machine, cell = record["machine"], record["cell"]
    try:  # it may have come to nothing before the history was asked
        known = known_before(machine, world, "" if record["status"] == "refused" else cell)
    except (TangoError, OSError):
        return {} if record["status"] == "refused" else {"unread": True}
    with suppress(TangoError, OSError):
        known = with_left(known, machine, world, settings.every_days, begun, stamp, locked)
        known |= dated(known, world.past, machine, begun, settings.every_days)
    return known


def _measured(
    settings: Nightly, world: Ports, after: Ports, day: float
) -> tuple[dict[str, Any], Knowledge | None, dict[str, str], str | None]:
    """settings, the world before the machine moves and after it, day → members of the record, unknowns, files, text of the
    readings.
    """
    kind, why_kind, touches = world.analysis.choice(world.past, day)
    points = [room(world.disk, settings), *world.control.preflight(kind, touches)]
    found: dict[str, Any] = {"preflight": [p.as_json() for p in points], "asked": {"kind": kind, "why": why_kind}}
    failed = [p for p in points if not p.passed]
    if failed:
        found |= {"moved": True} if any(p.moving for p in failed) else {}
        return found | {"why": say("night.night.preflight_failed", found=failed[0].found), "do": failed[0].do}, None, {}, None
    try:
        measured = world.control.measure(kind, touches)
    except LinkError as error:
        found |= {} if isinstance(error, NothingSentError) else {"moved": True}
        return found | {"why": sentence(error), "kind": "none"}, None, {}, None
    found |= {
        **{"kind": kind, "planned": measured.planned, "machine_time_s": round(measured.seconds, 1)},
        "hashes": dict(measured.hashes),
    }
    if measured.simulated:
        found["simulated"] = True
    if measured.trouble:
        found["trouble"] = [measured.trouble]
    if measured.readings is None or not len(measured.readings):
        return found | {"kind": "none", "why": measured.why or say("night.night.no_touch_was_made")}, None, {}, measured.text
    found |= {"touches": len(measured.readings), "status": "partial" if measured.why else "complete", "why": measured.why}
    try:
        more, knowledge, files = world.analysis.analysed(after.past, day, kind, measured)
    except LinkError as error:  # the history went away: nothing is wrong with the readings, and nobody has judged them
        why = say("night.night.not_judged", touches=len(measured.readings), why=sentence(error))
        return (
            found | {"kind": "none", "status": "failed", "touches": 0, "why": why, "do": say("night.night.see_to_history")},
            None,
            {},
            measured.text,
        )
    except (
        Exception
    ) as error:  # a mistake of this program is no reason to lose a night: its readings are kept, somebody hears of it
        doubt = {"verdict": "implausible", "reasons": [sentence(error)]}
        more, knowledge, files = {"verdict": "doubtful", "plausible": doubt, "carried": False}, None, {}
    if measured.why and (plausible := more.get("plausible") or {}).get("reasons"):
        told = stopped(measured.why, len(measured.readings), measured.planned)
        more["plausible"] = {**plausible, "reasons": [told, *unexplained(plausible["reasons"])]}
    return found | more, knowledge, files, measured.text


def room(disk: Disk, settings: Nightly) -> PreflightPoint:
    """disk, settings → whether there is room for a night."""
    free = disk.free_mb()
    enough = free >= settings.free_mb
    found = say("night.night.mb_free" if enough else "night.night.mb_left", free=f"{free:.0f}")
    return PreflightPoint(
        "disk", enough, found, "" if enough else say("night.night.make_room_mb_needed", free_mb=f"{settings.free_mb:.0f}")
    )


def known_before(machine: str, world: Ports, cell: str = "") -> dict[str, Any]:
    """→ date of the last night that measured, and a sentence on each night since that did not; what its cell has under another
    name, of a machine that has nights only as long as an alarm there has no answer.
    """
    if not world.past.knows(machine):
        renamed = [f.told(machine, True) for f in formers(world.past, machine, Path(cell))] if cell else []
        return {"former": renamed} if renamed else {}
    for many in (MISSED + 1, 60):  # the last one that measured is nearly always among the first
        nights = world.past.nights(machine, last=many)
        last = next((n for n in nights if n.touches), None)
        if last is not None or len(nights) < many:
            break
    # One that began while the last one measured was refused by it: the machine was measured all the same.
    gone = [n for n in nights if last is None or n.start_utc > last.end_utc][:MISSED]
    found: dict[str, Any] = {} if last is None else {"last_measured": last.night, "last_verdict": last.verdict}
    known = world.past.latest_knowledge(machine)
    found |= {} if known is None else {"last_carried": known[0].night}
    waiting = [f.told(machine, False) for f in formers(world.past, machine, Path(cell)) if f.alarms] if cell else []
    found |= {"former": waiting} if waiting else {}
    return found | ({"unmeasured": [f"{n.night}: {n.headline}" for n in reversed(gone)]} if gone else {})


def _kept(
    record: dict[str, Any],
    knowledge: Knowledge | None,
    files: dict[str, str],
    readings: str | None,
    settings: Nightly,
    world: Ports,
    stamp: str,
    left: list[str],
) -> dict[str, Any]:
    """→ the record as it was kept; whoever is to be told has been told, or the message waits on disk."""
    world.ending()
    ended = world.clock.now()
    started = datetime.fromisoformat(record["start_utc"])
    record |= {"end_utc": stamp_of(ended), "duration_s": round(max((ended - started).total_seconds(), 0.0), 1)}
    for number, alarm in enumerate(record["alarms"], 1):
        own = {"id": f"{record['night']}-{started:%H%M%S}-{number}", "owner": settings.owner or None, "decision": None}
        alarm |= own if not alarm.get("goes_on") else {key: alarm.get(key) or own[key] for key in own}
    if record["verdict"] == "not_measured" and record["status"] != "refused":
        if stale := nights_old(measured_on(record), record["night"], settings.answers_for):
            record["stale_nights"] = stale
        with suppress(TangoError, OSError):  # an alarm that waits is not answered by a night that did not measure
            waiting, silent = as_known_last(world, record["machine"], day_of(ended), str(record["night"]))
            record |= ({"standing": waiting} if waiting else {}) | ({"unheard": silent} if silent else {})
    with suppress(TangoError, OSError):
        record |= to_check(world.past, record)
    record["headline"] = headline(record)
    trouble: list[str] = [*record.pop("trouble", ())]
    if readings is not None:
        files = {"readings.csv": readings, **files}
    for name, text in files.items():
        try:
            world.disk.write(stamp, name, text)
            record["artefacts"] = record["artefacts"] | {name.partition(".")[0]: name}
        except OSError as error:
            trouble.append(say("night.night.not_written", name=name, why=error.strerror or error))
    try:
        world.past.add_night(record, readings, knowledge)
        kept = True
    except (TangoError, OSError) as error:
        kept = False
        trouble.append(say("night.night.not_kept", why=sentence(error)))
        try:
            world.disk.write(stamp, UNKEPT, packed(record, readings, knowledge))
            world.disk.begin(stamp, record["start_utc"])  # one that came to nothing before it had begun is looked for by its mark
        except OSError as second:
            with suppress(OSError):  # a mark needs little room: by it the next night knows that there was one
                world.disk.begin(stamp, record["start_utc"])
            trouble[-1] = say("night.night.kept_nowhere", why=sentence(error), disk=sentence(second))
    _told(record, trouble, left, world, stamp, settings.templates)
    if kept:
        try:
            world.disk.ended(stamp)
        except OSError as error:
            record["trouble"] = [*trouble, str(error)]
    return record | ({"trouble": trouble} if trouble else {})


def _told(record: dict[str, Any], trouble: list[str], left: list[str], world: Ports, stamp: str, templates: Path | None) -> None:
    try:
        t = texts_of(templates)
    except InputError as error:  # a mistake in a text keeps no message from being sent
        t, trouble[:] = texts(), [*trouble, str(error)]
    subject, text = message(record, trouble, left, _newest(record["machine"], world), t=t)
    waiting = True
    try:
        world.disk.post(stamp, f"{subject}\n{text}")
    except OSError:
        waiting = False  # then it is sent without having been kept
    try:
        unsent = [item for item in world.disk.unsent() if item[0] != stamp]
    except OSError:
        unsent = []
    for old, words in [*unsent, (stamp, f"{subject}\n{text}")]:
        deliveries = delivered(world.disk, world.mail, old, words, waiting or old != stamp)
        if old == stamp:
            record["notifications"] = [vars(d) for d in deliveries]
            if not waiting and not any(d.sent for d in deliveries):
                trouble.append(say("night.night.not_sent"))


def delivered(disk: Disk, mail: Mail, stamp: str, words: str, waiting: bool = True) -> Sequence[Delivery]:
    """disk, mail, stamp and text of a message, whether it is in the outbox → what became of it, one a receiver.

    Who has it is written below it in the outbox, so that one dead receiver does not send it to the others every night.
    """
    lines = words.splitlines(keepends=True)
    has = tuple(line.removeprefix(REACHED).strip() for line in lines if line.startswith(REACHED))
    subject, _, text = "".join(line for line in lines if not line.startswith(REACHED)).partition("\n")
    deliveries = mail.send(subject, text, has)
    with suppress(OSError):  # then it stays where it is, and is sent once more
        if waiting and all(d.sent for d in deliveries):
            disk.sent(stamp)
        elif waiting and any(d.sent and d.to not in has for d in deliveries):
            disk.post(stamp, f"{subject}\n{text}" + "".join(f"{REACHED}{d.to}\n" for d in deliveries if d.sent))
    return deliveries


def _newest(machine: str, world: Ports) -> tuple[int, str] | None:
    """→ number of entries of the machine and hash of the newest: who keeps the message sees a history whose end was cut off."""
    try:
        return world.past.newest_hashes().get(machine)
    except (TangoError, OSError):
        return None


def sentence(error: Exception) -> str:
    """what went wrong → words for people; of a mistake of this program its kind and place."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'disk'}: {error.strerror}"
    if isinstance(error, (TangoError, OSError)):
        return str(error)
    frames = traceback.extract_tb(error.__traceback__)
    place = next((f"{Path(x.filename).name} {x.lineno}" for x in reversed(frames) if "tango_cnc" in x.filename), "")
    return say("night.night.mistake", kind=type(error).__name__, error=error, place=f", {place}" if place else "")
