"""Errors of a Fagor control by what is wrong; a real one has numbers for them, which are not known here."""

from __future__ import annotations

from .._shared.alarm import Alarm

TEXTS = {
    "syntax": "SYNTAX ERROR",
    "arithmetic": "ERROR IN ARITHMETIC",
    "empty": "PARAMETER WITHOUT A VALUE",
    "variable": "VARIABLE DOES NOT EXIST",
    "parameter": "PARAMETER DOES NOT EXIST",
    "g-code": "FUNCTION DOES NOT EXIST",
    "statement": "STATEMENT DOES NOT EXIST",
    "axis": "AXIS DOES NOT EXIST",
    "feed": "FEEDRATE NOT PROGRAMMED",
    "structure": "$IF AND $ENDIF DO NOT MATCH",
    "header": "PROGRAM HEADER MISSING",
    "memory": "NOT ENOUGH MEMORY",
    "end": "END OF PROGRAM MISSING",
    "offset": "OFFSET DOES NOT EXIST",
    "file": "FILE NOT OPEN",
    "format": "TOO MANY OR TOO FEW IDENTIFIERS",
    "probe": "PROBE",
    "overtravel": "SOFTWARE TRAVEL LIMIT",
    "collision": "PROBE SIGNAL OUTSIDE OF A PROBING BLOCK",
    "machine": "MACHINE",
}


def alarm(kind: str, detail: str = "") -> Alarm:
    """what is wrong, what it is about → the error to raise."""
    return Alarm(f"CNC-{kind.upper()}", TEXTS[kind], detail)
