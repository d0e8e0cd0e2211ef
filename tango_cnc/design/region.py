"""Where parts are made, and what the errors of the machine do to the tool tip there.

The region is a box in the table frame and a span of each rotary axis: poses in which a tool works on a part. Places that the linear
axes do not reach, and angles at which the tool would come from below the table, are no part of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .. import check, kinematics
from ..iso230.poses import all_steady, at_poses
from ..records import Array, Artefact, InputError, Machine
from ..terms import Coefficient
from ..verify.volume import set_up, setup_lever

POSES = 512  # of a sequence that fills the region evenly (Halton 1960)
HEIGHT = 0.5  # of the smaller side of the table: how tall a part is taken to be when nobody says it
WHOLE = math.radians(15)
SPARSE = math.radians(10)  # by how much the poses of a whole span may fall short of its ends, there being so few
BELOW = -0.02  # cosine between tool and table beyond which the tool would come from below


@dataclass(frozen=True)
class Region:
    """Box (mm, table frame) and spans (rad) of the rotary axes in which parts are made."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    spans: Mapping[str, tuple[float, float]]


def region(machine: Machine, artefact: Artefact, box: Sequence[tuple[float, float]] | None = None) -> Region:
    """machine, artefact, three spans in mm or None → where parts are made.

    Without a box: the table's facets across the spindle, and along it from the table's top to half of its smaller side above.
    Rotary axes turn within their travels, one turn at most.
    """
    spans = {name: turn(machine, name) for name in machine.rotary}
    if box is not None:
        low, high = zip(*box, strict=True)
        return Region(low, high, spans)
    points = np.array([facet.point for facet in artefact.facets.values() if facet.ball is None] or [(0.0, 0.0, 0.0)])
    points = np.vstack([points, *(np.array(ball.centre) for ball in artefact.balls.values())]) if len(points) < 3 else points
    low, high = points.min(axis=0), points.max(axis=0)
    upright = np.array(machine.spindle.direction)
    along = int(np.argmax(np.abs(upright)))
    across = [i for i in range(3) if i != along]
    tall = HEIGHT * max(float(np.min(high[across] - low[across])), 1.0)
    if upright[along] > 0:
        low[along], high[along] = high[along], high[along] + tall
    else:
        low[along], high[along] = low[along] - tall, low[along]
    return Region(tuple(low.tolist()), tuple(high.tolist()), spans)


def turn(machine: Machine, name: str) -> tuple[float, float]:
    """machine, rotary axis → rad of its travel in whole steps of 15°, at most one turn, about zero where it can be."""
    low, high = machine.axis(name).travel or (-math.pi, math.pi)
    if high - low > math.tau:
        middle = 0.0 if low <= -math.pi and high >= math.pi else (low + high) / 2
        low, high = middle - math.pi, middle + math.pi
    first, last = math.ceil(low / WHOLE - 1e-9) * WHOLE, math.floor(high / WHOLE + 1e-9) * WHOLE
    return (first, last) if last > first else (low, high)


def poses(machine: Machine, where: Region, count: int = POSES) -> Array:
    """machine, region, how many → (m, k) mm rad, evenly within the region. Raises InputError where hardly a pose is reached."""
    names = machine.rotary
    from scipy.stats import qmc  # takes a third of a second to load, and few ask for it

    unit = qmc.Halton(3 + len(names), scramble=False).random(count + 1)[1:]
    low = np.array([*where.low, *(where.spans[name][0] for name in names)])
    high = np.array([*where.high, *(where.spans[name][1] for name in names)])
    value = low + unit * (high - low)
    position = np.zeros((count, len(machine.names)))
    for i, name in enumerate(names):
        position[:, machine.column(name)] = value[:, 3 + i]
    chain = kinematics.chain(machine)
    position = kinematics.inverse(chain, position, value[:, :3])
    above = kinematics.spindle_axis(chain, position) @ kinematics.spindle_axis(chain, np.zeros((1, len(machine.names))))[0]
    within = ~check.outside(machine, position).any(axis=1) & (above > BELOW)
    if within.sum() < max(20, count // 50):
        raise InputError(
            f"volume: the machine reaches {int(within.sum())} of {count} poses of the box {text(where)}; "
            "state where parts are made with --volume"
        )
    return np.asarray(position[within])


def text(where: Region) -> str:
    """region → 'X -200 … 200, Y -200 … 200, Z 0 … 200 mm, B -95 … 95, C -180 … 180°'."""
    box = ", ".join(f"{n} {low:.0f} … {high:.0f}" for n, low, high in zip("XYZ", where.low, where.high, strict=True))
    turns = ", ".join(f"{n} {math.degrees(a):.0f} … {math.degrees(b):.0f}" for n, (a, b) in where.spans.items())
    return f"{box} mm" + (f", {turns}°" if turns else "")


def counted(machine: Machine, where: Region, position: Array) -> str:
    """machine, region, its (m, k) poses mm rad → the region as text, each span as its poses have it."""
    spans = {
        name: (float(position[:, i].min()), float(position[:, i].max())) for name in where.spans for i in [machine.column(name)]
    }
    cut = [n for n, (low, high) in where.spans.items() if spans[n][0] - low + high - spans[n][1] > SPARSE]
    shown = replace(where, spans={n: spans[n] if n in cut else span for n, span in where.spans.items()})
    why = "beyond that the tool would come from below the table, or a linear axis is at its end"
    return text(shown) + (f" ({', '.join(cut)}: {why})" if cut else "")


@dataclass(frozen=True)
class Levers:
    """What a unit of each unknown does to the tool tip at m poses, the best set-up of workpiece and tool length taken out."""

    position: Array  # (m, k) mm rad
    steady: Array  # (m, 3, p) mm per unit
    jumps: Array  # (m, 3, p) mm per unit: by the last motion, either way


def levers(machine: Machine, coefficients: Sequence[Coefficient], count: int, position: Array) -> Levers:
    """machine, coefficients of the machine and set-up, number of unknowns p (the others move no tool), poses → levers."""
    where = at_poses(machine, position, np.zeros_like(position))
    moving = at_poses(machine, position, np.ones_like(position))
    run = kinematics.trace(where.chain, position)
    still, jumps = np.zeros((len(position), 3, count)), np.zeros((len(position), 3, count))
    own, values = all_steady(coefficients, where)
    regressors = dict(zip(own, values, strict=True))
    changes = {j: coefficients[j].regressor(moving) - regressors[j] for j in own}
    for i in range(3):
        slots = kinematics.sensitivity(where.chain, run, np.tile(np.eye(3)[i], (len(position), 1))).slots
        for j in own:
            lever = slots[coefficients[j].slot]
            still[:, i, j] = lever * regressors[j]
            jumps[:, i, j] = lever * changes[j]
    everywhere = np.ones(len(position), dtype=bool)
    return Levers(position, set_up(still, setup_lever(where, run.tip), everywhere), jumps)
