"""A part with holes on five sides: its features, and as the true machine cuts it and a CMM finds it."""

from __future__ import annotations

import math
from copy import copy
from dataclasses import replace

import numpy as np

from sim_controller.world import nominal_machine, tip_in_table, true_machine
from tango_cnc.records import Array, Machine, World
from tests.support.truth import Truth

LENGTH, CMM = 150.0, 0.5e-3  # mm
ZERO = {"X": 0.0, "Y": 0.0, "Z": 60.0}
PLACES = {  # a block with holes on five sides
    "P1": {"X": -60.0, "Y": -60.0, "Z": 0.0, "A": 0.0, "C": 0.0},
    "P2": {"X": 60.0, "Y": -60.0, "Z": 0.0, "A": 0.0, "C": 0.0},
    "P3": {"X": 60.0, "Y": 60.0, "Z": 0.0, "A": 0.0, "C": 0.0},
    "P4": {"X": -60.0, "Y": 60.0, "Z": -5.0, "A": 0.0, "C": 0.0},
    "Q1": {"X": 40.0, "Y": 10.0, "Z": 50.0, "A": 60.0, "C": 0.0},
    "Q2": {"X": -40.0, "Y": 20.0, "Z": 50.0, "A": 60.0, "C": 90.0},
    "Q3": {"X": 10.0, "Y": 10.0, "Z": 50.0, "A": 60.0, "C": 170.0},
    "Q4": {"X": 0.0, "Y": -30.0, "Z": 40.0, "A": -45.0, "C": -90.0},
}
PAIRS = [
    ("P1", "P2"),
    ("P2", "P3"),
    ("P1", "P3"),
    ("P2", "P4"),
    ("P1", "Q1"),
    ("Q1", "Q2"),
    ("Q2", "Q3"),
    ("P3", "Q4"),
    ("Q1", "Q4"),
]


def checks() -> str:
    text = "point_um: 0.5\nplaces:\n"
    for name, place in PLACES.items():
        text += f"  {name}: {{{', '.join(f'{a}: {v:g}' for a, v in place.items())}}}\n"
    text += "checks:\n" + "".join(f"  - {{kind: distance, of: [{a}, {b}]}}\n" for a, b in PAIRS)
    text += "  - {kind: squareness, of: [P2, P1, P2, P3]}\n"
    text += "".join(f"  - {{name: {q}, kind: position, of: {q}, datum: [P1, P2, P3, P4]}}\n" for q in ("Q1", "Q2", "Q3", "Q4"))
    return text


def axes(machine: Machine, place: dict[str, float], length: float = LENGTH) -> Array:
    at = np.zeros(len(machine.names))
    for name in (*machine.linear, *machine.rotary):
        tilt = place.get("A", 0.0) if name == "B" and "A" not in machine.rotary else 0.0  # a table that tilts about Y
        value = place.get(name, tilt) + ZERO.get(name, 0.0) + (length if name == "Z" else 0.0)
        at[machine.column(name)] = value if name in machine.linear else math.radians(value)
    return at


def cut_and_measured(machine: Machine, world: World, rng: np.random.Generator) -> dict[str, float]:
    """Features as a CMM finds them on the part that the true machine cuts, µm against nominal."""
    tool = replace(machine, probe=replace(machine.probe, length=LENGTH))
    at = np.array([axes(machine, p) for p in [*PLACES.values(), {}]])
    still = np.zeros_like(at)
    true = tip_in_table(true_machine(tool, replace(world, stylus={})), at, still)
    return _found(tip_in_table(nominal_machine(tool), at, still), true, rng)


def cut_by(
    truth: Truth, machine: Machine, rng: np.random.Generator, length: float = LENGTH, against: float | None = None
) -> dict[str, float]:
    """As `cut_and_measured`, of a machine that shares nothing with product or simulator.

    `against`: the tool was measured against the probe, Z coming down, with this standard deviation (mm); it cuts the same way.
    """
    one = copy(truth)
    one.length, one.stylus = length, np.zeros(3)
    at = np.array([axes(machine, p, length) for p in [*PLACES.values(), {}]])
    pose = {n: at[:, machine.column(n)] for n in machine.names}
    still = {n: np.zeros(len(at)) for n in machine.names}
    if against is not None:
        one.stylus = np.array([0.0, 0.0, truth.stylus[2] + rng.normal(0, against)])
        still["Z"] = np.full(len(at), -1.0)
    true, nominal = (one.tool_in_table(pose, still, errors=e)[:, :3, 3] for e in (True, False))
    return _found(nominal, true, rng)


def _found(nominal: Array, true: Array, rng: np.random.Generator) -> dict[str, float]:
    """(n + 1, 3) mm, tip at every place and at the zero, as meant and as it is → features as a CMM finds them, µm."""
    meant = nominal[:-1]
    shift = true[-1] - nominal[-1]

    def cmm() -> dict[str, Array]:
        points = true[:-1] - shift + rng.normal(scale=CMM, size=meant.shape)
        return dict(zip(PLACES, points, strict=True))

    plan = dict(zip(PLACES, meant, strict=True))
    result = {}
    for a, b in PAIRS:
        point = cmm()
        result[f"distance {a} {b}"] = (math.dist(point[a], point[b]) - math.dist(plan[a], plan[b])) * 1e3
    point = cmm()

    def angle(p: dict[str, Array]) -> float:
        one, two = p["P1"] - p["P2"], p["P3"] - p["P2"]
        return math.acos(one @ two / np.linalg.norm(one) / np.linalg.norm(two))

    result["squareness P2 P1 P2 P3"] = (angle(point) - angle(plan)) * math.dist(plan["P2"], plan["P3"]) * 1e3
    for name in ("Q1", "Q2", "Q3", "Q4"):
        point = cmm()
        datum = ["P1", "P2", "P3", "P4"]
        a, b = np.array([point[d] for d in datum]), np.array([plan[d] for d in datum])
        u, _, v = np.linalg.svd((a - a.mean(0)).T @ (b - b.mean(0)))
        turn = v.T @ np.diag([1, 1, np.sign(np.linalg.det(v.T @ u.T))]) @ u.T
        found = turn @ (point[name] - a.mean(0)) + b.mean(0) - plan[name]
        for i, letter in enumerate("xyz"):
            result[f"{name} {letter}"] = float(found[i]) * 1e3
    return result
