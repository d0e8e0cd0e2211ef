"""Facts of a report → whether parts may be made: the answer of the newest night, as on every page, or of the readings themselves.

Readings that are newer than the night count as well: of the two answers the worse one stands, until a night says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from .age import nights_old
from .answer import PARTS, WORSE, Answer, answer, measuring, staying
from .checks import limits_of, verdict
from .days import day, local_day
from .facts import Facts
from .orders import is_stopped, under_a_no
from .plain import length, signed
from .states import most_of_tip
from .texts import Texts
from .units import shown
from .verdict import worst_of
from .words import spoken

GROWN = 1.1  # times the error of the night, from where newer readings say what most of theirs comes from
NOTHING = Answer("unknown", "", "", "", "")


@dataclass(frozen=True)
class Told:
    """The answer, what it rests on, what is behind it, and which run its numbers are of; all as sentences."""

    answer: Answer
    basis: str
    cause: str
    run: str = ""
    by_night: bool = False
    own: Answer = NOTHING  # of these readings alone; no plain yes where they are newer than the night, and show a larger error


def may(f: Facts, t: Texts) -> Told:
    """facts, texts → whether parts may be made; neither yes nor no while the machine measures."""
    told = _known(f, t)
    return replace(told, answer=measuring(told.answer, t)) if f.nights is not None and f.nights.busy else told


def _known(f: Facts, t: Texts) -> Told:
    stated = f.wishes.stated
    strict = None if stated is None else replace(f, wishes=replace(f.wishes, limit=stated, stated=None))
    own = _but(_own(f, t), None if strict is None else _own(strict, t), f, t)
    if f.nights is None:
        return Told(own, t("may.by_readings") + _by_option(f, t), _most(f, own, t), own=own)
    own = _after(own, f, t)
    night = f.nights.answer(f.wishes.units, t, f.cell.machine, f.wishes.limit)
    night = _but(night, None if stated is None else f.nights.answer(f.wishes.units, t, f.cell.machine, stated), f, t)
    if f.nights.beside(f.paper.measured) == "newer" and (
        WORSE[own.may] > WORSE[night.may] or (night.old and night.may == "unknown" and not _old(f))
    ):
        key = "may.by_readings_alone" if night.old else "may.by_newer_readings"
        newer = t(key, date=day(f.nights.measured_on, t), answer=night.word)
        return Told(own, newer + _by_option(f, t), _most(f, own, t), _run(f, False, t), own=own)
    newest = grown(f) and own.numbers != ""  # the larger number is the newer one
    night = replace(night, numbers=own.numbers) if newest else _stays(night, own, f, t)
    basis = _by_night(f, t)
    return Told(
        night,
        basis + _by_option(f, t),
        "" if night.may == "yes" else _behind(f, newest, own, t),
        _run(f, not newest, t, bool(night.beside)),
        True,
        own,
    )


def _stays(night: Answer, own: Answer, f: Facts, t: Texts) -> Answer:
    """answer of the night, that of these readings, facts with nights, texts → the answer of the night; where these readings are
    newer, it says what they have found and until when it stays, as the pages of the machine do.
    """
    assert f.nights is not None
    moving = night.state in ("cut_off", "moved") or night.word == t("may.not_yet")
    if moving or f.nights.beside(f.paper.measured) != "newer" or own.may not in ("yes", "but", "no"):
        return night
    tip = None if f.tip is None or own.state == "doubtful" else 1e3 * f.tip.worst
    return staying(night, own.may, tip, str(f.paper.measured), f.wishes.units, t)


def _after(own: Answer, f: Facts, t: Texts) -> Answer:
    """answer of these readings, facts with nights → the same; no plain yes where they are newer than the night, and it has left an
    alarm that nobody has closed, or the error has grown since.
    """
    assert f.nights is not None
    if own.may not in ("yes", "unknown") or f.nights.beside(f.paper.measured) != "newer":
        return own
    date = day(f.nights.measured_on, t)
    if f.nights.old and f.nights.waiting and own.may == "yes":
        return replace(own, may="but", word=t("may.but"), state="alarm_open", why=t("may.open_old", date=date))
    if grown(f):
        return replace(own, may="but", word=t("may.but"), state="changed", why=t("may.grown_since", date=date))
    return own


def grown(f: Facts) -> bool:
    """facts → whether readings that are newer than the night show a larger error at the tool tip than it has."""
    if f.nights is None or f.tip is None or f.nights.beside(f.paper.measured) != "newer":
        return False
    there = ((f.nights.before or f.nights.record or {}).get("volume") or {}).get("worst_um")
    return there is not None and 1e3 * f.tip.worst > GROWN * float(there)


def _old(f: Facts) -> bool:
    """facts with nights → whether these readings, too, are too old for an answer of the day on which the report is made."""
    assert f.nights is not None
    return (
        f.nights.old > 0 and nights_old(local_day(f.paper.measured), local_day(f.paper.made.isoformat()), f.nights.answers_for) > 0
    )


def _run(f: Facts, by_night: bool, t: Texts, stays: bool = False) -> str:
    """facts with nights, whether the answer is the night's, texts, whether it says already what these readings have → of which run
    its number is, and that of the other run; nothing where both are one run, or where one of them knows no error.
    """
    assert f.nights is not None
    beside, known = f.nights.beside(f.paper.measured), f.nights.before or f.nights.record or {}
    there = (known.get("volume") or {}).get("worst_um")
    if beside == "own" or f.tip is None or there is None or known.get("verdict") == "doubtful":
        return ""
    here, night = (length(x, f.wishes.units) for x in (1e3 * f.tip.worst, float(there)))
    key = "run.readings" if not by_night else "run.night" if stays else f"run.night_{beside}"
    return t(key, date=day(f.nights.measured_on, t), here=here, night=night)


def _by_night(f: Facts, t: Texts) -> str:
    """facts with nights, texts → that the answer is the night's, and where its limit is not that of the night, both of them."""
    assert f.nights is not None
    date, limit = day(f.nights.date, t), f.wishes.limit
    known = f.nights.before or f.nights.record or {}
    then = next((float(x["limit"]) for x in known.get("limits") or () if x.get("what") == "volume" and x.get("limit")), None)
    if (
        limit is None
        or known.get("verdict") in ("doubtful", "not_measured")
        or (then is not None and abs(then - 1e3 * limit) < 1e-6)
    ):
        return t("may.by_night", date=date)
    u = f.wishes.units
    if then is None:
        return t("may.by_night_now", date=date, limit=length(1e3 * limit, u))
    return t("may.by_night_limit", date=date, limit=length(1e3 * limit, u), then=length(then, u))


