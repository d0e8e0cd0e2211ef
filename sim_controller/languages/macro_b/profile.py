"""What differs between machines with a Fanuc-like control; every default is a guess that a real machine may refute."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Literal

from tango_cnc.records import Machine

from .._shared.known import ORIENT, Controls, Shown


@dataclass(frozen=True)
class Profile:
    """Parameters and options of the control, with the parameter numbers of the 0i/30i families where they are known."""

    axes: tuple[str, ...]  # control axes 1, 2, 3 …: the order of #5001, #5021, #5041, #5061 (1020)
    # letters of 1, 2, 3 … instead, whether the machine has the axis or not (Haas: XYZABC); - where no axis has that number
    numbered: str = ""
    increment: Decimal = Decimal("0.001")  # mm and deg (IS-B; IS-C is 0.0001)
    calculator: bool = False  # a number without decimal point is whole mm (3401#0 DPI)
    g54: Mapping[str, float] = field(default_factory=dict)  # mm and deg
    left_on: Mapping[int, float] = field(default_factory=dict)  # group of G codes → what a program before has left on
    tool_lengths: Mapping[int, float] = field(default_factory=lambda: {1: 0.0})  # H → mm
    length_moves: bool = False  # G43 and G49 without an axis word move Z by the length there and then (5001, 5006#6)
    rollover: tuple[str, ...] = ()  # rotary axes of type 'roll-over' (1008#0 ROA)
    signed_direction: bool = False  # the sign of a roll-over command is its direction (1008#1 RAB)
    straight_rapid: bool = False  # G0 runs on a straight line (1401#1 LRP)
    read_ahead: bool = True  # #5021 and #5041 are read before the moves in front of them are done
    macros_ahead: bool = False  # macro statements are carried out ahead of motion; G103 P1 and empty blocks end that (Haas)
    # how a skip move has to be written: G31 P1 or G31.1 with several inputs, else P601 (M700V p. 555); another P is another input
    skip_word: str = "G31"
    waits: str = ""  # a block that waits for the axes besides G53, G31 and M0, e.g. G4 P0.1 or M66
    point_seconds: bool = False  # G4 P1. is a second and P1 a thousandth; else both are thousandths
    orient: str = "R"  # letter of the angle behind M19; behind another one the spindle stays as it is
    memory: int = 512  # kB free for a program; 0: it runs from a disk
    reading_stops: bool = False  # what stands behind M30 is not read into the memory (3201#6)
    scaled: Mapping[str, float] = field(default_factory=dict)  # of work coordinates; -1 is a mirror image (a setting, G51, G51.1)
    # the work offset turns with this rotary axis, machine moves do not (Haas G254); whether #504x and #506x know of it
    turned_with: str = ""
    turn_shown: bool = True
    inch_positions: bool = False  # an inch machine: variables of positions stay in inches, whatever G20 and G21 say
    counts: bool = False  # variables of positions come in whole increments, as on the display
    probe_variable: int = 0  # system variable that is 1 while the probe is deflected, as old as the last wait; 0: there is none
    # F of G31: as of any block, or its own alone, which it has to have and other blocks do not see (M700V)
    skip_feed: Literal["modal", "own"] = "modal"
    fastest_skip: float = math.inf  # mm/min of G31 (Haas: 2500)
    padding: Literal["spaces", "none", "bare"] = "spaces"  # leading zeros of DPRNT (6001#1 PRT); bare: as a Haas NGC
    overflow: Literal["dropped", "expanded"] = "dropped"  # digits that do not fit into a field; Haas expands it
    line_end: Literal["lf", "crlf", "lfcrcr", "cr"] = "lf"  # 100#3 NCR, 6001#4 CRO
    branches_in_dnc: bool = False  # GOTO and WHILE in a drip-fed main program, which real ones refuse


NUMBERS = "the list of system variables: which axis #5001, #5021, #5041 and #5061 are, which one #5002 …"
CONTROLS = Controls(
    {"probe_state": "probe_variable"},
    {
        "axis_numbers": Shown(("numbered",), NUMBERS),
        "skip": Shown(("skip_word",), "the skip function: with which word it is called where there are several skip inputs"),
        "wait": Shown(("waits", "macros_ahead"), "look-ahead of macros: behind which block variables are those of axes at rest"),
        "orient": ORIENT,
    },
)


def default_profile(machine: Machine) -> Profile:
    """machine → profile with X Y Z and then the rotary letters in alphabetical order; the spindle is no axis."""
    return Profile((*machine.linear, *machine.rotary))
