"""A cell measured, compensated and measured again on the simulated machine; truth by the simulator alone."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from sim_controller.compensation import Applied, read
from sim_controller.simulate import simulate
from sim_controller.world import Control, nominal_machine, tip_in_table, true_machine
from tango_cnc.commands._compensate import text as text
from tango_cnc.compensate import Proposal, propose
from tango_cnc.compensate.fit import known
from tango_cnc.compensate.space import matrix, sample
from tango_cnc.estimate import Estimate, estimate
from tango_cnc.files import read_cell, read_world
from tango_cnc.records import Array, Cell, World

ROOT = Path(__file__).parent.parent.parent
STEEL = 11.5e-6  # per K


@cache
def example(name: str) -> tuple[Cell, World]:
    """Name of an example → its cell and its true machine."""
    folder = ROOT / "examples" / name
    return read_cell(folder), read_world(folder / "world.yaml")


def measured(cell: Cell, world: World, control: Control | None = None, seed: int | None = None) -> Estimate:
    """Cell, true machine, what the control compensates → estimate of what it measures."""
    readings = simulate(cell.machine, cell.artefact, cell.strategy, world, seed=seed, control=control)
    return estimate(cell.machine, cell.artefact, readings, cell.terms)


@cache
def first(name: str) -> Estimate:
    """Name of an example → estimate before anything is compensated, of touches without scatter."""
    cell, world = example(name)
    return measured(cell, replace(world, noise=0.0))


@cache
def proposed(name: str, target: str) -> Proposal:
    """Name of an example, control → what that estimate proposes for it. Nobody changes it; each stores it in an own folder."""
    return propose(first(name), target)


def write(proposal: Proposal, folder: Path, files: dict[str, str] | None = None) -> Path:
    """Proposal, folder, other texts → the folder as a control gets it."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in (files or proposal.files).items():
        (folder / name).write_text(content, encoding="utf-8", newline="")
    (folder / "compensation.json").write_text(json.dumps({"target": proposal.target}))
    return folder


@dataclass(frozen=True)
class Closed:
    """What a second measurement finds; µm rms."""

    proposal: Proposal
    control: Applied
    held_before: float  # what the target takes away by calculation
    held_after: float  # what is left of the true machine beside what was said beforehand
    true_before: float  # of the true machine, set-up taken out
    true_after: float

    @property
    def gone(self) -> float:
        """→ share of what the target can hold that is gone."""
        return 1 - self.held_after / self.held_before


def rms(v: Array) -> float:
    """(3n,) mm → µm."""
    return float(np.sqrt(3 * np.mean(v**2)) * 1e3)


def tips(cell: Cell, world: World, proposal: Proposal, control: Control | None, poses: int = 1024) -> Array:
    """→ (3n,) mm, errors of the true machine's tip over the volume of the proposal."""
    at = sample(cell.machine, proposal.request.limits, poses)
    position, direction = at.touches.position, at.touches.direction
    nominal = tip_in_table(nominal_machine(cell.machine), position, direction)
    true = true_machine(cell.machine, replace(world, stylus={}), control)
    return np.asarray(at.free((tip_in_table(true, position, direction) - nominal).reshape(-1, 1))[:, 0])


def truth(cell: Cell, world: World, proposal: Proposal, control: Control | None) -> float:
    """→ µm rms of the same, at poses that the proposal does not know."""
    return rms(tips(cell, world, proposal, control, 2048))


def closed(name: str, target: str, folder: Path, settings: Sequence[str] = (), made: Proposal | None = None) -> Closed:
    """Example, target, folder, settings, what is proposed with them if that is known → compensated and measured again."""
    cell, world = example(name)
    before = first(name)
    proposal = made or propose(before, target, settings)
    control = read(write(proposal, folder), cell.machine)
    at = sample(cell.machine, proposal.request.limits)
    taken = matrix(proposal.held, at) @ proposal.fit.change
    said = at.free(known(before, at).error(at).reshape(-1, 1))[:, 0] - taken  # what it cannot hold, known beforehand

    true = truth(cell, world, proposal, None), truth(cell, world, proposal, control)
    return Closed(proposal, control, rms(taken), rms(tips(cell, world, proposal, control) - said), *true)


def drawn(cell: Cell, world: World, seed: int) -> World:
    """A true machine with errors of the size of this one's; calibrated facets differ from their certificate as it states."""
    rng = np.random.default_rng([23, seed])
    errors = {name: value * rng.normal() for name, value in world.errors.items()}
    certified = {name: facet.uncertainty for name, facet in cell.artefact.facets.items() if facet.uncertainty is not None}
    facets = {name: world.facets.get(name, 0.0) + std * rng.normal() for name, std in certified.items()}
    return replace(world, errors=errors, facets={**world.facets, **facets}, seed=seed)


def disturbed(cell: Cell, world: World, seed: int) -> World:
    """The same machine with another stylus in the spindle and the table set up anew."""
    rng = np.random.default_rng([31, seed])
    shift, turn, stylus = rng.normal(size=3) * 0.05, rng.normal(size=3) * 1e-4, rng.normal(size=3) * 0.05
    facets = {
        n: world.facets.get(n, 0.0) + float((shift + np.cross(turn, f.point)) @ np.array(f.normal))
        for n, f in cell.artefact.facets.items()
    }
    old = dict(world.stylus)
    names = ("EXt", "EYt", "EZt")
    return replace(
        world,
        stylus={n: old.get(n, 0.0) + float(d) for n, d in zip(names, stylus, strict=True)},
        facets={**world.facets, **facets},
    )


def warmer(world: World, kelvin: float) -> World:
    """The same machine, all its ways longer as those of steel that is warmer."""
    return replace(world, errors=world.errors | {f"E{a}{a}1": world.errors.get(f"E{a}{a}1", 0.0) + STEEL * kelvin for a in "XYZ"})
