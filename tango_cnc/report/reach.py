"""Who is asked about a machine → whom else, where nobody answers or no telephone number is stated."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from .days import day
from .texts import Texts

SILENT = 2  # days without an answer, from which somebody else is asked
REACHED = re.compile(r"\d{2}|@")  # a telephone number, or the address of a mail


def or_else(owner: str, days: int, deputy: str, t: Texts) -> str:
    """owner, days without an answer, deputy ('': none is stated), texts → whom else to ask, as a sentence; '' where the owner can
    be reached and has time to answer.
    """
    unknown, silent = not REACHED.search(owner), days >= SILENT
    if not unknown and not silent:
        return ""
    if deputy:
        return t("morning.deputy_next" if silent else "morning.deputy", deputy=deputy)
    return t(
        "morning.no_deputy_or_number" if unknown and silent else "morning.no_deputy" if silent else "morning.no_number", owner=owner
    )


def instead_of(record: Mapping[str, Any], found: Sequence[Mapping[str, Any]] = ()) -> str:
    """record with deputy, what is wrong → who is asked where no owner is named: the deputy, else who has or is asked about
    something else of this machine; '' where nobody is named at all.
    """
    return str(record.get("deputy") or next((a["owner"] for a in found if a.get("owner")), ""))


def to_ask(record: Mapping[str, Any], found: Sequence[Mapping[str, Any]], t: Texts) -> str:
    """record with owner and deputy, what is wrong, texts → whom to call about the first of it that nobody ignores, as an order;
    where somebody has that, about the first that nobody has answered, whose date it then names, or about a night in doubt, which
    nobody has; '' where somebody has all of it.
    """
    first = next((a for a in found if not a.get("let_be")), found[0]) if found else {}
    if first.get("decision") is not None:
        first = next((a for a in found if a.get("id") and a.get("decision") is None), {})
        if not first and record.get("verdict") != "doubtful":
            return ""
    told = _call(first, record, found, t)
    other = bool(first) and first is not found[0] and bool(first.get("night"))  # pages begin with what somebody has
    return f"{told} {t('morning.call_of', date=day(str(first['night']), t))}" if other else told


def _call(first: Mapping[str, Any], record: Mapping[str, Any], found: Sequence[Mapping[str, Any]], t: Texts) -> str:
    """as `to_ask`, with what somebody is called about → whom to call, as an order."""
    owner, deputy = str(first.get("owner") or record.get("owner") or ""), str(record.get("deputy") or "")
    silent, asked = int(first.get("silent") or 0), str(first.get("asked") or first.get("night") or "")
    if not owner:
        other = instead_of(record, found)
        return t("morning.nobody_but", other=other) if other else t("morning.nobody_todo")
    if not or_else(owner, silent, deputy, t):
        return t("morning.call", owner=owner)
    return of_two(owner, silent, deputy, asked, t) if deputy else t("morning.call_or_shift", owner=owner)


def of_two(owner: str, silent: int, deputy: str, asked: str, t: Texts) -> str:
    """owner, who has not answered or has no number, days since the first question, deputy, its date, texts → whom to call first:
    who can be reached comes before who cannot, or who has not answered.
    """
    ask, other = (deputy, owner) if REACHED.search(deputy) else (owner, deputy)
    if silent < SILENT or not asked:
        return t("morning.call_or", owner=ask, deputy=other)
    return t("morning.call_next" if ask == deputy else "morning.call_again", owner=owner, deputy=deputy, date=day(asked, t))
