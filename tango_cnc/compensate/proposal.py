"""Estimate, target, present values → a proposal: every number that changes, what it promises, and what it leaves."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np

from ..estimate import Estimate
from ..kinematics import Slot
from ..records import Array, InputError, Machine, TangoError
from . import hidden, targets, whose
from .fit import Fit, covering, fit, holding, known, rms
from .frame import said
from .hidden import Present
from .promise import Figure
from .space import Held, Limits, Poses, limits_of, sample
from .targets import Request
from .unparted import SEEN, unparted

FORMAT = "tango-compensation/1"
CAP_MM, CAP_DEG = 0.05, 0.01
EVEN = 1e-9  # mm, deg: what adding decimal numbers leaves
POSES = 1024
COMMON = 1e-5  # mm/mm, of all linear axes
ReadBack = Callable[[str, Mapping[str, object], Request, Mapping[str, str], Mapping[str, str], Poses], Array | None]


@dataclass(frozen=True)
class Proposal:
    """What is to be written into a control, and what that is worth."""

    target: str
    module: ModuleType
    request: Request
    fit: Fit
    numbers: Mapping[str, float]  # by place: what the control is to store
    present: Mapping[str, float]  # by place: what it stores now
    given: bool  # whether the present values were given and not assumed
    over: str
    uncorrected: Mapping[str, float]  # by place: what a control that corrects nothing stores where tool center point control acts
    unseen: float  # µm rms over the volume that the control takes away and the readings do not contain
    pinned: tuple[str, ...] = ()  # places of centers and directions that keep their values, as no touch shows them
    not_identifiable: tuple[str, ...] = ()  # what no touch shows of the machine, in sentences: none of the numbers contains it
    common_scale: float = 0.0  # µm rms over the volume that `COMMON` of it leaves, where no touch shows it; 0: they do
    bar: tuple[float, float] | None = None  # µm, of a scale bar: standard uncertainty, rms over the volume for each µm it is off
    doubts: tuple[str, ...] = ()  # whether the present values are those of this machine, in sentences
    unread: bool = False  # whether no reader is of a control with these settings: the promise is of the numbers, not of the files

    @property
    def held(self) -> tuple[Held, ...]:
        """→ every number that the target can store."""
        return self.fit.held

    @property
    def along(self) -> str:
        """→ where the control has x, y and z in machine.yaml; '' where both frames are one, and where no number has a direction."""
        counted = any(h.tcp or (h.slot is not None and h.slot.stage in ("inter", "intra")) for h in self.held)
        return said(self.request.described) if counted else ""

    @property
    def files(self) -> dict[str, str]:
        """→ {name: text} of what is written."""
        found: dict[str, str] = self.module.files(self.request, self.held, self.numbers)
        return found

    @property
    def undo(self) -> dict[str, str]:
        """→ {name: text} of the same files with the present values."""
        found: dict[str, str] = self.module.files(self.request, self.held, self.present)
        return found


def propose(
    result: Estimate,
    target: str,
    settings: Sequence[str] = (),
    present: Present | None = None,
    over: str = "probed",
    volume: Mapping[str, tuple[float, float]] | None = None,
    poses: int = POSES,
    tcp: bool | None = None,
    hidden_by: Mapping[str, float] | None = None,
    proven: bool = True,
    read_back: ReadBack | None = None,
) -> Proposal:
    """estimate, target, its settings, the control's present numbers, volume → proposal.

    `tcp`: whether the readings were made with tool center point control; asked for where present numbers act with it only.
    `hidden_by`: by label, by how much what no touch shows may move it, mm or rad: the promise contains it. `proven`: whether `tcp`
    is certain; where it is not, the promise holds for either. `read_back`: what the files take away, by a reader of the target;
    then the promise is of the files.
    Raises InputError for settings, volumes and present values that do not fit the target; TangoError when nothing is known.
    """
    module = targets.load(target)
    touches = result.model.touches
    machine = touches.machine
    limits = limits_of(machine, touches, over, volume or {})
    at = sample(machine, limits, poses)
    found = known(result, at)
    request = Request(machine, limits, targets.options(module, settings), found.coefficients)
    module.check(request)
    held: list[Held] = module.held(request)
    if not held:
        raise InputError(f"--target {target}: found settings with which nothing is stored; see 'tango compensate --facts {target}'")
    places = {h.place for h in held}
    there = Present({}, {}) if present is None else whose.matched(present, held)
    for place in there.numbers:
        if place not in places:
            if why := whose.unknown(place, there.numbers, held, request, target):
                raise InputError(
                    f"--present: found {place!r}: {why}; allowed: {_some(places)}. Take numbers "
                    f"{whose.CONTROL_OF.format(machine=machine.name)}, with the volume and settings that its tables have"
                )
            raise InputError(
                f"--present: found {place!r}, which this target with these settings does not store; allowed: {_some(places)}. "
                "Tables of other points cannot be added: give the same volume and settings as when they were written"
            )
    strange = whose.looked_at(there, held, request)
    now = {h.place: h.base for h in held} | dict(there.numbers)
    before = there.before(held)
    unseen = hidden.unseen(held, now, before)
    if tcp is None:
        hidden.asked(held, unseen)
    holds = holding(found, held, at, touches)
    off = np.where(holds.pinned, 0.0, unseen)
    unseen, other = (0 * off, off) if tcp else (off, 0 * off)
    doubts = np.array([(hidden_by or {}).get(result.selection.label(c.name), 0.0) for c in found.coefficients])
    acts = None
    if read_back is not None:
        change = holds.numbers(found, now, unseen)[1]
        written = _numbers(held, now, change)
        files, undo = (module.files(request, held, numbers) for numbers in (written, now))
        acts = read_back(target, {name: o.default for name, o in module.OPTIONS.items()}, request, files, undo, at)
        holds = holds if acts is None else replace(holds, lost=holds.space @ change - at.free(acts[:, None])[:, 0])
    best = fit(found, holds, now, unseen=unseen, spindle=unparted(result, at), doubts=doubts)
    if not proven and off.any():
        best = covering(best, holds, found, now, unseen, other)
    numbers = _numbers(held, now, best.change)
    given, size = present is not None, rms(holds.space @ unseen)
    said = over if not volume else "as given"
    not_shown = tuple(c.text for c in result.selection.unseen)
    pinned = tuple(h.place for h, kept in zip(held, holds.pinned, strict=True) if kept)
    return Proposal(
        target,
        module,
        request,
        best,
        numbers,
        now,
        given,
        said,
        before,
        size,
        pinned,
        not_shown,
        _common(result, at),
        _bar(result, at),
        strange,
        unread=read_back is not None and acts is None,
    )


def _numbers(held: Sequence[Held], now: Mapping[str, float], change: Array) -> dict[str, float]:
    """entries, the control's numbers, (h,) changes → {place: number} of the control with them."""
    return {h.place: h.number(h.value(now[h.place]) + float(c)) if c else now[h.place] for h, c in zip(held, change, strict=True)}


