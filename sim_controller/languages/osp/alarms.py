"""Alarms of an OSP by what is wrong; a real OSP has numbers for them, which are not known here."""

from __future__ import annotations

from .._shared.alarm import Alarm

TEXTS = {
    "syntax": "DATA FORMAT",
    "arithmetic": "ARITHMETIC",
    "empty": "VARIABLE HOLDS NOTHING",
    "variable": "NO SUCH VARIABLE",
    "g-code": "NO SUCH G CODE",
    "word": "NO SUCH ADDRESS",
    "feed": "NO FEED",
    "name": "PROGRAM OR SEQUENCE NAME",
    "end": "NO END OF PROGRAM",
    "memory": "PROGRAM MEMORY FULL",
    "nesting": "TOO MANY SUBPROGRAMS",
    "file": "FILE",
    "offset": "OFFSET NUMBER",
    "text": "TEXT TOO LONG",
    "unit": "UNIT SYSTEM",
    "probe": "TOUCH SENSOR IS ON",
    "overtravel": "STROKE END LIMIT",
    "collision": "TOUCH SENSOR CONTACT",
    "machine": "MACHINE",
}


def alarm(kind: str, detail: str = "") -> Alarm:
    """what is wrong, what it is about → the alarm to raise."""
    return Alarm(f"OSP-{kind.upper()}", TEXTS[kind], detail)
