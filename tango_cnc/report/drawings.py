"""Names of ISO 230-1 → a small drawing of what each means: gray is as designed, color is as found, far too large.

All drawings share one oblique view of the machine frame: X to the right, Z up, Y away from the viewer.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from html import escape

import numpy as np

from ..records import Array, Machine
from .svg import BLUE, INK, LINE, RED, SOFT

WIDE, HIGH = 108.0, 78.0
VIEW = np.array([[1.0, 0.5, 0.0], [0.0, -0.36, -1.0]])  # X right, Y back, Z up; rows are x and y of the picture
_INTER = re.compile(r"E([XYZABC])0([XYZABCS])")
_POWER = re.compile(r"E([XYZABC])([XYZABCS])(\d)")
_BACK = re.compile(r"E([XYZABC])\1b")
_STYLUS = re.compile(r"E([XYZ])t")
LETTER = {"X": 0, "Y": 1, "Z": 2, "A": 0, "B": 1, "C": 2}


def drawing(name: str, machine: Machine) -> str:
    """name of a parameter, machine → <svg> of what it means; an empty text for what has no picture."""
    if "-" in name:
        name = name.split("-")[0]
    for pattern, draw in _KINDS:
        if match := pattern.fullmatch(name):
            return _whole(name, draw(machine, *match.groups()))
    return ""


def _whole(name: str, parts: list[str]) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE:g} {HIGH:g}" width="{WIDE:g}" height="{HIGH:g}" role="img" '
        f'aria-label="{escape(name)}" font-family="sans-serif" font-size="10">{"".join(parts)}</svg>'
    )


def _at(point: Array) -> Array:
    return np.array([WIDE / 2, HIGH / 2]) + VIEW @ np.asarray(point, dtype=float)


def _line(a: Array, b: Array, color: str, dash: str = "", width: float = 1.6) -> str:
    p, q = _at(a), _at(b)
    broken = f' stroke-dasharray="{dash}"' if dash else ""
    return f'<path d="M{p[0]:.1f} {p[1]:.1f}L{q[0]:.1f} {q[1]:.1f}" stroke="{color}" stroke-width="{width}" fill="none"{broken}/>'


def _curve(points: Array, color: str, dash: str = "", width: float = 1.6) -> str:
    flat = [_at(p) for p in points]
    broken = f' stroke-dasharray="{dash}"' if dash else ""
    way = "L".join(f"{x:.1f} {y:.1f}" for x, y in flat)
    return f'<path d="M{way}" stroke="{color}" stroke-width="{width}" fill="none" stroke-linejoin="round"{broken}/>'


def _arrow(a: Array, b: Array, color: str = RED) -> str:
    p, q = _at(a), _at(b)
    along = (q - p) / (float(np.linalg.norm(q - p)) or 1.0)
    across = np.array([-along[1], along[0]])
    left, right = q - 5 * along + 3 * across, q - 5 * along - 3 * across
    head = f"{q[0]:.1f},{q[1]:.1f} {left[0]:.1f},{left[1]:.1f} {right[0]:.1f},{right[1]:.1f}"
    return _line(a, b, color, "", 1.8) + f'<polygon points="{head}" fill="{color}"/>'


def _text(point: Array, text: str, color: str = INK, dx: float = 0.0, dy: float = 3.5) -> str:
    x, y = _at(point)
    x, y = min(max(x + dx, 6), WIDE - 6), min(max(y + dy, 9), HIGH - 2)
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="middle" fill="{color}">{escape(text)}</text>'


def _direction(machine: Machine, axis: str) -> Array:
    """axis → unit vector as it is drawn: nearest letter's sign kept, so that 'up' stays up."""
    return np.asarray(machine.axis(axis).direction, dtype=float)


def _unit(letter: str) -> Array:
    return np.eye(3)[LETTER[letter]]


def _across(d: Array) -> Array:
    helper = np.eye(3)[int(np.argmin(np.abs(d)))]
    v = np.cross(d, helper)
    return np.asarray(v / np.linalg.norm(v))


