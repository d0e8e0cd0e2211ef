"""Facts → the charts of the report as SVG, and the data of the picture that can be turned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from html import escape
from typing import Any

import numpy as np

from .. import iso230
from ..diagnose import Diagnosis, Finding
from ..diagnose.sentences import covariate, towards
from ..records import Array
from ..verify import held_out
from .compensated import placed
from .days import between
from .facts import Facts
from .over import covariate_of, shown_over
from .svg import BLUE, CYCLE, GOOD, INK, LINE, LOOK, PURPLE, RED, SOFT, STOP, Canvas, Kind, Mark, Plotted, chart, label
from .texts import Texts
from .units import Units, inches

FIRST = 6  # covariates of a diagnosis that are drawn


def touches(f: Facts, t: Texts) -> str:
    """facts → what is left of every touch, in the order of measurement; touches that do not fit are crosses."""
    u, m = f.wishes.units, f.result.model.touches
    value = f.result.residuals * 1e3 * u.per_micron
    number, out = m.number.astype(float), f.result.out
    tips = [f"{i}: {facet}" for i, facet in zip(m.number, m.facet, strict=True)]
    sigma = f.result.sigma * 2e3 * u.per_micron
    span = np.array([float(m.number.min()), float(m.number.max())])
    series = [
        Plotted(span, np.zeros(2), "band", SOFT, f"± 2 {t('place.std')}", low=np.full(2, -sigma), high=np.full(2, sigma)),
        Plotted(number[~out], value[~out], "dots", BLUE, size=1.9, tips=_some(tips, ~out)),
        Plotted(number[out], value[out], "crosses", RED, size=4, tips=_some(tips, out)),
    ]
    return chart(series, Canvas(860, 230, t("fit.touches"), t("table.touch"), u.small))


def _some(tips: list[str], rows: Any) -> tuple[str, ...]:
    return tuple(tip for tip, keep in zip(tips, rows, strict=True) if keep)


def turning(f: Facts, t: Texts) -> dict[str, Any]:
    """facts → data of the picture that can be turned: points mm, normals, residuals µm or µin, how many of them are 1 mm."""
    u, m = f.wishes.units, f.result.model.touches
    corners = np.array([facet.point for facet in f.cell.artefact.facets.values()])
    low, high = corners.min(axis=0), corners.max(axis=0)
    shown = list(f.cell.artefact.facets.values())[:500]
    centre = (low + high) / 2
    rounded = np.round(m.point - centre, 2)
    return {
        "points": rounded.tolist(),
        "normals": np.round(m.normal, 3).tolist(),
        "facets": [[np.round(np.array(x.point) - centre, 2).tolist(), np.round(x.normal, 3).tolist()] for x in shown],
        "names": [f"{t('table.touch')} {i}, {t('table.facet')} {facet}" for i, facet in zip(m.number, m.facet, strict=True)],
        "sets": [
            {"title": t("fit.set_before"), "values": np.round(f.before * 1e3 * u.per_micron, 2).tolist()},
            {"title": t("fit.set_after"), "values": np.round(f.result.residuals * 1e3 * u.per_micron, 2).tolist()},
        ],
        "unit": u.small,
        "per_mm": 1e3 * u.per_micron,
        "size": round(float(np.linalg.norm(high - low)) / 2, 1) or 1.0,
        "words": {key: t(f"fit.{key}") for key in ("longer", "shorter", "reset", "top", "scale", "outside", "inside")},
    }


def still(data: dict[str, Any], which: int = 1, width: float = 560, height: float = 420) -> str:
    """data of `turning` → the same from one side as SVG: for paper, and where no script runs."""
    points, normals = np.array(data["points"]), np.array(data["normals"])
    values = np.array(data["sets"][which]["values"])
    size = float(data["size"])
    length = 0.3 * size / max(float(np.quantile(np.abs(values), 0.98)), 1e-9)
    turn, tilt = np.radians(-35.0), np.radians(28.0)
    rows = np.array(
        [
            [np.cos(turn), -np.sin(turn), 0.0],
            [np.sin(turn) * np.sin(tilt), np.cos(turn) * np.sin(tilt), np.cos(tilt)],
        ]
    )
    scale = 0.62 * min(width, height) / size

    def flat(p: Array) -> Array:
        xy = p @ rows.T * scale
        return np.column_stack([width / 2 + xy[:, 0], height / 2 - xy[:, 1]])

    a, b = flat(points), flat(points + normals * (values * length)[:, None])
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" height="{height:g}" '
        f'role="img" aria-label="{data["sets"][which]["title"]}" font-family="sans-serif" font-size="11">'
    ]
    for place, normal in data["facets"]:
        corners = flat(_square(np.array(place), np.array(normal), 0.045 * size))
        way = "L".join(f"{x:.1f} {y:.1f}" for x, y in corners)
        parts.append(f'<path d="M{way}Z" fill="#fff" fill-opacity="0.7" stroke="{LINE}"/>')
    for outward, color, dash in ((True, RED, ""), (False, BLUE, "3 1.5")):
        keep = (values > 0) == outward
        way = "".join(f"M{p[0]:.1f} {p[1]:.1f}L{q[0]:.1f} {q[1]:.1f}" for p, q in zip(a[keep], b[keep], strict=True))
        broken = f' stroke-dasharray="{dash}"' if dash else ""
        parts.append(f'<path d="{way or "M0 0"}" stroke="{color}" stroke-width="1" fill="none"{broken}/>')
    words = data["words"]
    y = height - 8
    px = scale * length  # of one µm or µin
    power = 10.0 ** np.floor(np.log10(70 / px))
    size = power * max(s for s in (1, 2, 5) if s * power * px <= 70.001)
    end, bar = width - 8, size * px
    parts.append(
        f'<path d="M{end - bar:.1f} {y - 24:g}h{bar:.1f}M{end - bar:.1f} {y - 28:g}v8M{end:g} {y - 28:g}v8" stroke="{INK}"/>'
    )
    parts.append(label(end - bar - 6, y - 20, f"{size:g} {data['unit']}", "end", INK))
    for color, dash, key, up in ((RED, "", "outside", 14), (BLUE, ' stroke-dasharray="3 1.5"', "inside", 0)):
        parts.append(f'<path d="M8 {y - up - 4:g}h20" stroke="{color}" stroke-width="1.6"{dash}/>')
        parts.append(label(34, y - up, words[key], "start", INK))
    times = float(f"{length * data['per_mm']:.1e}")
    parts += [label(width - 8, y, words["scale"].format(factor=f"{times:,.0f}"), "end"), "</svg>"]
    return "".join(parts)


def _square(at: Array, normal: Array, side: float) -> Array:
    """place, unit normal, half a side → (4, 3) corners of what stands for a facet."""
    u = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    u = side * u / (float(np.linalg.norm(u)) or 1.0)
    v = np.cross(normal, u)
    return np.array([at + u + v, at - u + v, at - u - v, at + u - v])


def predicted(f: Facts, t: Texts) -> str:
    """facts → each indexation as predicted from all others."""
    held, u = f.held, f.wishes.units
    if held is None:
        return ""
    k = 1e3 * u.per_micron
    numbers = np.unique(held.indexation)
    names = tuple(str(int(i)) for i in numbers)
    place = np.searchsorted(numbers, held.indexation).astype(float)
    spread = np.array([2 * k * float(np.median(held.expected[held.indexation == i])) for i in numbers])
    at = np.arange(len(numbers), dtype=float)
    series = [
        Plotted(at, spread, "band", SOFT, t("predicts.expected"), low=-spread, high=spread),
        Plotted(place, held.residual * k, "dots", BLUE, t("predicts.found"), size=2.0),
    ]
    first = held_out.in_words(f.readings, f.cell.machine, [int(numbers[0])])
    axis = t("predicts.axis", first=first)
    return chart(series, Canvas(860, 230, t("predicts.picture"), axis, u.small, names=names))


def motions(f: Facts, t: Texts) -> list[str]:
    """facts, texts → error motions of each axis over its touched range, with their intervals."""
    found = []
    u = f.wishes.units
    for axis, (at, curves) in iso230.curves(f.result).items():
        linear = axis in f.cell.machine.linear
        x = at * (u.per_mm if linear else 1.0)
        for unit in ("µm", "µrad"):
            own = [c for c in curves if c.unit == unit and float(np.ptp(c.value)) > 1e-6]
            if not own:
                continue
            factor, shown = u.of(unit)
            series = []
            for c, (color, dash) in zip(own, CYCLE, strict=False):
                half = f.factor * c.std * factor
                series.append(
                    Plotted(x, c.value * factor, "band", color, low=c.value * factor - half, high=c.value * factor + half)
                )
                kind = t(f"iso_kind.{c.kind}") if f"iso_kind.{c.kind}" in t else c.kind
                series.append(Plotted(x, c.value * factor, "line", color, f"{c.name} {kind}", dash))
            found.append(chart(series, Canvas(425, 250, axis, f"{axis}, {u.large if linear else '°'}", shown)))
    return found


def interval(value: float, half: float, span: float, wide: float = 150) -> str:
    """value, half interval, largest of the column → a bar from zero with its interval, for a row of a table."""
    middle, k = wide / 2, (wide / 2 - 4) / (span or 1.0)
    x, low, high = (middle + k * v for v in (value, value - half, value + half))
    low, high = max(low, 1), min(high, wide - 1)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide:g} 16" width="{wide:g}" height="16" aria-hidden="true">'
        f'<path d="M{middle:g} 1v14" stroke="{SOFT}"/>'
        f'<rect x="{min(x, middle):.1f}" y="5" width="{abs(x - middle):.1f}" height="6" fill="{BLUE}" fill-opacity="0.45"/>'
        f'<path d="M{low:.1f} 8H{high:.1f}M{low:.1f} 4v8M{high:.1f} 4v8" stroke="{INK}" stroke-width="1.3"/></svg>'
    )


def course(d: Diagnosis, t: Texts, unit: str, k: float) -> list[str]:
    """diagnosis → residuals over time, before and with the causes found; single touches set aside are crosses."""
    m = d.before.model.touches
    minutes, out = m.time / 60, np.isin(m.number, d.outliers)
    limit = 1.15 * k * float(np.max(np.abs(d.before.residuals[~out]))) if (~out).any() else 1.0
    band, ends = 2 * k * d.noise, np.array([minutes.min(), minutes.max()])
    drawn = []
    for key, values in (("course_before", d.before.residuals), ("course_after", d.after.residuals)):
        rms = f"{k * float(np.sqrt(np.mean(values**2))):.2f}"
        series = [
            Plotted(ends, ends, "band", SOFT, t("diagnosis.band"), low=np.full(2, -band), high=np.full(2, band)),
            Plotted(minutes[~out], k * values[~out], "dots", BLUE, size=1.9),
            Plotted(minutes[out], np.clip(k * values[out], -limit, limit), "crosses", RED, t("diagnosis.single"), size=3.5),
        ]
        title = t(f"diagnosis.{key}", rms=rms, unit=unit)
        series = [s for s in series if len(s.x)]
        drawn.append(chart(series, Canvas(860, 190, title, t("place.min"), unit, y_range=(-limit, limit))))
        if d.after is d.before:
            break
    return drawn


def _placed(x: Array, unit_x: str, unit: str) -> tuple[Array, str]:
    """places in the unit of people, that unit, unit of errors → the same in inch where errors are in µin."""
    inch = Units("inch")
    if unit != inch.small or unit_x not in ("mm", "mm/min"):
        return x, unit_x
    return x * inch.per_mm, unit_x.replace("mm", inch.large)


def dependence(d: Diagnosis, t: Texts, unit: str, k: float) -> list[str]:
    """diagnosis → means over the covariates that matter most, before and with the causes, with the band of a right model."""
    after = {x.covariate: x for x in d.tests_after}
    found = []
    for test in d.tests[:FIRST]:
        x, unit_x = _placed(*shown_over(d, test, t), unit)
        order = np.argsort(x)
        x, late = x[order], after.get(test.covariate)
        series = [
            Plotted(x, x, "band", SOFT, low=-k * test.band[order], high=k * test.band[order]),
            Plotted(x, k * test.mean[order], "line", RED, t("diagnosis.present"), "5 2"),
            Plotted(x, k * test.mean[order], "rings", RED),
        ]
        if d.after is not d.before and late is not None and len(late.mean) == len(order):
            series += [
                Plotted(x, k * late.mean[order], "line", BLUE, t("diagnosis.with_causes")),
                Plotted(x, k * late.mean[order], "dots", BLUE, size=2.2),
            ]
        title = f"{t.of(covariate(test.covariate))}: {100 * test.variance_share:.0f} %"
        found.append(chart(series, Canvas(425, 220, title, unit_x, unit)))
    return found


def finding(d: Diagnosis, f: Finding, t: Texts, unit: str, k: float) -> list[str]:
    """diagnosis, one of its findings → what it does over what it belongs to; and the part that the model cannot absorb."""
    if not f.pattern.any():
        return []
    m = d.before.model.touches
    about, x, unit_x = covariate_of(d, f, t)
    x, unit_x = _placed(x, unit_x, unit)
    basis = d.explanation.place.basis
    others = sum((o.pattern for o in d.findings if o is not f), np.zeros(len(m)))
    visible, rest = (basis @ (basis.T @ d.searched(x)) for x in (f.pattern, d.before.residuals - others))
    whole, what, left_over, rows = f.pattern, unit, d.after.residuals, np.ones(len(m), dtype=bool)
    if "direction" in f.detail and f.detail.get("frame") in ("machine", "table"):
        direction = np.array(f.detail["direction"])
        along = (m.machine_normal if f.detail["frame"] == "machine" else m.normal) @ direction
        rows = np.abs(along) > 0.4
        safe = np.where(rows, along, 1.0)
        what, whole, left_over = f"{unit}, {t.of(towards(direction))}", f.pattern / safe, d.after.residuals / safe
    left = [
        Plotted(x[rows], k * (whole + left_over)[rows], "rings", SOFT, t("diagnosis.measured"), size=1.8),
        Plotted(x[rows], k * whole[rows], "dots", RED, t("diagnosis.explained"), size=2),
    ]
    span = k * float(np.max(np.abs(visible))) or 1.0
    right = [
        Plotted(k * visible, k * rest, "rings", BLUE, size=1.8),
        Plotted(np.array([-span, span]), np.array([-span, span]), "line", INK),
    ]
    where = f"{about}, {unit_x}" if unit_x != about else about
    return [
        chart(left, Canvas(425, 250, t("diagnosis.seen_left"), where, what)),
        chart(
            right, Canvas(425, 250, t("diagnosis.seen_right"), t("diagnosis.expected", unit=unit), t("table.residual", unit=unit))
        ),
    ]


def trend(points: dict[str, Any], unit: str, t: Texts, width: float = 425, height: float = 240) -> str:
    """`title`, `first` day, `days` (n,) from it, `value`, `half`, `alarm`, `limit` or None, `events` (day, words) → a
    parameter by night."""
    x = np.array(points["days"], dtype=float)
    y, half = np.array(points["value"], dtype=float), np.array(points["half"], dtype=float)
    alarm = np.array(points.get("alarm") or np.zeros(len(x)), dtype=bool)
    series = [
        Plotted(x, y, "band", BLUE, t("trend.interval"), low=y - half, high=y + half),
        Plotted(x, y, "line", BLUE),
        Plotted(x[~alarm], y[~alarm], "dots", BLUE, t("trend.night")),
    ]
    if alarm.any():
        series.append(Plotted(x[alarm], y[alarm], "diamonds", PURPLE, t("trend.alarm"), size=4))
    marks = _marked(points.get("events") or ())
    if points.get("limit"):
        limit = float(np.copysign(points["limit"], np.mean(y)))
        marks.append(Mark(t("trend.allowed", limit=f"{abs(limit):g}", unit=unit), y=limit, color=INK, dash="7 3"))
    months = t("date.months").split()
    return chart(
        series, Canvas(width, height, points["title"], points["x_label"], unit, first_day=points["first"], months=months), marks
    )


def tip(
    nights: Sequence[tuple[date, float, str]],
    limit: float | None,
    unit: str,
    t: Texts,
    width: float,
    height: float,
    events: Mapping[str, str] | None = None,
) -> str:
    """(day, largest error, good | look | unsure | stop) of nights, oldest first, limit, unit → the tool tip by night; a gap
    stays one.

    `events`: {date: words} of what was done to the control.
    """
    first = nights[0][0]
    x = np.array([(day - first).days for day, _, _ in nights], dtype=float)
    y = np.array([value for _, value, _ in nights])
    level = np.array([what for _, _, what in nights])
    parts = np.split(np.arange(len(x)), np.flatnonzero(np.diff(x) > 1.5) + 1)
    series = [Plotted(x[i], y[i], "line", BLUE) for i in parts if len(i) > 1]
    signs: tuple[tuple[str, Kind, str, str, float], ...] = (
        ("good", "dots", GOOD, "kept", 3.2),
        ("look", "triangles", LOOK, "moved", 5.0),
        ("unsure", "boxes", LOOK, "unsure", 4.2),
        ("stop", "squares", STOP, "beyond", 4.2),
    )
    for name, kind, color, word, size in signs:
        keep = level == name
        if keep.any():
            said = [inches(v) if unit == "in" else f"{v:.1f} {unit}" for v in y[keep]]
            tips = tuple(f"{nights[i][0]}: {text}" for i, text in zip(np.flatnonzero(keep).tolist(), said, strict=True))
            series.append(Plotted(x[keep], y[keep], kind, color, t(f"trend.{word}"), size=size, tips=tips))
    marks = _marked(placed(events or {}, first, nights[-1][0]))
    if limit is not None:
        allowed = inches(limit).removesuffix(" in") if unit == "in" else f"{limit:.0f}"
        marks.append(Mark(t("trend.allowed", limit=allowed, unit=unit), y=limit, color=INK, dash="7 3"))
    span = between([str(night) for night, _, _ in nights], t)
    frame = Canvas(width, height, t("trend.tip"), span, unit, from_zero=True, first_day=first, months=t("date.months").split())
    return chart(series, frame, marks)


def _marked(events: Sequence[tuple[float, str]]) -> list[Mark]:
    return [Mark(words, x=at, row=i % 3) for i, (at, words) in enumerate(events)]


def compensated(rows: Sequence[tuple[str, Sequence[float | None]]], names: Sequence[str], unit: str, said: str) -> str:
    """(what, sizes or None) of a compensation, what each size is, unit, title → bars one below the other, each with its name."""
    bars = [(what, name, v) for what, sizes in rows for name, v in zip(names, sizes, strict=True) if v is not None]
    most = max((v for _, _, v in bars), default=0.0) or 1.0
    width, step, left = 560.0, 20.0, 120.0
    height = step * len(bars) + 24 * len(rows) + 6
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" height="{height:g}" '
        f'role="img" aria-label="{escape(said)}" font-family="sans-serif" font-size="11">'
    ]
    y, before = 0.0, ""
    for what, name, value in bars:
        if what != before:
            y, before = y + 24, what
            parts.append(label(4, y - 6, what, "start", INK))
        fill = (f'fill="{SOFT}"', f'fill="#fff" stroke="{INK}" stroke-dasharray="4 2"', f'fill="{BLUE}"')[list(names).index(name)]
        wide = max((width - left - 90) * value / most, 1.0)
        parts.append(f'<rect x="{left:g}" y="{y + 3:g}" width="{wide:.1f}" height="13" {fill}/>')
        parts.append(label(left - 8, y + 14, name, "end", INK))
        parts.append(label(left + wide + 6, y + 14, f"{value:.1f} {unit}", "start", INK))
        y += step
    return "".join([*parts, "</svg>"])
