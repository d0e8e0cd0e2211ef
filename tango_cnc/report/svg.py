"""Numbers → charts as SVG text, without a library: for the report, its PDF and the pages of `tango serve`.

Every series differs by shape or dash as well as by color, so that a chart is read in black and white and by color-blind
people. Colors are those of Okabe and Ito (2008). Only presentation attributes are used, no style sheet: a PDF engine
draws the same.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from html import escape
from itertools import pairwise
from typing import Literal

import numpy as np

from ..records import Array

INK, SOFT, LINE, PALE = "#1f2933", "#52606d", "#d3dae1", "#e8edf2"
BLUE, RED, GREEN, ORANGE, PURPLE = "#0072b2", "#d55e00", "#009e73", "#e69f00", "#8f4a86"
GOOD, LOOK, STOP = "#00694c", "#9a5b00", "#b3261e"  # of a verdict: as on pages (style.css); each has a shape of its own too
CYCLE = ((BLUE, ""), (RED, "6 3"), (GREEN, "2 2"), (PURPLE, "8 3 2 3"), (ORANGE, "1 3"), (INK, "10 4"))
FONT = "system-ui, -apple-system, 'Segoe UI', Helvetica, Arial, sans-serif"
Kind = Literal["line", "dots", "crosses", "rings", "squares", "boxes", "triangles", "diamonds", "band", "bars", "steps"]
HALO = 'stroke="#fff" stroke-width="3" paint-order="stroke" stroke-linejoin="round"'  # a text above a curve stays readable
WIDE = 6.4  # px that a sign of a label takes, at most
STEPS = (1, 2, 7, 14, 30, 61, 91, 182, 365)  # days between dates on an axis


@dataclass(frozen=True)
class Plotted:
    """One set of numbers on a chart; `low` and `high` are the ends of a band or of error bars, in the unit of y."""

    x: Array
    y: Array
    kind: Kind = "line"
    color: str = BLUE
    label: str = ""
    dash: str = ""
    low: Array | None = None
    high: Array | None = None
    size: float = 2.6
    tips: tuple[str, ...] = ()  # one a point, shown when the pointer rests on it


@dataclass(frozen=True)
class Mark:
    """A line across the chart: at x or at y, with a short text."""

    text: str = ""
    x: float | None = None
    y: float | None = None
    color: str = SOFT
    dash: str = "4 3"
    row: int = 0  # of its text, so that texts of lines near each other do not lie on each other


@dataclass(frozen=True)
class Canvas:
    """Size of a chart (px) and what its axes say; `names` replaces the numbers of the x axis at 0, 1, 2 and so on."""

    width: float = 640
    height: float = 240
    title: str = ""
    x_label: str = ""
    y_label: str = ""
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    names: tuple[str, ...] = ()
    from_zero: bool = False
    first_day: date | None = None  # x are days from it, and the axis has dates
    months: Sequence[str] = ()  # their names, for those dates


def ticks(low: float, high: float, most: int = 6) -> list[float]:
    """range → at most about `most` round numbers in it, and two at least: one alone shows no scale."""
    span = high - low
    if not (math.isfinite(span) and span > 0):
        return [low]
    rough = span / max(most, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    found: list[float] = []
    for part in (10, 5, 2.5, 2, 1, 0.5, 0.25):  # from coarse to fine
        if part * power < rough * 0.999 and len(found) > 1:
            break
        step = part * power
        first = math.ceil(low / step - 1e-9)
        found = [i * step for i in range(first, math.floor(high / step + 1e-9) + 1)]
    return found


def dates(first: date, low: float, high: float, most: int, months: Sequence[str]) -> list[tuple[float, str]]:
    """day of x = 0, range in days, how many at most, names of the months → (x, 23 Nov), or (x, 2026-11) where they are far apart;
    the last day is one.
    """
    last = math.floor(high + 1e-9)
    step = next((s for s in STEPS if (high - low) / s <= most), STEPS[-1])
    found = []
    for v in range(last, math.ceil(low - 1e-9) - 1, -step):
        day = first + timedelta(days=v)
        found.append((float(v), f"{day:%Y-%m}" if step > 30 else f"{day.day} {months[day.month - 1]}"))
    return found[::-1]


def number(value: float) -> str:
    """number → short text: 0.2, 12, −3, 1 200."""
    if value == 0 or abs(value) < 1e-12:
        return "0"
    text = f"{value:.10g}" if abs(value) < 1e5 else f"{value:.3g}"
    if len(text) > 7:
        text = f"{value:.3g}"
    if "e-" in text and abs(value) > 1e-6:  # 0.00005 in is a tick of an axis
        text = f"{value:.8f}".rstrip("0")
    return text.replace("-", "−")


def label(x: float, y: float, text: str, anchor: str = "middle", fill: str = SOFT) -> str:
    """place, text → <text>; anchor is start, middle or end."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{fill}">{escape(text)}</text>'


