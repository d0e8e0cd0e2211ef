"""Estimate and checks → one HTML page that stands alone: what a machinist needs first, then every number with its uncertainty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np

from ..estimate import Estimate, fit
from ..identify import select
from ..iso230 import Figure
from ..model import linearise
from ..records import Array, Cell, Readings
from ..verify.held_out import HeldOut
from ..verify.summary import pose_text
from ..verify.volume import VolumeMap
from .units import shown
from .words import spoken

CSS = """
:root{--ink:#1f2933;--soft:#5b6770;--line:#d9dee3;--good:#1b6ca8;--bad:#c0392b}
*{box-sizing:border-box}
body{font:16px/1.5 system-ui,Segoe UI,Helvetica,Arial,sans-serif;color:var(--ink);margin:0;background:#f4f6f8}
main{max-width:1040px;margin:0 auto;padding:28px 32px 60px;background:#fff}
h1{font-size:26px;margin:0}
h2{font-size:19px;margin:38px 0 8px;border-bottom:2px solid var(--line);padding-bottom:4px}
.sub{color:var(--soft);margin:2px 0 20px}
.cards{display:flex;gap:12px;flex-wrap:wrap;margin:18px 0}
.card{flex:1 1 165px;border:1px solid var(--line);border-radius:8px;padding:12px 14px}
.card b{display:block;font-size:21px;line-height:1.2}
.card span{color:var(--soft);font-size:13px;line-height:1.35;display:block;margin-top:4px}
.ok{border-left:5px solid #3c8d53}
.warn{border-left:5px solid #e08e0b}
.bad{border-left:5px solid var(--bad)}
table{border-collapse:collapse;width:100%;font-size:14px;margin:8px 0}
th{text-align:left;color:var(--soft);font-weight:600}
th,td{padding:4px 10px 4px 0;border-bottom:1px solid var(--line);vertical-align:top}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
tr.weak td{color:#8a949c}
.bar{display:inline-block;height:9px;background:var(--good)}
img{max-width:100%;display:block;margin:10px 0}
.note{color:var(--soft);font-size:13.5px}
ul{padding-left:20px}
details{margin:8px 0}
summary{cursor:pointer;color:var(--good)}
@media print{body{background:#fff}main{padding:0}h2{break-after:avoid}}
"""


@dataclass(frozen=True)
class Findings:
    """Everything that goes on the page; pictures are data URIs by caption, in order."""

    cell: Cell
    readings: Readings
    result: Estimate
    before: Array  # (n,) mm, what remains when only stylus and facets are adjusted
    iso: tuple[Figure, ...]
    chart: VolumeMap | None
    held: HeldOut | None
    why_not_held: str = ""
    pictures: Mapping[str, tuple[str, str]] = field(default_factory=dict)  # section: (caption, data URI)


def effects(result: Estimate) -> dict[str, float]:
    """estimate → µm, root mean square of what each parameter does to the touches; reported names, largest first."""
    _, jacobian = linearise(result.model, result.values)
    size = np.sqrt(np.mean((jacobian * result.values) ** 2, axis=0)) * 1e3
    own = result.parameters
    found = {
        result.selection.label(name): float(s)
        for name, s in zip(result.model.names, size, strict=True)
        if result.selection.label(name) in own
    }
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def unexplained_before(result: Estimate) -> Array:
    """estimate → (n,) mm, what remains of the touches when only stylus and facets are adjusted (subset S1)."""
    return fit(select(result.model.touches, ("S1",))).residuals


def render(found: Findings, version: str) -> str:
    """findings, version of the program → HTML."""
    cell, result = found.cell, found.result
    parts = [
        f"<h1>{escape(cell.machine.name)}</h1>",
        f'<p class="sub">{escape(cell.machine.topology)} · {escape(cell.artefact.name)} · {escape(cell.strategy.name)} · '
        f"tango_cnc {escape(version)}</p>",
        _summary(found),
        "<h2>Largest errors</h2>",
        _largest(found),
        _picture(found, "parameters"),
        "<h2>Does it fit?</h2>",
        _fit(found),
        _picture(found, "touches"),
        _picture(found, "vectors"),
        "<h2>Does it predict?</h2>",
        _predicts(found),
        _picture(found, "held_out"),
        "<h2>Error of the tool tip over the working volume</h2>",
        _volume(found),
        _picture(found, "volume"),
        "<h2>What cannot be seen</h2>",
        _unseen(result),
        "<h2>ISO 230-1 figures</h2>",
        _iso(found.iso),
        _picture(found, "curves"),
        "<h2>All parameters</h2>",
        _parameters(found),
        "<h2>Stylus and table</h2>",
        _setup(result),
    ]
    body = "\n".join(part for part in parts if part)
    title = f"{escape(cell.machine.name)}: calibration by probing its own table"
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>{title}</title><style>{CSS}</style></head><body><main>\n{body}\n</main></body></html>\n"
    )


def _worst(chart: VolumeMap | None) -> float | None:
    """→ µm, longest error within what was touched."""
    if chart is None:
        return None
    inside = ~chart.extrapolated
    return float(chart.size[inside].max() if inside.any() else chart.size.max()) * 1e3


def _card(value: str, text: str, state: str) -> str:
    return f'<div class="card {state}"><b>{value}</b><span>{text}</span></div>'


def _summary(found: Findings) -> str:
    result = found.result
    before, after = (float(np.abs(r).mean()) * 1e3 for r in (found.before, result.residuals))
    stated = result.model.touches.machine.probe.repeatability * 1e3
    ratio = result.sigma * 1e3 / stated if stated else 0.0
    worst = _worst(found.chart)
    outliers = len(result.outliers)
    touches = len(result.residuals)
    skipped = len(found.readings) - touches
    cards = [
        _card("unknown", "error of the tool tip: these touches tell nothing of the machine", "bad")
        if worst is None
        else _card(
            f"{worst:.0f} µm",
            "largest error of the tool tip against the table, within what was touched",
            "warn" if worst > 20 else "ok",
        ),
        _card(
            f"{before:.1f} → {after:.2f} µm", "mean unexplained distance of a touch, without and with the machine's errors", "ok"
        ),
        _card(
            f"{ratio:.1f} ×" if stated else f"{result.sigma * 1e3:.2f} µm",
            f"scatter of a touch {result.sigma * 1e3:.2f} µm against the {stated:.2f} µm that the probe repeats"
            if stated
            else "scatter of a touch",
            "ok" if ratio < 1.5 else "warn" if ratio < 4 else "bad",
        ),
        _card(
            f"{outliers}",
            f"of {touches} touches do not fit" + (f"; {skipped} made no proper contact" if skipped else ""),
            "ok" if not outliers else "warn",
        ),
    ]
    if found.held is not None:
        good = found.held.ratio
        cards.append(
            _card(
                f"{good:.2f}",
                "predicted against promised: held-out touches, 1 is as good as claimed",
                "ok" if good < 1.4 else "warn",
            )
        )
    return f'<div class="cards">{"".join(cards)}</div>' + _advice(ratio, outliers, found.held)


def _advice(ratio: float, outliers: int, held: HeldOut | None) -> str:
    lines = []
    if ratio >= 1.5:
        lines.append(
            "The model leaves clearly more than the probe's repeatability: ask <code>tango diagnose</code> what it is first."
        )
    if held is not None and held.ratio >= 1.4:
        lines.append("New positions are predicted worse than the estimate claims: something acts that the model lacks.")
    if outliers:
        lines.append(
            "Look at the touches that do not fit (chips, dirt, a wrong facet); estimate again with <code>--exclude-outliers</code>."
        )
    if not lines:
        lines.append(
            "The touches are explained to within their scatter, and touches that took no part are predicted as well as promised."
        )
    return "<ul>" + "".join(f"<li>{line}</li>" for line in lines) + "</ul>"


def _table(head: Sequence[tuple[str, bool]], rows: Sequence[tuple[Sequence[str], bool]]) -> str:
    """(title, numeric) columns, (cells, weak) rows → HTML; cells are HTML already."""
    top = "".join(f"<th{' class=n' if numeric else ''}>{title}</th>" for title, numeric in head)
    lines = []
    for cells, weak in rows:
        line = "".join(f"<td{' class=n' if numeric else ''}>{cell}</td>" for cell, (_, numeric) in zip(cells, head, strict=True))
        lines.append(f"<tr{' class=weak' if weak else ''}>{line}</tr>")
    return f"<table><tr>{top}</tr>{''.join(lines)}</table>"


def _largest(found: Findings) -> str:
    result, machine = found.result, found.cell.machine
    size = effects(result)
    own = result.parameters
    top = [(name, effect) for name, effect in size.items() if abs(own[name].value) > 2 * own[name].std][:8]
    if not top:
        return "<p>No single parameter is different from zero (two standard deviations).</p>"
    most = max(top[0][1], 1e-9)
    rows = []
    for name, effect in top:
        p = own[name]
        factor, unit = shown(p.unit)
        bar = f'<span class="bar" style="width:{100 * effect / most:.0f}px"></span>'
        rows.append(
            (
                (escape(spoken(name, machine)), escape(name), _value(p.value * factor, p.std * factor), unit, f"{effect:.1f}", bar),
                False,
            )
        )
    head = [("what", False), ("ISO 230-1", False), ("value", True), ("", False), ("effect on a touch, µm rms", True), ("", False)]
    note = "Parameters that are different from zero (two standard deviations), by what they do to the touches."
    return _table(head, rows) + f'<p class="note">{note}</p>'


def _value(value: float, std: float) -> str:
    digits = 1 if std >= 1 else 2 if std >= 0.095 else 3
    return f"{value:.{digits}f} ± {std:.{digits}f}"


def _picture(found: Findings, key: str) -> str:
    if key not in found.pictures:
        return ""
    caption, uri = found.pictures[key]
    return f'<img alt="{escape(caption)}" src="{uri}"><p class="note">{escape(caption)}</p>'


def _fit(found: Findings) -> str:
    result = found.result
    size = np.abs(result.residuals) * 1e3
    lines = [
        f"{len(size)} touches at {int(result.model.touches.indexation.max()) + 1} indexations, {len(result.values)} unknowns, "
        f"{result.dof} degrees of freedom.",
        f"Unexplained distance: max {size.max():.2f}, mean {size.mean():.2f}, rms {np.sqrt(np.mean(size**2)):.2f} µm. "
        f"Condition number {result.condition_number:.3g}.",
    ]
    if len(result.outliers):
        touches = result.model.touches
        rows = []
        for number in result.outliers[:30]:
            i = int(np.flatnonzero(touches.number == number)[0])
            at = pose_text(touches.machine, touches.position[i])
            rows.append(((f"{number}", escape(touches.facet[i]), at, f"{result.residuals[i] * 1e3:.2f}"), False))
        lines.append("Touches that do not fit (kept in the estimate):")
        text = "".join(f"<p>{line}</p>" for line in lines)
        return text + _table([("touch", True), ("facet", False), ("where", False), ("residual, µm", True)], rows)
    return "".join(f"<p>{line}</p>" for line in lines)


def _predicts(found: Findings) -> str:
    held = found.held
    if held is None:
        return f"<p>{escape(found.why_not_held)}</p>"
    f = held.figures
    return (
        f"<p>Each indexation was predicted by an estimate from all others: {f.count} touches, "
        f"standard deviation {f.sd * 1e3:.2f} µm, "
        f"largest {f.worst * 1e3:.2f} µm; {held.ratio:.2f} times what the estimates promised.</p>"
        + (
            f"<p class=note>Not predictable, touched at one indexation only: facets {escape(', '.join(held.unpredictable))}.</p>"
            if held.unpredictable
            else ""
        )
    )


def _volume(found: Findings) -> str:
    chart, machine = found.chart, found.cell.machine
    if chart is None:
        return "<p>The estimate contains no error of the machine: nothing is known of its tool tip.</p>"
    rows = []
    for text, mask in (
        ("within what was touched", ~chart.extrapolated),
        ("rest of the travel: extrapolated, a guess", chart.extrapolated),
    ):
        i = chart.worst(mask)
        if i is not None:
            cells = (
                text,
                f"{chart.size[i] * 1e3:.1f} ± {chart.std[i] * 1e3:.1f}",
                f"{chart.std[mask].max() * 1e3:.1f}",
                pose_text(machine, chart.position[i]),
            )
            rows.append((cells, bool(mask[i] and chart.extrapolated[i])))
    head = [("where", False), ("largest error, µm", True), ("largest std, µm", True), ("at (mm, °)", False)]
    note = "After the best set-up of workpiece and tool length, mean of both directions of motion."
    if unseen := [c.names[0] for c in found.result.selection.unseen]:
        note += f" Not contained, since the touches cannot see it: {escape(', '.join(unseen))}."
    return _table(head, rows) + f'<p class="note">{note}</p>'


def _unseen(result: Estimate) -> str:
    if not result.selection.unseen:
        return "<p>Everything that the terms ask for can be told apart by these touches.</p>"
    return "<ul>" + "".join(f"<li>{escape(c.text)}</li>" for c in result.selection.unseen) + "</ul>"


def _iso(iso: Sequence[Figure]) -> str:
    if not iso:
        return "<p>The terms contain nothing from which a figure follows.</p>"
    rows = []
    for f in iso:
        second = "" if f.arcseconds is None else f"{f.arcseconds:.2f} ″"
        over = "" if f.range is None else f"{f.range[0]:.0f} … {f.range[1]:.0f}"
        rows.append(
            ((f.kind, escape(f.name), _value(f.value, f.std), f.unit, second, over, escape(f.note)), abs(f.value) < 2 * f.std)
        )
    head = [("figure", False), ("", False), ("value", True), ("", False), ("", True), ("over, mm or °", True), ("", False)]
    note = "One axis moved alone over its touched range; grey: not different from zero (two standard deviations)."
    return _table(head, rows) + f'<p class="note">{note}</p>'


def _parameters(found: Findings) -> str:
    result, machine = found.result, found.cell.machine
    size = effects(result)
    rows = []
    for name, p in result.parameters.items():
        factor, unit = shown(p.unit)
        cells = (
            escape(name),
            _value(p.value * factor, p.std * factor),
            unit,
            f"{size.get(name, 0.0):.2f}",
            escape(spoken(name, machine)),
        )
        rows.append((cells, abs(p.value) < 2 * p.std))
    head = [("ISO 230-1", False), ("value ± std", True), ("", False), ("effect, µm rms", True), ("", False)]
    return _table(head, rows) + '<p class="note">Grey: not different from zero (two standard deviations).</p>'


def _setup(result: Estimate) -> str:
    rows = []
    for name, p in result.setup.items():
        factor, unit = shown(p.unit)
        rows.append(((escape(name), _value(p.value * factor, p.std * factor), unit), False))
    for facet, p in result.facets.items():
        rows.append(((f"facet {escape(facet)}", _value(p.value * 1e3, p.std * 1e3), "µm"), False))
    head = [("", False), ("offset ± std", True), ("", False)]
    return f"<details><summary>{len(rows)} offsets of stylus and facets</summary>{_table(head, rows)}</details>"


def as_json(found: Findings) -> dict[str, Any]:
    """findings → plain data of the page."""
    iso = [
        {
            "kind": f.kind,
            "name": f.name,
            "value": f.value,
            "std": f.std,
            "unit": f.unit,
            "range": None if f.range is None else list(f.range),
            "note": f.note,
        }
        for f in found.iso
    ]
    return {
        "format": "tango-report/1",
        "effects_um": effects(found.result),
        "iso230": iso,
        "held_out": None if found.held is None else {"sd_um": found.held.figures.sd * 1e3, "ratio_to_expected": found.held.ratio},
        "volume_worst_um": _worst(found.chart),
        "outliers": [int(i) for i in found.result.outliers],
        "not_identifiable": [c.text for c in found.result.selection.unseen],
    }
