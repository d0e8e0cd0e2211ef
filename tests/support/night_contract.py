"""What docs/nightly.md says of every night, held against every night of a year, by who has read that page only.

It remembers what each night said and does not ask the history, which cannot show what it has lost. After a power cut nobody knows
whether the night wrote its record; only then does it read the history.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, date, datetime, timedelta
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from support.years import Year

BEGUN = date(2026, 1, 1)
KINDS = {"complete": ("full", "check"), "partial": ("full", "check"), "failed": ("none",), "refused": ("none",)}
CLOSES = ("accept", "repaired")
LISTED = 7  # nights without a measurement that are on record one by one
COVER = 1.96  # standard deviations of an interval of 95 %


@dataclass
class Contract:
    """What the nights so far have said."""

    last: Mapping[str, Any] | None = None  # record of the last night that measured, where nothing is uncertain since
    measured: str = ""  # date of the last night that measured
    carried: str = ""  # date of the last night that was believed
    full: str = ""  # date of the last whole full night
    first: str = "9999"  # date of the first night on record
    sure: bool = True  # whether all nights so far are known here
    told: dict[str, Mapping[str, Any]] = field(default_factory=dict)  # alarms by id, as the last night told them
    answers: dict[str, tuple[str, str]] = field(default_factory=dict)  # by id of the alarm: action, until
    later: str = ""  # date of a whole full night that the history did not take, and may have taken later
    repaired: bool = False  # somebody has repaired something since the last full night
    heard: int = 0  # messages
    twice: set[str] = field(default_factory=set)  # messages of a night that was cut off: they may come again

    def decided(self, alarm: str, action: str, until: str | None) -> None:
        """id, action, until → remembered."""
        self.answers[alarm] = action, until or ""
        self.repaired |= action == "repaired"

    def cut_off(self, year: Year) -> None:
        """A night that power ended: what there is of it, nobody has been told."""
        self.twice |= set(year.heard[self.heard :])
        self.heard = len(year.heard)
        self.last, self.sure = None, False
        for record in reversed(year.history.records(year.name, 1) if year.history.knows(year.name) else ()):
            self._remember(record)

    def ended(self, year: Year, number: int, record: Mapping[str, Any]) -> Iterator[str]:
        """year, number of the night, its record → what it does not keep of docs/nightly.md, as sentences."""
        kept = not record.get("trouble")
        yield from _members(record, number)
        if record["status"] != "refused":
            yield from self._choice(record)
            yield from self._before(record)
        yield from self._alarms(record)
        if kept:
            yield from _kept(year, record, number, self.first)
        yield from self._messages(year, record, kept)
        if kept:
            self._remember(record)
        else:
            self.last, self.sure = None, False
            if record["kind"] == "full" and record["status"] == "complete":
                self.later = record["night"]

    def _choice(self, record: Mapping[str, Any]) -> Iterator[str]:
        """Which kind of night it was, by what the nights before said of it."""
        kind = (record.get("asked") or {}).get("kind")
        if kind is None:
            return
        if record["touches"] and record["kind"] != kind:
            yield f"a {record['kind']} night where {kind} was chosen"
        if not self.sure:
            return
        newest = max(self.full, self.later)
        age, least = (_days(one, record["night"]) if one else 1000 for one in (self.full, newest))
        due = not self.carried or least > 30 or (self.repaired and newest == self.full)
        due |= self.last is not None and self.last["next"]["kind"] == "full"
        if due and kind != "full":
            yield "a check where a full night is due"
        known = self.last is not None and _days(self.last["night"], record["night"]) == 1
        if known and kind == "full" and not due and not self.repaired and age < 29:
            yield "a full night where nothing asks for it"

    def _before(self, record: Mapping[str, Any]) -> Iterator[str]:
        """What it says of the nights before."""
        if not self.sure or record.get("unread"):
            return
        for key, mine in (("last_measured", self.measured), ("last_carried", self.carried)):
            if (record.get(key) or "") != mine:
                yield f"the record says {record.get(key)} for {key}; the nights before say {mine or 'never'}"
        gap = _days(self.measured, record["night"]) - 1 if self.measured else 0
        if len(record.get("unmeasured") or ()) < min(gap, LISTED):
            yield f"{gap} nights are not measured, and {len(record.get('unmeasured') or ())} are named"

    def _alarms(self, record: Mapping[str, Any]) -> Iterator[str]:
        """Its alarms, and those of earlier nights: none is lost before somebody has closed it, and none comes after that."""
        ids = [a["id"] for a in record["alarms"]]
        if len(set(ids)) < len(ids):
            yield "two alarms under one id"
        for alarm in record["alarms"]:
            if alarm["id"] in self.told and not alarm.get("goes_on"):
                yield f"the alarm {alarm['id']} has the id of an older one"
            if alarm["decision"] is not None:
                yield f"the night raises the alarm {alarm['id']}, and it has an answer already"
        change = record.get("change")
        alarming = change is not None and change["p_value"] < change["limit"]
        if alarming and record["verdict"] != "doubtful" and not (ids or record.get("ignored") or record.get("repaired")):
            yield "a p-value below its limit, and no alarm"
        sudden = [a for a in record["alarms"] if not a.get("rate_per_day") and not a.get("repair")]
        if sudden and not alarming:
            yield f"the night raises the alarm {sudden[0]['id']}, and its own test found nothing"
        if not self.sure or record["status"] == "refused" or record.get("unread"):
            return
        waiting = {a["id"] for a in record.get("standing") or ()}
        silent = {a["alarm"] for a in record.get("unheard") or ()}
        closed = {key for key, (action, _) in self.answers.items() if action in CLOSES}
        part = {str(one) for a in (*self.told.values(), *record["alarms"]) for one in (a.get("goes_on") or {}).get("with") or ()}
        stories = [(key, str(a["undoes"]["alarm"])) for key, a in self.told.items() if a.get("undoes")]
        back = {b if a in closed else a for a, b in stories if a in closed or b in closed}  # who closes an end has closed the other
        ignored = {key for key, (action, until) in self.answers.items() if action == "ignore" and until >= record["night"]}
        back |= {b if a in ignored else a for a, b in stories if (a in ignored) != (b in ignored)}
        if wrong := waiting & (closed - set(ids)):
            yield f"the alarm {min(wrong)} stands, and is closed"
        if wrong := waiting & ignored:
            yield f"the alarm {min(wrong)} stands, and is ignored"
        if wrong := set(self.told) - closed - ignored - part - back - waiting - set(ids):
            yield f"the alarm {min(wrong)} is not closed, and is not told"
        if wrong := (ignored & set(self.told)) - part - silent - set(ids):
            yield f"the alarm {min(wrong)} is ignored, and the night does not say so"

    def _messages(self, year: Year, record: Mapping[str, Any], kept: bool) -> Iterator[str]:
        """Who hears of it, when, and how often."""
        stamp = record["artefacts"]["folder"].removeprefix("nights/")
        waiting = dict(year.disk.unsent())
        if year.mail_down == 0 and waiting:
            yield f"mail is up, and the message {min(waiting)} waits"
        new = year.heard[self.heard :]
        if again := [text for at, text in enumerate(new) if text in year.heard[: self.heard + at] and text not in self.twice]:
            yield f"a message comes twice: {again[0].splitlines()[0]}"
        own = [text for text in (*new, *waiting.values()) if record["artefacts"]["folder"] in text or stamp in text]
        newest = year.history.newest_hashes().get(year.name)
        if kept and newest is not None and not any(newest[1] in text for text in (*new, *waiting.values())):
            yield "the message does not have the hash of the newest entry"
        subject = f"({record['night']})"
        if kept and own and not any(subject in text.partition("\n")[0] for text in own):
            yield "the subject does not have the date of the night"
        said = [str(text) for text in record.get("left_behind") or ()]
        if own and (silent := [text for text in said if not any(text in words for words in own)]):
            yield f"the message does not say {silent[0]!r}"
        self.heard = len(year.heard)

    def _remember(self, record: Mapping[str, Any]) -> None:
        self.first = min(self.first, record["night"])
        self.told |= {a["id"]: a for a in record["alarms"]}
        if not record["touches"]:
            return
        self.sure = self.sure or self.last is not None
        self.last, self.measured = record, record["night"]
        self.carried = record["night"] if record.get("carried") else self.carried
        if record["kind"] == "full" and record["status"] == "complete":
            self.full, self.repaired = record["night"], False


def _days(one: str, two: str) -> int:
    return (date.fromisoformat(two) - date.fromisoformat(one)).days


def _members(record: Mapping[str, Any], number: int) -> Iterator[str]:
    """The members of the record, beside one another."""
    touches, status, verdict = record["touches"], record["status"], record["verdict"]
    if record["kind"] not in KINDS[status] or (touches > 0) != (status in ("complete", "partial")):
        yield f"a night of kind {record['kind']} and {touches} touches is {status}"
    if bool(record["why"]) != (status != "complete"):
        yield f"a night that is {status} says why: {record['why']!r}"
    if (verdict == "not_measured") != (touches == 0):
        yield f"the verdict of {touches} touches is {verdict}"
    if touches > record["planned"]:
        yield f"{touches} touches, and {record['planned']} were planned"
    if not record["headline"] or "\n" in record["headline"]:
        yield f"no sentence for a telephone: {record['headline']!r}"
    if record["night"] != (BEGUN + timedelta(days=number)).isoformat():
        yield f"the night {number} is dated {record['night']}"
    begin, end = (datetime.fromisoformat(record[key]) for key in ("start_utc", "end_utc"))
    if end < begin or abs((end - begin).total_seconds() - record["duration_s"]) > 1.5 or begin.tzinfo != UTC:
        yield f"it lasts {record['duration_s']} s from {record['start_utc']} to {record['end_utc']}"
    if record["machine_time_s"] > record["duration_s"] + 1.5:
        yield "the machine was at work for longer than the night"
    if any(not p["passed"] for p in record["preflight"]) and touches:
        yield "a point of the preflight has failed, and it was measured"
    if verdict in ("good", "changed") and (verdict == "changed") != bool(record["alarms"] or record.get("standing")):
        yield f"the verdict is {verdict}, with {len(record['alarms'])} alarms and {len(record.get('standing') or ())} that stand"
    if record.get("carried") is False:
        if {"parameters", "state"} & set(record) or record["alarms"]:
            yield "a night that is not believed knows something"
        if verdict != "doubtful" or record["next"]["kind"] != "full":
            yield f"a night that is not believed is {verdict}, and the next one is {record['next']['kind']}"
    for name, p in (record.get("parameters") or {}).items():
        if not p["low"] <= p["value"] <= p["high"] or abs(p["high"] - p["low"] - 2 * COVER * p["std"]) > 0.01 * p["std"]:
            yield f"the interval of {name} is not that of 95 %"


def _kept(year: Year, record: Mapping[str, Any], number: int, first: str) -> Iterator[str]:
    """What is left of it on the disk and in the history, which has every night from the first one on."""
    stamp = record["artefacts"]["folder"].removeprefix("nights/")
    if [s for s, _ in year.disk.unfinished() if s == stamp]:
        yield "the night has ended, and its mark is there"
    known = year.history.latest_knowledge(year.name)
    if record.get("carried") is False and known is not None and known[0].start_utc == record["start_utc"]:
        yield "a night that is not believed is the one that goes on"
    nights = year.history.nights(year.name, 2 * LISTED)
    found = {n.night for n in nights}
    days = [(BEGUN + timedelta(days=number - back)).isoformat() for back in range(min(number, LISTED))]
    left = {str(text)[:10] for text in record.get("left_behind") or ()}
    if wrong := left & found:
        yield f"the record says that {min(wrong)} is not on record, and it is"
    # A night that has not the lock puts nothing on record but itself: it names what the next one does.
    named = left if record["status"] == "refused" else set[str]()
    if gone := [day for day in days if day > first and day not in found | named]:
        yield f"nothing is on record of {gone[-1]}"
    own = next((n for n in nights if n.start_utc == record["start_utc"] and n.status == record["status"]), None)
    if own is None:
        yield "it is not in the history"
    elif record["touches"] and year.history.readings_of([own.entry]).get(own.entry) != year.disk.read(stamp, "readings.csv"):
        yield "the readings in the history are not those in the folder"
