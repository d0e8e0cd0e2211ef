"""What several tests share of history."""

from __future__ import annotations

from typing import Any

import numpy as np

from tango_cnc.history import Knowledge


def record(day: int, machine: str = "M", **more: Any) -> dict[str, Any]:
    night = f"2026-10-{day:02d}"
    return {
        **{"format": "tango-night/1", "machine": machine, "cell": "/cells/m", "night": night},
        **{"start_utc": f"{night}T02:00:00Z", "end_utc": f"{night}T02:04:00Z", "duration_s": 240.0, "kind": "check"},
        **{"status": "complete", "verdict": "good", "headline": "nothing has changed", "alarms": [], "touches": 74},
        "parameters": {"EX0C": {"value": 0.001 * day, "std": 0.0002, "unit": "mm"}},
        **more,
    }


COMPENSATION = {"utc": "2026-10-03T09:00:00Z", "compensation": 1, "target": "siemens"}
EVENTS = (
    {**COMPENSATION, "event": "proposed", "promise": {"rms_before_um": {"value": 30.0}, "rms_after_um": {"value": 2.0}}},
    {**COMPENSATION, "event": "written", "utc": "2026-10-03T10:00:00Z"},
    {**COMPENSATION, "event": "rolled back", "utc": "2026-10-03T11:00:00Z", "measured_um": 58.0, "text": "a sign is wrong"},
)


def knowledge(day: int) -> Knowledge:
    root = np.tril(np.random.default_rng(day).normal(size=(4, 4)))
    return Knowledge(("EX0C", "EA0B", "EXt", "EZf3"), np.arange(4.0) * day, root @ root.T)
