"""What a journal says: one frozen record a kind of entry, and plain data ↔ records, shape and values looked at.

An event of a client is said in the past, and the entry that a session makes of it is its noun: Identified → Identity, Begun →
StartMark, Touched → Reading, Refused → RefusedRecord, Ended → End. `kind` is what the file calls it, and older journals too.
"""

from __future__ import annotations

import math
import re
import types
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, fields
from functools import cache
from typing import Any, ClassVar, Union, get_args, get_origin, get_type_hints

UTC = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?\+00:00")
STATUSES = ("ok", "miss", "early")


@dataclass(frozen=True)
class Opened:
    """The first entry: which format this is."""

    kind: ClassVar[str] = "journal"
    format: str


@dataclass(frozen=True)
class ProgramSent:
    """A program goes out; `part` is (which, of how many) programs of the plan."""

    kind: ClassVar[str] = "segment"
    utc: str
    tool_version: str
    machine: str
    controller: Mapping[str, str]  # post, port, simulated
    plan_hash: str
    program_hash: str
    touches: tuple[int, ...]
    part: tuple[int, ...] = (1, 1)
    how: str = "--resume"  # what 'tango run' has to state to go on with this run
    expected_s: float | None = None  # s that its touches take by the plan


def by_no_machine(entry: ProgramSent) -> bool:
    """segment of a run → whether a simulated control was to make its touches (`tango run --simulated`)."""
    return entry.controller.get("simulated") == "yes"


@dataclass(frozen=True)
class Identity:
    """What the control said it is."""

    kind: ClassVar[str] = "identity"
    text: str


@dataclass(frozen=True)
class StartMark:
    """The start mark came. `clock_s` is the computer's clock that nobody sets, which counts from its start `boot`."""

    kind: ClassVar[str] = "begun"
    utc: str
    time_s: float
    boot: str | None = None
    clock_s: float | None = None


@dataclass(frozen=True)
class Reading:
    """A touch: mm, rad in the order of the machine's axes; s since the first start mark; µm along the outward normal."""

    kind: ClassVar[str] = "reading"
    touch: int
    facet: str
    position: tuple[float, ...]
    time_s: float
    status: str
    deviation_um: float | None
    drift_um: float | None
    direction: tuple[int, ...]  # of the last motion of every axis: -1, 0, 1
    record: str
    temperatures: Mapping[str, float | None] | None = None  # °C, of sensors.yaml; None where nobody said it


@dataclass(frozen=True)
class Again:
    """A touch that a resumed run repeated, and how far it was from the first time, mm."""

    kind: ClassVar[str] = "again"
    touch: int
    status: str
    moved_mm: float | None
    time_s: float


@dataclass(frozen=True)
class RefusedRecord:
    """A record that was not believed, and why."""

    kind: ClassVar[str] = "refused"
    why: str
    record: str
    time_s: float


@dataclass(frozen=True)
class End:
    """The end of a segment; `stands`: the control said that its program has come to its end."""

    kind: ClassVar[str] = "end"
    complete: bool
    why: str
    utc: str
    stands: bool = False


Entry = Opened | ProgramSent | Identity | StartMark | Reading | Again | RefusedRecord | End
KINDS: Mapping[str, type[Entry]] = {kind.kind: kind for kind in get_args(Entry)}
HINTS = {kind: get_type_hints(kind) for kind in get_args(Entry)}


def plain(entry: Entry) -> dict[str, Any]:
    """entry → its kind and members, as JSON has them."""
    return {"kind": entry.kind, **asdict(entry)}


def entry_of(data: Mapping[str, Any]) -> Entry:
    """plain data of one line → entry; members that this version does not know are left out.

    Raises ValueError that names the member, what was found and what is allowed.
    """
    kind = KINDS.get(data.get("kind", ""))
    if kind is None:
        raise ValueError(f"kind: found {data.get('kind')!r:.60}; allowed: {', '.join(KINDS)}")
    given: dict[str, Any] = {}
    for field in fields(kind):
        if field.name in data:
            given[field.name] = _value(field.name, data[field.name], HINTS[kind][field.name])
        elif field.default is MISSING:
            raise ValueError(f"{kind.kind}: {field.name} is missing")
    entry = kind(**given)
    _judged(entry)
    return entry


@cache
def _shape(kind: Any) -> tuple[Any, tuple[Any, ...]]:
    return get_origin(kind), get_args(kind)


def _value(name: str, value: Any, kind: Any) -> Any:
    """member, what was found, its type → the value of that type. Raises ValueError."""
    origin, inner = _shape(kind)
    if origin in (Union, types.UnionType):
        return None if value is None else _value(name, value, inner[0])
    if origin is tuple and isinstance(value, list):
        return tuple(_value(name, item, inner[0]) for item in value)
    if origin is not None and issubclass(origin, Mapping) and isinstance(value, dict):
        return {str(key): _value(name, item, inner[1]) for key, item in value.items()}
    if kind is float and isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return float(value)
    if kind in (int, bool, str) and type(value) is kind:
        return value
    wanted = {float: "a finite number", int: "a whole number", bool: "true or false", str: "a text"}.get(kind, "a list")
    raise ValueError(f"{name}: found {value!r:.60}; allowed: {wanted}")


def _judged(entry: Entry) -> None:
    """Raises ValueError for values of the right type that no run writes."""
    if isinstance(entry, Reading):
        if entry.status not in STATUSES:
            raise ValueError(f"status: found {entry.status!r:.60}; allowed: {', '.join(STATUSES)}")
        if len(entry.direction) != len(entry.position) or not set(entry.direction) <= {-1, 0, 1}:
            raise ValueError(f"direction: found {list(entry.direction)!r:.60}; allowed: -1, 0 or 1 for each axis of position")
    if isinstance(entry, Reading | Again) and entry.touch < 1:
        raise ValueError(f"touch: found {entry.touch}; allowed: 1 and more")
    if isinstance(entry, ProgramSent | StartMark | End) and not UTC.fullmatch(entry.utc):
        raise ValueError(f"utc: found {entry.utc!r:.60}; allowed: a time such as 2026-05-01T06:00:00.000+00:00")
    if isinstance(entry, ProgramSent) and not (len(entry.part) == 2 and 1 <= entry.part[0] <= entry.part[1]):
        raise ValueError(f"part: found {list(entry.part)!r:.60}; allowed: [which, of how many]")
    if isinstance(entry, ProgramSent) and not (entry.how.startswith("--resume") and entry.how.isprintable()):
        raise ValueError(f"how: found {entry.how!r:.60}; allowed: --resume and what else 'tango run' has to state")
    if isinstance(entry, ProgramSent) and (entry.expected_s or 0.0) < 0:
        raise ValueError(f"expected_s: found {entry.expected_s}; allowed: 0 and more")
    if isinstance(entry, ProgramSent) and {"post", "port"} - set(entry.controller):
        raise ValueError("controller: post or port is missing")
    if isinstance(entry, StartMark | Reading | Again | RefusedRecord) and entry.time_s < 0:
        raise ValueError(f"time_s: found {entry.time_s}; allowed: 0 and more")
