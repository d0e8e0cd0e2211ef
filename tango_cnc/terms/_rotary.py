"""Error motions of a rotary axis at a harmonic of its angle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..kinematics import Slot, Stage
from ..records import COMPONENTS, Array, Machine
from ..touches import Touches
from . import Coefficient
from ._cause import Variants, label, need
from ._world import Effects, toward, wave

ORDERS = (1, 2, 3, 4)
BASE = {"A": 0, "B": 1, "C": 2}


def harmonics(
    cause: str, machine: Machine, axis: str, order: int, components: str, motion: str | None, frame: str = "turning"
) -> list[Coefficient]:
    """cause, axis, order, components such as XY → cosine and sine of each, mm or rad; `motion` X, Y … keeps one of them.

    They act on the body that turns (`turning`, as E_XC does) or before the motion (`fixed`).
    """
    need(cause, "frame", frame, ("turning", "fixed"))
    stage: Stage = "intra" if frame == "turning" else "inter"
    need(cause, "axis", axis, machine.rotary)
    unit = "mm" if components[0] in "XYZ" else "rad"
    stem = label(cause, axis, order, motion, None if frame == "turning" else frame)

    def one(name: str, letter: str, function: str, sign: float = 1.0) -> Coefficient:
        slot = Slot(axis, stage, COMPONENTS.index(letter))
        wave = np.cos if function == "cos" else np.sin
        return Coefficient(name, unit, slot, lambda t: sign * wave(order * t.axis(axis)))

    shown = components if motion is None else motion
    return [one(f"{stem}.{letter}{f}", letter, f) for letter in shown for f in ("cos", "sin")]


def across(axis: str, rotation: bool) -> str:
    """rotary axis → its two radial components: XY of C; AB when rotations are meant."""
    letters = "ABC" if rotation else "XYZ"
    return "".join(letter for i, letter in enumerate(letters) if i != BASE[axis])


def along(axis: str) -> str:
    """rotary axis → its axial component: Z of C."""
    return "XYZ"[BASE[axis]]


def every(touches: Touches, components: dict[str, str]) -> Variants:
    """touches, components of every axis → all of them together and each alone, orders 1 to 4."""
    for axis, letters in components.items():
        if len(np.unique(np.round(touches.axis(axis), 3))) > 3:
            for order in ORDERS:
                yield {"axis": axis, "order": order}
                if len(letters) > 1:
                    for letter in letters:
                        yield {"axis": axis, "order": order, "motion": letter, "frame": "fixed"}
                    yield {"axis": axis, "order": order, "frame": "fixed"}
                if len(letters) > 1:
                    for letter in letters:
                        yield {"axis": axis, "order": order, "motion": letter}


def waves(cause: str, machine: Machine, setting: Mapping[str, Any], values: Array, components: str) -> Effects:
    """cause, setting, values (cosine and sine of each component) → effects of the simulated machine, one a component."""
    axis, letters = str(setting["axis"]), setting.get("motion") or components
    order, frame = setting.get("order", 2), setting.get("frame", "turning")
    base = {"cause": cause, "axis": axis, "order": order, "frame": frame}
    pairs = np.reshape(values, (-1, 2))
    return [base | wave(pair) | {"direction": toward(machine, axis, x)} for x, pair in zip(letters, pairs, strict=True)]
