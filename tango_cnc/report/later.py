"""What pages of a machine say of a report whose readings are newer than its newest night (report.json, `newer`)."""

from __future__ import annotations

from typing import Literal

from .facts import Facts
from .may import Told, grown, may
from .newer import NewerAnswer
from .states import most_of_tip, moved_most
from .texts import texts


def no_after(f: Facts, said: Told) -> str:
    """facts, answer → when the newest night ended, where these readings are newer and say No by themselves, of the machine that the
    night has measured; else nothing. Pages of the machine ask for it.
    """
    if f.nights is None or said.by_night or said.own.may != "no":
        return ""
    return f.nights.ended_utc if not f.paper.simulated or (f.nights.record or {}).get("simulated") else ""


def after(f: Facts, said: Told) -> str:
    """facts, answer → when the newest night ended, where these readings are newer, of the machine that the night has measured, and
    say less than a plain Yes by themselves; else nothing. Pages of the machine ask for it.
    """
    if f.nights is None or f.nights.beside(f.paper.measured) != "newer" or said.own.may not in ("no", "but"):
        return ""
    return f.nights.ended_utc if not f.paper.simulated or (f.nights.record or {}).get("simulated") else ""


def yes_after(f: Facts, said: Told) -> str:
    """facts, answer → when the newest night ended, where these readings are newer, of the machine that the night has measured, and
    say a plain Yes by themselves; else nothing.
    """
    if f.nights is None or f.nights.beside(f.paper.measured) != "newer" or said.own.may != "yes":
        return ""
    return f.nights.ended_utc if not f.paper.simulated or (f.nights.record or {}).get("simulated") else ""


def newer_answer(f: Facts) -> NewerAnswer:
    """facts → what pages of the machine say of the answer of these readings; no number of readings that are in doubt."""
    measured, said = str(f.paper.measured), may(f, texts()).own
    kind: Literal["no", "but", "yes"] = "no" if said.may == "no" else "yes" if said.may == "yes" else "but"
    if f.tip is None or said.state == "doubtful":
        return NewerAnswer(measured, may=kind)
    tip, limit = 1e3 * f.tip.worst, None if f.wishes.limit is None else 1e3 * f.wishes.limit
    own = f.result.parameters
    most, moved = ((x, float(own[x].value), own[x].unit) if x else None for x in (most_of_tip(f), moved_most(f)))
    name, value, unit = most or ("", 0.0, "")
    return NewerAnswer(measured, tip, limit, name, value, unit, moved, kind, grown(f))
