"""The record of a night (tango-night/1, docs/nightly.md) → the morning page: one screen of a phone, then the engineer's part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from ..records import InputError, Machine
from . import svg
from .answer import answer
from .page import environment, rendered, value_text
from .plain import plain, rounded
from .texts import Texts, texts, texts_of
from .units import Units
from .verdict import Level

FORMAT = "tango-night/1"
LEVELS: Mapping[str, Level] = {
    "good": "good",
    "changed": "look",
    "not_measured": "look",
    "out_of_limits": "stop",
    "doubtful": "stop",
}
OF_THE_PROBE = ("facet", "noise_level", "pretravel", "stylus")  # causes that are no error of a part
LISTED = 3  # faults below the first one


def render(
    record: Mapping[str, Any],
    decisions: Sequence[Any] = (),
    units: Units | None = None,
    folder: Path | None = None,
    before: Mapping[str, Any] | None = None,
) -> str:
    """tango-night/1, decisions about its alarms, units, a shop's templates, last night that measured → HTML that stands alone.

    Raises InputError.
    """
    if record.get("format") != FORMAT:
        raise InputError(f"night: found format {record.get('format')!r}; allowed: {FORMAT}")
    return rendered(environment(folder), "morning.html", context(record, decisions, units, texts_of(folder), before=before))


def context(
    record: Mapping[str, Any],
    decisions: Sequence[Any],
    units: Units | None,
    t: Texts,
    *,
    waiting: Sequence[Mapping[str, Any]] = (),
    before: Mapping[str, Any] | None = None,
    machine: Machine | None = None,
    owner: str = "",
    late: str = "",
) -> dict[str, Any]:
    """record, decisions about its alarms, units, texts → values for the page.

    `waiting`: alarms of earlier nights that nobody has closed; `before`: the last night that measured; `owner`: who is asked
    where the record names nobody; `late`: date since when a complete night is missing.
    """
    u = units or Units()
    by_alarm = {d.alarm: d for d in decisions}  # the last one counts
    asked = {**record, "owner": record.get("owner") or owner}
    alarms = [_alarm(a, by_alarm.get(str(a.get("id"))), u, t, machine, asked) for a in record.get("alarms") or ()]
    found = faults(asked, waiting, by_alarm, u, t, machine)
    opened = [a["night"] for a in found if a["id"] and (a["decision"] is None or a["decision"].action == "acknowledge")]
    told = answer(record, u, t, "" if record.get("alarms") else next(iter(opened), ""), before, machine, late)
    return {
        "t": t,
        "units": u,
        "night": {
            "status": "complete",
            "why": "",
            "kind": "",
            "start_utc": "",
            "end_utc": "",
            "touches": 0,
            "planned": 0,
            **record,
        },
        "sentence": lambda text: sentence(text, u),
        "plain": lambda text: sentence(plain(str(text or ""), u, t, machine), Units()),
        "answer": told,
        "headline": sentence(record.get("headline"), u),
        "level": told.level,
        "word": t(f"morning.{told.state}") if f"morning.{told.state}" in t else told.state,
        "alarms": alarms,
        "first": found[0] if found else None,
        "also": found[1 : LISTED + 1],
        "more": max(len(found) - LISTED - 1, 0),
        "owner": asked["owner"],
        "failed": [{"do": "", "found": "", **p} for p in record.get("preflight") or () if not p.get("passed")],
        "preflight": record.get("preflight") or (),
        "limits": [_limit(x, u) for x in record.get("limits") or ()],
        "parameters": _parameters(record, u),
        "volume": _volume(record, u),
        "next": {"kind": "", **(record.get("next") or {}), "why": u.sentence(str((record.get("next") or {}).get("why") or ""))},
        "plausible": {"verdict": "", **(record.get("plausible") or {}), "reasons": _reasons(record, u)},
        "diagnosis": {"verdict": "", **(record.get("diagnosis") or {})},
        "temperatures": record.get("temperatures") or {},
        "hashes": record.get("hashes") or {},
        "versions": record.get("versions") or {},
        "change": _change(record, u),
        "residual": record.get("residual") or {},
    }


def earlier(alarms: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """alarms of earlier nights → the same, read today: "since last night" names the night instead."""
    return [{**a, "text": str(a.get("text") or "").replace("since last night", f"since {a.get('since')}")} for a in alarms]


def faults(
    record: Mapping[str, Any],
    waiting: Sequence[Mapping[str, Any]],
    decisions: Mapping[str, Any],
    u: Units,
    t: Texts,
    machine: Machine | None = None,
) -> list[dict[str, Any]]:
    """record, alarms of earlier nights, decisions by alarm → what is wrong, each once: unanswered first, then by what it does."""
    told: dict[str, dict[str, Any]] = {}
    older = [(a, True) for a in (*(record.get("standing") or ()), *waiting)]
    for a, before in [*((a, False) for a in record.get("alarms") or ()), *older]:
        shown = _alarm(a, decisions.get(str(a.get("id"))), u, t, machine, record)
        now = sentence(plain(str(a.get("now") or ""), u, t, machine), Units())
        if before and now:
            shown["text"] = f"{shown['text'].rstrip('.')}. {now}"
        told.setdefault(str(a.get("id") or len(told)), shown | {"older": before})
    found = _together(list(told.values()))
    for a in record.get("behind") or ():
        known = [size_of(x) for x in found if x.get("parameter") == a.get("parameter")]
        if not known or max(known) < 0.8 * size_of(a):  # an alarm that says the same is not told twice
            found.append(_alarm(a, None, u, t, machine, record) | {"older": False})
    if record.get("verdict") != "out_of_limits" or not record.get("behind"):
        return sorted(found, key=_urgency)
    behind = {x.get("parameter") for x in record["behind"]}
    return sorted(found, key=lambda a: (a.get("parameter") not in behind, *_urgency(a)))


def _together(alarms: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """alarms → one for each parameter: the oldest, whose "now" holds what came after it, with the effect of all of them."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for a in alarms:
        groups.setdefault(str(a.get("parameter") or a["id"]), []).append(a)
    found = []
    for same in groups.values():
        first = min(same, key=lambda a: a["night"])
        own, every = float(first.get("size") or 0.0), sum(float(a.get("size") or 0.0) for a in same)
        if len(same) > 1 and own and first.get("on_part_um") is not None:
            small = float(first["on_part_um"])
            large = abs(small * every / own)
            first = first | {"on_part_um": large, "on_part": first["on_part"].replace(rounded(small), rounded(large), 1)}
        unanswered = next((a for a in same if a["decision"] is None), None)
        first = first | {"same": len(same) - 1}
        found.append(first if unanswered is None else first | {k: unanswered[k] for k in ("decision", "decided", "who")})
    return found