def chart(series: Sequence[Plotted], frame: Canvas, marks: Sequence[Mark] = ()) -> str:
    """series, frame, lines across → one <svg>; the title is also what a screen reader says."""
    plot = _Plot(series, frame, marks)
    return plot.drawn()


class _Plot:
    """The arithmetic of one chart: room for labels, scales, and the pieces in the order they are drawn."""

    def __init__(self, series: Sequence[Plotted], frame: Canvas, marks: Sequence[Mark]) -> None:
        self.series, self.frame, self.marks = series, frame, marks
        self.labels = [s for s in series if s.label]
        self.rows = self._legend_rows()
        self.x0, self.x1 = self._range("x")
        self.y0, self.y1 = self._range("y")
        self.left, self.right = 58.0, frame.width - 14.0
        self.title = textwrap.wrap(frame.title, max(int((frame.width - 72) / 6.9), 12))
        self.head = 8.0 + 16.0 * len(self.title) if self.title else 10.0
        self.above = 12.0 * max((m.row + 1 for m in marks if m.x is not None and m.text), default=0)  # texts stand above all points
        self.top = self.head + 17.0 * len(self.rows) + self.above
        self.bottom = frame.height - (38.0 if frame.x_label else 24.0)

    def _legend_rows(self) -> list[list[Plotted]]:
        rows: list[list[Plotted]] = []
        room = 0.0
        for s in self.labels:
            wide = 30 + 6.1 * len(s.label)
            if not rows or room + wide > self.frame.width - 70:
                rows.append([])
                room = 0.0
            rows[-1].append(s)
            room += wide
        return rows

    def _range(self, which: str) -> tuple[float, float]:
        wanted = self.frame.x_range if which == "x" else self.frame.y_range
        if wanted is not None:
            return wanted
        values = [np.asarray(s.x if which == "x" else s.y, dtype=float) for s in self.series if which == "x" or s.kind != "band"]
        if which == "y":
            values += [np.asarray(v, dtype=float) for s in self.series for v in (s.low, s.high) if v is not None]
        values += [np.array([v]) for m in self.marks if (v := m.x if which == "x" else m.y) is not None]
        every = np.concatenate(values) if values else np.array([0.0])
        every = every[np.isfinite(every)]
        if not len(every):
            return 0.0, 1.0
        low, high = float(every.min()), float(every.max())
        if which == "y" and self.frame.from_zero:
            low = min(low, 0.0)
        room = 0.06 * (high - low) or abs(high) * 0.1 or 1.0
        if which == "x":
            return (low - 0.5, high + 0.5) if self.frame.names else (low - 0.25 * room, high + 0.25 * room)
        return (low if self.frame.from_zero and low == 0 else low - room), high + room

    def x(self, value: float) -> float:
        return self.left + (value - self.x0) / (self.x1 - self.x0) * (self.right - self.left)

    def y(self, value: float) -> float:
        return self.bottom - (value - self.y0) / (self.y1 - self.y0) * (self.bottom - self.top)

    def drawn(self) -> str:
        f = self.frame
        said = escape(f.title or f.y_label)
        parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {f.width:g} {f.height:g}" width="{f.width:g}" '
            f'height="{f.height:g}" role="img" aria-label="{said}" font-family="{escape(FONT)}" font-size="11" fill="{INK}">'
        ]
        for i, line in enumerate(self.title):
            parts.append(f'<text x="{self.left:g}" y="{15 + 16 * i}" font-size="12.5" font-weight="600">{escape(line)}</text>')
        parts += self._legend()
        parts += self._grid()
        for s in self.series:
            parts += self._series(s)
        for m in self.marks:
            parts += self._mark(m)
        parts += [
            f'<path d="M{self.left:.1f} {self.top:.1f}V{self.bottom:.1f}H{self.right:.1f}" fill="none" stroke="{SOFT}"/>',
            "</svg>",
        ]
        return "".join(parts)

    def _legend(self) -> list[str]:
        parts = []
        for i, row in enumerate(self.rows):
            at, y = self.left, self.head + (10.0 if self.title else 6.0) + 17 * i
            for s in row:
                parts += self._swatch(s, at, y - 4)
                parts.append(f'<text x="{at + 24:.1f}" y="{y:.1f}" fill="{SOFT}">{escape(s.label)}</text>')
                at += 34 + 6.1 * len(s.label)
        return parts

    def _swatch(self, s: Plotted, x: float, y: float) -> list[str]:
        if s.kind == "band":
            return [f'<rect x="{x:.1f}" y="{y - 5:.1f}" width="18" height="10" fill="{s.color}" fill-opacity="0.25"/>']
        if s.kind in ("line", "steps"):
            return [_path(f"M{x:.1f} {y:.1f}h18", s.color, s.dash, 2)]
        if s.kind == "bars":
            return [f'<rect x="{x + 4:.1f}" y="{y - 5:.1f}" width="10" height="10" fill="{s.color}"/>']
        return [_dot(x + 9, y, s, "")]

    def _grid(self) -> list[str]:
        f, parts = self.frame, []
        for v in ticks(self.y0, self.y1, max(2, int((self.bottom - self.top) / 34))):
            y = self.y(v)
            parts.append(f'<path d="M{self.left:.1f} {y:.1f}H{self.right:.1f}" stroke="{LINE if v else SOFT}" stroke-width="0.8"/>')
            parts.append(f'<text x="{self.left - 6:.1f}" y="{y + 3.6:.1f}" text-anchor="end" fill="{SOFT}">{number(v)}</text>')
        if f.names:
            room = (self.right - self.left) / max(len(f.names), 1)
            every = max(1, math.ceil(WIDE * max(map(len, f.names), default=1) / max(room, 1)))
            for i, name in enumerate(f.names):
                if i % every == 0:
                    parts.append(label(self.x(i), self.bottom + 14, name))
        elif f.first_day is not None:
            for v, name in dates(f.first_day, self.x0, self.x1, max(2, int((self.right - self.left) / 46)), f.months):
                parts.append(f'<path d="M{self.x(v):.1f} {self.bottom:.1f}v4" stroke="{SOFT}"/>')
                parts.append(label(min(self.x(v), f.width - 1 - WIDE * len(name) / 2), self.bottom + 15, name))
        else:
            for v in ticks(self.x0, self.x1, max(2, int((self.right - self.left) / 70))):
                x = self.x(v)
                parts.append(f'<path d="M{x:.1f} {self.bottom:.1f}v4" stroke="{SOFT}"/>')
                parts.append(f'<text x="{x:.1f}" y="{self.bottom + 15:.1f}" text-anchor="middle" fill="{SOFT}">{number(v)}</text>')
        if f.x_label:
            middle = (self.left + self.right) / 2
            parts.append(f'<text x="{middle:.1f}" y="{f.height - 6:.1f}" text-anchor="middle">{escape(f.x_label)}</text>')
        if f.y_label:
            middle = (self.top + self.bottom) / 2
            turned = f'transform="rotate(-90 12 {middle:.1f})"'
            parts.append(f'<text x="12" y="{middle:.1f}" text-anchor="middle" {turned}>{escape(f.y_label)}</text>')
        return parts

    def _points(self, s: Plotted, values: Array) -> list[tuple[float, float]]:
        pairs = zip(np.asarray(s.x, dtype=float), np.asarray(values, dtype=float), strict=True)
        return [(self.x(float(a)), self.y(float(b))) for a, b in pairs if math.isfinite(a) and math.isfinite(b)]

    def _series(self, s: Plotted) -> list[str]:
        if not len(s.x):
            return []
        if s.kind == "band":
            assert s.low is not None and s.high is not None
            there, back = self._points(s, s.high), self._points(s, s.low)[::-1]
            return [f'<path d="{_way([*there, *back])}Z" fill="{s.color}" fill-opacity="0.22"/>']
        points = self._points(s, s.y)
        parts = []
        if s.low is not None and s.high is not None:
            for a, b in zip(self._points(s, s.low), self._points(s, s.high), strict=True):
                parts.append(_path(f"M{a[0]:.1f} {a[1]:.1f}V{b[1]:.1f}m-3 0h6M{a[0] - 3:.1f} {a[1]:.1f}h6", s.color, "", 1.2))
        if s.kind == "line":
            return [*parts, _path(_way(points), s.color, s.dash, 1.8)]
        if s.kind == "steps":
            stairs = [points[0]]
            for a, b in pairwise(points):
                stairs += [(b[0], a[1]), b]
            return [*parts, _path(_way(stairs), s.color, s.dash, 1.8)]
        if s.kind == "bars":
            wide = max(1.0, 0.7 * (self.right - self.left) / max(len(points), 1))
            zero = self.y(min(max(0.0, self.y0), self.y1))
            return parts + [
                f'<rect x="{x - wide / 2:.1f}" y="{min(y, zero):.1f}" width="{wide:.1f}" height="{abs(zero - y):.1f}" '
                f'fill="{s.color}"/>'
                for x, y in points
            ]
        if s.kind == "dots" and not s.tips:  # one path of points instead of an element each: a third of the text
            way = "".join(f"M{x:.1f} {y:.1f}h.01" for x, y in points)
            return [
                *parts,
                f'<path d="{way}" fill="none" stroke="{s.color}" stroke-width="{2 * s.size:g}" stroke-linecap="round"/>',
            ]
        tips = s.tips or ("",) * len(points)
        return parts + [_dot(x, y, s, tip) for (x, y), tip in zip(points, tips, strict=False)]

    def _mark(self, m: Mark) -> list[str]:
        if m.x is not None:
            x = self.x(m.x)
            wide = 4 + WIDE * len(m.text)
            end = x > self.left + 0.75 * (self.right - self.left) or x + wide > self.frame.width
            x_end = x - 4 if x >= wide else self.frame.width - 2.0  # a text that fits on neither side ends at the edge
            foot = self.top - self.above + 9 + 12 * m.row
            parts = [_path(f"M{x:.1f} {foot - 8 if m.text else self.top:.1f}V{self.bottom:.1f}", m.color, m.dash, 1.2)]
            side = f'x="{x_end:.1f}" text-anchor="end"' if end else f'x="{x + 4:.1f}"'
            return [*parts, f'<text {side} y="{foot:.1f}" fill="{m.color}" {HALO}>{escape(m.text)}</text>']
        assert m.y is not None
        y = self.y(m.y)
        place, foot = self._free(m.text, y)
        return [
            _path(f"M{self.left:.1f} {y:.1f}H{self.right:.1f}", m.color, m.dash, 1.2),
            f'<text {place} y="{foot:.1f}" fill="{m.color}" {HALO}>{escape(m.text)}</text>',
        ]

    def _free(self, text: str, y: float) -> tuple[str, float]:
        """text of a line across the chart, its y in px → where it stands: at the left or right end, above or below, where it covers
        the fewest points; its foot.
        """
        at = [self._points(s, s.y) for s in self.series if s.kind != "band" and len(s.x)]
        between = [((a[0] + b[0]) / 2, (a[1] + b[1]) / 2) for points in at for a, b in pairwise(points)]
        points, wide = [*(p for one in at for p in one), *between], 6.2 * len(text)
        found = []
        for i, (left, foot) in enumerate((a, b) for b in (y - 4, y + 13) for a in (self.left + 4, self.right - 4 - wide)):
            inside = sum(left - 5 < a < left + wide + 5 and foot - 15 < b < foot + 7 for a, b in points)
            out = foot - 9 < self.top or foot + 2 > self.bottom
            found.append((out, inside, i, left, foot))
        _, _, i, left, foot = min(found)
        return (f'x="{left:.1f}"' if i % 2 == 0 else f'x="{self.right - 4:.1f}" text-anchor="end"'), foot


