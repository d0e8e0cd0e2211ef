"""Columns of a night in a list, made from its record and its readings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ._asked import COLUMNS


def rows_of(readings: str) -> int:
    """text of readings.csv → how many touches it has."""
    return max(readings.count("\n") - 1, 0)


def columns_of(record: Mapping[str, Any]) -> dict[str, Any]:
    """record of a night → its columns in a list: all of them come from the record, so a change of one shows."""
    residual, change, volume = record.get("residual") or {}, record.get("change") or {}, record.get("volume") or {}
    return {
        **{key: record[key] for key in COLUMNS[:7]},
        "alarms": len(record.get("alarms", ())),
        "p_value": change.get("p_value"),
        "touches": int(record.get("touches") or 0),
        "rms_um": residual.get("rms_um"),
        "volume_um": volume.get("worst_um"),
        "duration_s": float(record.get("duration_s") or 0.0),
    }
