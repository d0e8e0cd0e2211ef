"""Something that belongs to one moment or one pose: a clamp that held elsewhere, an open door, a hand on the table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..kinematics import Slot
from ..records import Array, Machine
from ..touches import Touches
from . import Cause, Coefficient
from ._cause import Variants, displaced, label, need
from ._world import Effects, vector


def variants(touches: Touches) -> Variants:
    """touches → nothing: what belongs to one moment is set aside before names are looked for."""
    yield from ()


def make(
    machine: Machine,
    at: float,
    until: float,
    axis: str | None = None,
    direction: Sequence[float] | None = None,
    frame: str = "machine",
) -> list[Coefficient]:
    """machine, first and last touch (their numbers in the readings) → displacement x y z in mm of that frame; or an angle."""
    first, last = int(at), int(until)

    def inside(t: Touches) -> Array:
        return ((t.counted >= first) & (t.counted <= last)).astype(float)

    if axis is not None:
        need("pulse", "axis", axis, machine.rotary)
        return [Coefficient(label("pulse", first, last, axis), "rad", Slot(axis, "motion"), inside)]
    return displaced(label("pulse", first, last, *(() if frame == "machine" else (frame,))), frame, inside, direction)


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → the same touches displaced, or an axis turned (world.yaml)."""
    base = {"cause": "pulse", "at": int(setting["at"]), "until": int(setting["until"])}
    if setting.get("axis") is not None:
        return [base | {"axis": setting["axis"], "amplitude": float(values[0])}]
    if (frame := str(setting.get("frame", "machine"))) != "machine":
        base |= {"frame": frame}
    if len(values) == 1:
        return [base | {"amplitude": float(values[0]), "direction": [float(x) for x in setting["direction"]]}]
    return [base | vector(values)]


TERM = Cause(
    text="some touches in a row were made while something was elsewhere (one clamping, an open door, a knock that went back)",
    source="change-point model; thesis section 7.3 (dismount and remount)",
    frame="machine or table",
    mistaken=("step", "indexation_seating"),
    says="touches {at} to {until} are off by {size} {towards}",
    meaning="these touches say nothing about the machine as it usually is; they would pull the estimate",
    advice="find out what happened then, and measure these touches again",
    refine={},
    variants=variants,
    example={"at": 100, "until": 140},
    make=make,
    role="moment",
    effects=effects,
)
