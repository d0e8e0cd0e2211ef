"""Which parts are to be checked this morning, and what was known before a night that measured nothing: for its message."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..report.suspects import as_limited, last_within, never_within, suspected
from ..report.tonight import is_over, only_set_up
from ..texts import say
from .dates import LISTED
from .ports import Past

EVERY = 10_000  # nights among which the last one within the limit is looked for


def to_check(past: Past, record: Mapping[str, Any]) -> dict[str, Any]:
    """history, record of tonight with alarms that stand → `parts_to_check`, as on its page, where a limit is crossed or nothing was
    measured; of the latter `last_limits` as well: those of the last night that measured. {}: nothing of both.
    """
    missing = record["verdict"] == "not_measured"
    if not (missing or record["verdict"] == "out_of_limits") or record["status"] == "refused" or not past.knows(record["machine"]):
        return {}
    nights = past.nights(record["machine"], last=LISTED)
    last = next((n for n in nights if n.verdict != "not_measured"), None)
    known = record if not missing else {} if last is None else past.records_of([last.entry])[last.entry]
    limits = [x for x in known.get("limits") or () if x.get("limit")] if known.get("carried", True) else []
    verdict = record["verdict"] if not missing else str(known.get("verdict") or "")
    may = "no" if verdict in ("out_of_limits", "doubtful") else "but"
    by_limit = {str(x["what"]): float(x["limit"]) for x in limits}
    every = _judged(past, record, by_limit) if may == "no" else []
    signs = [(n, verdict) for n, verdict, _ in every]
    found = suspected(may, last_within(signs), never_within(signs), _began(record, known))
    told: dict[str, Any] = {"last_limits": limits} if missing and limits else {}
    if found is None:
        return told
    entries = {date: entry for date, _, entry in reversed(every)}
    dates = {name: _date(past, date, entries if name in found.limits else {}) for name, date in found.dates.items()}
    return told | {"parts_to_check": say(found.key, **dates)}


def _judged(past: Past, record: Mapping[str, Any], limits: Mapping[str, float]) -> list[tuple[str, str, int | None]]:
    """history, record of tonight, {what: limit} → date, verdict and entry (None: not on record yet) of nights, newest first."""
    own = [] if record["verdict"] == "not_measured" else [(str(record["night"]), str(record["verdict"]), None)]
    nights = past.nights(record["machine"], last=EVERY)
    return [*own, *((n.night, as_limited(n.verdict, n.status, n.volume_um, limits), n.entry) for n in nights)]


def _date(past: Past, date: str, entries: Mapping[str, int | None]) -> str:
    """history, date of a night, entries by date of nights that are named for their limit → the date, and whether it is certain."""
    entry = entries.get(date)
    known = {} if entry is None else past.records_of([entry])[entry]
    unsure = known.get("verdict") in ("good", "changed") and any(x.get("passed") is None for x in known.get("limits") or ())
    return say("morning.unsure", date=date) if unsure else date


def _began(record: Mapping[str, Any], known: Mapping[str, Any]) -> str:
    """record of tonight, of the last night that measured → date of the last night before anything of the machine that is open."""
    alarms = [a for key in ("alarms", "standing", "unheard") for a in record.get(key) or ()]
    of_machine = [a for a in alarms if not (only_set_up(a) or is_over(a))]
    dates = [str(a["since"]) for a in (*of_machine, *(known.get("behind") or ())) if a.get("since")]
    return min(dates, default="")