def _turned(v: Array, about: Array, angle: float) -> Array:
    """vector, unit axis, rad → turned vector (Rodrigues)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(v * c + np.cross(about, v) * s + about * (about @ v) * (1 - c))


def _ring(centre: Array, d: Array, radius: float) -> Array:
    u = _across(d)
    v = np.cross(d, u)
    t = np.linspace(0, 2 * np.pi, 41)[:, None]
    return np.asarray(centre + radius * (np.cos(t) * u + np.sin(t) * v))


def _body(machine: Machine, axis: str, d: Array, shift: Array, color: str, dash: str) -> list[str]:
    """An axis as a line with what says its kind: a ring of a rotary axis or spindle, nothing more for a slide."""
    long = 24.0 if abs(d[2]) > 0.7 else 34.0
    parts = [_line(shift - long * d, shift + long * d, color, dash)]
    if machine.axis(axis).kind != "linear":
        parts.append(_curve(_ring(shift - 0.35 * long * d, d, 17.0), color, dash, 1.2))
    return parts


def _inter(machine: Machine, letter: str, axis: str) -> list[str]:
    d, e = _direction(machine, axis), _unit(letter)
    origin = np.zeros(3)
    parts = _body(machine, axis, d, origin, SOFT, "4 3")
    if letter in "XYZ":
        off = 15.0 * e
        parts += _body(machine, axis, d, off, BLUE, "")
        parts.append(_arrow(origin, off))
        return [*parts, _text(off, f"{letter}", RED, 9), _text(-1.0 * 30 * d, axis, SOFT, -8)]
    tilted = _turned(d, e, 0.42)
    parts += _body(machine, axis, tilted, origin, BLUE, "")
    if machine.axis(axis).kind == "linear":
        other = np.cross(e, d)
        if np.linalg.norm(other) > 0.5:  # the square that it should make
            parts.append(_curve(np.array([9 * d, 9 * d + 9 * other, 9 * other]), SOFT, "", 1.0))
            parts.append(_line(origin, 26 * other, LINE, "", 1.2))
    arc = np.array([_turned(28 * d, e, a) for a in np.linspace(0, 0.42, 9)])
    parts += [_curve(arc[:-1], RED, "", 1.6), _arrow(arc[-2], arc[-1])]
    return [*parts, _text(34 * tilted, axis, BLUE, 5)]


def _shape(degree: int) -> Array:
    t = np.linspace(-1, 1, 33)
    return np.asarray({0: t * 0 + 0.6, 1: t, 2: 1 - 2 * t**2, 3: 2.6 * (t - t**3)}.get(degree, np.sin(degree * 1.7 * t)))


def _power(machine: Machine, letter: str, axis: str, digit: str) -> list[str]:
    d, e, t = _direction(machine, axis), _unit(letter), np.linspace(-1, 1, 33)[:, None]
    rotary = machine.axis(axis).kind != "linear"
    shape = _shape(int(digit))[:, None]
    if rotary:
        return _turning(d, e, letter, axis, shape)
    long = 24.0 if abs(d[2]) > 0.7 else 36.0
    rail = _line(-long * d, long * d, SOFT, "4 3")
    if letter == axis:
        return [rail, *_scale(d, long, shape[:, 0])]
    if letter in "XYZ":
        found = long * t * d + 11.0 * shape * e
        most = int(np.argmax(np.abs(shape[:, 0])))
        return [rail, _curve(found, BLUE), _arrow(long * t[most] * d, found[most]), _text(found[most], letter, RED, 9)]
    parts = [rail]
    for i in (2, 16, 30):  # a carriage that tilts on its way
        at, angle = long * t[i] * d, 0.55 * float(shape[i, 0])
        u, v = (d, _across(d)) if abs(d @ e) < 0.5 else (_across(d), np.cross(d, _across(d)))
        box = np.array([-7 * u - 5 * v, 7 * u - 5 * v, 7 * u + 5 * v, -7 * u + 5 * v, -7 * u - 5 * v])
        parts.append(_curve(at + box, LINE, "", 1.2))
        parts.append(_curve(at + np.array([_turned(p, e, angle) for p in box]), BLUE))
    return [*parts, _text(np.zeros(3), f"about {'XYZ'[LETTER[letter]]}", RED, 0, 32)]


def _turning(d: Array, e: Array, letter: str, axis: str, shape: Array) -> list[str]:
    ring = _ring(np.zeros(3), d, 26.0)
    wobble = np.interp(np.linspace(-1, 1, 41), np.linspace(-1, 1, 33), shape[:, 0])[:, None]
    parts = [_curve(ring, SOFT, "4 3"), _line(-22 * d, 22 * d, LINE, "", 1.2)]
    if letter in "XYZ":
        found = ring + 8 * wobble * e
        return [*parts, _curve(found, BLUE), _arrow(np.zeros(3), 15 * e), _text(15 * e, letter, RED, 9)]
    tilted = _turned(d, e, 0.35)
    if np.linalg.norm(tilted - d) > 1e-6:
        back = _turned(d, e, -0.35)
        return [*parts, _line(-22 * tilted, 22 * tilted, BLUE), _line(-22 * back, 22 * back, BLUE, "2 2")]
    start = ring[0]
    ahead = _turned(start, d, 0.5)
    arc = np.array([_turned(start, d, a) for a in np.linspace(0, 0.5, 8)])
    return [*parts, _line(np.zeros(3), start, SOFT), _line(np.zeros(3), ahead, BLUE), _curve(arc, RED), _arrow(arc[-2], arc[-1])]


def _scale(d: Array, long: float, shape: Array) -> list[str]:
    side, parts = _across(d) * 7, []
    for s in np.linspace(-1, 1, 7):
        nominal = long * 0.85 * s * d
        found = nominal + 7 * float(np.interp(s, np.linspace(-1, 1, 33), shape)) * d
        parts += [_line(nominal - side, nominal, SOFT, "", 1.2), _line(found, found + side, BLUE)]
    return parts


def _back(machine: Machine, letter: str) -> list[str]:
    d = _direction(machine, letter)
    if machine.axis(letter).kind != "linear":
        ring = _ring(np.zeros(3), d, 26.0)
        return [
            _curve(ring[2:19], BLUE),
            _arrow(ring[17], ring[19]),
            _curve(ring[22:39], SOFT, "4 3"),
            _arrow(ring[24], ring[22], SOFT),
        ]
    long, side = (22.0 if abs(d[2]) > 0.7 else 32.0), 7 * _across(d)
    return [
        _arrow(-long * d + side, (long - 8) * d + side, BLUE),
        _arrow(long * d - side, (-long + 8) * d - side, SOFT),
        _line((long - 8) * d + side, (long - 8) * d - 2 * side, RED, "2 2", 1.2),
        _line(long * d + side, long * d - 2 * side, RED, "2 2", 1.2),
    ]


def _stylus(machine: Machine, letter: str) -> list[str]:
    s = np.asarray(machine.axis("S").direction, dtype=float)
    e = _unit(letter)
    top, tip = 28 * s, -18 * s
    off = tip + 13 * e
    p, q = _at(tip), _at(off)
    return [
        _line(top, tip, SOFT, "4 3"),
        _line(top, off, BLUE),
        f'<circle cx="{p[0]:.1f}" cy="{p[1]:.1f}" r="5" fill="none" stroke="{SOFT}" stroke-dasharray="2 2"/>',
        f'<circle cx="{q[0]:.1f}" cy="{q[1]:.1f}" r="5" fill="{BLUE}"/>',
        _arrow(tip, off),
    ]


_KINDS: tuple[tuple[re.Pattern[str], Callable[..., list[str]]], ...] = (
    (_INTER, _inter),
    (_BACK, _back),
    (_POWER, _power),
    (_STYLUS, _stylus),
)
