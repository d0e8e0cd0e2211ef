"""Journal → readings, and what `readings.json` says of them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import Any

import numpy as np

from ..records import Array, Plan, Readings
from .entries import Again, End, Entry, Identity, ProgramSent, Reading, RefusedRecord, by_no_machine

Entries = Sequence[Entry]


def readings_of(entries: Entries, plan: Plan) -> Readings | None:
    """entries of a journal, plan of the whole run → readings in the order of measurement; None when there are none."""
    found = [entry for entry in entries if isinstance(entry, Reading)]
    if not found:
        return None
    # The parts of a run are one segment.
    begun = accumulate(isinstance(entry, ProgramSent) and entry.part[0] == 1 for entry in entries)
    numbers = [number for number, entry in zip(begun, entries, strict=True) if isinstance(entry, Reading)]
    segment = np.unique(numbers, return_inverse=True)[1].astype(np.int64) + 1  # a segment without a reading is none
    facet = {touch.number: touch.facet for touch in plan.touches}
    return Readings(
        plan.machine.names,
        np.array([entry.touch for entry in found], dtype=np.int64),
        np.array([entry.time_s for entry in found], dtype=float),
        tuple(facet[entry.touch] for entry in found),
        np.array([entry.position for entry in found], dtype=float),
        np.array([entry.direction for entry in found], dtype=float),
        tuple(entry.status for entry in found),
        np.ones(len(found), dtype=np.int64),
        np.ones(len(found), dtype=np.int64),
        np.full(len(found), plan.strategy.approach.feed),
        temperatures=_temperatures(found),
        segment=segment if segment.max() > 1 else None,
        stylus=np.full(len(found), plan.machine.stylus) if plan.machine.styli else None,
    )


def _temperatures(found: Sequence[Reading]) -> dict[str, Array]:
    """readings of a journal → {sensor: (n,) °C}, NaN where nobody said it."""
    names = list(dict.fromkeys(name for entry in found for name in entry.temperatures or {}))
    said = {name: [(entry.temperatures or {}).get(name) for entry in found] for name in names}
    return {name: np.array([np.nan if value is None else value for value in values]) for name, values in said.items()}


def missing(entries: Entries, plan: Plan) -> tuple[int, ...]:
    """entries of a journal, plan of the whole run → touches that have no reading yet."""
    got = {entry.touch for entry in entries if isinstance(entry, Reading)}
    return tuple(touch.number for touch in plan.touches if touch.number not in got)


def provenance(entries: Entries, plan: Plan, digest: str | None = None) -> dict[str, Any]:
    """entries of a journal, plan of the whole run, hash of its last line → where the readings come from (readings.json)."""
    sent = [entry for entry in entries if isinstance(entry, ProgramSent)]
    first = sent[0]
    identity = [entry.text for entry in entries if isinstance(entry, Identity)]
    statuses = [entry.status for entry in entries if isinstance(entry, Reading)]
    ends = [entry for entry in entries if isinstance(entry, End)]
    return {
        "format": "tango-run/1",
        "program_hash": first.program_hash,
        "plan_hash": first.plan_hash,
        "machine": first.machine,
        "controller": {**first.controller, "identity": identity[0] if identity else None},
        **({"resume": first.how} if first.how != "--resume" else {}),
        **({"simulated": True} if any(by_no_machine(s) for s in sent) else {}),
        "start_utc": first.utc,
        "end_utc": ends[-1].utc if ends else None,
        "tool_version": first.tool_version,
        "journal_hash": digest,
        "touches": len(plan.touches),
        **{status: statuses.count(status) for status in ("ok", "miss", "early")},
        "missing": list(missing(entries, plan)),
        "refused": [{"record": entry.record, "why": entry.why} for entry in entries if isinstance(entry, RefusedRecord)],
        "repeated": [{"touch": e.touch, "status": e.status, "moved_mm": e.moved_mm} for e in entries if isinstance(e, Again)],
        "segments": [{"start_utc": entry.utc, "program_hash": entry.program_hash, "touches": len(entry.touches)} for entry in sent],
        "left_out": list(plan.left_out.values()),
        "left_out_touches": list(plan.left_out),
    }
