"""What all tables share: the printed figures, the stand-in geometry, and the simulated measurements."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import resources
from typing import Any

import numpy as np
import yaml

from ..files import read_artefact, read_machine
from ..records import Approach, Array, Artefact, Cell, Id, Indexation, Readings, Strategy, World

NOISE = 0.0006  # mm: section 4.6, repeatability of a touch, X Y Z 0.63 0.59 0.63 µm
SEED = 42

# Sections 4.6 and 7.3 measured what a touch suffers besides repeatability. Directions and phases are not printed: drawn.
DRIFT, TAU = 0.010, 1800.0  # mm, s: "approximately 10 µm for the first hour" (7.4), 12 µm in Figure 4-6; settled after half a test
WALK = 0.002  # mm after the whole test, each of x y z: not measured by the thesis, added by the independent program
SURFACE = {"z": 0.0003, "axis-parallel": 0.0009, "oblique": 0.0022}  # mm, Table 4-3: Z 0.30; X 0.89, Y 0.95; 2D 2.25 µm
LOBES = 0.004  # mm: two lobes, out of sphericity 8.1 µm (7.3), which is twice the amplitude
MINUTES = 161.0  # of 383 touches, as printed
# How the thesis' test spends its time is not printed. With its rapids the simulated machine would need half an hour, in which
# nothing drifts as far: it approaches so slowly that the test takes as long as printed.
FEED = 25.5  # mm/min
UNTOLD_TABLE = (
    "Stand-in for the table: a regular octagon, 400 mm across flats, with 26 facets where the thesis' Figure 4-2 shows them "
    "roughly; their coordinates are not printed. At some touches of Table 4-2 its facet faces away from the spindle; they are "
    "simulated all the same."
)


@dataclass(frozen=True)
class Row:
    """One line: what the thesis prints and what this program finds, one value a column; None where there is none.

    `other` is what a program independent of this one found; empty where none was asked.
    """

    name: str
    printed: tuple[float | None, ...]
    ours: tuple[float | None, ...]
    other: tuple[float | None, ...] = ()


@dataclass(frozen=True)
class Arrows:
    """Residual vectors on the table, for a picture like Figures 4-7 to 4-10."""

    figure: str
    panels: Mapping[str, tuple[Array, Array, Array, Any]]  # title: points (n, 3), normals (n, 3), residuals (n,) mm, groups (n,)


@dataclass(frozen=True)
class Table:
    """A table of the thesis beside this program's numbers."""

    number: str
    title: str
    unit: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    compared: str
    differs: str
    arrows: Arrows | None = None


