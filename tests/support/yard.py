"""Six kinds of causes that no catalogue holds, written after the diagnosis was mended: rates only.

python -m support.yard 950000 out.jsonl [machines]     appended to the file; then its table, without kinds

What a kind hides is (n,) by which a touch reads early, in any unit; beside `support.judge`, `workshop`, `hall` and `annex`.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np

from sim_controller.effects import History, lever

from .judge import LINEAR, MACHINES, TILT, TURN, Axes, Kinds, planned, recorded, table, tried
from .outside import DIRECTION, PROBE, TIME, Array, _axis, _part, _scaled, _towards

Rng = np.random.Generator


def bed_on_three_feet(h: History, rng: Rng, a: Axes) -> Array:
    """The bed stands on three feet: where the load comes over the free corner, it goes down there."""
    i, j = (k for k in range(3) if "XYZ"[k] != a.up)
    over = rng.choice([-1, 1]) * _scaled(h, "XYZ"[i]) + rng.choice([-1, 1]) * _scaled(h, "XYZ"[j])
    return np.maximum(over - rng.uniform(-0.3, 0.3), 0) * h.normal[:, "XYZ".index(a.up)]


def cooling_nose(h: History, rng: Rng, a: Axes) -> Array:
    """The spindle was warm: its nose shrinks first, and then the housing that carries it comes after."""
    u = _part(h)
    return (np.exp(-u / rng.uniform(0.05, 0.12)) - np.exp(-u / rng.uniform(0.4, 0.8))) * h.normal_spindle[:, 2]


def far_receiver(h: History, rng: Rng, a: Axes) -> Array:
    """The radio of the probe has to repeat itself far from the receiver in a corner: all touches come late there."""
    corner = rng.choice([-1.2, 1.2], 3)
    far = np.sqrt(sum((_scaled(h, "XYZ"[i]) - corner[i]) ** 2 for i in range(3)))
    return far ** rng.uniform(2, 4)


def unbalanced_piece(h: History, rng: Rng, a: Axes) -> Array:
    """The piece lies beside the axis: tilted, its weight turns the belt of the table, one way or the other by the angle."""
    return np.sin(_axis(h, a.tilt)) * np.sin(_axis(h, a.turn) + rng.uniform(0, 6)) * lever(h, a.turn)


def oiled_ways(h: History, rng: Rng, a: Axes) -> Array:
    """A pump oils the ways every few minutes: the slide floats, and comes down again until the next time."""
    since = (_part(h) * rng.uniform(3, 7) + rng.uniform()) % 1
    return np.exp(-since / rng.uniform(0.15, 0.4)) * _towards(h, rng)


def build_up(h: History, rng: Rng, a: Axes) -> Array:
    """The ball takes aluminium where it touches: each side of it by as many touches as it has had."""
    side = h.normal_spindle
    return np.array([np.sum(np.exp(6 * (side[:i] @ side[i] - 1))) for i in range(len(h))])


KINDS: Kinds = {
    kind.__name__: (kind, covariates)
    for kind, covariates in (
        (bed_on_three_feet, LINEAR),
        (cooling_nose, (TIME, PROBE, DIRECTION)),
        (far_receiver, LINEAR),
        (unbalanced_piece, (TILT, TURN)),
        (oiled_ways, (TIME,)),
        (build_up, (TIME, PROBE, DIRECTION)),
    )
}


if __name__ == "__main__":
    machines = sys.argv[3].split(",") if len(sys.argv) > 3 else MACHINES
    for one in planned(int(sys.argv[1]), 1, machines=machines, chosen=KINDS, kinds=KINDS):
        with Path(sys.argv[2]).open("a", encoding="utf-8") as out:
            out.write(json.dumps(asdict(tried(*one, kinds=KINDS))) + "\n")
    print("\n".join(table(recorded(Path(sys.argv[2])), {})))
