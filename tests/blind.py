"""Blind trials of the diagnosis: effects that the simulated machine hides, drawn from seeds; only the readings are handed over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from sim_controller.simulate import simulate
from tango_cnc.diagnose import Diagnosis, diagnose
from tango_cnc.files import read_cell, read_world
from tango_cnc.records import Cell, InputError, Readings, World

EXAMPLE = Path(__file__).parent.parent / "examples" / "hu40t"
NOISE = 0.0007  # mm
# Causes that the thesis' strategy with the terms S3 can see, and that are a pattern and not a spread.
DRAWN = (
    "thermal_drift",
    "table_drift",
    "table_growth",
    "scale_drift",
    "ambient_cycle",
    "step",
    "move_length_memory",
    "probe_hysteresis",
    "first_touch",
    "encoder_harmonic",
    "rotary_radial",
    "rotary_axial",
    "rotary_tilt",
    "gravity_sag",
    "probe_lobing",
    "pretravel_anisotropy",
    "error_motion",
    "cyclic_error",
    "compensation_kink",
    "moving_mass",
    "chip",
)


@dataclass(frozen=True)
class Bench:
    """A cell, its world without effects, and what it reads without effects and noise."""

    cell: Cell
    world: World
    clean: Readings


def bench() -> Bench:
    cell = read_cell(EXAMPLE)
    world = replace(read_world(EXAMPLE / "world.yaml"), effects=(), noise=0.0)
    return Bench(cell, world, simulate(cell.machine, cell.artefact, cell.strategy, world))


def draw(b: Bench, cause: str, rng: np.random.Generator) -> dict[str, Any]:
    """cause → its settings in world.yaml, amplitude 1 µm, 1 µrad or 1 µm/m."""
    run = float(np.ptp(b.clean.time))
    count = len(b.clean)
    towards = [float(x) for x in rng.normal(size=3)]
    axis, rotary = str(rng.choice(["X", "Y", "Z"])), str(rng.choice(["B", "C"]))
    phase = float(rng.uniform(0, 360))
    tau = {"tau": run * float(rng.uniform(0.15, 1.5))}
    settings: dict[str, dict[str, Any]] = {
        "thermal_drift": {"direction": towards, **tau},
        "table_drift": {"direction": towards, **tau},
        "table_growth": {"amplitude": 1e-6, **tau},
        "scale_drift": {"axis": axis, "amplitude": 1e-6, **tau},
        "ambient_cycle": {"direction": towards, "period": run / float(rng.uniform(1.5, 8)), "phase": phase},
        "step": {
            "direction": towards,
            "at": int(rng.integers(40, count - 40)),
            "frame": str(rng.choice(["machine", "table"])),
        },
        "move_length_memory": {"axis": axis, "length": float(rng.uniform(10, 150))},
        "encoder_harmonic": {"axis": rotary, "order": int(rng.integers(1, 4)), "amplitude": 1e-6, "phase": phase},
        "rotary_radial": {"axis": "C", "direction": towards, "order": int(rng.integers(2, 4)), "phase": phase},
        "rotary_axial": {"axis": "C", "order": int(rng.integers(1, 4)), "phase": phase},
        "rotary_tilt": {"axis": "C", "direction": towards, "order": int(rng.integers(1, 4)), "amplitude": 1e-6, "phase": phase},
        "gravity_sag": {"axis": "B", "direction": [[0, 1, 0], [0, 0, 1]][int(rng.integers(2))]},
        "probe_lobing": {"order": int(rng.integers(2, 4)), "phase": phase},
        "error_motion": {
            "name": f"E{rng.choice(list('ABC'))}{axis}",
            "degree": int(rng.integers(1, 4)),
            "amplitude": 1e-6,
            "span": 200.0,
        },
        "cyclic_error": {"axis": axis, "period": float(rng.choice([10, 12, 16, 20, 25, 40])), "phase": phase},
        "moving_mass": {"name": f"E{rng.choice(list('ABC'))}{axis}", "amplitude": 1e-6, "span": 200.0},
    }
    effect = {"cause": cause, "amplitude": 1e-3, **settings.get(cause, {})}
    if cause == "moving_mass":
        effect["by"] = str(rng.choice([a for a in "XYZ" if a != axis]))
    if cause == "compensation_kink":
        at = b.clean.position[:, b.cell.machine.column(axis)]
        low, high = float(at.min()), float(at.max())
        middle = low + (high - low) * float(rng.uniform(0.3, 0.7))
        del effect["amplitude"]
        effect |= {"axis": axis, "nodes": [low - 1, middle, high + 1], "values": [0.0, 1e-3, 0.0]}
    if cause == "chip":
        facet = str(rng.choice([f for f in b.cell.artefact.facets if b.clean.facet.count(f) > 8]))
        rows = [i for i, f in enumerate(b.clean.facet) if f == facet]
        effect |= {"facet": facet, "at": rows[int(rng.integers(3, len(rows) - 4))] + 1}
    return effect


def scaled(effect: dict[str, Any], factor: float) -> dict[str, Any]:
    """effect, factor → the same effect, so many times larger."""
    if "values" in effect:
        return effect | {"values": [v * factor for v in effect["values"]]}
    return effect | {"amplitude": effect["amplitude"] * factor}


@dataclass(frozen=True)
class Visible:
    """An effect as large as wanted, and what it does to the gap of every touch."""

    effect: dict[str, Any]
    size: float


def visible(b: Bench, effect: dict[str, Any], peak: float, outside: np.ndarray, normal: np.ndarray) -> Visible | None:
    """effect, wanted visible peak in mm, projector (n, n), normals (n, 3) → scaled effect, None when it cannot be seen.

    The visible part is what the fitted model cannot absorb of the change of the readings.
    """
    world = replace(b.world, effects=(scaled(effect, 1.0),))
    read = simulate(b.cell.machine, b.cell.artefact, b.cell.strategy, world)
    columns = [b.cell.machine.column(a) for a in "XYZ"]
    change = np.sum((read.position - b.clean.position)[:, columns] * normal, axis=1)
    left = outside @ change
    whole = float(np.linalg.norm(change))
    if whole == 0 or np.linalg.norm(left) < 0.05 * whole:
        return None
    factor = peak / float(np.abs(left).max())
    return Visible(scaled(effect, factor), factor)


@dataclass(frozen=True)
class Eyes:
    """What decides how large an effect looks: projector outside the model, direction in which X Y Z read the gap."""

    outside: np.ndarray
    normal: np.ndarray


def eyes(b: Bench) -> Eyes:
    from tango_cnc.diagnose._gain import residual_maker
    from tango_cnc.estimate import estimate
    from tango_cnc.kinematics import Slot
    from tango_cnc.model import known, linearise

    e = estimate(b.cell.machine, b.cell.artefact, b.clean, b.cell.terms)
    _, jacobian = linearise(e.model, e.values)
    _, rows, uncertainty = known(e.model, e.values)
    maker = residual_maker(np.vstack([jacobian, rows * (NOISE / uncertainty)[:, None]]))
    touches = e.model.touches
    normal = np.column_stack([touches.seen.slots[Slot(a, "motion")] for a in "XYZ"])
    n = len(touches)
    return Eyes(maker[:n, :n], normal)


def trial(
    b: Bench,
    eye: Eyes,
    causes: Sequence[str],
    peak: tuple[float, float],
    seed: int,
    excluded: Sequence[str] = (),
    noise: str = "white",
) -> tuple[list[dict[str, Any]], Diagnosis] | None:
    """causes, range of visible peaks in mm, seed → effects hidden, diagnosis; None when the draw cannot be seen."""
    rng = np.random.default_rng([1234, seed])
    effects = []
    for cause in causes:
        for _ in range(6):
            try:
                found = visible(b, draw(b, cause, rng), float(rng.uniform(*peak)), eye.outside, eye.normal)
            except InputError:
                continue
            if found is not None:
                effects.append(found.effect)
                break
        else:
            return None
    disturbing: list[dict[str, Any]] = []
    if noise == "drift":
        disturbing = [{"cause": "random_walk", "amplitude": 0.002}]
    if noise == "outliers":
        disturbing = [{"cause": "outliers", "amplitude": 0.02, "rate": 0.02}]
    world = replace(b.world, effects=(*effects, *disturbing), noise=NOISE)
    read = simulate(b.cell.machine, b.cell.artefact, b.cell.strategy, world, seed=seed)
    return effects, diagnose(b.cell.machine, b.cell.artefact, read, b.cell.terms, excluded)


def names(d: Diagnosis) -> list[str]:
    """diagnosis → names found, each once."""
    return list(dict.fromkeys(f.cause for f in d.findings))
