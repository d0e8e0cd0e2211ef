"""The record of a night → the first line of the morning: may I make parts? With the error and the limit side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any, Literal

from ..records import Machine
from ..texts import Said, say
from .age import night_of_stamp
from .days import at, clock, day, local_day
from .newer import NewerAnswer
from .pace import SOON, Ahead
from .plain import amount, length, plain, shop, signed
from .texts import Texts
from .units import Units, shown
from .verdict import Level
from .words import spoken

CLOCK = "history.clock."  # keys of the sentences of history/clock.py, with which the database would be loaded

CUT_OFF = "web.cut_off"  # key of the sentence about a night that was cut off
UNSENT = "web.unsent"  # of one that ended before anything was sent to the control
RUN_OFF = "web.run_off"  # of a run outside the nights that broke off
WAITING = "web.waiting"  # of one that has ended and that the history has not taken

PARTS = {
    "": "morning.parts_first",
    "_probe": "may.brief_probe",
    "_beside": "may.brief_beside",
}  # about the first one, by `of_probe`
NEWER = "newer"  # state of an answer that readings after the newest night have given

May = Literal["yes", "but", "no", "unknown", "wait"]  # wait: it is being measured
WORSE: Mapping[May, int] = {"yes": 0, "wait": 1, "unknown": 1, "but": 1, "no": 2}
LEVELS: Mapping[May, Level] = {"yes": "good", "but": "look", "no": "stop", "unknown": "unknown", "wait": "look"}
MEASURED = ("good", "changed", "out_of_limits", "doubtful")


@dataclass(frozen=True)
class Answer:
    """Whether parts may be made; `numbers` are error and limit, `why` is what limits a yes, `soon` how near the limit is, `old` how
    long it was not measured, where that is too long for an answer of today.
    """

    may: May
    word: str
    state: str  # key of the verdict in a word, below `morning`
    numbers: str
    why: str
    soon: str = ""
    old: str = ""
    of: str = ""  # date of the night that `numbers` are of, where they do not name it
    newer: bool = False  # whether readings after the newest night have given it, or its number
    after: str = ""  # then: date of the night that measured before them
    moved: str = ""  # then: what they have otherwise than that night, as a sentence
    mover: str = ""  # then: the parameter that this is about
    beside: str = ""  # what newer readings say that leave the answer as it is, and until when it stays, as a sentence
    again: bool = False  # whether these say a plain Yes: no full measurement is asked for once more

    @property
    def level(self) -> str:
        """→ the sign that goes with it."""
        return "none" if self.may == "wait" else LEVELS[self.may]

    @property
    def order(self) -> str:
        """→ `why` without what newer readings say beside it."""
        return self.why.removesuffix(self.beside).strip()

    def by_newer(self, *may: May) -> bool:
        """answers → whether readings after the newest night have given this one, and it is one of them."""
        return self.newer and self.may in may

    def short(self, t: Texts) -> str:
        """texts → what the page writes beside the answer: how old the result is, else the verdict in a word, if it has one."""
        return self.old or (t(f"morning.{self.state}") if f"morning.{self.state}" in t else "")


def answer(
    record: Mapping[str, Any],
    u: Units,
    t: Texts,
    waiting: str = "",
    before: Mapping[str, Any] | None = None,
    machine: Machine | None = None,
    late: str = "",
    has: str = "",
    ahead: Ahead | None = None,
    closed: str = "",
    old: int = 0,
    probe: str = "",
) -> Answer:
    """record, units, texts, date of an alarm that nobody has answered, last night that measured, machine, date since when a
    complete night is missing, who has an alarm that is not closed, how soon it is at its limit, by what every alarm of the night
    was closed since, nights since the last measurement where these are too many (age.nights_old), what of the open ones is of the
    probe (faults.of_probe) → the answer.

    A limit that is crossed is a no, whatever else the night has found. Numbers of an earlier night carry its date.
    """
    verdict = str(record.get("verdict"))
    missing = verdict == "not_measured"
    known = before if missing else record
    may, state, why = (
        _measured(known, t, waiting, has, closed, probe) if known is not None else ("unknown", "not_measured", t("may.never"))
    )
    date = str(known.get("night")) if known is not None else ""
    if known is None and record.get("last_measured"):
        why = t("may.long_ago", date=day(record["last_measured"], t))
    if missing and known is not None:
        doubted = str(known.get("verdict")) == "doubtful"  # then nothing was known that night either
        key = "may.unmeasured_doubt" if doubted else "may.unmeasured_beyond" if may == "no" else "may.unmeasured"
        why = t(key, date=day(date, t), cause=_cause("may.cause", record, u, t, machine))
        may, state = ("no" if may == "no" else "but"), "not_measured"
    moving = missing and bool(record.get("moved"))
    if old:
        stale = _of_old(record, known, may, old, date, u, t, machine)
        return _machine_first(stale, "moved", stale.state, t) if moving else stale
    if late and may == "yes":  # an answer of a week ago is no yes of today
        may, state, why = "but", "late", t("may.late", date=day(late, t))
    elif late and not missing:
        why = f"{why} {t('may.late_also', date=day(late, t))}".strip()
    soon = _soon(ahead, u, t) if ahead is not None and may in ("yes", "but") else ""
    if soon and ahead is not None and ahead.nights < SOON and may == "yes":  # it may be beyond before it is measured again
        may, state, why = "but", "undecided", t("may.first_part")
    numbers = _numbers(known, u, t, machine, date if missing else "")
    found = Answer(may, t(f"may.{may}"), state, numbers, why, soon, of="" if missing else date)
    return _machine_first(found, "moved", state, t) if moving else found


def of_moving(
    record: Mapping[str, Any], t: Texts, before: Mapping[str, Any] | None = None, former: Sequence[str] = (), old: int = 0
) -> Answer | None:
    """record of the newest night, texts, last night that measured (None: as the record says), what is said of the cell beside its
    nights, nights since the last measurement where these are too many → the answer of its page; None where it does not move.

    It needs no alarm: whoever has one, nobody makes parts before the machine was looked at.
    """
    if not is_moving(record, former):
        return None
    if before is None and record.get("last_measured"):
        before = {"verdict": str(record.get("last_verdict") or "good"), "night": record["last_measured"]}
    return renamed(answer(record, Units(), t, before=before, old=old), former, t)


def _cause(key: str, record: Mapping[str, Any], u: Units, t: Texts, machine: Machine | None) -> str:
    """key of its sentence, record of a night that did not begin, units, texts → what kept it, for the shop; '' for no check."""
    failed = next((p for p in record.get("preflight") or () if not p.get("passed") and p.get("found")), None)
    if failed is None:
        return ""
    cause = shop(plain(failed["found"], u, t, machine), t).partition(". ")[0].rstrip(".")  # the rest stands in what to do
    return t(key, cause=cause[:1].lower() + cause[1:])


def _machine_first(found: Answer, key: str, state: str, t: Texts) -> Answer:
    """answer, key of why the control may still execute a program, state where parts might be made, texts → the answer that begins
    with the order to look at the machine. Nobody makes a part on it before, whatever else is open: the sign is that of a no.
    """
    if found.may in ("yes", "but"):
        return replace(found, may="no", word=t("may.not_yet"), state=state, why=t(f"may.{key}"))
    return replace(found, why=f"{t(f'may.{key}_unknown')} {found.why}".strip())


def _of_old(
    record: Mapping[str, Any],
    known: Mapping[str, Any] | None,
    may: May,
    old: int,
    date: str,
    u: Units,
    t: Texts,
    machine: Machine | None,
) -> Answer:
    """record, last one that measured, what it said, nights since then, its date → the answer: nobody knows. A limit that was
    crossed stays crossed until a night says otherwise.
    """
    beyond = may == "no" and known is not None and str(known.get("verdict")) != "doubtful"
    doubted = known is not None and str(known.get("verdict")) == "doubtful"
    key = "old_beyond" if beyond else "old_doubt" if doubted else "old"
    when = day(date or record.get("last_measured"), t)
    word, told = t("may.no" if beyond else "may.unknown"), t("may.old_nights", nights=old)
    numbers = _numbers(known, u, t, machine, date)
    why = t(f"may.{key}", date=when, nights=old) + _cause("may.cause_old", record, u, t, machine)
    return Answer("no" if beyond else "unknown", word, "old", numbers, why, "", told)


def said_cut_off(stamps: Sequence[str], ended: Mapping[str, str] | None = None) -> tuple[Said, ...]:
    """stamps of nights with the mark of one at work, {stamp: how it ended} of those that did → what pages say beside the nights of
    the cell.
    """
    keys = {"unsent": UNSENT, "waiting": WAITING}
    return tuple(say(keys.get((ended or {}).get(stamp, ""), CUT_OFF), date=night_of_stamp(stamp)) for stamp in stamps)


def said_broken_off(at: float | None) -> tuple[Said, ...]:
    """when the last run of a cell broke off while its program may go on (s since 1970; None: it did not) → what pages say of it."""
    return (
        ()
        if at is None
        else (say(RUN_OFF, date=f"{datetime.fromtimestamp(at):%Y-%m-%d}", time=clock(datetime.fromtimestamp(at, UTC))),)
    )


def is_cut_off(former: Sequence[str]) -> bool:
    """what pages say of a cell beside its nights → whether a night of it was cut off, or a run broke off."""
    return any(isinstance(text, Said) and text.key in (CUT_OFF, RUN_OFF) for text in former)


def is_unsent(former: Sequence[str]) -> bool:
    """what pages say of a cell beside its nights → whether a night of it ended before anything was sent, and none was cut off."""
    return not is_cut_off(former) and any(isinstance(text, Said) and text.key == UNSENT for text in former)


def is_waiting(former: Sequence[str]) -> bool:
    """what pages say of a cell beside its nights → whether the history has not taken a night of it that ended, and none was cut
    off.
    """
    return not is_cut_off(former) and any(isinstance(text, Said) and text.key == WAITING for text in former)


def is_moving(record: Mapping[str, Any], former: Sequence[str]) -> bool:
    """record of the newest night, what is said of the cell beside its nights → whether the control may still execute a program."""
    return is_cut_off(former) or bool(record.get("moved"))


def dates_cut_off(former: Sequence[str]) -> list[str]:
    """what pages say of a cell beside its nights → dates of the nights that were cut off, newest first; the history has none of
    them until the next night.
    """
    return sorted((str(x.values["date"]) for x in former if isinstance(x, Said) and x.key in (CUT_OFF, UNSENT)), reverse=True)


def date_run_off(former: Sequence[str]) -> str:
    """what pages say of a cell beside its nights → date on which a run outside the nights broke off; '' where none did."""
    return next((str(x.values["date"]) for x in former if isinstance(x, Said) and x.key == RUN_OFF), "")


def renamed(found: Answer, former: Sequence[str], t: Texts) -> Answer:
    """answer, what the cell has under other names or with a date in the future, texts → the same; an alarm that is open there is
    open here, and no plain yes.
    """
    told = [text.values for text in former if isinstance(text, Said)]
    if dates_cut_off(former) or is_waiting(former):
        found = _dated(found, t)
    if is_cut_off(former):
        night = any(isinstance(text, Said) and text.key == CUT_OFF for text in former)
        return _machine_first(found, "cut_off" if night else "run_off", "cut_off", t)
    if is_unsent(former) and found.may == "yes":
        return replace(found, may="but", word=t("may.but"), state="not_measured", why=t("may.unsent"))
    if is_waiting(former) and found.may == "yes":
        return replace(found, may="but", word=t("may.but"), state="not_measured", why=t("may.waiting"))
    if found.may != "yes" or not any(int(x.get("alarms") or 0) + int(x.get("held") or 0) for x in told):
        return found
    dated = any(isinstance(text, Said) and text.key.startswith(CLOCK) for text in former)
    return replace(found, may="but", word=t("may.but"), state="alarm_open", why=t("may.left_out" if dated else "may.former"))


def of_no_night(former: Sequence[str], t: Texts) -> Answer | None:
    """what is said of a cell that no night has measured, texts → not yet, where its control may still move; else None."""
    return renamed(Answer("but", "", "", "", ""), former, t) if is_cut_off(former) else None


def _dated(found: Answer, t: Texts) -> Answer:
    """answer that is older than the newest night, texts → the same, whose numbers name their night."""
    return replace(found, numbers=t("may.on", text=found.numbers, date=day(found.of, t))) if found.numbers and found.of else found


def by_limit(record: Mapping[str, Any], limit: float | None) -> Mapping[str, Any]:
    """record of a night, limit of the tool tip in µm that is stated now (None: none) → the record judged by it, and not by that of
    the night. One that knows no error, or is not to be believed, stays as it is.
    """
    own: Sequence[Mapping[str, Any]] = record.get("limits") or ()
    volume = record.get("volume") or {}
    if limit is None or record.get("verdict") in ("doubtful", "not_measured"):
        return record
    if not any(x.get("what") == "volume" for x in own) and volume.get("worst_um") is not None:
        value, half = float(volume["worst_um"]), 1.96 * float(volume.get("std_um") or 0.0)
        own = [*own, {"what": "volume", "value": value, "unit": "µm", "low": value - half, "high": value + half}]

    def judged(x: Mapping[str, Any]) -> dict[str, Any]:
        low, high = (float(x.get(end, x["value"])) for end in ("low", "high"))
        return {**x, "limit": limit, "passed": True if high <= limit else False if low > limit else None}

    limits = [judged(x) if x.get("what") == "volume" and x.get("value") is not None else x for x in own]
    verdict = record.get("verdict")
    if verdict == "out_of_limits" and limits and not any(x.get("passed") is False for x in limits):
        verdict = "changed" if record.get("alarms") or record.get("standing") else "good"
    return {**record, "limits": limits, "verdict": verdict}


def _soon(ahead: Ahead, u: Units, t: Texts) -> str:
    """how soon a machine is at its limit, units, texts → the same as a sentence."""
    key = "now" if ahead.nights < 1 else "next" if ahead.nights < SOON else "in"
    words = {"limit": length(ahead.limit, u), "rate": length(ahead.rate, u), "nights": f"{ahead.nights:.0f}"}
    return t(f"may.soon_{key}", **words)


def by_newer(
    known: Answer, newer: NewerAnswer, u: Units, t: Texts, machine: Machine | None = None, night: Mapping[str, Any] | None = None
) -> Answer:
    """answer of the newest night, that of readings that came after it, units, texts, chain of axes, record of the last night that
    measured → the worse one of both: that of the readings with its number, what the largest part of a No comes from, and what has
    moved since the night; where the night says as much, its own answer with the number of the readings, if that is larger. Where
    the night says worse, its answer stays, and says until when, and what the readings say.

    What nobody knows because the machine may still move stays. Nights that are too old know less than readings that say No.
    """
    if known.state in ("cut_off", "moved") or known.word == t("may.not_yet"):
        return known
    stays = known.may == "unknown" and (known.state != "old" or newer.may != "no")
    worse = WORSE[newer.may] > WORSE[known.may]
    if stays or not (worse or newer.grown):
        return staying(known, newer.may, newer.tip_um, newer.measured, u, t)
    after, moved = str((night or {}).get("night") or ""), _moved_since(newer, night or {}, u, t, machine)
    numbers = _of_readings(newer, u, t)
    found = replace(
        known, soon="", old="", newer=True, after=after, moved=moved, mover=newer.moved[0] if newer.moved and moved else ""
    )
    if not worse:  # the night says as much, of a smaller error
        return replace(found, numbers=numbers or known.numbers, why=f"{known.why} {t('may.newer_also')}".strip())
    if newer.may != "no":
        why = t("may.newer_grown" if newer.grown else "may.newer_but", answer=known.word)
        return replace(found, may="but", word=t("may.but"), state=NEWER, numbers=numbers or known.numbers, why=why)
    why = t("may.newer_no", answer=known.word)
    if newer.parameter:
        factor, unit = shown(newer.unit)
        size = signed(newer.value * factor, unit, u, t)
        why += f" {t('may.most', what=spoken(newer.parameter, machine, t), size=size)}"
    return replace(found, may="no", word=t("may.no"), state=NEWER, numbers=numbers, why=why)


def staying(known: Answer, may: May, tip_um: float | None, measured: str, u: Units, t: Texts) -> Answer:
    """answer of the newest night, that of readings that came after it, their error (µm), when they were made (UTC), units, texts →
    the same answer, which says what these have found and until when it stays; a plain Yes of the night as it is.
    """
    if known.may in ("yes", "wait"):
        return known
    words = {"date": at(measured, t), "answer": t(f"may.{may}"), "stays": known.word}
    found = t("may.stays_found", answer=words["answer"], size=length(tip_um, u)) if tip_um is not None else words["answer"]
    open_ = known.may == "but" and known.state in ("changed", "alarm_open") and not known.why.startswith(t("may.repaired"))
    beside = t("may.stays_open" if open_ else "may.stays", **{**words, "answer": found})
    why = known.why.replace(t("may.doubtful"), t("may.doubtful_stays")) if may == "yes" else known.why
    return replace(known, why=f"{why} {beside}".strip(), beside=beside, again=may == "yes")


def _of_readings(newer: NewerAnswer, u: Units, t: Texts) -> str:
    """answer of newer readings, units, texts → their error beside its limit, with their date; '' where they know none."""
    if newer.tip_um is None:
        return ""
    if newer.limit_um is None:
        text = t("may.no_limit", what=t("may.tip"), found=amount(newer.tip_um, "µm", u, t))
    else:
        text = _pair(t("may.tip"), newer.tip_um, newer.limit_um, "µm", u, t)
    return t("may.of_readings", text=text, date=day(local_day(newer.measured), t))


def _moved_since(no: NewerAnswer, night: Mapping[str, Any], u: Units, t: Texts, machine: Machine | None) -> str:
    """answer of newer readings, record of the night before them, units, texts, chain of axes → what has moved most since then (of a
    report that does not say it: what the largest part of their error comes from) by them, and by the night, as a sentence; ''
    where the night does not know it, or has the same (95 %, of two like it).
    """
    name, value, own = no.moved or (no.parameter, no.value, no.unit)
    there = (night.get("parameters") or {}).get(name)
    if there is None or abs(value - float(there["value"])) <= 2 * math.sqrt(2) * float(there.get("std") or 0.0):
        return ""
    factor, unit = shown(own)
    here, then = (f"{'−' if x < 0 else ''}{amount(abs(x) * factor, unit, u, t)}" for x in (value, float(there["value"])))
    what = spoken(name, machine, t)
    return t("may.moved_since", what=f"{what[:1].upper()}{what[1:]}", here=here, there=then, date=day(night.get("night"), t))


def measuring(known: Answer, t: Texts) -> Answer:
    """what was known before, texts → the answer while the machine measures: neither yes nor no."""
    known = _dated(known, t)  # of a night before this measurement
    known = replace(known, newer=False, after="", moved="", beside="", again=False)
    return replace(
        known, may="wait", word=t("may.measuring"), state="", why=t("may.measuring_why", answer=known.word), soon="", old=""
    )


def _measured(record: Mapping[str, Any], t: Texts, waiting: str, has: str, closed: str, of: str) -> tuple[May, str, str]:
    verdict = str(record.get("verdict"))
    passed = [x.get("passed") for x in record.get("limits") or ()]
    if verdict == "doubtful":
        return "no", "doubtful", t("may.doubtful")
    if verdict == "out_of_limits" or False in passed:
        return "no", "out_of_limits", t("may.beyond")
    if verdict not in MEASURED:
        return "no", verdict, ""
    if closed == "repaired":
        return "but", "changed", t("may.repaired")
    if (verdict == "changed" and closed != "accept") or waiting or has:
        also = "may.open_other" if has else "may.open"  # somebody has another one
        why = t(also + of, date=day(waiting, t)) if waiting else t(f"may.has{of}", owner=has) if has else t(f"may.changed{of}")
        return "but", "changed" if verdict == "changed" else "alarm_open", why
    if None in passed:
        return "but", "undecided", t("may.undecided")
    if record.get("status") == "partial":
        return "but", "partial", t("may.partial", touches=record.get("touches") or 0, planned=record.get("planned") or 0)
    return "yes", "good" if any(x.get("limit") for x in record.get("limits") or ()) else "unchanged", ""


def _pair(name: str, value: float, limit: float, unit: str, u: Units, t: Texts) -> str:
    """what it is, its value and limit in a unit, units, texts → both side by side; 60.4 µm beside 60 µm must not look alike."""
    found, allowed = amount(value, unit, u, t), amount(limit, unit, u, t)
    if found == allowed:
        factor, short = u.plain if unit == "µm" else u.of(unit)
        size = abs(value) * factor
        found = f"{size:.5f} in" if short == "in" else f"{size:.1f} {short}"
    return t("may.numbers", what=f"{name[:1].upper()}{name[1:]}", found=found, allowed=allowed)


def _numbers(record: Mapping[str, Any] | None, u: Units, t: Texts, machine: Machine | None, date: str) -> str:
    if record is None or str(record.get("verdict")) == "doubtful":
        return ""
    limits: Sequence[Mapping[str, Any]] = [x for x in record.get("limits") or () if x.get("limit") and x.get("value") is not None]
    if limits:
        worst = max(limits, key=lambda x: abs(float(x["value"])) / float(x["limit"]))
        what = str(worst.get("what"))
        name = t("may.tip") if what == "volume" else spoken(what, machine, t)
        unit = str(worst.get("unit") or "µm")
        text = _pair(name, float(worst["value"]), float(worst["limit"]), unit, u, t)
        text = t("may.numbers_unsure", text=text) if worst.get("passed", True) is None else text
    elif (record.get("volume") or {}).get("worst_um") is not None:
        text = t("may.no_limit", what=t("may.tip"), found=amount(float(record["volume"]["worst_um"]), "µm", u, t))
    else:
        return ""
    if record.get("status") == "partial":
        text = t("may.incomplete", text=text)
    return t("may.on", text=text, date=day(date, t)) if date else text
