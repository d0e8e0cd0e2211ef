"""The acceptance sheet as plain data, as lines for people, and as the text of one typst page."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

from ..texts.number import unsigned_zero
from .covered import Covered, column
from .order import Certificate
from .sheet import Row, Signed

SIZES = (7.0, 6.5, 6.0, 5.5)  # pt, of the letters of the page; before less than 6.5 the rows are set closer
COUNT = re.compile(rb"/Count (\d+)")  # pages of a PDF
MOST, FINEST = 3, 6  # decimals of a value; of an end of an interval that is beside its limit


def as_json(found: Signed) -> dict[str, Any]:
    """sheet → plain data of the format tango-acceptance/1."""
    return {
        "format": "tango-acceptance/1",
        "conforms": found.conforms,
        "headline": headline(found),
        "stands": found.stands or None,
        "figures": [
            {
                **{"name": r.name, "value": r.value, "U": r.expanded, "guard_band": r.guard, "limit": r.limit, "unit": r.unit},
                **{"interval": None if r.interval is None else list(r.interval)},
                **{"decided_by": None if r.decided is None else list(r.decided), "verdict": r.verdict, "why": r.why},
                **{"over": [_over(c) for c in r.over], "note": r.how, "two_sided": r.two_sided},
            }
            for r in found.rows
        ],
        "iso_17025_7_8": dict(found.checklist),
        "missing": list(found.missing),
        "lacks": dict(found.lacks),
        "certificates": [_certificate(c) for c in found.order.certificates],
        "conditions": dict(found.order.conditions),
    }


def _over(c: Covered) -> dict[str, Any]:
    found = {"axis": c.axis, "range": [c.low, c.high], "travel": None if c.travel is None else list(c.travel), "unit": c.unit}
    return {**found, "positions": c.positions}


def _certificate(c: Certificate) -> dict[str, Any]:
    until = None if c.valid_until is None else c.valid_until.isoformat()
    return {
        **{"of": c.of, "number": c.number, "date": c.issued.isoformat(), "valid_until": until, "value": c.value or None},
        **{"uncertainty": c.uncertainty, "k": c.k, "issued_by": c.issued_by},
    }


def cells(row: Row) -> list[str]:
    """figure → cells: name, what it holds over, value, the interval that decides, U, guard band, limit, unit, verdict."""
    places = digits(row.expanded)
    value, expanded = (f"{x:.{places}f}" if x is not None else "–" for x in (row.value, row.expanded))
    guard = "–" if row.guard is None else f"{row.guard:.{places + 1}f}"
    between = "–" if row.decided is None else " … ".join(_against(x, row.limit, places + 1) for x in row.decided)
    over, limit = column(row.over), f"{'± ' if row.two_sided else ''}{row.limit:g}"
    return [unsigned_zero(cell) for cell in (row.name, over, value, between, expanded, guard, limit, row.unit, row.verdict)]


def digits(expanded: float | None) -> int:
    """U → decimals with which it has two significant digits, and the value as many; 0 to 3.

    Source: JCGM 100:2008, 7.2.6.
    """
    if not expanded:
        return MOST
    return min(max(1 - math.floor(math.log10(float(f"{expanded:.1e}"))), 0), MOST)


def _against(end: float, limit: float, places: int) -> str:
    """end of the interval that decides, limit, decimals → the end, with as many more as show on which side of the limit it is."""
    while places < FINEST and abs(end) != limit and float(f"{abs(end):.{places}f}") == limit:
        places += 1
    return f"{end:.{places}f}"


HEAD = ["figure", "over", "value", "at least … at most", "U (k = 2)", "guard band", "limit", "", "verdict"]


COPIES = "End of the sheet. It may be copied in full; a part of it only where the laboratory agrees."


def headline(found: Signed) -> str:
    """sheet → the sentence at its head: do the figures conform, and may the sheet be signed?"""
    if found.stands:
        return "No statement of conformity is made."
    text = "All figures conform" if found.conforms else "Not all figures conform"
    if not found.missing:
        return f"{text}."
    return f"{text}, but the sheet is incomplete and must not be signed. It lacks: {'; '.join(found.missing)}."


def one_page(found: Signed, quoted: Callable[[object], str], compiled: Callable[[str], bytes]) -> bytes:
    """sheet, what makes a string literal of typst, what makes a PDF of its source → PDF: one page, in smaller letters where a
    long sheet needs them; more pages where even the smallest that people read do not do.
    """
    for size, close in [*((size, False) for size in SIZES[:2]), *((size, True) for size in SIZES[1:])]:
        made = compiled(typst(found, quoted, size, close))
        if (pages := COUNT.search(made)) and int(pages[1]) == 1:
            return made
    return compiled(typst(found, quoted))


def typst(found: Signed, quoted: Callable[[object], str], size: float = 7.0, close: bool = False) -> str:
    """sheet, what makes a string literal of typst, size of its letters (pt), whether rows are set closer → source of the page."""
    row, line, edge, sign = (1.3, 0.3, 9, 5) if close else (2.5, 0.4, 11, 7)  # pt, em, mm, mm
    stands = f"No interval stands: {found.stands}" if found.stands else ""
    head = ", ".join(f"text({quoted(c)})" for c in HEAD)
    body = ", ".join(f"text({quoted(c)})" for row in found.rows for c in cells(row))
    missing = {clause: f"missing: {found.lacks[clause]}" if clause in found.lacks else "missing" for clause in found.missing}
    answers = ", ".join(f"text({quoted(x)})" for clause, a in found.checklist.items() for x in (clause, a or missing[clause]))
    why = "".join(f"#text({quoted(f'{r.name}: {r.why}')}) \\\n" for r in found.rows if r.why and r.why != found.stands)
    person = found.checklist["7.8.2.1 o) authorised by"]
    number = found.order.people.get("number", "")
    foot = quoted(f"Acceptance sheet {number}, page ")
    counted = f'context [#text({size}pt, {foot} + counter(page).display("1 of 1", both: true))]'
    return f"""#set page(paper: "a4", margin: (x: 14mm, y: {edge}mm), footer: {counted})
#set text(size: {size}pt, font: ("Liberation Sans", "DejaVu Sans", "Libertinus Serif"), fallback: true)
#set par(leading: {line}em)
#set table.cell(breakable: false)
#text(15pt, weight: "bold", {quoted(f"Acceptance sheet {number}")})

#text(10pt, weight: "bold", {quoted(headline(found))}) #text({quoted(stands)})

#table(columns: (1fr, auto, auto, auto, auto, auto, auto, auto, auto), inset: {row}pt, stroke: 0.3pt,
  table.header({head}), {body})
{why}
#table(columns: (42mm, 1fr), inset: {0.8 * row:.2f}pt, stroke: 0.3pt, {answers})

#block(breakable: false)[
#v({sign}mm) #line(length: 70mm, stroke: 0.5pt)
#text({quoted(f"{person} (date, signature)")})

#align(center, text({size}pt, {quoted(COPIES)}))
]
"""