def _way(points: Sequence[tuple[float, float]]) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points) if points else "M0 0"


def _path(way: str, color: str, dash: str, width: float) -> str:
    broken = f' stroke-dasharray="{dash}"' if dash else ""
    return f'<path d="{way}" fill="none" stroke="{color}" stroke-width="{width:g}" stroke-linejoin="round"{broken}/>'


def _dot(x: float, y: float, s: Plotted, tip: str) -> str:
    r = s.size
    if s.kind == "crosses":
        body = f'<path d="M{x - r:.1f} {y - r:.1f}l{2 * r:.1f} {2 * r:.1f}m0 {-2 * r:.1f}l{-2 * r:.1f} {2 * r:.1f}" '
        body += f'stroke="{s.color}" stroke-width="1.8" fill="none"'
    elif s.kind == "triangles":
        body = f'<path d="M{x:.1f} {y - 1.2 * r:.1f}l{1.2 * r:.1f} {2.2 * r:.1f}h{-2.4 * r:.1f}z" fill="{s.color}"'
    elif s.kind == "diamonds":
        body = f'<path d="M{x:.1f} {y - 1.3 * r:.1f}l{1.3 * r:.1f} {1.3 * r:.1f}l{-1.3 * r:.1f} {1.3 * r:.1f}'
        body += f'l{-1.3 * r:.1f} {-1.3 * r:.1f}z" fill="{s.color}"'
    elif s.kind == "squares":
        body = f'<rect x="{x - r:.1f}" y="{y - r:.1f}" width="{2 * r:.1f}" height="{2 * r:.1f}" fill="{s.color}"'
    elif s.kind == "boxes":
        body = f'<rect x="{x - r:.1f}" y="{y - r:.1f}" width="{2 * r:.1f}" height="{2 * r:.1f}" fill="none" stroke="{s.color}" '
        body += 'stroke-width="1.8"'
    elif s.kind == "rings":
        body = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r:g}" fill="none" stroke="{s.color}" stroke-width="1.4"'
    else:
        body = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r:g}" fill="{s.color}"'
    name = body[1 : body.index(" ")]
    return f"{body}><title>{escape(tip)}</title></{name}>" if tip else f"{body}/>"
