"""The chain of a machine: every entry carries the hash of the one before it, so that what was changed or cut out shows."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from ..texts import carried

FIRST = "0" * 64


def written(record: Mapping[str, Any]) -> str:
    """record of a night → its JSON, with keys and values of its texts."""
    return canonical(carried(record))


def canonical(data: Any) -> str:
    """plain data → the one JSON text that is hashed: sorted keys, no blanks, finite numbers."""
    return json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def sha256(data: str | bytes) -> str:
    """text or bytes → hex."""
    return hashlib.sha256(data.encode() if isinstance(data, str) else data).hexdigest()


def content_of_night(record: str, readings: str | None, numbers: bytes | None, names: str | None) -> str:
    """record as stored, SHA-256 of readings.csv, bytes of the estimate, its names as stored → SHA-256 of all that a night holds."""
    if names is None:
        return content_without_names(record, readings, numbers)
    return sha256(canonical([sha256(record), readings, None if numbers is None else sha256(numbers), sha256(names)]))


def content_without_names(record: str, readings: str | None, numbers: bytes | None) -> str:
    """The same as it was hashed up to November 2026. A night that was added since never has this hash, whatever its names are."""
    return sha256(canonical([sha256(record), readings, None if numbers is None else sha256(numbers)]))


def content_of_decision(row: Mapping[str, Any]) -> str:
    """alarm, action, until, owner, note, utc → SHA-256."""
    return sha256(canonical([row[key] for key in ("alarm", "action", "until", "owner", "note", "utc")]))


def content_of_compensation(row: Mapping[str, Any]) -> str:
    """columns of a compensation's event → SHA-256."""
    names = ("number", "target", "event", "text", "before_um", "promised_um", "measured_um", "line", "utc")
    return sha256(canonical([row[name] for name in names]))


def link(machine: str, number: int, kind: str, utc: str, content: str, previous: str) -> str:
    """what an entry says, hash of the one before it → its hash."""
    return sha256(canonical([machine, number, kind, utc, content, previous]))
