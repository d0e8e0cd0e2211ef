"""Twenty-two more kinds of causes that no catalogue holds, as a service engineer meets them: a judge beside `support.judge`.

python -m support.workshop first 800000 out.jsonl [seeds] [kinds] [machines]     FIRST or HELD; appended; then its table

Written before the diagnosis was read. FIRST may be looked at while the diagnosis is mended; HELD is for rates only.
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
from .outside import DIRECTION, HISTORY, PROBE, TIME, Array, _axis, _part, _scaled, _since, _towards

PLACE, FACET = "place", "facet"  # on the table


def _across(h: History) -> Array:
    """→ (n,) 0 … 1, how far a touch is from the direction of the spindle."""
    return np.asarray(np.hypot(*h.normal_spindle[:, :2].T))


def _after(h: History, rng: np.random.Generator, low: float = 0.2, high: float = 0.6) -> Array:
    """→ (n,) part of the run since a moment, 0 before it."""
    return np.maximum(_part(h) - rng.uniform(low, high), 0)


def lagging_column(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The gate is opened; the column follows the cold with its time constant and leans, in proportion to height."""
    side = h.normal[:, int(rng.integers(3))]
    return (1 - np.exp(-_after(h, rng) / rng.uniform(0.1, 0.4))) * (1.3 + _scaled(h, a.up)) * side


