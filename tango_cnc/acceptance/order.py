"""acceptance.yaml → limits, people, conditions and certificates; what cannot be true of any measurement is refused."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path

from ..files.checked import FURTHEST, Node, load
from ..files.composed import Scalar

PEOPLE = (
    *("laboratory", "address", "location", "customer", "contact", "number", "item", "method", "specification"),
    *("adjustment", "supplied", "external", "replaces", "signed_by", "role"),
)
CONDITIONS = ("machine_temperature", "table_temperature", "air_temperature", "warm_up")
STANDARDS = ("scale bar", "calibrated facets", "tip", "CMM", "thermometer")
LENGTHS = ("scale bar", "tip")  # whose certificate states a length
SMALLEST, LARGEST = 0.1, 5000.0  # µm, µrad, µm/m
UNITS = {"m": 1e3, "mm": 1.0, "µm": 1e-3, "um": 1e-3}
WIDEST = 0.1  # mm, of the uncertainty of a certificate
RELATIVE = " − "  # between two figures: the difference of them
HYPHEN = re.compile(" [-–] ")  # as people type it
LETTERS = re.compile(r"\w", re.UNICODE)
QUANTITY = re.compile(r"([-+]?\d+(?:\.\d+)?)\s*(\S+)")
DEGREES = re.compile(r"([-+]?\d+(?:\.\d+)?)\s*(?:°\s*)?C?")
COLD, HOT = -20.0, 60.0  # °C, of a workshop


@dataclass(frozen=True)
class Certificate:
    """One calibration certificate; lengths and standard uncertainty in mm where it states a length."""

    of: str
    number: str
    issued: date
    issued_by: str
    uncertainty: str  # as written, expanded
    k: float
    value: str = ""  # as written
    length: float | None = None
    std: float | None = None
    valid_until: date | None = None
    before: float | None = None  # mm, what artefact.yaml had during the run, where this certificate has corrected it since

    @property
    def text(self) -> str:
        """→ one line for the page."""
        until = f", valid until {self.valid_until}" if self.valid_until else ""
        value = f"{self.value} ± " if self.value else "± "
        return f"{self.of} {self.number} ({self.issued}{until}; {self.issued_by}): {value}{self.uncertainty} (k = {self.k:g})"


@dataclass(frozen=True)
class PartAsked:
    """A part whose features have limits: their list, zero (mm, degrees), length of its tools (mm), a program if it names blocks."""

    features: Path
    zero: Mapping[str, float]
    tool_length: float | None = None
    program: Path | None = None


@dataclass(frozen=True)
class Order:
    """acceptance.yaml: limits by figure (µm, µrad, µm/m), who and where, conditions (°C), certificates, the part."""

    limits: Mapping[str, float]
    people: Mapping[str, str]
    conditions: Mapping[str, str]
    certificates: tuple[Certificate, ...]
    tool_length: float | None = None
    remarks: str = ""
    performed: tuple[date, date] | None = None
    temperatures: Mapping[str, float] = field(default_factory=dict)  # °C, of `conditions`
    part: PartAsked | None = None
    file: str = "acceptance.yaml"  # as it was asked for, for messages


def read_order(file: Path, today: date) -> Order:
    """acceptance.yaml, day of issue → order. Raises InputError for unknown keys, dates to come, values that no workshop has."""
    fields = load(file).fields(["limits"], [*PEOPLE, "performed", "conditions", "certificates", "tool_length", "remarks", "part"])
    limits = {HYPHEN.sub(RELATIVE, name): _limit(child) for name, child in fields["limits"].items()}
    if not limits:
        raise fields["limits"].wrong("at least one figure with its limit, such as 'straightness EYX: 10'", "none")
    people = {name: _said(fields[name]) for name in PEOPLE if name in fields}
    conditions = fields["conditions"].fields([], CONDITIONS) if "conditions" in fields else {}
    temperatures = {name: _celsius(node) for name, node in conditions.items() if name != "warm_up" and _said(node)}
    nodes = fields["certificates"].list() if "certificates" in fields else []
    return Order(
        limits,
        people,
        {name: _said(node) for name, node in conditions.items()},
        tuple(_certificate(node, today) for node in nodes),
        fields["tool_length"].number(above=0, high=5000) if "tool_length" in fields else None,
        _said(fields["remarks"]) if "remarks" in fields else "",
        _days(fields["performed"], today) if "performed" in fields and _said(fields["performed"]) else None,
        temperatures,
        _part(fields["part"], file.parent) if "part" in fields else None,
        str(file),
    )


def _part(node: Node, folder: Path) -> PartAsked:
    fields = node.fields(["features", "zero"], ["tool_length", "program"])
    files = {key: folder / fields[key].text() for key in ("features", "program") if key in fields}
    for key, found in files.items():
        if not found.is_file():
            raise fields[key].wrong(f"a file beside {node.file.name}, or its path")
    return PartAsked(
        files["features"],
        {axis: child.position() for axis, child in fields["zero"].items()},
        fields["tool_length"].size() if "tool_length" in fields else None,
        files.get("program"),
    )


def _limit(node: Node) -> float:
    value = node.number(above=0)
    if not SMALLEST <= value <= LARGEST:
        hint = (
            f"{value:g} mm is written {value * 1e3:g}" if value < SMALLEST else "a limit that every machine keeps decides nothing"
        )
        raise node.wrong(f"{SMALLEST:g} to {LARGEST:g} (µm, µrad or µm/m); {hint}")
    return value


def _said(node: Node) -> str:
    """→ text as written; nothing where there is no letter and no figure in it. Raises InputError for lists and mappings."""
    if not isinstance(node.raw, Scalar):
        raise node.wrong("a text")
    text = "" if node.plain() is None else str(node.raw.value).strip()
    return text if LETTERS.search(text) else ""


def _celsius(node: Node) -> float:
    found = DEGREES.fullmatch(_said(node))
    if found is None or not COLD <= float(found[1]) <= HOT:
        raise node.wrong(f"a temperature of {COLD:g} to {HOT:g} °C, such as 20.4 °C")
    return float(found[1])


def _day(node: Node, text: str, today: date | None) -> date:
    try:
        found = date.fromisoformat(text)
    except ValueError:
        raise node.wrong("a date, such as 2026-01-10") from None
    if today is not None and found > today:
        raise node.wrong(f"a date that is not to come (today is {today})")
    return found


def _days(node: Node, today: date) -> tuple[date, date]:
    first, _, last = _said(node).partition(" to ")
    begun, ended = _day(node, first.strip(), today), _day(node, (last or first).strip(), today)
    if ended < begun:
        raise node.wrong("a date, or FIRST to LAST, such as 2026-01-10 to 2026-01-12")
    return begun, ended


def _certificate(node: Node, today: date) -> Certificate:
    f = node.fields(["of", "number", "date", "uncertainty", "k", "issued_by"], ["value", "valid_until", "before"])
    of, k = f["of"].text(STANDARDS), f["k"].number(1, 4)
    length = std = None
    for key in ("number", "issued_by"):
        if not _said(f[key]):
            raise f[key].wrong("a text")
    if of in LENGTHS:
        if "value" not in f:
            raise node.wrong(f"a value, such as 304.6686 mm: a certificate of a {of} states one", "no value")
        length, std = _millimetres(f["value"]), _millimetres(f["uncertainty"]) / k
        if not 0 < std * k <= WIDEST:
            raise f["uncertainty"].wrong(f"more than 0 and at most {1e3 * WIDEST:g} µm: no {of} is calibrated worse than that")
    until = _day(f["valid_until"], _said(f["valid_until"]), None) if "valid_until" in f else None
    value = _said(f["value"]) if "value" in f else ""
    issued = _day(f["date"], _said(f["date"]), today)
    if "before" in f and of != "scale bar":
        raise f["before"].wrong("at a scale bar only: the length that artefact.yaml gave it during the run")
    before = _millimetres(f["before"]) if "before" in f else None
    named = _said(f["number"]), issued, _said(f["issued_by"]), _said(f["uncertainty"])
    return Certificate(of, *named, k, value, length, std, until, before)


def _millimetres(node: Node) -> float:
    found = QUANTITY.fullmatch(_said(node))
    if found is None or found[2] not in UNITS:
        raise node.wrong(f"a number and its unit, {', '.join(UNITS)}, such as 304.6686 mm or 0.5 µm")
    value = float(found[1]) * UNITS[found[2]]
    if value > FURTHEST:
        raise node.wrong(f"at most {FURTHEST:g} mm")
    return value