def _by_option(f: Facts, t: Texts) -> str:
    """facts, texts → that the limit was asked for in place of that of nightly.yaml, as one more sentence; '' where it was not."""
    if f.wishes.limit is None or f.wishes.stated is None:
        return ""
    asked, stated = (length(1e3 * x, f.wishes.units) for x in (f.wishes.limit, f.wishes.stated))
    return f" {t('may.by_option', limit=asked, stated=stated)}"


def _but(found: Answer, strict: Answer | None, f: Facts, t: Texts) -> Answer:
    """answer by the limit that was asked for, that by the one of nightly.yaml (None: the same one) → a yes is no plain one where
    the limit of nightly.yaml says less.
    """
    if strict is None or WORSE[strict.may] <= WORSE[found.may] or f.wishes.stated is None:
        return found
    told = t("may.looser", stated=length(1e3 * f.wishes.stated, f.wishes.units), answer=strict.word)
    if found.may != "yes":
        return replace(found, why=f"{told} {found.why}".strip())
    return replace(found, may="but", word=t("may.but"), state="", why=told)


def _own(f: Facts, t: Texts) -> Answer:
    """facts, texts → the answer of these readings alone, by the same rules as that of a night."""
    trust = worst_of([c for c in verdict(f, t).checks if c.trust])
    limits = limits_of(f)
    record: Mapping[str, Any] = {
        "verdict": "doubtful" if trust.level == "stop" else "good",
        "limits": limits,
        "volume": None if f.tip is None else {"worst_um": f.tip.worst * 1e3},
        "status": "complete" if f.used >= f.planned else "partial",
        **{"touches": f.used, "planned": f.planned},
    }
    found = answer(record, f.wishes.units, t, machine=f.cell.machine)
    if found.state == "doubtful":
        return replace(found, why=t("may.readings_doubtful"))
    if not limits:
        return replace(found, may="unknown", word=t("may.limitless"), state="", why=t("may.state_limit"))
    if found.may == "yes" and f.control is not None and f.control.older:
        why = t("may.older_control", number=f.control.number, target=f.control.target)
        return replace(found, may="but", word=t("may.but"), state="", why=why)
    if found.may == "yes" and trust.level == "look":
        return replace(found, may="but", word=t("may.but"), state="", why=t("may.with_care"))
    return found


def _behind(f: Facts, newest: bool, own: Answer, t: Texts) -> str:
    """facts with nights, whether the number beside it is of these readings, their answer, texts → what is wrong first; a share is
    one of the number beside it.
    """
    assert f.nights is not None
    return _most(f, own, t) if newest and f.nights.share else f.nights.brief or f.nights.cause


def _most(f: Facts, own: Answer, t: Texts) -> str:
    """facts, their answer, texts → which error does most, where the tool tip is beyond its limit or close to it; else nothing."""
    name = most_of_tip(f)
    if own.state not in ("out_of_limits", "undecided") or not name:
        return ""
    factor, unit = shown(f.result.parameters[name].unit)
    size = signed(f.result.parameters[name].value * factor, unit, f.wishes.units, t)
    return t("may.most", what=spoken(name, f.cell.machine, t), size=size)


def parts_first(told: Answer, do: Sequence[str], t: Texts) -> list[str]:
    """answer, what to do, texts → the same, which begins as the answer does: under a No nothing in it lets parts be made meanwhile.

    To look at a machine that may still move stays before that.
    """
    none, some, moving = t("may.brief_no"), [t(key) for key in PARTS.values()], {t("morning.cut_off_todo")}
    stopped = is_stopped(told, t)
    do = under_a_no(do, t) if stopped else do
    first = [none] if stopped else [x for x in some if x in do]
    rest = [x for x in do if x not in (none, *some)]
    return [*(x for x in rest if x in moving), *first, *(x for x in rest if x not in moving)]
