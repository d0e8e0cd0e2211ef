"""Cycle 444: it positions itself along the normal of its point, probes, and tells what it has found in the frame of the program.

From the manual of a relative are the inputs Q263 Q264 Q294, Q581 to Q583, QS400 and Q309; from memory are its way (ball radius,
SET_UP and Q320 before the point, by way of the clearance height, then DIST towards it), its results Q151 … Q164, and that it makes
an error of no contact, of mirror image and of scaling.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from ...motion import Motion
from .._shared.scales import shown
from .expressions import error, number

TITLE = "TCH PROBE 444 PROBING IN 3-D"
POINT, NORMAL = ("Q263", "Q264", "Q294"), ("Q581", "Q582", "Q583")
CLEARANCE, HEIGHT, TOLERANCE, REACTION = "Q320", "Q260", "QS400", "Q309"
INPUTS = (*POINT, *NORMAL, CLEARANCE, HEIGHT, TOLERANCE, REACTION)
BACK = 1000.0  # mm/min
Placed = Callable[[Mapping[str, float]], dict[str, float]]
NO_BAND = ("", " ", "0")
SYSTEM = {(52, 1): "R", (55, 2): "F", (56, 1): "DIST", (56, 2): "SET_UP"}  # NR and IDX of ID350
TABLE = {"R": 3.0, "F": 180.0, "DIST": 13.5, "SET_UP": 8.5}  # of the probe in the spindle: mm, mm/min, mm, mm


@dataclass(frozen=True)
class Asked:
    """One call of the cycle, mm in the frame of the program."""

    point: dict[str, float]
    normal: dict[str, float]
    clearance: float
    height: float

    def away(self, distance: float) -> dict[str, float]:
        """mm → the place that far from the point along the normal."""
        return {name: self.point[name] + distance * self.normal[name] for name in "XYZ"}


def asked(block: str, values: Mapping[int, float]) -> Asked:
    """the cycle in one line, Q parameters → what it is to do. Raises Alarm for what is missing, unknown, or no direction."""
    texts = dict(re.findall(r'(QS?\d+)=("[^"]*"|\S+)', block.removeprefix(TITLE)))
    if not block.startswith(f"{TITLE} ") or set(texts) != set(INPUTS):
        raise error("NC BLOCK FAULTY", block)
    if texts[TOLERANCE].strip('"') not in NO_BAND or texts[REACTION] not in ("+0", "0"):
        raise error("TOLERANCE BAND NOT SIMULATED", texts[TOLERANCE])
    point, normal = ({name: number(texts[q], values) for name, q in zip("XYZ", row, strict=True)} for row in (POINT, NORMAL))
    size = math.hypot(*normal.values())
    clearance = number(texts[CLEARANCE], values)
    if size == 0 or clearance < 0:
        raise error("ENTRY VALUE INCORRECT", block)
    return Asked(point, {name: value / size for name, value in normal.items()}, clearance, number(texts[HEIGHT], values))


def contact(told: Asked, table: Mapping[str, float], motion: Motion, axes: Iterable[str], placed: Placed) -> dict[str, float]:
    """what is asked, probe table, axes that move, {X Y Z: mm} of the ball in the program → of the machine; → contact, mm deg.

    The pole of the ball goes over the clearance height. The way there and back is watched. Raises Alarm when nothing is met,
    MotionStop as any motion.
    """
    away = table["R"] + table["SET_UP"] + told.clearance
    begin, height = placed(told.away(away)), placed({"Z": told.height + table["R"]})["Z"]
    if shown(motion, "Z")["Z"] < height:
        motion.rapid({"Z": height})
    motion.rapid({name: begin[name] for name in "XY"})
    motion.rapid({"Z": begin["Z"]})
    skip = motion.skip(placed(told.away(away - table["DIST"])), table["F"])
    if not skip.hit:
        raise error("TOUCH POINT INACCESSIBLE", TITLE)
    motion.feed(begin, BACK)
    return shown(motion, axes, skip.position)


def results(told: Asked, radius: float, ball: Mapping[str, float]) -> dict[int, float]:
    """what was asked, mm, {X Y Z: mm} of the ball at the contact as calibrated → Q151 … Q153, Q161 … Q164."""
    found = {name: ball[name] - radius * told.normal[name] for name in "XYZ"}
    off = {name: found[name] - told.point[name] for name in "XYZ"}
    deviation = sum(off[name] * told.normal[name] for name in "XYZ")
    return {**dict(zip((151, 152, 153, 161, 162, 163), (*found.values(), *off.values()), strict=True)), 164: deviation}