def _common(result: Estimate, at: Poses) -> float:
    """estimate, poses → µm rms that a common scale of `COMMON` makes; 0 where the touches show it.

    Axes count from machine zero: far from it a scale also moves the centers against the touches.
    """
    return _scaled(COMMON, at) if result.selection.relative else 0.0


def _bar(result: Estimate, at: Poses) -> tuple[float, float] | None:
    """estimate, poses → standard uncertainty of the scale bar, rms of the tip for each µm that it has another length than stated,
    µm; None where it was not touched."""
    bar = result.model.touches.artefact.scale_bar
    return None if bar is None or result.model.bar is None else (1e3 * bar.uncertainty, _scaled(1e-3 / bar.length, at))


def _scaled(scale: float, at: Poses) -> float:
    """mm/mm of all linear axes, poses → µm rms of the tip."""
    linear = at.machine.linear
    moved = sum((at.slots[Slot(a, "motion")] * at.touches.axis(a)[:, None] for a in linear), np.zeros((len(at), 3)))
    return rms(at.free(scale * moved.reshape(-1, 1))[:, 0])


def _some(places: set[str]) -> str:
    listed = sorted(places)
    return ", ".join(listed[:4]) + (f" … ({len(listed)} in all)" if len(listed) > 4 else "")


def beyond(proposal: Proposal, cap_mm: float, cap_deg: float) -> list[str]:
    """proposal, largest change allowed → a sentence for every number of the files that changes more, the largest first."""
    found = []
    for name, size, turn, over in changes(proposal):
        cap, unit = (cap_deg, f"deg{over}") if turn else (cap_mm, f"mm{over}")
        if size > cap + EVEN:
            found.append((size / cap, f"{name}: changes by {size:.4g} {unit}; allowed: {cap:g} {unit}"))
    return [text for _, text in sorted(found, reverse=True)]


