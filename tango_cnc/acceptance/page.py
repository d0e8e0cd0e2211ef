"""The acceptance sheet as plain data, as lines for people, and as the text of one typst page."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .order import Certificate
from .sheet import Row, Signed


def as_json(found: Signed) -> dict[str, Any]:
    """sheet → plain data of the format tango-acceptance/1."""
    return {
        "format": "tango-acceptance/1",
        "conforms": found.conforms,
        "stands": found.stands or None,
        "figures": [
            {
                **{"name": r.name, "value": r.value, "U": r.expanded, "guard_band": r.guard, "limit": r.limit, "unit": r.unit},
                **{"interval": None if r.interval is None else list(r.interval)},
                **{"decided_by": None if r.decided is None else list(r.decided), "verdict": r.verdict, "why": r.why},
            }
            for r in found.rows
        ],
        "iso_17025_7_8": dict(found.checklist),
        "missing": list(found.missing),
        "lacks": dict(found.lacks),
        "certificates": [_certificate(c) for c in found.order.certificates],
        "conditions": dict(found.order.conditions),
    }


def _certificate(c: Certificate) -> dict[str, Any]:
    until = None if c.valid_until is None else c.valid_until.isoformat()
    return {
        **{"of": c.of, "number": c.number, "date": c.issued.isoformat(), "valid_until": until, "value": c.value or None},
        **{"uncertainty": c.uncertainty, "k": c.k, "issued_by": c.issued_by},
    }


def cells(row: Row) -> list[str]:
    """figure → cells: name, value, the interval that decides, U, guard band, limit, unit, verdict."""
    value, expanded, guard = (f"{x:.2f}" if x is not None else "–" for x in (row.value, row.expanded, row.guard))
    between = "–" if row.decided is None else f"{row.decided[0]:.2f} … {row.decided[1]:.2f}"
    return [row.name, value, between, expanded, guard, f"{row.limit:g}", row.unit, row.verdict]


HEAD = ["figure", "value", "at least … at most", "U (k = 2)", "guard band", "limit", "", "verdict"]


def typst(found: Signed, quoted: Callable[[object], str]) -> str:
    """sheet, what makes a string literal of typst → source of one page."""
    overall = "All figures conform." if found.conforms else "Not all figures conform."
    if found.stands:
        overall = "No statement of conformity is made."
    head = ", ".join(f"text({quoted(c)})" for c in HEAD)
    body = ", ".join(f"text({quoted(c)})" for row in found.rows for c in cells(row))
    missing = {clause: f"missing: {found.lacks[clause]}" if clause in found.lacks else "missing" for clause in found.missing}
    answers = ", ".join(f"text({quoted(x)})" for clause, a in found.checklist.items() for x in (clause, a or missing[clause]))
    why = "".join(f"#text({quoted(f'{r.name}: {r.why}')}) \\\n" for r in found.rows if r.why and r.why != found.stands)
    person = found.checklist["7.8.2.1 o) authorised by"]
    number = found.order.people.get("number", "")
    foot = quoted(f"Acceptance sheet {number}, page ")
    counted = f'context [#text(7pt, {foot} + counter(page).display("1 of 1", both: true))]'
    return f"""#set page(paper: "a4", margin: 14mm, footer: {counted})
#set text(size: 7.5pt, font: ("Liberation Sans", "DejaVu Sans", "Libertinus Serif"), fallback: true)
#set par(leading: 0.45em)
#set table.cell(breakable: false)
#text(15pt, weight: "bold", {quoted(f"Acceptance sheet {number}")})

#text(10pt, weight: "bold", {quoted(overall)}) #text({quoted(f"No interval stands: {found.stands}" if found.stands else "")})

#table(columns: (1fr, auto, auto, auto, auto, auto, auto, auto), inset: 2.5pt, stroke: 0.3pt,
  table.header({head}), {body})
{why}
#table(columns: (38mm, 1fr), inset: 2.5pt, stroke: 0.3pt, {answers})

#v(8mm) #line(length: 70mm, stroke: 0.5pt)
#text({quoted(f"{person} (date, signature)")})

#align(center, text(7pt, "End of the sheet"))
"""
