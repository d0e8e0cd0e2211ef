"""A sentence of a record → the same in the words of the shop: no symbol, no ±, an angle as a length over a length.

The engineer's part of a page keeps the sentence as it was recorded.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from ..records import Machine
from ..texts import LIST, Said
from ..texts.handed import COMMAND as WHOLE
from ..texts.number import MORE, Number
from .days import spoken_days
from .texts import Texts
from .units import Units, inches
from .words import spoken

SPAN = {"mm": 300.0, "inch": 12.0}  # mm or in over which a tilt is shown
COMMAND = re.compile(r"('tango [^']*')")
BRACKETS = re.compile(r" \((E[XYZABC](?:0[XYZABCS]|[XYZABC](?:\d|b))(?:-E\w+)?)\)")
ENGINEER = re.compile(r"\bE[XYZABC]\w{1,2}\b|\.yaml\b|'tango |--\w|standard\s+deviation|degrees\s+of\s+freedom")
SYMBOL = re.compile(r"\bE[XYZABC](?:0[XYZABCS]|[XYZABC](?:\d|b))\b(?:-E[XYZ][XYZ]1\b)?")
TILT = re.compile(r"[+\-−]?(\d+(?:\.\d+)?)(?: ± \d+(?:\.\d+)?)? (?:µrad|µm/m)(?![\w/²³])")
RATE = re.compile(r"([+\-−]?)(\d+(?:\.\d+)?)(?: ± \d+(?:\.\d+)?)? (µm/m|µm|µrad)/K")
SPREAD = re.compile(r"([+\-−]?)(\d+(?:\.\d+)?)(?: ± \d+(?:\.\d+)?)? µm(?![\w/²³])")
KELVIN = re.compile(r"(?<![\w-])-(?=\d+(?:\.\d+)? K\b)")


def plain(text: Any, u: Units, t: Texts, machine: Machine | None = None) -> str:
    """sentence with µm, µrad, µm/m and symbols of ISO 230-1, units, texts → the same for people who make parts.

    A number is rounded here, once, from what its text was rounded from. A date gets its day of the week. What stands between quotes
    is a command and stays as it is.
    """
    parts = COMMAND.split(t.of(text or "", MORE))
    return "".join(part if i % 2 else _plain(part, u, t, machine) for i, part in enumerate(parts))


def plainly(text: Any, t: Texts) -> str:
    """text of a record, texts → the same in this language; a reason for doubt that speaks to an engineer is what the shop reads in
    its place (`reason` of the texts), also inside another text. Numbers are not rounded yet.
    """
    if not isinstance(text, Said):
        return t.of(text, MORE)
    values = {name: plainly(x, t) if isinstance(x, Said | Number) else x for name, x in text.values.items()}
    if text.key == LIST:
        return str(values.pop("between")).join(str(x) for x in values.values())
    key = f"reason.{text.key}" if f"reason.{text.key}" in t else text.key
    return str(t(key, **values)) if key in t else t.of(text, MORE)


def reason(text: Any, u: Units, t: Texts, machine: Machine | None = None) -> str:
    """reason why readings are not believed, units, texts → what the shop reads: no symbol, no option, no statistics."""
    told = plain(plainly(text, t), u, t, machine)
    return t("reason.other") if ENGINEER.search(told) else told


def shop(text: str, t: Texts) -> str:
    """sentence, texts → the part of it for people at the machine: commands of this program are for the office, behind its mark."""
    return text.partition(t("morning.office_mark"))[0].rstrip()


def office(text: str, t: Texts) -> str:
    """sentence, texts → the part of it for the office; nothing where it has none."""
    told = text.partition(t("morning.office_mark"))[2].strip()
    return f"{told[:1].upper()}{told[1:]}"


def to_type(lines: Sequence[str], cell: str, t: Texts) -> list[str]:
    """what the office can do, name of the folder of the cell, texts → each once; where a command is among them, first where it is
    typed: no page says where that folder is.
    """
    told = list(dict.fromkeys(lines))
    where = t("web.type_where", folder=cell) if cell and any(WHOLE.search(line) for line in told) else ""
    return [where, *told] if where else told


def _plain(text: str, u: Units, t: Texts, machine: Machine | None) -> str:
    """part of a sentence without a command → the same in the words of the shop."""
    text = BRACKETS.sub("", text)
    text = SYMBOL.sub(lambda m: spoken(m[0], machine, t), text)
    text = RATE.sub(lambda m: _rate(m[1].replace("-", "−"), float(m[2]), m[3], u), text)
    text = SPREAD.sub(lambda m: _directed(m[1].replace("-", "−"), length(float(m[2]), u)), text)
    text = KELVIN.sub("−", text)
    told, at = [], 0
    for match in TILT.finditer(text):  # what a tilt becomes is no length of the record: it is not converted once more
        told += [u.sentence(text[at : match.start()]), tilt(float(match[1]), u, t)]
        at = match.end()
    return spoken_days("".join([*told, u.sentence(text[at:])]), t)


def _directed(sign: str, size: str) -> str:
    """sign or nothing, size for people → the same; what is rounded to nothing has no sign."""
    return size if float(size.split()[0]) == 0.0 else f"{sign}{size}"


def _rate(sign: str, size: float, unit: str, u: Units) -> str:
    """sign, size, unit of it, units → so much for every K."""
    return f"{sign}{length(size, u) if unit == 'µm' else f'{rounded(size)} {unit}'}/K"


def tilt(size: float, u: Units, t: Texts) -> str:
    """µrad or µm/m, units, texts → 12 µm over 300 mm, 0.0005 in over 12 in."""
    span = SPAN[u.system]
    small = size * span * (1e-3 if u.system == "mm" else 25.4e-3)  # µm
    return t("may.over", size=length(small, u), span=f"{span:g} {u.large}")


def length(micron: float, u: Units) -> str:
    """µm, units → its size for people who make parts: 76 µm, 0.0030 in."""
    return f"{rounded(abs(micron))} µm" if u.system == "mm" else inches(abs(micron) * u.plain[0])


def amount(value: float, unit: str, u: Units, t: Texts) -> str:
    """number in µm, µrad or µm/m, units, texts → 76 µm, or 12 µm over 300 mm; another unit stays as it is."""
    if unit in ("µrad", "µm/m"):
        return tilt(value, u, t)
    if unit == "µm":
        return length(value, u)
    factor, name = u.of(unit)
    return f"{rounded(abs(value * factor))} {name}".rstrip()


def signed(value: float, unit: str, u: Units, t: Texts) -> str:
    """number in µm, µrad or µm/m, units, texts → the same with the direction in which it moved: −9.2 µm. A tilt has no sign."""
    size = amount(value, unit, u, t)
    return size if unit in ("µrad", "µm/m") else _directed("−" if value < 0 else "+", size)


def rounded(value: float) -> str:
    """number without a sign → whole from 10 on, else one decimal."""
    return f"{value:.0f}" if value >= 9.95 else f"{value:.1f}".removesuffix(".0")


def value_text(value: float, std: float) -> str:
    """value, standard deviation → as many digits as the deviation is worth."""
    return f"{value:.{digits(std)}f}".replace("-", "−")


def digits(std: float) -> int:
    """standard deviation → decimals that are worth printing."""
    return 1 if std >= 1 else 2 if std >= 0.095 else 3
