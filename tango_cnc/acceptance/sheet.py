"""Order and figures → decisions with a guard band, and the page as records.

A figure conforms when value and guard band lie inside the limit, and does not when they lie outside it (ISO 14253-1:2017; 95 %
for one limit and a normal distribution: g = 1.65 u). A range is not normal: its guard bands end where it is larger, or smaller,
with 5 %; and what noise alone may show begins at 0 and is not rejected. Between both nothing is stated. The interval from one
guard band to the other is the one that is printed. No interval stands, and nothing conforms,
where no machine is known to have been measured, where the control has got a compensation since, where the estimate is not
trustworthy, where there is no budget or it does not name what every machine has, or where the touches scatter more than the budget
allows for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, datetime

from scipy import special

from ..iso230.signed import OnPart, Sheet
from ..judgement import Judgement
from ..records import Cell, InputError
from .clauses import checklist, unstated
from .covered import FITTED, Covered, covered, made_how, of_figure, two_sided
from .fitting import contradictions, untraced
from .order import Order

GUARD = 1.65
EXPANDED = 2.0
SURPRISE = 0.01
PARAMETER = "parameter"  # kind of a figure that rests on the terms of the cell


@dataclass(frozen=True)
class Source:
    """Where the readings come from: `doubt` is empty where a run measured a machine; its begin and end, UTC; touches left out.

    `older`: empty, or which compensation in the control they do not contain, and why.
    """

    doubt: str
    ran: tuple[datetime, datetime] | None = None
    text: str = ""
    remarks: tuple[str, ...] = ()
    older: str = ""


@dataclass(frozen=True)
class Row:
    """One figure against its limit; `verdict` is conforms, does not conform, undecided or not stated."""

    name: str
    value: float | None
    expanded: float | None  # U, k = 2
    guard: float | None
    limit: float
    unit: str
    verdict: str
    why: str = ""
    interval: tuple[float, float] | None = None  # 95 %, both sides together; that of a range ends at 0
    decided: tuple[float, float] | None = None  # from guard band to guard band, 95 % each: what decides, and is printed
    over: tuple[Covered, ...] = ()  # the axes that it is of: it holds over what was touched of them
    how: str = ""  # how it is made: about which line, over which poses
    two_sided: bool = False  # its sign counts, and its limit holds on both sides of 0


@dataclass(frozen=True)
class Signed:
    """All that the page states."""

    order: Order
    rows: tuple[Row, ...]
    stands: str  # empty, or why no interval stands
    checklist: Mapping[str, str]  # clause of ISO/IEC 17025:2017 → what answers it; empty where nothing does
    lacks: Mapping[str, str]  # clause → what it lacks, in words

    @property
    def missing(self) -> tuple[str, ...]:
        """→ clauses that nothing answers."""
        return tuple(clause for clause, answer in self.checklist.items() if not answer)

    @property
    def conforms(self) -> bool:
        """→ whether every figure conforms."""
        return all(row.verdict == "conforms" for row in self.rows)


def made(
    order: Order,
    sheet: Sheet,
    judgement: Judgement,
    cell: Cell,
    source: Source,
    absent: Sequence[str],
    files: Sequence[tuple[str, int, str]],
    version: str,
    day: date,
    by_terms: Judgement | None = None,
) -> Signed:
    """order, figures, judgement, cell, origin, what the budget leaves out, files (name, bytes, SHA-256), version, day, judgement by
    the terms of the cell where that is another one → page.

    Raises InputError for limits on figures that this machine does not have, and where order and cell contradict each other.
    """
    known = {f"{f.kind} {f.name}": f for f in sheet.figures}
    unknown = [name for name in order.limits if name not in known]
    if unknown:
        hint = ", 'parameter NAME' of the fit, and 'part NAME' where 'part' lists features"
        near = [name for name in known if any(word in name.split() for word in unknown[0].split())] or list(known)
        found = ", ".join(map(repr, unknown))
        raise InputError(f"{order.file}: limits: found {found}; allowed: {', '.join(near)}{hint}")
    contradictions(order, cell, sheet.thermal, source.ran)
    stands = _stands(sheet, judgement, source, absent)
    alone = _doubted(by_terms or judgement)
    over = covered(sheet, cell.machine)
    rows = tuple(
        replace(
            _row(name, known[name], limit, sheet, stands or (alone if known[name].kind == PARAMETER else "")),
            over=of_figure(known[name], over),
            how="" if known[name].kind in FITTED else known[name].note,
            two_sided=two_sided(known[name]),
        )
        for name, limit in order.limits.items()
    )
    scales = sheet.thermal is not None and any(known[r.name].expands for r in rows)
    lacking = untraced(order, cell, scales, day)
    lacks = {"7.8.4.1 c) traceability": "; ".join(lacking)} if lacking else {}
    said = (source.remarks, judgement.remarks)
    answers = checklist(order, sheet, not lacking, source.text, *said, files, version, day.isoformat())
    answers |= made_how([(r.name, r.how) for r in rows], over)
    return Signed(order, rows, stands, answers, unstated(order, answers) | lacks)


def _stands(sheet: Sheet, judgement: Judgement, source: Source, absent: Sequence[str]) -> str:
    if source.older:
        return f"{source.older}: the readings do not show the machine as it is now. Measure again and accept by those readings"
    if source.doubt:
        return source.doubt
    if doubt := _doubted(judgement):
        return doubt
    if sheet.budget is None or sheet.expected is None:
        return "there is no uncertainty.yaml, so U has no drift, no lobing, no form: write the budget (docs/uncertainty.md)"
    if absent:
        return f"uncertainty.yaml does not name {', '.join(absent)}: write a line of each, with 0 where it was found to be nothing"
    most = sheet.expected * float(special.chdtri(sheet.freedom, SURPRISE) / sheet.freedom) ** 0.5
    if sheet.sigma > most:
        return (
            f"the touches scatter by {sheet.sigma * 1e3:.2f} µm where uncertainty.yaml allows for {sheet.expected * 1e3:.2f} µm; "
            f"up to {most * 1e3:.2f} µm would be no surprise"
        )
    return ""


def _doubted(judgement: Judgement) -> str:
    if judgement.verdict == "trustworthy":
        return ""
    return f"the result is {judgement.verdict}: {'; '.join(judgement.reasons)}"


def _row(name: str, f: OnPart, limit: float, sheet: Sheet, stands: str) -> Row:
    if f.value is None or f.interval is None:
        return Row(name, None, None, None, limit, f.unit, "not stated", f.text)
    if f.expands and sheet.temperature == "not stated":
        why = "the temperatures of bar and machine are not stated; write temperature.yaml"
        return Row(name, None, None, None, limit, f.unit, "not stated", why)
    factor = float(special.stdtrit(sheet.freedom, 0.975))
    side = max(f.interval[1] - f.value, f.value - f.interval[0]) / factor
    low, high = f.bounds or (f.value - GUARD * side, f.value + GUARD * side)
    most, least = max(abs(low), abs(high)), 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
    size = abs(f.value)
    guard = size - least if limit < size else most - size
    verdict = "conforms" if most <= limit else "does not conform" if least >= limit else "undecided"
    if stands:
        verdict = "not stated"
    return Row(name, f.value, EXPANDED * side, guard, limit, f.unit, verdict, stands, f.interval, (low, high))
