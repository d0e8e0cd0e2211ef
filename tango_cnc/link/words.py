"""Letter-and-number records as controls print them (`DPRNT` and its relatives): strict in what is a record.

The format is known here and nowhere else. Three records exist:

    TANGO START <mark> <count>      TANGO END <mark> <count>      P17 H1 X-12.3450 Y… Z… B… C… K…

K is the sum of all coordinates, where the program prints one: lost and doubled characters pass every parity, but not this.
A record of a touch has every letter exactly once. Numbers come as `-   91.200` (sign, then padding), `.5040`, `90.` and
with spaces before or between; a decimal comma, a second sign or any other sign is no number.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from .client import Begun, Ended, Event, Refused, Touched

NUMBER = r"(?P<sign>[+-]?) *(?P<digits>\d+\.\d*|\.\d+|\d+)"
WORD = re.compile(rf" *(?P<letter>[A-Z]) *{NUMBER}(?![\d.]) *")
START = re.compile(r" *TANGO +START +(?P<mark>[0-9A-F]+) +(?P<count>\d+) *")
END = re.compile(r" *TANGO +END +(?:(?P<mark>[0-9A-F]+) +)?(?P<count>\d{1,9}) *")  # posts of earlier days print no mark
SUM = "K"
PLACES = 3  # that a control prints at least


def words(line: str) -> list[tuple[str, str]]:
    """'X   128.474 Y-   91.200' → [('X', '128.474'), ('Y', '-91.200')]. Raises ValueError saying where it is no list of words."""
    found: list[tuple[str, str]] = []
    at = 0
    while at < len(line):
        match = WORD.match(line, at)
        if match is None:
            raise ValueError(f"no letter and number at column {at + 1}")
        found.append((match["letter"], match["sign"] + match["digits"]))
        at = match.end()
    return found


def record(line: str, letters: Sequence[str]) -> Event:
    """one complete line, the axis letters a touch must carry → its event; Refused when it is no record."""
    if match := START.fullmatch(line):
        return Begun(match["mark"], int(match["count"]))
    if match := END.fullmatch(line):
        return Ended(int(match["count"]), match["mark"] or "")
    if not line.isascii() or not line.isprintable():
        return Refused("characters that no control prints: the line is disturbed or its parity is set wrongly", line)
    if "," in line:
        return Refused("a comma: numbers must have a decimal point", line)
    try:
        pairs = words(line)
    except ValueError as error:
        return Refused(str(error), line)
    values = dict(pairs)
    wanted = ["P", "H", *letters]
    if sorted(letter for letter, _ in pairs) not in (sorted(wanted), sorted({*wanted, SUM})):
        return Refused(f"the words {' '.join(letter for letter, _ in pairs)} instead of {' '.join(wanted)}", line)
    try:
        number, flag = int(_whole(values["P"])), int(_whole(values["H"]))
    except ValueError:
        return Refused("P and H must be whole numbers", line)
    if flag not in (0, 1, 2):
        return Refused(f"H{flag}: the flag is 0 (no contact), 1 (contact) or 2 (early contact)", line)
    position = {letter: float(values[letter]) for letter in letters if letter != SUM}
    if SUM in values and _uneven([values[letter] for letter in (*position, SUM)]):
        return Refused("numbers of different length from a control that prints zeros: characters were lost or doubled", line)
    if SUM in values and abs(float(values[SUM]) - sum(position.values())) > _rounding(
        [values[letter] for letter in (*position, SUM)]
    ):
        return Refused(
            f"K{values[SUM]}: the coordinates add up to {sum(position.values()):.4f}: characters were lost or changed", line
        )
    return Touched(number, flag, position, line.strip())


def _uneven(numbers: Sequence[str]) -> bool:
    """decimal numbers → whether they differ in places although zeros at the end are printed: two losses can have one sum."""
    places = [number.partition(".")[2] for number in numbers]
    return any(place.endswith("0") for place in places) and len({len(place) for place in places}) > 1


def _rounding(numbers: Sequence[str]) -> float:
    """decimal numbers, rounded or cut → by how much their sum may be wrong: places that one of them lacks are zeros, or lost.

    Every control prints micrometres. Whole numbers alone are exact, or have lost what came after the point.
    """
    return len(numbers) * 1.0001 * 10.0 ** -max(PLACES, *(len(number.partition(".")[2]) for number in numbers))


def _whole(text: str) -> str:
    """'17' or '17.' or '17.000' → '17'. Raises ValueError for anything that is not a whole number from 0."""
    match = re.fullmatch(r"\+?(\d+)(?:\.0*)?", text)
    if match is None:
        raise ValueError(text)
    return match[1]
