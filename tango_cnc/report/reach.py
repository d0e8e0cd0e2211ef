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


def to_ask(record: Mapping[str, Any], found: Sequence[Mapping[str, Any]], t: Texts) -> str:
    """record with owner and deputy, what is wrong, texts → whom to call, as an order; '' where somebody has it already."""
    first = found[0] if found else {}
    if first.get("decision") is not None:
        return ""
    owner, deputy = str(first.get("owner") or record.get("owner") or ""), str(record.get("deputy") or "")
    if not owner:
        return t("morning.nobody_todo")
    if not or_else(owner, int(first.get("silent") or 0), deputy, t):
        return t("morning.call", owner=owner)
    if not deputy:
        return t("morning.call_or_shift", owner=owner)
    # Who can be reached comes before who cannot, or who has not answered.
    ask, other = (deputy, owner) if REACHED.search(deputy) else (owner, deputy)
    if int(first.get("silent") or 0) < SILENT or not first.get("night"):
        return t("morning.call_or", owner=ask, deputy=other)
    return t(
        "morning.call_next" if ask == deputy else "morning.call_again", owner=owner, deputy=deputy, date=day(first["night"], t)
    )
