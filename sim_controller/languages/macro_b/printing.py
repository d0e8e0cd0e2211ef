"""`DPRNT[…]`: text and variables → the line that is punched."""

from __future__ import annotations

import re
from decimal import ROUND_HALF_UP, Decimal
from typing import Literal

from .alarms import alarm
from .expressions import Expression, Get

_FORMAT = re.compile(r"\[(\d)(\d)\]")
_TEXT = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789+-/.*")
Padding = Literal["spaces", "none", "bare"]  # bare: no leading and no trailing zeros, as a Haas NGC prints
Overflow = Literal["dropped", "expanded"]  # digits before the point that do not fit: Fanuc drops them, Haas makes room


def printed(text: str, get: Get, padding: Padding, overflow: Overflow = "dropped") -> str:
    """inside of DPRNT[…] without spaces → line without its end. Raises Alarm for characters or formats that are not allowed."""
    line, at = "", 0
    while at < len(text):
        if text[at] != "#":
            if text[at] not in _TEXT:
                raise alarm("PS0114", f"{text[at]!r} in DPRNT")
            line += " " if text[at] == "*" else text[at]
            at += 1
            continue
        expression = Expression(text, get, at)
        number = expression.reference()
        form = _FORMAT.match(text, expression.at)
        if form is None:
            raise alarm("PS0114", f"format [cd] expected after #{number} in DPRNT")
        line += field(get(number), int(form[1]), int(form[2]), padding, overflow)
        at = form.end()
    return line


def field(value: float | None, whole: int, decimals: int, padding: Padding, overflow: Overflow = "dropped") -> str:
    """value, digits before and after the point → the field: sign before the padding, digits that do not fit dropped or not.

    Raises Alarm for [00] and for more than eight digits.
    """
    if not 0 < whole + decimals <= 8:
        raise alarm("PS0114", f"format [{whole}{decimals}]")
    number = Decimal(repr(float(value or 0.0))).quantize(Decimal(1).scaleb(-decimals), ROUND_HALF_UP)
    digits = f"{abs(number):f}"
    before, _, after = digits.partition(".")
    if overflow == "dropped":
        before = before[-whole:] if whole else ""
    negative = number < 0
    if padding == "spaces":
        before = (before.lstrip("0") or "0").rjust(whole) if whole else before.lstrip("0")
        sign = "-" if negative else " "
    else:
        before = before.lstrip("0") or ("0" if whole else "")
        sign = "-" if negative else ""
    if padding == "bare":
        before, after = before.lstrip("0"), after.rstrip("0")
        before = before or ("" if after else "0")
    return sign + before + (f".{after}" if decimals else "")
