"""A knock, a restart, a re-seated or remounted table: everything sits somewhere else from one touch on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..records import Machine
from ..touches import Touches
from . import Cause, Coefficient, Shape
from ._cause import Variants, displaced, label, moments, onsets, since, times, turns


def variants(touches: Touches) -> Variants:
    """touches → every moment, in both frames where the table turns."""
    for at in moments(touches):
        for frame in ("machine", "table") if turns(touches) else ("machine",):
            yield {"at": at, "frame": frame}


def make(machine: Machine, at: float, frame: str = "machine", direction: Sequence[float] | None = None) -> list[Coefficient]:
    """machine, first touch after it (its number in the readings) → displacement in x y z of that frame, mm."""
    return displaced(label("step", int(at), frame), frame, since(at), direction)


def unnamed(touches: Touches, rows: int) -> Iterator[Shape]:
    """touches, rows that are searched → steps, without its name."""
    for after in onsets(touches, rows):
        yield "time", "machine", "step", times(after, touches.machine_normal)
        yield "time", "table", "step", times(after, touches.normal)


TERM = Cause(
    text="something moved at once (restart, re-seated probe, remounted table, knock)",
    source="change-point model; thesis section 7.3 (dismount and remount)",
    frame="machine or table",
    mistaken=("thermal_drift", "table_drift"),
    says="everything moved {size} {towards} {moment}, {clock} after the start",
    meaning="parts before and after that moment do not fit together; a calibration across it describes neither machine",
    advice="find out what happened at that moment and measure again; keep the term only if it cannot be repeated",
    refine={"at": "touch"},
    variants=variants,
    make=make,
    role="interruption",
    unnamed=unnamed,
)
