"""`tango nightly --status`: how the last nights went, what waits to be sent, and what comes next."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

from ..files import read_cell
from ..files.nightly import Nightly, history_of
from ..history import Decision, History, Night, Standing, opened
from ..history.answers import of_machine
from ..history.clock import asks, in_future
from ..history.clock import told as told_of
from ..history.former import Former, formers, of_folder
from ..link.lock import broken_off, cut_off, ended
from ..link.progress import minutes_left, newest_complete
from ..nightly.mail import answer
from ..records import TangoError
from ..report.age import due, measured_on, night_of_stamp, nights_old
from ..report.answer import Answer, May, measuring, of_no_night, said_broken_off, said_cut_off
from ..report.days import at, local_day
from ..report.morning import next_night
from ..report.newer import NewerAnswer, newer_answer
from ..report.repeated import as_found, shortened, stories
from ..report.texts import Texts, code
from ..report.tonight import by_now, by_tonight, is_over, is_unsure, only_set_up
from ..report.words import of_its_night
from ..state.changes import change
from ..texts import say
from ._answered import answer_now, run_without_report
from ._common import fitted, on_terminal, table, write_json
from ._handed import whole
from ._shop import ENDED, headlines, looked_at, note_simulated
from ._unreadable import machine_of


@dataclass(frozen=True)
class Status:
    """What is known of the nights of a cell without measuring."""

    name: str  # of the machine; empty: nobody says it
    trouble: str | None  # why no night can begin
    nights: Sequence[Night]  # newest first
    said: Mapping[int, str]  # entry: its headline
    alarms: Sequence[Mapping[str, Any]]  # without an answer
    held: Sequence[tuple[Mapping[str, Any], Decision]]  # answered and not closed, with who has done that
    coming: Mapping[str, Any]  # the next night; empty: unknown
    standing: Standing | None  # as in the list of all machines
    stale: int  # nights since the machine was measured; 0: not old
    future: Night | None  # one that is left out, dated in the future
    renamed: Sequence[Former]  # what the cell has under other names
    waiting: Sequence[str]  # stamps of messages that are not sent
    unfinished: Sequence[str]  # stamps of nights that have begun and not ended
    cut: Sequence[str]  # stamps of those that nobody works on
    broken: float | None  # when a run broke off whose program may go on, s since 1970
    ended: Mapping[str, str]  # and how those ended that did
    left: int | None = None  # minutes that a run or a night still takes which is at work
    newer: NewerAnswer | None = None  # the answer of a report of readings after the newest night
    unsure: bool = False  # whether nobody knows if the last night that measured was within its limits
    told: Answer | None = None  # the answer of its page, where that was asked for
    ran: str = ""  # when a run after the newest night began of which no report was written (UTC)

    @property
    def late(self) -> bool:
        """→ whether a night is missing."""
        return self.standing is None or self.standing.late

    @property
    def wants_somebody(self) -> bool:
        """→ whether somebody has to do something."""
        wanted = self.standing is None or self.standing.wants_somebody or self.stale > 0
        wanted |= self.future is not None and asks(self.future)
        return bool(
            wanted
            or self.cut
            or self.broken
            or self.alarms
            or self.held
            or self.unsure
            or self.by_newer("no", "but")
            or self.trouble is not None
            or any(f.alarms for f in self.renamed)
        )

    def by_newer(self, *may: May) -> bool:
        """answers → whether newer readings have given the answer of the page, and it is one of them."""
        return self.told is not None and self.told.by_newer(*may)

    def as_json(self) -> dict[str, Any]:
        """→ members of tango-nightly-status/1."""
        return {
            "format": "tango-nightly-status/1",
            "machine": self.name,
            "late": self.late,
            "stale_nights": self.stale,
            "waiting": self.waiting,
            "unfinished": self.unfinished,
            "cut_off": self.cut,
            "measuring_minutes_left": self.left,
            "newer_no": self.by_newer("no"),
            "newer_but": self.by_newer("but"),
            "run_without_report": self.ran or None,
            "newer_beside": (self.told.beside if self.told is not None else "") or None,
            "run_broke_off": None if self.broken is None else f"{datetime.fromtimestamp(self.broken, UTC):%Y-%m-%dT%H:%M:%SZ}",
            "trouble": self.trouble,
            "left_out": None if self.future is None else vars(self.future),
            "open_alarms": list(self.alarms),
            "held_alarms": [{**alarm, "decision": d.action, "owner": d.owner, "until": d.until} for alarm, d in self.held],
            "nights": [vars(n) | {"headline": self.said.get(n.entry) or n.headline} for n in self.nights],
            "next": self.coming or None,
            "former": [
                {
                    "machine": f.machine,
                    "nights": f.nights,
                    "last": f.last,
                    "open_alarms": list(f.alarms),
                    "held_alarms": list(f.held),
                }
                for f in self.renamed
            ],
        }


def status(
    folder: Path, settings: Nightly, wrong: TangoError | None, where: str | None, disk: Any, json_file: str | None, t: Texts
) -> int:
    """folder of a cell, its settings, what is wrong with them, --history, its disk, --json, texts → exit status: 1 where somebody
    has to do something.
    """
    name = ""
    if not folder.is_dir():
        read_cell(folder)  # says that there is no such cell
    try:
        name = read_cell(folder).machine.name
    except TangoError as error:
        wrong = wrong or error
    place = history_of(folder, settings, where)
    with opened(looked_at(place)) as all_of_it:
        history = all_of_it.as_of(lambda: datetime.now(UTC))
        name = name or machine_of(folder, history.machines())
        found = _read(history, name, folder, settings, place, disk, None if wrong is None else str(wrong))
        if json_file is None or found.newer is not None:
            with suppress(TangoError):  # what is wrong with the cell is printed on its own line
                found = replace(found, told=answer_now(folder, read_cell(folder).machine, place, found.newer, t))
        if json_file is None:
            note_simulated(history, name, t)
    if not write_json(json_file, found.as_json()):
        first, *lines = _lines(found, folder, where, t)
        told = _answer(folder, found, t)
        ran = t("web.ran_since", date=at(found.ran, t)) if found.ran and found.left is None else ""
        do = t("web.ran_since_do")
        for line in (first, *([f"  {told}"] if told else []), *([f"  {ran} {do}"] if ran else []), *lines):
            click.echo(fitted(whole(line)))
    return int(found.wants_somebody)


def _answer(folder: Path, known: Status, t: Texts) -> str:
    """cell, its status, texts → whether parts may be made, as on its page."""
    left = known.left
    busy = "" if left is None else t("web.left_short" if left else "web.begun_short", minutes=left)
    if (told := known.told) is not None:
        told = measuring(told, t) if busy else told
        word = ", ".join(x for x in (told.word, busy or told.old) if x)
        lines = (f"{word}.", told.why, f"{told.numbers}." if told.numbers else "", told.moved, told.soon)
        return f"{t('may.ask')} {' '.join(x for x in lines if x)}"
    if busy:
        return f"{t('may.ask')} {t('may.measuring')}, {busy}. {t('web.wait_there')}"
    former = (*said_cut_off(known.cut, known.ended), *said_broken_off(known.broken))
    if (moving := of_no_night(former, t)) is not None:
        return f"{t('may.ask')} {moving.word}. {moving.why}"
    ran = newest_complete(folder)
    why = t("may.ran" if (folder / "report.html").is_file() else "may.ran_bare", date=at(ran, t)) if ran else t("may.never")
    return f"{t('may.ask')} {t('may.unknown')}. {why}"


def _read(
    history: History, name: str, folder: Path, settings: Nightly, place: str | Path, disk: Any, trouble: str | None
) -> Status:
    """history, machine, folder of its cell, settings, where the history is, disk, what is wrong → its status."""
    now = datetime.now(UTC)
    today = f"{now.astimezone():%Y-%m-%d}"
    renamed = formers(history, name, folder, of_folder(place, folder))
    nights = history.nights(name, last=7) if name in history.machines() else ()
    newest = max(nights, key=lambda n: n.end_utc, default=None)  # one that was refused began after the one at work
    record = history.night(newest.entry).record if newest else {}
    last = next((n for n in nights if n.verdict != "not_measured"), None)
    before = record if last is None or newest is None or last.entry == newest.entry else history.night(last.entry).record
    standings = history.fleet(datetime.now(UTC).isoformat(), settings.late_hours)
    cut = cut_off(folder)
    return Status(
        name,
        trouble,
        nights,
        headlines(history, nights),
        _by_tonight(history.open_alarms(name, today=today), record) if nights else (),
        _held(history, name, today, record) if nights else (),
        next_night(record, history.decisions(name), before) if nights else {},
        next((s for s in standings if s.machine == name), None),
        nights_old(measured_on(record, before), due(now, before.get("start_utc")), settings.answers_for) if nights else 0,
        in_future(history, name),
        renamed,
        [stamp for stamp, _ in disk.unsent()],
        [stamp for stamp, _ in disk.unfinished()],
        cut,
        broken_off(folder),
        ended(folder, cut),
        minutes_left(folder, time.time()),
        newer_answer(folder, record.get("end_utc")),
        is_unsure(before) if nights else False,
        ran=run_without_report(folder, record),
    )


def _held(history: History, name: str, today: str, record: Mapping[str, Any]) -> Sequence[tuple[Mapping[str, Any], Decision]]:
    """history, machine, local date, record of its newest night → alarms that somebody has answered and nobody has closed, a change
    and its way back once, with what was decided.
    """
    known = of_machine(history, name, today)
    held = known.held()
    first = [key for key in held if not stories([known.newest[key][1]]) & set(held) - {key}]
    told = _by_tonight([known.newest[key][1] for key in first], record)
    return [(alarm, known.decided[key]) for key, alarm in zip(first, told, strict=True)]


def _by_tonight(alarms: Sequence[Mapping[str, Any]], record: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
    """alarms, record of the newest night → the same in the words of that night where it has measured them, what does most to a part
    first.
    """
    stands = {a["id"]: a for a in record.get("standing") or ()}

    def told(a: Mapping[str, Any]) -> Mapping[str, Any]:
        if (one := stands.get(a["id"])) is None:
            return a
        return {**a, **{key: one[key] for key in ("text", "now", "total")}, **by_tonight(one)}

    def place(a: Mapping[str, Any]) -> tuple[bool, bool, float]:
        probe = only_set_up(a) and change(a.get("cause")).of_the_probe
        return is_over(a), probe, -abs(a.get("on_part_um") or 0.0)

    return sorted(map(told, alarms), key=place)


def _lines(found: Status, folder: Path, where: str | None, t: Texts) -> Iterator[str]:
    """status, folder of the cell, --history, texts → what is printed."""
    word = t(f"cli.nightly.{_first_word(found)}")
    unknown = found.stale and not found.by_newer("no")  # else its readings know what the nights do not
    yield f"{found.name}: {t('cli.nightly.stale', nights=found.stale) if unknown else word}"
    if unknown:
        yield f"  {t('morning.old_todo')}"
    if found.trouble is not None:
        yield "  " + t("cli.nightly.cannot_begin", why=found.trouble)
    if found.future is not None:
        yield f"  {t.of(told_of(found.future))}"
    for f in found.renamed:
        if f.alarms or f.held or not found.nights:
            yield f"  {t.of(f.told(found.name, not found.nights))}"
    yield from _nights(found, t)
    for alarm in found.alarms:
        command = answer(alarm["id"], str(folder), where)
        yield "  " + t("cli.nightly.open_alarm", id=alarm["id"], text=_told(alarm, found), command=command)
    for alarm, d in found.held:
        command = answer(alarm["id"], str(folder), where, d.owner)
        who = say("cli.nightly.ignores" if d.action == "ignore" else "cli.nightly.has", **_of_decision(d))
        yield "  " + t("cli.nightly.held_alarm", id=alarm["id"], text=_told(alarm, found), who=who, command=command)
    for stamp in found.waiting:
        yield "  " + t("cli.nightly.waits", stamp=stamp)
    for stamp in found.unfinished:
        key = ENDED.get(found.ended.get(stamp, ""), "cut_off" if stamp in found.cut else "begun")
        yield "  " + t(f"cli.nightly.{key}", stamp=stamp if key == "begun" else night_of_stamp(stamp))
    if found.coming:
        yield "  " + t("cli.nightly.next", kind=code(found.coming["kind"]), why=found.coming["why"])


def _first_word(found: Status) -> str:
    """status → the key of what stands first: nobody reads on behind "on time" where something has to be looked at."""
    if not found.nights:
        return "no_night"
    if found.cut or found.broken:
        return "look_first"
    if found.late:
        return "late"
    return "nothing_measured" if found.nights[0].verdict == "not_measured" else "on_time"


def _told(alarm: Mapping[str, Any], found: Status) -> str:
    """open alarm, status → its sentence with the date of the night that found it, and as it is by now."""
    night = str(alarm["id"])[:10]
    dated = as_found(alarm["text"], {"alarms": [{**alarm, "night": night}]})
    older = bool(found.nights) and found.nights[0].night > night
    return str(by_now(of_its_night(dated, night) if older else dated, alarm))


def _of_decision(d: Decision) -> dict[str, str]:
    """decision that closes nothing → who has made it, since when, until when."""
    return {"owner": d.owner, "date": local_day(d.utc) if d.utc else "", "until": d.until or ""}


def _nights(found: Status, t: Texts) -> Iterator[str]:
    """status, texts → a line a night."""
    rows = [[""] * 5]  # no heads
    titles = shortened([found.said.get(n.entry) or n.headline for n in found.nights])
    for n, text in zip(found.nights, titles, strict=True):
        rows.append([n.night, *(t.of(code(word)) for word in (n.kind, n.status, n.verdict)), " ".join(t.of(text).split())])
    columns = on_terminal()
    listed = table(rows, "<<<<<", None if columns is None else columns - 2)
    yield from (f"  {line}" for line in listed.splitlines() if line.strip())
