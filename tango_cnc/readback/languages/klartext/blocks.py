"""Blocks of Klartext that a program of this kind may have: everything that is not here is refused."""

from __future__ import annotations

import re
from itertools import pairwise

SIGNED = r"[+-]\d+\.\d+"
TURN = re.compile(rf"L ([ABC])({SIGNED}) R0 FMAX M91")
ANGLE = re.compile(rf"CYCL DEF 13\.1 ANGLE({SIGNED})")
READ = re.compile(r"FN 18: SYSREAD (Q\d+) = ID(240(?= NR8)|270(?= NR1)) NR[18] IDX([1-9])")
MIRRORED = re.compile(r"FN 18: SYSREAD (Q\d+) = ID210 NR3")
FACTOR = re.compile(r"FN 18: SYSREAD (Q\d+) = ID210 NR4 IDX([1-3])")
PROBE_TABLE = re.compile(r"FN 18: SYSREAD (Q\d+) = ID350 NR(\d+) IDX(\d)")
ASSIGN = re.compile(r"(Q\d+) = ([^\"|]+)")
TEXT = re.compile(r"(QS\d) = (.+)")
DECLARED = re.compile(r'DECLARE STRING (QS\d) = "([^"{}]*)"')
JUMP = re.compile(r"FN (9|10|11|12): IF ([+-](?:Q\d+|\d+\.?\d*)) (EQU|NE|GT|LT) ([+-](?:Q\d+|\d+\.?\d*)) GOTO LBL (\d+)")
COMPARES = {"9": ("EQU", "EQ"), "10": ("NE", "NE"), "11": ("GT", "GT"), "12": ("LT", "LT")}
CALL = re.compile(r"CALL LBL (\d+)")
PRINT = re.compile(r"FN 16: F-PRINT (\S+) / (\S+)")
PROBE = (
    re.compile(r"TCH PROBE 4\.0 MEASURING IN 3-D"),
    re.compile(r"TCH PROBE 4\.1 Q(\d+)"),
    re.compile(r"TCH PROBE 4\.2 IX\+(Q\d+) IY\+(Q\d+) IZ\+(Q\d+)"),
    re.compile(r"TCH PROBE 4\.3 (?:DIST|ABST)\+(Q\d+) F(\d+\.?\d*) MB\+(\d+\.?\d*) REFERENCE SYSTEM: 1"),
)
BEGIN, END = re.compile(r"BEGIN PGM (\S+) MM"), "END PGM {} MM"
HEAD = (  # nothing is shifted, mirrored, turned or scaled, and the spindle stands
    *(
        "CYCL DEF 7.1 X+0.0",
        "CYCL DEF 7.2 Y+0.0",
        "CYCL DEF 7.3 Z+0.0",
        "CYCL DEF 8.1",
        "CYCL DEF 10.1 ROT+0",
        "CYCL DEF 11.1 SCL 1",
    ),
    *("M137", "M5"),
)
CYCLES = (
    *("CYCL DEF 7.0 DATUM SHIFT", "CYCL DEF 8.0 MIRROR IMAGE", "CYCL DEF 10.0 ROTATION", "CYCL DEF 11.0 SCALING"),
    "CYCL DEF 13.0 ORIENTATION",
    "CYCL DEF 9.0 DWELL TIME",
)
DWELL = re.compile(r"CYCL DEF 9\.1 DWELL (\d{1,2})")
FOLLOWS = {  # a block of a cycle belongs to the one before it, and is another one's alone
    **{later: before for before, later in pairwise(["CYCL DEF 7.0 DATUM SHIFT", *HEAD[:3]])},
    **dict(zip(HEAD[3:6], CYCLES[1:4], strict=True)),
    "CYCL DEF 9.1": "CYCL DEF 9.0 DWELL TIME",
    **{"CYCL DEF 13.1": CYCLES[4], "M19": "CYCL DEF 13.1"},
}