@dataclass(frozen=True)
class Setting:
    """What stands in for the two machines of the thesis: `hu40t` (chapters 4, 6, 8; files beside this one), `huron` (chapter 5)."""

    huron: Cell
    huron_s2: Strategy
    seed: int = SEED
    cache: dict[str, Any] = field(default_factory=dict, compare=False, repr=False)

    @cached_property
    def hu40t(self) -> Cell:
        """→ the HU40T with its table and Table 4-2, scale bar included."""
        folder = resources.files(__package__)
        with resources.as_file(folder / "hu40t_machine.yaml") as machine, resources.as_file(folder / "hu40t_table.yaml") as table:
            whole = read_machine(machine), read_artefact(table)
            return Cell(machine.parent, *whole, self._strategy(whole[1]), ("S3",))

    @cached_property
    def printed(self) -> dict[str, Any]:
        """→ figures printed in the thesis."""
        text = resources.files(__package__).joinpath("printed.yaml").read_text(encoding="utf-8")
        found: dict[str, Any] = yaml.safe_load(text)
        return found

    @cached_property
    def indexations(self) -> tuple[Indexation, ...]:
        """→ Table 4-2, without the scale bar."""
        return tuple(_indexation(row) for row in self.printed["table_4_2"])

    def _strategy(self, artefact: Artefact) -> Strategy:
        """Table 4-2 with the scale bar touched once; at which indexation is not printed."""
        bar = tuple(f.id for f in artefact.facets.values() if f.ball is not None)
        at = 16  # B0 C0 with every facet
        rows = list(self.indexations)
        rows[at] = replace(rows[at], facets=(*bar, *rows[at].facets))
        return Strategy("thesis Table 4-2", Approach(10.0, 5.0, FEED), tuple(rows))

    @cached_property
    def surfaces(self) -> dict[str, tuple[Id, ...]]:
        """→ facets of the table by how they face: z, axis-parallel, oblique."""
        found: dict[str, list[Id]] = {kind: [] for kind in SURFACE}
        for facet in self.hu40t.artefact.facets.values():
            if facet.ball is None:
                straight = max(abs(facet.normal[0]), abs(facet.normal[1]))
                kind = "z" if abs(facet.normal[2]) > 0.9 else "axis-parallel" if straight > 0.9 else "oblique"
                found[kind].append(facet.id)
        return {kind: tuple(facets) for kind, facets in found.items()}

    @cached_property
    def disturbances(self) -> tuple[dict[str, Any], ...]:
        """→ drift, random walk, surface and lobing as effects of the simulated machine; direction and phase from the seed."""
        rng = np.random.default_rng([self.seed, 46])
        towards, phase = [float(x) for x in rng.normal(size=3)], float(rng.uniform(0, 360))
        return (
            {"cause": "thermal_drift", "amplitude": DRIFT, "direction": towards, "tau": TAU},
            {"cause": "random_walk", "amplitude": WALK / math.sqrt(MINUTES / 60)},
            *({"cause": "surface_form", "amplitude": SURFACE[kind], "facets": list(f)} for kind, f in self.surfaces.items()),
            {"cause": "probe_lobing", "amplitude": LOBES, "order": 2, "phase": phase},
        )

    def again(self, seed: int) -> Setting:
        """seed → the same with other noise, directions and phases, nothing of it computed yet."""
        return replace(self, seed=seed, cache={})

    def world(self, errors: Mapping[str, float], disturbed: bool = False, noise: float = NOISE) -> World:
        """coefficients (mm, rad) → a machine with them, a table as far from nominal as the thesis' (197 µm), a stylus."""
        rng = np.random.default_rng(self.seed)
        flat = [f.id for f in self.hu40t.artefact.facets.values() if f.ball is None]
        offset = rng.uniform(-1, 1, len(flat))
        offset *= 0.19725 / np.ptp(offset)
        facets = dict(zip(flat, offset.tolist(), strict=True))
        stylus = {"EXt": 0.011, "EYt": -0.003, "EZt": -0.069}
        return World(dict(errors), stylus, facets, noise, self.disturbances if disturbed else (), self.seed)

    def measured(self, world: World, strategy: Strategy | None = None) -> Readings:
        """world → readings of the simulated HU40T."""
        from sim_controller.simulate import simulate

        return simulate(self.hu40t.machine, self.hu40t.artefact, strategy or self.hu40t.strategy, world)


def _indexation(row: Mapping[str, Any]) -> Indexation:
    position = {name: math.radians(row[name]) for name in "SBC"}
    return Indexation(position, tuple(str(f) for f in row["facets"]))


def si(errors: Mapping[str, float]) -> dict[str, float]:
    """printed µm, µrad, µm/m by name → mm, rad, mm/mm."""
    return {name: value * (1e-3 if _length(name) else 1e-6) for name, value in errors.items()}


def _length(name: str) -> bool:
    """A length in µm: a translation that is constant (EX0C) or a backlash of a linear axis (EXXb)."""
    return name[1] in "XYZ" and (name[2] == "0" or (name.endswith("b") and name[2] in "XYZ"))


def people(name: str, value: float) -> float:
    """name, value in mm, rad, mm/mm → µm, µrad, µm/m."""
    return value * (1e3 if _length(name) else 1e6)


def um(values: Sequence[float]) -> tuple[float, ...]:
    """mm → µm."""
    return tuple(value * 1e3 for value in values)
