"""Cycle 444 of Klartext as the reader knows it: where it would go by itself, what it leaves behind, and what may be wrong of that.

Facts, as far as they are known: it goes by way of the clearance height of the ball's pole to ball radius, SET_UP and Q320 before
its point along the normal, probes from there over DIST, and comes back; Q115 Q116 Q117 are the contact from the datum without
length and calibration, Q164 is how far it lies out along the normal; radius, feed, DIST and SET_UP stand in the probe table, FN 18
ID350.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from ....records import InputError, Plan
from ...twins import LAG, Place, Twin

FRAME = {"X": 3.25, "Y": -4.5, "Z": 87.0}  # mm between the frame of ID270 and that of Q115, which knows no tool length
MARKED = 10_000.0  # mm: no contact is so far
CORRECTED = 0.4  # mm beside the line of a touch: a calibration
OUT = 1.0  # mm: a contact that far from what its axes say is another one
PARAMETERS = ("Q263", "Q264", "Q294", "Q581", "Q582", "Q583")
CALL = re.compile(
    "TCH PROBE 444 PROBING IN 3-D "
    + " ".join(rf"{name}=\+(Q\d+)" for name in PARAMETERS)
    + r' Q320=\+0 Q260=\+(Q\d+) QS400="0" Q309=\+0'
)
CONTACT = {"X": "Q115", "Y": "Q116", "Z": "Q117"}
DEVIATION = "Q164"
WRONG = {"F": (0.05, 0.0), "DIST": (0.0, 0.5), "SET_UP": (0.0, 0.5), "R": (0.0, 0.5)}  # of a column: so much is too much
SYSTEM = {("52", "1"): "R", ("55", "2"): "F", ("56", "1"): "DIST", ("56", "2"): "SET_UP"}  # NR and IDX


def table(plan: Plan) -> dict[str, float]:
    """plan of double touches → the probe table that it needs, mm and mm/min."""
    approach, retreat = plan.strategy.approach, _retreat(plan)
    radius = plan.machine.probe.tip_radius
    return {"R": radius, "F": approach.feed, "DIST": retreat + approach.search, "SET_UP": retreat}


def other_tables(plan: Plan, name: str) -> tuple[float, ...]:
    """plan, column of the probe table → what it may say with which the program must not begin."""
    right, (factor, more) = table(plan)[name], WRONG[name]
    return (right * (1 + factor) + more, right * (1 - factor) - more)


def _retreat(plan: Plan) -> float:
    approach = plan.strategy.approach
    return approach.find.retreat if approach.find else approach.standoff


def in_its_frame(twin: Twin, name: str) -> float:
    """twin, axis letter → where the tool length ends, in the frame of the program, mm (FN 18 ID270)."""
    return twin.position[name] - twin.offset.get(name, 0.0) - FRAME.get(name, 0.0)


def contact(twin: Twin) -> None:
    """Q115 Q116 Q117 after a contact."""
    for name, parameter in CONTACT.items():
        twin.shared[parameter] = twin.skip[name] - twin.offset[name]


def marked(twin: Twin) -> dict[str, float]:
    """twin before the cycle → Q115 Q116 Q117 Q164. Raises InputError when one of them could be taken for a result of the cycle."""
    now = {parameter: float(twin.shared.get(parameter) or 0.0) for parameter in (*CONTACT.values(), DEVIATION)}
    if any(abs(value) < MARKED for value in now.values()):
        raise InputError("if cycle 444 has left Q115 Q116 Q117 Q164 as they were, nobody would know")
    return now


@dataclass(frozen=True)
class Asked:
    """What a call asks for, mm in machine coordinates."""

    begin: Place
    end: Place
    height: float


def asked(match: re.Match[str], value: Callable[[str], float], known: Mapping[str, float], base: Twin, pole: bool) -> Asked:
    """call, its parameters' values, probe table, machine, whether the tool length ends at the pole of the ball → where it goes.

    Raises InputError for a normal that is none.
    """
    x, y, z, *normal, height = (value(text) for text in match.groups())
    if abs(sum(n**2 for n in normal) - 1) > 1e-6:
        raise InputError("the normal of cycle 444 has not the length 1")
    away, up = known["R"] + known["SET_UP"], {"Z": known["R"] if pole else 0.0}
    off = {name: base.position[name] - in_its_frame(base, name) - up.get(name, 0.0) for name in "XYZ"}
    point = {name: p + off[name] for name, p in zip("XYZ", (x, y, z), strict=True)}
    along = dict(zip("XYZ", normal, strict=True))
    begin, end = ({name: point[name] + way * along[name] for name in "XYZ"} for way in (away, away - known["DIST"]))
    return Asked(begin, end, height + off["Z"] + known["R"])


def left(told: Asked, start: Place, nominal: Place) -> Callable[[Twin], None]:
    """what was asked, beginning and nominal contact of the touch, mm → what the cycle leaves where it has met something."""
    way = sum((told.end[n] - start[n]) ** 2 for n in start) ** 0.5
    normal = {n: (start[n] - told.end[n]) / way for n in start}

    def does(twin: Twin) -> None:
        contact(twin)
        twin.shared[DEVIATION] = sum((twin.skip[n] - nominal[n]) * normal[n] for n in start)
        twin.position.update(start)

    return does


def doubts(base: Twin, before: Mapping[str, float], told: Asked, start: Place) -> Iterator[Twin]:
    """machine after the cycle, its results before it, what was asked, its beginning → machines on which it does something else."""
    for kept in (tuple(CONTACT.values()), (DEVIATION,)):
        stale = base.twin("stop", f"cycle 444 has left {' '.join(kept)} as they were")
        stale.shared.update({parameter: before[parameter] for parameter in kept})
        yield stale
    for out in (OUT, -OUT):
        other = base.twin("stop", "cycle 444 speaks of another contact than its axes")
        other.shared[DEVIATION] = float(other.shared[DEVIATION] or 0.0) + out
        yield other
    way = {n: told.end[n] - start[n] for n in start}
    size = sum(w**2 for w in way.values()) ** 0.5
    for name in start:
        aside = {n: float(n == name) - way[name] * way[n] / size**2 for n in start}
        if sum(a**2 for a in aside.values()) ** 0.5 > 0.5:
            astray = base.twin("stop", f"cycle 444 has ended beside the line of its touch in {name}")
            astray.position.update({n: start[n] + LAG * a for n, a in aside.items()})
            yield astray
            corrected = base.twin("stop", f"cycle 444 has corrected its contact in {name}")
            for n, parameter in CONTACT.items():
                corrected.shared[parameter] = float(corrected.shared[parameter] or 0.0) + CORRECTED * aside[n]
            yield corrected