def _urgency(a: Mapping[str, Any]) -> tuple[bool, bool, float]:
    return a.get("decision") is not None, str(a.get("cause")).replace(" ", "_") in OF_THE_PROBE, -size_of(a)


def size_of(a: Mapping[str, Any]) -> float:
    """fault → µm that it does, at most where that is on record, else the size that was found (of a tilt over 300 mm)."""
    if a.get("on_part_um") is not None:
        return abs(float(a["on_part_um"]))
    return abs(float(a.get("size") or 0.0)) * (1e3 if a.get("unit") == "mm" else 3e5)


def _alarm(
    a: Mapping[str, Any], decision: Any, u: Units, t: Texts, machine: Machine | None = None, record: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    raw = str(a.get("text") or "")
    size, record = _amount(a, u), record or {}
    owner = (decision.owner if decision is not None else None) or a.get("owner") or record.get("owner")
    return {
        **a,
        "id": str(a.get("id") or ""),
        "text": sentence(plain(raw, u, t, machine), Units()),
        "recorded": sentence(raw, u),
        "night": str(a.get("id") or "")[:10],
        "cause": str(a.get("cause") or "").replace("_", " "),
        "amount": "" if " ± " in raw else size,  # for the engineer, where the sentence does not say it already
        "on_part": sentence(plain(_told(a, "on_part", u, t), u, t, machine), Units()),
        "todo": sentence(plain(_told(a, "do", u, t), u, t, machine), Units()),
        "instead": [str(x).replace("_", " ") for x in a.get("instead") or ()],
        "owner": owner,
        "who": _who(owner, decision, bool(a.get("id")), t),
        "decision": decision,
        "same": 0,  # more alarms about it
        "decided": "" if decision is None else t(f"decision.{decision.action}"),
    }


def _who(owner: Any, decision: Any, asked: bool, t: Texts) -> str:
    """owner, decision, whether an answer is asked for, texts → who has it, as a sentence without its full stop."""
    if decision is not None:
        return t("morning.has", owner=owner, decided=t(f"decision.{decision.action}"))
    if not owner:
        return t("morning.nobody")
    return t("morning.asked", owner=owner) if asked else str(owner)


def sentence(text: Any, u: Units) -> str:
    """text of a record, units → the same as a sentence: a capital in front, lengths in these units."""
    found = u.sentence(str(text or ""))
    return found[:1].upper() + found[1:]


def _told(a: Mapping[str, Any], member: str, u: Units, t: Texts) -> str:
    """→ the shop's text where the record has the program's own; what the record says otherwise."""
    key, effect = f"cause.{a.get('cause')}.{member}", f"{float(a.get('on_part_um') or 0.0):.1f} µm"
    own = str(a.get(member) or "")
    return t(key, effect=effect) if key in t and own == texts()(key, effect=effect) else own


def _amount(a: Mapping[str, Any], u: Units) -> str:
    """→ '+20.3 ± 0.5 µm'; without ± where no uncertainty is on record."""
    if not a.get("size"):
        return ""
    factor, unit = u.coefficient(str(a.get("unit") or "mm"))
    value, std = float(a["size"]) * factor, abs(float(a.get("std") or 0.0) * factor)
    decimals = 0 if std >= 10 else 1 if std >= 0.095 or not std else 2
    number = f"{value:+.{decimals}f}".replace("-", "−")
    return f"{number} ± {std:.{decimals}f} {unit}" if std else f"{number} {unit}"


def _limit(x: Mapping[str, Any], u: Units) -> dict[str, Any]:
    factor, unit = u.of(str(x.get("unit") or ""))
    shown = {key: None if x.get(key) is None else f"{float(x[key]) * factor:.1f}" for key in ("value", "low", "high", "limit")}
    state = "open" if x.get("passed") is None else "good" if x["passed"] else "stop"
    return {**x, **shown, "unit": unit, "state": state}


def _reasons(record: Mapping[str, Any], u: Units) -> list[str]:
    return [sentence(r, u) for r in (record.get("plausible") or {}).get("reasons") or ()]


def _change(record: Mapping[str, Any], u: Units) -> dict[str, Any]:
    found = record.get("change") or {}
    return {**found, "text": f"{sentence(found.get('text'), u).rstrip('.')}." if found.get("text") else ""}


def _volume(record: Mapping[str, Any], u: Units) -> dict[str, str]:
    v = record.get("volume") or {}
    k = u.per_micron
    return {key: f"{float(v[key]) * k:.1f}" for key in ("worst_um", "rms_um", "std_um") if v.get(key) is not None}


def _parameters(record: Mapping[str, Any], u: Units) -> list[dict[str, Any]]:
    rows = []
    for name, p in (record.get("parameters") or {}).items():
        factor, unit = u.coefficient(str(p.get("unit") or ""))
        value, std = float(p["value"]) * factor, float(p.get("std") or 0.0) * factor
        low, high = (float(p.get(key, p["value"])) * factor for key in ("low", "high"))
        change = None if p.get("change") is None else float(p["change"]) * factor
        rows.append(
            {
                "name": name,
                "value": value_text(value, std),
                "low": value_text(low, std),
                "high": value_text(high, std),
                "unit": unit,
                "change": "–" if change is None else ("+" if change > 0 else "") + value_text(change, std),
                "much": change is not None and abs(change) > 2 * (high - low) / 4,
                "seen": bool(p.get("seen", True)),
            }
        )
    return rows


def strip(nights: Sequence[tuple[str, str, str]], label: str) -> Markup:
    """(date, verdict, address) of nights, oldest first, what it is → a row of signs, one a night, by shape and color."""
    wide = 14.0
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {max(wide * len(nights), wide):g} 16" '
        f'width="{max(wide * len(nights), wide):g}" height="16" role="img" aria-label="{svg.escape(label)}">'
    ]
    for i, (date, verdict, _) in enumerate(nights):
        x = wide * i + wide / 2
        tip = f"<title>{svg.escape(date)}: {svg.escape(verdict.replace('_', ' '))}</title>"
        parts.append(f"<g>{tip}{_sign(verdict, x)}</g>")
    return Markup("".join([*parts, "</svg>"]))


def _sign(verdict: str, x: float) -> str:
    if verdict == "not_measured":
        return f'<circle cx="{x:g}" cy="8" r="4" fill="none" stroke="{svg.SOFT}" stroke-width="1.6"/>'
    level = LEVELS.get(verdict, "stop")
    if level == "good":
        return f'<circle cx="{x:g}" cy="8" r="3.4" fill="#00694c"/>'
    if level == "look":
        return f'<path d="M{x:g} 1.5l6 12h-12z" fill="#b06a00"/>'
    return f'<path d="M{x - 5:g} 3h10v10h-10z" fill="#b3261e"/>'
