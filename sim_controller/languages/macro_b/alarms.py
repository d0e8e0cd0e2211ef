"""Alarms of a Fanuc-like control by number; texts as in the manuals of the 30i family, from memory: unverified."""

from __future__ import annotations

from ...motion import MotionStop
from .._shared.alarm import Alarm, Silence

TEXTS = {
    "PS0003": "TOO MANY DIGIT",
    "PS0004": "INVALID BREAK POINT OF WORDS",
    "PS0005": "NO DATA AFTER ADDRESS",
    "PS0007": "ILLEGAL USE OF DECIMAL POINT",
    "PS0009": "IMPROPER NC-ADDRESS",
    "PS0010": "IMPROPER G-CODE",
    "PS0011": "FEED ZERO ( COMMAND )",
    "PS0030": "ILLEGAL OFFSET NUMBER",
    "PS0035": "CAN NOT COMMAND G31",
    "P601": "MULTI STEP SKIP WITHOUT P",
    "P603": "SKIP SPEED 0",
    "PS0070": "NO PROGRAM SPACE IN MEMORY",
    "PS0076": "PROGRAM NOT FOUND",
    "PS0077": "TOO MANY SUB,MACRO NESTING",
    "PS0110": "OVERFLOW :INTEGER",
    "PS0112": "ZERO DIVIDE",
    "PS0114": "ILLEGAL EXPRESSION FORMAT",
    "PS0115": "VARIABLE NO. OUT OF RANGE",
    "PS0116": "WRITE PROTECTED VARIABLE",
    "PS0118": "TOO MANY BRACKET NESTS",
    "PS0119": "ARGUMENT VALUE OUT OF RANGE",
    "PS0123": "ILLEGAL MODE FOR GOTO/WHILE/DO",
    "PS0124": "MISSING END STATEMENT",
    "PS0125": "MACRO STATEMENT FORMAT ERROR",
    "PS0126": "ILLEGAL LOOP NUMBER",
    "PS0127": "DUPLICATE NC,MACRO STATEMENT",
    "PS0128": "ILLEGAL MACRO SEQUENCE NUMBER",
    "PS0129": "USE 'G' AS ARGUMENT",
    "PS5010": "END OF RECORD",
    "OT0500": "+ OVERTRAVEL ( SOFT 1 )",
    "OT0501": "- OVERTRAVEL ( SOFT 1 )",
    "EX1001": "PROBE TRIPPED",
    "EX1002": "MACHINE ALARM",
}


def alarm(code: str, detail: str = "") -> Alarm:
    """number, what it is about → the alarm to raise."""
    return Alarm(code, TEXTS[code], detail)


def as_alarm(stop: MotionStop) -> Exception:
    """why the motion ended → the alarm for it, or Silence."""
    if stop.cause == "overtravel":
        return alarm("OT0500" if stop.sign > 0 else "OT0501", f"{stop.axis}: {stop}")
    if stop.cause == "collision":
        return alarm("EX1001", str(stop))
    return Silence() if str(stop) == "silence" else alarm("EX1002", str(stop))
