"""Cycle 444 as the second of two touches: it measures the facet that TCH PROBE 4 has found, at the feed of the probe table.

The cycle knows positions of its own frame alone, positions itself, corrects its results Q151 … with the calibration of the probe,
and makes an error of no contact. So it is called

* only where the first touch has met the facet: a facet that is not found is a miss, on record without a second touch;
* from the very place that it would position to: its point is that place, as FN 18 ID270 says it in the cycle's own frame, less ball
  radius, set-up clearance and Q320 along the normal;
* for Q115 Q116 Q117, the contact without calibration, radius and length. Both touches leave it in these three, the first in machine
  coordinates besides: the difference is the frame. Q164, what the cycle itself makes of it, has to agree.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from tango_cnc.records import InputError

from ._base import Job, number, search_distance
from ._klartext import (
    ASTRAY,
    CYCLE,
    DISAGREES,
    FLAG,
    FOUND,
    NOW,
    TABLE,
    WAY,
    feed_text,
    judged,
    on_its_line,
    reading,
    turned,
    way,
)

AGREES = 0.5  # mm between what the cycle says of a contact and what its axes say: calibration, not another place
NOWHERE = 99999  # mm: a contact that is still there after the cycle is none of its own
PLACE = {"X": "Q61", "Y": "Q62", "Z": "Q63"}
NORMAL = {"X": "Q64", "Y": "Q65", "Z": "Q66"}
POINT = {"X": "Q67", "Y": "Q68", "Z": "Q69"}
FRAME = {"X": "Q71", "Y": "Q72", "Z": "Q73"}
CONTACT = {"X": "Q115", "Y": "Q116", "Z": "Q117"}
RADIUS, CLEARANCE = "Q74", "Q75"
DOUBTS = (
    "the text of cycle 444 and of its parameters; iTNC 530 has none",
    "ID350 NR55 IDX2 NR56 IDX1 NR56 IDX2 NR52 IDX1 are F, DIST, SET UP and ball radius of the probe table",
    "ID270 NR1 are positions of the ball centre in the frame of cycle 444",
    "cycle 444 stays where it stands when that is ball radius, SET UP and Q320 from its point, and watches the probe all the time",
    "Q115 Q116 Q117 hold the contact of TCH PROBE 4 and of cycle 444, neither with the radius nor with the calibration",
    "a program may write into Q115 Q116 Q117: what cycle 444 leaves there is told from what stood there before",
    "Q164 is above 0 where the contact comes before its nominal place",
)


def doubts(given: Mapping[str, Any]) -> tuple[str, ...]:
    """`controller` keys → what nobody has confirmed of cycle 444, where it is asked for."""
    return DOUBTS if given.get("cycle") == 444 else ()


def fits(job: Job) -> None:
    """Raises InputError where facets are touched once: the cycle tells nobody that it has met nothing, it ends the program."""
    if job.plan.strategy.approach.find is None:
        raise InputError(
            "controller.cycle: found 444 and a strategy that touches once; allowed: 4, or with approach.find in strategy.yaml 444: "
            "cycle 444 ends the program where it meets nothing, so a first touch has to find the facet"
        )
    if counting(job).options["misses"] < 2:
        raise InputError("controller.misses: found 1; allowed with cycle: 444: 2 … 20")


def counting(job: Job) -> Job:
    """job, which counts both moves of a double touch that meet nothing → the same that counts those that find."""
    return replace(job, options={**job.options, "misses": job.options["misses"] // 2})


def table_text(job: Job) -> str:
    """job that measures from the near place → what the probe table has to say, for remarks and the stop."""
    feed, way = feed_text(job.plan.strategy.approach.feed), number(search_distance(job.plan)).rstrip(".")
    return f"PROBE TABLE NEEDS F {feed} DIST {way} SET UP TO {number(_retreat(job)).rstrip('.')}"


def table(job: Job) -> Iterator[str]:
    """Ball radius into Q74, Q320 into Q75; jumps where the probe table would make the cycle move otherwise than is planned."""
    approach = job.plan.strategy.approach
    for what, wanted in (("NR55 IDX2", approach.feed), ("NR56 IDX1", search_distance(job.plan))):
        yield f"FN 18: SYSREAD Q35 = ID350 {what}"
        yield f"Q35 = ABS ( Q35 - {wanted:.4f} )"
        yield f"FN 11: IF +Q35 GT +0.0010 GOTO LBL {TABLE}"
    yield f"FN 18: SYSREAD {CLEARANCE} = ID350 NR56 IDX2"
    yield f"{CLEARANCE} = {_retreat(job):.4f} - {CLEARANCE}"
    yield f"FN 12: IF +{CLEARANCE} LT +0 GOTO LBL {TABLE}"
    yield f"FN 18: SYSREAD {RADIUS} = ID350 NR52 IDX1"
    yield f"FN 12: IF +{RADIUS} LT +0.1 GOTO LBL {TABLE}"


def frame() -> Iterator[str]:
    """For the first touch: machine coordinates less those of Q115 Q116 Q117, of one contact."""
    for name in "XYZ":
        yield f"{FRAME[name]} = {FOUND[name]} - {CONTACT[name]}"


def measuring(job: Job) -> Iterator[str]:
    """Measures from Q24 Q25 Q26, where the axes stand, towards Q21 Q22 Q23; results as TCH PROBE 4 leaves them."""
    yield f"LBL {CYCLE} ; CYCLE 444 FROM Q24 Q25 Q26 TOWARDS Q21 Q22 Q23"
    yield "FN 20: WAIT FOR SYNC"
    yield from turned(job)
    yield f"FN 12: IF +{FLAG} LT +0.5 GOTO LBL {10 * CYCLE + 1}"
    yield from way()
    for name in "XYZ":
        yield reading(job, PLACE[name], name, "ID270")
        yield f"{NORMAL[name]} = ( 0 - {NOW[name]} ) / {WAY}"
        yield f"{POINT[name]} = {PLACE[name]} - ( {_retreat(job):.4f} + {RADIUS} ) * {NORMAL[name]}"
    for parameter in CONTACT.values():
        yield f"{parameter} = {NOWHERE}"
    yield "TCH PROBE 444 PROBING IN 3-D ~"
    yield from _parameters()
    yield "FN 20: WAIT FOR SYNC"
    for name in "XYZ":
        yield f"{FOUND[name]} = {CONTACT[name]} + {FRAME[name]}"
        yield reading(job, PLACE[name], name)
    yield from on_its_line(job, PLACE, ASTRAY)
    yield from judged(job, CYCLE, _agrees(job), counts=False)


def stops(job: Job) -> dict[int, str]:
    """job that measures from the near place → {label: text} of the stops that cycle 444 needs besides."""
    return {
        TABLE: table_text(job),
        DISAGREES: "CYCLE 444 AND ITS AXES DISAGREE",
        ASTRAY: "CYCLE 444 HAS LEFT THE LINE OF ITS TOUCH",
    }


def _parameters() -> Iterator[str]:
    names = ("1ST POINT 1ST AXIS", "1ST POINT 2ND AXIS", "1ST POINT 3RD AXIS")
    for parameter, value, name in zip(("Q263", "Q264", "Q294"), POINT.values(), names, strict=True):
        yield f"    {parameter}=+{value} ;{name} ~"
    names = ("NORMAL IN REF. AXIS", "NORMAL IN MINOR AXIS", "NORMAL IN TOOL AXIS")
    for parameter, value, name in zip(("Q581", "Q582", "Q583"), NORMAL.values(), names, strict=True):
        yield f"    {parameter}=+{value} ;{name} ~"
    yield f"    Q320=+{CLEARANCE} ;SET-UP CLEARANCE ~"
    yield f"    Q260=+{PLACE['Z']} ;CLEARANCE HEIGHT ~"
    yield '    QS400="0" ;TOLERANCE ~'
    yield "    Q309=+0 ;ERROR REACTION"


def _agrees(job: Job) -> Iterator[str]:
    yield f"Q37 = ABS ( Q36 - {_retreat(job):.4f} + Q164 )"
    yield f"FN 11: IF +Q37 GT +{AGREES:.4f} GOTO LBL {DISAGREES}"


def _retreat(job: Job) -> float:
    """→ mm from where the second touch begins to the nominal contact."""
    return job.plan.strategy.approach.standoff
