"""Estimate → slices through the working volume: how long the error of the tip is there, and where nobody has touched."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

from ..records import Array, Machine
from ..touches import Touches
from ..verify.volume import VolumeMap
from .svg import FONT, INK, SOFT, label, number, ticks
from .units import Units

POINTS = 13  # a side of a slice
# Cividis (Nuñez, Anderton, Renslow 2018): gets lighter all the way, so that it reads the same in gray and to every eye.
SCALE = ((0, 32, 76), (0, 66, 118), (62, 85, 117), (98, 106, 112), (127, 124, 117), (160, 146, 103), (199, 171, 79), (255, 234, 70))


@dataclass(frozen=True)
class Slice:
    """Two axes moved over their travel, all others at `centre`: sizes (m, m) mm, extrapolated (m, m)."""

    across: str
    up: str
    x: Array  # (m,) mm or deg
    y: Array
    size: Array
    std: Array
    extrapolated: NDArray[np.bool_]
    rest: tuple[tuple[str, float, bool], ...]  # the other axes: name, mm or deg, whether it is linear


def planes(machine: Machine) -> list[tuple[str, str]]:
    """machine → pairs of axes that are worth a slice: the linear ones, and the rotary ones where there are two."""
    linear = machine.linear
    pairs = [(a, b) for i, a in enumerate(linear) for b in linear[i + 1 :]]
    return [*pairs, *([tuple(machine.rotary[:2])] if len(machine.rotary) > 1 else [])]  # type: ignore[list-item]


def poses(machine: Machine, touches: Touches) -> Array:
    """machine, touches → (n, k) mm rad: the poses of every slice through the mean of the touched poses, one after the other."""
    centre = np.array(touches.position.mean(axis=0))
    centre[machine.column("S")] = 0.0
    parts = []
    for pair in planes(machine):
        lines = [_line(machine, touches, name) for name in pair]
        one, two = np.meshgrid(*lines, indexing="xy")
        block = np.tile(centre, (POINTS * POINTS, 1))
        block[:, machine.column(pair[0])], block[:, machine.column(pair[1])] = one.ravel(), two.ravel()
        parts.append(block)
    return np.vstack(parts)


def _line(machine: Machine, touches: Touches, name: str) -> Array:
    low, high = float(touches.axis(name).min()), float(touches.axis(name).max())
    travel = machine.axis(name).travel
    room = 0.35 * (high - low) or (1.0 if name in machine.linear else 0.1)
    first, last = low - room, high + room
    if travel is not None:
        first, last = max(first, travel[0]), min(last, travel[1])
    return np.linspace(first, last, POINTS)


def cut(chart: VolumeMap, machine: Machine, first: int) -> list[Slice]:
    """map that holds the poses of `poses` from row `first` on → slices, in mm and deg."""
    found = []
    for i, (a, b) in enumerate(planes(machine)):
        rows = slice(first + i * POINTS**2, first + (i + 1) * POINTS**2)
        at = chart.position[rows]
        x = np.array(at[:POINTS, machine.column(a)])
        y = np.array(at[::POINTS, machine.column(b)])
        if a in machine.rotary:
            x, y = np.degrees(x), np.degrees(y)
        rest: list[tuple[str, float, bool]] = []
        for name in (*machine.linear, *machine.rotary):
            if name not in (a, b):
                value = float(at[0, machine.column(name)])
                shown = float(np.degrees(value)) if name in machine.rotary else value
                rest.append((name, shown, name in machine.linear))
        shape = (POINTS, POINTS)
        found.append(
            Slice(
                a,
                b,
                x,
                y,
                chart.size[rows].reshape(shape),
                chart.std[rows].reshape(shape),
                chart.extrapolated[rows].reshape(shape),
                tuple(rest),
            )
        )
    return found


def color(part: float) -> str:
    """0 … 1 → color of the scale, dark to light."""
    at = min(max(part, 0.0), 1.0) * (len(SCALE) - 1)
    i = min(int(at), len(SCALE) - 2)
    mix = [round(a + (at - i) * (b - a)) for a, b in zip(SCALE[i], SCALE[i + 1], strict=True)]
    return "#{:02x}{:02x}{:02x}".format(*mix)


def picture(found: Sequence[Slice], machine: Machine, units: Units, words: dict[str, str]) -> str:
    """slices, machine, units, texts (`scale`, `hatched`) → one <svg>; extrapolated cells are hatched."""
    inside = [float(s.size[~s.extrapolated].max()) for s in found if (~s.extrapolated).any()]
    top = max([*inside, 1e-6]) if inside else max(float(s.size.max()) for s in found)
    side, gap = 210.0, 78.0
    rows = -(-len(found) // 2)
    width, height = 2 * (side + gap) + 96, rows * (side + 74) + 34
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" height="{height:g}" '
        f'role="img" aria-label="{escape(words["scale"])}" font-family="{escape(FONT)}" font-size="11" fill="{INK}">'
    ]
    for i, s in enumerate(found):
        parts += _slice(s, 56 + (i % 2) * (side + gap), 30 + (i // 2) * (side + 74), side, top, machine, units)
    parts += _legend(width - 84, 36, top, units, words, rows * (side + 74) - 60)
    hatch = 10
    y = height - 14
    parts += [
        f'<rect x="56" y="{y - 9:g}" width="22" height="12" fill="{color(0.4)}"/>',
        _hatch(56, y - 9, 22, 12, hatch),
        f'<text x="84" y="{y + 1:g}" fill="{SOFT}">{escape(words["hatched"])}</text>',
        "</svg>",
    ]
    return "".join(parts)


def _placed(name: str, value: float, linear: bool, units: Units) -> str:
    """axis, where it stands (mm or deg), whether it is linear, units → X 13.2 or B 0°."""
    if not linear:
        return f"{name} {round(value)}°"
    return f"{name} {value * units.per_mm:.{0 if units.system == 'mm' else 1}f}".replace("-", "−")


def _slice(s: Slice, left: float, top: float, side: float, most: float, machine: Machine, units: Units) -> list[str]:
    n = len(s.x)
    cell = side / n
    rest = ", ".join(_placed(*axis, units) for axis in s.rest)
    parts = [
        f'<text x="{left:g}" y="{top - 8:g}" font-weight="600">{s.across} – {s.up}'
        f'<tspan font-weight="400" dx="9" fill="{SOFT}">{escape(rest)}</tspan></text>'
    ]
    for row in range(n):
        for column in range(n):
            value = float(s.size[row, column])
            x, y = left + column * cell, top + side - (row + 1) * cell
            tip = f"{value * 1e3 * units.per_micron:.1f} ± {2e3 * float(s.std[row, column]) * units.per_micron:.1f} {units.small}"
            parts.append(
                f'<rect x="{x:.1f}" y="{y:.1f}" width="{cell + 0.4:.1f}" height="{cell + 0.4:.1f}" fill="{color(value / most)}">'
                f"<title>{tip}</title></rect>"
            )
    for row in range(n):  # runs of extrapolated cells of a row are hatched together
        column = 0
        while column < n:
            if not s.extrapolated[row, column]:
                column += 1
                continue
            end = column
            while end < n and s.extrapolated[row, end]:
                end += 1
            parts.append(_hatch(left + column * cell, top + side - (row + 1) * cell, (end - column) * cell, cell, 7))
            column = end
    for name, values, sideways in ((s.across, s.x, True), (s.up, s.y, False)):
        linear = name in machine.linear
        shown = values * (units.per_mm if linear else 1.0)
        low, high = float(shown[0]), float(shown[-1])
        for v in ticks(low, high, 4):
            part = (v - low) / (high - low) * (1 - 1 / n) + 0.5 / n
            if sideways:
                parts.append(label(left + part * side, top + side + 14, number(v)))
            else:
                parts.append(label(left - 5, top + side - part * side + 4, number(v), "end"))
        what = f"{name}, {units.large if linear else '°'}"
        if sideways:
            parts.append(f'<text x="{left + side / 2:.1f}" y="{top + side + 29:.1f}" text-anchor="middle">{what}</text>')
        else:
            x, y = left - 40, top + side / 2
            parts.append(
                f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="middle" transform="rotate(-90 {x:.1f} {y:.1f})">{what}</text>'
            )
    return parts


def _hatch(x: float, y: float, wide: float, high: float, step: float) -> str:
    """Slanted lines, dark on white ones, cut at the edges by hand: patterns of SVG are not drawn alike everywhere.

    The color below stays as it is: on this scale paler is a larger error, and a veil would make one up.
    """
    way = ""
    at = np.ceil((x + y) / step) * step  # lines x + y = constant, so that neighbors join
    while at < x + wide + y + high:
        x1, x2 = min(at - y, x + wide), max(at - y - high, x)
        if x1 > x2:
            way += f"M{x1:.1f} {at - x1:.1f}L{x2:.1f} {at - x2:.1f}"
        at += step
    below = f'<path d="{way}" stroke="#fff" stroke-opacity="0.6" stroke-width="1.5" fill="none" pointer-events="none"/>'
    return below + f'<path d="{way}" stroke="{INK}" stroke-width="0.7" fill="none" pointer-events="none"/>'


def _legend(x: float, y: float, top: float, units: Units, words: dict[str, str], room: float) -> list[str]:
    tall, n = min(room, 220.0), 24
    parts = [f'<text x="{x:g}" y="{y - 12:g}">{escape(units.small)}</text>']
    for i in range(n):
        band = f'y="{y + tall * (1 - (i + 1) / n):.1f}" width="16" height="{tall / n + 0.4:.1f}"'
        parts.append(f'<rect x="{x:g}" {band} fill="{color((i + 0.5) / n)}"/>')
    most = top * 1e3 * units.per_micron
    for v in ticks(0.0, most, 5):
        at = y + tall * (1 - v / most)
        parts.append(f'<text x="{x + 22:g}" y="{at + 4:.1f}" fill="{SOFT}">{number(v)}</text>')
    return parts
