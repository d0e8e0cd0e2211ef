"""Twenty more kinds of causes that no catalogue holds, as they happen in a hall: beside `support.judge` and `support.workshop`.

python -m support.hall seen 800000 out.jsonl [machines]     SEEN or HELD; appended; then its table

SEEN were looked at while the diagnosis was mended; HELD were written with them and were not. What a kind hides is (n,) by which
a touch reads early, in any unit.
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
from .workshop import FACET, PLACE, _across

Rng = np.random.Generator


def _azimuth(h: History) -> Array:
    return np.asarray(np.arctan2(h.normal_spindle[:, 1], h.normal_spindle[:, 0]))


def _level(rng: Rng) -> Array:
    """→ (3,) any direction in the plane of the table."""
    return unit((*rng.normal(size=2), 0.0))


def _filled(rise: Array, step: Array, tau: float, most: float = np.inf) -> Array:
    """(n,) what comes with each touch, (n,) time between them, time constant → (n,) what is there: it goes away with time."""
    found, state = np.zeros(len(rise)), 0.0
    for i, (more, gone) in enumerate(zip(rise, step, strict=True)):
        state = min(state * np.exp(-gone / tau) + more, most)
        found[i] = state
    return found


def hydrostatic_film(h: History, rng: Rng, a: Axes) -> Array:
    """The oil film of a hydrostatic turntable is thinner where the tilt brings load on it, and thins as the oil warms."""
    load = 1.4 + np.cos(_axis(h, a.tilt) + rng.uniform(-0.4, 0.4))
    return load ** (-1 / 3) * (1 - rng.uniform(0.5, 0.9) * _part(h)) * h.normal_table[:, 2]


def greasy_screw(h: History, rng: Rng, a: Axes) -> Array:
    """Bands of old grease on a screw: at a few places it pushes the nut aside."""
    i = int(rng.integers(3))
    q = _scaled(h, "XYZ"[i])
    bands = np.zeros(len(h))
    for c in rng.uniform(-0.9, 0.9, 3):
        bands += rng.choice([-1, 1]) * rng.uniform(0.4, 1) * np.exp(-(((q - c) / rng.uniform(0.12, 0.3)) ** 2))
    return bands * h.normal[:, i]


def sticking_tilt(h: History, rng: Rng, a: Axes) -> Array:
    """A tilting axis with a counterweight sticks where the load is out of balance: it stops short of where it came from."""
    torque = np.abs(np.sin(_axis(h, a.tilt) - rng.uniform(-0.5, 0.5)))
    return h.direction[:, h.column(a.tilt)] * np.maximum(torque - rng.uniform(0.1, 0.4), 0) * lever(h, a.tilt)


def approach_lobing(h: History, rng: Rng, a: Axes) -> Array:
    """Lobes of the probe depend on whether the vertical axis came down or up before the touch."""
    d = h.direction[:, h.column(a.up)]
    return np.cos(3 * (_azimuth(h) - rng.uniform(0, 2))) * (1 + rng.uniform(0.6, 1) * d) * _across(h)


def cloudy_sun(h: History, rng: Rng, a: Axes) -> Array:
    """Sun on a column, with clouds: its lean follows on and off with a time constant, in proportion to height."""
    t = _part(h)
    edges = np.sort(rng.uniform(0, 1, 5))
    on = np.searchsorted(edges, t) % 2
    tau, lean, state = rng.uniform(0.04, 0.12), np.zeros(len(h)), 0.0
    for i, (step, shines) in enumerate(zip(np.diff(t, prepend=0), on, strict=True)):
        state += (shines - state) * (1 - np.exp(-step / tau))
        lean[i] = state
    return lean * (1.4 + _scaled(h, a.up)) * h.normal[:, int(rng.choice([i for i in range(3) if "XYZ"[i] != a.up]))]


def cover_drag(h: History, rng: Rng, a: Axes) -> Array:
    """A telescopic way cover picks up one plate after the other: its drag rises in steps, against the motion."""
    i, j = rng.choice(3, 2, replace=False)
    q = _scaled(h, "XYZ"[i]) * rng.choice([-1, 1])
    steps = np.searchsorted(np.sort(rng.uniform(-0.9, 0.9, 4)), q)
    return (0.5 + steps) * h.direction[:, h.column("XYZ"[i])] * h.normal[:, j if rng.random() < 0.5 else i]


def interpolating_encoder(h: History, rng: Rng, a: Axes) -> Array:
    """The interpolation of an angle encoder errs by waves of the angle, which the filter of a long turn keeps longer."""
    c = _axis(h, a.turn)
    turned = np.abs(np.diff(c, prepend=c[:1]))
    last = np.maximum.accumulate(np.where(turned > 1e-6, np.arange(len(h)), 0))
    far = turned[last] / max(turned[last].max(), 1e-9)
    waves = np.sin(rng.choice([2, 3, 4, 6]) * c + rng.uniform(0, 6))
    return waves * far ** rng.uniform(0.5, 1.2) * lever(h, a.turn)


def two_orientations(h: History, rng: Rng, a: Axes) -> Array:
    """The orientation of the spindle catches at one of two places, by chance after each turn: the runout shows or does not.

    A new seat at every indexation, which the catalogue has: what is said of it does not count as false.
    """
    there = rng.integers(0, 2, int(h.indexation.max()) + 1)[h.indexation]
    return there * (h.normal_spindle[:, :2] @ _level(rng)[:2])


def knocks_of_changer(h: History, rng: Rng, a: Axes) -> Array:
    """The tool changer swings three times: each knocks the machine, which comes back within minutes."""
    t, knocked = _part(h), np.zeros(len(h))
    for m in np.sort(rng.uniform(0.1, 0.85, 3)):
        knocked += np.where(t > m, np.exp(-np.maximum(t - m, 0) / rng.uniform(0.02, 0.06)), 0)
    return knocked * _towards(h, rng)


def soaked_table(h: History, rng: Rng, a: Axes) -> Array:
    """Coolant soaks the table: from a moment on it shrinks along one direction only, with its time constant."""
    d = _level(rng)
    after = np.maximum(_part(h) - rng.uniform(0.1, 0.4), 0)
    return (1 - np.exp(-after / rng.uniform(0.1, 0.3))) * (h.point @ d) * (h.normal_table @ d)


SEEN: Kinds = {
    kind.__name__: (kind, covariates)
    for kind, covariates in (
        (hydrostatic_film, (TILT, TIME, DIRECTION)),
        (greasy_screw, LINEAR),
        (sticking_tilt, (DIRECTION, HISTORY, TILT)),
        (approach_lobing, (PROBE, DIRECTION, HISTORY, *LINEAR)),
        (cloudy_sun, (TIME, *LINEAR)),
        (cover_drag, (DIRECTION, *LINEAR)),
        (interpolating_encoder, (TURN, HISTORY)),
        (two_orientations, ("indexation", TIME, PROBE, DIRECTION)),
        (knocks_of_changer, (TIME,)),
        (soaked_table, (TIME, PLACE, FACET, DIRECTION)),
    )
}


def chipped_ball(h: History, rng: Rng, a: Axes) -> Array:
    """From a moment on a chip sticks to the ball, where a cone of directions touches."""
    v = h.normal_spindle[rng.integers(len(h))] + 0.15 * rng.normal(size=3)
    return (_part(h) > rng.uniform(0.2, 0.6)) * np.maximum(h.normal_spindle @ unit(tuple(v)) - rng.uniform(0.4, 0.7), 0)


def leaking_balance(h: History, rng: Rng, a: Axes) -> Array:
    """The counterbalance leaks while the vertical axis stands, and is filled as it goes up."""
    q, t = _axis(h, a.up), h.time
    up = np.maximum(np.diff(q, prepend=q[:1]), 0) / 100
    pressure = _filled(up, np.diff(t, prepend=t[:1]), np.ptp(t) * rng.uniform(0.02, 0.06), 2.0)
    return pressure * h.normal[:, "XYZ".index(a.up)]


def hall_cycle_square(h: History, rng: Rng, a: Axes) -> Array:
    """The bed bends with the cycle of the hall: two axes are no longer square, to and fro."""
    i, j = rng.choice(3, 2, replace=False)
    return np.sin(2 * np.pi * (rng.uniform(0.8, 1.8) * _part(h) + rng.uniform())) * _scaled(h, "XYZ"[i]) * h.normal[:, j]


def rail_joint(h: History, rng: Rng, a: Axes) -> Array:
    """At the joint of a rail the carriage pitches as it passes over: what is high above it is carried to and fro."""
    i = int(rng.choice([k for k in range(3) if "XYZ"[k] != a.up]))
    x = _scaled(h, "XYZ"[i])
    u = (x - rng.uniform(-0.6, 0.6)) / rng.uniform(0.15, 0.35)
    return u * np.exp(-(u**2) / 2) * (1.5 + _scaled(h, a.up)) * h.normal[:, i]


def biting_clamp(h: History, rng: Rng, a: Axes) -> Array:
    """The clamp of the turning axis bites on a toothed ring and pulls the table along, only from one side."""
    from_below = h.direction[:, h.column(a.turn)] > 0
    return from_below * np.sin(rng.choice([2, 3, 4, 5]) * _axis(h, a.turn) + rng.uniform(0, 6)) * lever(h, a.turn)


def heated_by_tilting(h: History, rng: Rng, a: Axes) -> Array:
    """The motor of the tilting axis heats what carries it with every degree that it turns; it cools between."""
    q, t = _axis(h, a.tilt), h.time
    heat = _filled(np.abs(np.diff(q, prepend=q[:1])), np.diff(t, prepend=t[:1]), np.ptp(t) * rng.uniform(0.05, 0.15))
    return heat * _towards(h, rng)


def sagging_crossrail(h: History, rng: Rng, a: Axes) -> Array:
    """A crossrail sags in its middle, the more the farther out the column carries it."""
    i, j = (int(k) for k in rng.permutation([k for k in range(3) if "XYZ"[k] != a.up]))
    x, y = _scaled(h, "XYZ"[i]), _scaled(h, "XYZ"[j])
    return (1 - (x - rng.uniform(-0.3, 0.3)) ** 2) * (1 + y) * h.normal[:, "XYZ".index(a.up)]


def rested_probe(h: History, rng: Rng, a: Axes) -> Array:
    """A probe that has rested answers earlier, to the side: by the logarithm of the time since the touch before."""
    gap = np.diff(h.time, prepend=h.time[0] - 60.0)
    return np.log(gap / np.median(gap)) * (0.3 + _across(h)) * (1 + 0.3 * np.cos(_azimuth(h) - rng.uniform(0, 6)))


def ratchet(h: History, rng: Rng, a: Axes) -> Array:
    """Each time the turning axis turns back the piece slips a little further on the table."""
    senses = np.sign(np.diff(_axis(h, a.turn), prepend=_axis(h, a.turn)[:1]))
    last, slips, slipped = 0.0, 0, np.zeros(len(h))
    for i, sense in enumerate(senses):
        slips += bool(sense and last and sense != last)
        last = sense or last
        slipped[i] = slips
    return slipped ** rng.uniform(0.6, 1) * lever(h, a.turn)


def floating_pallet(h: History, rng: Rng, a: Axes) -> Array:
    """Beyond a tilt one end of the pallet lifts: the farther out, the more."""
    q = _axis(h, a.tilt)
    used, d = np.unique(np.round(q, 4)), _level(rng)
    at = float(rng.choice((used[1:] + used[:-1]) / 2))
    out = (h.point @ d) - np.quantile(h.point @ d, 0.3)
    return (q > at) * np.maximum(out, 0) * h.normal_table[:, 2]


HELD: Kinds = {
    kind.__name__: (kind, covariates)
    for kind, covariates in (
        (chipped_ball, (TIME, PROBE, DIRECTION)),
        (leaking_balance, (HISTORY, TIME)),
        (hall_cycle_square, (TIME, *LINEAR)),
        (rail_joint, LINEAR),
        (biting_clamp, (DIRECTION, HISTORY, TURN)),
        (heated_by_tilting, (HISTORY, TIME, TILT)),
        (sagging_crossrail, LINEAR),
        (rested_probe, (HISTORY, TIME, PROBE, DIRECTION)),
        (ratchet, (HISTORY, TIME, TURN)),
        (floating_pallet, (TILT, PLACE, FACET, DIRECTION)),
    )
}


if __name__ == "__main__":
    kinds = {"seen": SEEN, "held": HELD}[sys.argv[1]]
    start, target = int(sys.argv[2]), Path(sys.argv[3])
    machines = sys.argv[4].split(",") if len(sys.argv) > 4 else MACHINES
    for one in planned(start, 1, kinds, machines, kinds=kinds):
        with target.open("a", encoding="utf-8") as out:
            out.write(json.dumps(asdict(tried(*one, kinds=kinds))) + "\n")
    print("\n".join(table(recorded(target), kinds)))
