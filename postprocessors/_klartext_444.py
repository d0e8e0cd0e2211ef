"""Cycle 444 as the second of two touches: it measures the facet that TCH PROBE 4 has found, at the feed of the probe table.

The cycle knows positions of its own frame alone, positions itself, corrects its results Q151 … with the calibration of the probe,
and makes an error of no contact. So it is called

* only where the first touch has met the facet within its search zone: any other is on record as a miss or as early as it is;
* from the very place that it would position to: its point is that place, as FN 18 ID270 says it in the cycle's own frame, less ball
  radius and SET_UP along the normal. The probe table has to say what the program expects, in every column that this rests on;
* for Q115 Q116 Q117, the contact without calibration, radius and length. Both touches leave it in these three, the first in machine
  coordinates besides: the difference is the frame. Q164, what the cycle itself makes of it, has to agree.

Should the ball be one radius from where the program takes it to be, the cycle would go there by itself, in rapid: the place is that
much farther from the search zone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from tango_cnc.records import InputError

from ._base import Job, Option, early_distance, number, search_distance
from ._klartext import (
    ASTRAY,
    CYCLE,
    DISAGREES,
    ELSEWHERE,
    FLAG,
    FOUND,
    NOW,
    TABLE,
    WAY,
    feed_text,
    on_its_line,
    reading,
    turned,
    way,
)

AGREES = 0.5  # mm between what the cycle says of a contact and what its axes say: calibration, not another place
ASIDE = 0.1  # mm beside the line of the touch: more is calibration, or another frame
CLEAR = 0.5  # mm between the search zone and a ball that is one radius from where it should be
SAME_RADIUS = 0.2  # mm
NOWHERE = 99999  # mm: a result that is still there after the cycle is none of its own
PLACE = {"X": "Q61", "Y": "Q62", "Z": "Q63"}
NORMAL = {"X": "Q64", "Y": "Q65", "Z": "Q66"}
POINT = {"X": "Q67", "Y": "Q68", "Z": "Q69"}
FRAME = {"X": "Q71", "Y": "Q72", "Z": "Q73"}
CONTACT = {"X": "Q115", "Y": "Q116", "Z": "Q117"}
SEEN = {"X": "Q76", "Y": "Q77", "Z": "Q78"}
RADIUS, DEVIATION = "Q74", "Q164"
LENGTH_ENDS = Option(
    "length_ends",
    "pole",
    "where on the ball the tool length of the probe ends, for cycle 444: at its pole or its centre",
    verified=True,
    choices=("pole", "centre"),
)
DOUBTS = (
    "the text of cycle 444 and of its parameters; iTNC 530 has none",
    "ID350 NR55 IDX2 NR56 IDX1 NR56 IDX2 NR52 IDX1 are F, DIST, SET UP and ball radius of the probe table",
    "ID270 NR1 is where the tool length ends, in the frame of cycle 444",
    "cycle 444 stays where it stands when the ball is SET UP and its radius from the point, and watches the probe all the time",
    "cycle 444 is allowed with rotary axes that stand at an angle and no tilted plane (chkTiltingAxes of the machine)",
    "a tool call before has set the probe along Z as tool: the program calls no tool",
    "Q115 Q116 Q117 hold the contact of TCH PROBE 4 and of cycle 444, neither with the radius nor with the calibration",
    "Q164 is above 0 where the contact comes before its nominal place",
)
ENDS = "length_ends = pole: the tool length of the probe ends at the pole of its ball, not at the centre"


def doubts(given: Mapping[str, Any]) -> tuple[str, ...]:
    """`controller` keys → what nobody has confirmed of cycle 444, where it is asked for."""
    if given.get("cycle") != 444:
        return ()
    return DOUBTS if "length_ends" in given else (ENDS, *DOUBTS)


def fits(job: Job) -> None:
    """Raises InputError where facets are touched once, or from so near that the cycle could meet one on a way of its own."""
    approach, radius = job.plan.strategy.approach, job.machine.probe.tip_radius
    if approach.find is None:
        raise InputError(
            "controller.cycle: found 444 and a strategy that touches once; allowed: 4, or with approach.find in strategy.yaml 444: "
            "cycle 444 ends the program where it meets nothing, so a first touch has to find the facet"
        )
    if approach.find.retreat < (least := approach.search + radius + CLEAR) - 1e-9:
        raise InputError(
            f"controller.cycle: found 444 with approach.find.retreat {approach.find.retreat:g}; allowed: at least {least:g}, "
            f"search, ball radius and {CLEAR:g}: the cycle positions by itself. Raise retreat in strategy.yaml or lower search"
        )
    if counting(job).options["misses"] < 2:
        raise InputError("controller.misses: found 1; allowed with cycle: 444: 2 … 20")


def counting(job: Job) -> Job:
    """job, which counts both moves of a double touch that meet nothing → the same that counts those that find."""
    return replace(job, options={**job.options, "misses": job.options["misses"] // 2})


def table_text(job: Job) -> str:
    """job that measures from the near place → what the probe table has to say, for remarks and the stop."""
    feed, (way, retreat, radius) = feed_text(job.plan.strategy.approach.feed), (number(v).rstrip(".") for v in _lengths(job))
    return f"PROBE TABLE NEEDS F {feed} DIST {way} SET UP {retreat} BALL RADIUS {radius}"


def table(job: Job) -> Iterator[str]:
    """Ball radius into Q74; jumps where the probe table would make the cycle move otherwise than is planned."""
    way, retreat, radius = _lengths(job)
    columns = (("NR55 IDX2", job.plan.strategy.approach.feed), ("NR56 IDX1", way), ("NR56 IDX2", retreat), ("NR52 IDX1", radius))
    for column, wanted in columns:
        yield f"FN 18: SYSREAD {RADIUS} = ID350 {column}"
        yield f"Q35 = ABS ( {RADIUS} - {wanted:.4f} )"
        yield f"FN 11: IF +Q35 GT +{SAME_RADIUS if column == 'NR52 IDX1' else 0.001:.4f} GOTO LBL {TABLE}"


def frame() -> Iterator[str]:
    """For the first touch: machine coordinates less those of Q115 Q116 Q117, of one contact."""
    for name in "XYZ":
        yield f"{FRAME[name]} = {FOUND[name]} - {CONTACT[name]}"


def seen() -> Iterator[str]:
    """For the first touch: what is on record where there is no second one. Guarded moves between them write into Q41 Q42 Q43."""
    for name in "XYZ":
        yield f"{SEEN[name]} = {FOUND[name]}"


def measuring(job: Job) -> Iterator[str]:
    """Measures from Q24 Q25 Q26, where the axes stand, towards Q21 Q22 Q23; results as TCH PROBE 4 leaves them."""
    other, early, done = (10 * CYCLE + i for i in (1, 2, 3))
    yield f"LBL {CYCLE} ; CYCLE 444 FROM Q24 Q25 Q26 TOWARDS Q21 Q22 Q23"
    yield "FN 20: WAIT FOR SYNC"
    yield from turned(job)
    yield f"FN 10: IF +{FLAG} NE +1 GOTO LBL {other}"
    yield from way()
    yield from _point(job)
    for parameter in (*CONTACT.values(), DEVIATION):
        yield f"{parameter} = {NOWHERE}"
    for parameter in CONTACT.values():
        yield f"FN 12: IF +{parameter} LT +{NOWHERE - 1} GOTO LBL {ELSEWHERE}"
    yield "TCH PROBE 444 PROBING IN 3-D ~"
    yield from _parameters()
    yield "FN 20: WAIT FOR SYNC"
    for name in "XYZ":
        yield f"{FOUND[name]} = {CONTACT[name]} + {FRAME[name]}"
        yield reading(job, PLACE[name], name)
    yield from on_its_line(job, PLACE, ASTRAY)
    yield from on_its_line(job, FOUND, ELSEWHERE, ASIDE)
    yield f"Q37 = ABS ( Q36 - {_retreat(job):.4f} + {DEVIATION} )"
    yield f"FN 11: IF +Q37 GT +{AGREES:.4f} GOTO LBL {DISAGREES}"
    yield f"FN 11: IF +Q35 GT +{early_distance(job.plan):.4f} GOTO LBL {early}"
    yield f"{FLAG} = 2"
    yield f"LBL {early}"
    yield f"FN 9: IF +0 EQU +0 GOTO LBL {done}"
    yield f"LBL {other}"
    for name in "XYZ":
        yield f"{FOUND[name]} = {SEEN[name]}"
    yield f"LBL {done}"
    yield "LBL 0"


def stops(job: Job) -> dict[int, str]:
    """job that measures from the near place → {label: text} of the stops that cycle 444 needs besides."""
    return {
        TABLE: table_text(job),
        DISAGREES: "CYCLE 444 AND ITS AXES DISAGREE",
        ASTRAY: "CYCLE 444 HAS LEFT THE LINE OF ITS TOUCH",
    }


def _point(job: Job) -> Iterator[str]:
    """Nominal contact on the facet, in the frame of the cycle: the ball is where the axes stand. Q63 is the height of its pole."""
    pole = job.options["length_ends"] == "pole"
    for name in "XYZ":
        yield reading(job, PLACE[name], name, "ID270")
        yield f"{NORMAL[name]} = ( 0 - {NOW[name]} ) / {WAY}"
        up = f" + {RADIUS}" if pole and name == "Z" else ""
        yield f"{POINT[name]} = {PLACE[name]}{up} - ( {_retreat(job):.4f} + {RADIUS} ) * {NORMAL[name]}"
    if not pole:
        yield f"{PLACE['Z']} = {PLACE['Z']} - {RADIUS}"


def _parameters() -> Iterator[str]:
    names = ("1ST POINT 1ST AXIS", "1ST POINT 2ND AXIS", "1ST POINT 3RD AXIS")
    for parameter, value, name in zip(("Q263", "Q264", "Q294"), POINT.values(), names, strict=True):
        yield f"    {parameter}=+{value} ;{name} ~"
    names = ("NORMAL IN REF. AXIS", "NORMAL IN MINOR AXIS", "NORMAL IN TOOL AXIS")
    for parameter, value, name in zip(("Q581", "Q582", "Q583"), NORMAL.values(), names, strict=True):
        yield f"    {parameter}=+{value} ;{name} ~"
    yield "    Q320=+0 ;SET-UP CLEARANCE ~"
    yield f"    Q260=+{PLACE['Z']} ;CLEARANCE HEIGHT ~"
    yield '    QS400="0" ;TOLERANCE ~'
    yield "    Q309=+0 ;ERROR REACTION"


def _lengths(job: Job) -> tuple[float, float, float]:
    """→ mm: the whole way of the cycle, the part of it before the nominal contact, ball radius."""
    return search_distance(job.plan), _retreat(job), job.machine.probe.tip_radius


def _retreat(job: Job) -> float:
    """→ mm from where the second touch begins to the nominal contact."""
    return job.plan.strategy.approach.standoff
