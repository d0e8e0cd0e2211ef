"""How often the quick check sees a change of the machine: predicted, and counted over simulated machines.

    OPENBLAS_NUM_THREADS=1 python benchmarks/check.py CELL [--runs N] [--nothing N] [--minutes M] [--size UM]
                                                      [--strategy FILE] [--full FILE] [--again N]

A check is designed for the cell, or is that of a strategy file of 'tango design --goal check -o FILE'. The full run that it rests
on is the cell's own strategy, or that of --full, and N checks right after it. The simulated machine of the cell's world.yaml is
measured in full, changes, and is checked, with the check's touches and new scatter. What a change does to the tool tip where
parts are made is worked out from the simulator's own transforms, the best placing of a rigid part and the tool's length taken
out, so that nothing of the design judges itself.

* nothing has changed (in --nothing runs): false alarms;
* random changes of locations, gains and backlashes, as large as --size at the worst place of the volume;
* the change that the check sees worst, of that size: about the stated power at the stated size, no more.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from sim_controller.simulate import simulate
from sim_controller.world import tip_in_table, true_machine
from tango_cnc.commands.check import positioning_feed
from tango_cnc.commands.design import gate_of
from tango_cnc.design import check, goals, propose, region, touching
from tango_cnc.design.changed import changed
from tango_cnc.design.measured import fitted
from tango_cnc.files import later, read_cell, read_strategy, read_world
from tango_cnc.plan import last_moves, plan
from tango_cnc.records import Array, Machine, Plan, Readings, World
from tango_cnc.touches import from_readings

FULL = 8  # full runs that the checks rest on in turn
USUAL = {"mm": 0.01, "rad": 2e-5, "": 2e-5}


def moved(machine: Machine, one: World, other: World, position: Array) -> float:
    """machine, two worlds, (m, k) poses → mm: the most that the tip moves, a rigid part's placing and the tool's length apart."""
    still = np.zeros_like(position)
    before, after = (tip_in_table(true_machine(machine, w), position, still) for w in (one, other))
    longer = replace(machine, probe=replace(machine.probe, length=machine.probe.length + 1.0))
    along = tip_in_table(true_machine(longer, World()), position, still) - tip_in_table(
        true_machine(machine, World()), position, still
    )
    placing = np.zeros((len(position), 3, 7))
    placing[:, :, :3] = np.eye(3)
    for i in range(3):
        placing[:, :, 3 + i] = np.cross(np.eye(3)[i], before) / 100
    placing[:, :, 6] = along
    change = (after - before).ravel()
    flat = placing.reshape(-1, 7)
    left = change - flat @ np.linalg.lstsq(flat, change, rcond=None)[0]
    largest = float(np.linalg.norm(left.reshape(-1, 3), axis=1).max())
    for sense in np.eye(position.shape[1]):  # what is lost by a reversal of one axis
        jump = [tip_in_table(true_machine(machine, w), position, sense[None] + still) for w in (one, other)]
        lost = (jump[1] - jump[0]) - (after - before)
        largest = max(largest, float(np.linalg.norm(lost, axis=1).max()))
    return largest


def measured(made: Plan, moved_by: Array, world: World, seed: int) -> Readings:
    """plan, its last motions, true machine, seed → readings."""
    return simulate(made.machine, made.artefact, made.strategy, world, seed=seed, moved=moved_by)


def main() -> int:
    """→ exit status: 1 when the stated power is not reached, or false alarms are too many."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("cell", type=Path)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--minutes", type=float)
    parser.add_argument("--size", type=float)
    parser.add_argument("--nothing", type=int)
    parser.add_argument("--strategy", type=Path)
    parser.add_argument("--full", type=Path)
    parser.add_argument("--again", type=int, default=0)
    given = parser.parse_args()
    cell, world = read_cell(given.cell), read_world(given.cell / "world.yaml")
    if given.full is not None:
        cell = replace(cell, strategy=read_strategy(given.full, cell.machine, cell.artefact))
    aim = goals.read("check")
    how = touching.touching(cell.strategy.approach, 0.3)
    terms = propose.usual_terms(aim, cell.terms)
    wish = propose.Wish(aim, given.minutes, terms, how.approach, feed=positioning_feed(cell), gate=gate_of(cell))
    ready = propose.setting(cell, wish)
    if given.strategy is None:
        found = propose.propose(ready)
    else:
        other = replace(cell, strategy=read_strategy(given.strategy, cell.machine, cell.artefact))
        found = propose.same_time(ready, other, plan(other, "leave-out"))
    whole = plan(cell, "leave-out")
    by, small_by = last_moves(whole), last_moves(found.plan)
    full = [measured(whole, by, world, 100 + n) for n in range(FULL)]
    for n in range(FULL):
        for k in range(given.again):
            full[n] = later(full[n], measured(found.plan, small_by, world, 1_000_000 + FULL * k + n))
    if given.again:
        other = replace(cell, strategy=found.cell.strategy)
        ready = propose.setting(cell, replace(wish, before=full[0]))
        found = propose.same_time(ready, other, plan(other, "leave-out"))
    sees = check.power(found, ready.lever)
    size = given.size or 1e3 * sees.size
    print(
        f"{len(found.rows)} touches in {found.seconds:.0f} s; stated: {1e3 * sees.size:.2f} µm seen with {check.POWER:.0%}",
        flush=True,
    )
    rng, choice = np.random.default_rng(1), ready.problem.choice
    touched = [replace(from_readings(cell.machine, cell.artefact, r), artefact=choice.cell.artefact) for r in full]
    known = [fitted(choice, touches) for touches in touched]
    position = region.poses(cell.machine, ready.where)
    own = [choice.selection.model.coefficients[j] for j in choice.twice if not check.is_stylus(choice, j)]
    told = check.seen(choice, found.information, ready.lever)
    flat = np.linalg.eigh(told.moved @ told.covariance @ np.swapaxes(told.moved, 1, 2))
    pose = int(np.argmax(flat.eigenvalues[:, -1]))
    worst = told.covariance @ told.moved[pose].T @ flat.eigenvectors[pose][:, -1]
    scale = np.array([choice.scale[j] for j in choice.twice if not check.is_stylus(choice, j)])
    good = True
    for name in ("nothing", "random", "worst"):
        seen, runs = 0, (given.nothing or given.runs) if name == "nothing" else given.runs
        for run in range(runs):
            step = (
                worst * scale
                if name == "worst"
                else rng.normal(size=len(own))
                * [USUAL.get(c.unit.split("/")[0] if c.unit in ("mm", "rad") else "", 2e-5) for c in own]
            )
            other = _changed(world, own, step)
            factor = 0.0 if name == "nothing" else size / 1e3 / moved(cell.machine, world, other, position)
            now = _changed(world, own, step * factor)
            stylus = {
                n: v + rng.normal(0, ready.wish.stylus)
                for n, v in {**dict.fromkeys(("EXt", "EYt", "EZt"), 0.0), **world.stylus}.items()
            }
            few = measured(found.plan, small_by, replace(now, stylus=stylus), 10_000 + run)
            before, was = full[run % FULL], known[run % FULL]
            seen += changed(choice, ready.lever, before, few, limit=sees.limit, was=was).changed
        share = seen / runs
        print(f"{name}: {size if name != 'nothing' else 0:.2f} µm, alarms {seen} of {runs} ({share:.1%})", flush=True)
        spread = 3 * np.sqrt(check.POWER * (1 - check.POWER) / runs)
        good &= share <= 0.03 if name == "nothing" else share >= check.POWER - spread
    return int(not good)


def _changed(world: World, own, step: Array) -> World:
    """world, coefficients, change of each → the world after it."""
    errors = dict(world.errors)
    for c, change in zip(own, step, strict=True):
        errors[c.name] = errors.get(c.name, 0.0) + float(change)
    return replace(world, errors=errors)


if __name__ == "__main__":
    sys.exit(main())
