"""What comes out of a database is what a history puts into it, or it is refused in a sentence."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import Column, Float, Integer, LargeBinary, Row, Select

from ..files.readjson import parse_json
from ..files.shape import misfit
from ..records import InputError
from ..texts import revived
from . import _asked as asked
from . import _tables as t
from .records import Knowledge, Night

NONE = frozenset({type(None)})
LONGEST = 64 << 20  # bytes of readings or numbers, unpacked: no night has a hundredth of it
AGAIN = "'tango history verify' lists what is damaged; 'tango history restore' brings a backup back"
BESIDE = (t.night_readings, t.night_estimate)  # which not every night has
ALARM = {"id": str, "cause?": str, "size?": float, "std?": float, "text?": str, "do?": str, "since?": str, "unit?": str}
NIGHT = {
    **dict.fromkeys(("machine", "night", "start_utc", "end_utc", "kind", "status", "verdict", "headline"), str),
    "format": str,
    "alarms": [ALARM],
    "standing?": [ALARM],
    "parameters?": {"*": {"value": float, "std": float, "unit?": str, "change?": float, "low?": float, "high?": float}},
    **{f"{name}?": [{}] for name in ("preflight", "limits", "behind")},
    **{f"{name}?": {} for name in ("change", "residual", "volume", "diagnosis", "plausible", "temperatures", "next", "artefacts")},
    "sensors?": {"*": {"state": str}},
    **{f"{name}?": {} for name in ("hashes", "versions", "said", "trend", "state")},
    **dict.fromkeys(("touches?", "planned?", "duration_s?"), float),
}


def rows(wanted: Select[Any], found: Sequence[Row[Any]]) -> None:
    """question, its answers → each value is of the kind of its column. Raises InputError for the first that is not."""
    if not found:
        return
    for (name, kind, may), values in zip(_kinds(wanted), zip(*found, strict=True), strict=True):
        types = set(map(type, values))
        if types <= (kind | NONE if may else kind) and (float not in types or all(map(math.isfinite, filter(None, values)))):
            continue
        for value in values:
            if value is None and may:
                continue
            if type(value) not in kind or (isinstance(value, float) and not math.isfinite(value)):
                raise InputError(f"history: {name}: found {value!a:.40}; allowed: {_word(kind)}; {AGAIN}")


@lru_cache(64)
def _kinds(wanted: Select[Any]) -> tuple[tuple[str, frozenset[type], bool], ...]:
    """question → name, types and whether it may be absent, of each column of its answers."""
    found = []
    for column in wanted.selected_columns:
        stored = isinstance(column, Column) and column.table not in BESIDE
        found.append((column.name, _kind(column.type), not stored or bool(column.nullable)))
    return tuple(found)


def _kind(column: Any) -> frozenset[type]:
    if isinstance(column, Integer):
        return frozenset({int})
    if isinstance(column, Float):
        return frozenset({int, float})
    return frozenset({bytes if isinstance(column, LargeBinary) else str})


def _word(kind: frozenset[type]) -> str:
    return "a number" if int in kind else "packed numbers or text" if bytes in kind else "a text"


def record(text: str, entry: int | None = None) -> Mapping[str, Any]:
    """JSON of the record of a night, its entry → the record, whose texts know their keys. Raises InputError for anything else.

    The same text is not read twice: what is in it is shared.
    """
    data, wrong = _record(text)
    if data is not None:
        return dict(data)
    which = "" if entry is None else f" of night {entry}"
    raise InputError(f"history: the record{which}: {wrong[:200]}; {AGAIN}")


@lru_cache(128)  # a night looks at the last sixty more than once
def _record(text: str) -> tuple[Mapping[str, Any] | None, str]:
    """JSON of the record of a night → the record, or None and what is wrong with it."""
    try:
        data = parse_json(text)
        if wrong := misfit(data, NIGHT):
            return None, wrong
    except ValueError as error:
        return None, str(error)
    try:
        return revived(data), ""
    except (ValueError, TypeError):
        return None, "said: found texts that do not belong together"


def readings(packed: bytes) -> str:
    """packed text of readings.csv → that text. Raises InputError where it is damaged."""
    try:
        return _unpacked(packed).decode()
    except (ValueError, zlib.error):
        raise InputError(f"history: found readings that cannot be unpacked; {AGAIN}") from None


@lru_cache(4)  # a night asks for the newest more than once
def knowledge(names: str, packed: bytes | None) -> Knowledge:
    """JSON list of p names, packed numbers → all unknowns of a night. Raises InputError where they are damaged."""
    try:
        known = parse_json(names)
        data = np.frombuffer(_unpacked(packed or b""), "<f8")
        p = len(known)
        if misfit(known, [str]) or len(data) != p + p * (p + 1) // 2 or not np.isfinite(data).all():
            raise ValueError
    except (ValueError, TypeError, zlib.error):
        raise InputError(f"history: found an estimate that cannot be unpacked; {AGAIN}") from None
    covariance = np.zeros((p, p))
    covariance[lower_of(p)] = data[p:]
    whole, values = covariance + np.tril(covariance, -1).T, np.array(data[:p])
    for shared in (whole, values):
        shared.setflags(write=False)
    return Knowledge(tuple(known), values, whole)


@lru_cache(4)
def lower_of(count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """p unknowns → rows and columns of the lower triangle of their covariance, in the order in which it is packed."""
    return np.tril_indices(count)


def _unpacked(packed: bytes) -> bytes:
    """zlib → bytes, no more than anybody has packed. Raises ValueError, zlib.error."""
    machine = zlib.decompressobj()
    data = machine.decompress(packed, LONGEST)
    if not machine.eof:
        raise ValueError("cut off, or longer than any night")
    return data


def night(row: Row[Any]) -> Night:
    """row of a night → the night as it is listed."""
    return listed(Night(row.entry_id, row.name, *(getattr(row, key) for key in asked.COLUMNS)))


def listed(found: Night) -> Night:
    """night as it is stored → as it is listed: a night in doubt has no error at the tool tip that curves and exports may show."""
    return replace(found, volume_um=None) if found.verdict == "doubtful" and found.volume_um is not None else found
