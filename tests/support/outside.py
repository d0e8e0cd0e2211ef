"""Thirty kinds of causes that no catalogue holds, as physics of the simulated machine, and eleven kinds of noise.

Written without reading the diagnosis. Each kind is a function (history, rng) → (n,) by which a touch reads early, in any
unit: a campaign scales it. A displacement d of the table along an outward normal n makes its touch early by d·n.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_controller.effects import History, lever
from support.effect_parts import unit

Array = NDArray[np.float64]
Kind = Callable[[History, np.random.Generator], Array]


def _part(h: History) -> Array:
    """→ (n,) 0 … 1, time as a part of the run."""
    return np.asarray((h.time - h.time[0]) / np.ptp(h.time))


def _axis(h: History, letter: str) -> Array:
    return np.asarray(h.position[:, h.column(letter)])


def _scaled(h: History, letter: str) -> Array:
    """→ (n,) −1 … 1 over the range that is used."""
    q = _axis(h, letter)
    return np.asarray(2 * (q - q.min()) / np.ptp(q) - 1)


def _towards(h: History, rng: np.random.Generator, frame: str = "machine") -> Array:
    """→ (n,) how much of a unit displacement in a random direction is along the normal."""
    normal = h.normal if frame == "machine" else h.normal_table
    return np.asarray(normal @ unit(tuple(rng.normal(size=3))))


def _since(h: History) -> Array:
    """→ (n,) s since the first touch of this indexation."""
    first = np.flatnonzero(np.diff(h.indexation, prepend=-1))
    begins = h.time[first]
    return np.asarray(h.time - begins[np.searchsorted(first, np.arange(len(h)), side="right") - 1])


def overshoot(h: History, rng: np.random.Generator) -> Array:
    """A temperature control overshoots: a displacement comes and goes."""
    x = _part(h) / rng.uniform(0.15, 0.3)
    return x * np.exp(1 - x) * _towards(h, rng)


def open_door(h: History, rng: np.random.Generator) -> Array:
    """A window in time in which the machine stands elsewhere."""
    begin = rng.uniform(0.2, 0.6)
    t = _part(h)
    return ((t > begin) & (t < begin + rng.uniform(0.1, 0.25))) * _towards(h, rng)


def cooler(h: History, rng: np.random.Generator) -> Array:
    """A cooler switches on and off with a short duty."""
    phase = (_part(h) * rng.uniform(2.5, 5) + rng.uniform()) % 1
    return (phase < 0.3) * _towards(h, rng)


def late_drift(h: History, rng: np.random.Generator) -> Array:
    """Nothing for a while, then a steady drift: coolant is switched on."""
    return np.maximum(_part(h) - rng.uniform(0.4, 0.7), 0) * _towards(h, rng)


def chirp(h: History, rng: np.random.Generator) -> Array:
    """A swing that becomes quicker."""
    t = _part(h)
    return np.sin(2 * np.pi * (1.0 * t + rng.uniform(2, 3) * t**2)) * _towards(h, rng)


def table_cycle(h: History, rng: np.random.Generator) -> Array:
    """Coolant breathes under the table: a cycle in the frame of the table."""
    return np.sin(2 * np.pi * _part(h) * rng.uniform(1.5, 4) + rng.uniform(0, 6)) * _towards(h, rng, "table")


def bending_column(h: History, rng: np.random.Generator) -> Array:
    """The column bends as it warms up: sideways, in proportion to time and height squared."""
    side = h.normal[:, int(rng.integers(2))]
    return _part(h) * (1 + _scaled(h, "Z")) ** 2 * side


def warming_rotary(h: History, rng: np.random.Generator) -> Array:
    """The zero of the tilting axis wanders to and fro with time."""
    return np.sin(np.pi * _part(h) * rng.uniform(1, 2)) * lever(h, "B")


def wearing_backlash(h: History, rng: np.random.Generator) -> Array:
    """The lost motion of an axis grows during the test."""
    i = int(rng.integers(3))
    return _part(h) ** 2 * h.direction[:, h.column("XYZ"[i])] * h.normal[:, i]


def breathing_scale(h: History, rng: np.random.Generator) -> Array:
    """The scale of an axis breathes with the room."""
    i = int(rng.integers(3))
    return np.sin(2 * np.pi * _part(h) * rng.uniform(1.5, 3)) * _scaled(h, "XYZ"[i]) * h.normal[:, i]


def floating_slide(h: History, rng: np.random.Generator) -> Array:
    """A slide rides up on its oil, the faster it came and the nearer it is to the pump, and sinks in the time until the touch."""
    i, j = rng.choice(3, 2, replace=False)
    q, gap = _axis(h, "XYZ"[i]), np.maximum(np.diff(h.time, prepend=h.time[0] - 10.0), 0.1)
    speed = np.abs(np.diff(q, prepend=q[:1])) / gap
    lift = np.sqrt(speed / max(float(speed.max()), 1e-9)) * np.exp(-gap / rng.uniform(5, 20))
    return lift * (1.5 + _scaled(h, "XYZ"[i])) * h.normal[:, j]


def worn_guide(h: History, rng: np.random.Generator) -> Array:
    """A hollow in a guide: a dip over 60 mm of travel, square to it."""
    i, j = rng.choice(3, 2, replace=False)
    q = _axis(h, "XYZ"[i])
    middle = rng.uniform(*np.quantile(q, [0.3, 0.7]))
    return np.exp(-(((q - middle) / 35) ** 2)) * h.normal[:, j]


def magnetised_scale(h: History, rng: np.random.Generator) -> Array:
    """The scale reads two lengths before and after a place."""
    i = int(rng.integers(3))
    q = _axis(h, "XYZ"[i])
    return np.tanh((q - rng.uniform(*np.quantile(q, [0.3, 0.7]))) / 12) * h.normal[:, i]


def twisted_bed(h: History, rng: np.random.Generator) -> Array:
    """A bed that is twisted: an error of one axis grows with the square of its own place and with that of another one."""
    i, j, k = rng.permutation(3)
    return _scaled(h, "XYZ"[i]) ** 2 * _scaled(h, "XYZ"[j]) * h.normal[:, k]


def ripple(h: History, rng: np.random.Generator) -> Array:
    """Height waves around a point of the X Y plane, as of a granite plate that was lapped round."""
    r = np.hypot(_axis(h, "X") - rng.uniform(-80, 80), _axis(h, "Y") - rng.uniform(-80, 80))
    return np.sin(2 * np.pi * r / rng.uniform(120, 200)) * h.normal[:, 2]


def leaning_ram(h: History, rng: np.random.Generator) -> Array:
    """The ram leans with the square of its height, and as far as the table is tilted."""
    return _scaled(h, "Y") ** 2 * np.sin(_axis(h, "B")) * h.normal[:, 2]


def worm_wheel(h: History, rng: np.random.Generator) -> Array:
    """A bad tooth: the angle of a rotary axis is wrong around one place."""
    letter = str(rng.choice(["B", "C"]))
    q = _axis(h, letter)
    middle = rng.choice(np.unique(np.round(q, 4))[2:-2])
    return np.exp(-(((q - middle) / np.radians(18)) ** 2)) * lever(h, letter)


def loose_table(h: History, rng: np.random.Generator) -> Array:
    """Beyond an angle the table rests on another pad and sits elsewhere."""
    q = _axis(h, "C")
    return (q > rng.choice(np.unique(np.round(q, 4))[3:-3]) + 1e-3) * _towards(h, rng)


def tilted_load(h: History, rng: np.random.Generator) -> Array:
    """An offset load: how far the table gives way depends on tilt times turn."""
    return np.sin(_axis(h, "B")) * np.cos(2 * _axis(h, "C") + rng.uniform(0, 6)) * h.normal[:, int(rng.integers(3))]


def cable_drag(h: History, rng: np.random.Generator) -> Array:
    """Hoses wind up beyond a turn, and the turntable leans."""
    c = _axis(h, "C") - rng.uniform(-1, 1.5)
    lean = np.cross(unit(tuple(rng.normal(size=3) * [1, 1, 0])), h.point - [0, 0, 0])
    return np.log1p(np.exp(4 * c)) * np.einsum("ni,ni->n", lean, h.normal_table)


def dead_sector(h: History, rng: np.random.Generator) -> Array:
    """The probe trips late in one sector."""
    azimuth = np.arctan2(h.normal_spindle[:, 1], h.normal_spindle[:, 0])
    apart = np.angle(np.exp(1j * (azimuth - rng.uniform(-np.pi, np.pi))))
    return np.exp(-((apart / 0.5) ** 2)) * np.hypot(*h.normal_spindle[:, :2].T)


def slanting_trigger(h: History, rng: np.random.Generator) -> Array:
    """The probe is stiffest on the slant."""
    across = np.hypot(*h.normal_spindle[:, :2].T)
    return np.abs(h.normal_spindle[:, 2]) * across * (1 + 0.5 * across)


def spindle_seat(h: History, rng: np.random.Generator) -> Array:
    """At one orientation of the spindle the taper seats elsewhere, the more the higher the ram stands."""
    s = np.round(_axis(h, "S"), 3)
    return (s == rng.choice(np.unique(s))) * (1 + _scaled(h, "Y")) ** 2 * h.normal[:, 2]


def stick_slip(h: History, rng: np.random.Generator) -> Array:
    """After short moves to one side an axis stops short."""
    i = int(rng.integers(3))
    move = h.move[:, h.column("XYZ"[i])]
    way = np.abs(h.position - np.roll(h.position, 1, axis=0))[:, h.column("XYZ"[i])]
    return (move < 0) * np.exp(-way / 30) * h.normal[:, int(rng.integers(3))]


def relaxing_clamp(h: History, rng: np.random.Generator) -> Array:
    """A clamp relaxes after each indexation."""
    return np.exp(-_since(h) / rng.uniform(10, 25)) * h.normal[:, int(rng.integers(3))]


def swinging_table(h: History, rng: np.random.Generator) -> Array:
    """The table still sinks after large turns."""
    turn = np.abs(np.diff(_axis(h, "C"), prepend=0.0))
    big = np.maximum.accumulate(np.where(turn > 1e-6, np.arange(len(h)), 0))
    return turn[big] ** 1.5 * h.normal[:, 2]


def worn_screw(h: History, rng: np.random.Generator) -> Array:
    """Lost motion that is largest in the middle of the travel, where the screw is worn."""
    i = int(rng.integers(3))
    return np.exp(-((_scaled(h, "XYZ"[i]) / 0.35) ** 2)) * h.direction[:, h.column("XYZ"[i])] * h.normal[:, i]


def one_sided(h: History, rng: np.random.Generator) -> Array:
    """Towards one side the column gives way, the more the higher it stands."""
    i = int(rng.integers(2))
    against = h.direction[:, h.column("XYZ"[i])] < 0
    return against * (1 + _scaled(h, "Z")) ** 2 * np.abs(h.normal[:, i])


def turned_clamp(h: History, rng: np.random.Generator) -> Array:
    """One indexation is clamped at a wrong angle."""
    letter = str(rng.choice(["B", "C"]))
    return (h.indexation == _one(h, rng)) * lever(h, letter)


def moved_clamp(h: History, rng: np.random.Generator) -> Array:
    """One indexation is clamped beside its place."""
    return (h.indexation == _one(h, rng)) * _towards(h, rng)


def _one(h: History, rng: np.random.Generator) -> int:
    count = np.bincount(h.indexation)
    return int(rng.choice(np.flatnonzero(count >= 5)))


# What a person would have to look at: letters of axes, and the words below.
TIME, PROBE, HISTORY, DIRECTION, MOMENT = "time", "probe direction", "history", "direction", "indexation"


@dataclass(frozen=True)
class Outside:
    """A kind, and the covariates that it is made of."""

    make: Kind
    covariates: tuple[str, ...]


KINDS: Mapping[str, Outside] = {
    kind.__name__: Outside(kind, covariates)
    for kind, covariates in (
        (overshoot, (TIME,)),
        (open_door, (TIME,)),
        (cooler, (TIME,)),
        (late_drift, (TIME,)),
        (chirp, (TIME,)),
        (table_cycle, (TIME,)),
        (bending_column, (TIME, "Z")),
        (warming_rotary, (TIME, "B")),
        (wearing_backlash, (TIME, DIRECTION)),
        (breathing_scale, (TIME, "X", "Y", "Z")),
        (floating_slide, (TIME, HISTORY, "X", "Y", "Z")),
        (worn_guide, ("X", "Y", "Z")),
        (magnetised_scale, ("X", "Y", "Z")),
        (twisted_bed, ("X", "Y", "Z")),
        (ripple, ("X", "Y")),
        (leaning_ram, ("Y", "B")),
        (worm_wheel, ("B", "C")),
        (loose_table, ("C",)),
        (tilted_load, ("B", "C")),
        (cable_drag, ("C",)),
        (dead_sector, (PROBE,)),
        (slanting_trigger, (PROBE,)),
        (spindle_seat, ("S", "Y")),
        (stick_slip, (HISTORY, DIRECTION, "X", "Y", "Z")),
        (relaxing_clamp, (HISTORY, TIME)),
        (swinging_table, (HISTORY,)),
        (worn_screw, (DIRECTION, "X", "Y", "Z")),
        (one_sided, (DIRECTION, "X", "Y", "Z")),
        (turned_clamp, (MOMENT,)),
        (moved_clamp, (MOMENT,)),
    )
}


def _noise(make: Callable[[int, np.random.Generator], Array]) -> Kind:
    return lambda h, rng: make(len(h), rng)


def _pink(n: int, rng: np.random.Generator) -> Array:
    spectrum = np.fft.rfft(rng.normal(size=4 * n))
    spectrum[1:] /= np.sqrt(np.arange(1, len(spectrum)))
    spectrum[0] = 0
    wave = np.fft.irfft(spectrum)[:n]
    return np.asarray(wave / wave.std())


def _ar1(n: int, rng: np.random.Generator, memory: float = 0.6) -> Array:
    out = rng.normal(size=n)
    for i in range(1, n):
        out[i] = memory * out[i - 1] + np.sqrt(1 - memory**2) * out[i]
    return out


def _spread(h: History, rng: np.random.Generator, group: NDArray[np.int64]) -> Array:
    """Noise of another size for each member of a group: 1 for most, 3 for a quarter of them."""
    size = np.where(rng.random(int(group.max()) + 1) < 0.25, 3.0, 1.0)
    return np.asarray(size[group] * rng.normal(size=len(h)))


def _walk(h: History, rng: np.random.Generator) -> Array:
    steps = rng.normal(size=(len(h), 3)) * np.sqrt(np.diff(h.time, prepend=h.time[0]))[:, None]
    walk = np.cumsum(steps, axis=0) / np.sqrt(np.ptp(h.time))
    return np.asarray(rng.normal(size=len(h)) + 2.0 * np.einsum("ni,ni->n", walk, h.normal))


NULLS: Mapping[str, Kind] = {  # in units of the standard deviation of a touch
    "white": _noise(lambda n, rng: rng.normal(size=n)),
    "walk": _walk,
    "t(3)": _noise(lambda n, rng: rng.standard_t(3, size=n) / np.sqrt(3)),
    "Laplace": _noise(lambda n, rng: rng.laplace(size=n) / np.sqrt(2)),
    "AR(1)": _noise(_ar1),
    "pink": _noise(_pink),
    "spread by facet": lambda h, rng: _spread(h, rng, np.unique(h.facet, return_inverse=True)[1]),
    "spread by direction": lambda h, rng: _spread(
        h, rng, np.argmax(np.abs(h.normal), axis=1) + 3 * (h.normal[np.arange(len(h)), np.argmax(np.abs(h.normal), axis=1)] > 0)
    ),
    "spread by time": lambda h, rng: (1 + 2 * _part(h)) * rng.normal(size=len(h)),
    "spread by indexation": lambda h, rng: _spread(h, rng, h.indexation),
    "seating": lambda h, rng: rng.normal(size=len(h))
    + 1.2 * np.einsum("ni,ni->n", rng.normal(size=(int(h.indexation.max()) + 1, 3))[h.indexation], h.normal),
}
