"""The clauses of ISO/IEC 17025:2017, 7.8 and what answers each; empty where nothing does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ..iso230.signed import Sheet
from .order import CONDITIONS, Order

RULE = (
    "ISO 14253-1:2017: a figure conforms when it lies inside its limit by the guard band g = 1.65 u or more (95 %), does not "
    "conform when it lies outside by g or more, and is undecided between. The column 'at least … at most' "
    "decides: the figure is above the one and below the other, each with 95 %. A limit with ± holds on both sides of 0. "
    "It is applied to every figure of the table, over the range in its column 'over'"
)
RISK = (
    "the sheet accepts at most 5 of 100 figures that are at or beyond their limit, and rejects at most 5 of 100 that are inside "
    "it. Assumed: budget and model are complete, a figure is normally distributed about its value, and a range as the machines "
    "that the touches leave possible"
)
CONFORMITY = "column verdict of the table, by the rule of 7.8.6.2 c); none is made where the head of the sheet says so"
NOTES = "of the run, and of the fit by the terms of the cell, from which figures named 'parameter' come and no others"
SUPPLIED = "the laboratory has not verified these data and does not answer for them; the results may depend on them"
NOT_IN_IT = "not in U: setting up a tool or workpiece, and whatever changes after the measurement"


def checklist(
    order: Order,
    sheet: Sheet,
    traced: bool,
    origin: str,
    deviations: Sequence[str],
    remarks: Sequence[str],
    files: Sequence[tuple[str, int, str]],
    version: str,
    day: str,
) -> dict[str, str]:
    """order, figures, whether traceability is complete, origin, what the run left out, remarks of the judgement, files,
    version, day → clause: what answers it.
    """
    p = order.people
    performed = "" if order.performed is None else " to ".join(dict.fromkeys(d.isoformat() for d in order.performed))
    return {
        "7.8.2.1 a) title": "Acceptance sheet",
        "7.8.2.1 b) laboratory": _both(p, "laboratory", "address"),
        "7.8.2.1 c) location": p.get("location", ""),
        "7.8.2.1 d) number and end": p.get("number", ""),
        "7.8.2.1 e) customer and contact": _both(p, "customer", "contact"),
        "7.8.2.1 f) method": p.get("method", ""),
        "7.8.2.1 g) item": p.get("item", ""),
        "7.8.2.1 h) receipt of the item": "none: it was measured where it stands",
        "7.8.2.1 i) performed": performed,
        "7.8.2.1 j) issued": day,
        "7.8.2.1 k) sampling": "none: one item",
        "7.8.2.1 l) only this item": "The results relate to the item named here only, as it was when it was measured.",
        "7.8.2.1 m) results": "the table of figures, in µm, µrad and µm/m",
        "7.8.2.1 n) additions, deviations": "; ".join([order.remarks, *deviations]) if order.remarks else "",
        "7.8.2.1 o) authorised by": _both(p, "signed_by", "role"),
        "7.8.2.1 p) external providers": p.get("external", ""),
        "7.8.2.2 supplied by the customer": _supplied(p.get("supplied", "")),
        "7.8.3.1 as a test report": "a) as 7.8.4.1 b); b) as 7.8.4.1 e); c) as 7.8.4.1 a); d) as 7.8.4.1 f); e) the rows 'other'",
        "7.8.4.1 a) uncertainty": _uncertainty(sheet),
        "7.8.4.1 b) conditions": _conditions(order.conditions, sheet),
        "7.8.4.1 c) traceability": f"to the SI by {'; '.join(c.text for c in order.certificates)}" if traced else "",
        "7.8.4.1 d) before and after adjustment": p.get("adjustment", ""),
        "7.8.4.1 e) conformity": CONFORMITY,
        "7.8.4.1 f) opinions": "none: the sheet has results and decisions only (7.8.7)",
        "7.8.4.3 calibration interval": "no recommendation is made",
        "7.8.6.1 level of risk": RISK,
        "7.8.6.2 a) results it applies to": "every figure of the table",
        "7.8.6.2 b) specification": p.get("specification", ""),
        "7.8.6.2 c) decision rule": RULE,
        "7.8.8 replaces": p.get("replaces", ""),
        "other: reference": f"{sheet.reference.text}; scales: temperature {sheet.temperature}",
        **_parameters(order, sheet),
        **_tool(order, sheet),
        **({"other: notes": f"{NOTES}: {'; '.join(remarks)}"} if remarks else {}),
        "other: readings": origin,
        "other: program and data": f"tango_cnc {version}; " + "; ".join(f"{n} {h[:16]}" for n, _, h in files),
    }


def _supplied(text: str) -> str:
    """what the customer supplied, as written → the same with the disclaimer that 7.8.2.2 asks for, where it is not none."""
    return text if not text or text.strip().rstrip(".").lower() in ("none", "nothing", "no") else f"{text}: {SUPPLIED}"


def _parameters(order: Order, sheet: Sheet) -> dict[str, str]:
    """order, figures → what parameters of the fit mean, where the order has limits for some."""
    notes = dict.fromkeys(f.note for f in sheet.figures if f.kind == "parameter" and f"parameter {f.name}" in order.limits)
    return {"other: parameters": "; ".join(notes)} if notes else {}


def _tool(order: Order, sheet: Sheet) -> dict[str, str]:
    """order, figures → what is stated of the tool that cuts the part, where the order has limits for features of one."""
    notes = dict.fromkeys(f.note for f in sheet.figures if f.kind == "part" and f"part {f.name}" in order.limits)
    return {"other: tool": "; ".join(notes)} if any(notes) else {}


def _uncertainty(sheet: Sheet) -> str:
    text = "U = 2 u (k = 2; 95 % where a figure is normally distributed): scatter of touches, every error motion of the axes"
    if sheet.budget is None:
        return f"{text}. There is no budget: lobing, drift, form are NOT in it; {NOT_IN_IT}"
    beside = ", ".join(sheet.budget.beside)
    text += f"; of uncertainty.yaml ({', '.join(sheet.budget.named)}), beside what the scatter shows: {beside or 'nothing'}"
    return f"{text}; in scales the expansions; {NOT_IN_IT}" if sheet.thermal is not None else f"{text}; {NOT_IN_IT}"


def _conditions(stated: Mapping[str, str], sheet: Sheet) -> str:
    if not all(stated.get(name) for name in CONDITIONS):
        return ""
    text = "; ".join(f"{name.replace('_', ' ')} {stated[name]}" for name in CONDITIONS)
    return text if sheet.thermal is None else f"{text}; scales by temperature.yaml: {sheet.thermal.text}"


def _both(p: Mapping[str, str], one: str, two: str) -> str:
    return f"{p[one]}, {p[two]}" if p.get(one) and p.get(two) else ""


ASKED: Mapping[str, tuple[str, ...]] = {
    "7.8.2.1 b) laboratory": ("laboratory", "address"),
    "7.8.2.1 c) location": ("location",),
    "7.8.2.1 d) number and end": ("number",),
    "7.8.2.1 e) customer and contact": ("customer", "contact"),
    "7.8.2.1 f) method": ("method",),
    "7.8.2.1 g) item": ("item",),
    "7.8.2.1 i) performed": ("performed",),
    "7.8.2.1 n) additions, deviations": ("remarks",),
    "7.8.2.1 o) authorised by": ("signed_by", "role"),
    "7.8.2.1 p) external providers": ("external",),
    "7.8.2.2 supplied by the customer": ("supplied",),
    "7.8.4.1 b) conditions": tuple(f"conditions.{name}" for name in CONDITIONS),
    "7.8.4.1 d) before and after adjustment": ("adjustment",),
    "7.8.6.2 b) specification": ("specification",),
    "7.8.8 replaces": ("replaces",),
}  # clause → keys of acceptance.yaml that answer it


def unstated(order: Order, answers: Mapping[str, str]) -> dict[str, str]:
    """order, clause: what answers it → of every clause that nothing answers, the keys of acceptance.yaml that are not stated, in
    words.
    """
    stated = {name for name, text in order.people.items() if text}
    stated |= {f"conditions.{name}" for name, text in order.conditions.items() if text}
    stated |= {"remarks"} if order.remarks else set()
    stated |= {"performed"} if order.performed else set()
    name = Path(order.file).name
    open_keys = {clause: [key for key in keys if key not in stated] for clause, keys in ASKED.items() if not answers.get(clause)}
    return {clause: f"write {', '.join(keys)} into {name}" for clause, keys in open_keys.items() if keys}
