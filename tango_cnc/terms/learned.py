"""A shape that a diagnosis found in the touches of this machine and kept in `learned/<name>.yaml` of its cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..kinematics import Slot, axis_frame
from ..records import Array, InputError, Machine
from ..touches import Touches
from . import Cause, Coefficient, Detail
from ._cause import Variants, early
from ._shape import form_of
from ._world import Effects


def variants(touches: Touches) -> Variants:
    """touches → nothing: the shapes of a cell are handed to a diagnosis with their numbers."""
    yield from ()


def make(
    machine: Machine,
    name: str,
    factors: Sequence[Mapping[str, Any]] = (),
    weight: str = "none",
    values: Sequence[float] = (),
) -> list[Coefficient]:
    """machine, name and numbers of a shape → one coefficient: how many times as large as it was when it was learned.

    Raises InputError where its numbers are missing or do not fit together.
    """
    if not values or not factors:
        raise InputError(
            f"terms: learned: found the name {name!r} without its numbers; allowed: the name of a file learned/<name>.yaml of the "
            "cell, as tango diagnose --learn writes it"
        )
    form = form_of({"factors": factors, "weight": weight})
    size = np.array(values, dtype=float)

    def pattern(t: Touches, felt: Array | None = None) -> Array:
        columns = form.columns(t, felt=felt)
        if columns.shape[1] != len(size):
            raise InputError(f"terms: learned {name}: found {len(size)} values; allowed: {columns.shape[1]}, one a function")
        return np.asarray(columns @ size)

    if (found := moved(machine, weight)) is not None:
        slot, sign = found
        return [Coefficient(f"learned[{name}]", "1", slot, lambda t: sign * pattern(t, np.ones((len(t), 1))))]
    return [early(f"learned[{name}]", pattern, "1")]


def moved(machine: Machine, weight: str) -> tuple[Slot, float] | None:
    """machine, how a shape is felt → where in the chain it moves the tool, and with which sign; None where it is no such move.

    What is felt along a direction of the machine frame is a move of the tip in it; what is felt as an axis is, a positioning error
    of that axis or a tilt of what it carries. Parts have these, too, and not touches alone.
    """
    kind, _, rest = weight.partition(" ")
    branch = machine.tool_branch or machine.workpiece_branch
    if kind == "axis":
        return Slot(rest, "motion"), 1.0
    if kind == "tilt":
        letter, axis = rest.split(" of ")
        return Slot(axis, "intra", 3 + "ABC".index(letter)), 1.0
    if kind != "machine" or rest not in tuple("xyz") or not branch:
        return None
    first = machine.axis(branch[0])
    straight = axis_frame(first.name, first.direction)[0] is None
    return (Slot(first.name, "inter", "xyz".index(rest)), -1.0) if straight else None


def effects(machine: Machine, setting: Mapping[str, Any], values: Array) -> Effects:
    """machine, setting, values → the same shape, so many times as large (world.yaml)."""
    kept = {k: setting[k] for k in ("name", "factors", "weight", "values") if k in setting}
    return [{"cause": "learned", **kept, "amplitude": float(values[0])}]


def words(detail: Detail) -> dict[str, str]:
    """detail of a finding → when it was learned, and what its file says of it."""
    day, text = str(detail.get("learned", "")), str(detail.get("text", "")).rstrip(". ")
    return {
        "day": f", learned on {day}," if day else " that was learned before",
        "note": f". Its file says: {text}" if text else "",
    }


EXAMPLE = {
    "name": "leaning ram",
    "factors": [
        {"covariate": "Y", "kind": "polynomial", "low": -250.0, "high": 250.0, "count": 1},
        {"covariate": "B", "kind": "waves", "low": -1.6, "high": 1.6, "count": 2},
    ],
    "weight": "machine z",
    "values": [0.3, -0.2, 1.0, 0.5, 0.1],
}

TERM = Cause(
    text="a shape without a name that was learned from an earlier measurement of this machine",
    source="Rasmussen & Williams, Gaussian Processes for Machine Learning, 2006, chapter 2",
    frame="machine, table, spindle or axis",
    mistaken=("indexation_seating",),
    says="the shape {name}{day} is back, {times} times as large; the touch that feels it most is off by {size}{note}",
    meaning="parts are off by this as they were when it was learned",
    advice="keep the term, and look for what was the same on both occasions",
    refine={},
    variants=variants,
    example=EXAMPLE,
    make=make,
    role="learned",
    effects=effects,
    words=words,
)
