"""The record of a night (tango-night/1, docs/nightly.md) → the morning page: one screen of a phone, then the engineer's part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from ..records import InputError
from . import svg
from .page import environment, rendered, value_text
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


def render(record: Mapping[str, Any], decisions: Sequence[Any] = (), units: Units | None = None, folder: Path | None = None) -> str:
    """tango-night/1, decisions about its alarms, units, a shop's templates → HTML that stands alone. Raises InputError."""
    if record.get("format") != FORMAT:
        raise InputError(f"night: found format {record.get('format')!r}; allowed: {FORMAT}")
    return rendered(environment(folder), "morning.html", context(record, decisions, units, texts_of(folder)))


def context(
    record: Mapping[str, Any], decisions: Sequence[Any], units: Units | None, t: Texts, strip: Sequence[tuple[str, str]] = ()
) -> dict[str, Any]:
    """record, decisions about its alarms, units, texts, (date, verdict) of nights before → values for the page."""
    u = units or Units()
    by_alarm = {d.alarm: d for d in decisions}  # the last one counts
    alarms = [_alarm(a, by_alarm.get(str(a.get("id"))), u, t) for a in record.get("alarms") or ()]
    level = LEVELS.get(str(record.get("verdict")), "stop")
    first = alarms[0] if alarms else _earlier(record, by_alarm, u, t)
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
        "headline": sentence(record.get("headline"), u),
        "level": level,
        "word": t(f"morning.{record.get('verdict')}") if f"morning.{record.get('verdict')}" in t else str(record.get("verdict")),
        "alarms": alarms,
        "first": first,
        "failed": [{"do": "", "found": "", **p} for p in record.get("preflight") or () if not p.get("passed")],
        "preflight": record.get("preflight") or (),
        "limits": [_limit(x, u) for x in record.get("limits") or ()],
        "parameters": _parameters(record, u),
        "volume": _volume(record, u),
        "strip": strip,
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


def _earlier(record: Mapping[str, Any], decisions: Mapping[str, Any], u: Units, t: Texts) -> dict[str, Any] | None:
    """a night without an alarm of its own → what stands behind a crossed limit, else the newest alarm that nobody has closed."""
    standing, behind = record.get("standing") or (), record.get("behind") or ()
    if behind and (record.get("verdict") == "out_of_limits" or not standing):
        return _alarm({"owner": record.get("owner"), **behind[0]}, None, u, t)
    if not standing:
        return None
    a = standing[0]
    shown = _alarm(a, decisions.get(str(a.get("id"))), u, t)
    now = sentence(a.get("now"), u)
    return shown | {
        "older": True,
        "night": str(a.get("night")),
        "text": f"{shown['text'].rstrip('.')}. {now}" if now else shown["text"],
    }


def _alarm(a: Mapping[str, Any], decision: Any, u: Units, t: Texts) -> dict[str, Any]:
    text = sentence(a.get("text"), u)
    size = _amount(a, u)
    if " ± " in text or u.sentence("0 µm").split()[1] in text:  # it says its size already
        size = ""
    owner = (decision.owner if decision is not None else None) or a.get("owner")
    return {
        **a,
        "text": text,
        "night": str(a.get("id") or "")[:10],
        "cause": str(a.get("cause") or "").replace("_", " "),
        "amount": size,
        "on_part": sentence(_told(a, "on_part", u, t), u),
        "todo": sentence(_told(a, "do", u, t), u),
        "instead": [str(x).replace("_", " ") for x in a.get("instead") or ()],
        "owner": owner,
        "decision": decision,
        "decided": "" if decision is None else t(f"decision.{decision.action}"),
    }


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
