"""Machines drawn at random, measured with scatter, compensated: what was promised is what the true machine has left."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.compensated import example, measured, truth, write

from sim_controller.compensation import read
from tango_cnc.compensate import propose
from tango_cnc.records import World


def drawn(world: World, seed: int) -> World:
    """A true machine with errors of the size of this one's."""
    rng = np.random.default_rng([23, seed])
    return replace(world, errors={name: value * rng.normal() for name, value in world.errors.items()}, seed=seed)


def kept(name: str, target: str, seeds: range, folder: Path) -> tuple[int, list[float]]:
    """Example, target, seeds → promises that were kept, µm left of every machine."""
    cell, world = example(name)
    within, left = 0, []
    for seed in seeds:
        true = drawn(world, seed)
        proposal = propose(measured(cell, true), target)
        control = read(write(proposal, folder / f"{name}{target}{seed}"), cell.machine)
        after, promise = truth(cell, true, proposal, control), proposal.fit.rms_after
        within += promise.low <= after <= promise.high
        left.append(after)
    return within, left


@pytest.mark.campaign
def test_promises_are_kept(tmp_path: Path) -> None:
    within, left = kept("trunnion", "siemens", range(10), tmp_path)
    print(f"trunnion, siemens: {within} of 10 within the promise, {np.mean(left):.2f} µm left")
    assert within >= 8


@pytest.mark.campaign
@pytest.mark.parametrize("target", ["linuxcnc", "isg_csv", "siemens", "fagor"])
@pytest.mark.parametrize("name", ["trunnion", "fork_head"])
def test_two_hundred_promises_are_kept(name: str, target: str, tmp_path: Path) -> None:
    within, left = kept(name, target, range(200), tmp_path)
    print(f"{name}, {target}: {within} of 200 within the promise, {np.mean(left):.2f} µm left on average")
    assert within >= 180
