"""Nine more kinds of causes that no catalogue holds, written after what changes a name's size was told with its rivals; rates only.

python -m support.foundry 900000 out.jsonl [machines]     appended to the file; then its table, without kinds

What a kind hides is (n,) by which a touch reads early, in any unit; beside `support.judge`, `workshop`, `hall` and `annex`.
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
from .outside import DIRECTION, HISTORY, PROBE, TIME, Array, _axis, _part, _scaled

Rng = np.random.Generator


def _level(rng: Rng, a: Axes) -> int:
    """→ one of the axes that lie."""
    return int(rng.choice([k for k in range(3) if "XYZ"[k] != a.up]))


def _rested(h: History, letter: str) -> Array:
    """(n,) s since the axis was last moved."""
    q = _axis(h, letter)
    last = np.maximum.accumulate(np.where(np.abs(np.diff(q, prepend=q[:1])) > 1e-6, np.arange(len(h)), 0))
    return np.asarray(h.time - h.time[last])


def tired_clamp(h: History, rng: Rng, a: Axes) -> Array:
    """The clamp of the turntable loses pressure after it closed; the tilt lets the load pull the table round."""
    rested = _rested(h, a.turn)
    lost = 1 - np.exp(-rested / (np.median(rested) * rng.uniform(0.7, 2.0)))
    return lost * np.sin(_axis(h, a.tilt) + rng.uniform(-0.2, 0.2)) * lever(h, a.turn)


def joined_scale(h: History, rng: Rng, a: Axes) -> Array:
    """A magnetic scale is joined of two pieces: a gap where they meet, and another pitch behind it."""
    i = int(rng.integers(3))
    behind = _scaled(h, "XYZ"[i]) - rng.uniform(-0.5, 0.5)
    return (behind > 0) * (rng.uniform(0.3, 0.8) + rng.choice([-1, 1]) * behind) * h.normal[:, i]


def quill_under_tilt(h: History, rng: Rng, a: Axes) -> Array:
    """What is carried far out hangs by the square of how far, and less where the tilt brings its weight back over the bed."""
    i = _level(rng, a)
    out = (1 + rng.choice([-1, 1]) * _scaled(h, "XYZ"[i])) ** 2
    return out * np.cos(_axis(h, a.tilt) - rng.uniform(0.3, 0.6)) * h.normal[:, "XYZ".index(a.up)]


def tired_servo(h: History, rng: Rng, a: Axes) -> Array:
    """An axis is not yet there: what is left of its way goes away with the time since the touch before."""
    i = int(rng.integers(3))
    q, gap = _axis(h, "XYZ"[i]), np.diff(h.time, prepend=h.time[0] - 60.0)
    return np.diff(q, prepend=q[:1]) * np.exp(-gap / (np.median(gap) * rng.uniform(0.4, 0.8))) * h.normal[:, i]


def drying_gib(h: History, rng: Rng, a: Axes) -> Array:
    """A gib runs dry: the slide turns in its play by the side from which it came, more and more."""
    i = _level(rng, a)
    turned = h.direction[:, h.column("XYZ"[i])] * _part(h) ** rng.uniform(0.8, 2.0)
    return turned * (1.3 + _scaled(h, a.up)) * h.normal[:, i]


def loosening_stylus(h: History, rng: Rng, a: Axes) -> Array:
    """The stylus comes loose touch by touch: it gives way to one side of the spindle, and to that side only."""
    give = np.maximum(h.normal_spindle @ unit((*rng.normal(size=2), 0.0)), 0)
    return give * _part(h) ** rng.uniform(0.7, 1.5)


def dragging_seal(h: History, rng: Rng, a: Axes) -> Array:
    """The seal of the turntable drags it back after a turn, by the side from which it came, and lets go within minutes."""
    rested = _rested(h, a.turn)
    side = h.direction[:, h.column(a.turn)]
    return side * np.exp(-rested / (np.median(rested) * rng.uniform(0.6, 1.5))) * lever(h, a.turn)


def pumped_up(h: History, rng: Rng, a: Axes) -> Array:
    """A pump fills the accumulator of the counterbalance at once, when it is empty; the head comes down by and by between."""
    return ((_part(h) * rng.uniform(3, 9) + rng.uniform()) % 1.0) * h.normal[:, "XYZ".index(a.up)]


def chain_of_weight(h: History, rng: Rng, a: Axes) -> Array:
    """The chain of a counterweight runs over a wheel with few teeth: waves of the height, the larger the longer the chain."""
    z = _scaled(h, a.up)
    waves = np.sin(np.pi * z * rng.uniform(2.5, 5.0) + rng.uniform(0, 6))
    return waves * (1 + rng.choice([-1, 1]) * z) * h.normal[:, _level(rng, a)]


KINDS: Kinds = {
    kind.__name__: (kind, covariates)
    for kind, covariates in (
        (tired_clamp, (HISTORY, TIME, TILT, TURN)),
        (joined_scale, LINEAR),
        (quill_under_tilt, (TILT, *LINEAR)),
        (tired_servo, (HISTORY, TIME, DIRECTION)),
        (drying_gib, (DIRECTION, TIME, *LINEAR)),
        (loosening_stylus, (PROBE, DIRECTION, TIME)),
        (dragging_seal, (DIRECTION, HISTORY, TIME, TURN)),
        (pumped_up, (TIME,)),
        (chain_of_weight, LINEAR),
    )
}


if __name__ == "__main__":
    machines = sys.argv[3].split(",") if len(sys.argv) > 3 else MACHINES
    for one in planned(int(sys.argv[1]), 1, machines=machines, chosen=KINDS, kinds=KINDS):
        with Path(sys.argv[2]).open("a", encoding="utf-8") as out:
            out.write(json.dumps(asdict(tried(*one, kinds=KINDS))) + "\n")
    print("\n".join(table(recorded(Path(sys.argv[2])), {})))
