"""How a number is written on a command line: said wherever one has a comma, a unit or places that it cannot have."""

from __future__ import annotations

import math
import re

PLAIN = re.compile(r"([+-]?\d+)(?:[.,](\d+))?\s*((?:[^\W\d_]|[°%])*)")
GROUPED = re.compile(r"[+-]?\d{1,3}(?:([.,' ])\d{3})(?:\1\d{3})*(?:[.,]\d+)?")
OF_CLICK = re.compile(r"'(?P<found>.*)' is not a valid (?P<kind>float|integer)", re.DOTALL)
OF_OURS = re.compile(r"--[\w-]+: found '(?P<found>[^']*)'; allowed: ")
COMMA = re.compile(r"\d,\d")
UNIT = re.compile(r"(?:^|[=:,\s])[+-]?\d+(?:\.\d+)?\s*(?:[µnm]?m|in|inch|[mµ]?rad|deg|um|urad|s|min|h|%|°)(?=$|[,:\s])")


def advice(message: str, command: str) -> str:
    """what is said of an option, the command as it is typed → how its number is written, a sentence; '' where that is not what
    is wrong.
    """
    if found := OF_CLICK.match(message):
        return _single(found["found"].strip(), found["kind"] == "integer", command)
    if (found := OF_OURS.match(message)) and (COMMA.search(found["found"]) or UNIT.search(found["found"])):
        return "Numbers are written with a point and without a unit, as 1.5; a comma stands between two of them"
    return ""


def _single(text: str, whole: bool, command: str) -> str:
    """what stands for one number, whether it has to be a whole one, the command → how it is written; '' where it is no number."""
    if (grouped := GROUPED.fullmatch(text)) and not re.fullmatch(r"[+-]?\d+,\d+", text):
        bare = text.replace(grouped[1], "").replace(",", ".")
        return f"A number is written without signs between its thousands: {_rounded(bare) if whole else bare}"
    found = PLAIN.fullmatch(text)
    if found is None:
        return ""
    whole_part, part, unit = found.groups()
    if unit:
        return f"A number stands without its unit: {command} --help says which it has"
    if whole:
        return f"This is a whole number: {_rounded(f'{whole_part}.{part or 0}')}"
    return f"A number is written with a point: {whole_part}.{part}"


def _rounded(number: str) -> str:
    """number as text → the whole numbers beside it, as text."""
    low, high = math.floor(float(number)), math.ceil(float(number))
    return f"{low}" if low == high else f"{low} or {high}"
