"""FN 16: a mask file says what is printed."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from .expressions import error


def printed(mask: Iterable[str], texts: Mapping[int, str]) -> Iterator[str]:
    """lines of a mask, string parameters → lines that are printed. Raises Alarm for a mask that is none."""
    for line in mask:
        if line in ("M_APPEND;", "M_CLOSE;"):
            continue
        match = re.fullmatch(r'"([^"]*)"((?:,QS?\d+)*);', line)
        if match is None:
            raise error("MASK FILE FAULTY", line)
        given = match[2].split(",")[1:]
        if match[1].count("%S") != match[1].count("%") or len(given) != match[1].count("%S"):
            raise error("MASK FILE FAULTY", line)
        text = match[1]
        for name in given:
            text = text.replace("%S", texts.get(int(name[2:]), "") if name.startswith("QS") else "", 1)
        yield text