def changes(proposal: Proposal) -> list[tuple[str, float, bool, str]]:
    """proposal → of every number of the files: its name, by how much it changes (mm or deg), whether deg, " over the volume".

    A ratio counts by the most that it does over the volume. The numbers that a target calculates count as well as those held.
    """
    machine, found = proposal.request.machine, []
    longest = max(high - low for name, (low, high) in proposal.request.limits.items() if name in machine.linear)
    for h, change in zip(proposal.held, proposal.fit.change, strict=True):
        if h.kind == "ratio":
            turn, size = h.unit.startswith("rad"), abs(float(change)) * (longest if h.reach is None else h.reach)
            found.append((h.place, math.degrees(size) if turn else size, turn, " over the volume"))
            continue
        size = abs(proposal.numbers[h.place] - proposal.present[h.place])
        turn = h.kind == "angle"
        found.append((h.place, math.degrees(size) if turn and h.unit != "deg" else size, turn, ""))
    derived = proposal.module.derived
    new, now = (derived(proposal.request, proposal.held, n) for n in (proposal.numbers, proposal.present))
    found += [(name, abs(d.value - now[name].value), d.unit == "deg", "") for name, d in new.items()]
    return found


def capped(proposal: Proposal, cap_mm: float, cap_deg: float) -> None:
    """proposal, largest change allowed → nothing. Raises TangoError that names what changes more."""
    over = beyond(proposal, cap_mm, cap_deg)
    if over:
        more = f" and {len(over) - 5} more" if len(over) > 5 else ""
        raise TangoError(
            f"compensate: {len(over)} of {len(changes(proposal))} numbers change by more than is allowed; nothing was written. "
            + "; ".join(over[:5])
            + more
            + ". See whether machine.yaml and readings belong to this machine; if the change is right, allow it with --cap-mm and "
            "--cap-deg"
        )


def as_json(proposal: Proposal) -> dict[str, Any]:
    """proposal → plain data of the format tango-compensation/1."""
    machine, best, promised = proposal.request.machine, proposal.fit, proposal.fit.promised

    def figure(f: Figure) -> dict[str, float]:
        return {"value": round(f.value, 4), "low": round(f.low, 4), "high": round(f.high, 4)}

    values = [
        {
            "place": h.place,
            "table": h.table,
            "unit": h.unit,
            "present": proposal.present[h.place],
            "new": proposal.numbers[h.place],
            "increment": h.increment,
        }
        | ({"uncorrected": proposal.uncorrected[h.place]} if h.tcp else {})
        for h in proposal.held
    ]
    return {
        "format": FORMAT,
        "target": proposal.target,
        "machine": machine.name,
        "topology": machine.topology,
        "options": dict(proposal.request.options),
        **({"along": proposal.along} if proposal.along else {}),
        "volume": {name: _limits(machine, name, proposal.request.limits) for name in proposal.request.limits},
        "over": proposal.over,
        "present_given": proposal.given,
        **({"present_doubts": list(proposal.doubts)} if proposal.doubts else {}),
        "unseen_um": round(proposal.unseen, 4),
        "keep_present": list(proposal.pinned),
        "not_identifiable": list(proposal.not_identifiable),
        **({"common_scale_um": round(proposal.common_scale, 4)} if proposal.common_scale else {}),
        **({"bar_um_per_um": round(proposal.bar[1], 4)} if proposal.bar else {}),
        "promise": {
            "rms_before_um": figure(promised.rms_before),
            "rms_after_um": figure(promised.rms_after),
            "p95_before_um": figure(promised.largest_before),
            "p95_after_um": figure(promised.largest_after),
            "rms_held_um": round(best.rms_holdable, 4),
            "rounding_um": round(best.rounding, 4),
            "direction_before_urad": round(best.direction_before, 4),
            "direction_after_urad": round(best.direction_after, 4),
            "with_program_um": figure(promised.rms_program),
            **({"either_um": round(best.widened.either, 4)} if best.widened is not None and best.widened.either else {}),
            **({} if best.widened is None else {SEEN[0]: figure(best.rms_before), SEEN[1]: figure(best.rms_after)}),
        },
        "coefficients": [
            {"name": s.name, "effect_um": round(s.effect_um, 4), "held": round(s.held, 4), "word": s.word} for s in best.shares
        ],
        "unconfirmed": targets.unconfirmed(proposal.module),
        "values": values,
    }


def _limits(machine: Machine, name: str, limits: Limits) -> list[float]:
    scale = 1.0 if name in machine.linear else 180 / math.pi
    return [round(v * scale, 9) for v in limits[name]]


def total(proposal: Proposal) -> Array:
    """proposal → (h,) what the control then holds, present values included; mm rad mm/mm."""
    return np.array([h.value(proposal.numbers[h.place]) for h in proposal.held])
