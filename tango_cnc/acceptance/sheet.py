"""acceptance.yaml and figures → decisions with a guard band, and the clauses of ISO/IEC 17025:2017, 7.8 that the page answers.

A figure conforms when value and guard band lie inside the limit, and does not when they lie outside it (ISO 14253-1:2017; 95 %
for one limit and a normal distribution: g = 1.65 u). Between both nothing is stated. Where the touches scatter more than the
cell states, or the estimate is not trustworthy, no interval stands and nothing conforms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from scipy import special, stats

from ..files.checked import load
from ..iso230.signed import OnPart, Sheet
from ..judgement import Judgement
from ..records import InputError, Machine

GUARD = 1.65
EXPANDED = 2.0
SURPRISE = 0.01
PEOPLE = ("laboratory", "address", "location", "customer", "number", "item", "performed", "method", "signed_by", "role")
CONDITIONS = ("machine_temperature", "table_temperature", "air_temperature", "warm_up")
CERTIFICATE = ("of", "number", "date", "value", "uncertainty", "issued_by")
RULE = (
    "ISO 14253-1:2017: a figure conforms when it lies inside its limit by the guard band g = 1.65 u or more (95 %), does not "
    "conform when it lies outside by g or more, and is undecided between"
)


@dataclass(frozen=True)
class Order:
    """acceptance.yaml: limits by figure (µm, µrad, µm/m), who and where, conditions, certificates."""

    limits: Mapping[str, float]
    people: Mapping[str, str]
    conditions: Mapping[str, str]
    certificates: tuple[Mapping[str, str], ...]
    tool_length: float | None = None
    remarks: str = ""


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


@dataclass(frozen=True)
class Signed:
    """All that the page states."""

    order: Order
    rows: tuple[Row, ...]
    stands: str  # empty, or why no interval stands
    checklist: Mapping[str, str]  # clause of ISO/IEC 17025:2017 → what answers it; empty where nothing does

    @property
    def missing(self) -> tuple[str, ...]:
        """→ clauses that nothing answers."""
        return tuple(clause for clause, answer in self.checklist.items() if not answer)

    @property
    def conforms(self) -> bool:
        """→ whether every figure conforms."""
        return all(row.verdict == "conforms" for row in self.rows)


def read_order(file: Path) -> Order:
    """acceptance.yaml → order. Raises InputError for keys that do not exist and limits that are not above 0."""
    fields = load(file).fields(["limits"], [*PEOPLE, "conditions", "certificates", "tool_length", "remarks"])
    limits = {name: child.number(above=0) for name, child in fields["limits"].items()}
    if not limits:
        raise fields["limits"].wrong("at least one figure with its limit, such as 'straightness EYX: 10'", "none")
    people = {name: _said(fields[name].plain()) for name in PEOPLE if name in fields}
    conditions: dict[str, str] = {}
    if "conditions" in fields:
        conditions = {name: _said(child.plain()) for name, child in fields["conditions"].items()}
    certificates = []
    for node in fields["certificates"].list() if "certificates" in fields else []:
        certificates.append({name: _said(child.plain()) for name, child in node.fields(CERTIFICATE).items()})
    length = fields["tool_length"].number(above=0) if "tool_length" in fields else None
    return Order(
        limits, people, conditions, tuple(certificates), length, _said(fields["remarks"].plain()) if "remarks" in fields else ""
    )


def _said(value: object) -> str:
    return "" if value is None else str(value)


def made(
    order: Order,
    sheet: Sheet,
    judgement: Judgement,
    machine: Machine,
    files: Sequence[tuple[str, int, str]],
    version: str,
    day: str,
) -> Signed:
    """order, figures, judgement, machine, files (name, bytes, SHA-256), version, date of issue → page. Raises InputError for limits

    on figures that this machine does not have.
    """
    known = {f"{f.kind} {f.name}": f for f in sheet.figures}
    unknown = [name for name in order.limits if name not in known]
    if unknown:
        raise InputError(f"acceptance.yaml: limits: found {unknown[0]!r}; allowed: {', '.join(known)}")
    stands = _stands(sheet, judgement, machine)
    rows = tuple(_row(name, known[name], limit, sheet, stands) for name, limit in order.limits.items())
    return Signed(order, rows, stands, _checklist(order, sheet, files, version, day))


def _stands(sheet: Sheet, judgement: Judgement, machine: Machine) -> str:
    if judgement.verdict != "trustworthy":
        return f"the result is {judgement.verdict}: {'; '.join(judgement.reasons)}"
    stated = machine.probe.repeatability
    most = stated * float(stats.chi2.ppf(1 - SURPRISE, sheet.freedom) / sheet.freedom) ** 0.5
    if sheet.sigma > most:
        return (
            f"the touches scatter by {sheet.sigma * 1e3:.2f} µm where machine.yaml states {stated * 1e3:.2f} µm; "
            f"up to {most * 1e3:.2f} µm would be no surprise"
        )
    return ""


def _row(name: str, f: OnPart, limit: float, sheet: Sheet, stands: str) -> Row:
    if f.value is None or f.interval is None:
        return Row(name, None, None, None, limit, f.unit, "not stated", f.text)
    if f.kind.startswith("positioning") and f.unit.startswith("µm") and sheet.temperature == "not stated":
        why = "the temperatures of bar and machine are not stated; write temperature.yaml"
        return Row(name, None, None, None, limit, f.unit, "not stated", why)
    factor = float(special.stdtrit(sheet.freedom, 0.975))
    size = abs(f.value)
    side = max(f.interval[1] - f.value, f.value - f.interval[0]) / factor
    guard = GUARD * side
    verdict = "conforms" if size + guard <= limit else "does not conform" if size - guard >= limit else "undecided"
    if stands:
        verdict = "not stated"
    return Row(name, f.value, EXPANDED * side, guard, limit, f.unit, verdict, stands)


def _checklist(order: Order, sheet: Sheet, files: Sequence[tuple[str, int, str]], version: str, day: str) -> dict[str, str]:
    p, c = order.people, order.conditions
    certificates = "; ".join(
        f"{x['of']} {x['number']} ({x['date']}): {x['value']} ± {x['uncertainty']}" for x in order.certificates
    )
    conditions = "; ".join(f"{n.replace('_', ' ')} {c[n]}" for n in CONDITIONS) if all(c.get(n) for n in CONDITIONS) else ""
    return {
        "7.8.2.1 a) title": "Acceptance sheet",
        "7.8.2.1 b) laboratory": _both(p, "laboratory", "address"),
        "7.8.2.1 c) location": p.get("location", ""),
        "7.8.2.1 d) number and end": p.get("number", ""),
        "7.8.2.1 e) customer": p.get("customer", ""),
        "7.8.2.1 f) method": p.get("method", ""),
        "7.8.2.1 g) item": p.get("item", ""),
        "7.8.2.1 i) performed": p.get("performed", ""),
        "7.8.2.1 j) issued": day,
        "7.8.2.1 l) only this item": "The results relate to the item named here only, as it was when it was measured.",
        "7.8.2.1 m) results": "the table of figures, in µm, µrad and µm/m",
        "7.8.2.1 n) additions, deviations": order.remarks,
        "7.8.2.1 o) authorised by": _both(p, "signed_by", "role"),
        "7.8.4.1 a) uncertainty": "U = 2 u (k = 2): scatter of touches, every error motion of the axes; in scales the expansions",
        "7.8.4.1 b) conditions": conditions,
        "7.8.4.1 c) traceability": certificates,
        "7.8.6 decision rule": RULE,
        "other: reference": f"{sheet.reference.text}; scales: temperature {sheet.temperature}",
        "other: program and data": f"tango_cnc {version}; " + "; ".join(f"{n} {h[:16]}" for n, _, h in files),
    }


def _both(p: Mapping[str, str], one: str, two: str) -> str:
    return f"{p[one]}, {p[two]}" if p.get(one) and p.get(two) else ""
