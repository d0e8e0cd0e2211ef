"""Alarms of a Sinumerik-like control by number; texts from memory: unverified."""

from __future__ import annotations

from ...motion import MotionStop
from .._shared.alarm import Alarm, Silence

TEXTS = {
    "6500": "NC MEMORY IS FULL",
    "10720": "SOFTWARE LIMIT SWITCH",
    "10860": "FEEDRATE NOT PROGRAMMED",
    "12080": "SYNTAX ERROR",
    "12090": "UNEXPECTED PARAMETER",
    "12150": "OPERATION NOT COMPATIBLE WITH DATA TYPE",
    "12170": "NAME DEFINED SEVERAL TIMES",
    "12190": "DEFINITION BEHIND THE FIRST STATEMENT",
    "12420": "IDENTIFIER TOO LONG",
    "12470": "G FUNCTION UNKNOWN",
    "12550": "NAME NOT DEFINED OR OPTION NOT AVAILABLE",
    "12640": "CONTROL STRUCTURE NOT CLOSED",
    "14011": "END OF PROGRAM MISSING",
    "14051": "ERROR IN ARITHMETIC",
    "14080": "JUMP DESTINATION NOT FOUND",
    "16800": "TRAVERSE INSTRUCTION DC ONLY FOR MODULO AXES",
    "16830": "INCORRECT MODULO POSITION",
    "17020": "ILLEGAL ARRAY INDEX",
    "17180": "D NUMBER NOT DEFINED",
    "21700": "TOUCH PROBE IS ALREADY DEFLECTED, EDGE POLARITY NOT POSSIBLE",
    "26000": "PROBE TRIPPED",
    "26001": "MACHINE ALARM",
}


def alarm(code: str, detail: str = "") -> Alarm:
    """number, what it is about → the alarm to raise."""
    return Alarm(code, TEXTS[code], detail)


def as_alarm(stop: MotionStop) -> Exception:
    """why the motion ended → the alarm for it, or Silence."""
    if stop.cause == "overtravel":
        return alarm("10720", f"{stop.axis}{'+' if stop.sign > 0 else '-'}: {stop}")
    if stop.cause == "collision":
        return alarm("26000", str(stop))
    return Silence() if str(stop) == "silence" else alarm("26001", str(stop))
