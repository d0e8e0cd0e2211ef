"""Eleven kinds of causes that no catalogue holds, and one that has become one since (`hot_screw`, now `screw_heat`).

python -m support.annex 900000 out.jsonl [machines]     appended to the file; then its table, without kinds

What a kind hides is (n,) by which a touch reads early, in any unit; beside `support.judge`, `support.workshop`, `support.hall`.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np

from sim_controller.effects import History, lever
from support.effect_parts import unit

from .judge import LINEAR, MACHINES, TILT, TURN, Axes, Kinds, planned, recorded, table, tried
from .outside import DIRECTION, HISTORY, PROBE, TIME, Array, _axis, _part, _scaled, _towards
from .workshop import FACET, PLACE

Rng = np.random.Generator


def _used(way: Array, step: Array, tau: float) -> Array:
    """(n,) way before each touch, (n,) s between touches, time constant → (n,) heat of it: it comes with the way and goes."""
    heat, state = np.zeros(len(way)), 0.0
    for i, (more, gone) in enumerate(zip(way, step, strict=True)):
        state = state * np.exp(-gone / tau) + more
        heat[i] = state
    return heat


def _step(h: History) -> Array:
    return np.asarray(np.diff(h.time, prepend=h.time[:1]))


def _way(h: History, letter: str) -> Array:
    q = _axis(h, letter)
    return np.abs(np.diff(q, prepend=q[:1]))


def stiff_hose(h: History, rng: Rng, a: Axes) -> Array:
    """A hose to the tilting axis stiffens as it bends: it pulls one axis by the product of the tilt and of a place."""
    i = int(rng.integers(3))
    bent = 1 - np.cos(_axis(h, a.tilt) - rng.uniform(-0.3, 0.3))
    return bent * (1 + _scaled(h, "XYZ"[i])) ** 2 * h.normal[:, int(rng.integers(3))]


def ringing_after_rest(h: History, rng: Rng, a: Axes) -> Array:
    """A column swings after each rapid: the touch comes on one side of the swing or on the other, by the time since the last."""
    gap = np.diff(h.time, prepend=h.time[0] - 60.0)
    u = gap / np.median(gap)
    return np.cos(2 * np.pi * (u * rng.uniform(0.3, 0.7) + rng.uniform())) * np.exp(-u / rng.uniform(1.5, 4)) * _towards(h, rng)


def wave_through_column(h: History, rng: Rng, a: Axes) -> Array:
    """A wave of heat climbs the column: what is high leans later than what is low."""
    phase = rng.uniform(1.0, 2.0) * _part(h) - rng.uniform(0.15, 0.3) * _scaled(h, a.up) + rng.uniform()
    return np.sin(2 * np.pi * phase) * h.normal[:, int(rng.choice([i for i in range(3) if "XYZ"[i] != a.up]))]


def worn_sector(h: History, rng: Rng, a: Axes) -> Array:
    """The worm wheel is worn in the sector where all work is done: only there the angle is wrong."""
    c = _axis(h, a.turn)
    off = np.angle(np.exp(1j * (c - rng.choice(np.unique(np.round(c, 4))))))
    return np.exp(-((off / rng.uniform(0.3, 0.7)) ** 2)) * lever(h, a.turn)


def sinking_foot(h: History, rng: Rng, a: Axes) -> Array:
    """A foot sinks while the load stands over it, and comes back while it does not."""
    i = int(rng.choice([k for k in range(3) if "XYZ"[k] != a.up]))
    x, tau = _scaled(h, "XYZ"[i]), float(np.ptp(h.time)) * rng.uniform(0.05, 0.15)
    sunk, state = np.zeros(len(h)), 0.0
    for k, (over, step) in enumerate(zip(x, _step(h), strict=True)):
        state += (over - state) * (1 - np.exp(-step / tau))
        sunk[k] = state
    return sunk * h.normal[:, "XYZ".index(a.up)]


def forgetful_probe(h: History, rng: Rng, a: Axes) -> Array:
    """The probe sits askew after a touch, on the side of it, and creeps back until the next one."""
    gap = np.diff(h.time, prepend=h.time[0] - 60.0)
    before = np.vstack([h.normal_spindle[:1], h.normal_spindle[:-1]])
    return np.einsum("ni,ni->n", before, h.normal_spindle) * np.exp(-gap / (np.median(gap) * rng.uniform(0.5, 1.0)))


def second_slab(h: History, rng: Rng, a: Axes) -> Array:
    """Beyond a place the bed stands on another slab of the floor: what is high leans from there on."""
    i = int(rng.choice([k for k in range(3) if "XYZ"[k] != a.up]))
    x = _scaled(h, "XYZ"[i])
    return (x > rng.uniform(-0.4, 0.4)) * (1.5 + _scaled(h, a.up)) * h.normal[:, i]


def bending_plate(h: History, rng: Rng, a: Axes) -> Array:
    """The plate bends under its weight: its middle comes down where the tilt leaves it flat, its rim stays."""
    out = np.linalg.norm(h.point - h.point.mean(axis=0), axis=1)
    return np.cos(_axis(h, a.tilt) - rng.uniform(-0.2, 0.2)) * (1 - (out / out.max()) ** 2) * h.normal_table[:, 2]


def hot_screw(h: History, rng: Rng, a: Axes) -> Array:
    """The screw of an axis warms with the way that it goes and cools: its scale is wrong in proportion, from its fixed end."""
    i = int(rng.integers(3))
    heat = _used(_way(h, "XYZ"[i]), _step(h), float(np.ptp(h.time)) * rng.uniform(0.05, 0.15))
    return heat * (1 + _scaled(h, "XYZ"[i])) * h.normal[:, i]


def dying_battery(h: History, rng: Rng, a: Axes) -> Array:
    """The battery of the probe dies: it answers later and later, to all sides alike, and ever faster."""
    return (1.02 - _part(h)) ** -rng.uniform(0.4, 0.9)


def loaded_bearing(h: History, rng: Rng, a: Axes) -> Array:
    """The rollers of the turntable run out by twice the angle, the more the tilt loads them."""
    load = np.abs(np.sin(_axis(h, a.tilt))) + rng.uniform(0, 0.2)
    towards = h.normal_table @ unit((*rng.normal(size=2), 0.0))
    return load * np.cos(2 * _axis(h, a.turn) + rng.uniform(0, 6)) * towards


def shaken_neighbour(h: History, rng: Rng, a: Axes) -> Array:
    """A long rapid of one axis throws another one off its place, for a touch: the longer, the more, up to a limit."""
    i, j = rng.choice(3, 2, replace=False)
    q = _axis(h, "XYZ"[i])
    way = np.diff(q, prepend=q[:1]) / rng.uniform(40, 120)
    return np.tanh(way) * h.normal[:, j]


NAMED: Kinds = {"hot_screw": (hot_screw, (HISTORY, TIME, *LINEAR))}
KINDS: Kinds = {
    kind.__name__: (kind, covariates)
    for kind, covariates in (
        (stiff_hose, (TILT, *LINEAR)),
        (ringing_after_rest, (HISTORY, TIME)),
        (wave_through_column, (TIME, *LINEAR)),
        (worn_sector, (TURN,)),
        (sinking_foot, (HISTORY, TIME, *LINEAR)),
        (forgetful_probe, (HISTORY, PROBE, DIRECTION)),
        (second_slab, LINEAR),
        (bending_plate, (TILT, PLACE, FACET, DIRECTION)),
        (dying_battery, (TIME,)),
        (loaded_bearing, (TILT, TURN, DIRECTION)),
        (shaken_neighbour, (HISTORY, DIRECTION)),
    )
}


if __name__ == "__main__":
    machines = sys.argv[3].split(",") if len(sys.argv) > 3 else MACHINES
    for one in planned(int(sys.argv[1]), 1, machines=machines, chosen=KINDS, kinds=KINDS):
        with Path(sys.argv[2]).open("a", encoding="utf-8") as out:
            out.write(json.dumps(asdict(tried(*one, kinds=KINDS))) + "\n")
    print("\n".join(table(recorded(Path(sys.argv[2])), {})))
