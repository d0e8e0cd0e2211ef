"""Nights as `tango nightly` writes them (docs/nightly.md), invented for pages: nothing here was measured."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

M = "HU40T-like"  # the machine of the cells in which a test says no other
FIRST = datetime(2026, 10, 24, 2, 0, tzinfo=UTC)
BEYOND = {"what": "volume", "value": 51.0, "low": 50.0, "high": 52.0, "limit": 45.0, "unit": "µm", "passed": False}
NOTHING: dict[str, Any] = {"status": "failed", "kind": "none", "touches": 0, "parameters": None, "volume": None, "limits": []}
NOTHING |= {"why": "the probe did not answer"}
NAMES = {
    "EX0C": ("mm", -0.1138),
    "EY0C": ("mm", 0.012),
    "EA0B": ("rad", -2.4e-5),
    "EYY1-EXX1": ("mm/mm", 1.4e-5),
    "EC0Y": ("rad", 9e-6),
}


def night(machine: str, number: int, verdict: str = "good", **more: Any) -> dict[str, Any]:
    """machine, number of the night from 0, verdict, members that replace the usual ones → tango-night/1."""
    start = FIRST + timedelta(days=number)
    rng = np.random.default_rng(number)
    step = 0.0198 if number >= 12 else 0.0
    drift = 0.0012 * max(0, number - 20)
    parameters: dict[str, Any] = {}
    for name, (unit, value) in NAMES.items():
        std = 0.0003 if unit == "mm" else 1.2e-6
        now = value + rng.normal(0, 0.6 * std) + (step if name == "EX0C" else 0.0) + (drift if name == "EY0C" else 0.0)
        change = step if name == "EX0C" and number == 12 else float(rng.normal(0, 0.8 * std))
        parameters[name] = {
            **{"value": now, "unit": unit, "std": std, "low": now - 1.96 * std, "high": now + 1.96 * std},
            **{"change": change, "rate_per_day": 0.0, "seen": name != "EC0Y" or number % 7 == 0},
        }
    worst = 21.3 + 1e3 * step * 0.5 + 1e3 * drift + float(rng.normal(0, 0.4))
    record: dict[str, Any] = {
        **{"format": "tango-night/1", "machine": machine, "cell": "/srv/cells/one", "night": start.strftime("%Y-%m-%d")},
        **{"start_utc": _stamp(start), "end_utc": _stamp(start + timedelta(seconds=250)), "duration_s": 250.0},
        **{"machine_time_s": 214.0, "kind": "full" if number % 7 == 0 else "check", "status": "complete", "why": ""},
        **{"verdict": verdict, "headline": f"As the night before; largest error of the tool tip {worst:.0f} µm, 45 µm are allowed"},
        "preflight": [{"check": "probe", "passed": True, "found": "answers, not triggered", "do": ""}],
        **{"touches": 74, "planned": 74, "alarms": [], "parameters": parameters},
        "change": {"p_value": 0.4, "statistic": 38.0, "dof": 38, "limit": 0.00137, "text": "One false alarm in 730 nights."},
        "volume": {"worst_um": worst, "rms_um": 9.8, "std_um": 0.9},
        "limits": [
            {"what": "volume", "value": worst, "unit": "µm", "low": worst - 2, "high": worst + 2, "limit": 45.0, "passed": True}
        ],
        "residual": {"rms_um": 0.64, "std_um": 0.69, "dof": 340},
        **{"plausible": {"verdict": "trustworthy", "reasons": []}, "diagnosis": {"verdict": "adequate", "findings": []}},
        "temperatures": {"bed": {"mean": 21.3, "first": 20.9, "last": 21.6}},
        "hashes": {"cell": "a" * 64, "plan": "b" * 64, "program": "c" * 64, "readings": "d" * 64},
        **{"versions": {"tango_cnc": "0.1.0"}, "artefacts": {"folder": f"nights/{start:%Y-%m-%dT%H%M%SZ}"}},
        "next": {"kind": "check", "why": "nothing is too uncertain"},
    }
    return record | more


def knock(date: str) -> dict[str, Any]:
    """date of the night → the alarm of a machine that was hit."""
    return {
        **{"id": f"{date}-1", "cause": "axis_location", "parameter": "EX0C"},
        "text": "The axis of C moved along X, all at once",
        **{"since": "2026-11-04", "size": 0.0198, "std": 0.0004, "unit": "mm", "rate_per_day": None, "sigmas": 49.5},
        **{"on_part_um": 19.8, "on_part": "A feature milled at C 0° and one at C 180° are 39.6 µm apart."},
        "do": "Look for a collision in the log of the control. Measure once more, then set the pivot of C to the new place.",
        **{"instead": ["stylus"], "owner": None, "decision": None},
    }


def thirty(machine: str) -> list[dict[str, Any]]:
    """machine → thirty nights: it is hit in night 12 and drifts from night 20 on; night 5 was not measured."""
    records = [night(machine, i) for i in range(30)]
    records[5] = night(
        machine,
        5,
        "not_measured",
        **{"status": "failed", "kind": "none", "why": "the probe did not answer", "touches": 0, "parameters": None, "volume": None},
        **{"headline": "Not measured: the probe did not answer", "change": None, "residual": None, "limits": []},
        preflight=[{"check": "probe", "passed": False, "found": "no answer", "do": "Change the battery of the probe."}],
    )
    records[12] = night(
        machine, 12, "changed", headline="EX0C moved by +19.8 ± 0.4 µm since last night", alarms=[knock(records[12]["night"])]
    )
    return records


def _stamp(moment: datetime) -> str:
    return moment.strftime("%Y-%m-%dT%H:%M:%SZ")


def into(history: Any, records: Sequence[dict[str, Any]]) -> None:
    """open history, records → added in their order."""
    for record in records:
        history.add_night(record, "touch,time_s\n1,0\n")


def dated(ago: float) -> dict[str, str]:
    """days before now → dates of a night."""
    start = datetime.now(UTC).replace(microsecond=0) - timedelta(days=ago)
    return {"night": f"{start:%Y-%m-%d}", "start_utc": f"{start:%Y-%m-%dT%H:%M:%SZ}", "end_utc": f"{start:%Y-%m-%dT%H:%M:%SZ}"}


def story(kind: str) -> list[dict[str, Any]]:
    """story → two nights, the newer one of today."""
    before, now = dated(1), dated(0)
    alarm = knock(now["night"]) | {"id": f"{now['night']}-1", "since": before["night"], "owner": "Ann"}
    bent = alarm | {"cause": "stylus", "parameter": "stylus", "text": "The tip has moved"}
    last = {
        "changed": night(M, 1, "changed", alarms=[alarm], **now),
        "beyond": night(M, 1, "out_of_limits", alarms=[alarm], limits=[BEYOND], **now),
        "probe": night(M, 1, "changed", alarms=[bent], **now),
        "moving": night(M, 1, "not_measured", moved=True, **NOTHING, **now),
        "nothing": night(M, 1, "not_measured", last_measured=before["night"], last_verdict="good", **NOTHING, **now),
        "doubtful": night(M, 1, "doubtful", plausible={"verdict": "implausible", "reasons": ["x"]}, **now),
    }[kind]
    return [night(M, 0, **before) | {"simulated": True}, last]


def hit(name: str) -> list[dict[str, object]]:
    """machine → two nights: it is hit in the second."""
    return [night(name, 0), night(name, 1, "changed", alarms=[knock("2026-10-25") | {"id": f"{name}-1"}])]
