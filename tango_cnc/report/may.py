"""Facts of a report → whether parts may be made: the answer of the newest night, as on every page, or of the readings themselves.

Readings that are newer than the night count as well: of the two answers the worse one stands, until a night says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from .answer import Answer, answer
from .days import day
from .facts import Facts, effects, limits_of, verdict
from .plain import amount
from .texts import Texts
from .units import shown
from .verdict import worst_of
from .words import spoken

WORSE = {"yes": 0, "wait": 1, "unknown": 1, "but": 1, "no": 2}


@dataclass(frozen=True)
class Told:
    """The answer, what it rests on, and what is behind it; both as sentences."""

    answer: Answer
    basis: str
    cause: str


def may(f: Facts, t: Texts) -> Told:
    """facts, texts → whether parts may be made."""
    own = _own(f, t)
    if f.nights is None:
        return Told(own, t("may.by_readings"), _most(f, own, t))
    night = f.nights.answer(f.wishes.units, t, f.cell.machine, f.wishes.limit)
    if f.nights.beside(f.paper.measured) == "newer" and WORSE[own.may] > WORSE[night.may]:
        return Told(own, t("may.by_newer_readings", date=day(f.nights.date, t), answer=night.word), _most(f, own, t))
    own_limit = night != f.nights.answer(f.wishes.units, t, f.cell.machine)
    basis = t("may.by_night_limit" if own_limit else "may.by_night", date=day(f.nights.date, t))
    return Told(night, basis, "" if night.may == "yes" else f.nights.cause)


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


def _most(f: Facts, own: Answer, t: Texts) -> str:
    """facts, their answer, texts → which error does most, where the tool tip is beyond its limit or close to it; else nothing."""
    name = next(iter(effects(f.result)), None)
    if own.state not in ("out_of_limits", "undecided") or name is None:
        return ""
    factor, unit = shown(f.result.parameters[name].unit)
    size = amount(f.result.parameters[name].value * factor, unit, f.wishes.units, t)
    return t("may.most", what=spoken(name, f.cell.machine, t), size=size)
