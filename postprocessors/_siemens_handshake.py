"""Records through variables of a Sinumerik: R parameters or an array of global user data, which an OPC UA server shows.

What stands where is that of `tango_cnc/link/opcua.yaml`: the control writes `record` last, and waits until `taken` is the same.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from tango_cnc.records import InputError

NONE = "none"
NAME = re.compile(r"R(?P<first>[0-9]{1,3})|[A-Z][A-Z_][A-Z0-9_]{0,22}")
OFFSETS = {"record": 0, "taken": 1, "point": 2, "flag": 3, "count": 4, "mark0": 5, "mark1": 6, "mark2": 7, "sum": 8}
OFFSETS |= {letter: 10 + i for i, letter in enumerate("XYZABCS")}
LAST = max(OFFSETS.values())
MOST = 65535  # records are counted to it and go on from 0
END = 65535  # point of the end mark
AHEAD = "TAKEN IS AHEAD OF RECORD. MAKE BOTH THE SAME"
WAIT = 0.1  # s between two looks at `taken`


def used(name: str) -> bool:
    """value of the option → whether records go into variables. Raises InputError for what names none."""
    if name == NONE:
        return False
    match = NAME.fullmatch(name)
    if match is None or int(match["first"] or 0) + LAST > 999:
        raise InputError(
            f"controller.handshake: found {name!r}; allowed: none, R700 (the first of {LAST + 1} R parameters), or the name of an "
            f"array of global user data with {LAST + 1} fields"
        )
    return True


def cell(name: str, what: str) -> str:
    """value of the option, what is meant → the variable: R702, or TANGO[2]."""
    match = NAME.fullmatch(name)
    assert match is not None
    return f"R{int(match['first']) + OFFSETS[what]}" if match["first"] else f"{name}[{OFFSETS[what]}]"


def doubts(name: str) -> tuple[str, ...]:
    """value of the option → what is unverified with it."""
    if not used(name):
        return ()
    first, last = cell(name, "record"), cell(name, "S")
    return (
        f"{first} to {last} exist, keep their values when the control is switched off, and nobody else uses them",
        f"the OPC UA server shows {first} to {last} as the file of nodes names them, and lets {cell(name, 'taken')} be written",
        "a loop of WHILE with G4 and STOPRE sees what the OPC UA server writes, and a reset ends it",
    )


def ahead(name: str) -> str:
    """value of the option → the condition that `taken` would take the next record before anybody has seen it."""
    record, taken = cell(name, "record"), cell(name, "taken")
    return f"({taken}-{record}==1) OR ({record}-{taken}=={MOST})"


def handed(name: str, values: Mapping[str, str]) -> Iterator[str]:
    """value of the option, {what: its value or expression} → the lines that give a record and wait until it has been taken."""
    record, taken = cell(name, "record"), cell(name, "taken")
    for what, value in values.items():
        yield f"{cell(name, what)}={value}"
    yield "STOPRE"
    yield f"{record}={record}+1"
    yield f"IF {record}>{MOST}"
    yield f"{record}=0"
    yield "ENDIF"
    yield f"WHILE {taken}<>{record}"
    yield f"G4 F{WAIT}"
    yield "STOPRE"
    yield "ENDWHILE"


def marked(mark: str, count: int) -> dict[str, str]:
    """hash of the program, its touches → what stands in the variables all the time."""
    whole = mark.rjust(12, "0")
    return {"count": str(count), **{f"mark{i}": str(int(whole[4 * i : 4 * i + 4], 16)) for i in range(3)}}
