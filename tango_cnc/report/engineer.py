"""The engineer's part of the morning page: preflight, limits, parameters, and what a night was judged by."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .alarm import sentence
from .plain import value_text
from .texts import Texts
from .units import Units


def numbers(record: Mapping[str, Any], u: Units, t: Texts) -> dict[str, Any]:
    """record, units, texts → values of that part."""
    return {
        "failed": [{"do": "", "found": "", **_checked(p, t)} for p in record.get("preflight") or () if not p.get("passed")],
        "preflight": [_checked(p, t) for p in record.get("preflight") or ()],
        "limits": [_limit(x, u, t) for x in record.get("limits") or ()],
        "parameters": _parameters(record, u),
        "volume": _volume(record, u),
        "plausible": {"verdict": "", **(record.get("plausible") or {}), "reasons": _reasons(record, u, t)},
        "diagnosis": {"verdict": "", **(record.get("diagnosis") or {})},
        "temperatures": record.get("temperatures") or {},
        "hashes": record.get("hashes") or {},
        "versions": record.get("versions") or {},
        "change": _change(record, u, t),
        "residual": record.get("residual") or {},
    }


def _checked(point: Mapping[str, Any], t: Texts) -> dict[str, Any]:
    """one check before the start, texts → the same in their language."""
    key = f"check_name.{point.get('check')}"
    return {**t.all(point), "check": t(key) if key in t else point.get("check")}


def _limit(x: Mapping[str, Any], u: Units, t: Texts) -> dict[str, Any]:
    factor, unit = u.of(str(x.get("unit") or ""))
    shown = {key: None if x.get(key) is None else f"{float(x[key]) * factor:.1f}" for key in ("value", "low", "high", "limit")}
    state = "open" if x.get("passed") is None else "good" if x["passed"] else "stop"
    what = str(x.get("what"))
    name = t(f"followed.{what}") if f"followed.{what}" in t else what
    return {**x, **shown, "what": name, "unit": unit, "state": state}


def _reasons(record: Mapping[str, Any], u: Units, t: Texts) -> list[str]:
    return [sentence(r, u, t) for r in (record.get("plausible") or {}).get("reasons") or ()]


def _change(record: Mapping[str, Any], u: Units, t: Texts) -> dict[str, Any]:
    found = record.get("change") or {}
    return {**found, "text": f"{sentence(found.get('text'), u, t).rstrip('.')}." if found.get("text") else ""}


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
