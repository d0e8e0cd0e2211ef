"""What the files of causes have in common: patterns, waves, slow changes. `Cause` in the package says what a file fills."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from ..kinematics import Slot
from ..records import Array, InputError
from ..touches import Touches
from . import GAP, Coefficient, Shape

Pattern = Callable[[Touches], Array]
Variants = Iterator[dict[str, Any]]
HOUR = 3600.0
WIDE = 10.0  # mm: an axis that goes less has no screw to speak of
BEYOND = 0.15  # of the touched way: how far behind its end a screw or scale is held, where nobody has stated it
FEWEST = 6  # touches before and after a moment at which something moved


def label(cause: str, *setting: Any) -> str:
    """name of a cause, settings → the stem of the names of its coefficients, different for different settings."""
    shown = [f"{s:.6g}" if isinstance(s, float) else str(s) for s in setting if s is not None]
    return f"{cause}[{','.join(shown)}]" if shown else cause


def early(name: str, pattern: Pattern, unit: str = "mm") -> Coefficient:
    """name, pattern (n,) → coefficient that makes the surface read too early by value × pattern."""
    return Coefficient(name, unit, GAP, lambda touches: -pattern(touches))


def normals(touches: Touches, frame: str) -> Array:
    """machine, table or spindle → (n, 3) outward normals in that frame. Raises InputError for another word."""
    if frame == "machine":
        return touches.machine_normal
    if frame == "table":
        return touches.normal
    if frame == "spindle":
        return touches.spindle_normal
    raise InputError(f"terms: frame: found {frame!r}; allowed: machine, table, spindle")


def moments(touches: Touches) -> list[int]:
    """touches → first touches after which something may sit elsewhere: every fourth, and the first of every indexation."""
    n = len(touches)
    begins = np.flatnonzero(np.diff(touches.indexation)) + 2
    rows = [at - 1 for at in sorted({*begins.tolist(), *range(FEWEST + 1, n - FEWEST, 4)}) if FEWEST < at <= n - FEWEST]
    return [int(touches.counted[row]) for row in rows]


def since(at: float) -> Pattern:
    """first touch after something happened (its number in the readings) → 0 before, 1 from there on, (n,)."""
    return lambda t: (t.counted >= int(at)).astype(float)


def onsets(touches: Touches, rows: int) -> Iterator[Array]:
    """touches, rows that are searched → (n, 1) columns, 0 before a moment and 1 from there on, every eight searched rows."""
    stride = 8 * -(-len(touches) // rows)
    for at in range(stride, len(touches) - stride, stride):
        yield since(int(touches.counted[at]))(touches)[:, None]


def displaced(
    stem: str, frame: str, shape: Pattern, direction: Sequence[float] | None = None, unit: str = "mm"
) -> list[Coefficient]:
    """stem, frame, shape (n,), direction or None → coefficients of a displacement n·a × shape: x y z, or one along `direction`."""
    if direction is not None:
        unit_vector = np.array(direction, dtype=float) / np.linalg.norm(direction)
        return [early(stem, lambda t: normals(t, frame) @ unit_vector * shape(t), unit)]

    def along(i: int) -> Pattern:
        return lambda t: normals(t, frame)[:, i] * shape(t)

    return [early(f"{stem}.{c}", along(i), unit) for i, c in enumerate("xyz")]


def wave(stem: str, slot: Slot, angle: Pattern, unit: str, size: Pattern | None = None) -> list[Coefficient]:
    """stem, slot, angle (n,) rad, size (n,) → cosine and sine that act there; at `GAP` positive = read too early."""
    sign = -1.0 if slot == GAP else 1.0

    def part(function: Callable[[Array], Array]) -> Pattern:
        return lambda t: sign * function(angle(t)) * (1.0 if size is None else size(t))

    return [Coefficient(f"{stem}.cos", unit, slot, part(np.cos)), Coefficient(f"{stem}.sin", unit, slot, part(np.sin))]


def grown(shape: str, tau: float, sensor: str | None = None) -> Pattern:
    """exponential, linear or sensor → how much of a slow change has happened at each touch, (n,)."""
    if sensor is not None:
        return lambda t: t.temperatures[sensor] - t.temperatures[sensor][0]
    if shape == "exponential":
        return lambda t: 1 - np.exp(-t.warm / tau)
    if shape == "linear":
        return lambda t: t.warm / tau
    raise InputError(f"terms: shape: found {shape!r}; allowed: exponential, linear")


def fraction(values: Array) -> Array:
    """(n,) → the same from 0 to 1."""
    return (values - values.min()) / (np.ptp(values) or 1.0)


def times(function: Array, weights: Array) -> Array:
    """(n, f), (n,) or (n, w) → (n, f·w) all products."""
    return np.einsum("nf,nw->nfw", function, weights.reshape(len(function), -1)).reshape(len(function), -1)


def settling(touches: Touches, frame: str, kind: str, weights: Array) -> Iterator[Shape]:
    """touches, frame, kind, (n,) or (n, w) → shapes of what begins with the test and settles, or goes on."""
    since = fraction(touches.warm)
    for function in (*(1 - np.exp(-since / tau) for tau in np.geomspace(1 / 15, 2.5, 6)), since):
        yield "time", frame, kind, times(function[:, None], weights)


def slow(touches: Touches, number: int = 7) -> Variants:
    """touches → settings of `grown`: time constants from a twentieth to three times the run, straight line, every sensor."""
    run = max(float(np.ptp(touches.warm)), 1.0)
    for tau in np.geomspace(run / 15, 2.5 * run, number):
        yield {"shape": "exponential", "tau": float(tau)}
    yield {"shape": "linear", "tau": HOUR}
    for sensor, value in touches.temperatures.items():
        if np.ptp(value) > 0.05:
            yield {"sensor": sensor}


def turns(touches: Touches) -> bool:
    """touches → whether the table turns between them; where it does not, table and machine frame are the same."""
    return not np.allclose(touches.normal, touches.machine_normal, atol=1e-6)


def ends(touches: Touches, axis: str) -> tuple[float, float]:
    """touches, linear axis → readings in mm, a little beyond what was touched, at which its screw or scale may be held."""
    low, high = float(touches.axis(axis).min()), float(touches.axis(axis).max())
    return round(low - BEYOND * (high - low)), round(high + BEYOND * (high - low))


def places(touches: Touches, axis: str) -> list[float]:
    """touches, linear axis → `ends`, and two places between them, in mm; none of them is zero."""
    low, high = ends(touches, axis)
    between = [round(low + part * (high - low)) for part in (0.3, 0.7)]
    return [float(place) for place in (low, *between, high) if place]


def need(cause: str, name: str, value: Any, allowed: Sequence[Any]) -> None:
    """Raises InputError when a setting is not one of the allowed ones."""
    if value not in allowed:
        raise InputError(f"terms: {cause}: {name}: found {value!r}; allowed: {', '.join(map(str, allowed))}")


def moved_axes(touches: Touches, axes: Sequence[str], least: float) -> list[str]:
    """letters, mm or rad → those axes that move by more than that during the test."""
    return [axis for axis in axes if np.ptp(touches.axis(axis)) > least]