def dragging_chain(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """At one end of an axis the cable chain is folded tight: it drags, and more when it is pushed than when it is pulled."""
    i, j = rng.choice(3, 2, replace=False)
    x = _scaled(h, "XYZ"[i]) * rng.choice([-1, 1])
    return np.maximum(x - rng.uniform(-0.3, 0.3), 0) ** 1.5 * (1 + 0.5 * h.direction[:, h.column("XYZ"[i])]) * h.normal[:, j]


def polygon_of_a_chain(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The chain of the counterweight runs over a sprocket: height errs by scallops of one pitch, more with a long chain."""
    scallop = np.abs(np.sin(np.pi * (_axis(h, a.up) + rng.uniform(0, 40)) / rng.uniform(30, 60)))
    return scallop * (1.5 + _scaled(h, a.up)) * h.normal[:, "XYZ".index(a.up)]


def dirty_glass(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """A drop of oil on a glass scale: over 15 mm of travel it reads short by an amount that dips twice."""
    i = int(rng.integers(3))
    q = _axis(h, "XYZ"[i])
    middle = float(rng.choice(q))
    return np.where(np.abs(q - middle) < 7.5, 1 + 0.5 * np.cos(4 * np.pi * (q - middle) / 15), 0) * h.normal[:, i]


def releasing_clamp(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """A clamp of the piece lets go slowly from a moment on, quickly first and then ever slower."""
    return np.log1p(_after(h, rng, 0.1, 0.5) / rng.uniform(0.01, 0.05)) * _towards(h, rng, "table")


def worm_under_load(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The worm of the turning axis errs once in each of its turns, and as far as the tilted load presses on it."""
    worm = rng.choice([5, 7, 10])
    return (
        np.sin(worm * _axis(h, a.turn) + rng.uniform(0, 6)) * np.sin(_axis(h, a.tilt) + rng.uniform(-0.3, 0.3)) * lever(h, a.turn)
    )


def overhanging_load(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """A load beside the middle of the table twists the tilting axis by its weight, as the table brings it round."""
    return np.cos(_axis(h, a.tilt)) * np.cos(_axis(h, a.turn) + rng.uniform(0, 6)) * lever(h, a.tilt)


def turning_probe(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The drive of the spindle warms and lets the probe turn: its runout shows in ever other directions."""
    azimuth = np.arctan2(h.normal_spindle[:, 1], h.normal_spindle[:, 0])
    turned = rng.choice([-1, 1]) * rng.uniform(1.5, 3) * _part(h) ** 1.5
    phase = rng.uniform(0, 6)
    return (np.cos(azimuth - phase - turned) - np.cos(azimuth - phase)) * _across(h)


def chilling(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The chiller runs for 90 s of every 7 min: what it cools falls quickly and comes back slowly."""
    since = (h.time - h.time[0] + rng.uniform(0, 420)) % 420
    cold = np.where(since < 90, 1 - np.exp(-since / 60), (1 - np.exp(-1.5)) * np.exp(-(since - 90) / 130))
    return cold * _towards(h, rng)


def drying_guide(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The oil film of a guide is wiped away by short moves and comes back with long ones: so does the lost motion."""
    i = int(rng.integers(3))
    way, dry, state, length = np.abs(h.move[:, h.column("XYZ"[i])]), np.zeros(len(h)), 0.0, rng.uniform(30, 90)
    for row, gone in enumerate(way):
        state = state * np.exp(-gone / length) + (0.3 if gone < 20 else 0.0)
        dry[row] = state
    return dry * h.direction[:, h.column("XYZ"[i])] * h.normal[:, i]


def loosening_bolt(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """One bolt of the table of facets loosens: it turns a little more about the other one with each indexation."""
    about = h.point[:, :2] - rng.choice(h.point[:, :2])
    turn = about[:, 0] * h.normal_table[:, 1] - about[:, 1] * h.normal_table[:, 0]
    begins = rng.uniform(0.2, 0.6) * h.indexation.max()
    return np.maximum(h.indexation - begins, 0) ** 0.7 * turn


def low_battery(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The battery of the probe runs down: it answers later and later, to the side more than along the spindle."""
    return _part(h) ** rng.uniform(2, 5) * (0.3 + _across(h) ** 2)


FIRST: Kinds = {
    kind.__name__: (kind, covariates)
    for kind, covariates in (
        (lagging_column, (TIME, *LINEAR)),
        (dragging_chain, (DIRECTION, *LINEAR)),
        (polygon_of_a_chain, LINEAR),
        (dirty_glass, LINEAR),
        (releasing_clamp, (TIME,)),
        (worm_under_load, (TILT, TURN)),
        (overhanging_load, (TILT, TURN)),
        (turning_probe, (TIME, PROBE, DIRECTION)),
        (chilling, (TIME,)),
        (drying_guide, (HISTORY, DIRECTION, *LINEAR)),
        (loosening_bolt, (TIME, HISTORY, PLACE, FACET)),
        (low_battery, (TIME, PROBE, DIRECTION)),
    )
}


def creeping_back(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """Something is knocked at a moment, and creeps back."""
    after = _part(h) - rng.uniform(0.2, 0.6)
    return np.where(after > 0, np.exp(-after / rng.uniform(0.05, 0.15)), 0) * _towards(h, rng)


def pulling_brake(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """The brake of the tilting axis pulls it off its place as it closes, to the side that it came from, and more when tilted."""
    return h.direction[:, h.column(a.tilt)] * (0.6 + np.abs(np.sin(_axis(h, a.tilt)))) * lever(h, a.tilt)


def racking_gantry(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """A gantry racks: what hangs at one side of it lags behind, to the other side when it goes back."""
    i, j = rng.choice(3, 2, replace=False)
    return (_scaled(h, "XYZ"[j]) + rng.uniform(-0.5, 0.5)) * h.direction[:, h.column("XYZ"[i])] * h.normal[:, i]


def wet_faces(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """Coolant was sprayed at a moment: what faces up is cold then, and warms again."""
    after = _part(h) - rng.uniform(0.1, 0.5)
    up = np.maximum(h.normal[:, "XYZ".index(a.up)] + rng.uniform(0.1, 0.4), 0)
    return np.where(after > 0, np.exp(-after / rng.uniform(0.1, 0.3)), 0) * up


def wobbling_screw(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """A bent screw: once in each turn it errs, least in the middle between its bearings and with a change of side."""
    i = int(rng.integers(3))
    lead = rng.choice([16, 20, 25, 32])
    return np.sin(2 * np.pi * _axis(h, "XYZ"[i]) / lead + rng.uniform(0, 6)) * _scaled(h, "XYZ"[i]) * h.normal[:, i]


def overridden_feed(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """For a part of the test somebody turns the override down: the probe overruns less, to the side above all."""
    begin = rng.uniform(0.15, 0.6)
    t = _part(h)
    return ((t > begin) & (t < begin + rng.uniform(0.15, 0.3))) * (0.2 + _across(h))


def growing_post(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """A post of the table of facets stands in the sun: what is near it grows away from the middle."""
    post = rng.choice(h.point[:, :2])
    near = np.exp(-np.sum((h.point[:, :2] - post) ** 2, axis=1) / rng.uniform(80, 160) ** 2)
    return _part(h) ** rng.uniform(0.6, 1.5) * near * (h.normal_table @ unit((*post, 40.0)))


def long_way_overshoot(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """After ways of more than 60 mm an axis has not yet settled when the probe touches; after shorter ones it has."""
    i = int(rng.integers(3))
    way = h.position[:, h.column("XYZ"[i])] - np.roll(h.position[:, h.column("XYZ"[i])], 1)
    far = np.maximum(np.abs(way) - 60, 0)
    return np.sign(way) * np.sqrt(far) * h.normal[:, int(rng.integers(3))]


def settling_in(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """After each turn of the table the tilted body sinks for a while, the deeper the more it is tilted."""
    return (1 - np.exp(-_since(h) / rng.uniform(10, 30))) * np.sin(_axis(h, a.tilt)) * h.normal[:, "XYZ".index(a.up)]


def two_bearings(h: History, rng: np.random.Generator, a: Axes) -> Array:
    """Beyond a height another bearing carries the ram: it leans by its place beyond, as the turning axis has its flat side."""
    beyond = np.maximum(_scaled(h, a.up) - rng.uniform(-0.3, 0.3), 0)
    return beyond * np.cos(2 * _axis(h, a.turn) + rng.uniform(0, 6)) * h.normal[:, int(rng.integers(3))]


HELD: Kinds = {
    kind.__name__: (kind, covariates)
    for kind, covariates in (
        (creeping_back, (TIME,)),
        (pulling_brake, (DIRECTION, TILT)),
        (racking_gantry, (DIRECTION, *LINEAR)),
        (wet_faces, (TIME, DIRECTION)),
        (wobbling_screw, LINEAR),
        (overridden_feed, (TIME, PROBE, DIRECTION)),
        (growing_post, (TIME, PLACE, FACET)),
        (long_way_overshoot, (HISTORY, DIRECTION, *LINEAR)),
        (settling_in, (HISTORY, TIME, TILT)),
        (two_bearings, (TURN, *LINEAR)),
    )
}


if __name__ == "__main__":
    kinds = {"first": FIRST, "held": HELD}[sys.argv[1]]
    start, target = int(sys.argv[2]), Path(sys.argv[3])
    seeds = int(sys.argv[4]) if len(sys.argv) > 4 else 1
    chosen = sys.argv[5].split(",") if len(sys.argv) > 5 else list(kinds)
    machines = sys.argv[6].split(",") if len(sys.argv) > 6 else MACHINES
    for one in planned(start, seeds, chosen, machines, kinds=kinds):
        with target.open("a", encoding="utf-8") as out:
            out.write(json.dumps(asdict(tried(*one, kinds=kinds))) + "\n")
    print("\n".join(table(recorded(target), kinds)))
