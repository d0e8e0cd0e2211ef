"""What came out, against what was known before: each parameter, facet and ball with its tolerance."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..estimate import Estimate
from ..judgement import TableTolerances, Tolerances
from ..model import Model
from ..records import Array, Machine
from ..terms import GAP, Coefficient
from ..texts import say

CERTAIN = 3.0  # standard deviations that a value has to be beyond its tolerance


@dataclass(frozen=True)
class Bound:
    """One quantity beside what is plausible for it; `value`, `std` and `tolerance` in `unit` (mm, rad, mm/mm)."""

    name: str
    names: tuple[str, ...]  # parameters that make it
    value: float
    std: float
    tolerance: float
    unit: str
    key: str  # where the tolerance is stated: machine.yaml tolerances.location

    @property
    def beyond(self) -> bool:
        """→ whether it is implausible, its uncertainty granted."""
        return abs(self.value) - CERTAIN * self.std > self.tolerance

    @property
    def undecided(self) -> bool:
        """→ whether the touches say less of it than was known before."""
        return self.std > self.tolerance


def bounds(result: Estimate) -> Iterator[Bound]:
    """estimate → every quantity that has a tolerance."""
    yield from _coefficients(result)
    yield from _table(result)


def _coefficients(result: Estimate) -> Iterator[Bound]:
    model, machine = result.model, result.model.touches.machine
    std = result.std
    together: dict[object, list[int]] = {}
    for i, c in enumerate(model.coefficients):
        if (c.slot.stage in ("stylus", "table", "inter") and c.slot.axis and _constant(model, i)) or is_backlash(c):
            size, unit, key = alone(c, machine, model.touches.artefact.tolerances)
            yield Bound(result.selection.label(c.name), (c.name,), float(result.values[i]), float(std[i]), size, unit, key)
        else:
            together.setdefault(c.slot, []).append(i)
    for rows in together.values():
        yield _range(result, rows)


def _constant(model: Model, i: int) -> bool:
    return bool(np.ptp(model.regressors[i]) == 0) if len(model.touches) else True


def is_backlash(c: Coefficient) -> bool:
    """coefficient → whether it is a backlash."""
    return c.slot.stage == "motion" and c.name.endswith("b")


def alone(c: Coefficient, machine: Machine, table: TableTolerances) -> tuple[float, str, str]:
    """constant coefficient or backlash, machine, table → its tolerance, unit and where that is stated."""
    known: Tolerances = machine.tolerances
    turns = c.slot.component >= 3
    if is_backlash(c):
        if c.slot.axis in machine.linear:
            return known.backlash, "mm", "machine.yaml: tolerances.backlash"
        return known.backlash_angle, "rad", "machine.yaml: tolerances.backlash_angle"
    if c.slot.stage == "stylus":
        return known.stylus, "mm", "machine.yaml: tolerances.stylus"
    if c.slot.stage == "table":
        size = table.placement_angle if turns else table.placement
        return size, "rad" if turns else "mm", f"artefact.yaml: tolerances.placement{'_angle' if turns else ''}"
    if turns:
        return known.angle, "rad", "machine.yaml: tolerances.angle"
    return known.location, "mm", "machine.yaml: tolerances.location"


def _range(result: Estimate, rows: list[int]) -> Bound:
    """What the coefficients of one slot do together over the touches: a straightness, a positioning error, a drift."""
    model, machine = result.model, result.model.touches.machine
    known, c = machine.tolerances, model.coefficients[rows[0]]
    names = tuple(model.coefficients[i].name for i in rows)
    regressors: Array = model.regressors[rows]
    effect = result.values[rows] @ regressors
    at = int(np.argmax(np.abs(effect)))
    own = regressors[:, at]
    value, std = float(effect[at]), math.sqrt(max(float(own @ result.covariance[np.ix_(rows, rows)] @ own), 0.0))
    name = " ".join(result.selection.label(n) for n in names[:3]) + (" …" if len(names) > 3 else "")
    turns = c.slot != GAP and (c.slot.component >= 3 if c.slot.stage != "motion" else c.slot.axis in machine.rotary)
    if c.slot.stage == "motion" and c.slot.axis in machine.linear:
        reach = max(float(np.abs(model.touches.axis(c.slot.axis)).max()), 1.0)
        if len(rows) == 1 and c.name == f"E{c.slot.axis}{c.slot.axis}1":
            value, std = float(result.values[rows[0]]), float(result.std[rows[0]])
            return Bound(name, names, value, std, known.scale, "mm/mm", "machine.yaml: tolerances.scale")
        return Bound(name, names, value, std, known.scale * reach, "mm", "machine.yaml: tolerances.scale")
    if turns:
        return Bound(name, names, value, std, known.motion_angle, "rad", "machine.yaml: tolerances.motion_angle")
    return Bound(name, names, value, std, known.motion, "mm", "machine.yaml: tolerances.motion")


def _table(result: Estimate) -> Iterator[Bound]:
    model = result.model
    table = model.touches.artefact.tolerances
    first, std = len(model.coefficients), result.std
    key = "artefact.yaml: tolerances."
    facets = model.touches.facets
    for i, facet in enumerate(facets):
        j = first + i
        yield Bound(f"EZf{facet}", (f"EZf{facet}",), float(result.values[j]), float(std[j]), table.facet, "mm", f"{key}facet")
    if len(facets) >= 4:
        rows = slice(first, first + len(facets))
        one = np.full(len(facets), 1 / len(facets))
        spread = math.sqrt(max(float(one @ result.covariance[rows, rows] @ one), 0.0))
        mean = float(np.mean(result.values[rows]))
        names = tuple(f"EZf{facet}" for facet in facets)
        yield Bound(say("place.facets"), names, mean, spread, table.common, "mm", f"{key}common")
    for i in range(first + len(facets), len(model.names)):
        name = model.names[i]
        yield Bound(name, (name,), float(result.values[i]), float(std[i]), table.ball, "mm", f"{key}ball")
