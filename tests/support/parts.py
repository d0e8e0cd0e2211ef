"""A part with holes on five sides: its features, and as the true machine cuts it and a CMM finds it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sim_controller.world import nominal_machine, tip_in_table, true_machine
from tango_cnc.records import Array, Machine, World

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


def axes(machine: Machine, place: dict[str, float]) -> Array:
    at = np.zeros(len(machine.names))
    for name in (*machine.linear, *machine.rotary):
        value = place.get(name, 0.0) + ZERO.get(name, 0.0) + (LENGTH if name == "Z" else 0.0)
        at[machine.column(name)] = value if name in machine.linear else math.radians(value)
    return at


def cut_and_measured(machine: Machine, world: World, rng: np.random.Generator) -> dict[str, float]:
    """Features as a CMM finds them on the part that the true machine cuts, µm against nominal."""
    tool = replace(machine, probe=replace(machine.probe, length=LENGTH))
    at = np.array([axes(machine, p) for p in PLACES.values()])
    still = np.zeros_like(at)
    zero = axes(machine, {})[None]
    nominal, true = nominal_machine(tool), true_machine(tool, replace(world, stylus={}))
    meant = tip_in_table(nominal, at, still)
    shift = tip_in_table(true, zero, zero * 0) - tip_in_table(nominal, zero, zero * 0)

    def cmm() -> dict[str, Array]:
        points = tip_in_table(true, at, still) - shift + rng.normal(scale=CMM, size=at[:, :3].shape)
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
