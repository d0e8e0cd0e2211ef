"""Machines nobody built, for properties that every chain must have."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from tango_cnc.records import Axis, Machine, Probe

BASE = {"X": 0, "A": 0, "Y": 1, "B": 1, "Z": 2, "C": 2, "S": 2}


def machine_of(topology: str, rng: np.random.Generator | None = None) -> Machine:
    """topology → machine with axes along their base vectors, or, given a generator, inclined, reversed and anywhere in space."""
    workpiece, tool = topology[1:].split("f")
    tool = tool.removesuffix("(S)t")
    rotary = sorted(letter for letter in workpiece + tool if letter in "ABC")
    axes = [_axis(name, rng) for name in ("X", "Y", "Z", *rotary, "S")]
    return Machine(topology, topology, tuple(axes), tuple(reversed(workpiece)), (*tool, "S"), Probe(210.0, 3.0, 0.0007))


def _axis(name: str, rng: np.random.Generator | None) -> Axis:
    kind = "linear" if name in "XYZ" else "spindle" if name == "S" else "rotary"
    travel = None if kind == "spindle" else (-400.0, 400.0) if kind == "linear" else (-2.0, 2.0)
    direction, point = np.eye(3)[BASE[name]], np.zeros(3)
    if rng is not None:
        direction = direction * rng.choice([-1.0, 1.0])
        if rng.random() < 0.5:
            direction = direction + rng.uniform(-0.5, 0.5, 3)
            direction /= np.linalg.norm(direction)
        point = rng.uniform(-200, 200, 3) if kind != "linear" else point
    return Axis(name, kind, tuple(direction.tolist()), tuple(point.tolist()), travel)  # type: ignore[arg-type]


@st.composite
def topologies(draw: st.DrawFn) -> str:
    """→ three linear and up to two rotary axes in any order, the foundation anywhere among them."""
    rotary = draw(st.lists(st.sampled_from("ABC"), max_size=2, unique=True))
    letters = draw(st.permutations([*"XYZ", *rotary]))
    cut = draw(st.integers(0, len(letters)))
    return f"w{''.join(letters[:cut])}f{''.join(letters[cut:])}(S)t"


def random_positions(machine: Machine, rng: np.random.Generator, count: int) -> np.ndarray:
    """→ (count, k) mm rad, anywhere within the travels, the spindle turned anywhere."""
    travels = [axis.travel or (-np.pi, np.pi) for axis in machine.axes]
    low, high = np.array(travels).T
    return rng.uniform(low, high, (count, len(travels)))
